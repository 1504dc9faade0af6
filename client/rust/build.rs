//! Generates the messages and the service from the contract, which lies beside this folder in the repository. Needs protoc.
use std::path::{Path, PathBuf};

fn protos(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("the contract's folder").flatten() {
        let path = entry.path();
        if path.is_dir() {
            protos(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "proto") {
            found.push(path);
        }
    }
}

fn main() {
    let root = Path::new("../../proto");
    let mut found = Vec::new();
    protos(&root.join("sightline"), &mut found);
    protos(&root.join("google/rpc"), &mut found);
    found.sort();
    println!("cargo:rerun-if-changed=../../proto");
    tonic_prost_build::configure()
        .build_server(false)
        .compile_protos(&found, &[root.to_path_buf()])
        .expect("the contract compiles");
}
