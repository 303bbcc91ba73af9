//! Frames in the hands of others: h5py and VTK's own reader.

use crate::{python, service};
use serde_json::{Value, json};
use std::process::Command;

/// Archives and texts of an operator have the same matrix for SciPy: symmetric in areas, and constants have no Laplacian.
#[test]
fn operators_open_in_scipy() {
    let Some(python) = python() else { return };
    let (directory, service) = service(&[]);
    let mut seen = Vec::new();
    for (format, names) in [
        ("npz", ["laplace_beltrami.npz"].as_slice()),
        ("matrix_market", ["laplace_beltrami.mtx", "laplace_beltrami_areas.mtx"].as_slice()),
    ] {
        let scene = json!({"kind": "surface_pde", "count": 500, "problem": "poisson", "method": "conservative"});
        let id = service.submit(&json!({"scene": scene, "output": {"operators": format}}));
        let job = service.wait_for(&id, &["succeeded"]);
        assert_eq!(job["resolved"]["output"]["operators"], format);
        let mut paths = Vec::new();
        for name in names {
            let path = directory.path().join(name);
            std::fs::write(&path, service.get(&format!("/v1/jobs/{id}/files/{name}")).bytes).unwrap();
            paths.push(path);
        }
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/operators.py");
        let output = Command::new(&python).arg(script).args(&paths).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        seen.push(serde_json::from_slice::<Value>(&output.stdout).unwrap());
    }
    assert_eq!(seen[0], seen[1]);
    let number = |name: &str| seen[0][name].as_f64().unwrap();
    assert_eq!(number("rows"), 500.0);
    assert!((number("area") / (4.0 * std::f64::consts::PI) - 1.0).abs() < 2e-3);
    assert!(number("asymmetry") < 1e-14 && number("constants") < 1e-12, "{seen:?}");
    // Scenes without operators say so.
    let body = json!({"scene": {"kind": "vortex"}, "output": {"operators": "npz"}});
    let refused = service.post("/v1/jobs", &body);
    assert_eq!(refused.json()["errors"][0]["pointer"], "/output/operators");
}

#[test]
fn frames_open_in_h5py_and_vtk_with_the_right_counts_times_and_fields() {
    let Some(python) = python() else { return };
    let (directory, service) = service(&[]);
    for kind in meniscus::scenes::SCENES {
        let body: Value = serde_json::from_str(kind.example).unwrap();
        let id = service.submit(&body);
        let job = service.wait_for(&id, &["succeeded"]);
        let frames: Vec<Value> =
            service.files(&id).into_iter().filter(|f| f["path"].as_str().unwrap().starts_with("frames/")).collect();
        let mut paths = Vec::new();
        for (k, frame) in frames.iter().enumerate() {
            let path = directory.path().join(format!("{}-{k}.vtkhdf", kind.kind));
            let content = service.get(&format!("/v1/jobs/{id}/files/{}", frame["path"].as_str().unwrap())).bytes;
            std::fs::write(&path, content).unwrap();
            paths.push(path);
        }
        assert!(paths.len() >= 3);
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/read_frames.py");
        let output = Command::new(&python).arg(script).args(&paths).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let found: Vec<Value> = serde_json::from_slice(&output.stdout).unwrap();
        let mut fields: Vec<String> = serde_json::from_value(job["resolved"]["output"]["fields"].clone()).unwrap();
        fields.sort();
        for (k, (frame, found)) in frames.iter().zip(&found).enumerate() {
            // A front has as many foot-points as it is long; what a job tells is the number at its end.
            let is_end = k + 1 == frames.len();
            let number =
                if kind.kind == "front" && !is_end { &found["h5py"]["points"] } else { &job["progress"]["particles"] };
            for reader in ["h5py", "vtk"] {
                let seen = &found[reader];
                assert_eq!(&seen["points"], number, "{reader} {}", frame["path"]);
                assert_eq!(seen["time"].as_f64(), frame["time"].as_f64(), "{reader}");
                assert_eq!(serde_json::from_value::<Vec<String>>(seen["fields"].clone()).unwrap(), fields, "{reader}");
            }
            assert_eq!(&found["vtk"]["vertices"], number);
            let (a, b) = (found["h5py"]["mean_x"].as_f64().unwrap(), found["vtk"]["mean_x"].as_f64().unwrap());
            // VTK adds the same doubles in another order.
            assert!((a - b).abs() < 1e-12);
        }
        // ParaView's index names every frame with its time.
        let index = service.get(&format!("/v1/jobs/{id}/files/frames.vtkhdf.series")).json();
        let named: Vec<(&Value, &Value)> =
            index["files"].as_array().unwrap().iter().map(|f| (&f["name"], &f["time"])).collect();
        assert_eq!(named, frames.iter().map(|f| (&f["path"], &f["time"])).collect::<Vec<_>>());
    }
}
