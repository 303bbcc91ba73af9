//! `meniscus verify` and `meniscus run` with cases, by the real program: every short target of accuracy is met. Times are
//! shown and not judged here.

use super::support::program;
use serde_json::{Value, json};
use std::path::Path;
use std::process::{Command, Output};

#[test]
fn the_short_targets_of_redistance_are_met_and_earlier_runs_are_kept() {
    let directory = tempfile::tempdir().unwrap();
    let verify = || {
        let output = Command::new(program())
            .args(["verify", "--only", "redistance", "--runs"])
            .arg(directory.path().join("runs"))
            .output()
            .unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    let first = verify();
    let lines: Vec<&str> = first.lines().collect();
    assert!(lines.len() > 15, "{first}");
    for line in lines.iter().filter(|line| !line.contains("CPU seconds")) {
        assert!(line.ends_with(" met") || line.contains(" RMS error at jitter 0.49 "), "{line}");
    }
    assert!(lines.iter().any(|line| line.contains("CPU seconds")));
    // Kept runs give the same lines, their own times included.
    assert_eq!(verify(), first);
}

#[test]
fn unknown_kinds_are_named() {
    let output = Command::new(program()).args(["verify", "--only", "droplets"]).output().unwrap();
    assert!(!output.status.success());
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(message.contains("droplets") && message.contains("redistance, vortex"), "{message}");
}

#[test]
fn points_of_a_file_are_read_in_the_foreground() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    let run = |name: &str, scene: &Value| {
        std::fs::write(at("scene.json"), scene.to_string()).unwrap();
        Command::new(program()).arg("run").arg(at("scene.json")).arg("--out").arg(at(name)).output().unwrap()
    };
    let ellipse = json!({"kind": "redistance", "spacing": 0.03125});
    assert!(run("ellipse", &ellipse).status.success());
    // Frames hold the level of the band; what they came from is found again from them.
    let frame = |number: u32| {
        let path = at("ellipse").join(format!("frames/{number:06}.vtkhdf"));
        json!({"type": "points", "file": path})
    };
    let own = json!({"kind": "redistance", "spacing": 0.03125, "shape": frame(0), "queries": frame(1)});
    let output = run("own", &own);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let nearly = |name: &str| {
        let file = hdf5::File::open(at(name).join("frames/000001.vtkhdf")).unwrap();
        file.dataset("VTKHDF/PointData/phi").unwrap().read_raw::<f64>().unwrap()
    };
    let (phi, again) = (nearly("ellipse"), nearly("own"));
    assert_eq!(phi.len(), again.len());
    for (a, b) in phi.iter().zip(&again).filter(|(a, _)| a.is_finite()) {
        assert!((a - b).abs() < 1e-6, "{a} and {b}");
    }
    let missing = json!({"kind": "redistance", "shape": {"type": "points", "file": at("none.h5")}});
    let refused = run("missing", &missing);
    assert!(!refused.status.success());
    assert!(String::from_utf8_lossy(&refused.stderr).contains("/shape"));
}

/// A case of four runs of which one target is met and one is missed.
fn case() -> Value {
    let run = |cells: f64| json!({"kind": "redistance", "spacing": 1.0 / cells});
    json!({
        "title": "Ellipse", "source": "A test",
        "runs": {"cells_16": run(16.0), "cells_24": run(24.0), "cells_32": run(32.0), "cells_48": run(48.0)},
        "targets": [
            {"title": "order", "bound": {"at_least": 4.0}, "paper": "4.8",
             "measure": {"type": "order", "quantity": "phi", "norm": "rms", "floor": 1e-13}},
            {"title": "maximum error", "runs": ["cells_16"], "bound": {"at_most": 0.0},
             "measure": {"type": "error", "quantity": "phi", "norm": "max"}}
        ]
    })
}

fn run_file(case: &Value, directory: &Path) -> Output {
    let file = directory.join("ellipse.json");
    std::fs::write(&file, case.to_string()).unwrap();
    Command::new(program()).arg("run").arg(&file).arg("--out").arg(directory.join("out")).output().unwrap()
}

#[test]
fn a_case_runs_by_itself_and_shows_its_values_beside_its_targets() {
    let directory = tempfile::tempdir().unwrap();
    let output = run_file(&case(), directory.path());
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(!output.status.success(), "a missed target is a failure: {text}");
    let line = |title: &str| text.lines().find(|line| line.starts_with(title)).unwrap_or_else(|| panic!("{text}"));
    assert!(line("order ").ends_with(" met") && line("order ").contains("4.8") && line("order ").contains("≥ 4.000"));
    assert!(line("maximum error ").ends_with(" missed"));
    for name in ["cells_16", "cells_24", "cells_32", "cells_48"] {
        assert!(directory.path().join("out").join(name).join("report.json").is_file(), "{name}");
    }
}

#[test]
fn mistakes_in_a_case_are_told_with_their_place_before_anything_runs() {
    let directory = tempfile::tempdir().unwrap();
    let message = |change: &dyn Fn(&mut Value)| {
        let mut case = case();
        change(&mut case);
        let output = run_file(&case, directory.path());
        assert!(!output.status.success() && !directory.path().join("out").exists());
        String::from_utf8(output.stderr).unwrap()
    };
    let field = message(&|case| case["targets"][1]["colour"] = json!(1));
    assert!(field.contains("ellipse.json: targets[1]") && field.contains("unknown field `colour`"), "{field}");
    let scene = message(&|case| case["runs"]["cells_48"]["spacin"] = json!(1));
    assert!(scene.contains("run cells_48: /scene/spacin") && scene.contains("did you mean spacing?"), "{scene}");
}

#[test]
fn cases_of_a_directory_are_verified_instead_of_those_of_the_program() {
    let directory = tempfile::tempdir().unwrap();
    let (cases, runs) = (directory.path().join("cases"), directory.path().join("runs"));
    std::fs::create_dir_all(cases.join("redistance")).unwrap();
    std::fs::write(cases.join("redistance/ellipse.json"), case().to_string()).unwrap();
    let verify =
        || Command::new(program()).arg("verify").arg("--cases").arg(&cases).arg("--runs").arg(&runs).output().unwrap();
    let output = verify();
    let text = String::from_utf8(output.stdout).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert!(!output.status.success() && lines.len() == 2, "{text}");
    assert!(lines[0].starts_with("redistance/ellipse ") && lines[0].ends_with(" met"), "{text}");
    assert!(lines[1].ends_with(" missed"), "{text}");
    std::fs::write(cases.join("redistance/broken.json"), "{\"title\": 1}").unwrap();
    let message = String::from_utf8(verify().stderr).unwrap();
    assert!(message.contains("redistance/broken.json: title: invalid type"), "{message}");
}
