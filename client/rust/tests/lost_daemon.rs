//! The client against daemons of its own. The environment variable SIGHTLINED names the program.
mod daemon;

use std::time::Duration;

use sightline_client::v1::{OpenSession, Pose3, Target, Tick};
use sightline_client::{capsule, instance, transforms, vector, Camera, Code, Error, LiveCamera, LiveOptions, Options};

use daemon::Daemon;

fn opening() -> OpenSession {
    OpenSession {
        instances: vec![instance(1, capsule(0.3, 1.8), [0.0, 0.9, 0.0])],
        targets: vec![Target { id: 1, ..Default::default() }],
        camera: Some(Pose3 { position: Some(vector([0.0, 1.6, 6.0])), rotation: None }),
        ..Default::default()
    }
}

fn tick(frame: i32, id: u64) -> Tick {
    let time_s = f64::from(frame) / 60.0;
    Tick { time_s, transforms: Some(transforms(&[(id, [2.0 * time_s.sin(), 0.9, 0.0])])), ..Default::default() }
}

async fn play(camera: &mut Camera, first: i32, n: i32) -> u64 {
    let mut last = 0;
    for frame in first..first + n {
        last = camera.tick(tick(frame, 1)).await.unwrap().sequence;
    }
    last
}

#[tokio::test(flavor = "multi_thread")]
async fn the_session_goes_on_in_the_daemon_at_the_next_address() {
    let (mut first, mut second, third) = (Daemon::start(), Daemon::start(), Daemon::start());
    let addresses = [&first.address, &second.address, &third.address];
    let mut camera = Camera::open(addresses, opening(), Options::default()).await.unwrap();
    play(&mut camera, 0, 30).await;
    first.stop("-TERM");
    assert_eq!(play(&mut camera, 30, 30).await, 60);
    assert_eq!(camera.last_resync(), Some("the server is stopping"));
    second.stop("-KILL");
    assert_eq!(play(&mut camera, 60, 30).await, 90);
    assert_eq!(camera.resyncs(), 2);
    camera.close().await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_daemon_that_hangs_is_left_and_a_camera_gives_up_in_time() {
    let (mut first, second) = (Daemon::start(), Daemon::start());
    let options = Options { reply_timeout: Duration::from_secs(2), give_up_after: Duration::ZERO, ..Default::default() };
    let mut camera = Camera::open([&first.address, &second.address], opening(), options).await.unwrap();
    first.signal("-STOP");
    let error = camera.tick(tick(0, 1)).await.unwrap_err();
    assert!(error.to_string().contains("nothing for 2s"), "{error}");
    assert_eq!(play(&mut camera, 1, 1).await, 2, "the next tick tries again");
}

#[tokio::test(flavor = "multi_thread")]
async fn errors_name_the_field() {
    let daemon = Daemon::start();
    let mut camera = Camera::open([&daemon.address], opening(), Options::default()).await.unwrap();
    let Err(Error::Refused(refused)) = camera.tick(tick(0, 99)).await else { panic!("not refused") };
    assert_eq!(refused.field_violations[0].field, "tick.transforms.ids[0]");
    let wrong = OpenSession { targets: vec![Target { id: 99, ..Default::default() }], ..opening() };
    let Err(Error::Failed(failed)) = Camera::open([&daemon.address], wrong, Options::default()).await else { panic!("opened") };
    assert_eq!((failed.code, failed.violations[0].field.as_str()), (Code::NotFound, "open.targets[0].id"));
    let Err(Error::Failed(failed)) = Camera::open(["127.0.0.1:1"], opening(), Options::default()).await else { panic!("opened") };
    assert_eq!(failed.code, Code::Unavailable);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_scene_file_that_is_missing_is_an_error() {
    let options = Options { scene: Some("no/such.glb".into()), ..Default::default() };
    let Err(Error::Failed(failed)) = Camera::open(["127.0.0.1:1"], opening(), options.clone()).await else { panic!("opened") };
    assert_eq!(failed.code, Code::InvalidArgument);
    let live = LiveOptions { camera: options, wait: Duration::from_secs(5), ..Default::default() };
    let Err(Error::Failed(failed)) = LiveCamera::open(["127.0.0.1:1"], opening(), live).tick(tick(0, 1)).await else { panic!("opened") };
    assert!(failed.message.contains("no/such.glb"), "{}", failed.message);
}
