//! Plays conformance sessions. tests/conformance/README.md describes the protocol; messages are in base64 instead of JSON, which prost
//! cannot write.
use base64::{engine::general_purpose::STANDARD, Engine};
use prost::Message;
use serde_json::{json, Value};
use sightline_client::v1::{CameraReply, OpenSession, Tick};
use sightline_client::{Camera, Certificate, ClientTlsConfig, Code, Error, Identity, LiveCamera, LiveOptions, Options, PoseSampler, Scene};

fn decode<M: Message + Default>(text: &Value) -> M {
    M::decode(&*STANDARD.decode(text.as_str().expect("base64")).expect("base64")).expect("a message")
}

fn encode(message: &impl Message) -> String {
    STANDARD.encode(message.encode_to_vec())
}

/// NotFound is NOT_FOUND.
fn name(code: Code) -> String {
    let name = format!("{code:?}");
    let parts = name.char_indices().map(|(i, letter)| if i > 0 && letter.is_uppercase() { format!("_{letter}") } else { letter.to_string() });
    parts.collect::<String>().to_uppercase()
}

fn trust(command: &Value) -> (Option<ClientTlsConfig>, Option<String>) {
    let trust = &command["trust"];
    let pem = |name: &str| trust[name].as_str().map(|path| std::fs::read(path).expect("a file"));
    let tls = pem("roots").map(|roots| ClientTlsConfig::new().ca_certificate(Certificate::from_pem(roots)));
    let tls = match (tls, pem("certificate"), pem("key")) {
        (Some(tls), Some(certificate), Some(key)) => Some(tls.identity(Identity::from_pem(certificate, key))),
        (tls, _, _) => tls,
    };
    (tls, trust["token"].as_str().map(str::to_owned))
}

fn scene_file(command: &Value) -> Option<Scene> {
    command["scene_file"].as_str().map(Into::into)
}

async fn run(camera: &mut Option<Camera>, command: &Value) -> Result<Value, Error> {
    if !command["open"].is_null() {
        let uploads = command["uploads"].as_array().into_iter().flatten();
        let uploads = uploads.map(|path| std::fs::read(path.as_str().expect("a path")).expect("a file")).collect();
        let address = command["address"].as_str().expect("an address");
        let (tls, token) = trust(command);
        let scene = scene_file(command).or_else(|| command["scene"].as_str().map(|path| std::fs::read(path).expect("a file").into()));
        let options = Options { scene, uploads, tls, token, ..Options::default() };
        let opened = Camera::open([address], decode(&command["open"]), options).await?;
        return Ok(json!({"opened": encode(camera.insert(opened).opened())}));
    }
    let camera = camera.as_mut().expect("an open camera");
    if !command["tick"].is_null() {
        return Ok(json!({"camera": encode(&camera.tick(decode(&command["tick"])).await?)}));
    }
    camera.close().await?;
    Ok(json!({"closed": {"resyncs": camera.resyncs(), "resumes": camera.resumes()}}))
}

/// The commands of tests/live for a PoseSampler and a LiveCamera.
#[derive(Default)]
struct Live {
    sampler: PoseSampler,
    camera: Option<LiveCamera>,
}

impl Live {
    /// None: it is no command of this kind.
    async fn run(&mut self, command: &Value) -> Option<Value> {
        let number = |value: &Value| value.as_f64().expect("a number");
        if command.get("sampler_new").is_some() {
            self.sampler = PoseSampler::default();
            return Some(json!({"sampler": {}}));
        }
        if let Some(reply) = command.get("sampler_add") {
            return Some(json!({"taken": self.sampler.add(&decode::<CameraReply>(reply))}));
        }
        if let Some(by) = command.get("sampler_shift") {
            let by: Vec<f64> = by.as_array().expect("a vector").iter().map(number).collect();
            self.sampler.shift([by[0], by[1], by[2]]);
            return Some(json!({"sampler": {}}));
        }
        if let Some(at) = command.get("sampler_at") {
            let target: Vec<f64> = at["target"].as_array().expect("a target").iter().map(number).collect();
            let shown = self.sampler.sample(number(&at["time_s"]), target.try_into().ok());
            let values = |s: sightline_client::Sample| [&s.position[..], &s.rotation[..], &[s.field_of_view, f64::from(u8::from(s.cut))]].concat();
            return Some(json!({"sample": shown.map(values)}));
        }
        if let Some(opening) = command.get("live_open") {
            let wait = std::time::Duration::from_secs_f64(number(&command["wait_s"]));
            let options = LiveOptions { camera: Options { scene: scene_file(command), ..Default::default() }, wait, ..Default::default() };
            self.camera = Some(LiveCamera::open([command["address"].as_str().expect("an address")], decode::<OpenSession>(opening), options));
            return Some(json!({"live": {}}));
        }
        if let Some(tick) = command.get("live_tick") {
            return Some(self.tick(decode(tick)).await);
        }
        command.get("live_close")?;
        let camera = self.camera.take()?;
        let (resyncs, resumes, began) = (camera.resyncs(), camera.resumes(), std::time::Instant::now());
        camera.close().await;
        Some(json!({"live_closed": {"took_s": began.elapsed().as_secs_f64(), "resyncs": resyncs, "resumes": resumes}}))
    }

    async fn tick(&mut self, tick: Tick) -> Value {
        let began = std::time::Instant::now();
        let view = match self.camera.as_mut().expect("an open camera").tick(tick).await {
            Ok(view) => view,
            Err(Error::Failed(failed)) => return json!({"error": name(failed.code)}),
            Err(_) => return json!({"error": "QUEUE_FULL"}),
        };
        let took_s = began.elapsed().as_secs_f64();
        let (sequence, hash) = view.reply.map_or((0, 0), |reply| (reply.sequence, reply.mirror_hash));
        let (refusals, codes): (Vec<_>, Vec<_>) = view.refusals.iter().map(|refusal| (refusal.sequence, refusal.code)).unzip();
        json!({"view": {
            "position": view.shown.position, "rotation": view.shown.rotation, "field_of_view": view.shown.field_of_view, "cut": view.shown.cut,
            "age_s": view.age_s, "source": format!("{:?}", view.source).to_lowercase(), "sequence": view.sequence, "reply": sequence,
            "hash": hash.to_string(), "refusals": refusals, "refusal_codes": codes, "trouble": view.trouble.is_some(), "took_s": took_s}})
    }
}

#[tokio::main]
async fn main() {
    let mut camera = None;
    let mut live = Live::default();
    for line in std::io::stdin().lines() {
        let command = serde_json::from_str(&line.expect("a line")).expect("a command");
        if let Some(answer) = live.run(&command).await {
            println!("{answer}");
            continue;
        }
        let answer = run(&mut camera, &command).await.unwrap_or_else(|error| match error {
            Error::Refused(error) => json!({"refused": encode(&error)}),
            Error::Failed(failed) => {
                let violations: Vec<_> = failed.violations.iter().map(|v| json!({"field": v.field, "description": v.description})).collect();
                json!({"failed": {"code": name(failed.code), "violations": violations}})
            }
            Error::QueueFull => unreachable!("a Camera has no queue"),
        });
        println!("{answer}");
    }
}
