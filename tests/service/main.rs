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

use support::Service;

/// A service on a directory of its own.
fn service(arguments: &[&str]) -> (tempfile::TempDir, Service) {
    let directory = tempfile::tempdir().unwrap();
    let service = Service::start(directory.path(), arguments);
    (directory, service)
}
