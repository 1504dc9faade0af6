using System;
using System.Collections.Generic;
using System.Diagnostics;
using System.IO;
using System.Threading.Tasks;
using Google.Protobuf;
using Grpc.Core;
using Grpc.Net.Client;
using Sightline.V1;

namespace Sightline.Client {

/// <summary>How a camera reaches its daemons and what it does when one is lost.</summary>
public sealed class CameraOptions {
    /// <summary>How long a tick waits for a daemon that takes the session over; zero: a lost session is an error at once.</summary>
    public TimeSpan GiveUpAfter { get; set; } = TimeSpan.FromSeconds(30);
    /// <summary>A daemon that answers nothing for so long is taken for lost.</summary>
    public TimeSpan ReplyTimeout { get; set; } = TimeSpan.FromSeconds(5);
    /// <summary>The same for an upload, and for the opening, for which the daemon loads the scene.</summary>
    public TimeSpan OpenTimeout { get; set; } = TimeSpan.FromSeconds(30);
    /// <summary>The client's own scene file (.glb, or .gltf without other files): each daemon gets it, and its hash goes into OpenSession.Scene.</summary>
    public byte[] Scene { get; set; }
    /// <summary>The same by its path.</summary>
    public string SceneFile { get; set; }
    /// <summary>Files that the opening or a tick names by their hashes; a daemon that does not have one gets it.</summary>
    public IReadOnlyList<byte[]> Uploads { get; set; } = new byte[0][];
    /// <summary>Called with the reason after the session was opened again.</summary>
    public Action<string> OnResync { get; set; }
    /// <summary>Makes the channel to an address. Unity needs a handler of its own: see README.md. Default: GrpcChannel.ForAddress.</summary>
    public Func<string, ChannelBase> Connect { get; set; } =
        address => GrpcChannel.ForAddress(address, new GrpcChannelOptions { MaxReceiveMessageSize = 64 << 20 });

    internal byte[] ReadScene() { return SceneFile == null ? Scene : File.ReadAllBytes(SceneFile); }
}

/// <summary>A session that keeps targets in view, tick by tick. One call at a time.
/// When the stream breaks, the next tick goes on with the session in a new stream: the daemon keeps it for a while (its flag --resume-grace-s), and the
/// replies are those of an unbroken stream. When the daemon does not keep it, goes away, or says Drain, the next tick opens the session again, in the
/// daemon that answers then, and returns its reply: at the camera's last pose, with the scene, targets, settings, limits and lens as they were. Several
/// addresses are tried in turn.</summary>
public sealed class SightlineCamera : IDisposable {
    readonly IReadOnlyList<string> addresses;
    readonly CameraOptions options;
    readonly byte[] scene;  // the client's own; null: there is none
    readonly Snapshot snapshot;
    readonly Random random = new Random();
    ControlStream stream;
    // A daemon resumes a session at once, or not at all.
    static readonly TimeSpan LongestResume = TimeSpan.FromSeconds(2);

    ulong sequence;
    int address;
    ByteString token = ByteString.Empty;  // of the session in the daemon at `address`, also while it is lost; empty: it cannot be resumed
    ulong answered;                       // the newest tick of this session that was answered

    /// <summary>What the daemon said when it opened the session, the last time that one did.</summary>
    public SessionOpened Opened { get; private set; }
    /// <summary>How many times the session was opened again, in another daemon or in the same one.</summary>
    public int Resyncs { get; private set; }
    /// <summary>How many times it went on in another stream without that.</summary>
    public int Resumes { get; private set; }

    SightlineCamera(IReadOnlyList<string> addresses, OpenSession opening, CameraOptions options) {
        this.addresses = addresses;
        this.options = options ?? new CameraOptions();
        scene = this.options.ReadScene();
        snapshot = new Snapshot(opening);
    }

    /// <summary>Opens a session in the first daemon that takes it. Throws FailedException, and what File.ReadAllBytes throws.</summary>
    /// <param name="addresses">For example "http://127.0.0.1:50151".</param>
    public static async Task<SightlineCamera> OpenAsync(IReadOnlyList<string> addresses, OpenSession opening, CameraOptions options = null) {
        var camera = new SightlineCamera(addresses, opening, options);
        for (int attempt = 1;; ++attempt) {
            try {
                await camera.OpenStreamAsync();
                return camera;
            } catch (FailedException error) {
                camera.NextAddress();
                if (!error.IsLost(opening: true) || attempt == addresses.Count) throw;
            }
        }
    }

    /// <summary>Tells the daemon what has changed, and returns where the camera goes. Ticks whose sequence is 0 are numbered. Throws RefusedException when
    /// the daemon refuses the tick, and FailedException when no daemon takes a lost session over in time.</summary>
    public async Task<CameraReply> TickAsync(Tick tick) {
        if (tick.StepControl != null && tick.StepControl.MergeIntoNext)
            throw new ArgumentException("a camera waits for a reply to each tick", "tick.StepControl.MergeIntoNext");
        var numbered = tick.Clone();
        if (numbered.Sequence == 0) numbered.Sequence = sequence + 1;
        sequence = Math.Max(sequence, numbered.Sequence);
        var waited = Stopwatch.StartNew();
        string reason = null;
        bool reopened = false;
        ControlResponse response = null;
        for (var pause = TimeSpan.Zero; response == null; pause = Longer(pause)) {
            await Task.Delay(Shaken(pause));
            if (stream != null && stream.Drained != null) {
                reason = stream.Drained;
                Leave();
            }
            bool wasOpen = stream != null, taken = false;
            try {
                if (stream == null && token.Length > 0) taken = await ResumeAsync(numbered.Sequence);
                if (stream == null) {
                    await OpenStreamAsync();
                    reopened = wasOpen = true;
                    await TellPastAsync(numbered);
                }
                wasOpen = true;
                response = await AskAsync(numbered, taken);
            } catch (FailedException error) {
                Leave();
                if (!error.IsLost(opening: !wasOpen) || waited.Elapsed >= options.GiveUpAfter) throw;
                reason = reason ?? error.Message;
            }
        }
        answered = numbered.Sequence;
        if (reopened) {
            ++Resyncs;
            options.OnResync?.Invoke(reason ?? "the former tick lost the session");
        }
        return Take(numbered, response);
    }

    /// <summary>Ends the session in order. Throws FailedException if it was lost meanwhile.</summary>
    public async Task CloseAsync() {
        var last = stream;
        stream = null;
        if (last == null) return;
        using (last) await last.FinishAsync(options.ReplyTimeout);
    }

    /// <summary>Cuts the session off if it was not closed.</summary>
    public void Dispose() {
        stream?.Dispose();
        stream = null;
    }

    async Task OpenStreamAsync() {
        try {
            // The opening needs the hash, which comes with the upload.
            if (scene != null && snapshot.SceneHash.Length == 0) await UploadAsync(new byte[0][]);
            Opened = await TryOpenAsync();
        } catch (FailedException error) when (LacksScene(error) && (scene != null || options.Uploads.Count > 0)) {
            await UploadAsync(options.Uploads);
            Opened = await TryOpenAsync();
        }
    }

    // The client's own scene and others, in a stream that opens no session, since the daemon does not wait long for an opening.
    async Task UploadAsync(IReadOnlyList<byte[]> others) {
        using (var apart = new ControlStream(options.Connect(addresses[address]))) {
            if (scene != null) snapshot.SceneHash = (await apart.UploadAsync(scene, options.OpenTimeout)).Hash;
            foreach (var other in others) await apart.UploadAsync(other, options.OpenTimeout);
        }
    }

    async Task<SessionOpened> TryOpenAsync() {
        var first = new ControlRequest { Open = snapshot.Opening() };
        first.Open.Resumable = true;
        var opened = await StartAsync(first, options.OpenTimeout);
        token = opened.ResumeToken;
        answered = 0;
        return opened;
    }

    // A new stream, and the answer to its first message.
    async Task<SessionOpened> StartAsync(ControlRequest first, TimeSpan timeout) {
        var opening = new ControlStream(options.Connect(addresses[address]));
        try {
            await opening.SendAsync(first, timeout);
            ControlResponse response;
            do response = await opening.ReceiveAsync(timeout);
            while (response.MessageCase != ControlResponse.MessageOneofCase.Opened);
            stream = opening;
            return response.Opened;
        } catch (FailedException) {
            opening.Dispose();
            throw;
        }
    }

    // Goes on with the lost session, if the daemon keeps it. True: the daemon has taken the tick already, and its answer follows. Without a stream
    // afterwards, a new session must be opened.
    async Task<bool> ResumeAsync(ulong next) {
        var first = new ControlRequest { Resume = new ResumeSession { Token = token, AnsweredSequence = answered } };
        try {
            var timeout = options.ReplyTimeout < LongestResume ? options.ReplyTimeout : LongestResume;
            ulong newest = (await StartAsync(first, timeout)).NewestSequence;
            if (newest == next || newest == answered) {
                ++Resumes;
                return newest == next;
            }
            await CloseAsync();  // the session lacks ticks that a former stream lost
        } catch (FailedException error) when (!error.IsLost(opening: true) || addresses.Count > 1) {
            if (error.IsLost(opening: true)) NextAddress();
        }
        token = ByteString.Empty;
        return false;
    }

    static bool LacksScene(FailedException error) {
        return error.Code == StatusCode.NotFound && error.Names("scene");
    }

    // What a new session begins with after its opening, so that `next` can follow.
    async Task TellPastAsync(Tick next) {
        var ticks = snapshot.Ticks(next.Sequence);
        if (next.Delta != null && next.Delta.HasBaseRevision) {
            next.Delta.BaseRevision = Opened.MirrorRevision;
            foreach (var tick in ticks)
                if (tick.Delta != null) ++next.Delta.BaseRevision;
        }
        foreach (var tick in ticks) await stream.SendAsync(new ControlRequest { Tick = tick }, options.ReplyTimeout);
    }

    async Task<ControlResponse> AskAsync(Tick tick, bool taken) {
        if (!taken) await stream.SendAsync(new ControlRequest { Tick = tick }, options.ReplyTimeout);
        while (true) {
            var response = await stream.ReceiveAsync(options.ReplyTimeout);
            bool isReply = response.MessageCase == ControlResponse.MessageOneofCase.Camera && response.Camera.Sequence == tick.Sequence;
            if (isReply || response.MessageCase == ControlResponse.MessageOneofCase.TickError) return response;
        }
    }

    CameraReply Take(Tick tick, ControlResponse response) {
        if (response.MessageCase == ControlResponse.MessageOneofCase.TickError) {
            var refused = new RefusedException(response.TickError);
            if (refused.WasApplied) snapshot.Apply(tick);
            throw refused;
        }
        snapshot.Apply(tick);
        snapshot.TakeReply(response.Camera);
        return response.Camera;
    }

    // Gives the stream up. The next one goes to the next address, unless the session can be resumed.
    void Leave() {
        if (stream != null && stream.Drained != null) token = ByteString.Empty;
        Dispose();
        if (token.Length == 0) NextAddress();
    }

    void NextAddress() { address = (address + 1) % addresses.Count; }

    internal static TimeSpan Longer(TimeSpan pause) {
        return TimeSpan.FromSeconds(pause == TimeSpan.Zero ? 0.05 : Math.Min(2 * pause.TotalSeconds, 1.0));
    }

    // Random, so that the cameras of a lost daemon do not all come at once.
    TimeSpan Shaken(TimeSpan pause) { return TimeSpan.FromSeconds(pause.TotalSeconds * (0.5 + 0.5 * random.NextDouble())); }
}

}  // namespace Sightline.Client
