//! `kill -9` of the service and of workers at random moments.

use crate::common::Expected;
use crate::support::{Service, chance, eventually, signal, steady_job};
use rustix::process::Signal;
use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// Kills of the service under load: no acknowledged job is lost, doubled or stuck, and all data are those of an
/// undisturbed run.
pub fn of_the_service(count: u64, seed: u64) -> String {
    let directory = tempfile::tempdir().unwrap();
    let mut service = Service::start(directory.path(), &["--slots", "2"]);
    let body = steady_job();
    let expected = Expected::of(&service, &body);
    let mut acknowledged: Vec<String> = (0..3).map(|_| service.submit(&body)).collect();
    let mut open = acknowledged.clone();
    for kill in 0..count {
        std::thread::sleep(Duration::from_secs_f64(0.4 * chance(seed, kill)));
        if kill % 7 == 3 {
            // Killed right after the 201.
            acknowledged.push(service.submit(&body));
            open.extend(acknowledged.last().cloned());
        }
        let workers: Vec<u32> = open.iter().filter_map(|id| service.worker(id)).collect();
        service.kill();
        eventually("orphans are gone by the closed pipe alone", Duration::from_secs(5), || {
            let alive = |pid: &u32| {
                std::fs::read_to_string(format!("/proc/{pid}/status")).is_ok_and(|s| !s.contains("State:\tZ"))
            };
            (!workers.iter().any(alive)).then_some(())
        });
        service.restart();
        open.retain(|id| service.job(id)["state"] != "succeeded");
        if open.len() < 2 {
            acknowledged.push(service.submit(&body));
            open.extend(acknowledged.last().cloned());
        }
    }
    for id in &acknowledged {
        let job = service.wait_for(id, &["succeeded"]);
        expected.check(&service, id);
        assert_eq!(job["warnings"], json!([]), "a restart of the service is no fault of the job");
    }
    // None doubled: the store knows these and the undisturbed one.
    let all = service.get("/v1/jobs?limit=500").json();
    assert_eq!(all["items"].as_array().unwrap().len(), acknowledged.len() + 1);
    assert!(service.stop(), "the service did not end well");
    service.fsck();
    format!("{count} kills of the service, {} jobs acknowledged and finished, all data identical", acknowledged.len())
}

/// Kills of the service while a study refines: its levels and its table are those of an undisturbed study, and none is made twice.
pub fn of_a_refinement(count: u64, seed: u64) -> String {
    let directory = tempfile::tempdir().unwrap();
    let mut service = Service::start(directory.path(), &["--slots", "1"]);
    let body = json!({
        "base": {"scene": {"kind": "redistance", "repeat": 12}, "checkpoint": {"every_steps": 3}},
        "sweep": {"mode": "refine", "axis": "/scene/spacing", "from": 0.08, "ratio": 1.5, "levels": {"least": 3, "most": 4},
            "quantity": {"error": {"quantity": "phi", "norm": "rms"}}, "until": {"tolerance": 1e-30}, "reuse": false},
    });
    let submit = |service: &Service| service.post("/v1/studies", &body).json()["id"].as_str().unwrap().to_owned();
    let is_over = |service: &Service, id: &str| {
        (service.get(&format!("/v1/studies/{id}")).json()["state"] == "succeeded").then_some(())
    };
    let start = Instant::now();
    let calm = submit(&service);
    eventually("the undisturbed study ends", Duration::from_secs(120), || is_over(&service, &calm));
    let whole = start.elapsed().as_secs_f64();
    let expected = told(&service, &calm);
    let (mut kills, mut studies) = (0, 0);
    while kills < count {
        let id = submit(&service);
        studies += 1;
        while is_over(&service, &id).is_none() && kills < count {
            std::thread::sleep(Duration::from_secs_f64(0.5 * whole * chance(seed, kills)));
            service.kill();
            kills += 1;
            service.restart();
        }
        eventually("the disturbed study ends", Duration::from_secs(120), || is_over(&service, &id));
        assert_eq!(told(&service, &id), expected, "{id}");
    }
    assert!(service.stop(), "the service did not end well");
    service.fsck();
    format!("{kills} kills of the service in {studies} studies that refine, all levels and tables as undisturbed")
}

/// What a study tells but for ids and times: the rows of its table, the values of its levels, and the number of its jobs.
fn told(service: &Service, id: &str) -> Vec<String> {
    let accept = [("accept", "application/json")];
    let table = service.request("GET", &format!("/v1/studies/{id}/table"), &accept, None).json();
    let mut told: Vec<String> = table["rows"].as_array().unwrap().iter().cloned().map(without_times).collect();
    let report = service.get(&format!("/v1/studies/{id}/report")).json();
    told.extend(report["levels"].as_array().unwrap().iter().cloned().map(without_times));
    told.extend(["order", "gci", "convergence", "outcome"].map(|name| report[name].to_string()));
    let jobs = service.get(&format!("/v1/studies/{id}/jobs?limit=100")).json()["items"].as_array().unwrap().len();
    told.push(format!("{jobs} jobs"));
    told
}

fn without_times(mut row: Value) -> String {
    for name in ["job", "cpu_s", "wall_s"] {
        row.as_object_mut().unwrap().shift_remove(name);
    }
    row.to_string()
}

/// Kills of workers: at most what came after the last checkpoint is done again, and the final data are identical.
pub fn of_workers(count: u64, seed: u64) -> String {
    let directory = tempfile::tempdir().unwrap();
    let service = Service::start(directory.path(), &["--slots", "2", "--threads", "2"]);
    let body = steady_job();
    let start = Instant::now();
    let expected = Expected::of(&service, &body);
    // Moments are parts of what a run takes here: on a faster machine too, most of them come before its end.
    let whole = start.elapsed().as_secs_f64();
    let mut kills = 0;
    let mut round = 0;
    let mut repeated = 0_u64;
    let mut jobs = 0;
    // Two deaths a job at most: a third without a new checkpoint would rightly fail it.
    while kills < count {
        let ids: Vec<String> = (0..2).map(|_| service.submit(&body)).collect();
        for (k, id) in ids.iter().enumerate() {
            for death in 0..2 {
                let attempt = service.job(id)["attempt"].as_u64().unwrap().max(1);
                service.wait_for(id, &["running", "succeeded"]);
                let moment = chance(seed, round * 100 + 10 * k as u64 + death);
                std::thread::sleep(Duration::from_secs_f64(0.6 * whole * moment));
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
            repeated = repeated.max(most_repeated(&service, id));
            jobs += 1;
        }
        round += 1;
        assert!(round < 2 * count.max(20), "only {kills} kills found a worker");
    }
    format!("{kills} kills of workers in {jobs} jobs, at most {repeated} steps done again, all data identical")
}

/// The most steps that an attempt of a job did again: what it had come to, less where the next one began. No attempt
/// begins before the newest checkpoint that was announced.
fn most_repeated(service: &Service, id: &str) -> u64 {
    let events = service.events(id);
    let mut announced = std::collections::BTreeMap::new();
    let mut reached = std::collections::BTreeMap::new();
    for event in &events {
        let attempt = event["attempt"].as_u64().unwrap();
        if let Some(step) = event["data"]["step"].as_u64() {
            let best = if event["type"] == "checkpoint" { &mut announced } else { &mut reached };
            let entry: &mut u64 = best.entry(attempt).or_default();
            *entry = step.max(*entry);
        }
    }
    let log = service.get(&format!("/v1/jobs/{id}/log")).text();
    let starts: Vec<u64> = log
        .lines()
        .filter_map(|line| line.split("start at step ").nth(1)?.split(',').next()?.trim().parse().ok())
        .collect();
    let mut most = 0;
    for (attempt, start) in (1_u64..).zip(&starts) {
        let before =
            |map: &std::collections::BTreeMap<u64, u64>| map.range(..attempt).map(|(_, s)| *s).max().unwrap_or(0);
        assert!(*start >= before(&announced), "{id}: attempt {attempt} began at {start}, before a checkpoint");
        most = most.max(before(&reached).saturating_sub(*start));
    }
    most
}
