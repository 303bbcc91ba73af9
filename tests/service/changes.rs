//! Changes of jobs that wait, actions on many, repeats, and jobs that wait for others.

use crate::service;
use crate::support::{endless_job, eventually, long_job};
use serde_json::{Value, json};
use std::time::Duration;

fn quick_job(name: &str) -> Value {
    json!({"name": name, "labels": {"set": "a"}, "scene": {"kind": "redistance", "spacing": 0.1}})
}

#[test]
fn a_job_that_waits_can_be_changed() {
    let (_directory, service) = service(&["--slots", "1"]);
    let blocker = service.submit(&endless_job());
    service.worker_eventually(&blocker);
    let (first, second) = (service.submit(&quick_job("first")), service.submit(&quick_job("second")));
    let path = format!("/v1/jobs/{second}");
    let patch = |headers: &[(&str, &str)], body: &Value| {
        service.request("PATCH", &path, headers, Some(body.to_string().as_bytes()))
    };
    let tag = service.get(&path).header("etag").unwrap().to_owned();
    let changed =
        patch(&[("if-match", &tag)], &json!({"name": null, "labels": {"set": null, "b": "2"}, "priority": 7}));
    assert_eq!(changed.status, 200, "{}", changed.text());
    let job = changed.json();
    assert_eq!(
        (&job["name"], &job["labels"], &job["resolved"]["priority"]),
        (&Value::Null, &json!({"b": "2"}), &json!(7))
    );
    assert_eq!(patch(&[("if-match", &tag)], &json!({"priority": 1})).status, 412);
    let wrong = patch(&[], &json!({"scene": {}, "priority": "high"}));
    assert_eq!((wrong.status, wrong.pointers().len()), (422, 2), "{}", wrong.text());
    assert_eq!(job["waiting_for"], "a free slot, its memory and its disk space");
    let running = service.request("PATCH", &format!("/v1/jobs/{blocker}"), &[], Some(b"{\"priority\": 1}"));
    assert_eq!(running.status, 409);
    service.act(&blocker, "cancel");
    for id in [&first, &second] {
        service.wait_for(id, &["succeeded"]);
    }
    let began = |id: &str| service.job(id)["started_at"].as_str().unwrap().to_owned();
    assert!(began(&second) < began(&first), "the priority was not heeded");
}

#[test]
fn an_action_is_done_to_all_that_a_filter_matches() {
    let (_directory, service) = service(&["--slots", "1"]);
    let blocker = service.submit(&endless_job());
    service.worker_eventually(&blocker);
    let jobs: Vec<String> = (0..5).map(|k| service.submit(&quick_job(&format!("job {k}")))).collect();
    let act = |body: &Value| service.post("/v1/jobs/actions", body);
    let filter = json!({"label.set": "a"});
    let dry = act(&json!({"action": "pause", "filter": filter, "dry_run": true})).json();
    assert_eq!((&dry["matched"], &dry["changed"], &dry["dry_run"]), (&json!(5), &json!(5), &json!(true)));
    assert_eq!(service.job(&jobs[0])["state"], "queued");
    assert_eq!(act(&json!({"action": "pause", "filter": filter})).json()["changed"], 5);
    assert_eq!(service.job(&jobs[4])["state"], "paused");
    let refused = act(&json!({"action": "delete", "filter": filter})).json();
    assert_eq!((&refused["changed"], refused["skipped"].as_array().unwrap().len()), (&json!(0), 5));
    assert_eq!(act(&json!({"action": "cancel", "filter": {"state": ["paused"]}})).json()["changed"], 5);
    assert_eq!(act(&json!({"action": "delete", "filter": filter})).json()["changed"], 5);
    assert_eq!(service.get(&format!("/v1/jobs/{}", jobs[0])).status, 404);
    for body in [
        json!({"action": "cancel", "filter": {}}),
        json!({"action": "cancel"}),
        json!({"action": "x", "filter": filter}),
    ] {
        assert_eq!(act(&body).status, 422, "{body}");
    }
}

#[test]
fn a_failed_or_canceled_job_is_repeated_as_a_new_one() {
    let (_directory, service) = service(&["--slots", "1"]);
    let old = service.submit(&quick_job("again"));
    service.wait_for(&old, &["succeeded"]);
    assert_eq!(service.act(&old, "retry").status, 409);
    let blocker = service.submit(&endless_job());
    let old = service.submit(&quick_job("again"));
    service.act(&old, "cancel");
    let key = [("idempotency-key", "once")];
    let retry = || service.request("POST", &format!("/v1/jobs/{old}/retry"), &key, Some(b""));
    let made = retry();
    assert_eq!(made.status, 201, "{}", made.text());
    let new = made.json();
    assert_eq!((&new["lineage"]["retry_of"], &new["name"]), (&json!(old), &json!("again")));
    assert_eq!(retry().json()["id"], new["id"]);
    service.act(&blocker, "cancel");
    service.wait_for(new["id"].as_str().unwrap(), &["succeeded"]);
}

#[test]
fn jobs_wait_for_others_and_go_on_from_their_last_checkpoint() {
    let (_directory, service) = service(&["--slots", "2"]);
    let mut body = long_job();
    body["scene"]["repeat"] = json!(240);
    body["output"]["every_time"] = json!(60);
    let first = service.submit(&body);
    let answer = service.post("/v1/jobs", &json!({"restart": {"job": first, "overrides": {"/repeat": 300}}}));
    assert_eq!(answer.status, 201, "{}", answer.text());
    let second = answer.json()["id"].as_str().unwrap().to_owned();
    assert_eq!(answer.json()["after"], json!([first]));
    let mut after = quick_job("third");
    after["after"] = json!([second]);
    let third = service.submit(&after);
    assert_eq!(service.job(&third)["waiting_for"], "one job of `after` to succeed");
    for id in [&first, &second, &third] {
        service.wait_for(id, &["succeeded"]);
    }
    let (earlier, later) = (service.job(&second), service.job(&third));
    assert!(earlier["finished_at"].as_str() <= later["started_at"].as_str());
    let newest = service.get(&format!("/v1/jobs/{first}/checkpoints")).json()["items"][0]["id"].clone();
    assert_eq!(earlier["lineage"]["restarted_from"], newest);
    assert_eq!(earlier["progress"]["step"], 300);
    assert!(service.get(&format!("/v1/jobs/{second}/log")).text().contains("at step 240"));
}

#[test]
fn a_job_whose_predecessor_fails_is_canceled_with_all_that_wait_for_it() {
    let (_directory, service) = service(&["--slots", "1"]);
    let first = service.submit(&endless_job());
    let mut chain = vec![first.clone()];
    for k in 0..3 {
        let mut body = quick_job(&format!("link {k}"));
        body["after"] = json!([chain.last()]);
        chain.push(service.submit(&body));
    }
    service.worker_eventually(&first);
    service.act(&first, "cancel");
    for id in &chain[1..] {
        let job = eventually("it is given up", Duration::from_secs(10), || {
            Some(service.job(id)).filter(|job| job["state"] == "canceled")
        });
        assert_eq!(job["reason"], "dependency.failed");
        assert!(job["message"].as_str().unwrap().contains("has not succeeded"), "{job}");
    }
    let mut late = quick_job("late");
    late["after"] = json!([first, "job_none"]);
    let refused = service.post("/v1/jobs", &late);
    assert_eq!((refused.status, refused.pointers()), (422, vec!["/after/0".to_owned(), "/after/1".to_owned()]));
}
