//! The OpenAPI document as programs use it: it validates, and clients that are generated from it work.

use crate::{python, service};
use std::path::{Path, PathBuf};
use std::process::Command;

fn run(command: &mut Command) {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(output.status.success(), "{command:?}: {}{}", text(&output.stdout), text(&output.stderr));
}

#[test]
fn a_generated_python_client_submits_a_job_and_reads_its_report() {
    let Some(python) = python() else { return };
    let (_directory, service) = service(&["--slots", "1"]);
    let folder = service.data.join("client");
    std::fs::create_dir(&folder).unwrap();
    let document = folder.join("openapi.json");
    std::fs::write(&document, service.get("/openapi.json").bytes).unwrap();
    run(Command::new(&python).args(["-m", "openapi_spec_validator"]).arg(&document));
    // The generator has no type of its own for files, pictures and streams.
    let overrides = "content_type_overrides:\n  application/x-hdf5: application/octet-stream\n  \
        application/x-tar: application/octet-stream\n  image/svg+xml: application/octet-stream\n  \
        text/event-stream: text/plain\n  text/csv: text/plain\n";
    std::fs::write(folder.join("overrides.yml"), overrides).unwrap();
    run(Command::new(python.with_file_name("openapi-python-client"))
        .args(["generate", "--meta", "none", "--output-path", "meniscus_client", "--fail-on-warning"])
        .args(["--config", "overrides.yml", "--path"])
        .arg(&document)
        // It formats what it writes with ruff.
        .env("PATH", path_with(python.parent().unwrap()))
        .current_dir(&folder));
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/generated_client.py");
    run(Command::new(&python).arg(script).arg(&service.url).arg(&folder));
}

/// Where the client for Python is, and what Python needs to find it.
fn own_client() -> (PathBuf, PathBuf) {
    let place = Path::new(env!("CARGO_MANIFEST_DIR")).join("api/clients/python");
    let source = place.join("src");
    (place, source)
}

#[test]
fn the_client_for_python_does_what_it_says() {
    let Some(python) = python() else { return };
    let (_directory, service) = service(&["--slots", "2"]);
    let (place, source) = own_client();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/own_client.py");
    run(Command::new(&python).arg(script).arg(&service.url).env("PYTHONPATH", &source));
    // Its types are those of the document.
    let document = service.data.join("openapi.json");
    std::fs::write(&document, service.get("/openapi.json").bytes).unwrap();
    let written = service.data.join("models.py");
    run(Command::new(&python).arg(place.join("generate.py")).arg(&document).arg(&written));
    let kept = source.join("meniscus_client/models.py");
    if std::env::var_os("MENISCUS_UPDATE").is_some() {
        std::fs::copy(&written, &kept).unwrap();
    }
    let read = |path: &Path| std::fs::read_to_string(path).unwrap();
    assert!(read(&written) == read(&kept), "`make client` writes models.py anew");
}

#[test]
fn the_reference_is_what_the_service_says_of_itself() {
    let Some(python) = python() else { return };
    let (_directory, service) = service(&["--slots", "1"]);
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (kept, written) = (root.join("docs/reference"), service.data.join("reference"));
    let target = if std::env::var_os("MENISCUS_UPDATE").is_some() { &kept } else { &written };
    run(Command::new(&python).arg(root.join("tests/python/reference.py")).arg(&service.url).arg(target));
    let pages = |folder: &Path| {
        let mut pages: Vec<(std::ffi::OsString, String)> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap())
            .map(|entry| (entry.file_name(), std::fs::read_to_string(entry.path()).unwrap()))
            .collect();
        pages.sort();
        pages
    };
    assert!(pages(target) == pages(&kept), "`make reference` writes docs/reference anew");
}

#[test]
fn the_notebook_of_first_steps_runs() {
    let Some(python) = python() else { return };
    let (directory, service) = service(&["--slots", "2"]);
    let (place, source) = own_client();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/run_notebook.py");
    run(Command::new(&python)
        .arg(script)
        .arg(place.join("examples/first-steps.ipynb"))
        .arg(directory.path())
        .env("PYTHONPATH", &source)
        .env("MPLBACKEND", "agg")
        .env("MENISCUS_URL", &service.url));
}

#[test]
fn types_for_typescript_are_generated_and_compile() {
    let Some(tools) = std::env::var_os("MENISCUS_NODE_TOOLS").map(PathBuf::from) else {
        assert!(std::env::var_os("CI").is_none(), "MENISCUS_NODE_TOOLS is not set");
        return;
    };
    let (_directory, service) = service(&["--slots", "1"]);
    let folder = service.data.join("types");
    std::fs::create_dir(&folder).unwrap();
    std::fs::write(folder.join("openapi.json"), service.get("/openapi.json").bytes).unwrap();
    run(Command::new(tools.join("openapi-typescript"))
        // Fields with a default may be left out of requests.
        .args(["openapi.json", "--default-non-nullable=false", "--output", "meniscus.ts"])
        .current_dir(&folder));
    let program = r#"import type { components, paths } from "./meniscus";
const job: components["schemas"]["JobSpec"] = {
  scene: { kind: "redistance", spacing: 0.1, shape: { type: "circle", radius: 0.5 } },
};
type Report = paths["/v1/jobs/{id}/report"]["get"]["responses"]["200"]["content"]["application/json"];
const largest = (report: Report): number => Math.max(...report.errors.map((entry) => entry.value ?? 0));
console.log(job, largest);
"#;
    std::fs::write(folder.join("use.ts"), program).unwrap();
    run(Command::new(tools.join("tsc"))
        .args(["--noEmit", "--strict", "--skipLibCheck", "--lib", "es2022,dom", "use.ts"])
        .current_dir(&folder));
}

/// The search path with a folder before it.
fn path_with(first: &Path) -> std::ffi::OsString {
    let rest = std::env::var_os("PATH").unwrap_or_default();
    std::env::join_paths(std::iter::once(first.to_owned()).chain(std::env::split_paths(&rest))).unwrap()
}
