using System;
using System.Collections.Generic;
using System.Diagnostics;
using System.Threading;
using System.Threading.Tasks;
using Sightline.V1;

namespace Sightline.Client {

/// <summary>How a LiveCamera reaches its daemons, and how long it waits. GiveUpAfter does not count.</summary>
public sealed class LiveOptions {
    /// <summary>Scene, SceneFile, Uploads, OpenTimeout, OnResync and Connect. OnResync is called on a thread of the pool.</summary>
    public CameraOptions Camera { get; set; } = new CameraOptions();
    /// <summary>Tick waits at most so long for its answer; zero: not at all.</summary>
    public TimeSpan Wait { get; set; } = TimeSpan.FromSeconds(0.1);
    /// <summary>Without an answer for so long, the camera follows the targets by itself. It must be longer than the way to the daemon and back.</summary>
    public TimeSpan FallbackAfter { get; set; } = TimeSpan.FromSeconds(0.3);
    /// <summary>So long the way back takes, in game time.</summary>
    public TimeSpan Blend { get; set; } = TimeSpan.FromSeconds(0.5);
    /// <summary>Without an answer for so long, the stream is given up for a new one.</summary>
    public TimeSpan ReplyTimeout { get; set; } = TimeSpan.FromSeconds(2);
    /// <summary>So long the last ticks may take.</summary>
    public TimeSpan CloseAfter { get; set; } = TimeSpan.FromSeconds(1);
}

/// <summary>The camera to draw now.</summary>
public sealed class LiveView {
    /// <summary>Pose and field of view. Cut: it jumped; reset what smooths over frames.</summary>
    public Sample Shown { get; internal set; }
    /// <summary>Game time since the tick that the newest reply covers; 0: this one.</summary>
    public double AgeS { get; internal set; }
    /// <summary>Where the pose comes from.</summary>
    public LiveSource Source { get; internal set; }
    /// <summary>Number of the newest tick; the first is 1.</summary>
    public ulong Sequence { get; internal set; }
    /// <summary>The newest one; null: there is none so far.</summary>
    public CameraReply Reply { get; internal set; }
    /// <summary>Of ticks, since the former view; Sequence says which.</summary>
    public IReadOnlyList<TickError> Refusals { get; internal set; }
    /// <summary>Why no daemon answers; null: one does.</summary>
    public Exception Trouble { get; internal set; }
}

/// <summary>A session that keeps targets in view, for a game loop that must not wait. It opens at once, and reaches the daemon on the thread pool, for
/// ever if need be. A daemon that can never accept the opening is an error, which Tick throws. One that is away is not. One call at a time.</summary>
public sealed class LiveCamera : IDisposable {
    static readonly TimeSpan LongestPause = TimeSpan.FromSeconds(0.25);  // between attempts, so that a daemon that is back is found soon

    // constant after construction
    readonly IReadOnlyList<string> addresses;
    readonly OpenSession opening;
    readonly LiveOptions options;
    readonly CameraOptions cameraOptions;
    readonly Task worker;
    readonly CancellationTokenSource stopping = new CancellationTokenSource();
    readonly SemaphoreSlim more = new SemaphoreSlim(0);  // one for each tick, and one for the end

    readonly object gate = new object();  // guards what follows
    readonly Display display;
    readonly WaitingTicks waiting = new WaitingTicks();
    readonly Stopwatch silence = Stopwatch.StartNew();  // counts while ticks are unanswered
    volatile SightlineCamera camera;
    ulong sequence, answered;  // the newest tick, and the newest one that was answered
    double? firstS;
    List<TickError> refusals = new List<TickError>();
    Exception fatal, trouble;

    /// <summary>Starts a session. addresses: for example "http://127.0.0.1:50151". Throws what File.ReadAllBytes throws for Camera.SceneFile.</summary>
    public LiveCamera(IReadOnlyList<string> addresses, OpenSession opening, LiveOptions options = null) {
        this.addresses = addresses;
        this.opening = opening.Clone();
        this.options = options ?? new LiveOptions();
        var given = this.options.Camera;
        cameraOptions = new CameraOptions {
            GiveUpAfter = TimeSpan.Zero, ReplyTimeout = this.options.ReplyTimeout, OpenTimeout = given.OpenTimeout, Scene = given.ReadScene(),
            Uploads = given.Uploads, OnResync = given.OnResync, Connect = given.Connect
        };
        display = new Display(this.opening, this.options.Blend.TotalSeconds);
        worker = Task.Run(WorkAsync);
    }

    /// <summary>What the daemon said when it opened the session, the last time that one did; null: none did so far.</summary>
    public SessionOpened Opened => camera?.Opened;
    /// <summary>As SightlineCamera.Resyncs.</summary>
    public int Resyncs => camera == null ? 0 : camera.Resyncs;
    /// <summary>As SightlineCamera.Resumes.</summary>
    public int Resumes => camera == null ? 0 : camera.Resumes;

    /// <summary>Tells the daemon what has changed, and returns the camera to draw. It waits for the answer at most LiveOptions.Wait, and not at all while
    /// an earlier tick is unanswered. The camera numbers ticks. Throws QueueFullException, and FailedException for an opening that no daemon accepts.</summary>
    public LiveView Tick(Tick message) {
        if (message.StepControl != null && message.StepControl.MergeIntoNext)
            throw new ArgumentException("a camera waits for a reply to each tick", "message.StepControl.MergeIntoNext");
        if (message.Sequence != 0) throw new ArgumentException("a LiveCamera numbers its ticks", "message.Sequence");
        if (!Finite.Is(message.TimeS)) throw new ArgumentException("must be finite", "message.TimeS");
        lock (gate) {
            bool idle = answered == sequence;
            Take(message.Clone(), idle);
            if (idle) WaitForAnswer();
            Check();
            var view = View(message.TimeS, null, idle ? sequence + 1 : sequence);
            if (display.Follows) waiting.Suggest(display.Observed());
            return view;
        }
    }

    /// <summary>The camera to draw between ticks, at a game time near the newest tick's. Never waits.</summary>
    /// <param name="drawn">Positions of targets at that time, by id.</param>
    public LiveView Sample(double timeS, IReadOnlyDictionary<ulong, Double3> drawn = null) {
        lock (gate) {
            Check();
            return View(timeS, drawn, sequence + 1);
        }
    }

    /// <summary>Ends the session. Ticks that wait are sent before, if a daemon takes them within LiveOptions.CloseAfter. Never throws.</summary>
    public void Dispose() {
        stopping.Cancel();
        more.Release();
        try {
            worker.Wait(options.CloseAfter);
        } catch (AggregateException) { }  // the session is over in any case
        camera?.Dispose();
    }

    void Check() {
        if (fatal != null) throw fatal;
        if (stopping.IsCancellationRequested) throw new ObjectDisposedException("LiveCamera");
    }

    void Take(Tick tick, bool idle) {
        Check();
        tick.Sequence = sequence + 1;
        waiting.Add(tick);
        display.TakeTick(tick);
        if (idle) silence.Restart();
        sequence = tick.Sequence;
        firstS = firstS ?? tick.TimeS;
        more.Release();
    }

    void WaitForAnswer() {
        var waited = Stopwatch.StartNew();
        while (answered != sequence && fatal == null) {
            var left = options.Wait - waited.Elapsed;
            if (left <= TimeSpan.Zero) return;
            Monitor.Wait(gate, left);
        }
    }

    LiveView View(double timeS, IReadOnlyDictionary<ulong, Double3> drawn, ulong countsFrom) {
        if (answered != sequence && silence.Elapsed >= options.FallbackAfter) display.Follow(countsFrom);
        LiveSource source;
        var shown = display.Show(timeS, drawn, out source);
        var reply = display.Newest;
        if (source == LiveSource.Predicted && reply != null && reply.Sequence == sequence) source = LiveSource.Reply;
        double coveredS = reply != null ? reply.TimeS : firstS ?? timeS;
        var view = new LiveView {
            Shown = shown, AgeS = Math.Max(timeS - coveredS, 0), Source = source, Sequence = sequence, Reply = reply, Refusals = refusals, Trouble = trouble
        };
        refusals = new List<TickError>();
        return view;
    }

    // On the thread pool.

    async Task WorkAsync() {
        try {
            if (!await TryForEverAsync(null)) return;
            for (var ticks = await NextAsync(); ticks != null; ticks = await NextAsync())
                foreach (var tick in ticks)
                    if (!await TryForEverAsync(tick)) return;
            await camera.CloseAsync();
        } catch (Exception error) {
            lock (gate) {
                fatal = error;
                Monitor.PulseAll(gate);
            }
        }
    }

    // Null: the camera was closed, and no tick is left.
    async Task<List<Tick>> NextAsync() {
        while (true) {
            lock (gate) {
                if (waiting.Count > 0) return waiting.Take();
                if (stopping.IsCancellationRequested) return null;
            }
            await more.WaitAsync();
        }
    }

    // Opens the session if need be, and gets the answer to the tick. False: the camera was closed.
    async Task<bool> TryForEverAsync(Tick tick) {
        for (var pause = TimeSpan.Zero;; pause = SightlineCamera.Longer(pause)) {
            if (pause > TimeSpan.Zero && !await PauseAsync(pause)) return false;
            string stream = StreamName;
            try {
                if (camera == null) camera = await SightlineCamera.OpenAsync(addresses, opening, cameraOptions);
                if (tick != null) Answer(tick, await camera.TickAsync(tick), null);
                return true;
            } catch (RefusedException refused) {
                Answer(tick, null, refused.Error);
                return true;
            } catch (FailedException failed) when (camera != null || failed.IsLost(opening: true)) {
                if (tick != null && StreamName != stream && !failed.IsLost(opening: false)) {
                    Answer(tick, null, failed.AsRefusal(tick.Sequence));  // it would end the call of the next stream too
                    return true;
                }
                lock (gate) trouble = failed;
            }
        }
    }

    // Another one after each opening and each resumption. A session that cannot be resumed goes on under another id.
    string StreamName => Opened?.SessionId + " " + Resumes;

    // False: the camera was closed.
    async Task<bool> PauseAsync(TimeSpan pause) {
        try {
            await Task.Delay(pause < LongestPause ? pause : LongestPause, stopping.Token);
        } catch (OperationCanceledException) { }
        return !stopping.IsCancellationRequested;
    }

    void Answer(Tick tick, CameraReply reply, TickError refusal) {
        lock (gate) {
            answered = tick.Sequence;
            trouble = null;
            silence.Restart();
            if (reply != null) display.TakeReply(reply);
            if (refusal != null && refusals.Count < WaitingTicks.MostWaiting) refusals.Add(refusal);
            Monitor.PulseAll(gate);
        }
    }
}

}  // namespace Sightline.Client
