//! The promises on a Slurm cluster: real daemons of two nodes on this machine, the real service, unchanged workers.
//!
//! `make test-cluster` installs Slurm and runs them; without it they are left out.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod faults;
mod loopback;
#[path = "../faults/common.rs"]
#[expect(dead_code, reason = "each test target uses a part")]
mod results;
#[path = "../support/service.rs"]
#[expect(dead_code, reason = "each test target uses a part")]
mod service;
mod soak;
mod workings;

/// `common.rs` names the support so.
mod support {
    pub use crate::service::Service;
}

use loopback::Cluster;
use results::Expected;
use serde_json::{Value, json};
use service::Service;
use std::path::Path;

/// The configuration of a service on a trial cluster.
pub fn configuration(cluster: &Cluster, more: &str) -> String {
    format!(
        "[executor]\nkind = \"slurm\"\nshared = \"{}\"\nprogram = \"{}\"\nmemory-bytes = 500000000\nslots = 40\npoll-s = 0.5\n\
         submission-interval-s = 0.02\nsettle-grace-s = 3\nheartbeat-s = 0.5\nlease-s = 8\ngrace-s = 30\n{more}\n",
        cluster.shared().display(),
        service::program().display(),
    )
}

/// A service that uses a cluster.
pub fn serve(cluster: &Cluster) -> Service {
    serve_with(cluster, "", &[])
}

/// With further lines of the configuration, and variables in its environment.
pub fn serve_with(cluster: &Cluster, more: &str, variables: &[(&str, &str)]) -> Service {
    let file = cluster.path("config.toml");
    std::fs::write(&file, configuration(cluster, more)).unwrap();
    let conf = cluster.path("slurm.conf");
    let mut all = vec![("SLURM_CONF", conf.to_str().unwrap())];
    all.extend_from_slice(variables);
    Service::start_with(&cluster.path("data"), &["--config", file.to_str().unwrap()], &all)
}

/// What an undisturbed run of a body gives, on this machine without a cluster.
pub fn undisturbed(body: &Value) -> Expected {
    let data = tempfile::tempdir().unwrap();
    Expected::of(&Service::start(data.path(), &[]), body)
}

/// A job of some seconds with frames, series and checkpoints.
pub fn body() -> Value {
    json!({
        "scene": {"kind": "droplet", "spacing": 0.05, "end_time": 0.3},
        "output": {"every_time": 0.1},
        "checkpoint": {"every_steps": 200}
    })
}

/// A job of three times as long.
pub fn longer() -> Value {
    let mut longer = body();
    longer["scene"]["end_time"] = json!(0.9);
    longer["output"]["every_time"] = json!(0.3);
    longer
}

/// A job at work on a cluster, and what it gives when nothing disturbs it.
pub struct Trial {
    /// The results of an undisturbed run.
    pub expected: Expected,
    /// Where it runs.
    pub cluster: Cluster,
    /// The service that uses the cluster.
    pub service: Service,
    /// Id of the job.
    pub id: String,
}

impl Trial {
    /// Runs a body without a cluster, then begins it on one and waits for its first checkpoint.
    pub fn begin(body: &Value) -> Self {
        let expected = undisturbed(body);
        let cluster = Cluster::start();
        let service = serve(&cluster);
        let id = service.submit(body);
        wait_for_checkpoint(&service, &id);
        Self { expected, cluster, service, id }
    }
}

/// A job comes to its end in an attempt, with the results of an undisturbed run.
pub fn check_attempt(service: &Service, id: &str, attempt: u64, expected: &Expected) {
    let job = service.wait_for(id, &["succeeded"]);
    assert_eq!(job["attempt"], attempt, "{job}");
    check(service, id, expected);
}

/// Frames and series are those of an undisturbed run.
pub fn check(service: &Service, id: &str, expected: &Expected) {
    assert_eq!(service.frames(id), expected.frames, "{id}");
    assert_eq!(service.series(id), expected.series, "{id}");
}

/// Waits until a job has made a checkpoint.
pub fn wait_for_checkpoint(service: &Service, id: &str) {
    service::eventually("there is a checkpoint", std::time::Duration::from_secs(60), || {
        let made = service.get(&format!("/v1/jobs/{id}/checkpoints")).json();
        (!made["items"].as_array().unwrap().is_empty()).then_some(())
    });
}

/// Directory of an attempt on the shared file system.
pub fn attempt_directory(cluster: &Cluster, id: &str, attempt: u64) -> std::path::PathBuf {
    let jobs: &Path = &cluster.shared().join("jobs");
    jobs.join(id).join("attempts").join(attempt.to_string())
}
