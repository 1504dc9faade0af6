//! A daemon of the test's own. The environment variable SIGHTLINED names the program.
use std::process::{Child, Command};
use std::time::Duration;

pub struct Daemon {
    process: Child,
    pub address: String,
}

impl Daemon {
    pub fn start() -> Daemon {
        let program = std::env::var("SIGHTLINED").expect("SIGHTLINED names the daemon");
        let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let address = format!("127.0.0.1:{port}");
        let flags = ["--sampler", "embree", "--log-level", "error", "--listen", &address];
        let process = Command::new(program).args(flags).spawn().unwrap();
        for _ in 0..6000 {
            if std::net::TcpStream::connect(&address).is_ok() {
                return Daemon { process, address };
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        panic!("the daemon did not start");
    }

    #[allow(dead_code)]
    pub fn signal(&mut self, name: &str) {
        assert!(Command::new("kill").args([name, &self.process.id().to_string()]).status().unwrap().success());
    }

    #[allow(dead_code)]
    pub fn stop(&mut self, name: &str) {
        self.signal(name);
        self.process.wait().unwrap();
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
