//! What must survive: `kill -9` at any moment, damaged checkpoints, an orderly shutdown in the middle of work.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "../support/service.rs"]
#[expect(dead_code, reason = "each test target uses a part")]
mod support;

use rustix::process::Signal;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use support::{Service, chance, endless_job, eventually, long_job, signal, steady_job};

/// The results that every disturbed run must reach, from an undisturbed one.
struct Expected {
    frames: Vec<(String, String)>,
    series: String,
}

impl Expected {
    fn of(service: &Service, body: &Value) -> Self {
        let id = service.submit(body);
        service.wait_for(&id, &["succeeded"]);
        Self { frames: service.frames(&id), series: service.series(&id) }
    }

    fn check(&self, service: &Service, id: &str) {
        // The whole files are the same bytes, which is more than their data sets.
        assert_eq!(service.frames(id), self.frames, "{id}");
        assert_eq!(service.series(id), self.series, "{id}");
        let ids: Vec<u64> = service.events(id).iter().map(|e| e["id"].as_u64().unwrap()).collect();
        assert_eq!(ids, (1..=ids.len() as u64).collect::<Vec<_>>(), "{id}: events have gaps");
        let fractions: Vec<f64> = service
            .events(id)
            .iter()
            .filter(|e| e["type"] == "progress")
            .map(|e| e["data"]["fraction"].as_f64().unwrap())
            .collect();
        assert!(fractions.is_sorted(), "{id}: the fraction falls: {fractions:?}");
        // What killed attempts left behind is gone: as many frames and checkpoints on disk as listed.
        let frames = files_below(service, id, "frames");
        assert_eq!(frames.len(), self.frames.len(), "{id}: {frames:?}");
        let listed = service.get(&format!("/v1/jobs/{id}/checkpoints")).json()["items"].as_array().unwrap().len();
        let checkpoints = files_below(service, id, "checkpoints");
        assert_eq!(checkpoints.len(), listed, "{id}: {checkpoints:?}");
    }
}

/// A seed from the environment, or one of this moment; printed, so that a failure can be repeated.
#[expect(clippy::print_stdout, reason = "a failing run must show its seed")]
fn seed() -> u64 {
    let given = std::env::var("MENISCUS_SEED").ok().and_then(|s| s.parse().ok());
    let seed = given.unwrap_or_else(|| {
        std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().as_micros() as u64
    });
    println!("MENISCUS_SEED={seed}");
    seed
}

#[test]
fn twenty_kills_of_workers_lose_nothing() {
    let directory = tempfile::tempdir().unwrap();
    let service = Service::start(directory.path(), &["--slots", "2", "--threads", "2"]);
    let body = steady_job();
    let expected = Expected::of(&service, &body);
    let seed = seed();
    let mut kills = 0;
    let mut round = 0;
    // Two deaths a job at most: a third without a new checkpoint would rightly fail it.
    while kills < 20 {
        let ids: Vec<String> = (0..2).map(|_| service.submit(&body)).collect();
        for (k, id) in ids.iter().enumerate() {
            for death in 0..2 {
                let attempt = service.job(id)["attempt"].as_u64().unwrap().max(1);
                service.wait_for(id, &["running", "succeeded"]);
                let moment = chance(seed, round * 100 + 10 * k as u64 + death);
                std::thread::sleep(Duration::from_secs_f64(0.5 * moment));
                if let Some(pid) = service.worker(id) {
                    signal(pid, Signal::KILL);
                    kills += 1;
                    eventually("the next attempt runs", Duration::from_secs(20), || {
                        let job = service.job(id);
                        (job["attempt"].as_u64().unwrap() > attempt || job["state"] == "succeeded").then_some(())
                    });
                }
            }
        }
        for id in &ids {
            service.wait_for(id, &["succeeded"]);
            expected.check(&service, id);
        }
        round += 1;
        assert!(round < 40, "only {kills} kills found a worker");
    }
}

#[test]
fn twenty_kills_of_the_service_lose_no_job() {
    let directory = tempfile::tempdir().unwrap();
    let mut service = Service::start(directory.path(), &["--slots", "2"]);
    let body = steady_job();
    let expected = Expected::of(&service, &body);
    let seed = seed();
    let mut acknowledged: Vec<String> = (0..3).map(|_| service.submit(&body)).collect();
    for kill in 0..20 {
        std::thread::sleep(Duration::from_secs_f64(0.4 * chance(seed, kill)));
        if kill % 7 == 3 {
            // Killed right after the 201.
            acknowledged.push(service.submit(&body));
        }
        let workers: Vec<u32> = acknowledged.iter().filter_map(|id| service.worker(id)).collect();
        service.kill();
        eventually("orphans are gone by the closed pipe alone", Duration::from_secs(5), || {
            let alive = |pid: &u32| {
                std::fs::read_to_string(format!("/proc/{pid}/status")).is_ok_and(|s| !s.contains("State:\tZ"))
            };
            (!workers.iter().any(alive)).then_some(())
        });
        service.restart();
        let unfinished =
            acknowledged.iter().map(|id| service.job(id)).filter(|job| job["state"] != "succeeded").count();
        if unfinished < 2 {
            acknowledged.push(service.submit(&body));
        }
    }
    for id in &acknowledged {
        let job = service.wait_for(id, &["succeeded"]);
        expected.check(&service, id);
        assert_eq!(job["health"]["warnings"], json!([]), "a restart of the service is no fault of the job");
    }
    // None doubled: the store knows these and the undisturbed one.
    let all = service.get("/v1/jobs?limit=500").json();
    assert_eq!(all["items"].as_array().unwrap().len(), acknowledged.len() + 1);
}

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

/// All files in a folder of every attempt of a job, by name.
fn files_below(service: &Service, id: &str, folder: &str) -> Vec<PathBuf> {
    let attempts = service.data.join("jobs").join(id).join("attempts");
    let attempts = std::fs::read_dir(attempts).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = attempts
        .flat_map(|attempt| std::fs::read_dir(attempt.path().join(folder)).into_iter().flatten().flatten())
        .map(|entry| entry.path())
        .collect();
    files.sort_by(|a, b| a.file_name().cmp(&b.file_name()));
    files
}

/// The whole checkpoints among them.
fn checkpoint_files(service: &Service, id: &str) -> Vec<PathBuf> {
    let is_whole = |path: &PathBuf| path.extension().is_some_and(|e| e == "h5");
    files_below(service, id, "checkpoints").into_iter().filter(is_whole).collect()
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
        let warnings = job["health"]["warnings"].as_array().unwrap();
        assert_eq!(warnings.len(), how_many, "{warnings:?}");
        assert!(warnings.iter().all(|w| w.as_str().unwrap().contains("passed over")));
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

#[test]
fn cancels_at_random_moments_are_prompt() {
    let directory = tempfile::tempdir().unwrap();
    let service = Service::start(directory.path(), &["--slots", "2"]);
    let seed = seed();
    for round in 0..20 {
        let id = service.submit(&steady_job());
        std::thread::sleep(Duration::from_secs_f64(0.3 * chance(seed, round)));
        let asked = Instant::now();
        service.act(&id, "cancel");
        service.wait_for(&id, &["canceled", "succeeded"]);
        // Far above the two seconds of the contract only where the machine itself stands still.
        assert!(asked.elapsed() < Duration::from_secs(8), "{:?}", asked.elapsed());
    }
}
