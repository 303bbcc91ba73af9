//! The HTTP contract, on the real binary over a real socket.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "../support/service.rs"]
#[expect(dead_code, reason = "each test target uses a part")]
mod support;

mod accuracy;
mod files;
mod jobs;
mod access;
mod changes;
mod clients;
mod connections;
mod contract;
mod data_directory;
mod data_uploads;
mod estimates;
mod examples;
mod http;
mod readers;
mod refinement;
mod requests;
mod studies;
mod upload_kinds;
mod uploads;
mod verify;

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;
use support::Service;

/// A service on a directory of its own.
fn service(arguments: &[&str]) -> (tempfile::TempDir, Service) {
    let directory = tempfile::tempdir().unwrap();
    let service = Service::start(directory.path(), arguments);
    (directory, service)
}

/// The Python of `make test` with its packages; None where tests run without `make test`.
fn python() -> Option<PathBuf> {
    let found = std::env::var_os("MENISCUS_PYTHON").map(PathBuf::from);
    let is_required = std::env::var_os("CI").is_some() || std::env::var_os("MENISCUS_BIN").is_some();
    assert!(found.is_some() || !is_required, "MENISCUS_PYTHON is not set");
    found
}

/// Lets a script of `tests/python` write files to a folder; None without Python.
fn files_of(script: &str, folder: &Path) -> Option<()> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python").join(script);
    let made = Command::new(python()?).arg(script).arg(folder).output().unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    Some(())
}

/// The manifest that such a script wrote.
fn manifest(folder: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(folder.join("manifest.json")).unwrap()).unwrap()
}
