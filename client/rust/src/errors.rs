use prost::Message;
use tonic::{Code, Status};

use crate::generated::google::rpc;
use crate::v1::{tick_error, FieldViolation, TickError};

/// The error of an opening or of a tick.
#[derive(Debug, Clone)]
pub enum Error {
    /// The daemon refused a tick, and the session goes on. The message names the field and what is wrong. Nothing of the tick was applied,
    /// unless the message says that its step failed.
    Refused(TickError),
    /// The session could not be opened, or it was lost and no daemon took it over in time. The next tick of a camera that lost its session
    /// tries again.
    Failed(Failed),
    /// The tick of a LiveCamera was not taken, because too many wait for a daemon.
    QueueFull,
}

/// Why a session failed.
#[derive(Debug, Clone)]
pub struct Failed {
    /// Unavailable: no daemon answers, or the connection broke.
    pub code: Code,
    pub message: String,
    /// The fields of the request that are wrong; empty if the request was not the cause.
    pub violations: Vec<FieldViolation>,
}

impl std::fmt::Display for Error {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Error::Refused(error) => write!(out, "{}", error.message),
            Error::Failed(failed) => write!(out, "{:?}: {}", failed.code, failed.message),
            Error::QueueFull => write!(out, "too many ticks wait for a daemon"),
        }
    }
}

impl std::error::Error for Error {}

pub(crate) fn unavailable(message: impl Into<String>) -> Failed {
    Failed { code: Code::Unavailable, message: message.into(), violations: Vec::new() }
}

impl From<Status> for Failed {
    fn from(status: Status) -> Self {
        let details = rpc::Status::decode(status.details()).unwrap_or_default().details;
        let bad = details.iter().filter(|detail| detail.type_url.ends_with("google.rpc.BadRequest"));
        let violations = bad.flat_map(|detail| rpc::BadRequest::decode(&*detail.value).unwrap_or_default().field_violations);
        Failed {
            code: status.code(),
            message: status.message().to_owned(),
            violations: violations.map(|v| FieldViolation { field: v.field, description: v.description }).collect(),
        }
    }
}

impl Failed {
    /// True if another attempt, or another daemon, may help. A scene file that is too large stays so.
    pub(crate) fn is_lost(&self, opening: bool) -> bool {
        use Code::*;
        matches!(self.code, Unavailable | Cancelled | Unknown | Internal | DeadlineExceeded | Aborted)
            || (opening && self.code == ResourceExhausted && !self.names("chunk"))
    }

    /// Of a tick that ends each call in which it is sent.
    pub(crate) fn into_refusal(self, sequence: u64) -> TickError {
        let code = match self.code {
            Code::NotFound => tick_error::Code::NotFound,
            Code::AlreadyExists => tick_error::Code::AlreadyExists,
            Code::FailedPrecondition => tick_error::Code::FailedPrecondition,
            Code::ResourceExhausted => tick_error::Code::ResourceExhausted,
            _ => tick_error::Code::InvalidArgument,
        };
        TickError { sequence, code: code as i32, message: self.message, field_violations: self.violations, resync: None }
    }

    pub(crate) fn lacks_scene(&self) -> bool {
        self.code == Code::NotFound && self.names("scene")
    }

    /// A part of a field that is wrong has this name.
    fn names(&self, part: &str) -> bool {
        self.violations.iter().any(|violation| violation.field.contains(part))
    }
}
