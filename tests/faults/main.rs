//! What must survive: `kill -9` at any moment, damaged checkpoints, a full disk, an orderly shutdown in the middle of work.
//! The proofs run here about twenty times each; `make soak` runs them by the thousand.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod common;
mod proofs;
mod quick;
#[path = "../support/service.rs"]
#[expect(dead_code, reason = "each test target uses a part")]
mod support;

use common::{Expected, checkpoint_files};
use rustix::process::Signal;
use serde_json::{Value, json};
use std::path::Path;
use std::time::Duration;
use support::{Service, chance, endless_job, eventually, long_job, seed, signal};

#[test]
fn an_orderly_shutdown_checkpoints_and_requeues() {
    let directory = tempfile::tempdir().unwrap();
    let mut service = Service::start(directory.path(), &["--slots", "1"]);
    let mut body = long_job();
    body["checkpoint"] = json!({"every_wall_s": 3600});
    let expected = Expected::of(&service, &body);
    let id = service.submit(&body);
    eventually("it is under way", Duration::from_secs(20), || {
        (service.job(&id)["progress"]["step"].as_u64() > Some(0)).then_some(())
    });
    assert!(service.stop(), "the service did not end well");
    service.restart();
    let job = service.wait_for(&id, &["succeeded"]);
    assert_eq!(job["attempt"], 2);
    let states: Vec<Value> =
        service.events(&id).iter().filter(|e| e["type"] == "state").map(|e| e["data"]["to"].clone()).collect();
    assert_eq!(states, ["queued", "running", "pausing", "queued", "running", "succeeded"]);
    // It went on from the checkpoint that the shutdown made, not from the start.
    assert!(service.get(&format!("/v1/jobs/{id}/log")).text().contains("restored ckpt_"));
    expected.check(&service, &id);
}

type Damage = fn(&Path);

fn truncate(path: &Path) {
    let length = std::fs::metadata(path).unwrap().len();
    std::fs::OpenOptions::new().write(true).open(path).unwrap().set_len(length / 3).unwrap();
}

fn flip_a_bit(path: &Path) {
    let mut bytes = std::fs::read(path).unwrap();
    let place = bytes.len() * 2 / 3;
    bytes[place] ^= 0x10;
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn damaged_checkpoints_fall_back_to_the_one_before_and_at_last_to_the_start() {
    let directory = tempfile::tempdir().unwrap();
    let service = Service::start(directory.path(), &["--slots", "1"]);
    let body = long_job();
    let expected = Expected::of(&service, &body);
    let damages: [(Damage, usize); 3] = [(truncate, 1), (flip_a_bit, 1), (truncate, 2)];
    for (damage, how_many) in damages {
        let id = service.submit(&body);
        eventually("two checkpoints are kept", Duration::from_secs(20), || {
            (checkpoint_files(&service, &id).len() >= 2).then_some(())
        });
        service.act(&id, "pause");
        service.wait_for(&id, &["paused"]);
        let files = checkpoint_files(&service, &id);
        assert_eq!(files.len(), 2, "at least two are kept, older ones removed: {files:?}");
        for file in files.iter().rev().take(how_many) {
            damage(file);
        }
        service.act(&id, "resume");
        let job = service.wait_for(&id, &["succeeded"]);
        let warnings = job["warnings"].as_array().unwrap();
        assert_eq!(warnings.len(), how_many, "{warnings:?}");
        assert!(warnings.iter().all(|w| w["message"].as_str().unwrap().contains("passed over")));
        expected.check(&service, &id);
    }
}

#[test]
fn a_restart_from_a_damaged_checkpoint_fails_with_the_reason() {
    let directory = tempfile::tempdir().unwrap();
    let service = Service::start(directory.path(), &["--slots", "1"]);
    let first = service.submit(&json!({"scene": {"kind": "redistance", "spacing": 0.1}}));
    service.wait_for(&first, &["succeeded"]);
    let id = service.get(&format!("/v1/jobs/{first}/checkpoints")).json()["items"][0]["id"].clone();
    flip_a_bit(&checkpoint_files(&service, &first)[0]);
    let restart = service.submit(&json!({"restart": {"checkpoint": id, "overrides": {"/repeat": 5}}}));
    let job = eventually("it fails", Duration::from_secs(20), || {
        let job = service.job(&restart);
        (job["state"] == "failed").then_some(job)
    });
    assert_eq!(job["reason"], "checkpoint.none_valid");
}

/// Contention for the store while workers end: every cancel must come to an end, whatever it meets.
#[test]
fn cancels_in_the_last_moment_are_never_forgotten() {
    let directory = tempfile::tempdir().unwrap();
    let service = Service::start(directory.path(), &["--slots", "2"]);
    let seed = seed();
    let done = std::sync::atomic::AtomicBool::new(false);
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while !done.load(std::sync::atomic::Ordering::Relaxed) {
                    let id =
                        service.submit(&json!({"scene": {"kind": "redistance", "spacing": 0.2}, "priority": -100}));
                    service.act(&id, "cancel");
                }
            });
        }
        for round in 0..30 {
            let id = service.submit(&json!({"scene": {"kind": "redistance", "spacing": 0.05}, "priority": 100}));
            eventually("the worker is there or has been", Duration::from_secs(20), || {
                (service.job(&id)["attempt"] == 1).then_some(())
            });
            std::thread::sleep(Duration::from_secs_f64(0.12 * chance(seed, round)));
            service.act(&id, "cancel");
            service.wait_for(&id, &["canceled", "succeeded"]);
        }
        done.store(true, std::sync::atomic::Ordering::Relaxed);
    });
    // Nothing is left between two states, of the background's jobs neither.
    eventually("every job has ended", Duration::from_secs(30), || {
        let page = service.get("/v1/jobs?state=queued,running,pausing,canceling,interrupted&limit=500").json();
        page["items"].as_array().unwrap().is_empty().then_some(())
    });
    let canceled = service.get("/v1/jobs?state=canceled&limit=500").json();
    assert!(!canceled["items"].as_array().unwrap().is_empty());
}

/// The service is killed in the middle of its orderly shutdown, and again: a restart never counts against a job.
#[test]
fn shutdowns_that_are_cut_short_do_not_count() {
    let directory = tempfile::tempdir().unwrap();
    let mut service = Service::start(directory.path(), &["--slots", "1"]);
    let id = service.submit(&endless_job());
    for attempt in 1..=4_u64 {
        let pid = eventually("the attempt runs", Duration::from_secs(20), || {
            (service.job(&id)["attempt"] == attempt).then(|| service.worker(&id)).flatten()
        });
        // The worker cannot rest: its step takes minutes.
        signal(service.pid(), Signal::TERM);
        eventually("the drain has begun", Duration::from_secs(10), || {
            (service.job(&id)["state"] == "pausing").then_some(())
        });
        service.kill();
        eventually("the worker goes with the service", Duration::from_secs(5), || {
            let status = std::fs::read_to_string(format!("/proc/{pid}/status"));
            (!status.is_ok_and(|s| !s.contains("State:\tZ"))).then_some(())
        });
        service.restart();
    }
    assert!(["queued", "running"].contains(&service.job(&id)["state"].as_str().unwrap()));
    service.act(&id, "cancel");
    service.wait_for(&id, &["canceled"]);
}

#[test]
fn a_worker_that_dies_three_times_without_a_checkpoint_fails_the_job() {
    let directory = tempfile::tempdir().unwrap();
    let service = Service::start(directory.path(), &["--slots", "1"]);
    // Minutes in one step: no checkpoint can come in between.
    let id = service.submit(&endless_job());
    for attempt in 1..=3_u64 {
        let pid = eventually("the attempt runs", Duration::from_secs(20), || {
            (service.job(&id)["attempt"] == attempt).then(|| service.worker(&id)).flatten()
        });
        signal(pid, Signal::KILL);
    }
    let job = eventually("it fails", Duration::from_secs(20), || {
        let job = service.job(&id);
        (job["state"] == "failed").then_some(job)
    });
    assert_eq!(job["reason"], "worker.crash");
    assert!(job["message"].as_str().unwrap().starts_with("3 workers in a row"));
}
