//! Data directories: databases that are lost or older than the files beside them, and folders of others.

use crate::common::Expected;
use crate::support::{Service, chance, eventually, steady_job};
use serde_json::json;
use std::path::Path;
use std::time::Duration;

fn lose_database(data: &Path) {
    for entry in std::fs::read_dir(data).unwrap().flatten() {
        if entry.file_name().to_string_lossy().starts_with("meniscus.sqlite") {
            std::fs::remove_file(entry.path()).unwrap();
        }
    }
}

/// The database is lost, or an older copy is put back, after a stop or a kill at a random moment: the start is refused, and with
/// `--adopt` every job comes back and ends with the same data.
pub fn lost_databases(count: u64, seed: u64) -> String {
    let directory = tempfile::tempdir().unwrap();
    let data = directory.path().join("data");
    let mut service = Service::start(&data, &["--slots", "1"]);
    let body = steady_job();
    let expected = Expected::of(&service, &body);
    let done = service.submit(&json!({"name": "done", "scene": {"kind": "redistance", "spacing": 0.1}}));
    service.wait_for(&done, &["succeeded"]);
    let (mut lost, mut older) = (0, 0);
    for round in 0..count {
        assert!(service.stop());
        let copy = directory.path().join("copy");
        std::fs::copy(data.join("meniscus.sqlite"), &copy).unwrap();
        service.restart();
        let running = service.submit(&body);
        service.worker_eventually(&running);
        std::thread::sleep(Duration::from_secs_f64(chance(seed, 2 * round)));
        if round % 2 == 0 {
            assert!(service.stop());
        } else {
            service.kill();
            // The worker ends when it notices that its service has gone.
            std::thread::sleep(Duration::from_millis(300));
        }
        lose_database(&data);
        if chance(seed, 2 * round + 1) < 0.5 {
            lost += 1;
        } else {
            std::fs::copy(&copy, data.join("meniscus.sqlite")).unwrap();
            older += 1;
        }
        assert!(service.refused_start().contains("--adopt"));
        service.restart_with(&["--slots", "1", "--adopt"]);
        assert_eq!(service.job(&done)["state"], "succeeded");
        service.wait_for(&running, &["succeeded"]);
        expected.check(&service, &running);
        service.restart_needs_no_adoption();
    }
    assert!(service.stop());
    service.fsck();
    format!("{lost} lost and {older} older databases: starts refused, all jobs came back, all data identical")
}

/// Folders and files of others, with names of any kind, lie in a data directory: they stay as they are, byte by byte.
pub fn foreign_folders(count: u64, seed: u64) -> String {
    let directory = tempfile::tempdir().unwrap();
    let data = directory.path().join("data");
    let mut service = Service::start(&data, &["--slots", "1"]);
    let names =
        ["2025-thesis", ".DS_Store", "job_", "job_mine", "upl_x", "JOB_01JZZZZZZZZZZZZZZZZZZZZZZZ", "attempts", "a b"];
    for round in 0..count {
        assert!(service.stop());
        let name = names[(chance(seed, 2 * round) * names.len() as f64) as usize];
        let parent = ["jobs", "uploads", ""][(chance(seed, 2 * round + 1) * 3.0) as usize];
        let file = data.join(parent).join(format!("{name}-{round}")).join("results.csv");
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(&file, format!("years of work {round}")).unwrap();
        service.restart();
        let id = service.submit(&json!({"scene": {"kind": "redistance", "spacing": 0.2}}));
        service.wait_for(&id, &["succeeded"]);
        assert_eq!(service.request("DELETE", &format!("/v1/jobs/{id}"), &[], None).status, 204);
        eventually("its folder is gone", Duration::from_secs(5), || {
            (!data.join("jobs").join(&id).exists()).then_some(())
        });
        assert_eq!(std::fs::read_to_string(&file).unwrap(), format!("years of work {round}"));
    }
    let left =
        ["jobs", "uploads", ""].iter().flat_map(|parent| std::fs::read_dir(data.join(parent)).unwrap().flatten());
    let kept = left.filter(|entry| entry.path().join("results.csv").is_file()).count();
    assert_eq!(kept as u64, count);
    format!("{count} folders of others were left as they are")
}
