//! Studies: one object, many jobs.

use crate::service;
use crate::support::{Service, endless_job, eventually};
use serde_json::{Value, json};
use std::time::Duration;

fn ended(service: &Service, id: &str) -> Value {
    eventually("the study ends", Duration::from_secs(120), || {
        let study = service.get(&format!("/v1/studies/{id}")).json();
        ["succeeded", "failed", "canceled"].contains(&study["state"].as_str().unwrap()).then_some(study)
    })
}

fn submit(service: &Service, body: &Value) -> String {
    let answer = service.post("/v1/studies", body);
    assert_eq!(answer.status, 201, "{}", answer.text());
    let id = answer.json()["id"].as_str().unwrap().to_owned();
    assert_eq!(answer.header("location"), Some(format!("/v1/studies/{id}").as_str()));
    id
}

fn act(service: &Service, id: &str, action: &str) -> Value {
    let answer = service.request("POST", &format!("/v1/studies/{id}/{action}"), &[], Some(b""));
    assert_eq!(answer.status, 202, "{}", answer.text());
    answer.json()
}

#[test]
fn a_grid_is_run_tabulated_and_drawn_with_its_orders() {
    let (_directory, service) = service(&["--slots", "2"]);
    let spec = json!({
        "name": "orders", "base": {"scene": {"kind": "redistance", "method": {"type": "pcp"}}},
        "sweep": {"mode": "grid", "axes": {"/scene/spacing": [0.05, 0.035, 0.025, 0.0175], "/scene/method/degree": [3, 4]}},
    });
    let dry = service.post("/v1/studies?dry_run=true", &spec);
    assert_eq!(dry.status, 200);
    assert_eq!(dry.json()["points"].as_array().unwrap().len(), 8);
    assert!(dry.json()["estimate"]["disk_bytes"].as_u64().unwrap() > 0);
    assert_eq!(service.get("/v1/studies").json()["items"], json!([]), "a dry run makes nothing");
    let id = submit(&service, &spec);
    let study = ended(&service, &id);
    assert_eq!((&study["state"], &study["counts"]["succeeded"]), (&json!("succeeded"), &json!(8)));
    let csv = service.get(&format!("/v1/studies/{id}/table")).text();
    let header: Vec<&str> = csv.lines().next().unwrap().split(',').collect();
    assert_eq!(
        header[..10],
        [
            "index",
            "/scene/spacing",
            "/scene/method/degree",
            "job",
            "state",
            "reason",
            "cpu_s",
            "wall_s",
            "particles",
            "steps"
        ]
    );
    assert!(header[10..].contains(&"error.phi.rms"), "{header:?}");
    assert_eq!(csv.lines().count(), 9);
    let table =
        service.request("GET", &format!("/v1/studies/{id}/table?after=5"), &[("accept", "application/json")], None);
    assert_eq!(table.json()["rows"].as_array().unwrap().len(), 2);
    assert_eq!(table.json()["rows"][0]["/scene/spacing"], 0.0175);
    let report = service.get(&format!("/v1/studies/{id}/report")).json();
    let lines = |quantity: &str, norm: &str| {
        let all = report["errors"].as_array().unwrap();
        all.iter().find(|e| e["quantity"] == quantity && e["norm"] == norm).unwrap()["lines"].clone()
    };
    for line in lines("phi", "rms").as_array().unwrap() {
        assert_eq!(line["points"].as_array().unwrap().len(), 4);
        assert!(line["order"].as_f64().unwrap() > 3.0, "{line}");
    }
    let picture =
        service.request("GET", &format!("/v1/studies/{id}/report?error=phi.max"), &[("accept", "image/svg+xml")], None);
    assert_eq!(picture.header("content-type"), Some("image/svg+xml"));
    assert!(picture.text().contains("order") && picture.text().contains("phi.max"));
    // The events of all jobs, in one row without gaps.
    let events = service.get(&format!("/v1/studies/{id}/events?limit=1000")).json();
    let numbers: Vec<u64> = events["items"].as_array().unwrap().iter().map(|e| e["id"].as_u64().unwrap()).collect();
    assert_eq!(numbers, (1..=numbers.len() as u64).collect::<Vec<_>>());
    let jobs = service.get(&format!("/v1/studies/{id}/jobs?limit=3")).json();
    assert_eq!(jobs["items"][0]["lineage"]["study"], id.as_str());
    assert!(jobs["next"].is_string());
    assert_eq!(service.request("DELETE", &format!("/v1/studies/{id}"), &[], None).status, 204);
    assert_eq!(service.get("/v1/jobs").json()["items"], json!([]));
}

#[test]
fn all_or_nothing_and_every_error_once_at_its_axis() {
    let (_directory, service) = service(&[]);
    let axes = json!({"/scene/spacing": [0.1, -0.1, 0.05], "/scene/repeat": [1, 2, 3, 4]});
    let spec =
        json!({"base": {"scene": {"kind": "redistance"}}, "sweep": {"mode": "grid", "axes": axes}, "max_paralel": 1});
    assert_eq!(service.post("/v1/studies", &spec).pointers(), ["/max_paralel"]);
    let spec = json!({"base": {"scene": {"kind": "redistance"}}, "sweep": {"mode": "grid", "axes": axes}});
    let answer = service.post("/v1/studies", &spec);
    assert_eq!((answer.status, answer.pointers()), (422, vec!["/sweep/axes/~1scene~1spacing/1".to_owned()]));
    assert_eq!(service.get("/v1/jobs").json()["items"], json!([]));
}

#[test]
fn a_study_holds_to_its_parallel_jobs_pauses_resumes_and_cancels() {
    let (_directory, service) = service(&["--slots", "3", "--threads", "1"]);
    let point = json!({"/scene/repeat": 720});
    let spec = json!({"base": {"scene": {"kind": "redistance", "spacing": 0.03125}},
        "sweep": {"mode": "list", "points": vec![point; 30]}, "max_parallel": 1});
    let id = submit(&service, &spec);
    let running = || {
        service.get(&format!("/v1/studies/{id}/jobs?state=running,pausing&limit=50")).json()["items"]
            .as_array()
            .unwrap()
            .len()
    };
    eventually("one runs", Duration::from_secs(20), || (running() == 1).then_some(()));
    for _ in 0..30 {
        assert!(running() <= 1, "more than max_parallel run");
        std::thread::sleep(Duration::from_millis(10));
    }
    act(&service, &id, "pause");
    let study = eventually("all rest", Duration::from_secs(20), || {
        let study = service.get(&format!("/v1/studies/{id}")).json();
        (study["state"] == "paused").then_some(study)
    });
    assert_eq!(study["counts"]["paused"].as_u64().unwrap() + study["counts"]["succeeded"].as_u64().unwrap_or(0), 30);
    assert_eq!(service.request("DELETE", &format!("/v1/studies/{id}"), &[], None).status, 409);
    act(&service, &id, "resume");
    eventually("it runs again", Duration::from_secs(20), || (running() == 1).then_some(()));
    act(&service, &id, "cancel");
    assert_eq!(ended(&service, &id)["state"], "canceled");
    act(&service, &id, "cancel");
}

#[test]
fn the_first_failure_stops_a_study_and_a_retry_goes_on() {
    let (_directory, service) = service(&["--slots", "1"]);
    // Two that are to fail: their workers are ended three times in a row.
    let spec = json!({"base": endless_job(), "on_failure": "stop",
        "sweep": {"mode": "list", "points": [{"/labels": {"k": "0"}}, {"/labels": {"k": "1"}}, {"/labels": {"k": "2"}}]}});
    let id = submit(&service, &spec);
    let first = service.get(&format!("/v1/studies/{id}/jobs?sort=created_at")).json()["items"][0]["id"]
        .as_str()
        .unwrap()
        .to_owned();
    for attempt in 1..=3_u64 {
        let pid = eventually("the attempt runs", Duration::from_secs(20), || {
            (service.job(&first)["attempt"] == attempt).then(|| service.worker(&first)).flatten()
        });
        crate::support::signal(pid, rustix::process::Signal::KILL);
    }
    let study = ended(&service, &id);
    assert_eq!(study["counts"], json!({"failed": 1, "canceled": 2}));
    let canceled = service.get(&format!("/v1/studies/{id}/jobs?state=canceled")).json();
    assert!(canceled["items"][0]["message"].as_str().unwrap().contains("on_failure"));
    let study = act(&service, &id, "retry");
    assert_eq!((&study["points"], &study["counts"]["queued"]), (&json!(3), &json!(3)));
    let jobs = service.get(&format!("/v1/studies/{id}/jobs?limit=50")).json();
    let retried: Vec<&Value> =
        jobs["items"].as_array().unwrap().iter().filter(|j| !j["lineage"]["retry_of"].is_null()).collect();
    assert_eq!(retried.len(), 3);
    // Nothing has failed since: a second retry makes nothing.
    assert_eq!(
        act(&service, &id, "retry")["counts"].as_object().unwrap().values().map(|n| n.as_u64().unwrap()).sum::<u64>(),
        3
    );
    act(&service, &id, "cancel");
    ended(&service, &id);
}

#[test]
fn ten_thousand_points_are_made_paged_and_cancelled() {
    // Small files and no reserve: the space that 10,000 of them are expected to take must be free.
    let (_directory, mut service) = service(&["--slots", "1", "--disk-reserve-bytes", "0"]);
    let points: Vec<Value> = (0..10_000).map(|k| json!({"/scene/shape/radius": 0.6 + 1e-5 * f64::from(k)})).collect();
    let spec = json!({"base": {"scene": {"kind": "redistance", "spacing": 0.3, "shape": {"type": "circle", "radius": 1}}},
        "sweep": {"mode": "list", "points": points}});
    let id = submit(&service, &spec);
    act(&service, &id, "pause");
    service.kill();
    service.restart();
    let mut seen = std::collections::BTreeSet::new();
    let mut path = format!("/v1/studies/{id}/jobs?limit=500");
    loop {
        let answer = service.get(&path);
        for job in answer.json()["items"].as_array().unwrap() {
            assert!(seen.insert(job["id"].as_str().unwrap().to_owned()));
        }
        let Some(link) = answer.header("link") else { break };
        path = link.trim_start_matches('<').split('>').next().unwrap().to_owned();
        // What is made in the meantime shifts nothing.
        service.submit(&json!({"scene": {"kind": "redistance", "spacing": 0.2}}));
    }
    assert_eq!(seen.len(), 10_000);
    let study = act(&service, &id, "cancel");
    let counts = &study["counts"];
    assert_eq!(counts["canceled"].as_u64().unwrap() + counts["succeeded"].as_u64().unwrap_or(0), 10_000, "{counts}");
}
