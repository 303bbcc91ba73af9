//! The faults of a cluster, with real daemons: lost nodes and answers, time limits, preemption, doubles, late files.

use crate::service::{eventually, signal};
use crate::{
    Cluster, Trial, attempt_directory, body, check, check_attempt, longer, serve, serve_with, undisturbed,
    wait_for_checkpoint,
};
use rustix::process::Signal;
use serde_json::json;
use std::process::Command;
use std::time::Duration;

#[test]
#[ignore = "needs Slurm: make test-cluster"]
fn a_lost_node_costs_an_interval_while_its_orphan_is_not_believed() {
    let Trial { expected, mut cluster, service, id } = Trial::begin(&longer());
    let node = cluster.node_of(&id);
    cluster.kill_node(node);
    // The orphan may come to its end before the node is declared lost: then its verdict counts.
    service.wait_for(&id, &["succeeded"]);
    check(&service, &id, &expected);
    cluster.start_node(node);
    eventually("no process is left", Duration::from_secs(30), || cluster.job_processes().is_empty().then_some(()));
    let again = service.submit(&body());
    service.wait_for(&again, &["succeeded"]);
}

#[test]
#[ignore = "needs Slurm: make test-cluster"]
fn a_daemon_that_is_back_in_time_loses_nothing() {
    let Trial { expected, mut cluster, service, id } = Trial::begin(&body());
    let node = cluster.node_of(&id);
    cluster.kill_node(node);
    std::thread::sleep(Duration::from_secs(1));
    cluster.start_node(node);
    check_attempt(&service, &id, 1, &expected);
}

#[test]
#[ignore = "needs Slurm: make test-cluster"]
fn a_lost_answer_of_sbatch_makes_no_second_job() {
    let expected = undisturbed(&body());
    let cluster = Cluster::start();
    let service = serve(&cluster);
    // The controller takes the job after the command has given up.
    cluster.freeze_controller(true);
    let id = service.submit(&body());
    eventually("the answer is lost", Duration::from_secs(30), || {
        service.log_text().contains("whether the cluster has a job is not known").then_some(())
    });
    cluster.freeze_controller(false);
    check_attempt(&service, &id, 1, &expected);
    assert_eq!(service.get("/readyz").status, 200);
}

#[test]
#[ignore = "needs Slurm: make test-cluster"]
fn the_time_limit_of_the_cluster_is_a_pause_and_no_end() {
    let expected = undisturbed(&longer());
    let cluster = Cluster::start();
    // TERM comes 55 seconds before the end of a minute.
    let service = serve_with(&cluster, "time-limit-s = 60\n", &[]);
    let file = cluster.path("config.toml");
    let text = std::fs::read_to_string(&file).unwrap().replace("grace-s = 30", "grace-s = 55");
    std::fs::write(&file, text).unwrap();
    let mut service = service;
    assert!(service.stop());
    service.restart();
    let mut slow = longer();
    slow["scene"]["end_time"] = json!(0.9);
    let id = service.submit(&slow);
    let job = service.wait_for(&id, &["succeeded"]);
    check(&service, &id, &expected);
    assert!(job["attempt"].as_u64().unwrap() >= 1, "{job}");
    let evictions = service.events(&id).iter().filter(|event| event["data"]["reason"] == "worker.evicted").count();
    assert_eq!(evictions > 0, job["attempt"].as_u64().unwrap() > 1, "{job}");
}

#[test]
#[ignore = "needs Slurm: make test-cluster"]
fn preemption_sends_the_job_back_to_the_queue_with_its_checkpoint() {
    let Trial { expected, cluster, service, id } = Trial::begin(&longer());
    cluster.node_of(&id);
    cluster
        .ask("sbatch", &["-p", "urgent", "-N2", "--exclusive", "-t", "1", "-o", "/dev/null", "--wrap", "sleep 2"])
        .unwrap();
    check_attempt(&service, &id, 2, &expected);
    let evicted = service.events(&id).iter().any(|event| event["data"]["reason"] == "worker.evicted");
    assert!(evicted, "{:?}", service.events(&id));
}

#[test]
#[ignore = "needs Slurm: make test-cluster"]
fn a_controller_that_forgets_a_job_and_gives_its_number_away_confuses_nobody() {
    let expected = undisturbed(&body());
    let mut cluster = Cluster::start();
    let service = serve(&cluster);
    let id = service.submit(&body());
    eventually("it was submitted", Duration::from_secs(20), || {
        service.log_text().contains("submitted to the cluster").then_some(())
    });
    cluster.kill_controller();
    std::thread::sleep(Duration::from_secs(1));
    cluster.start_controller();
    let other = service.submit(&body());
    for id in [&id, &other] {
        service.wait_for(id, &["succeeded"]);
        check(&service, id, &expected);
    }
}

#[test]
#[ignore = "needs Slurm: make test-cluster"]
fn without_answers_for_a_while_jobs_run_on_and_the_service_stays_ready() {
    let Trial { expected, mut cluster, service, id } = Trial::begin(&body());
    cluster.stop_munged();
    let waiting = service.submit(&body());
    let said = eventually("it says so", Duration::from_secs(30), || {
        service.job(&waiting)["waiting_for"]
            .as_str()
            .filter(|said| said.contains("no answer") || said.contains("rror"))
            .map(str::to_owned)
    });
    assert!(said.starts_with("slurm ("), "{said}");
    assert_eq!(service.get("/readyz").status, 200);
    // What runs comes to its end by its own words.
    assert_eq!(service.wait_for(&id, &["succeeded"])["attempt"], 1);
    check(&service, &id, &expected);
    cluster.start_munged();
    service.wait_for(&waiting, &["succeeded"]);
    check(&service, &waiting, &expected);
}

#[test]
#[ignore = "needs Slurm: make test-cluster"]
fn of_two_jobs_of_one_attempt_one_works() {
    let Trial { expected, cluster, service, id } = Trial::begin(&body());
    let directory = attempt_directory(&cluster, &id, 1);
    let name = format!("--job-name=mns-{id}-1");
    let script = directory.join("slurm.sh").display().to_string();
    let output = format!("--output={}", directory.join("log.txt").display());
    let second =
        cluster.ask("sbatch", &["--parsable", &name, "--export=NIL", &output, "--open-mode=append", &script]).unwrap();
    let state = eventually("the second has ended", Duration::from_secs(30), || {
        let row = cluster.ask("squeue", &["-h", "-t", "all", "-j", &second, "-o", "%T"])?;
        (row != "PENDING" && row != "RUNNING" && row != "COMPLETING").then_some(row)
    });
    assert_eq!(state, "FAILED");
    check_attempt(&service, &id, 1, &expected);
}

#[test]
#[ignore = "needs Slurm: make test-cluster"]
fn a_requeue_by_hand_never_runs_an_attempt_twice() {
    let Trial { expected, cluster, service, id } = Trial::begin(&longer());
    cluster.node_of(&id);
    let number = cluster.queue("%i")[0].clone();
    // The administrator allows what the service has forbidden.
    cluster.ask("scontrol", &["update", &format!("jobid={number}"), "requeue=1"]).unwrap();
    cluster.ask("scontrol", &["requeue", &number]).unwrap();
    service.wait_for(&id, &["succeeded"]);
    check(&service, &id, &expected);
}

#[test]
#[ignore = "needs Slurm: make test-cluster"]
fn a_signal_to_the_worker_is_an_eviction_and_a_kill_a_death() {
    let Trial { expected, cluster, service, id } = Trial::begin(&longer());
    signal(service.worker_eventually(&id), Signal::TERM);
    eventually("there is a second attempt", Duration::from_secs(30), || {
        (service.job(&id)["attempt"] == 2).then_some(())
    });
    let heartbeat = attempt_directory(&cluster, &id, 2).join("heartbeat.json");
    eventually("it gives signs of life", Duration::from_secs(30), || heartbeat.exists().then_some(()));
    signal(service.worker_eventually(&id), Signal::KILL);
    check_attempt(&service, &id, 3, &expected);
    let reasons: Vec<String> =
        service.events(&id).iter().filter_map(|event| event["data"]["reason"].as_str().map(str::to_owned)).collect();
    assert!(
        reasons.contains(&"worker.evicted".to_owned()) && reasons.contains(&"worker.crash".to_owned()),
        "{reasons:?}"
    );
}

#[test]
#[ignore = "needs Slurm: make test-cluster"]
fn a_cluster_that_takes_few_jobs_is_asked_with_patience() {
    let cluster = Cluster::start_with("MaxJobCount=5", None);
    let service = serve(&cluster);
    let mut quick = body();
    quick["scene"]["end_time"] = json!(0.02);
    quick["output"] = json!({});
    let ids: Vec<String> = (0..7).map(|_| service.submit(&quick)).collect();
    for id in &ids {
        assert_eq!(service.wait_for(id, &["succeeded"])["attempt"], 1);
    }
}

#[test]
#[ignore = "needs Slurm: make test-cluster"]
fn a_service_that_is_killed_anywhere_around_a_submission_loses_and_doubles_nothing() {
    let expected = undisturbed(&body());
    let cluster = Cluster::start();
    for place in ["slurm/scripted", "slurm/submitted"] {
        let broken = cluster.path("broken");
        let _ = std::fs::remove_file(&broken);
        let at = format!("{place}:1:{}", broken.display());
        let mut service = serve_with(&cluster, "", &[("MENISCUS_BREAK", &at)]);
        let id = service.submit(&body());
        eventually("the service is killed there", Duration::from_secs(20), || service.has_ended().then_some(()));
        service.restart();
        let job = service.wait_for(&id, &["succeeded"]);
        assert_eq!(job["attempt"], 1, "{place}: {job}");
        check(&service, &id, &expected);
    }
}

/// A mounted file system.
struct Mount(std::path::PathBuf);

impl Drop for Mount {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg("-l").arg(&self.0).status();
    }
}

/// The service sees the shared directory through a file system that remembers for a while what it saw; nodes see it directly.
#[test]
#[ignore = "needs Slurm: make test-cluster"]
fn files_that_come_late_are_waited_for() {
    let seconds = if std::env::var_os("MENISCUS_LATE_FILES").is_some() { 15 } else { 4 };
    let expected = undisturbed(&body());
    let source = tempfile::tempdir().unwrap();
    let cluster = Cluster::start_with("", Some(source.path().to_owned()));
    let cache = format!("attr_timeout={seconds},entry_timeout={seconds},negative_timeout={seconds}");
    let mounted =
        Command::new("bindfs").args(["-o", &cache]).arg(source.path()).arg(cluster.shared()).status().unwrap();
    assert!(mounted.success());
    let _mount = Mount(cluster.shared());
    let file = cluster.path("config.toml");
    drop(serve(&cluster));
    let grace = format!("settle-grace-s = {}\nheartbeat-s = 0.5\nlease-s = 60", seconds + 5);
    let text = crate::configuration(&cluster, "").replace("settle-grace-s = 3\nheartbeat-s = 0.5\nlease-s = 8", &grace);
    std::fs::write(&file, text).unwrap();
    let conf = cluster.path("slurm.conf");
    let service = crate::Service::start_with(
        &cluster.path("data"),
        &["--config", file.to_str().unwrap()],
        &[("SLURM_CONF", conf.to_str().unwrap())],
    );
    let ids: Vec<String> = (0..3).map(|_| service.submit(&body())).collect();
    for id in &ids {
        let job = service.wait_for(id, &["succeeded"]);
        assert_eq!(job["attempt"], 1, "{job}");
        check(&service, id, &expected);
    }
    // A checkpoint that was just written is read on the other node. The job lasts until its files are seen.
    let mut body = longer();
    body["scene"]["end_time"] = serde_json::json!(0.3 * f64::from(seconds));
    let id = service.submit(&body);
    wait_for_checkpoint(&service, &id);
    service.act(&id, "pause");
    service.wait_for(&id, &["paused"]);
    service.act(&id, "resume");
    service.wait_for(&id, &["succeeded"]);
}
