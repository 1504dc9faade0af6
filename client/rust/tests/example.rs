//! The example is short, and moves a camera.
mod daemon;

use std::path::PathBuf;
use std::process::Command;

use daemon::Daemon;

/// `cargo test` builds the examples beside the tests.
fn example(name: &str) -> PathBuf {
    let test = std::env::current_exe().unwrap();
    test.parent().and_then(|deps| deps.parent()).unwrap().join("examples").join(name)
}

#[test]
fn the_example_is_short_and_moves_a_camera() {
    assert!(include_str!("../examples/pair.rs").lines().count() < 60);
    let daemon = Daemon::start();
    let output = Command::new(example("pair")).arg(&daemon.address).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let printed = String::from_utf8(output.stdout).unwrap();
    let both = printed.lines().filter(|line| line.ends_with("100% 100%")).count();
    assert_eq!(printed.lines().count(), 300);
    assert!(both > 150, "both targets are visible in {both} replies only");
}
