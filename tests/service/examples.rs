//! The bodies of `tests/examples`, each run in the foreground by the real program, and measures of one's own in series.

use crate::service;
use crate::support::{eventually, program};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Duration;

fn examples() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/examples");
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "json"));
    files.sort();
    files
}

fn run(body: &Path, out: &Path) -> Output {
    Command::new(program()).arg("run").arg(body).arg("--out").arg(out).output().unwrap()
}

/// The columns of a series by name.
fn series(out: &Path) -> (Vec<String>, Vec<Vec<f64>>) {
    let text = std::fs::read_to_string(out.join("series.csv")).unwrap();
    let mut lines = text.lines();
    let names = lines.next().unwrap().split(',').map(str::to_owned).collect();
    let rows = lines.map(|line| line.split(',').map(|word| word.parse().unwrap_or(f64::NAN)).collect()).collect();
    (names, rows)
}

fn column(out: &Path, name: &str) -> Vec<f64> {
    let (names, rows) = series(out);
    let place = names.iter().position(|known| known == name).unwrap_or_else(|| panic!("{name} is not in {names:?}"));
    rows.iter().map(|row| row[place]).collect()
}

#[test]
fn every_example_runs_to_its_end() {
    let files = examples();
    assert!(files.len() >= 15);
    for file in files {
        let out = tempfile::tempdir().unwrap();
        let body: Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
        // Studies need a service; their tests are in `studies` and `refinement`.
        if body.get("sweep").is_some() || body.get("accuracy").is_some() {
            continue;
        }
        let done = run(&file, &out.path().join("out"));
        let printed = String::from_utf8_lossy(&done.stderr).into_owned();
        assert!(done.status.success(), "{}: {printed}", file.display());
        let report = std::fs::read(out.path().join("out/report.json")).unwrap();
        let report: Value = serde_json::from_slice(&report).unwrap();
        assert_eq!(report["health"]["finite"], json!(true), "{}", file.display());
    }
}

#[test]
fn studies_and_accuracies_of_the_examples_succeed() {
    let (_directory, service) = service(&["--slots", "2"]);
    for file in examples() {
        let body: Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
        if body.get("accuracy").is_some() {
            let made = service.post("/v1/jobs", &body);
            assert_eq!(made.status, 201, "{}: {}", file.display(), made.text());
            let id = made.json()["id"].as_str().unwrap().to_owned();
            service.wait_for(&id, &["succeeded"]);
            let report = service.get(&format!("/v1/jobs/{id}/report")).json();
            assert_eq!(report["accuracy"]["met"], json!(true), "{report}");
        } else if body.get("sweep").is_some() {
            let made = service.post("/v1/studies", &body);
            assert_eq!(made.status, 201, "{}: {}", file.display(), made.text());
            let id = made.json()["id"].as_str().unwrap().to_owned();
            let study = eventually("the study ends", Duration::from_secs(120), || {
                let study = service.get(&format!("/v1/studies/{id}")).json();
                ["succeeded", "failed"].contains(&study["state"].as_str().unwrap()).then_some(study)
            });
            assert_eq!(study["outcome"], json!("tolerance"), "{study}");
        }
    }
}

fn run_body(body: &Value, directory: &Path) -> (Output, PathBuf) {
    let file = directory.join("body.json");
    std::fs::write(&file, body.to_string()).unwrap();
    let out = directory.join("out");
    (run(&file, &out), out)
}

/// Σ ρ u² V/2 of decaying vortices in a fluid without tension: exp(−4 ν k² t) of that at the start, k = 2π.
#[test]
fn measures_and_probes_are_columns_of_the_series() {
    let directory = tempfile::tempdir().unwrap();
    let velocity = json!(["sin(2*pi*x)*cos(2*pi*y)", "-cos(2*pi*x)*sin(2*pi*y)"]);
    let fluid = json!({"density": 1, "viscosity": 0.02, "sound_speed": 12});
    let body = json!({
        "scene": {
            "kind": "droplet", "case": "static", "spacing": 0.025, "surface_tension": 0, "end_time": 0.2,
            "domain": {"low": [0, 0], "high": [1, 1]}, "shape": {"type": "circle", "center": [0.5, 0.5], "radius": 0.25},
            "fluids": {"inside": fluid, "outside": fluid}, "initial_velocity": {"inside": velocity, "outside": velocity}
        },
        "output": {
            "series_every_steps": 5,
            "probes": [
                {"name": "corner", "at": [0.25, 0.5], "field": "velocity_x"},
                {"name": "line", "along": {"from": [0, 0.5], "to": [1, 0.5], "count": 5}, "field": "velocity_y"}
            ],
            "measures": [
                {"name": "kinetic", "integral": "density*(velocity_x^2 + velocity_y^2)/2"},
                {"name": "inside", "integral": "1", "over": "inside"},
                {"name": "fastest", "max": "hypot(velocity_x, velocity_y)"}
            ]
        }
    });
    let (done, out) = run_body(&body, directory.path());
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let kinetic = column(&out, "measure.kinetic");
    assert!((kinetic[0] - 0.25).abs() < 2e-3, "{}", kinetic[0]);
    let k = 2.0 * std::f64::consts::PI;
    let decay = (kinetic.last().unwrap() / kinetic[0]).ln() / 0.2;
    let exact = -4.0 * 0.02 * k * k;
    assert!((decay / exact - 1.0).abs() < 0.15, "{decay} {exact}");
    let inside = column(&out, "measure.inside");
    // Whole particles are inside or not: on a lattice of h = R/10 the area is right to a few of them.
    assert!((inside[0] - std::f64::consts::PI / 16.0).abs() < 4e-3, "{}", inside[0]);
    assert!((column(&out, "measure.fastest")[0] - 1.0).abs() < 0.05);
    // u = sin(π/2) cos(π) at the probe.
    assert!((column(&out, "probe.corner")[0] + 1.0).abs() < 0.05, "{:?}", column(&out, "probe.corner"));
    assert!(column(&out, "probe.line.4")[0].abs() < 0.1);
}

#[test]
fn wrong_measures_are_told_at_their_place() {
    let directory = tempfile::tempdir().unwrap();
    let body = json!({
        "scene": {"kind": "vortex", "spacing": 0.05, "steps": 2, "end_time": 0.1},
        "output": {
            "probes": [{"name": "a b", "at": [0, 0, 0], "field": "phii"}, {"name": "c", "field": "phi"}],
            "measures": [{"name": "v", "integral": "phi", "over": "inside"}, {"name": "w", "mean": "psii", "max": "phi"}]
        }
    });
    let (done, _) = run_body(&body, directory.path());
    let printed = String::from_utf8_lossy(&done.stderr).into_owned() + &String::from_utf8_lossy(&done.stdout);
    assert!(!done.status.success());
    for place in [
        "/output/probes/0/name",
        "/output/probes/0/at",
        "/output/probes/0/field",
        "/output/probes/1",
        "/output/measures/0/over",
        "/output/measures/1",
    ] {
        assert!(printed.contains(place), "{place}: {printed}");
    }
}
