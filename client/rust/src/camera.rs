//! A camera that keeps its targets in view, tick by tick.
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tonic::transport::ClientTlsConfig;

use crate::errors::{Error, Failed};
use crate::snapshot::{was_applied, Snapshot};
use crate::stream::{connect, silent, upload, wrong, Stream};
use crate::v1::{control_request, control_response, CameraReply, OpenSession, ResumeSession, SessionOpened, Tick};

const LONGEST_PAUSE: Duration = Duration::from_secs(1);
// A daemon resumes a session at once, or not at all.
const LONGEST_RESUME: Duration = Duration::from_secs(2);

/// How a camera reaches its daemons and what it does when one is lost.
#[derive(Debug, Clone)]
pub struct Options {
    /// How long a tick waits for a daemon that takes the session over; zero: a lost session is an error at once.
    pub give_up_after: Duration,
    /// A daemon that answers nothing for so long is taken for lost.
    pub reply_timeout: Duration,
    /// The same for an upload, and for the opening, for which the daemon loads the scene.
    pub open_timeout: Duration,
    /// The client's own scene file: each daemon gets it, and its hash goes into OpenSession.scene.
    pub scene: Option<Scene>,
    /// Files that the opening or a tick names by their hashes; a daemon that does not have one gets it.
    pub uploads: Vec<Vec<u8>>,
    /// Encrypts TCP, and can show the daemon a certificate; none: TCP is not encrypted.
    pub tls: Option<ClientTlsConfig>,
    /// Shows the daemon who calls; needs `tls` or a unix socket.
    pub token: Option<String>,
}

impl Default for Options {
    fn default() -> Self {
        let seconds = Duration::from_secs;
        let (give_up_after, reply_timeout, open_timeout) = (seconds(30), seconds(5), seconds(30));
        Options { give_up_after, reply_timeout, open_timeout, scene: None, uploads: Vec::new(), tls: None, token: None }
    }
}

/// A scene file (.glb, or .gltf without other files): "level.glb".into(), or its bytes.
#[derive(Debug, Clone)]
pub enum Scene {
    Bytes(Arc<[u8]>),
    File(PathBuf),
}

impl From<&str> for Scene {
    fn from(path: &str) -> Self {
        Scene::File(path.into())
    }
}

impl From<PathBuf> for Scene {
    fn from(path: PathBuf) -> Self {
        Scene::File(path)
    }
}

impl From<Vec<u8>> for Scene {
    fn from(bytes: Vec<u8>) -> Self {
        Scene::Bytes(bytes.into())
    }
}

impl Scene {
    /// Reads the file, once.
    pub(crate) fn bytes(&mut self) -> Result<Arc<[u8]>, Failed> {
        if let Scene::File(path) = self {
            let read = std::fs::read(&*path).map_err(|error| wrong(&format!("Options::scene: {}: {error}", path.display())))?;
            *self = read.into();
        }
        match self {
            Scene::Bytes(bytes) => Ok(bytes.clone()),
            Scene::File(_) => unreachable!("it was read"),
        }
    }
}

/// A session that keeps targets in view. When the stream breaks, the next tick goes on with the session in a new stream: the daemon keeps it
/// for a while (its flag --resume-grace-s), and the replies are those of an unbroken stream. When the daemon does not keep it, goes away, or
/// says Drain, the next tick opens the session again, in the daemon that answers then, and returns its reply: at the camera's last pose, with
/// the scene, targets, settings, limits and lens as they were. Needs a tokio runtime.
pub struct Camera {
    addresses: Vec<String>,
    address: usize,
    options: Options,
    uploads: Vec<Arc<[u8]>>, // the client's own scene comes first
    snapshot: Snapshot,
    stream: Option<Stream>,
    opened: SessionOpened,
    sequence: u64,
    resyncs: usize,
    last_resync: Option<String>,
    resumes: usize,
    token: Vec<u8>, // of the session in the daemon at `address`, also while it is lost; empty: it cannot be resumed
    answered: u64,  // the newest tick of this session that was answered
}

impl Camera {
    /// Opens a session with the first of the addresses ("host:port" or "unix:/path") that answers.
    pub async fn open<A: Into<String>>(addresses: impl IntoIterator<Item = A>, opening: OpenSession, mut options: Options) -> Result<Camera, Error> {
        let scene = options.scene.as_mut().map(Scene::bytes).transpose().map_err(Error::Failed)?;
        let uploads = scene.into_iter().chain(std::mem::take(&mut options.uploads).into_iter().map(Into::into)).collect();
        let mut camera = Camera {
            addresses: addresses.into_iter().map(Into::into).collect(),
            address: 0,
            options,
            uploads,
            snapshot: Snapshot::new(opening),
            stream: None,
            opened: SessionOpened::default(),
            sequence: 0,
            resyncs: 0,
            last_resync: None,
            resumes: 0,
            token: Vec::new(),
            answered: 0,
        };
        for left in (0..camera.addresses.len()).rev() {
            match camera.open_stream().await {
                Ok(()) => break,
                Err(failed) if left == 0 || !failed.is_lost(true) => return Err(Error::Failed(failed)),
                Err(_) => camera.leave(),
            }
        }
        Ok(camera)
    }

    /// What the daemon said when it opened the session, the last time that one did.
    pub fn opened(&self) -> &SessionOpened {
        &self.opened
    }

    /// How many times the session was opened again, in another daemon or in the same one.
    pub fn resyncs(&self) -> usize {
        self.resyncs
    }

    /// How many times it went on in another stream without that.
    pub fn resumes(&self) -> usize {
        self.resumes
    }

    /// Why it did so the last time.
    pub fn last_resync(&self) -> Option<&str> {
        self.last_resync.as_deref()
    }

    /// Sends what has changed, and returns where the camera goes. The camera numbers ticks whose sequence is 0. `step_control` must not merge
    /// the tick into the next one, because it would get no reply.
    pub async fn tick(&mut self, mut tick: Tick) -> Result<CameraReply, Error> {
        assert!(!tick.step_control.is_some_and(|control| control.merge_into_next), "a camera waits for a reply to each tick");
        if tick.sequence == 0 {
            tick.sequence = self.sequence + 1;
        }
        self.sequence = self.sequence.max(tick.sequence);
        match self.ask_until_answered(&mut tick).await.map_err(Error::Failed)? {
            control_response::Message::Camera(reply) => {
                self.snapshot.apply(&tick);
                self.snapshot.take_reply(&reply);
                Ok(reply)
            }
            control_response::Message::TickError(error) => {
                if was_applied(&error) {
                    self.snapshot.apply(&tick);
                }
                Err(Error::Refused(error))
            }
            _ => unreachable!("ask returns answers only"),
        }
    }

    /// Ends the session.
    pub async fn close(&mut self) -> Result<(), Error> {
        match self.stream.take() {
            Some(stream) => stream.finish(self.options.reply_timeout).await.map_err(Error::Failed),
            None => Ok(()),
        }
    }

    async fn ask_until_answered(&mut self, tick: &mut Tick) -> Result<control_response::Message, Failed> {
        let give_up = Instant::now() + self.options.give_up_after;
        let mut reason = None;
        let mut reopened = false;
        let mut pause = Duration::ZERO;
        loop {
            tokio::time::sleep(pause.mul_f64(0.5 + jitter() / 2.0)).await;
            if let Some(drained) = self.stream.as_ref().and_then(Stream::drained) {
                reason.get_or_insert(drained);
                self.leave();
            }
            let (failed, opening) = match self.open_if_needed(tick, &mut reopened).await {
                Err(failed) => (failed, true),
                Ok(taken) => match self.ask(tick, taken).await {
                    Err(failed) => (failed, false),
                    Ok(answer) => {
                        self.answered = tick.sequence;
                        if reopened {
                            self.resyncs += 1;
                            self.last_resync = reason.or_else(|| Some("the former tick lost the session".into()));
                        }
                        return Ok(answer);
                    }
                },
            };
            self.leave();
            if !failed.is_lost(opening) || Instant::now() >= give_up {
                return Err(failed);
            }
            reason.get_or_insert(failed.message);
            pause = longer(pause);
        }
    }

    /// True: the daemon has the tick already, and its answer follows.
    async fn open_if_needed(&mut self, next: &mut Tick, reopened: &mut bool) -> Result<bool, Failed> {
        let mut taken = false;
        if self.stream.is_none() && !self.token.is_empty() {
            taken = self.resume(next.sequence).await?;
        }
        if self.stream.is_none() {
            self.open_stream().await?;
            *reopened = true;
            self.tell_past(next).await;
        }
        Ok(taken)
    }

    /// Goes on with the lost session, if the daemon keeps it. True: the daemon has taken the tick already, and its answer follows. Without a
    /// stream afterwards, and without an error, a new session must be opened.
    async fn resume(&mut self, sequence: u64) -> Result<bool, Failed> {
        let timeout = self.options.reply_timeout.min(LONGEST_RESUME);
        match tokio::time::timeout(timeout, self.try_to_resume(timeout)).await.unwrap_or_else(|_| Err(silent(timeout))) {
            Ok((stream, opened)) => {
                let newest = opened.newest_sequence;
                if newest == sequence || newest == self.answered {
                    self.stream = Some(stream);
                    self.resumes += 1;
                    return Ok(newest == sequence);
                }
                let _ = stream.finish(self.options.reply_timeout).await; // the session lacks ticks that a former stream lost
            }
            Err(failed) if failed.is_lost(true) && self.addresses.len() == 1 => return Err(failed),
            Err(failed) if failed.is_lost(true) => self.next_address(),
            Err(_) => {}
        }
        self.token.clear();
        Ok(false)
    }

    async fn try_to_resume(&self, timeout: Duration) -> Result<(Stream, SessionOpened), Failed> {
        let client = connect(&self.addresses[self.address], &self.options).await?;
        let request = ResumeSession { token: self.token.clone(), answered_sequence: self.answered };
        let mut stream = Stream::start(client, control_request::Message::Resume(request));
        let opened = stream.opened(timeout).await?;
        Ok((stream, opened))
    }

    async fn open_stream(&mut self) -> Result<(), Failed> {
        // The opening needs the hash of the client's own scene, which comes with the first upload.
        let first = usize::from(self.options.scene.is_some() && !self.snapshot.names_scene_by_hash());
        match self.open_session(first).await {
            Err(failed) if failed.lacks_scene() && !self.uploads.is_empty() => self.open_session(self.uploads.len()).await,
            opened => opened,
        }
    }

    async fn open_session(&mut self, uploads: usize) -> Result<(), Failed> {
        let mut client = connect(&self.addresses[self.address], &self.options).await?;
        for (i, scene) in self.uploads[..uploads].iter().enumerate() {
            let timeout = self.options.open_timeout;
            let hash = tokio::time::timeout(timeout, upload(&mut client, scene)).await.unwrap_or_else(|_| Err(silent(timeout)))?;
            if i == 0 && self.options.scene.is_some() {
                self.snapshot.use_scene(hash);
            }
        }
        let opening = OpenSession { resumable: true, ..self.snapshot.opening() };
        let mut stream = Stream::start(client, control_request::Message::Open(opening));
        self.opened = stream.opened(self.options.open_timeout).await?;
        self.token = self.opened.resume_token.clone();
        self.answered = 0;
        self.stream = Some(stream);
        Ok(())
    }

    /// Tells a new session what happened before the tick.
    async fn tell_past(&mut self, next: &mut Tick) {
        let ticks = self.snapshot.ticks(next.sequence);
        if let Some(revision) = next.delta.as_mut().and_then(|delta| delta.base_revision.as_mut()) {
            *revision = self.opened.mirror_revision + ticks.iter().filter(|tick| tick.delta.is_some()).count() as u64;
        }
        let stream = self.stream.as_ref().expect("it was opened");
        for tick in ticks {
            stream.send(control_request::Message::Tick(tick)).await;
        }
    }

    async fn ask(&mut self, tick: &Tick, taken: bool) -> Result<control_response::Message, Failed> {
        let stream = self.stream.as_mut().expect("it was opened");
        if !taken {
            stream.send(control_request::Message::Tick(tick.clone())).await;
        }
        loop {
            let message = stream.receive(self.options.reply_timeout).await?;
            match &message {
                control_response::Message::TickError(_) => return Ok(message),
                control_response::Message::Camera(reply) if reply.sequence == tick.sequence => return Ok(message),
                _ => continue,
            }
        }
    }

    /// Gives the stream up. The next one goes to the next address, unless the session can be resumed.
    fn leave(&mut self) {
        if self.stream.take().is_some_and(|stream| stream.drained().is_some()) {
            self.token.clear();
        }
        if self.token.is_empty() {
            self.next_address();
        }
    }

    fn next_address(&mut self) {
        self.address = (self.address + 1) % self.addresses.len();
    }
}

/// The time to wait before the next attempt.
pub(crate) fn longer(pause: Duration) -> Duration {
    (2 * pause).clamp(Duration::from_millis(50), LONGEST_PAUSE)
}

/// A number in [0, 1) that differs from process to process and from moment to moment, so that the cameras of a lost daemon do not all come
/// at once.
pub(crate) fn jitter() -> f64 {
    use std::hash::{BuildHasher, RandomState};
    (RandomState::new().hash_one(0) >> 11) as f64 / (1u64 << 53) as f64
}
