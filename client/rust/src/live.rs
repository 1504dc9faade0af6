//! A camera for a game loop: no call waits for long, with or without a daemon.
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::Notify;
use tokio::task::JoinHandle;

use crate::camera::{jitter, longer, Camera, Options};
use crate::display::{Display, Source};
use crate::errors::{Error, Failed};
use crate::following::Drawn;
use crate::sampler::Sample;
use crate::v1::{CameraReply, OpenSession, SessionOpened, Tick, TickError};
use crate::waiting::{WaitingTicks, MOST_WAITING};

// Between attempts, so that a daemon that is back is found soon.
const LONGEST_PAUSE: Duration = Duration::from_millis(250);

/// How a [`LiveCamera`] reaches its daemons, and how long it waits.
#[derive(Debug, Clone)]
pub struct LiveOptions {
    /// `give_up_after` and `reply_timeout` do not count.
    pub camera: Options,
    /// `tick` waits at most so long for its answer.
    pub wait: Duration,
    /// Without an answer for so long, the camera follows the targets by itself. It must be longer than the way to the daemon and back.
    pub fallback_after: Duration,
    /// So long the way back takes, in game time.
    pub blend: Duration,
    /// Without an answer for so long, the stream is given up for a new one.
    pub reply_timeout: Duration,
    /// So long the last ticks may take.
    pub close_after: Duration,
}

impl Default for LiveOptions {
    fn default() -> Self {
        let ms = Duration::from_millis;
        LiveOptions { camera: Options::default(), wait: ms(100), fallback_after: ms(300), blend: ms(500), reply_timeout: ms(2000), close_after: ms(1000) }
    }
}

/// The camera to draw now.
#[derive(Debug, Clone)]
pub struct LiveView {
    pub shown: Sample,
    /// Game time since the tick that the newest reply covers; 0: this one.
    pub age_s: f64,
    pub source: Source,
    /// Number of the newest tick; the first is 1.
    pub sequence: u64,
    /// The newest one; none: there is none so far.
    pub reply: Option<CameraReply>,
    /// Of ticks, since the former view; `sequence` says which.
    pub refusals: Vec<TickError>,
    /// Why no daemon answers; none: one does.
    pub trouble: Option<Failed>,
}

struct State {
    display: Display,
    waiting: WaitingTicks,
    sequence: u64, // of the newest tick
    answered: u64, // the newest one that was answered
    first_s: Option<f64>,
    silent_since: Instant, // counts while ticks are unanswered
    refusals: Vec<TickError>,
    fatal: Option<Failed>,
    trouble: Option<Failed>,
    stopping: bool,
    opened: Option<SessionOpened>,
    resyncs: usize,
    resumes: usize,
}

struct Shared {
    state: Mutex<State>,
    for_worker: Notify, // there are ticks, or the camera was closed
    for_game: Notify,   // a tick was answered, or none ever will be
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A session that keeps targets in view, for a game loop that must not wait. It opens at once, and a task reaches the daemon, for ever if need be. A
/// daemon that can never accept the opening is an error, which `tick` and `update` return. One that is away is not. Needs a tokio runtime that
/// runs meanwhile.
pub struct LiveCamera {
    shared: Arc<Shared>,
    wait: Duration,
    fallback_after: Duration,
    close_after: Duration,
    worker: JoinHandle<()>,
}

impl LiveCamera {
    /// Starts a session with the first of the addresses ("host:port" or "unix:/path") that answers.
    pub fn open<A: Into<String>>(addresses: impl IntoIterator<Item = A>, opening: OpenSession, options: LiveOptions) -> LiveCamera {
        let state = State {
            display: Display::new(&opening, options.blend.as_secs_f64()),
            waiting: WaitingTicks::default(),
            sequence: 0,
            answered: 0,
            first_s: None,
            silent_since: Instant::now(),
            refusals: Vec::new(),
            fatal: None,
            trouble: None,
            stopping: false,
            opened: None,
            resyncs: 0,
            resumes: 0,
        };
        let shared = Arc::new(Shared { state: Mutex::new(state), for_worker: Notify::new(), for_game: Notify::new() });
        let worker = Worker {
            shared: shared.clone(),
            addresses: addresses.into_iter().map(Into::into).collect(),
            opening,
            options: Options { give_up_after: Duration::ZERO, reply_timeout: options.reply_timeout, ..options.camera },
            camera: None,
        };
        LiveCamera {
            shared,
            wait: options.wait,
            fallback_after: options.fallback_after,
            close_after: options.close_after,
            worker: tokio::spawn(worker.work()),
        }
    }

    /// What the daemon said when it opened the session, the last time that one did; none: none did so far.
    pub fn opened(&self) -> Option<SessionOpened> {
        self.shared.lock().opened.clone()
    }

    /// As [`Camera::resyncs`].
    pub fn resyncs(&self) -> usize {
        self.shared.lock().resyncs
    }

    /// As [`Camera::resumes`].
    pub fn resumes(&self) -> usize {
        self.shared.lock().resumes
    }

    /// Tells the daemon what has changed, and returns the camera to draw at once. The camera numbers ticks. The error is `QueueFull`, or `Failed` for an
    /// opening that no daemon accepts.
    pub fn update(&mut self, tick: Tick) -> Result<LiveView, Error> {
        let time_s = tick.time_s;
        let sequence = self.take(tick)?;
        self.view_of(time_s, sequence)
    }

    /// The same, but waits for the answer at most `LiveOptions::wait`, and not at all while an earlier tick is unanswered.
    pub async fn tick(&mut self, tick: Tick) -> Result<LiveView, Error> {
        let time_s = tick.time_s;
        let idle = {
            let state = self.shared.lock();
            state.answered == state.sequence
        };
        let sequence = self.take(tick)?;
        if !idle {
            return self.view_of(time_s, sequence);
        }
        let _ = tokio::time::timeout(self.wait, self.answer_to(sequence)).await;
        self.view_of(time_s, sequence + 1)
    }

    /// The camera to draw between ticks, at a game time near the newest tick's. `drawn`: positions of targets at that time, by id.
    pub fn sample(&mut self, time_s: f64, drawn: &Drawn) -> Result<LiveView, Error> {
        let mut state = self.shared.lock();
        let counts_from = state.sequence + 1;
        state.view(time_s, drawn, counts_from, self.fallback_after)
    }

    /// Ends the session. Ticks that wait are sent before, if a daemon takes them within `LiveOptions::close_after`.
    pub async fn close(mut self) {
        self.shared.lock().stopping = true;
        self.shared.for_worker.notify_one();
        let _ = tokio::time::timeout(self.close_after, &mut self.worker).await;
    }

    async fn answer_to(&self, sequence: u64) {
        loop {
            let changed = self.shared.for_game.notified();
            {
                let state = self.shared.lock();
                if state.answered >= sequence || state.fatal.is_some() {
                    return;
                }
            }
            changed.await;
        }
    }

    fn take(&self, mut tick: Tick) -> Result<u64, Error> {
        assert!(!tick.step_control.is_some_and(|control| control.merge_into_next), "a camera waits for a reply to each tick");
        assert!(tick.sequence == 0, "a LiveCamera numbers its ticks");
        assert!(tick.time_s.is_finite(), "time_s must be finite");
        let mut state = self.shared.lock();
        state.check()?;
        let (sequence, time_s) = (state.sequence + 1, tick.time_s);
        tick.sequence = sequence;
        state.waiting.add(tick.clone()).map_err(|_| Error::QueueFull)?;
        state.display.take_tick(&tick);
        if state.answered == state.sequence {
            state.silent_since = Instant::now();
        }
        state.sequence = sequence;
        state.first_s.get_or_insert(time_s);
        self.shared.for_worker.notify_one();
        Ok(sequence)
    }

    fn view_of(&self, time_s: f64, counts_from: u64) -> Result<LiveView, Error> {
        let mut state = self.shared.lock();
        let view = state.view(time_s, &Drawn::new(), counts_from, self.fallback_after)?;
        if state.display.follows() {
            let observed = state.display.observed();
            state.waiting.suggest(observed);
        }
        Ok(view)
    }
}

impl Drop for LiveCamera {
    fn drop(&mut self) {
        self.worker.abort();
    }
}

impl State {
    fn check(&self) -> Result<(), Error> {
        self.fatal.clone().map_or(Ok(()), |failed| Err(Error::Failed(failed)))
    }

    fn view(&mut self, time_s: f64, drawn: &Drawn, counts_from: u64, fallback_after: Duration) -> Result<LiveView, Error> {
        self.check()?;
        if self.answered != self.sequence && self.silent_since.elapsed() >= fallback_after {
            self.display.follow(counts_from);
        }
        let (shown, mut source) = self.display.show(time_s, drawn);
        let reply = self.display.newest.clone();
        if source == Source::Predicted && reply.as_ref().is_some_and(|reply| reply.sequence == self.sequence) {
            source = Source::Reply;
        }
        let covered_s = reply.as_ref().map(|reply| reply.time_s).or(self.first_s).unwrap_or(time_s);
        let refusals = std::mem::take(&mut self.refusals);
        Ok(LiveView { shown, age_s: (time_s - covered_s).max(0.0), source, sequence: self.sequence, reply, refusals, trouble: self.trouble.clone() })
    }
}

struct Worker {
    shared: Arc<Shared>,
    addresses: Vec<String>,
    opening: OpenSession,
    options: Options,
    camera: Option<Camera>,
}

impl Worker {
    async fn work(mut self) {
        if !self.try_for_ever(None).await {
            return;
        }
        while let Some(ticks) = self.next().await {
            for tick in ticks {
                if !self.try_for_ever(Some(tick)).await {
                    return;
                }
            }
        }
        if let Some(camera) = &mut self.camera {
            let _ = camera.close().await; // the session is over in any case
        }
    }

    /// None: the camera was closed, and no tick is left.
    async fn next(&self) -> Option<Vec<Tick>> {
        loop {
            {
                let mut state = self.shared.lock();
                if state.stopping || !state.waiting.is_empty() {
                    return state.waiting.take();
                }
            }
            self.shared.for_worker.notified().await;
        }
    }

    /// Opens the session if need be, and gets the answer to the tick. False: the camera was closed, or no daemon takes the opening.
    async fn try_for_ever(&mut self, tick: Option<Tick>) -> bool {
        let mut pause = Duration::ZERO;
        loop {
            if pause > Duration::ZERO && !self.pause(pause.min(LONGEST_PAUSE)).await {
                return false;
            }
            pause = longer(pause);
            let stream = self.stream_name();
            let failed = match self.try_once(tick.clone()).await {
                Ok(reply) => return self.answer(tick, reply, None),
                Err(Error::Refused(refusal)) => return self.answer(tick, None, Some(refusal)),
                Err(Error::Failed(failed)) => failed,
                Err(Error::QueueFull) => unreachable!("a camera has no queue"),
            };
            let is_new = self.stream_name() != stream;
            if let Some(sequence) = tick.as_ref().map(|tick| tick.sequence).filter(|_| is_new && !failed.is_lost(false)) {
                return self.answer(tick, None, Some(failed.into_refusal(sequence))); // it would end the call of the next stream too
            }
            let mut state = self.shared.lock();
            if self.camera.is_none() && !failed.is_lost(true) {
                state.fatal = Some(failed);
                self.shared.for_game.notify_one();
                return false;
            }
            state.trouble = Some(failed);
        }
    }

    /// Another one after each opening and each resumption. A session that cannot be resumed goes on under another id.
    fn stream_name(&self) -> Option<(String, usize)> {
        self.camera.as_ref().map(|camera| (camera.opened().session_id.clone(), camera.resumes()))
    }

    /// False: the camera was closed.
    async fn pause(&self, pause: Duration) -> bool {
        let due = tokio::time::Instant::now() + pause.mul_f64(0.5 + jitter() / 2.0);
        while !self.shared.lock().stopping {
            if tokio::time::timeout_at(due, self.shared.for_worker.notified()).await.is_err() {
                return true;
            }
        }
        false
    }

    async fn try_once(&mut self, tick: Option<Tick>) -> Result<Option<CameraReply>, Error> {
        if self.camera.is_none() {
            if let Some(scene) = &mut self.options.scene {
                scene.bytes().map_err(Error::Failed)?; // only once, however often the opening is tried
            }
            self.camera = Some(Camera::open(self.addresses.clone(), self.opening.clone(), self.options.clone()).await?);
        }
        let (Some(camera), Some(tick)) = (&mut self.camera, tick) else { return Ok(None) };
        let answer = camera.tick(tick).await;
        let mut state = self.shared.lock();
        (state.opened, state.resyncs, state.resumes) = (Some(camera.opened().clone()), camera.resyncs(), camera.resumes());
        answer.map(Some)
    }

    fn answer(&self, tick: Option<Tick>, reply: Option<CameraReply>, refusal: Option<TickError>) -> bool {
        let mut state = self.shared.lock();
        state.trouble = None;
        if let Some(tick) = tick {
            (state.answered, state.silent_since) = (tick.sequence, Instant::now());
        }
        if let Some(reply) = reply {
            state.display.take_reply(reply);
        }
        if state.refusals.len() < MOST_WAITING {
            state.refusals.extend(refusal);
        }
        self.shared.for_game.notify_one();
        true
    }
}
