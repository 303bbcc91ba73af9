//! Values at points and flows on grids as uploads: read in every form that NumPy, VTK and h5py write, used by jobs and their restarts,
//! refused with what is wrong.

use crate::support::program;
use crate::upload_kinds::inspected;
use crate::uploads::upload;
use crate::{files_of, service};
use meniscus::geometry::fibonacci;
use serde_json::{Value, json};
use std::process::Command;

/// A sphere of 400 points as XYZ.
fn sphere() -> (Vec<[f64; 3]>, String) {
    let points: Vec<[f64; 3]> = fibonacci::sphere(400).iter().map(|x| [x[0], x[1], x[2]]).collect();
    let text = points.iter().map(|[x, y, z]| format!("{x} {y} {z}\n")).collect();
    (points, text)
}

fn heat(surface: &Value, initial: &Value) -> Value {
    json!({"kind": "surface_pde", "surface": {"type": "points", "upload": surface["id"]}, "problem": {
        "type": "diffusion", "initial": initial, "end_time": 0.1, "time_step": 0.02, "source": "0.1", "diffusivity": "1 + z/2"
    }})
}

#[test]
fn values_of_uploads_begin_jobs_and_their_restarts() {
    let (_directory, service) = service(&["--slots", "1"]);
    let (points, text) = sphere();
    let surface = upload(&service, "surface", text.as_bytes());
    let csv: String = "a;u\n".to_owned() + &points.iter().map(|x| format!("0;{}\n", x[0] * x[1])).collect::<String>();
    let values = upload(&service, "values", csv.as_bytes());
    assert_eq!(values["state"], "ready", "{values}");
    assert_eq!((&values["found"]["values"], &values["found"]["columns"][1]["name"]), (&json!(400), &json!("u")));
    let data = json!({"type": "data", "name": "u", "upload": values["id"]});
    let [of_data, written] = [data.clone(), json!({"type": "formula", "value": "x*y"})].map(|initial| {
        let id = service.submit(&json!({"scene": heat(&surface, &initial), "checkpoint": {"every_steps": 2}}));
        service.wait_for(&id, &["succeeded"]);
        id
    });
    let last = |id: &str| service.get(&format!("/v1/jobs/{id}/files/series.csv")).text();
    assert_eq!(last(&of_data), last(&written));
    let checkpoint = service.get(&format!("/v1/jobs/{of_data}/checkpoints")).json()["items"][0]["id"].clone();
    let rest = service.submit(&json!({"restart": {"checkpoint": checkpoint}}));
    service.wait_for(&rest, &["succeeded"]);
    // Estimates know how many points there are.
    let estimate = service.post("/v1/estimates", &json!({"scene": heat(&surface, &data)}));
    assert_eq!(estimate.json()["particles"], 400, "{}", estimate.text());
    // The wrong kind of upload, a name that is not there, and another number of values.
    let wrong = json!({"scene": heat(&surface, &json!({"type": "data", "upload": surface["id"]}))});
    assert_eq!(service.post("/v1/jobs", &wrong).pointers(), ["/scene/problem/initial"]);
    let few = upload(&service, "values", b"1\n2\n");
    let few = json!({"scene": heat(&surface, &json!({"type": "data", "upload": few["id"]}))});
    let refused = service.post("/v1/jobs", &few);
    assert!(refused.pointers() == ["/scene/problem/initial"] && refused.text().contains("2 values for 400 points"));
    let unnamed = heat(&surface, &json!({"type": "data", "name": "w", "upload": values["id"]}));
    let job = service.wait_for(&service.submit(&json!({ "scene": unnamed })), &["failed"]);
    let message = job["message"].as_str().unwrap();
    assert!(
        message.contains("/problem/initial") && message.contains("no column \"w\"; it has \"a\", \"u\""),
        "{message}"
    );
}

#[test]
fn values_come_in_the_forms_that_people_have() {
    let directory = tempfile::tempdir().unwrap();
    let read = |name: &str, bytes: &[u8]| {
        let path = directory.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        inspected(&path, "values")
    };
    let ply = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float quality\nproperty float y\nproperty float z\n\
               property uchar red\nend_header\n0 0.5 0 0 7\n1 -2 0 0 9\n";
    let (_, cloud) = read("a.ply", ply.as_bytes());
    let columns = cloud.unwrap().columns;
    let found: Vec<(&str, &[f64])> = columns.iter().map(|c| (c.name.as_str(), c.values.as_slice())).collect();
    assert_eq!(found, [("quality", &[0.5, -2.0][..]), ("red", &[7.0, 9.0][..])]);
    let (said, _) = read("b.txt", b"1\n2\nx\n");
    assert!(said["rejected"].as_str().unwrap().contains("line 3"), "{said}");
    let (said, _) = read("c.txt", b"# nothing\n");
    assert!(said["rejected"].as_str().unwrap().contains("no values"), "{said}");
}

#[test]
fn flows_of_vtk_and_h5py_are_read_in_every_form() {
    let directory = tempfile::tempdir().unwrap();
    if files_of("flow_kinds.py", directory.path()).is_none() {
        return;
    }
    let mut files: Vec<_> = std::fs::read_dir(directory.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    assert!(files.len() > 20, "{files:?}");
    for path in files {
        let (said, cloud) = inspected(&path, "flow");
        let name = path.file_stem().unwrap().to_str().unwrap();
        if name.starts_with("refused") {
            let reason = said["rejected"].as_str().unwrap_or_default();
            let part = if name.ends_with("nan") { "the time of step 1 (counted from 0) is NaN" } else { "no times" };
            assert!(reason.contains(part), "{path:?}: {said}");
            continue;
        }
        let cloud = cloud.unwrap_or_else(|| panic!("{path:?}: {said}"));
        let nodes = cloud.grid.unwrap();
        let times: &[f64] = if name.contains("times") || name == "offsets" { &[0.0, 0.5, 2.0] } else { &[0.0] };
        let counts = match name {
            "plane" => [9, 7, 1],
            "large_blocks" => [65, 40, 9],
            _ => [9, 7, 5],
        };
        assert_eq!((nodes.counts, nodes.origin, nodes.times.as_slice()), (counts, [-1.0, 0.5, 2.0], times), "{path:?}");
        for (t, time) in times.iter().enumerate() {
            // The offsets say that the last time is like the one before.
            let time = if name == "offsets" && t == 2 { 0.5 } else { *time };
            for k in 0..nodes.len() {
                let [i, j, l] = [k % counts[0], k / counts[0] % counts[1], k / counts[0] / counts[1]].map(|i| i as f64);
                let x = [-1.0 + 0.25 * i, 0.5 + 0.5 * j, 2.0 + 0.125 * l];
                let expected = [x[0] + 10.0 * time, 2.0 * x[1], x[2] - x[0]];
                for (column, expected) in cloud.columns.iter().zip(expected) {
                    let found = column.values[t * nodes.len() + k];
                    assert!((found - expected).abs() < 1e-6, "{path:?} {t} {k}: {found} {expected}");
                }
            }
        }
        assert_eq!(cloud.columns.len(), if name == "plane" { 2 } else { 3 }, "{path:?}");
    }
}

#[test]
fn a_number_too_few_in_a_flow_is_told() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("torn.vti");
    let file = |numbers: &str| {
        format!(
            "<VTKFile type=\"ImageData\"><ImageData WholeExtent=\"0 1 0 1 0 0\"><Piece><PointData><DataArray type=\"Float64\" \
             Name=\"velocity\" NumberOfComponents=\"2\" format=\"ascii\">{numbers}</DataArray></PointData></Piece></ImageData></VTKFile>"
        )
    };
    std::fs::write(&path, file("1 2 3 4 5 6 7")).unwrap();
    let (said, _) = inspected(&path, "flow");
    assert!(said["rejected"].as_str().unwrap_or_default().contains("9 numbers of velocities for 12"), "{said}");
    std::fs::write(&path, file("1 2 3 4 5 6 7 8")).unwrap();
    assert!(inspected(&path, "flow").1.is_some());
}

/// Rigid rotation about (0.5, 0.75) as a VTI file of the plane.
fn rotation() -> String {
    let numbers: String = (0..41 * 41)
        .map(|k| {
            let [x, y] = [k % 41, k / 41].map(|i| -0.5 + 0.05 * f64::from(i));
            format!("{} {} 0\n", -(y - 0.75), x - 0.5)
        })
        .collect();
    format!(
        "<VTKFile type=\"ImageData\" byte_order=\"LittleEndian\"><ImageData WholeExtent=\"0 40 0 40 0 0\" Origin=\"-0.5 -0.5 0\" \
         Spacing=\"0.05 0.05 1\"><Piece Extent=\"0 40 0 40 0 0\"><PointData><DataArray type=\"Float64\" Name=\"velocity\" \
         NumberOfComponents=\"3\" format=\"ascii\">{numbers}</DataArray></PointData></Piece></ImageData></VTKFile>"
    )
}

#[test]
fn an_uploaded_flow_carries_a_surface() {
    let (_directory, service) = service(&["--slots", "1"]);
    let flow = upload(&service, "flow", rotation().as_bytes());
    assert_eq!((&flow["state"], &flow["found"]["nodes"]), (&json!("ready"), &json!([41, 41, 1])), "{flow}");
    let given = json!({"type": "grid", "upload": flow["id"]});
    let vortex = json!({"kind": "vortex", "spacing": 0.03125, "band_h": 8, "end_time": 1, "steps": 20, "flow": given});
    let front = json!({"kind": "front", "spacing": 0.03, "end_time": 1, "time_step": 0.05, "law": {"type": "flow", "flow": given},
        "shape": {"type": "circle", "center": [0.5, 0.75], "radius": 0.15}});
    for scene in [vortex, front] {
        let id = service.submit(&json!({ "scene": scene }));
        service.wait_for(&id, &["succeeded"]);
        // A rotation is linear in space: splines give it exactly, and the circle about its center stays.
        let report = service.get(&format!("/v1/jobs/{id}/report")).json();
        let errors = report["errors"].as_array().unwrap();
        let worst =
            errors.iter().filter(|e| e["norm"] == "max" && matches!(e["quantity"].as_str(), Some("phi" | "points")));
        let worst = worst.map(|e| e["value"].as_f64().unwrap()).fold(0.0, f64::max);
        assert!(worst < 3e-4, "{report}");
    }
    let turned = rotation().replace("Spacing", "Direction=\"0 1 0 1 0 0 0 0 1\" Spacing");
    let refused = upload(&service, "flow", turned.as_bytes());
    assert!(refused["state"] == "rejected" && refused["reason"].as_str().unwrap().contains("turned"), "{refused}");
    let refused = upload(&service, "flow", rotation().replacen("velocity", "u", 1).as_bytes());
    assert!(refused["reason"].as_str().unwrap().contains("[\"u\"]"), "{refused}");
    // `meniscus run` takes the same file.
    let directory = tempfile::tempdir().unwrap();
    let (file, body) = (directory.path().join("flow.vti"), directory.path().join("body.json"));
    std::fs::write(&file, rotation()).unwrap();
    let scene = json!({"kind": "vortex", "spacing": 0.05, "band_h": 8, "end_time": 0.2, "steps": 4, "flow": {"type": "grid", "file": file}});
    std::fs::write(&body, json!({ "scene": scene }).to_string()).unwrap();
    let done = Command::new(program()).arg("run").arg(&body).arg("--out").arg(directory.path().join("out")).output();
    assert!(done.as_ref().unwrap().status.success(), "{}", String::from_utf8_lossy(&done.unwrap().stderr));
}
