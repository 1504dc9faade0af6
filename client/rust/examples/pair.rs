//! Moves two people behind a pillar, and prints where the camera goes: pair [ADDRESS].
use sightline_client::v1::{OpenSession, Pose3, Target, Tick};
use sightline_client::{box_shape, capsule, instance, transforms, vector, Camera, Options};

const ANNA: u64 = 1;
const BEN: u64 = 2;
const PILLAR: u64 = 3;

/// Where Anna and Ben are, in metres; +Y is up.
fn positions(time_s: f64) -> [(u64, [f64; 3]); 2] {
    let x = 3.0 * time_s.sin();
    [(ANNA, [x - 0.6, 0.9, 0.0]), (BEN, [x + 0.6, 0.9, 0.0])]
}

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), sightline_client::Error> {
    let address = std::env::args().nth(1).unwrap_or("127.0.0.1:50151".into());
    let mut instances: Vec<_> = positions(0.0).map(|(id, position)| instance(id, capsule(0.3, 1.8), position)).into();
    instances.push(instance(PILLAR, box_shape(1.0, 4.0, 1.0), [0.0, 2.0, 2.0]));
    let opening = OpenSession {
        instances,
        targets: [ANNA, BEN].map(|id| Target { id, ..Default::default() }).into(),
        camera: Some(Pose3 { position: Some(vector([0.0, 1.6, 6.0])), rotation: None }),
        ..Default::default()
    };
    let mut camera = Camera::open([address], opening, Options::default()).await?;
    for frame in 0..300 {
        let time_s = f64::from(frame) / 60.0;
        let reply = camera.tick(Tick { time_s, transforms: Some(transforms(&positions(time_s))), ..Default::default() }).await?;
        let p = reply.pose.and_then(|pose| pose.position).unwrap_or_default();
        let seen: Vec<_> = reply.targets.iter().map(|target| format!("{:.0}%", 100.0 * target.visible_share)).collect();
        println!("{time_s:.2} s  camera ({:.2}, {:.2}, {:.2})  visible {}", p.x, p.y, p.z, seen.join(" "));
    }
    camera.close().await
}
