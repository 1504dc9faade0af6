using System;
using System.Collections.Generic;
using System.Diagnostics;
using System.Threading.Tasks;
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
    /// <summary>The same for the opening, for which the daemon loads the scene.</summary>
    public TimeSpan OpenTimeout { get; set; } = TimeSpan.FromSeconds(30);
    /// <summary>The scene files that SceneRef.Hash names; a daemon that does not have one gets it.</summary>
    public IReadOnlyList<byte[]> Uploads { get; set; } = new byte[0][];
    /// <summary>Called with the reason after the session has gone on in another daemon.</summary>
    public Action<string> OnResync { get; set; }
    /// <summary>Makes the channel to an address. Unity needs a handler of its own: see README.md. Default: GrpcChannel.ForAddress.</summary>
    public Func<string, ChannelBase> Connect { get; set; } =
        address => GrpcChannel.ForAddress(address, new GrpcChannelOptions { MaxReceiveMessageSize = 64 << 20 });
}

/// <summary>A session that keeps targets in view, tick by tick. One call at a time.
/// When the stream breaks, when the daemon goes away, or when it says Drain, the next tick opens the session again, in the daemon that answers then, and
/// returns its reply: at the camera's last pose, with the scene, targets, settings, limits and lens as they were. Several addresses are tried in
/// turn.</summary>
public sealed class SightlineCamera : IDisposable {
    readonly IReadOnlyList<string> addresses;
    readonly CameraOptions options;
    readonly Snapshot snapshot;
    readonly Random random = new Random();
    ControlStream stream;
    ulong sequence;
    int address;

    /// <summary>What the daemon said when it opened the session, the last time that one did.</summary>
    public SessionOpened Opened { get; private set; }
    /// <summary>How many times the session went on in another daemon, or in the same one again.</summary>
    public int Resyncs { get; private set; }

    SightlineCamera(IReadOnlyList<string> addresses, OpenSession opening, CameraOptions options) {
        this.addresses = addresses;
        this.options = options ?? new CameraOptions();
        snapshot = new Snapshot(opening);
    }

    /// <summary>Opens a session in the first daemon that takes it. Throws FailedException.</summary>
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
        ControlResponse response = null;
        for (var pause = TimeSpan.Zero; response == null; pause = Longer(pause)) {
            await Task.Delay(Shaken(pause));
            if (stream != null && stream.Drained != null) {
                reason = stream.Drained;
                Leave();
            }
            bool wasOpen = stream != null;
            try {
                if (!wasOpen) {
                    await OpenStreamAsync();
                    wasOpen = true;
                    await ResumeAsync(numbered);
                }
                response = await AskAsync(numbered);
            } catch (FailedException error) {
                Leave();
                if (!error.IsLost(opening: !wasOpen) || waited.Elapsed >= options.GiveUpAfter) throw;
                reason = reason ?? error.Message;
            }
        }
        if (reason != null) {
            ++Resyncs;
            options.OnResync?.Invoke(reason);
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
            Opened = await TryOpenAsync();
        } catch (FailedException error) when (LacksScene(error) && options.Uploads.Count > 0) {
            using (var uploads = new ControlStream(options.Connect(addresses[address])))
                foreach (var scene in options.Uploads) await uploads.UploadAsync(scene, options.OpenTimeout);
            Opened = await TryOpenAsync();
        }
    }

    async Task<SessionOpened> TryOpenAsync() {
        var opening = new ControlStream(options.Connect(addresses[address]));
        try {
            await opening.SendAsync(new ControlRequest { Open = snapshot.Opening() }, options.OpenTimeout);
            ControlResponse response;
            do response = await opening.ReceiveAsync(options.OpenTimeout);
            while (response.MessageCase != ControlResponse.MessageOneofCase.Opened);
            stream = opening;
            return response.Opened;
        } catch (FailedException) {
            opening.Dispose();
            throw;
        }
    }

    static bool LacksScene(FailedException error) {
        if (error.Code != StatusCode.NotFound) return false;
        foreach (var violation in error.Violations)
            if (violation.Field.Contains("scene")) return true;
        return false;
    }

    // The messages with which a new stream begins after its opening, so that `next` can follow.
    async Task ResumeAsync(Tick next) {
        var ticks = snapshot.Ticks(next.Sequence);
        if (next.Delta != null && next.Delta.HasBaseRevision) {
            next.Delta.BaseRevision = Opened.MirrorRevision;
            foreach (var tick in ticks)
                if (tick.Delta != null) ++next.Delta.BaseRevision;
        }
        foreach (var tick in ticks) await stream.SendAsync(new ControlRequest { Tick = tick }, options.ReplyTimeout);
    }

    async Task<ControlResponse> AskAsync(Tick tick) {
        await stream.SendAsync(new ControlRequest { Tick = tick }, options.ReplyTimeout);
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

    // Gives the stream up; the next one goes to the next address.
    void Leave() {
        Dispose();
        NextAddress();
    }

    void NextAddress() { address = (address + 1) % addresses.Count; }

    static TimeSpan Longer(TimeSpan pause) {
        return TimeSpan.FromSeconds(pause == TimeSpan.Zero ? 0.05 : Math.Min(2 * pause.TotalSeconds, 1.0));
    }

    // Random, so that the cameras of a lost daemon do not all come at once.
    TimeSpan Shaken(TimeSpan pause) { return TimeSpan.FromSeconds(pause.TotalSeconds * (0.5 + 0.5 * random.NextDouble())); }
}

}  // namespace Sightline.Client
