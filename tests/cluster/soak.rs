//! Long runs on a cluster: `make soak-cluster`. Their results stand in docs/results/cluster.md.

use crate::service::{Service, chance, eventually, seed};
use crate::{Cluster, body, check, serve, undisturbed};
use serde_json::json;
use std::time::{Duration, Instant};

fn minutes(name: &str, default: f64) -> Duration {
    let given = std::env::var(name).ok().and_then(|text| text.parse().ok());
    Duration::from_secs_f64(60.0 * given.unwrap_or(default))
}

fn number(name: &str, default: usize) -> usize {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

#[test]
#[ignore = "a soak of ten minutes: make soak-cluster"]
fn every_job_ends_as_undisturbed_under_random_kills() {
    let jobs = number("MENISCUS_SOAK_JOBS", 200);
    let (seed, time) = (seed(), minutes("MENISCUS_SOAK_MINUTES", 10.0));
    // Long enough that two cores are busy for the whole time.
    let mut body = body();
    body["scene"]["end_time"] = json!(0.6);
    body["output"]["every_time"] = json!(0.2);
    let expected = undisturbed(&body);
    let mut cluster = Cluster::start();
    let mut service = serve(&cluster);
    let ids: Vec<String> = (0..jobs).map(|_| service.submit(&body)).collect();
    let (began, mut kills, mut draw) = (Instant::now(), [0; 3], 0);
    while began.elapsed() < time && !is_all_done(&service, &ids) {
        let mut next = || {
            draw += 1;
            chance(seed, draw)
        };
        std::thread::sleep(Duration::from_secs_f64(2.0 + 10.0 * next()));
        let (away, which) = (Duration::from_secs_f64(8.0 * next()), (4.0 * next()) as usize);
        kills[which.min(2)] += 1;
        disturb(&mut cluster, &mut service, which, away);
        cluster.resume_drained_nodes();
    }
    let mut attempts = 0;
    for id in &ids {
        let job = end_of(&cluster, &service, id);
        assert_eq!(job["state"], "succeeded", "{job}");
        attempts += job["attempt"].as_u64().unwrap();
        check(&service, id, &expected);
    }
    eventually("no job is left in the cluster", Duration::from_secs(60), || {
        cluster.queue("%j").is_empty().then_some(())
    });
    eventually("no process is left", Duration::from_secs(60), || cluster.job_processes().is_empty().then_some(()));
    println!(
        "{jobs} jobs, {attempts} attempts, kills: service {}, controller {}, node {}; {:.0} s in all",
        kills[0],
        kills[1],
        kills[2],
        began.elapsed().as_secs_f64()
    );
}

/// Waits for the end of a job; what keeps it from one is told.
fn end_of(cluster: &Cluster, service: &Service, id: &str) -> serde_json::Value {
    let began = Instant::now();
    loop {
        let job = service.try_job(id).unwrap_or_default();
        if job["state"].as_str().is_some_and(|state| ["succeeded", "failed", "canceled"].contains(&state)) {
            return job;
        }
        if began.elapsed() > Duration::from_secs(900) {
            let nodes = cluster.ask("sinfo", &["-N", "-o", "%N %T %E"]);
            let metrics = service.get("/metrics").text();
            let slurm: Vec<&str> = metrics.lines().filter(|line| line.starts_with("meniscus_slurm")).collect();
            panic!("{job} does not end; queue {:?}, nodes {nodes:?}, {slurm:#?}", cluster.queue("%j %T %r %N"));
        }
        cluster.resume_drained_nodes();
        std::thread::sleep(Duration::from_millis(500));
    }
}

/// Kills the service (0), the controller (1) or the daemon of a node (2, 3), and starts it again after a while.
fn disturb(cluster: &mut Cluster, service: &mut Service, which: usize, away: Duration) {
    match which {
        0 => {
            service.kill();
            std::thread::sleep(away);
            service.restart();
        }
        1 => {
            cluster.kill_controller();
            std::thread::sleep(away);
            cluster.start_controller();
        }
        _ => {
            cluster.kill_node(which - 1);
            // Sometimes longer than the cluster has patience for.
            std::thread::sleep(away * 2);
            cluster.start_node(which - 1);
        }
    }
}

fn is_all_done(service: &Service, ids: &[String]) -> bool {
    ids.iter().all(|id| service.try_job(id).is_some_and(|job| job["state"] == "succeeded"))
}

/// A study of many short jobs, here and on the cluster.
#[test]
#[ignore = "a soak of half an hour: make soak-cluster"]
fn ten_thousand_short_jobs() {
    let count = number("MENISCUS_SOAK_STUDY", 10_000);
    let data = tempfile::tempdir().unwrap();
    let local = Service::start(data.path(), &["--slots", "2"]);
    let here = run_study(&local, count.min(1000), || 0);
    println!("local, two slots: {:.1} jobs/s, {} MB of service memory", here.0, here.1 >> 20);
    drop(local);
    let cluster = Cluster::start();
    let service = serve(&cluster);
    let most = std::cell::Cell::new(0);
    let there = run_study(&service, count, || {
        let jobs = cluster.ask("squeue", &["-h", "-o", "%j"]).map_or(0, |said| said.lines().count());
        most.set(most.get().max(jobs));
        jobs
    });
    println!(
        "cluster of two nodes: {count} jobs, {:.1} jobs/s, {} MB of service memory, at most {} jobs in the cluster",
        there.0,
        there.1 >> 20,
        most.get()
    );
    assert!(most.get() <= 40);
    assert!(there.1 <= 150 << 20, "{} MB", there.1 >> 20);
}

/// Jobs in a second, and the most memory of the service.
fn run_study(service: &Service, count: usize, look: impl Fn() -> usize) -> (f64, u64) {
    let base = json!({"scene": {"kind": "redistance", "spacing": 0.1}, "output": {"fields": ["phi"]}});
    let first = service.submit(&base);
    service.wait_for(&first, &["succeeded"]);
    let values: Vec<f64> = (0..count).map(|k| 0.1 + 1e-6 * k as f64).collect();
    let study = json!({"base": base, "sweep": {"mode": "grid", "axes": {"/scene/spacing": values}}});
    let answer = service.post("/v1/studies", &study);
    assert_eq!(answer.status, 201, "{}", answer.text());
    let id = answer.json()["id"].as_str().unwrap().to_owned();
    let (began, mut memory) = (Instant::now(), 0);
    loop {
        std::thread::sleep(Duration::from_secs(1));
        memory = memory.max(service.resident_bytes());
        look();
        let view = service.get(&format!("/v1/studies/{id}")).json();
        let done = view["counts"]["succeeded"].as_u64().unwrap_or(0) as usize;
        assert_eq!(view["counts"]["failed"].as_u64().unwrap_or(0), 0, "{view}");
        if done == count {
            return (count as f64 / began.elapsed().as_secs_f64(), memory);
        }
        assert!(began.elapsed() < Duration::from_secs(7200), "{view}");
    }
}
