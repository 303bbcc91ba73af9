//! The page in a real browser (Chromium, driven by Playwright) against the real service. The steps of each test are in `steps.mjs`;
//! what happens to the service in between is here.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::io::{BufRead, BufReader, Write};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

#[path = "../support/service.rs"]
#[expect(dead_code, reason = "each test target uses a part")]
mod service;

/// A service whose address stays the same over its starts.
struct Served {
    data: tempfile::TempDir,
    port: u16,
    arguments: Vec<String>,
    child: Option<Child>,
}

impl Served {
    fn start(arguments: &[&str]) -> Self {
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let arguments = arguments.iter().map(|argument| (*argument).to_owned()).collect();
        let mut served = Self { data: tempfile::tempdir().unwrap(), port, arguments, child: None };
        served.launch();
        served
    }

    fn launch(&mut self) {
        let mut child = Command::new(service::program())
            .args(["serve", "--no-calibration", "--bind", &format!("127.0.0.1:{}", self.port), "--data"])
            .arg(self.data.path().join("data"))
            .args(&self.arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        assert!(line.starts_with("listening on"), "{line}");
        self.child = Some(child);
    }

    fn kill(&mut self) {
        if let Some(mut child) = self.child.take() {
            child.kill().unwrap();
            child.wait().unwrap();
        }
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.kill();
    }
}

/// The steps of one test in the browser.
struct Steps {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

fn chromium() -> PathBuf {
    let path = std::env::var_os("MENISCUS_CHROMIUM").map_or_else(|| PathBuf::from("/usr/bin/chromium"), PathBuf::from);
    assert!(path.is_file(), "{} is not there: `make test` installs Chromium", path.display());
    path
}

impl Steps {
    fn begin(name: &str, served: &Served, more: &[&str]) -> Self {
        let here = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/browser/steps.mjs");
        let mut child = Command::new("node")
            .arg(here)
            .args([name, &format!("http://127.0.0.1:{}", served.port)])
            .args(more)
            .env("MENISCUS_CHROMIUM", chromium())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let (input, output) = (child.stdin.take().unwrap(), BufReader::new(child.stdout.take().unwrap()));
        Self { child, input, output }
    }

    /// Waits until the browser has come to a place, and lets it go on after `then`.
    fn at(&mut self, place: &str, then: impl FnOnce()) {
        let mut line = String::new();
        self.output.read_line(&mut line).unwrap();
        assert_eq!(line.trim(), place);
        then();
        writeln!(self.input, "go on").unwrap();
    }

    fn end(mut self) {
        drop(self.input);
        assert!(self.child.wait().unwrap().success());
    }
}

fn run(name: &str) {
    let served = Served::start(&["--slots", "2"]);
    Steps::begin(name, &served, &[]).end();
}

#[test]
fn a_vortex_is_submitted_by_the_form_and_watched_to_its_end() {
    run("watch");
}

#[test]
fn a_file_of_ones_own_is_seen_before_it_is_used() {
    run("upload");
}

#[test]
fn a_job_goes_on_from_a_checkpoint_to_a_later_end() {
    run("restart");
}

#[test]
fn what_the_service_refuses_is_shown_at_its_field() {
    run("refusal");
}

#[test]
fn walls_and_bodies_are_lists_in_the_form() {
    run("lists");
}

#[test]
fn slips_of_the_hand_lose_nothing_and_do_nothing_else() {
    run("slips");
}

#[test]
fn a_study_that_refines_is_made_by_the_form_and_shows_what_it_found() {
    run("refine");
}

#[test]
fn a_study_has_its_points_and_a_failed_job_its_reason() {
    run("study");
}

#[test]
fn jobs_are_filtered_compared_and_acted_upon() {
    run("jobs");
}

#[test]
fn every_view_can_be_used_by_keyboard_and_reader_and_in_a_narrow_window() {
    run("access");
}

#[test]
fn a_service_that_was_killed_is_found_again_without_a_reload() {
    let mut served = Served::start(&["--slots", "2"]);
    let mut steps = Steps::begin("recovery", &served, &[]);
    steps.at("running", || served.kill());
    steps.at("away", || served.launch());
    steps.end();
}

#[test]
fn with_tokens_one_signs_in_and_the_token_is_in_no_address() {
    let output = Command::new(service::program()).args(["token", "alice"]).output().unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    let (token, line) = said.trim().split_once('\n').unwrap();
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), line).unwrap();
    let served = Served::start(&["--slots", "2", "--token-file", file.path().to_str().unwrap(), "--base-path", "/lab"]);
    Steps::begin("tokens", &served, &[token]).end();
}

/// The types that the page is written against are those of the document that the service publishes.
#[test]
fn the_page_agrees_with_the_description_of_the_api() {
    let data = tempfile::tempdir().unwrap();
    let service = service::Service::start(data.path(), &[]);
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("api/page");
    let document = data.path().join("openapi.json");
    std::fs::write(&document, service.get("/openapi.json").bytes).unwrap();
    let tool = |name: &str, arguments: &[&str]| {
        let output =
            Command::new(page.join("node_modules/.bin").join(name)).args(arguments).current_dir(&page).output();
        let output = output.unwrap_or_else(|error| panic!("{name}: {error}; `make page` installs it"));
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{name}: {said}{}", String::from_utf8_lossy(&output.stderr));
    };
    tool("openapi-typescript", &[document.to_str().unwrap(), "-o", "src/api-types.ts"]);
    tool("tsc", &["--noEmit"]);
}

#[test]
#[ignore = "writes into docs/guide: make screenshots"]
fn pictures_of_every_view() {
    run("pictures");
}

/// How quickly a frame of 250,000 points is drawn, and whether the memory of a tab stays where it is over a running job.
#[test]
#[ignore = "measures: cargo test --test browser -- --ignored --nocapture speed"]
fn speed() {
    run("speed");
}
