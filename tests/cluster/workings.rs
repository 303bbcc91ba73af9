//! What a user does: run, watch, pause, cancel, restart the service.

use crate::results::Expected;
use crate::service::{Service, eventually};
use crate::{Cluster, Trial, body, check, longer, serve, serve_with, undisturbed, wait_for_checkpoint};
use serde_json::json;
use std::time::{Duration, Instant};

#[test]
#[ignore = "needs Slurm: make test-cluster"]
fn jobs_run_over_both_nodes_and_a_restart_of_the_service_changes_nothing() {
    let expected = undisturbed(&body());
    let cluster = Cluster::start();
    let mut service = serve(&cluster);
    let ids: Vec<String> = (0..4).map(|_| service.submit(&body())).collect();
    for id in &ids {
        wait_for_checkpoint(&service, id);
    }
    // The service is away for a while; the cluster is not.
    service.kill();
    std::thread::sleep(Duration::from_secs(2));
    service.restart();
    for id in &ids {
        let job = service.wait_for(id, &["succeeded"]);
        assert_eq!(job["attempt"], 1, "{job}");
        check(&service, id, &expected);
    }
    // A stop leaves what runs alone.
    let id = service.submit(&longer());
    wait_for_checkpoint(&service, &id);
    assert!(service.stop());
    assert_eq!(cluster.queue("%j").len(), 1);
    service.restart();
    assert_eq!(service.wait_for(&id, &["succeeded"])["attempt"], 1);
    assert!(service.stop());
    service.fsck();
}

#[test]
#[ignore = "needs Slurm: make test-cluster"]
fn a_job_says_what_it_waits_for_and_a_cancel_is_prompt_everywhere() {
    let cluster = Cluster::start();
    let service = serve_with(&cluster, "", &[]);
    // As many as both nodes take, and one more.
    let ids: Vec<String> = (0..8).map(|_| service.submit(&crate::service::endless_job())).collect();
    for id in &ids {
        eventually("it works", Duration::from_secs(30), || service.worker(id));
    }
    let waiting = service.submit(&body());
    let said = eventually("it says what it waits for", Duration::from_secs(20), || {
        service.job(&waiting)["waiting_for"]
            .as_str()
            .filter(|said| said.contains("Resources") || said.contains("Priority"))
            .map(str::to_owned)
    });
    assert!(said.starts_with("slurm ("), "{said}");
    assert_eq!(service.job(&waiting)["state"], "running");
    for id in [&waiting, &ids[0]] {
        let began = Instant::now();
        assert_eq!(service.act(id, "cancel").status, 202);
        service.wait_for(id, &["canceled"]);
        assert!(began.elapsed() < Duration::from_secs(2), "{:?}", began.elapsed());
    }
    // Right behind its submission.
    let id = service.submit(&body());
    let began = Instant::now();
    service.act(&id, "cancel");
    service.wait_for(&id, &["canceled"]);
    assert!(began.elapsed() < Duration::from_secs(2), "{:?}", began.elapsed());
    for id in &ids[1..] {
        service.act(id, "cancel");
    }
    for id in &ids[1..] {
        service.wait_for(id, &["canceled"]);
    }
    eventually("the cluster is empty", Duration::from_secs(20), || cluster.queue("%j").is_empty().then_some(()));
    let metrics = service.get("/metrics").text();
    for name in [
        "meniscus_slurm_table_age_seconds",
        "meniscus_slurm_jobs",
        "meniscus_slurm_node_jobs{node=\"node1\"}",
        "meniscus_slurm_unsure",
        "meniscus_slurm_sbatch_seconds",
    ] {
        assert!(metrics.contains(name), "{name}");
    }
}

#[test]
#[ignore = "needs Slurm: make test-cluster"]
fn a_pause_on_the_cluster_keeps_its_checkpoint_and_restarts_are_bit_identical() {
    let Trial { expected, cluster: _cluster, service, id } = Trial::begin(&body());
    service.act(&id, "pause");
    let job = service.wait_for(&id, &["paused"]);
    assert_eq!(job["reason"], "user.pause");
    service.act(&id, "resume");
    let job = service.wait_for(&id, &["succeeded"]);
    assert_eq!(job["attempt"], 2);
    check(&service, &id, &expected);
    // A limit of time that is used up while the cluster has the job in its queue is none.
    let mut limited = body();
    limited["limits"] = json!({"wall_s": 600});
    let id = service.submit(&limited);
    service.wait_for(&id, &["succeeded"]);
}

#[test]
#[ignore = "needs Slurm: make test-cluster"]
fn a_service_that_drains_takes_its_jobs_back() {
    let cluster = Cluster::start();
    let mut service = serve_with(&cluster, "", &[]);
    assert!(service.stop());
    let file = cluster.path("config.toml");
    service.restart_with(&["--config", file.to_str().unwrap(), "--drain"]);
    let id = service.submit(&body());
    wait_for_checkpoint(&service, &id);
    assert!(service.stop());
    eventually("the cluster is empty", Duration::from_secs(20), || cluster.queue("%j").is_empty().then_some(()));
    service.restart();
    let job = service.wait_for(&id, &["succeeded"]);
    assert_eq!(job["attempt"], 2, "{job}");
}

#[test]
#[ignore = "needs Slurm: make test-cluster"]
fn another_build_on_a_node_is_named_and_nothing_is_lost() {
    let cluster = Cluster::start();
    let copy = cluster.path("meniscus");
    std::fs::copy(crate::service::program(), &copy).unwrap();
    let text = crate::configuration(&cluster, "")
        .replace(&crate::service::program().display().to_string(), &copy.display().to_string());
    let file = cluster.path("config.toml");
    std::fs::write(&file, text).unwrap();
    let conf = cluster.path("slurm.conf");
    let service = Service::start_with(
        &cluster.path("data"),
        &["--config", file.to_str().unwrap()],
        &[("SLURM_CONF", conf.to_str().unwrap())],
    );
    // Another build is installed while the service runs.
    let mut bytes = std::fs::read(&copy).unwrap();
    bytes.extend_from_slice(b"another build");
    std::fs::remove_file(&copy).unwrap();
    std::fs::write(&copy, bytes).unwrap();
    std::fs::set_permissions(&copy, std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
    let id = service.submit(&body());
    let job = eventually("the job says why", Duration::from_secs(60), || {
        let job = service.job(&id);
        job["hint"].as_str().is_some_and(|said| said.contains("another build")).then_some(job)
    });
    assert_eq!((&job["state"], &job["reason"]), (&json!("queued"), &json!("worker.evicted")), "{job}");
    assert!(job["hint"].as_str().unwrap().contains("tries again by itself"), "{job}");
}

/// A job of a second, whose running time is known from one before.
fn short_body() -> serde_json::Value {
    json!({"scene": {"kind": "redistance", "spacing": 0.02, "repeat": 100}, "checkpoint": {"every_steps": 20}})
}

/// A cluster on which the time of a short job is known, and what the job gives.
fn short_trial() -> (Cluster, Service, Expected) {
    let cluster = Cluster::start();
    let service = serve(&cluster);
    let expected = Expected::of(&service, &short_body());
    (cluster, service, expected)
}

#[test]
#[ignore = "needs Slurm: make test-cluster"]
fn short_jobs_share_a_job_of_the_cluster_and_each_keeps_its_promises() {
    let expected = undisturbed(&short_body());
    let cluster = Cluster::start();
    let mut service = serve(&cluster);
    // The first tells how long they take.
    let first = service.submit(&short_body());
    service.wait_for(&first, &["succeeded"]);
    let jobs = || {
        cluster
            .ask("squeue", &["-h", "-t", "all", "-o", "%j"])
            .unwrap()
            .lines()
            .filter(|name| name.starts_with("mns-"))
            .count()
    };
    let before = jobs();
    let values: Vec<f64> = (0..30).map(|k| 0.02 + 1e-5 * f64::from(k)).collect();
    let study = json!({"base": short_body(), "sweep": {"mode": "grid", "axes": {"/scene/spacing": values}}});
    let answer = service.post("/v1/studies", &study);
    assert_eq!(answer.status, 201, "{}", answer.text());
    let study = answer.json()["id"].as_str().unwrap().to_owned();
    eventually("some are done", Duration::from_secs(60), || {
        let view = service.get(&format!("/v1/studies/{study}")).json();
        (view["counts"]["succeeded"].as_u64().unwrap_or(0) >= 5).then_some(())
    });
    // Those that wait behind others can be taken back at once.
    let last = service.get(&format!("/v1/jobs?study={study}&state=running&limit=200")).json();
    let victim =
        last["items"].as_array().unwrap().iter().map(|job| job["id"].as_str().unwrap().to_owned()).max().unwrap();
    let began = Instant::now();
    service.act(&victim, "cancel");
    service.wait_for(&victim, &["canceled"]);
    assert!(began.elapsed() < Duration::from_secs(2), "{:?}", began.elapsed());
    service.kill();
    service.restart();
    let view = eventually("all are done", Duration::from_secs(120), || {
        let view = service.get(&format!("/v1/studies/{study}")).json();
        (view["counts"]["succeeded"] == 29).then_some(view)
    });
    assert_eq!(view["counts"]["canceled"], 1, "{view}");
    assert!(jobs() - before <= 4, "{} jobs of the cluster", jobs() - before);
    let again = service.submit(&short_body());
    service.wait_for(&again, &["succeeded"]);
    check(&service, &again, &expected);
    let one = service.get(&format!("/v1/jobs?study={study}&state=succeeded&limit=200")).json();
    for job in one["items"].as_array().unwrap() {
        assert_eq!(job["attempt"], 1, "{job}");
    }
    eventually("lists and scripts are gone", Duration::from_secs(60), || {
        std::fs::read_dir(cluster.shared().join("bundles")).unwrap().next().is_none().then_some(())
    });
}

#[test]
#[ignore = "needs Slurm: make test-cluster"]
fn a_bundle_that_the_cluster_ends_gives_its_attempts_back() {
    let (cluster, service, expected) = short_trial();
    let short = short_body();
    let ids: Vec<String> = (0..12).map(|_| service.submit(&short)).collect();
    let bundle = eventually("the bundle works", Duration::from_secs(30), || {
        cluster.queue("%j %T").into_iter().find(|row| row.contains("bundle") && row.contains("RUNNING"))
    });
    service.wait_for(&ids[0], &["succeeded"]);
    let name = bundle.split(' ').next().unwrap();
    cluster.ask("scancel", &["--me", &format!("--name={name}")]).unwrap();
    for id in &ids {
        service.wait_for(id, &["succeeded"]);
        check(&service, id, &expected);
    }
}

#[test]
#[ignore = "needs Slurm: make test-cluster"]
fn a_worker_of_a_bundle_that_dies_is_tried_again_while_the_others_go_on() {
    let (_cluster, service, expected) = short_trial();
    let short = short_body();
    let ids: Vec<String> = (0..6).map(|_| service.submit(&short)).collect();
    crate::service::signal(service.worker_eventually(&ids[0]), rustix::process::Signal::KILL);
    for id in &ids {
        let job = service.wait_for(id, &["succeeded"]);
        assert_eq!(job["attempt"].as_u64(), Some(if *id == ids[0] { 2 } else { 1 }), "{job}");
        check(&service, id, &expected);
    }
}
