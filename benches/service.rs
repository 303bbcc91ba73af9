//! How fast the service answers, beside what was promised: `make load`, or `cargo bench --bench service`. The release
//! binary over a real socket, 32 connections from this process, on the same cores as the service and its workers.
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a measurement that fails stops, and shows")]

#[path = "../tests/support/service.rs"]
#[expect(dead_code, reason = "a part is used")]
mod support;

use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::Mutex;
use std::time::{Duration, Instant};
use support::{Service, endless_job, eventually};

const CONNECTIONS: usize = 32;

/// A connection that is kept.
struct Connection {
    socket: TcpStream,
    buffer: Vec<u8>,
}

impl Connection {
    fn open(url: &str) -> Self {
        let socket = TcpStream::connect(url.trim_start_matches("http://")).unwrap();
        socket.set_nodelay(true).unwrap();
        Self { socket, buffer: vec![0; 1 << 16] }
    }

    /// Sends a request and reads the answer; its status.
    fn ask(&mut self, request: &[u8]) -> u16 {
        self.socket.write_all(request).unwrap();
        let mut filled = 0;
        let mut whole = usize::MAX;
        while filled < whole {
            if filled == self.buffer.len() {
                self.buffer.resize(2 * filled, 0);
            }
            let count = self.socket.read(&mut self.buffer[filled..]).unwrap();
            assert!(count > 0, "the connection was closed");
            filled += count;
            if whole == usize::MAX
                && let Some(end) = self.buffer[..filled].windows(4).position(|w| w == b"\r\n\r\n")
            {
                let head = String::from_utf8_lossy(&self.buffer[..end]).to_ascii_lowercase();
                let length = head.lines().find_map(|l| l.strip_prefix("content-length: ")?.parse::<usize>().ok());
                whole = end + 4 + length.unwrap_or(0);
            }
        }
        String::from_utf8_lossy(&self.buffer[9..12]).parse().unwrap()
    }
}

fn get(path: &str) -> Vec<u8> {
    format!("GET {path} HTTP/1.1\r\nhost: localhost\r\n\r\n").into_bytes()
}

fn post(path: &str, body: &str) -> Vec<u8> {
    format!(
        "POST {path} HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\ncontent-length: {}\r\n\r\n{body}",
        body.len()
    )
    .into_bytes()
}

/// Requests over all connections for some seconds; sorted times in milliseconds, and requests a second.
fn storm(url: &str, seconds: f64, expected: u16, request: impl Fn(usize) -> Vec<u8> + Sync) -> (Vec<f64>, f64) {
    let times = Mutex::new(Vec::new());
    let began = Instant::now();
    std::thread::scope(|scope| {
        for k in 0..CONNECTIONS {
            let (times, request) = (&times, &request);
            scope.spawn(move || {
                let mut connection = Connection::open(url);
                let mut own = Vec::new();
                let mut n = k;
                while began.elapsed().as_secs_f64() < seconds {
                    let bytes = request(n);
                    let asked = Instant::now();
                    assert_eq!(connection.ask(&bytes), expected);
                    own.push(asked.elapsed().as_secs_f64() * 1e3);
                    n += CONNECTIONS;
                }
                times.lock().unwrap().extend(own);
            });
        }
    });
    let elapsed = began.elapsed().as_secs_f64();
    let mut times = times.into_inner().unwrap();
    times.sort_by(f64::total_cmp);
    let rate = times.len() as f64 / elapsed;
    (times, rate)
}

fn at(times: &[f64], share: f64) -> f64 {
    times[((times.len() as f64 * share) as usize).min(times.len() - 1)]
}

/// A bare axum answer of the same bytes, over the same connections.
fn bare(body: Vec<u8>) -> String {
    let (sender, receiver) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().unwrap();
        runtime.block_on(async move {
            let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
            sender.send(format!("http://{}", listener.local_addr().unwrap())).unwrap();
            let handler = move || async move { ([("content-type", "application/json")], body) };
            axum::serve(listener, axum::Router::new().route("/", axum::routing::get(handler))).await.unwrap();
        });
    });
    receiver.recv().unwrap()
}

struct Row {
    what: &'static str,
    measured: String,
    promised: &'static str,
    is_met: bool,
}

fn main() {
    if std::env::args().any(|argument| argument == "--list" || argument == "--test") {
        return;
    }
    let directory = tempfile::tempdir().unwrap();
    let mut service = Service::start(directory.path(), &["--slots", "2", "--threads", "1"]);
    let mut rows = Vec::new();
    let mut row = |what, measured: String, promised, is_met| {
        println!("{} {what}: {measured} (promised: {promised})", if is_met { "met   " } else { "MISSED" });
        rows.push(Row { what, measured, promised, is_met });
    };
    // Both cores are busy in solvers.
    let busy: Vec<String> = (0..2).map(|_| service.submit(&endless_job())).collect();
    for id in &busy {
        service.wait_for(id, &["running"]);
    }
    let radii: Vec<f64> = (0..10_000).map(|k| 0.3 + 1e-5 * f64::from(k)).collect();
    let study = json!({"base": {"scene": {"kind": "redistance", "spacing": 0.1, "shape": {"type": "circle", "radius": 0.5}}, "priority": -10},
        "sweep": {"mode": "list", "points": radii.iter().map(|r| json!({"/scene/shape/radius": r})).collect::<Vec<_>>()}});
    let asked = Instant::now();
    let answer = service.post("/v1/studies", &study);
    let seconds = asked.elapsed().as_secs_f64();
    assert_eq!(answer.status, 201, "{}", answer.text());
    let study = answer.json()["id"].as_str().unwrap().to_owned();
    row("a study of 10,000 points is accepted", format!("{seconds:.2} s"), "≤ 2 s", seconds <= 2.0);
    let body = json!({"scene": {"kind": "redistance", "spacing": 0.1}, "priority": -50}).to_string();
    let (times, rate) = storm(&service.url, 8.0, 201, |_| post("/v1/jobs", &body));
    let text = format!("p50 {:.1} ms, p99 {:.1} ms, {rate:.0}/s", at(&times, 0.5), at(&times, 0.99));
    row("submit, 32 connections, both cores in solvers, 10,000 jobs", text, "p99 ≤ 50 ms", at(&times, 0.99) <= 50.0);
    let path = format!("/v1/jobs/{}", busy[0]);
    let (times, rate) = storm(&service.url, 8.0, 200, |_| get(&path));
    let text = format!("p50 {:.1} ms, p99 {:.1} ms, {rate:.0}/s", at(&times, 0.5), at(&times, 0.99));
    row("read a job, the same", text, "p99 ≤ 20 ms", at(&times, 0.99) <= 20.0);
    let asked = Instant::now();
    let page = service.get(&format!("/v1/studies/{study}/jobs?limit=100"));
    let milliseconds = asked.elapsed().as_secs_f64() * 1e3;
    assert_eq!(page.json()["items"].as_array().unwrap().len(), 100);
    row("a page of 100 jobs of the study", format!("{milliseconds:.0} ms"), "–", true);
    let asked = Instant::now();
    let table = service.get(&format!("/v1/studies/{study}/table"));
    let milliseconds = asked.elapsed().as_secs_f64() * 1e3;
    assert_eq!(table.text().lines().count(), 10_001);
    row("the table of 10,000 points", format!("{milliseconds:.0} ms"), "–", true);
    let asked = Instant::now();
    let answer = service.request("POST", &format!("/v1/studies/{study}/cancel"), &[], Some(b""));
    assert_eq!(answer.json()["counts"]["canceled"], 10_000, "{}", answer.text());
    let seconds = asked.elapsed().as_secs_f64();
    row("a study of 10,000 points is cancelled", format!("{seconds:.2} s"), "≤ 2 s", seconds <= 2.0);
    service.kill();
    let began = Instant::now();
    service.restart();
    let seconds = began.elapsed().as_secs_f64();
    let jobs: i64 = service.with_store(|store| store.query_row("SELECT COUNT(*) FROM jobs", [], |r| r.get(0)));
    row(
        "ready after kill -9 with more than 10,000 jobs",
        format!("{seconds:.2} s with {jobs} jobs"),
        "≤ 5 s",
        seconds <= 5.0,
    );
    // Idle: nothing is left to be run.
    service.with_store(|store| {
        store.execute("UPDATE jobs SET state = 'canceled', finished_at = created_at WHERE state = 'queued'", [])
    });
    for id in &busy {
        service.act(id, "cancel");
    }
    eventually("nothing runs", Duration::from_secs(30), || {
        let page: Value = service.get("/v1/jobs?state=queued,running,canceling&limit=1").json();
        page["items"].as_array().unwrap().is_empty().then_some(())
    });
    let answer = service.get(&path);
    let bare = bare(answer.bytes);
    let _ = storm(&service.url, 1.0, 200, |_| get(&path));
    let (_, ours) = storm(&service.url, 5.0, 200, |_| get(&path));
    let (_, theirs) = storm(&bare, 5.0, 200, |_| get("/"));
    let text = format!("{ours:.0}/s against {theirs:.0}/s, a share of {:.2}", ours / theirs);
    row("idle reads against a bare axum answer of the same bytes", text, "≥ 1/3", ours * 3.0 >= theirs);
    let memory = service.resident_bytes() as f64 / 1e6;
    row("resident memory after all this", format!("{memory:.0} MB"), "≤ 100 MB", memory <= 100.0);
    let mut text = String::from("| | measured | promised | |\n| --- | --- | --- | --- |\n");
    for Row { what, measured, promised, is_met } in &rows {
        text += &format!("| {what} | {measured} | {promised} | {} |\n", if *is_met { "met" } else { "missed" });
    }
    std::fs::create_dir_all("soak-output").unwrap();
    std::fs::write("soak-output/load.md", text).unwrap();
}
