//! What clients do: read slowly or never, lose their connection, send everything twice.

use crate::support::{Answer, Service, chance, endless_job, eventually, steady_job};
use serde_json::json;
use std::collections::BTreeSet;
use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

fn open_stream(service: &Service, id: &str) -> TcpStream {
    let mut socket = TcpStream::connect(service.url.trim_start_matches("http://")).unwrap();
    write!(
        socket,
        "GET /v1/jobs/{id}/events HTTP/1.1\r\nHost: localhost\r\nAccept: text/event-stream\r\nConnection: close\r\n\r\n"
    )
    .unwrap();
    socket
}

/// Streams of events of one job, of which every other is never read: those that are read get everything, the job and the
/// service are not slowed down.
pub fn event_streams(count: u64, _: u64) -> String {
    let directory = tempfile::tempdir().unwrap();
    let service = Service::start(directory.path(), &["--slots", "1"]);
    let mut body = steady_job();
    body["checkpoint"] = json!({"every_steps": 1});
    let id = service.submit(&body);
    let sockets: Vec<TcpStream> = (0..count).map(|_| open_stream(&service, &id)).collect();
    let readers: Vec<_> = sockets.iter().step_by(2).map(|socket| socket.try_clone().unwrap()).collect();
    let (mut slowest, mut events) = (0.0_f64, 0);
    std::thread::scope(|scope| {
        let threads: Vec<_> = readers
            .into_iter()
            .map(|socket| {
                scope.spawn(move || {
                    let lines = BufReader::new(socket).lines().map_while(Result::ok);
                    lines.filter_map(|line| line.strip_prefix("id: ")?.parse::<u64>().ok()).collect::<Vec<u64>>()
                })
            })
            .collect();
        while service.job(&id)["state"] != "succeeded" {
            let asked = Instant::now();
            assert_eq!(service.get("/v1/jobs?limit=1").status, 200);
            slowest = slowest.max(asked.elapsed().as_secs_f64());
            std::thread::sleep(Duration::from_millis(20));
        }
        let all: Vec<u64> = service.events(&id).iter().map(|event| event["id"].as_u64().unwrap()).collect();
        events = all.len();
        for thread in threads {
            assert_eq!(thread.join().unwrap(), all);
        }
    });
    let memory = service.resident_bytes() as f64 / 1e6;
    drop(sockets);
    assert!(memory < 150.0, "{memory} MB");
    format!(
        "{count} streams, half of them never read: {events} events without gaps, slowest read beside {slowest:.3} s, service {memory:.0} MB"
    )
}

/// A large download is cut again and again and goes on with `curl -C -`.
pub fn cut_downloads(count: u64, seed: u64) -> String {
    let directory = tempfile::tempdir().unwrap();
    let service = Service::start(directory.path(), &["--slots", "1"]);
    let id = service.submit(&json!({"scene": {"kind": "redistance", "dimension": 3, "spacing": 0.02}}));
    service.wait_for(&id, &["succeeded"]);
    let frame = service.files(&id).into_iter().max_by_key(|file| file["size_bytes"].as_u64()).unwrap();
    let size = frame["size_bytes"].as_u64().unwrap();
    let url = format!("{}/v1/jobs/{id}/files/{}", service.url, frame["path"].as_str().unwrap());
    let target = directory.path().join("frame");
    let rate = format!("{}", size / 2);
    for cut in 0..count {
        let mut curl = Command::new("curl")
            .args(["-sS", "-C", "-", "--limit-rate", &rate, "-o"])
            .arg(&target)
            .arg(&url)
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_secs_f64(0.08 + 0.06 * chance(seed, cut)));
        // It may have come to its end.
        let _ = curl.kill();
        curl.wait().unwrap();
        let there = std::fs::metadata(&target).map_or(0, |meta| meta.len());
        if there >= size {
            std::fs::OpenOptions::new().write(true).open(&target).unwrap().set_len(size / 3).unwrap();
        }
    }
    let rest = Command::new("curl").args(["-sS", "-C", "-", "-o"]).arg(&target).arg(&url).output().unwrap();
    assert!(rest.status.success(), "{}", String::from_utf8_lossy(&rest.stderr));
    let (sha256, bytes) = meniscus_jobs::system::digest::of_file(&target).unwrap();
    assert_eq!((sha256.as_str(), bytes), (frame["sha256"].as_str().unwrap(), size));
    format!("{count} cuts in a download of {:.1} MB, the digest is that of the list", size as f64 / 1e6)
}

/// Many submissions with one key at once make one job; another body under the key is refused, also after `kill -9`.
pub fn one_key(count: u64, seed: u64) -> String {
    let directory = tempfile::tempdir().unwrap();
    let mut service = Service::start(directory.path(), &["--slots", "1"]);
    service.submit(&endless_job());
    let key = format!("key-{seed}");
    let body = json!({"scene": {"kind": "redistance", "spacing": 0.1}}).to_string();
    let send = |service: &Service, body: &str| {
        let headers = [("content-type", "application/json"), ("idempotency-key", key.as_str())];
        service.request("POST", "/v1/jobs", &headers, Some(body.as_bytes()))
    };
    let answers: Vec<_> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..count).map(|_| scope.spawn(|| send(&service, &body))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    let texts: BTreeSet<String> = answers.iter().map(Answer::text).collect();
    assert_eq!(texts.len(), 1, "{texts:?}");
    assert!(answers.iter().all(|answer| answer.status == 201));
    let replayed = answers.iter().filter(|answer| answer.header("idempotent-replayed") == Some("true")).count() as u64;
    assert_eq!(replayed, count - 1);
    service.kill();
    service.restart();
    assert_eq!(send(&service, &body).text(), texts.into_iter().next().unwrap());
    assert_eq!(send(&service, &body.replace("0.1", "0.2")).status, 422);
    let jobs = eventually("the list is there", Duration::from_secs(5), || {
        service.get("/v1/jobs").json()["items"].as_array().map(Vec::len)
    });
    assert_eq!(jobs, 2);
    format!("{count} submissions with one key at once made one job")
}
