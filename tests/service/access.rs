//! Keys, tokens, names, budgets, and what every answer carries.

use crate::service;
use crate::support::{Service, program};
use serde_json::json;
use std::process::Command;

fn token(name: &str, scopes: &str) -> (String, String) {
    let output = Command::new(program()).args(["token", name, "--scopes", scopes]).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let mut lines = text.lines().map(str::to_owned);
    (lines.next().unwrap(), lines.next().unwrap())
}

#[test]
fn tokens_open_what_their_scopes_say() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("tokens");
    let (alice, first) = token("alice", "read,submit,control");
    let (bob, second) = token("bob", "read");
    std::fs::write(&file, format!("# who\n{first}\n{second}\n")).unwrap();
    assert!(!std::fs::read_to_string(&file).unwrap().contains(&alice), "the file has digests alone");
    let data = directory.path().join("data");
    std::fs::create_dir(&data).unwrap();
    let service = Service::start(&data, &["--token-file", file.to_str().unwrap()]);
    let body = json!({"scene": {"kind": "redistance", "spacing": 0.1}}).to_string();
    let ask = |method: &str, path: &str, token: Option<&str>| {
        let bearer = token.map(|token| format!("Bearer {token}"));
        let headers: Vec<(&str, &str)> = bearer.iter().map(|text| ("authorization", text.as_str())).collect();
        service.request(method, path, &headers, (method == "POST").then_some(body.as_bytes()))
    };
    assert_eq!(ask("GET", "/healthz", None).status, 200);
    let refused = ask("GET", "/v1/jobs", None);
    assert_eq!(refused.status, 401);
    assert!(refused.header("www-authenticate").unwrap().starts_with("Bearer"));
    for path in ["/v1", "/metrics", "/openapi.json", "/v1/nothing"] {
        assert_eq!(ask("GET", path, None).status, 401, "{path}");
    }
    assert_eq!(ask("GET", &format!("/v1/jobs?access_token={alice}"), None).status, 401, "no token in a URL");
    assert_eq!(ask("GET", "/v1/jobs", Some(&bob)).status, 200);
    assert_eq!(ask("POST", "/v1/jobs", Some(&bob)).status, 403);
    let made = ask("POST", "/v1/jobs", Some(&alice));
    assert_eq!(made.status, 201);
    let id = made.json()["id"].as_str().unwrap().to_owned();
    assert_eq!(ask("POST", &format!("/v1/jobs/{id}/cancel"), Some(&bob)).status, 403);
    assert_eq!(ask("DELETE", &format!("/v1/jobs/{id}"), Some("mns_guess")).status, 401);
    let log = service.log_text();
    assert!(!log.contains(&alice) && !log.contains(&bob), "no token in a log");
}

#[test]
fn other_names_and_pages_of_other_origins_are_not_answered() {
    let (_directory, service) = service(&["--allow-host", "sim.example"]);
    let with = |headers: &[(&str, &str)]| service.request("GET", "/v1", headers, None).status;
    assert_eq!(with(&[("host", "evil.example")]), 421);
    assert_eq!(with(&[("host", "sim.example:8080")]), 200);
    assert_eq!(with(&[("origin", "http://evil.example")]), 403);
    assert_eq!(with(&[("origin", &service.url)]), 200);
    let answer = service.get("/v1");
    for name in ["x-request-id", "x-content-type-options", "content-security-policy", "referrer-policy"] {
        assert!(answer.header(name).is_some(), "{name}");
    }
    let missing = service.get("/v1/jobs/job_none");
    assert_eq!(missing.header("content-type"), Some("application/problem+json"));
}

#[test]
fn keys_replay_and_budgets_run_out() {
    let (_directory, service) = service(&["--creations-per-minute", "4", "--most-unfinished", "1000"]);
    let body = json!({"scene": {"kind": "redistance", "spacing": 0.1}}).to_string();
    let send =
        |key: &str, body: &str| service.request("POST", "/v1/jobs", &[("idempotency-key", key)], Some(body.as_bytes()));
    let first = send("a", &body);
    assert_eq!(first.header("ratelimit"), Some("\"creation\";r=3;t=15"));
    assert_eq!(first.header("ratelimit-policy"), Some("\"creation\";q=4;w=60"));
    let again = send("a", &body);
    assert_eq!((again.text(), again.header("location")), (first.text(), first.header("location")));
    assert_eq!(again.header("idempotent-replayed"), Some("true"));
    assert_eq!(send("a", &body.replace("0.1", "0.3")).status, 422);
    assert_eq!(send("", &body).status, 422);
    // What was only told again, or refused for its key, costs nothing.
    for key in ["b", "c", "d"] {
        assert_eq!(send(key, &body).status, 201);
    }
    let refused = send("e", &body);
    assert_eq!(refused.status, 429);
    assert_eq!(send("a", &body).status, 201, "a replay is never refused for its budget");
    assert!(refused.header("retry-after").unwrap().parse::<u64>().unwrap() >= 1);
    assert_eq!(service.get("/v1/jobs").json()["items"].as_array().unwrap().len(), 4);
}

#[test]
fn old_jobs_expire_and_metrics_count() {
    let (_directory, mut service) = service(&["--retention-days", "7", "--slots", "1"]);
    let old = service.submit(&json!({"scene": {"kind": "redistance", "spacing": 0.1}}));
    let young = service.submit(&json!({"scene": {"kind": "redistance", "spacing": 0.1}}));
    for id in [&old, &young] {
        service.wait_for(id, &["succeeded"]);
    }
    let text = service.get("/metrics").text();
    for line in [
        "meniscus_jobs{state=\"succeeded\"} 2",
        "meniscus_slots 1",
        "meniscus_transitions_total{to=\"running\",reason=\"\"} 2",
    ] {
        assert!(text.contains(line), "{line} is not in {text}");
    }
    for name in [
        "meniscus_http_requests_total",
        "meniscus_http_request_seconds_bucket",
        "meniscus_disk_free_bytes",
        "meniscus_resident_bytes",
        "meniscus_queue_oldest_seconds",
    ] {
        assert!(text.contains(name), "{name}");
    }
    service.with_store(|store| store.execute("UPDATE jobs SET ended_s = ended_s - 8 * 86400.0 WHERE id = ?1", [&old]));
    assert!(service.stop());
    service.restart();
    crate::support::eventually("the old one is gone", std::time::Duration::from_secs(10), || {
        let is_gone = service.get(&format!("/v1/jobs/{old}")).status == 404;
        (is_gone && !service.data.join("jobs").join(&old).exists()).then_some(())
    });
    assert_eq!(service.job(&young)["state"], "succeeded");
}

#[test]
fn urgent_jobs_go_first_but_nothing_waits_for_ever() {
    let (_directory, service) = service(&["--slots", "1"]);
    let blocker = service.submit(&crate::support::endless_job());
    service.worker_eventually(&blocker);
    let quick = |priority: i64| json!({"scene": {"kind": "redistance", "spacing": 0.2}, "priority": priority});
    let old = service.submit(&quick(0));
    let urgent = service.submit(&quick(5));
    let patient = service.submit(&quick(0));
    // It has waited for two hours.
    service.with_store(|store| store.execute("UPDATE jobs SET rank = rank - 7200 WHERE id = ?1", [&patient]));
    service.act(&blocker, "cancel");
    for id in [&old, &urgent, &patient] {
        service.wait_for(id, &["succeeded"]);
    }
    let began = |id: &str| service.job(id)["started_at"].as_str().unwrap().to_owned();
    assert!(began(&patient) < began(&urgent) && began(&urgent) < began(&old));
}

#[test]
fn fsck_finds_what_is_wrong() {
    let (directory, mut service) = service(&["--slots", "1"]);
    let id = service.submit(&json!({"scene": {"kind": "redistance", "spacing": 0.1}}));
    service.wait_for(&id, &["succeeded"]);
    let look = || Command::new(program()).args(["fsck", "--data"]).arg(directory.path()).output().unwrap();
    let busy = look();
    assert!(!busy.status.success() && String::from_utf8_lossy(&busy.stderr).contains("another service"));
    assert!(service.stop());
    assert!(look().status.success(), "{}", String::from_utf8_lossy(&look().stdout));
    let frame = directory.path().join("jobs").join(&id).join("attempts/1/frames/000000.vtkhdf");
    let mut bytes = std::fs::read(&frame).unwrap();
    bytes[100] ^= 1;
    std::fs::write(&frame, bytes).unwrap();
    let stranger = "jobs/job_01JZZZZZZZZZZZZZZZZZZZZZZZ";
    std::fs::create_dir(directory.path().join(stranger)).unwrap();
    service.with_store(|store| store.execute("DELETE FROM events WHERE job = ?1 AND id = 2", [&id]));
    let found = look();
    let text = String::from_utf8_lossy(&found.stdout).into_owned();
    assert!(!found.status.success());
    for part in ["another digest", stranger, "without gaps", "3 errors"] {
        assert!(text.contains(part), "{part}: {text}");
    }
}
