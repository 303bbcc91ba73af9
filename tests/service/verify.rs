//! `meniscus verify` by the real program: every short row of accuracy is met. Times are shown and not judged here.

use super::support::program;
use std::process::Command;

#[test]
fn the_short_rows_of_redistance_are_met_and_earlier_runs_are_kept() {
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
    let rows: Vec<&str> = first.lines().collect();
    assert!(rows.len() > 15, "{first}");
    for row in rows.iter().filter(|row| !row.contains("seconds")) {
        assert!(row.ends_with(" met") || row.contains("RMS at α = .49"), "{row}");
    }
    assert!(rows.iter().any(|row| row.contains("seconds")));
    // Kept runs give the same table, their own times included.
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
    let run = |name: &str, scene: &serde_json::Value| {
        std::fs::write(at("scene.json"), scene.to_string()).unwrap();
        Command::new(program()).arg("run").arg(at("scene.json")).arg("--out").arg(at(name)).output().unwrap()
    };
    let ellipse = serde_json::json!({"kind": "redistance", "spacing": 0.03125});
    assert!(run("ellipse", &ellipse).status.success());
    // Frames hold the level of the band; what they came from is found again from them.
    let frame = |number: u32| {
        let path = at("ellipse").join(format!("frames/{number:06}.vtkhdf"));
        serde_json::json!({"type": "points", "file": path})
    };
    let own = serde_json::json!({"kind": "redistance", "spacing": 0.03125, "shape": frame(0), "queries": frame(1)});
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
    let missing = serde_json::json!({"kind": "redistance", "shape": {"type": "points", "file": at("none.h5")}});
    let refused = run("missing", &missing);
    assert!(!refused.status.success());
    assert!(String::from_utf8_lossy(&refused.stderr).contains("/shape"));
}
