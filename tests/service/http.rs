//! What clients, proxies and browsers expect of HTTP beside the routes.

use crate::service;
use crate::support::{Service, eventually, program, signal};
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::process::{Command, Stdio};
use std::time::Duration;

fn quick_job() -> Value {
    json!({"scene": {"kind": "redistance", "spacing": 0.1}})
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut child = Command::new("gzip").arg("-c").stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(bytes).unwrap();
    child.wait_with_output().unwrap().stdout
}

#[test]
fn bodies_may_be_compressed_and_begin_with_a_byte_order_mark() {
    let (_directory, service) = service(&["--slots", "1"]);
    let text = quick_job().to_string();
    let send = |headers: &[(&str, &str)], body: &[u8]| service.request("POST", "/v1/jobs", headers, Some(body));
    assert_eq!(send(&[("content-encoding", "gzip")], &gzip(text.as_bytes())).status, 201);
    assert_eq!(send(&[], &[b"\xef\xbb\xbf", text.as_bytes()].concat()).status, 201);
    let refused = send(&[("content-encoding", "br")], text.as_bytes());
    assert_eq!((refused.status, refused.header("accept-encoding")), (415, Some("gzip, identity")));
    assert_eq!(refused.json()["type"], "/problems/unsupported-encoding");
    assert_eq!(send(&[("content-encoding", "gzip")], text.as_bytes()).status, 400);
    // What is unpacked counts against the limit.
    let large = gzip(&vec![b' '; 3 << 20]);
    assert_eq!(send(&[("content-encoding", "gzip")], &large).status, 413);
    let upload = service.request(
        "POST",
        "/v1/uploads?as=queries",
        &[("content-encoding", "gzip")],
        Some(&gzip(b"0 0 0\n1 0 0\n")),
    );
    let id = upload.json()["id"].as_str().unwrap().to_owned();
    eventually("the upload is ready", Duration::from_secs(20), || {
        (service.get(&format!("/v1/uploads/{id}")).json()["state"] == "ready").then_some(())
    });
}

#[test]
fn texts_are_compressed_where_the_client_asks_and_files_are_not() {
    let (_directory, service) = service(&["--slots", "1"]);
    let id = service.submit(&quick_job());
    service.wait_for(&id, &["succeeded"]);
    let ask = |path: &str| service.request("GET", path, &[("accept-encoding", "gzip")], None);
    let document = ask("/openapi.json");
    assert_eq!(document.header("content-encoding"), Some("gzip"));
    let vary: Vec<&str> = document.headers.get_all("vary").iter().map(|value| value.to_str().unwrap()).collect();
    assert!(vary.join(",").to_ascii_lowercase().contains("accept-encoding"), "{vary:?}");
    assert!(document.bytes.starts_with(&[0x1f, 0x8b]));
    assert!(service.get("/openapi.json").header("content-encoding").is_none());
    for path in ["files/frames/000000.vtkhdf", "files/report.json", "files.tar"] {
        let answer = ask(&format!("/v1/jobs/{id}/{path}"));
        assert_eq!((answer.status, answer.header("content-encoding")), (200, None), "{path}");
    }
}

#[test]
fn probes_are_answered_whatever_they_name_as_host() {
    let (_directory, service) = service(&[]);
    for host in ["10.244.0.5:8080", "meniscus.default.svc:8080", "localhost"] {
        let status = |path: &str| service.request("GET", path, &[("host", host)], None).status;
        assert_eq!((status("/healthz"), status("/readyz")), (200, 200), "{host}");
        assert_eq!(status("/v1"), if host == "localhost" { 200 } else { 421 });
    }
    let mut stream = TcpStream::connect(service.url.trim_start_matches("http://")).unwrap();
    stream.write_all(b"GET /healthz HTTP/1.0\r\n\r\n").unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.0 200") || answer.starts_with("HTTP/1.1 200"), "{answer}");
}

#[test]
fn numbers_tags_cursors_and_headers_are_read_as_their_standards_say() {
    let (_directory, service) = service(&["--slots", "1"]);
    for part in [
        json!({"checkpoint": {"keep": 3.0}}),
        json!({"output": {"series_every_steps": 1e1}}),
        json!({"limits": {"memory_bytes": 1e9}}),
        json!({"priority": 1.0}),
    ] {
        let mut body = quick_job();
        body.as_object_mut().unwrap().extend(part.as_object().unwrap().clone());
        assert_eq!(service.post("/v1/jobs", &body).status, 201, "{part}");
    }
    let study =
        json!({"base": quick_job(), "sweep": {"mode": "grid", "axes": {"/scene/spacing": [0.2]}}, "max_parallel": 2.0});
    assert_eq!(service.post("/v1/studies", &study).status, 201);
    for query in ["cursor=", "cursor=junk", "sort=created_at&cursor=junk", "cursor=%00"] {
        let answer = service.get(&format!("/v1/jobs?{query}"));
        assert_eq!((answer.status, answer.pointers()), (422, vec!["cursor".to_owned()]), "{query}");
    }
    let id = service.submit(&quick_job());
    service.wait_for(&id, &["succeeded"]);
    let path = format!("/v1/jobs/{id}");
    let tag = service.get(&path).header("etag").unwrap().to_owned();
    for known in [tag.clone(), format!("W/{tag}"), format!("\"x\", W/{tag}"), "*".to_owned()] {
        assert_eq!(service.request("GET", &path, &[("if-none-match", &known)], None).status, 304, "{known}");
    }
    let events = format!("{path}/events");
    let headers = [("accept", "text/event-stream"), ("last-event-id", "")];
    let stream = service.request("GET", &events, &headers, None);
    assert_eq!((stream.status, stream.header("x-accel-buffering")), (200, Some("no")));
}

/// The token of a name, and its line for the token file.
fn token(name: &str, scopes: &str) -> (String, String) {
    let output = Command::new(program()).args(["token", name, "--scopes", scopes]).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let mut lines = text.lines().map(str::to_owned);
    (lines.next().unwrap(), lines.next().unwrap())
}

#[test]
fn what_others_made_is_read_by_all_and_changed_by_admins() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("tokens");
    let names = [("alice", "read,submit,control"), ("bob", "read,submit,control"), ("root", "read,admin")];
    let [alice, bob, root] = names.map(|(name, scopes)| token(name, scopes));
    std::fs::write(&file, [&alice.1, &bob.1, &root.1].map(String::as_str).join("\n")).unwrap();
    let data = directory.path().join("data");
    let service = Service::start(&data, &["--slots", "1", "--token-file", file.to_str().unwrap()]);
    let send = |token: &(String, String), method: &str, path: &str, body: Option<&Value>| {
        let authorization = format!("Bearer {}", token.0);
        let body = body.map(ToString::to_string);
        service.request(method, path, &[("authorization", &authorization)], body.as_deref().map(str::as_bytes))
    };
    let job = send(&alice, "POST", "/v1/jobs", Some(&crate::support::endless_job())).json();
    let id = job["id"].as_str().unwrap().to_owned();
    assert_eq!(job["owner"], "alice");
    let path = format!("/v1/jobs/{id}");
    assert_eq!(send(&bob, "GET", &path, None).status, 200);
    for (method, below) in
        [("POST", "/cancel"), ("POST", "/pause"), ("POST", "/checkpoints"), ("DELETE", ""), ("PATCH", "")]
    {
        let refused = send(&bob, method, &format!("{path}{below}"), Some(&json!({})));
        assert_eq!((refused.status, &refused.json()["type"]), (403, &json!("/problems/not-owner")), "{method} {below}");
        assert!(refused.text().contains("alice"));
    }
    let all = json!({"action": "cancel", "filter": {"kind": "redistance"}});
    let acted = send(&bob, "POST", "/v1/jobs/actions", Some(&all)).json();
    assert_eq!((&acted["matched"], &acted["changed"]), (&json!(1), &json!(0)));
    assert!(acted["skipped"][0]["reason"].as_str().unwrap().contains("alice"));
    let count = |token, query: &str| send(token, "GET", query, None).json()["items"].as_array().unwrap().len();
    assert_eq!((count(&alice, "/v1/jobs?owner=me"), count(&bob, "/v1/jobs?owner=me")), (1, 0));
    assert_eq!(count(&bob, "/v1/jobs?owner=alice"), 1);
    assert_eq!(send(&root, "POST", &format!("{path}/cancel"), Some(&json!({}))).status, 202);
    // A ticket reads streams and files for a minute, and nothing else.
    let ticket = send(&alice, "POST", "/v1/tickets", None).json()["ticket"].as_str().unwrap().to_owned();
    let open = |path: &str| service.get(path).status;
    assert_eq!(open(&format!("{path}/events?ticket={ticket}&limit=5")), 200);
    assert_eq!(open(&format!("{path}/events?ticket=mnt_other")), 401);
    assert_eq!((open(&format!("{path}?ticket={ticket}")), open(&format!("{path}/events"))), (401, 401));
    assert!(!service.log_text().contains(&ticket), "the log has a ticket");
}

#[test]
fn tokens_are_read_again_when_their_file_changes_and_at_a_hangup() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("tokens");
    let (old, new) = (token("old", "read"), token("new", "read"));
    std::fs::write(&file, &old.1).unwrap();
    let mut service = Service::start(&directory.path().join("data"), &["--token-file", file.to_str().unwrap()]);
    let status = |service: &Service, token: &str| {
        service.request("GET", "/v1", &[("authorization", &format!("Bearer {token}"))], None).status
    };
    std::fs::write(&file, format!("{}\n# a comment\n", new.1)).unwrap();
    eventually("the new token is known", Duration::from_secs(10), || (status(&service, &new.0) == 200).then_some(()));
    assert_eq!(status(&service, &old.0), 401);
    // A damaged file changes nothing.
    std::fs::write(&file, "nonsense").unwrap();
    signal(service.pid(), rustix::process::Signal::HUP);
    eventually("it is said", Duration::from_secs(10), || {
        service.log_text().contains("the ones before stay").then_some(())
    });
    assert_eq!(status(&service, &new.0), 200);
    assert!(!service.has_ended(), "a hangup ended the service");
    assert!(service.stop());
}

#[test]
fn pages_of_allowed_origins_may_use_the_service() {
    let (_directory, service) = service(&["--allow-origin", "https://lab.example"]);
    let ask = |method: &str, origin: &str| {
        let headers = [("origin", origin), ("access-control-request-method", "POST")];
        service.request(method, "/v1/jobs", &headers, None)
    };
    let preflight = ask("OPTIONS", "https://lab.example");
    assert_eq!(preflight.status, 200);
    assert_eq!(preflight.header("access-control-allow-origin"), Some("https://lab.example"));
    assert!(preflight.header("access-control-allow-methods").unwrap().contains("PATCH"));
    let answer = ask("GET", "https://lab.example");
    assert_eq!((answer.status, answer.header("access-control-allow-origin")), (200, Some("https://lab.example")));
    let foreign = ask("GET", "https://evil.example");
    assert_eq!((foreign.status, foreign.header("access-control-allow-origin")), (403, None));
}

#[test]
fn behind_a_proxy_all_addresses_have_the_base_path() {
    let directory = tempfile::tempdir().unwrap();
    let service = Service::start(directory.path(), &["--base-path", "/sim/meniscus"]);
    assert_eq!((service.get("/healthz").status, service.get("/v1").status), (200, 404));
    let made = service.post("/sim/meniscus/v1/jobs", &quick_job());
    assert_eq!(made.status, 201, "{}", made.text());
    let place = made.header("location").unwrap();
    assert!(place.starts_with("/sim/meniscus/v1/jobs/job_"), "{place}");
    let job = service.get(place).json();
    for link in job["links"].as_object().unwrap().values() {
        assert!(link.as_str().unwrap().starts_with("/sim/meniscus/v1/"), "{link}");
    }
    let wrong = service.get("/sim/meniscus/v1/jobs/job_x").json();
    assert_eq!(service.get(wrong["type"].as_str().unwrap()).status, 200);
    service.post("/sim/meniscus/v1/jobs", &quick_job());
    let page = service.get("/sim/meniscus/v1/jobs?limit=1");
    assert!(page.header("link").unwrap().starts_with("</sim/meniscus/v1/jobs?"));
    assert_eq!(service.get("/sim/meniscus/readyz").status, 200);
}
