//! The real binary over a real socket, in a data directory of its own.

use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// The program under test: built by the Makefile with debug assertions, `MENISCUS_BIN` says where.
pub fn program() -> PathBuf {
    let beside = || {
        let mut path = std::env::current_exe().unwrap();
        path.pop();
        path.pop();
        path.join("meniscus")
    };
    let path = std::env::var_os("MENISCUS_BIN").map_or_else(beside, PathBuf::from);
    assert!(
        path.is_file(),
        "{} is not there: run `make test`, or `cargo build --profile test -p meniscus-api` first",
        path.display()
    );
    path
}

pub struct Service {
    child: Child,
    pub url: String,
    pub data: PathBuf,
    arguments: Vec<String>,
    variables: Vec<(String, String)>,
    agent: ureq::Agent,
    /// What the service writes to its standard error, over all its starts.
    log: tempfile::NamedTempFile,
}

pub struct Answer {
    pub status: u16,
    pub headers: ureq::http::HeaderMap,
    pub bytes: Vec<u8>,
}

impl Answer {
    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.bytes).unwrap_or_else(|e| panic!("{e}: {}", self.text()))
    }

    pub fn text(&self) -> String {
        String::from_utf8_lossy(&self.bytes).into_owned()
    }

    pub fn header(&self, name: &str) -> Option<&str> {
        self.headers.get(name).and_then(|v| v.to_str().ok())
    }

    /// The pointers of a problem's errors.
    pub fn pointers(&self) -> Vec<String> {
        self.json()["errors"]
            .as_array()
            .into_iter()
            .flatten()
            .map(|e| e["pointer"].as_str().unwrap().to_owned())
            .collect()
    }
}

fn launch(
    data: &Path,
    arguments: &[String],
    variables: &[(String, String)],
    log: &tempfile::NamedTempFile,
) -> (Child, String) {
    // `prlimit` takes the limits of a process and the program that runs under them.
    let limit = variables.iter().find(|(name, _)| name == "MENISCUS_TEST_PRLIMIT").map(|(_, limit)| limit);
    let mut command = match limit {
        Some(limit) => {
            let mut command = Command::new("prlimit");
            command.args(limit.split(' ')).arg(program());
            command
        }
        None => Command::new(program()),
    };
    let mut child = command
        .envs(variables.iter().cloned())
        .args(["serve", "--bind", "127.0.0.1:0", "--no-calibration", "--data"])
        .arg(data)
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::from(std::fs::OpenOptions::new().append(true).open(log.path()).unwrap()))
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let url = line.trim().strip_prefix("listening on ").unwrap_or_else(|| panic!("first line: {line:?}")).to_owned();
    (child, url)
}

impl Service {
    pub fn start(data: &Path, arguments: &[&str]) -> Self {
        Self::start_with(data, arguments, &[])
    }

    /// With variables in its environment, which its workers see, too.
    pub fn start_with(data: &Path, arguments: &[&str], variables: &[(&str, &str)]) -> Self {
        let arguments: Vec<String> = arguments.iter().map(|a| (*a).to_owned()).collect();
        let variables: Vec<(String, String)> =
            variables.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect();
        let log = tempfile::NamedTempFile::new().unwrap();
        let (child, url) = launch(data, &arguments, &variables, &log);
        let agent = ureq::Agent::config_builder().http_status_as_error(false).max_redirects(0).build().into();
        let service = Self { child, url, data: data.to_owned(), arguments, variables, agent, log };
        service.wait_ready();
        service
    }

    fn wait_ready(&self) {
        eventually("the service is ready", Duration::from_secs(20), || {
            (self.get("/readyz").status == 200).then_some(())
        });
    }

    /// What the service has written to its standard error so far.
    pub fn log_text(&self) -> String {
        std::fs::read_to_string(self.log.path()).unwrap()
    }

    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// `kill -9`.
    pub fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Starts it again with other arguments.
    pub fn restart_with(&mut self, arguments: &[&str]) {
        self.arguments = arguments.iter().map(|argument| (*argument).to_owned()).collect();
        self.restart();
    }

    /// Stops it, and starts it again without `--adopt`.
    pub fn restart_needs_no_adoption(&mut self) {
        assert!(self.stop());
        self.arguments.retain(|argument| argument != "--adopt");
        self.restart();
    }

    /// A start that is refused: what it says.
    pub fn refused_start(&self) -> String {
        let output = Command::new(program())
            .args(["serve", "--bind", "127.0.0.1:0", "--no-calibration", "--data"])
            .arg(&self.data)
            .args(&self.arguments)
            .output()
            .unwrap();
        assert!(!output.status.success() && output.stdout.is_empty(), "{output:?}");
        String::from_utf8(output.stderr).unwrap()
    }

    pub fn restart(&mut self) {
        (self.child, self.url) = launch(&self.data, &self.arguments, &self.variables, &self.log);
        self.wait_ready();
    }

    /// Whether the service has come to an end by itself.
    pub fn has_ended(&mut self) -> bool {
        self.child.try_wait().unwrap().is_some()
    }

    /// A job, or nothing where the service does not answer.
    pub fn try_job(&self, id: &str) -> Option<Value> {
        let answer = self.agent.get(format!("{}/v1/jobs/{id}", self.url)).call();
        answer.ok()?.body_mut().read_to_string().ok().and_then(|text| serde_json::from_str(&text).ok())
    }

    /// Looks the data directory over, with the service stopped.
    pub fn fsck(&self) {
        let output = Command::new(program()).args(["fsck", "--data"]).arg(&self.data).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    }

    /// Resident memory of the service.
    pub fn resident_bytes(&self) -> u64 {
        meniscus_jobs::system::process::resident_bytes(self.pid()).unwrap()
    }

    /// The worker of a job, waited for.
    pub fn worker_eventually(&self, id: &str) -> u32 {
        eventually("there is a worker", Duration::from_secs(20), || self.worker(id))
    }

    /// Does something to the store behind the service's back.
    pub fn with_store<R>(&self, work: impl FnOnce(&rusqlite::Connection) -> rusqlite::Result<R>) -> R {
        let store = rusqlite::Connection::open(self.data.join("meniscus.sqlite")).unwrap();
        store.busy_timeout(Duration::from_secs(10)).unwrap();
        work(&store).unwrap()
    }

    /// SIGTERM, and the wait for an orderly end.
    pub fn stop(&mut self) -> bool {
        signal(self.pid(), rustix::process::Signal::TERM);
        let deadline = Instant::now() + Duration::from_secs(30);
        while Instant::now() < deadline {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status.success();
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        false
    }

    pub fn request(&self, method: &str, path: &str, headers: &[(&str, &str)], body: Option<&[u8]>) -> Answer {
        let mut builder = ureq::http::Request::builder().method(method).uri(format!("{}{path}", self.url));
        for (name, value) in headers {
            builder = builder.header(*name, *value);
        }
        let answer = match body {
            Some(body) => self.agent.run(builder.body(body).unwrap()),
            None => self.agent.run(builder.body(()).unwrap()),
        };
        let mut answer = answer.unwrap_or_else(|e| panic!("{method} {path}: {e}"));
        let mut bytes = Vec::new();
        answer.body_mut().as_reader().read_to_end(&mut bytes).unwrap();
        Answer { status: answer.status().as_u16(), headers: answer.headers().clone(), bytes }
    }

    pub fn get(&self, path: &str) -> Answer {
        self.request("GET", path, &[], None)
    }

    pub fn post(&self, path: &str, body: &Value) -> Answer {
        self.request("POST", path, &[("content-type", "application/json")], Some(body.to_string().as_bytes()))
    }

    pub fn submit(&self, body: &Value) -> String {
        let answer = self.post("/v1/jobs", body);
        assert_eq!(answer.status, 201, "{}", answer.text());
        answer.json()["id"].as_str().unwrap().to_owned()
    }

    pub fn job(&self, id: &str) -> Value {
        let answer = self.get(&format!("/v1/jobs/{id}"));
        assert_eq!(answer.status, 200, "{}", answer.text());
        answer.json()
    }

    pub fn act(&self, id: &str, action: &str) -> Answer {
        self.request("POST", &format!("/v1/jobs/{id}/{action}"), &[], Some(b""))
    }

    /// Waits until the job is in one of the states, and fails at any other terminal one.
    pub fn wait_for(&self, id: &str, states: &[&str]) -> Value {
        eventually(&format!("{id} is {states:?}"), Duration::from_secs(120), || {
            let job = self.job(id);
            let state = job["state"].as_str().unwrap();
            let terminal = ["succeeded", "failed", "canceled"].contains(&state);
            assert!(states.contains(&state) || !terminal, "{id} is {state}: {} {}", job["reason"], job["message"]);
            states.contains(&state).then_some(job)
        })
    }

    pub fn files(&self, id: &str) -> Vec<Value> {
        self.get(&format!("/v1/jobs/{id}/files")).json()["items"].as_array().unwrap().clone()
    }

    /// Digests of all frames, by path.
    pub fn frames(&self, id: &str) -> Vec<(String, String)> {
        self.files(id)
            .iter()
            .filter(|f| f["path"].as_str().unwrap().starts_with("frames/"))
            .map(|f| (f["path"].as_str().unwrap().to_owned(), f["sha256"].as_str().unwrap().to_owned()))
            .collect()
    }

    pub fn series(&self, id: &str) -> String {
        self.get(&format!("/v1/jobs/{id}/series")).text()
    }

    pub fn events(&self, id: &str) -> Vec<Value> {
        let mut all = Vec::new();
        let mut after = 0;
        loop {
            let page = self.get(&format!("/v1/jobs/{id}/events?after={after}&limit=1000")).json();
            all.extend(page["items"].as_array().unwrap().clone());
            match page["next"].as_u64() {
                Some(next) => after = next,
                None => return all,
            }
        }
    }

    /// The process of the job's worker, once there is one for the present attempt.
    pub fn worker(&self, id: &str) -> Option<u32> {
        let attempt = self.job(id)["attempt"].as_u64().unwrap();
        let directory = self.data.join("jobs").join(id).join("attempts").join(attempt.to_string());
        let wanted = std::fs::canonicalize(directory).ok()?;
        std::fs::read_dir("/proc").unwrap().flatten().find_map(|entry| {
            let pid: u32 = entry.file_name().to_str()?.parse().ok()?;
            let command = std::fs::read(entry.path().join("cmdline")).ok()?;
            command.split(|b| *b == 0).any(|word| word == wanted.as_os_str().as_encoded_bytes()).then_some(pid)
        })
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

pub fn signal(pid: u32, signal: rustix::process::Signal) {
    let pid = rustix::process::Pid::from_raw(pid.cast_signed()).unwrap();
    // It may be gone.
    let _ = rustix::process::kill_process(pid, signal);
}

pub fn eventually<R>(what: &str, patience: Duration, mut look: impl FnMut() -> Option<R>) -> R {
    let deadline = Instant::now() + patience;
    loop {
        if let Some(result) = look() {
            return result;
        }
        assert!(Instant::now() < deadline, "it never came true that {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// A job of up to two seconds with frames, series and twelve checkpoints on any machine, whose physics feeds back into
/// itself.
pub fn steady_job() -> Value {
    json!({
        "scene": {"kind": "redistance", "spacing": 0.03125, "repeat": 240},
        "output": {"every_time": 60, "series_every_steps": 7},
        "checkpoint": {"every_steps": 20}
    })
}

/// The same three times as long, for tests that must act before it ends on a machine much faster than this one.
pub fn long_job() -> Value {
    let mut body = steady_job();
    body["scene"]["repeat"] = json!(720);
    body["output"]["every_time"] = json!(180);
    body
}

/// A job whose only step takes minutes: fits of 165 coefficients about tens of thousands of particles.
pub fn endless_job() -> Value {
    json!({"scene": {"kind": "redistance", "dimension": 3, "spacing": 0.015625, "method": {"type": "pcp", "degree": 8}}})
}

/// A number in [0, 1) from a seed and a counter, printed seeds make a run repeatable.
pub fn chance(seed: u64, counter: u64) -> f64 {
    0.5 + 0.5 * meniscus::geometry::random::CounterRandom::new(seed).symmetric(&[counter.cast_signed()])
}

/// A seed from the environment, or one of this moment; printed, so that a failure can be repeated.
#[expect(clippy::print_stdout, reason = "a failing run must show its seed")]
pub fn seed() -> u64 {
    let given = std::env::var("MENISCUS_SEED").ok().and_then(|s| s.parse().ok());
    let seed = given.unwrap_or_else(|| {
        std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().as_micros() as u64
    });
    println!("MENISCUS_SEED={seed}");
    seed
}
