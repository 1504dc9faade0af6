//! One call of Control on a connection of its own, with a task that reads its responses.
use std::sync::{Arc, Mutex};
use std::time::Duration;

use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use tokio_stream::wrappers::ReceiverStream;
use tonic::metadata::AsciiMetadataValue;
use tonic::service::{interceptor::InterceptedService, Interceptor};
use tonic::transport::{Channel, Endpoint};
use tonic::{Code, Request, Status};

use crate::camera::Options;
use crate::errors::{unavailable, Failed};
use crate::v1::camera_control_service_client::CameraControlServiceClient;
use crate::v1::{control_request, control_response, ControlRequest, ControlResponse, SessionOpened, UploadSceneRequest};

// Replies with depth maps exceed the default limit of 4 MiB.
const MAX_REPLY_BYTES: usize = 64 << 20;
const CHUNK_BYTES: usize = 512 << 10;

/// Adds the token to every call.
#[derive(Clone)]
pub(crate) struct Bearer(Option<AsciiMetadataValue>);

impl Interceptor for Bearer {
    fn call(&mut self, mut request: Request<()>) -> Result<Request<()>, Status> {
        if let Some(value) = &self.0 {
            request.metadata_mut().insert("authorization", value.clone());
        }
        Ok(request)
    }
}

pub(crate) type Client = CameraControlServiceClient<InterceptedService<Channel, Bearer>>;

fn bearer(token: Option<&str>, confidential: bool) -> Result<Bearer, Failed> {
    let Some(token) = token else { return Ok(Bearer(None)) };
    if !confidential {
        return Err(wrong("Options::token is sent only over TLS (Options::tls) or a unix socket"));
    }
    let value = format!("Bearer {token}").parse().map_err(|_| wrong("Options::token has characters that no header may have"))?;
    Ok(Bearer(Some(value)))
}

pub(crate) async fn connect(address: &str, options: &Options) -> Result<Client, Failed> {
    let local = address.starts_with("unix:");
    let tls = options.tls.clone().filter(|_| !local);
    let bearer = bearer(options.token.as_deref(), local || tls.is_some())?;
    let scheme = if tls.is_some() { "https" } else { "http" };
    let uri = if local || address.contains("://") { address.to_owned() } else { format!("{scheme}://{address}") };
    let endpoint = Endpoint::from_shared(uri).map_err(|error| unavailable(error.to_string()))?;
    let endpoint = endpoint.connect_timeout(options.open_timeout).tcp_nodelay(true);
    let endpoint = match tls {
        Some(tls) => endpoint.tls_config(tls).map_err(|error| wrong(&format!("Options::tls: {error}")))?,
        None => endpoint,
    };
    let channel = endpoint.connect().await.map_err(|error| unavailable(format!("no daemon answers at {address}: {error}")))?;
    Ok(Client::new(InterceptedService::new(channel, bearer)).max_decoding_message_size(MAX_REPLY_BYTES))
}

pub(crate) fn wrong(message: &str) -> Failed {
    Failed { code: Code::InvalidArgument, ..unavailable(message) }
}

/// Returns the hash of the scene.
pub(crate) async fn upload(client: &mut Client, scene: &[u8]) -> Result<String, Failed> {
    let chunks: Vec<_> = scene.chunks(CHUNK_BYTES).map(|chunk| UploadSceneRequest { chunk: chunk.to_vec() }).collect();
    Ok(client.upload_scene(tokio_stream::iter(chunks)).await?.into_inner().hash)
}

// What both the camera and the reader use.
#[derive(Default)]
struct Shared {
    requests: Option<mpsc::Sender<ControlRequest>>, // none: no more are sent
    drained: Option<String>,                        // the reason why the daemon takes no more ticks
}

pub(crate) fn silent(timeout: Duration) -> Failed {
    unavailable(format!("the daemon has answered nothing for {timeout:?}"))
}

pub(crate) struct Stream {
    shared: Arc<Mutex<Shared>>,
    responses: mpsc::Receiver<Result<ControlResponse, Failed>>, // ends when the daemon has ended the call in order
    reader: JoinHandle<()>,
}

impl Stream {
    /// Starts the call with its first message.
    pub fn start(mut client: Client, first: control_request::Message) -> Self {
        let (sender, requests) = mpsc::channel(64);
        let (answers, responses) = mpsc::channel(64);
        let _ = sender.try_send(ControlRequest { message: Some(first) });
        let shared = Arc::new(Mutex::new(Shared { requests: Some(sender), drained: None }));
        let of_reader = shared.clone();
        let reader = tokio::spawn(async move {
            let mut call = match client.control(ReceiverStream::new(requests)).await {
                Ok(response) => response.into_inner(),
                Err(status) => return drop(answers.send(Err(status.into())).await),
            };
            loop {
                let answer = match call.message().await {
                    Ok(Some(response)) => Ok(response),
                    Ok(None) => return,
                    Err(status) => Err(Failed::from(status)),
                };
                if let Ok(ControlResponse { message: Some(control_response::Message::Drain(drain)) }) = &answer {
                    // The daemon need not wait for more ticks; it answers those that it has.
                    *of_reader.lock().unwrap() = Shared { requests: None, drained: Some(drain.reason.clone()) };
                }
                let over = answer.is_err();
                if answers.send(answer).await.is_err() || over {
                    return;
                }
            }
        });
        Stream { shared, responses, reader }
    }

    pub fn drained(&self) -> Option<String> {
        self.shared.lock().unwrap().drained.clone()
    }

    /// Queues a message. When the call has ended, `receive` says why.
    pub async fn send(&self, message: control_request::Message) {
        let sender = self.shared.lock().unwrap().requests.clone();
        if let Some(sender) = sender {
            let _ = sender.send(ControlRequest { message: Some(message) }).await;
        }
    }

    /// The next response, or none when the daemon has ended the call in order.
    async fn next(&mut self, timeout: Duration) -> Result<Option<ControlResponse>, Failed> {
        match tokio::time::timeout(timeout, self.responses.recv()).await {
            Ok(response) => response.transpose(),
            Err(_) => Err(silent(timeout)),
        }
    }

    pub async fn receive(&mut self, timeout: Duration) -> Result<control_response::Message, Failed> {
        loop {
            match self.next(timeout).await? {
                None => return Err(unavailable(self.drained().unwrap_or_else(|| "the daemon has ended the session".into()))),
                Some(response) => {
                    if let Some(message) = response.message {
                        return Ok(message);
                    }
                }
            }
        }
    }

    /// The answer to the first message.
    pub async fn opened(&mut self, timeout: Duration) -> Result<SessionOpened, Failed> {
        loop {
            if let control_response::Message::Opened(opened) = self.receive(timeout).await? {
                return Ok(opened);
            }
        }
    }

    /// Ends the session in order.
    pub async fn finish(mut self, timeout: Duration) -> Result<(), Failed> {
        self.shared.lock().unwrap().requests = None;
        while self.next(timeout).await?.is_some() {}
        Ok(())
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        self.reader.abort();
    }
}
