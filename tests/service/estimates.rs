//! Estimates before a run.

use crate::service;
use serde_json::json;

#[test]
fn estimates_check_everything_and_make_nothing() {
    let (_directory, service) = service(&[]);
    let answer = service.post("/v1/estimates", &json!({"scene": {"kind": "vortex", "spacing": 0.03125}}));
    assert_eq!(answer.status, 200);
    let estimate = answer.json();
    assert_eq!(estimate["resolved"]["scene"]["field"], "dual");
    for name in ["particles", "steps", "memory_bytes", "disk_bytes"] {
        assert!(estimate[name].as_u64().unwrap() > 0, "{name}");
    }
    assert!(estimate["wall_s"].is_null(), "nothing is known of this machine yet");
    let wrong = service.post("/v1/estimates", &json!({"scene": {"kind": "vortex", "spacing": -1}, "nme": 1}));
    assert_eq!((wrong.status, wrong.pointers()), (422, vec!["/nme".to_owned(), "/scene/spacing".to_owned()]));
    assert_eq!(service.get("/v1/jobs").json()["items"], json!([]));
}

#[test]
fn finished_jobs_teach_what_the_next_will_take() {
    let (_directory, service) = service(&["--slots", "1", "--threads", "1"]);
    let body = |repeat: u64| json!({"scene": {"kind": "redistance", "spacing": 0.015625, "repeat": repeat}});
    let first = service.submit(&body(40));
    service.wait_for(&first, &["succeeded"]);
    let estimate = service.post("/v1/estimates", &body(160)).json();
    let expected = estimate["cpu_s"].as_f64().unwrap();
    let second = service.submit(&body(160));
    let job = service.wait_for(&second, &["succeeded"]);
    let taken = job["usage"]["cpu_s"].as_f64().unwrap();
    // Machines are noisy; that the one run is four times the other is what was learned.
    assert!((0.4..2.5).contains(&(expected / taken)), "{expected} s expected, {taken} s taken");
    assert!(estimate["basis"].as_str().unwrap().contains("redistance/2"));
}
