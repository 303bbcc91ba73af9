//! What machines do: disks fill, memory ends, processes stand still, clocks are set.

use crate::common::Expected;
use crate::support::{Service, chance, endless_job, eventually, long_job, signal, steady_job};
use rustix::process::Signal;
use serde_json::{Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// A small disk of its own, unmounted in the end.
struct SmallDisk {
    place: PathBuf,
}

impl SmallDisk {
    /// None where this user may not mount.
    fn mount(place: &Path, bytes: u64) -> Option<Self> {
        std::fs::create_dir_all(place).unwrap();
        let mounted =
            Command::new("mount").args(["-t", "tmpfs", "-o", &format!("size={bytes}"), "none"]).arg(place).output();
        mounted.ok()?.status.success().then(|| Self { place: place.to_owned() })
    }

    fn free(&self) -> u64 {
        let stat = rustix::fs::statvfs(&self.place).unwrap();
        stat.f_bavail * stat.f_frsize
    }

    /// Fills the disk but for so many bytes, whatever a job takes in the meantime.
    fn fill(&self, leave: u64) {
        let mut ballast = std::fs::File::create(self.place.join("ballast")).unwrap();
        while self.free() > leave {
            let most = (self.free() - leave).min(1 << 16) as usize;
            if ballast.write_all(&vec![0; most]).is_err() {
                break;
            }
        }
    }

    fn relieve(&self) {
        std::fs::remove_file(self.place.join("ballast")).unwrap();
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg("-l").arg(&self.place).output();
    }
}

/// The disk fills up while a job runs, down to a random rest, so that another write fails each time: reads go on, the
/// job rests with `storage.enospc` (or has not noticed), and goes on to the same data when there is room.
pub fn full_disk(count: u64, seed: u64) -> String {
    let directory = tempfile::tempdir().unwrap();
    let mut noticed = 0;
    let mut refused = 0;
    let mut reference = None;
    for round in 0..count {
        let Some(disk) = SmallDisk::mount(&directory.path().join(round.to_string()), 96 << 20) else {
            return "not shown: this user may not mount a small disk".to_owned();
        };
        let service = Service::start(&disk.place, &["--slots", "1", "--disk-reserve-bytes", "1000000"]);
        let body = long_job();
        let expected = reference.get_or_insert_with(|| Expected::of(&service, &body));
        let id = service.submit(&body);
        eventually("it is under way", Duration::from_secs(20), || {
            (service.job(&id)["progress"]["step"].as_u64() > Some(0)).then_some(())
        });
        // From nothing at all to what a few checkpoints need.
        let leave = (2e6 * chance(seed, round).powi(3)) as u64;
        disk.fill(leave);
        let full = std::time::Instant::now();
        while full.elapsed() < Duration::from_secs(3) {
            let job = service.job(&id);
            assert!(service.get("/v1/jobs").status == 200 && service.get("/healthz").status == 200);
            assert!(service.get(&format!("/v1/jobs/{id}/files")).status == 200);
            if job["state"] == "paused" {
                assert_eq!(job["reason"], "storage.enospc");
                noticed += 1;
                break;
            }
            assert_ne!(job["state"], "failed", "{job}");
            std::thread::sleep(Duration::from_millis(50));
        }
        let answer = service.post("/v1/jobs", &steady_job());
        assert!([201, 507].contains(&answer.status), "{}: {}", answer.status, answer.text());
        refused += u64::from(answer.status == 507);
        let other = (answer.status == 201).then(|| answer.json()["id"].as_str().unwrap().to_owned());
        disk.relieve();
        let job = service.wait_for(&id, &["succeeded"]);
        assert_eq!(job["warnings"], json!([]));
        expected.check(&service, &id);
        if let Some(other) = other {
            service.wait_for(&other, &["succeeded"]);
        }
        drop(service);
    }
    format!(
        "{count} full disks: {noticed} jobs rested with storage.enospc and went on by themselves, {refused} submissions got 507, all data identical"
    )
}

/// A worker that outgrows its limit is ended with that reason, and the service stays as it is.
pub fn memory_limit(count: u64, _: u64) -> String {
    let directory = tempfile::tempdir().unwrap();
    let service = Service::start(directory.path(), &["--slots", "1"]);
    for _ in 0..count {
        let ended = crowded(&service);
        assert_eq!(ended["reason"], "limit.memory", "{ended}");
        assert_eq!(service.get("/readyz").status, 200);
    }
    format!("{count} workers ended at their limit with limit.memory")
}

/// A job whose limit is lowered behind the service's back, in its resolved body, below what every worker has.
fn crowded(service: &Service) -> Value {
    let blocker = service.submit(&endless_job());
    let id = service.submit(&endless_job());
    service.with_store(|store| {
        store.execute(
            "UPDATE jobs SET resolved = json_set(resolved, '$.limits.memory_bytes', 4000000) WHERE id = ?1",
            [&id],
        )
    });
    service.act(&blocker, "cancel");
    eventually("it fails", Duration::from_secs(30), || {
        let job = service.job(&id);
        (job["state"] == "failed").then_some(job)
    })
}

/// A worker that stands still (SIGSTOP) is ended after its lease, and the job goes on to the same data.
pub fn stalled_workers(count: u64, seed: u64) -> String {
    let directory = tempfile::tempdir().unwrap();
    let service = Service::start(directory.path(), &["--slots", "1", "--lease-s", "3"]);
    // Long enough not to have ended when the signal comes, however busy the machine.
    let body = long_job();
    let expected = Expected::of(&service, &body);
    for round in 0..count {
        let id = service.submit(&body);
        let pid = service.worker_eventually(&id);
        std::thread::sleep(Duration::from_secs_f64(0.4 * chance(seed, round)));
        signal(pid, Signal::STOP);
        service.wait_for(&id, &["succeeded"]);
        expected.check(&service, &id);
        let events = service.events(&id);
        let reasons: Vec<&Value> = events.iter().map(|event| &event["data"]["reason"]).collect();
        assert!(reasons.iter().any(|reason| *reason == "worker.stalled"), "{reasons:?}");
    }
    format!("{count} workers that stood still were ended with worker.stalled, all data identical")
}

/// The clock is set forward and back by up to a day while jobs are made, run and listed: ids rise, pages have every job
/// once, nothing expires or ends early, events stay in order.
pub fn clock_steps(count: u64, seed: u64) -> String {
    let directory = tempfile::tempdir().unwrap();
    let offset = directory.path().join("offset");
    std::fs::write(&offset, "0").unwrap();
    let data = directory.path().join("data");
    std::fs::create_dir(&data).unwrap();
    let variables = [("MENISCUS_CLOCK_OFFSET_FILE", offset.to_str().unwrap())];
    let mut service = Service::start_with(&data, &["--slots", "2", "--retention-days", "30"], &variables);
    let body = steady_job();
    let expected = Expected::of(&service, &body);
    let running = service.submit(&body);
    let mut ids = Vec::new();
    for step in 0..count {
        let seconds = (172_800.0 * (chance(seed, step) - 0.5)) as i64;
        std::fs::write(&offset, seconds.to_string()).unwrap();
        ids.push(service.submit(&json!({"scene": {"kind": "redistance", "spacing": 0.2}, "priority": -10})));
        if step % 50 == 25 {
            service.kill();
            service.restart();
        }
    }
    assert!(ids.is_sorted(), "ids fall");
    let mut seen = Vec::new();
    let mut path = "/v1/jobs?sort=created_at&limit=7".to_owned();
    loop {
        let page = service.get(&path).json();
        seen.extend(page["items"].as_array().unwrap().iter().map(|job| job["id"].as_str().unwrap().to_owned()));
        match page["next"].as_str() {
            Some(next) => path = format!("/v1/jobs?sort=created_at&limit=7&cursor={next}"),
            None => break,
        }
    }
    assert_eq!(seen.len() as u64, count + 2);
    assert!(seen.is_sorted());
    for id in ids.iter().chain([&running]) {
        service.wait_for(id, &["succeeded"]);
    }
    expected.check(&service, &running);
    assert!(service.stop());
    service.fsck();
    format!("{count} steps of the clock within ±1 day: ids rise, every job is listed once, all have succeeded")
}

/// Descriptors run out while jobs wait: none of them fails, and all run when there are some again.
pub fn descriptor_shortage(count: u64, seed: u64) -> String {
    let directory = tempfile::tempdir().unwrap();
    let service = Service::start(directory.path(), &["--slots", "2"]);
    let limit = |soft: u64| {
        let status = Command::new("prlimit")
            .args(["--pid", &service.pid().to_string(), &format!("--nofile={soft}:")])
            .status()
            .unwrap();
        assert!(status.success());
    };
    let (mut missed, mut jobs) = (0, 0);
    for round in 0..count {
        let open = std::fs::read_dir(format!("/proc/{}/fd", service.pid())).unwrap().count() as u64;
        let blocker = service.submit(&endless_job());
        let ids: Vec<String> =
            (0..3).map(|_| service.submit(&json!({"scene": {"kind": "redistance", "spacing": 0.2}}))).collect();
        // Enough for a client that asks, and for no worker's pipes.
        limit(open + 2);
        std::thread::sleep(Duration::from_secs_f64(0.5 + chance(seed, round)));
        limit(1024);
        service.act(&blocker, "cancel");
        for id in &ids {
            let job = service.wait_for(id, &["succeeded"]);
            assert_eq!(job["attempt"], 1, "{job}");
            missed += service.events(id).iter().filter(|event| event["data"]["hint"].is_string()).count();
            jobs += 1;
        }
    }
    format!("{jobs} jobs in {count} shortages of descriptors, {missed} missed starts, none failed")
}
