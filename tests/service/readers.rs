//! Frames in the hands of others: h5py and VTK's own reader.

use crate::service;
use serde_json::Value;
use std::process::Command;

#[test]
fn frames_open_in_h5py_and_vtk_with_the_right_counts_times_and_fields() {
    // `make test` makes the environment and says where.
    let Ok(python) = std::env::var("MENISCUS_PYTHON") else {
        assert!(
            std::env::var_os("CI").is_none() && std::env::var_os("MENISCUS_BIN").is_none(),
            "MENISCUS_PYTHON is not set"
        );
        return;
    };
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
