//! A job's life: submit, run, pause, resume, cancel, restart, delete.

use crate::service;
use crate::support::{endless_job, eventually, long_job, steady_job};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

#[test]
fn a_job_runs_to_its_end_and_shows_everything() {
    let (_directory, service) = service(&[]);
    let example: Value = serde_json::from_str(meniscus::scenes::find("vortex").unwrap().example).unwrap();
    let answer = service.post("/v1/jobs", &example);
    assert_eq!(answer.status, 201);
    let id = answer.json()["id"].as_str().unwrap().to_owned();
    assert_eq!(answer.header("location").unwrap(), format!("/v1/jobs/{id}"));
    assert!(answer.header("x-request-id").is_some());
    let job = service.wait_for(&id, &["succeeded"]);
    assert_eq!(job["progress"]["fraction"], 1.0);
    assert_eq!(job["spec"], example);
    assert_eq!(job["resolved"]["scene"]["method"]["type"], "pcp");
    assert!(job["usage"]["cpu_s"].as_f64().unwrap() > 0.0 && job["usage"]["disk_bytes"].as_u64().unwrap() > 100_000);
    let report = service.get(&format!("/v1/jobs/{id}/report")).json();
    assert!(report["errors"].as_array().unwrap().iter().any(|e| e["quantity"] == "phi" && e["norm"] == "rms"));
    assert!(report["cost"]["phases"]["redistancing/query"].as_f64().unwrap() > 0.0);
    assert!(report["method"]["method"].as_str().unwrap().starts_with("pcp"));
    assert_eq!((&report["health"]["status"], &report["health"]["findings"]), (&json!("sound"), &json!([])));
    assert_eq!(report["health"]["checks"][0]["name"], "area_drift");
    assert!(report.get("stability").is_none());
    let diagnostics = report["diagnostics"].as_array().unwrap();
    let solves = diagnostics.iter().find(|one| one["name"] == "newton.solves").unwrap();
    assert!(solves["value"].as_f64().unwrap() > 0.0 && solves["doc"].as_str().unwrap().ends_with('.'), "{solves}");
    let health = &job["health"];
    assert_eq!((&health["status"], &health["finite"], &job["warnings"]), (&json!("sound"), &json!(true), &json!([])));
    // What frames, series and reports show is declared.
    let kind = service.get("/v1/scenes/vortex").json();
    let declares = |list: &str, name: &str| kind[list].as_array().unwrap().iter().any(|one| one["name"] == name);
    assert!(declares("fields", "psi") && declares("observables", "volume_drift") && declares("norms", "rms"));
    assert_eq!(kind["fields"][0]["unit"], "length");
    let csv = service.series(&id);
    let rows: Vec<&str> = csv.lines().collect();
    assert!(rows[0].starts_with("time,time_step,area"));
    // 60 steps, a row every ten, first and last included.
    assert_eq!(rows.len(), 1 + 7);
    let json = service.request("GET", &format!("/v1/jobs/{id}/series"), &[("accept", "application/json")], None).json();
    assert_eq!(json["rows"].as_array().unwrap().len(), 7);
    let log = service.get(&format!("/v1/jobs/{id}/log")).text();
    assert!(log.trim_end().ends_with(" succeeded"), "{log}");
    assert_eq!(service.get(&format!("/v1/jobs/{id}/log?tail=1")).text().lines().count(), 1);
    let kinds: BTreeSet<String> = service.events(&id).iter().map(|e| e["type"].as_str().unwrap().to_owned()).collect();
    assert!(["state", "frame", "checkpoint", "progress"].iter().all(|kind| kinds.contains(*kind)), "{kinds:?}");
    assert_eq!(service.get(&format!("/v1/jobs/{id}/checkpoints")).json()["items"].as_array().unwrap().len(), 1);
}

#[test]
fn pause_and_resume_leave_no_trace_in_the_results() {
    let (_directory, service) = service(&["--slots", "2", "--threads", "2"]);
    let undisturbed = service.submit(&long_job());
    let disturbed = service.submit(&long_job());
    for _ in 0..3 {
        eventually("it makes progress", Duration::from_secs(20), || {
            let job = service.job(&disturbed);
            (job["state"] == "running" && job["progress"]["step"].as_u64() > Some(0) || job["state"] == "succeeded")
                .then_some(())
        });
        if service.act(&disturbed, "pause").status == 409 {
            break;
        }
        // Idempotent while it lasts.
        let job = service.wait_for(&disturbed, &["paused", "succeeded"]);
        if job["state"] == "succeeded" {
            break;
        }
        assert_eq!(job["reason"], "user.pause");
        assert!(job["hint"].as_str().unwrap().contains("resume"));
        assert_eq!(service.act(&disturbed, "pause").status, 202);
        assert_eq!(service.act(&disturbed, "resume").status, 202);
    }
    let job = service.wait_for(&disturbed, &["succeeded"]);
    assert!(job["attempt"].as_u64().unwrap() > 1, "it was never paused");
    service.wait_for(&undisturbed, &["succeeded"]);
    assert_eq!(service.frames(&disturbed), service.frames(&undisturbed));
    assert_eq!(service.series(&disturbed), service.series(&undisturbed));
    assert_eq!(service.act(&disturbed, "resume").status, 409);
}

/// The index of frames is whole and matches its digest at every moment of a run.
#[test]
fn the_index_of_frames_is_true_while_the_job_runs() {
    let (directory, service) = service(&["--slots", "1"]);
    let mut body = long_job();
    body["output"]["every_time"] = json!(6);
    let id = service.submit(&body);
    let mut seen = BTreeSet::new();
    let path = format!("/v1/jobs/{id}/files/frames.vtkhdf.series");
    loop {
        let is_over = service.job(&id)["state"] == "succeeded";
        let answer = service.get(&path);
        if answer.status == 200 {
            let place = directory.path().join("index.json");
            std::fs::write(&place, &answer.bytes).unwrap();
            let sum = std::process::Command::new("sha256sum").arg(&place).output().unwrap().stdout;
            let sum = String::from_utf8(sum).unwrap();
            assert_eq!(answer.header("etag").unwrap().trim_matches('"'), sum.split(' ').next().unwrap());
            let frames = answer.json()["files"].as_array().unwrap().clone();
            // Whatever the index names can be had.
            let last = frames.last().unwrap()["name"].as_str().unwrap().to_owned();
            assert_eq!(service.request("HEAD", &format!("/v1/jobs/{id}/files/{last}"), &[], None).status, 200);
            seen.insert(frames.len());
        }
        if is_over {
            break;
        }
    }
    assert!(seen.len() > 2 && seen.last() == Some(&121), "{seen:?}");
    assert!(service.get(&format!("/v1/jobs/{id}/files.tar")).bytes.len() > 100_000);
}

#[test]
fn cancel_is_prompt_idempotent_and_final() {
    let (_directory, service) = service(&["--slots", "1"]);
    let slow = service.submit(&endless_job());
    let waiting = service.submit(&steady_job());
    service.wait_for(&slow, &["running"]);
    eventually("the worker computes", Duration::from_secs(20), || {
        service.get(&format!("/v1/jobs/{slow}/log")).text().contains("start at step").then_some(())
    });
    let asked = Instant::now();
    assert_eq!(service.act(&slow, "cancel").status, 202);
    service.wait_for(&slow, &["canceled"]);
    assert!(asked.elapsed() < Duration::from_secs(3), "{:?}", asked.elapsed());
    assert_eq!(service.act(&slow, "cancel").status, 202);
    assert_eq!(service.act(&slow, "pause").status, 409);
    assert_eq!(service.job(&slow)["reason"], "user.cancel");
    assert!(service.worker(&slow).is_none());
    service.act(&waiting, "cancel");
    service.wait_for(&waiting, &["canceled"]);
    let other = service.submit(&steady_job());
    assert_eq!(service.request("DELETE", &format!("/v1/jobs/{other}"), &[], None).status, 409);
    assert_eq!(service.request("DELETE", &format!("/v1/jobs/{slow}"), &[], None).status, 204);
    assert_eq!(service.get(&format!("/v1/jobs/{slow}")).status, 404);
    assert!(!service.data.join("jobs").join(&slow).exists());
}

#[test]
fn a_finished_job_goes_on_to_a_later_end_bit_for_bit() {
    let (_directory, service) = service(&["--slots", "2"]);
    let scene = |repeat: u64| json!({"kind": "redistance", "spacing": 0.03125, "repeat": repeat});
    let whole = service.submit(&json!({"scene": scene(40)}));
    let half = service.submit(&json!({"scene": scene(25)}));
    service.wait_for(&half, &["succeeded"]);
    let checkpoint =
        service.get(&format!("/v1/jobs/{half}/checkpoints")).json()["items"][0]["id"].as_str().unwrap().to_owned();
    let restart = json!({"restart": {"checkpoint": checkpoint, "overrides": {"/repeat": 40}}, "output": {"series_every_steps": 5}});
    let rest = service.submit(&restart);
    // What it began with belongs to it now.
    assert_eq!(service.request("DELETE", &format!("/v1/jobs/{half}"), &[], None).status, 204);
    let job = service.wait_for(&rest, &["succeeded"]);
    assert_eq!(job["lineage"]["restarted_from"], checkpoint);
    service.wait_for(&whole, &["succeeded"]);
    let frames = service.frames(&rest);
    // Frame numbers go on after the two of the first job: the restart state and the end.
    assert_eq!(
        frames.iter().map(|f| f.0.as_str()).collect::<Vec<_>>(),
        ["frames/000002.vtkhdf", "frames/000003.vtkhdf"]
    );
    assert_eq!(frames[1].1, service.frames(&whole)[1].1);
    let rows: Vec<String> =
        service.series(&rest).lines().skip(1).map(|l| l.split(',').next().unwrap().to_owned()).collect();
    assert_eq!(rows, ["25.0", "30.0", "35.0", "40.0"]);
}

#[test]
fn limits_pause_or_fail_with_their_reason() {
    let (_directory, service) = service(&["--slots", "2"]);
    let mut body = long_job();
    body["limits"] = json!({"wall_s": 0.3});
    let id = service.submit(&body);
    let mut legs = 0;
    loop {
        let job = service.wait_for(&id, &["paused", "succeeded"]);
        if job["state"] == "succeeded" {
            break;
        }
        assert_eq!(job["reason"], "limit.walltime");
        legs += 1;
        assert!(legs < 60, "the wall time does not count anew");
        service.act(&id, "resume");
    }
    assert!(legs >= 1);
    let mut body =
        json!({"scene": {"kind": "redistance", "spacing": 0.015625, "repeat": 3000}, "checkpoint": {"every_steps": 5}});
    body["limits"] = json!({"disk_bytes": 100_000});
    let id = service.submit(&body);
    assert_eq!(service.wait_for(&id, &["paused"])["reason"], "limit.disk");
    assert!(!service.get(&format!("/v1/jobs/{id}/checkpoints")).json()["items"].as_array().unwrap().is_empty());
}

#[test]
fn two_hundred_submissions_at_once_are_all_accepted_once() {
    let (_directory, service) = service(&["--slots", "1"]);
    let ids: Vec<String> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..200)
            .map(|k| {
                let service = &service;
                scope.spawn(move || {
                    service.submit(
                        &json!({"scene": {"kind": "redistance", "spacing": 0.1}, "labels": {"k": k.to_string()}}),
                    )
                })
            })
            .collect();
        threads.into_iter().map(|t| t.join().unwrap()).collect()
    });
    let unique: BTreeSet<&String> = ids.iter().collect();
    assert_eq!(unique.len(), 200);
    // Pages of 70 while jobs run and one more is submitted: each of the 200 exactly once.
    let mut seen = Vec::new();
    let mut path = "/v1/jobs?limit=70".to_owned();
    loop {
        let answer = service.get(&path);
        let page = answer.json();
        seen.extend(page["items"].as_array().unwrap().iter().map(|j| j["id"].as_str().unwrap().to_owned()));
        service.submit(&json!({"scene": {"kind": "redistance", "spacing": 0.1}}));
        if page["next"].is_null() {
            break;
        }
        let link = answer.header("link").unwrap();
        path = link.trim_start_matches('<').split('>').next().unwrap().to_owned();
        assert!(link.ends_with("rel=\"next\""));
    }
    assert_eq!(seen.iter().collect::<BTreeSet<_>>().len(), seen.len());
    assert!(ids.iter().all(|id| seen.contains(id)));
    let labelled = service.get("/v1/jobs?label.k=77").json();
    assert_eq!(labelled["items"].as_array().unwrap().len(), 1);
}

#[test]
fn event_streams_have_no_gaps_and_end_with_the_job() {
    let (_directory, service) = service(&["--slots", "1"]);
    let id = service.submit(&steady_job());
    let stream = |after: Option<u64>| {
        let mut socket = TcpStream::connect(service.url.trim_start_matches("http://")).unwrap();
        let last = after.map(|n| format!("Last-Event-ID: {n}\r\n")).unwrap_or_default();
        write!(socket, "GET /v1/jobs/{id}/events HTTP/1.1\r\nHost: localhost\r\nAccept: text/event-stream\r\n{last}Connection: close\r\n\r\n").unwrap();
        let mut reader = BufReader::new(socket);
        let mut status = String::new();
        reader.read_line(&mut status).unwrap();
        let ids: Vec<u64> =
            reader.lines().map_while(Result::ok).filter_map(|line| line.strip_prefix("id: ")?.parse().ok()).collect();
        (status, ids)
    };
    let (status, ids) = stream(None);
    assert!(status.contains("200"));
    assert_eq!(service.job(&id)["state"], "succeeded");
    assert_eq!(ids, (1..=ids.len() as u64).collect::<Vec<_>>());
    assert_eq!(service.events(&id).len(), ids.len());
    let middle = ids.len() as u64 / 2;
    assert_eq!(stream(Some(middle)).1, (middle + 1..=ids.len() as u64).collect::<Vec<_>>());
    assert!(stream(Some(ids.len() as u64)).0.contains("204"));
    assert!(stream(Some(u64::MAX)).0.contains("204"));
    let last = service.events(&id).into_iter().rfind(|e| e["type"] == "progress").unwrap();
    assert_eq!(last["data"]["fraction"], 1.0);
    // A stream beyond the end of a running job ends with it.
    let running = service.submit(&steady_job());
    let mut socket = TcpStream::connect(service.url.trim_start_matches("http://")).unwrap();
    write!(socket, "GET /v1/jobs/{running}/events HTTP/1.1\r\nHost: localhost\r\nAccept: text/event-stream\r\nLast-Event-ID: 100000\r\nConnection: close\r\n\r\n").unwrap();
    socket.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    assert!(BufReader::new(socket).lines().all(|line| line.is_ok()));
    assert_eq!(service.job(&running)["state"], "succeeded");
}

#[test]
fn a_job_is_not_sent_twice_and_waits_for_changes() {
    let (_directory, service) = service(&["--slots", "1"]);
    let id = service.submit(&json!({"scene": {"kind": "redistance", "spacing": 0.1}}));
    service.wait_for(&id, &["succeeded"]);
    let path = format!("/v1/jobs/{id}");
    let tag = service.get(&path).header("etag").unwrap().to_owned();
    assert_eq!(service.request("GET", &path, &[("if-none-match", &tag)], None).status, 304);
    let asked = Instant::now();
    let answer = service.request("GET", &path, &[("if-none-match", &tag), ("prefer", "wait=1")], None);
    assert_eq!(answer.status, 200);
    assert!(asked.elapsed() >= Duration::from_millis(900));
    let long = service.submit(&steady_job());
    let tag = service.get(&format!("/v1/jobs/{long}")).header("etag").unwrap().to_owned();
    let answer =
        service.request("GET", &format!("/v1/jobs/{long}"), &[("if-none-match", &tag), ("prefer", "wait=30")], None);
    assert_ne!(answer.header("etag").unwrap().split('-').next(), tag.split('-').next());
}
