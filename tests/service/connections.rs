//! Connections: bounded, timed, and ended so that answers arrive.

use crate::service;
use crate::support::{Service, eventually};
use serde_json::json;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

fn connect(service: &Service) -> TcpStream {
    let stream = TcpStream::connect(service.url.trim_start_matches("http://")).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    stream
}

#[test]
fn idle_connections_keep_nobody_out_and_no_job_from_its_worker() {
    let directory = tempfile::tempdir().unwrap();
    let variables = [("MENISCUS_TEST_PRLIMIT", "--nofile=400:400")];
    let service = Service::start_with(directory.path(), &["--slots", "1"], &variables);
    let jobs: Vec<String> =
        (0..4).map(|_| service.submit(&json!({"scene": {"kind": "redistance", "spacing": 0.1}}))).collect();
    let idle: Vec<TcpStream> = (0..600).map(|_| connect(&service)).collect();
    let asked = Instant::now();
    assert_eq!(service.get("/v1/jobs").status, 200);
    assert!(asked.elapsed() < Duration::from_secs(5), "a client waited {:?}", asked.elapsed());
    for id in &jobs {
        assert_eq!(service.wait_for(id, &["succeeded"])["attempt"], 1);
    }
    drop(idle);
}

#[test]
fn heads_that_do_not_come_and_connections_that_idle_are_closed() {
    let (_directory, service) = service(&[]);
    let mut half = connect(&service);
    half.write_all(b"GET /healthz HTTP/1.1\r\nHost: loc").unwrap();
    let mut idle = connect(&service);
    idle.write_all(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n").unwrap();
    let began = Instant::now();
    let mut answer = Vec::new();
    idle.read_to_end(&mut answer).unwrap();
    assert!(answer.starts_with(b"HTTP/1.1 200"));
    // It may be told that it took too long.
    let _ = half.read_to_end(&mut answer);
    assert!(began.elapsed() < Duration::from_secs(28), "{:?}", began.elapsed());
}

#[test]
fn a_refusal_before_the_body_was_read_arrives() {
    let (_directory, service) = service(&[]);
    for _ in 0..5 {
        let mut stream = connect(&service);
        let length = 6 << 20;
        let head = format!(
            "POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nContent-Length: {length}\r\n\r\n"
        );
        stream.write_all(head.as_bytes()).unwrap();
        std::thread::sleep(Duration::from_millis(100));
        let body = vec![b' '; 1 << 16];
        for _ in 0..length / body.len() {
            stream.write_all(&body).unwrap();
        }
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        assert!(answer.starts_with("HTTP/1.1 413"), "{answer}");
    }
}

#[test]
fn readers_that_stall_hold_up_nobody() {
    let (_directory, service) = service(&["--slots", "1"]);
    let id = service.submit(&json!({"scene": {"kind": "vortex", "spacing": 0.02, "end_time": 1},
        "output": {"every_time": 0.02}}));
    service.wait_for(&id, &["succeeded"]);
    let path = format!("/v1/jobs/{id}/files.tar");
    let whole = service.get(&path);
    assert!(whole.bytes.len() > 10 << 20, "{} bytes do not fill the buffers", whole.bytes.len());
    let stalled: Vec<TcpStream> = (0..20)
        .map(|_| {
            let mut stream = connect(&service);
            stream.write_all(format!("GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n").as_bytes()).unwrap();
            let mut first = [0; 100];
            stream.read_exact(&mut first).unwrap();
            stream
        })
        .collect();
    let asked = Instant::now();
    assert_eq!(service.get(&path).bytes.len(), whole.bytes.len());
    assert!(asked.elapsed() < Duration::from_secs(5), "{:?}", asked.elapsed());
    let open = |service: &Service| {
        let text = service.get("/metrics").text();
        let line = text.lines().find_map(|line| line.strip_prefix("meniscus_connections ")).unwrap();
        line.parse::<f64>().unwrap()
    };
    assert!(open(&service) >= 20.0);
    eventually("stalled readers are given up", Duration::from_secs(40), || (open(&service) < 10.0).then_some(()));
    drop(stalled);
}
