//! Plays conformance sessions. tests/conformance/README.md describes the protocol; messages are in base64 instead of JSON, which prost
//! cannot write.
use base64::{engine::general_purpose::STANDARD, Engine};
use prost::Message;
use serde_json::{json, Value};
use sightline_client::{Camera, Certificate, ClientTlsConfig, Code, Error, Identity, Options};

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

async fn run(camera: &mut Option<Camera>, command: &Value) -> Result<Value, Error> {
    if !command["open"].is_null() {
        let uploads = command["uploads"].as_array().into_iter().flatten();
        let uploads = uploads.map(|path| std::fs::read(path.as_str().expect("a path")).expect("a file")).collect();
        let address = command["address"].as_str().expect("an address");
        let (tls, token) = trust(command);
        let options = Options { uploads, tls, token, ..Options::default() };
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

#[tokio::main]
async fn main() {
    let mut camera = None;
    for line in std::io::stdin().lines() {
        let command = serde_json::from_str(&line.expect("a line")).expect("a command");
        let answer = run(&mut camera, &command).await.unwrap_or_else(|error| match error {
            Error::Refused(error) => json!({"refused": encode(&error)}),
            Error::Failed(failed) => {
                let violations: Vec<_> = failed.violations.iter().map(|v| json!({"field": v.field, "description": v.description})).collect();
                json!({"failed": {"code": name(failed.code), "violations": violations}})
            }
        });
        println!("{answer}");
    }
}
