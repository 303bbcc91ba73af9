//! What a service does with a directory: only its own is used, nothing of others is touched, what a database has lost comes back.

use crate::support::{Service, endless_job, eventually, long_job, program};
use serde_json::json;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

/// Removes the database of a stopped service.
fn lose_database(data: &Path) {
    for entry in std::fs::read_dir(data).unwrap().flatten() {
        if entry.file_name().to_string_lossy().starts_with("meniscus.sqlite") {
            std::fs::remove_file(entry.path()).unwrap();
        }
    }
}

fn names(directory: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(directory)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

#[test]
fn a_directory_of_others_is_refused_and_left_as_it_is() {
    let directory = tempfile::tempdir().unwrap();
    let foreign = directory.path().join("jobs/2025-thesis/results.csv");
    std::fs::create_dir_all(foreign.parent().unwrap()).unwrap();
    std::fs::write(&foreign, "years of work").unwrap();
    for command in ["serve", "fsck"] {
        let output = Command::new(program()).args([command, "--data"]).arg(directory.path()).output().unwrap();
        let text = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success(), "{command}");
        assert!(text.contains(directory.path().to_str().unwrap()), "{text}");
    }
    assert_eq!(names(directory.path()), ["jobs"]);
    assert_eq!(names(&directory.path().join("jobs")), ["2025-thesis"]);
    assert_eq!(std::fs::read_to_string(&foreign).unwrap(), "years of work");
}

#[test]
fn foreign_entries_in_our_folders_stay_and_our_own_without_records_are_set_aside() {
    let directory = tempfile::tempdir().unwrap();
    let mut service = Service::start(directory.path(), &["--slots", "1"]);
    assert!(service.stop());
    let jobs = directory.path().join("jobs");
    std::fs::write(jobs.join(".DS_Store"), "").unwrap();
    for folder in ["2025-thesis", "job_mine", "job_01JZZZZZZZZZZZZZZZZZZZZZZZ"] {
        std::fs::create_dir_all(jobs.join(folder)).unwrap();
        std::fs::write(jobs.join(folder).join("results.csv"), "years of work").unwrap();
    }
    service.restart();
    assert!(service.log_text().contains("job_01JZZZZZZZZZZZZZZZZZZZZZZZ"));
    assert!(service.stop());
    assert_eq!(names(&jobs), [".DS_Store", "2025-thesis", "job_mine"]);
    let aside = directory.path().join("orphans/job_01JZZZZZZZZZZZZZZZZZZZZZZZ/results.csv");
    assert_eq!(std::fs::read_to_string(aside).unwrap(), "years of work");
    let output = Command::new(program()).args(["fsck", "--data"]).arg(directory.path()).output().unwrap();
    assert!(output.status.success());
    assert!(String::from_utf8(output.stdout).unwrap().contains("set aside"));
}

#[test]
fn a_clean_stop_folds_the_log_and_keeps_everything() {
    let directory = tempfile::tempdir().unwrap();
    let mut service = Service::start(directory.path(), &["--slots", "1"]);
    let id = service.submit(&json!({"scene": {"kind": "redistance", "spacing": 0.1}}));
    service.wait_for(&id, &["succeeded"]);
    assert!(service.stop());
    assert!(!names(directory.path()).iter().any(|name| name.ends_with("-wal") || name.ends_with("-shm")));
    service.restart();
    assert_eq!(service.job(&id)["state"], "succeeded");
}

#[test]
fn a_lost_database_refuses_the_start_and_jobs_come_back_from_their_files() {
    let directory = tempfile::tempdir().unwrap();
    let mut service = Service::start(directory.path(), &["--slots", "1"]);
    let done = service.submit(&json!({"name": "done", "labels": {"a": "b"},
        "scene": {"kind": "vortex", "spacing": 0.05, "end_time": 0.4}, "output": {"every_time": 0.1}}));
    service.wait_for(&done, &["succeeded"]);
    let failed = service.submit(&json!({"scene": {"kind": "surface_pde", "surface": "sphere", "count": 2000,
        "problem": {"type": "poisson"}, "solver": {"type": "bicgstab", "max_iterations": 2}}}));
    eventually("it fails", Duration::from_secs(60), || (service.job(&failed)["state"] == "failed").then_some(()));
    let canceled = service.submit(&endless_job());
    service.worker_eventually(&canceled);
    service.act(&canceled, "cancel");
    service.wait_for(&canceled, &["canceled"]);
    let paused = service.submit(&long_job());
    let has_begun = || (service.job(&paused)["progress"]["step"].as_u64() > Some(0)).then_some(());
    eventually("it has begun", Duration::from_secs(20), has_begun);
    service.act(&paused, "pause");
    service.wait_for(&paused, &["paused"]);
    let upload = service.request("POST", "/v1/uploads?as=queries&name=places", &[], Some(b"0 0 0\n1 0 0\n")).json();
    let upload = upload["id"].as_str().unwrap().to_owned();
    let is_ready = || (service.get(&format!("/v1/uploads/{upload}")).json()["state"] == "ready").then_some(());
    eventually("the upload is ready", Duration::from_secs(20), is_ready);
    let before = service.job(&done);
    let (files, series) = (service.files(&done), service.series(&done));
    assert!(service.stop());
    lose_database(directory.path());
    let said = service.refused_start();
    for part in ["is missing", "--adopt", "meniscus.sqlite"] {
        assert!(said.contains(part), "{said}");
    }
    assert!(!directory.path().join("meniscus.sqlite").exists());
    service.restart_with(&["--slots", "1", "--adopt"]);
    let after = service.job(&done);
    for field in ["state", "name", "labels", "spec", "resolved", "created_at", "progress", "started_at", "health"] {
        assert_eq!(after[field], before[field], "{field}");
    }
    assert_eq!((service.files(&done), service.series(&done)), (files, series));
    assert_eq!(service.get(&format!("/v1/jobs/{done}/report")).status, 200);
    assert_eq!(service.job(&failed)["state"], "failed");
    assert_eq!(service.job(&canceled)["state"], "canceled");
    assert_eq!(service.job(&paused)["state"], "paused");
    assert_eq!(service.get(&format!("/v1/uploads/{upload}")).json()["name"], "places");
    let latest = service.get(&format!("/v1/jobs/{paused}/checkpoints")).json()["items"][0].clone();
    service.act(&paused, "resume");
    service.worker_eventually(&paused);
    assert!(latest["step"].as_u64().unwrap() > 0);
    assert!(service.stop());
    service.fsck();
    // Once is enough: the next start needs no flag.
    service.restart_with(&["--slots", "1"]);
}

#[test]
fn an_older_database_refuses_the_start_and_learns_what_it_missed() {
    let directory = tempfile::tempdir().unwrap();
    let mut service = Service::start(directory.path(), &["--slots", "1"]);
    let known = service.submit(&endless_job());
    service.worker_eventually(&known);
    service.act(&known, "pause");
    service.wait_for(&known, &["paused"]);
    assert!(service.stop());
    let copy = directory.path().join("copy");
    std::fs::copy(directory.path().join("meniscus.sqlite"), &copy).unwrap();
    service.restart();
    let new = service.submit(&json!({"scene": {"kind": "redistance", "spacing": 0.1}}));
    service.wait_for(&new, &["succeeded"]);
    service.act(&known, "resume");
    service.worker_eventually(&known);
    service.act(&known, "cancel");
    service.wait_for(&known, &["canceled"]);
    assert!(service.stop());
    std::fs::rename(&copy, directory.path().join("meniscus.sqlite")).unwrap();
    let said = service.refused_start();
    assert!(said.contains("is older") && said.contains("2 jobs"), "{said}");
    service.restart_with(&["--slots", "1", "--adopt"]);
    assert_eq!(service.job(&new)["state"], "succeeded");
    assert_eq!(service.job(&known)["state"], "canceled");
    assert_eq!(service.job(&known)["attempt"], 2);
}

#[test]
fn a_backup_of_a_busy_service_starts_by_itself_with_its_uploads() {
    let directory = tempfile::tempdir().unwrap();
    let service = Service::start(&directory.path().join("data"), &["--slots", "1"]);
    let busy = service.submit(&endless_job());
    service.worker_eventually(&busy);
    let upload = service.request("POST", "/v1/uploads?as=queries", &[], Some(b"0 0 0\n1 0 0\n")).json();
    let upload = upload["id"].as_str().unwrap().to_owned();
    let target = directory.path().join("copy");
    let backup = Command::new(program()).args(["backup", "--data"]).arg(&service.data).arg(&target).output().unwrap();
    assert!(backup.status.success(), "{backup:?}");
    let copy = Service::start(&target, &["--slots", "1"]);
    assert_eq!(copy.get(&format!("/v1/uploads/{upload}")).status, 200);
    assert!(target.join("uploads").join(&upload).join("content").is_file());
    copy.worker_eventually(&busy);
}

#[test]
fn what_is_wrong_at_a_start_is_said_with_the_place_and_what_helps() {
    let directory = tempfile::tempdir().unwrap();
    let service = Service::start(&directory.path().join("data"), &[]);
    let serve = |data: &Path, bind: &str| {
        let output = Command::new(program()).args(["serve", "--bind", bind, "--data"]).arg(data).output().unwrap();
        assert!(!output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    let port = service.url.rsplit(':').next().unwrap();
    let taken = serve(&directory.path().join("other"), &format!("127.0.0.1:{port}"));
    assert!(taken.contains(&format!("127.0.0.1:{port}")) && taken.contains("--bind"), "{taken}");
    let busy = serve(&service.data, "127.0.0.1:0");
    assert!(busy.contains("another service") && busy.contains(service.data.to_str().unwrap()), "{busy}");
    let file = directory.path().join("a file");
    std::fs::write(&file, "").unwrap();
    let not_a_directory = serve(&file, "127.0.0.1:0");
    assert!(not_a_directory.contains("is not a directory") && not_a_directory.contains("a file"), "{not_a_directory}");
}
