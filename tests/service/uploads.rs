//! Files from outside: taken in, looked into by a process of its own, used, refused.

use crate::support::{Service, eventually, program, steady_job};
use crate::{files_of, manifest, service};
use meniscus::geometry::{Vector, fibonacci};
use serde_json::{Value, json};
use std::process::Command;
use std::time::Duration;

pub(crate) fn upload(service: &Service, purpose: &str, bytes: &[u8]) -> Value {
    let answer = service.request("POST", &format!("/v1/uploads?as={purpose}"), &[], Some(bytes));
    assert_eq!(answer.status, 201, "{}", answer.text());
    let id = answer.json()["id"].as_str().unwrap().to_owned();
    eventually("it is looked into", Duration::from_secs(20), || {
        let upload = service.get(&format!("/v1/uploads/{id}")).json();
        (upload["state"] != "quarantined").then_some(upload)
    })
}

#[test]
fn a_downloaded_checkpoint_comes_back_as_an_upload_and_goes_on_bit_for_bit() {
    let (_directory, service) = service(&["--slots", "1"]);
    let body = json!({"scene": {"kind": "vortex", "spacing": 0.03125, "flow": {"type": "single_vortex", "period": 2}, "end_time": 1, "steps": 30}});
    let first = service.submit(&body);
    service.wait_for(&first, &["succeeded"]);
    let checkpoint =
        service.get(&format!("/v1/jobs/{first}/checkpoints")).json()["items"][0]["id"].as_str().unwrap().to_owned();
    let bytes = service.get(&format!("/v1/checkpoints/{checkpoint}/content")).bytes;
    // Another service, which knows nothing of the first.
    let (_elsewhere, other) = crate::service(&["--slots", "1"]);
    let found = upload(&other, "checkpoint", &bytes);
    assert_eq!((&found["state"], &found["found"]["step"]), (&json!("ready"), &json!(30)), "{found}");
    let restart = json!({"restart": {"upload": found["id"], "overrides": {"/end_time": 2}}});
    let rest = other.submit(&restart);
    let job = other.wait_for(&rest, &["succeeded"]);
    assert_eq!(job["lineage"]["restarted_from"], found["id"]);
    let here = service.submit(&json!({"restart": {"checkpoint": checkpoint, "overrides": {"/end_time": 2}}}));
    service.wait_for(&here, &["succeeded"]);
    assert_eq!(other.frames(&rest), service.frames(&here));
    assert_eq!(other.series(&rest), service.series(&here));
    // A forked one, with an override that no restart may make.
    let refused = other.post("/v1/jobs", &json!({"restart": {"upload": found["id"], "overrides": {"/spacing": 0.1}}}));
    assert_eq!(refused.status, 422);
    assert_eq!(
        other.request("DELETE", &format!("/v1/uploads/{}", found["id"].as_str().unwrap()), &[], None).status,
        204
    );
}

#[test]
fn points_and_places_of_uploads_are_used_by_scenes() {
    let (_directory, service) = service(&["--slots", "1"]);
    let first = service.submit(&json!({"scene": {"kind": "redistance", "spacing": 0.03125}}));
    service.wait_for(&first, &["succeeded"]);
    let frame = service.get(&format!("/v1/jobs/{first}/files/frames/000000.vtkhdf")).bytes;
    let points = upload(&service, "points", &frame);
    assert_eq!(points["state"], "ready", "{points}");
    assert_eq!(points["found"]["fields"], json!(["phi"]));
    let places = upload(&service, "queries", b"0.75 0 0\n0 0.5 0\n0.7 0 0\n");
    assert_eq!(places["found"]["points"], 3, "{places}");
    let scene = json!({"kind": "redistance", "spacing": 0.03125, "shape": {"type": "points", "upload": points["id"]},
                       "queries": {"type": "points", "upload": places["id"]}});
    let id = service.submit(&json!({"scene": scene, "checkpoint": {"every_steps": 1}}));
    // While somebody needs it, an upload is not deleted.
    let place = format!("/v1/uploads/{}", points["id"].as_str().unwrap());
    let deleted = service.request("DELETE", &place, &[], None).status;
    service.wait_for(&id, &["succeeded"]);
    if deleted == 409 {
        assert_eq!(service.request("DELETE", &place, &[], None).status, 204);
    }
    let wrong = json!({"scene": {"kind": "redistance", "shape": {"type": "points", "upload": places["id"]}}});
    assert_eq!(service.post("/v1/jobs", &wrong).pointers(), ["/scene/shape"]);
}

#[test]
fn surfaces_are_understood_and_everything_else_is_named() {
    let (_directory, service) = service(&["--slots", "1"]);
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    let surface = upload(&service, "surface", obj.as_bytes());
    assert_eq!((&surface["found"]["faces"], &surface["found"]["is_closed"]), (&json!(4), &json!(true)), "{surface}");
    for (purpose, bytes, part) in [
        ("surface", b"v 0 0 0\nf 1 2 3\n".as_slice(), "line 2"),
        ("points", b"\x89HDF\r\n\x1a\nrubbish", "file"),
        ("checkpoint", b"hello", "no HDF5 file"),
        ("queries", b"1 2 x\n", "no number"),
    ] {
        let found = upload(&service, purpose, bytes);
        assert_eq!(found["state"], "rejected", "{found}");
        assert!(found["reason"].as_str().unwrap().contains(part), "{found}");
        let reason = found["reason"].as_str().unwrap();
        assert!(!reason.contains(service.data.to_str().unwrap()), "{reason}");
    }
    assert_eq!(service.request("POST", "/v1/uploads", &[], Some(b"x")).pointers(), ["as"]);
    assert_eq!(service.request("POST", "/v1/uploads?as=points", &[], Some(b"")).status, 422);
    let form = [("content-type", "multipart/form-data; boundary=x")];
    assert_eq!(service.request("POST", "/v1/uploads?as=points", &form, Some(b"x")).status, 415);
    assert_eq!(service.get("/v1/uploads").json()["items"].as_array().unwrap().len(), 5);
}

#[test]
fn uploads_have_a_limit_and_a_key() {
    let (_directory, service) = service(&["--upload-bytes", "1000"]);
    let send =
        |bytes: &[u8]| service.request("POST", "/v1/uploads?as=queries", &[("idempotency-key", "k")], Some(bytes));
    assert_eq!(send(&[b'0'; 1001]).status, 413);
    let first = send(b"1 2 3\n");
    let again = send(b"1 2 3\n");
    assert_eq!((first.status, again.status, first.text()), (201, 201, again.text()));
    assert_eq!(again.header("idempotent-replayed"), Some("true"));
    assert_eq!(send(b"1 2 4\n").status, 422);
    assert_eq!(service.get("/v1/uploads").json()["items"].as_array().unwrap().len(), 1);
    assert_eq!(std::fs::read_dir(service.data.join("uploads")).unwrap().count(), 1, "nothing is left of the others");
}

/// The public list of ways to make HDF5 open other files or load code, and files that only look harmless.
#[test]
fn hostile_files_are_refused_before_anything_else_is_opened() {
    let directory = tempfile::tempdir().unwrap();
    if files_of("hostile_hdf5.py", directory.path()).is_none() {
        return;
    }
    let manifest = manifest(directory.path());
    let inspect = |folder: &str, name: &str, purpose: &str| {
        let output = Command::new(program())
            .args(["inspect", "--as", purpose])
            .arg(format!("{name}.h5"))
            .current_dir(directory.path().join(folder))
            .env("HDF5_PLUGIN_PATH", directory.path().join("targets/plugins"))
            .output()
            .unwrap();
        let line = output.stdout.split(|b| *b == b'\n').next().unwrap_or_default().to_vec();
        serde_json::from_slice::<Value>(&line).unwrap_or(Value::Null)
    };
    let mut opened = Vec::new();
    let mut let_through = Vec::new();
    let names = |list: &str| manifest[list].as_array().unwrap().clone();
    for case in names("hostile") {
        let name = case["name"].as_str().unwrap();
        let name = name.trim_end_matches(".h5");
        if inspect("hostile", name, "points")["ready"].is_object() {
            if case["opens_other_files"] == true {
                opened.push(name.to_owned());
            } else {
                let_through.push(name.to_owned());
            }
        }
    }
    // Its group has no name: only a reference in an attribute leads there, and nobody reads attributes.
    opened.retain(|name| name != "extlink_behind_reference");
    assert!(opened.is_empty(), "let through though they lead to other files: {opened:?}");
    // Odd, but neither dangerous nor wrong as points: libhdf5 reads them all the same.
    assert!(let_through.len() <= 40, "{let_through:?}");
    let refused: Vec<(String, Value)> = names("benign")
        .iter()
        .map(|case| case["name"].as_str().unwrap().trim_end_matches(".h5").to_owned())
        .filter_map(|name| {
            let said = inspect("benign", &name, "points");
            (!said["ready"].is_object()).then_some((name, said))
        })
        .collect();
    assert!(refused.is_empty(), "{refused:?}");
    // No target was so much as opened: the system calls say so, where they can be seen.
    if Command::new("strace").arg("-V").output().is_ok_and(|output| output.status.success()) {
        for case in names("hostile").iter().filter(|case| case["opens_other_files"] == true) {
            let name = case["name"].as_str().unwrap().trim_end_matches(".h5");
            let traced = Command::new("strace")
                .args(["-f", "-e", "trace=openat,open,socket,connect,execve"])
                .arg(program())
                .args(["inspect", "--as", "points"])
                .arg(format!("{name}.h5"))
                .current_dir(directory.path().join("hostile"))
                .env("HDF5_PLUGIN_PATH", directory.path().join("targets/plugins"))
                .output()
                .unwrap();
            let calls = String::from_utf8_lossy(&traced.stderr).into_owned();
            assert!(!calls.contains("targets") && !calls.contains("etc/passwd"), "{name}: {calls}");
        }
    }
}

#[test]
fn checkpoints_on_demand_are_listed_and_kept_while_they_are_used() {
    let (_directory, service) = service(&["--slots", "1"]);
    let mut body = steady_job();
    body["checkpoint"] = json!({"every_wall_s": 3600});
    let id = service.submit(&body);
    service.worker_eventually(&id);
    eventually("it is under way", Duration::from_secs(20), || {
        (service.job(&id)["progress"]["step"].as_u64() > Some(0)).then_some(())
    });
    let asked = service.request("POST", &format!("/v1/jobs/{id}/checkpoints"), &[], Some(b""));
    if asked.status == 202 {
        eventually("a checkpoint comes", Duration::from_secs(20), || {
            let list = service.get(&format!("/v1/jobs/{id}/checkpoints")).json();
            (!list["items"].as_array().unwrap().is_empty()).then_some(())
        });
    }
    service.wait_for(&id, &["succeeded"]);
}

/// A sphere as XYZ, six numbers a line with normals, three without.
fn sphere_xyz(has_normals: bool) -> Vec<u8> {
    let line = |n: Vector<3>| {
        let [x, y, z] = (n * 2.0).into();
        let normal = if has_normals { format!(" {} {} {}", n[0], n[1], n[2]) } else { String::new() };
        format!("{x} {y} {z}{normal}\n")
    };
    fibonacci::sphere(1500).into_iter().map(line).collect::<String>().into_bytes()
}

/// The same as PLY, in 32 bits, with normals that are as long as the radius.
fn sphere_ply() -> Vec<u8> {
    let names = ["x", "y", "z", "nx", "ny", "nz"].map(|name| format!("property float {name}\n")).concat();
    let mut bytes =
        format!("ply\nformat binary_little_endian 1.0\nelement vertex 1500\n{names}end_header\n").into_bytes();
    for x in fibonacci::sphere(1500) {
        let x: [f64; 3] = (x * 2.0).into();
        bytes.extend(x.iter().chain(&x).flat_map(|c| (*c as f32).to_le_bytes()));
    }
    bytes
}

#[test]
fn equations_are_solved_on_uploaded_surfaces_with_and_without_normals() {
    let (directory, service) = service(&["--slots", "1"]);
    let run = |scene: Value| {
        let id = service.submit(&json!({"scene": scene}));
        service.wait_for(&id, &["succeeded"]);
        let frame = service.get(&format!("/v1/jobs/{id}/files/frames/000001.vtkhdf")).bytes;
        (id, frame)
    };
    // H of a sphere of radius 2 is 1/2.
    let column = |frame: &[u8], name: &str| -> Vec<f64> {
        let path = directory.path().join("frame.vtkhdf");
        std::fs::write(&path, frame).unwrap();
        let file = hdf5::File::open(&path).unwrap();
        file.dataset(&format!("VTKHDF/PointData/{name}")).unwrap().read_raw().unwrap()
    };
    let on = |surface: &Value, more: Value| {
        let mut scene = json!({"kind": "surface_pde", "surface": {"type": "points", "upload": surface["id"]}});
        scene.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        scene
    };
    let mut with_normals = Vec::new();
    for (bytes, has_normals) in [(sphere_xyz(true), true), (sphere_xyz(false), false), (sphere_ply(), true)] {
        let surface = upload(&service, "surface", &bytes);
        assert_eq!((&surface["found"]["points"], &surface["found"]["normals"]), (&json!(1500), &json!(has_normals)));
        let (id, frame) = run(on(&surface, json!({"problem": "curvature"})));
        let mean = column(&frame, "mean_curvature");
        assert!(mean.len() == 1500 && mean.iter().all(|h| (h - 0.5).abs() < 1e-2), "{mean:?}");
        let report = service.get(&format!("/v1/jobs/{id}/report")).json();
        assert_eq!(report["errors"], json!([]));
        let said = report["method"]["points"].as_str().unwrap();
        assert!(said.contains(if has_normals { "their own normals" } else { "estimated normals" }), "{said}");
        with_normals = frame;
    }
    // A frame has points and normals: it is a surface again.
    let surface = upload(&service, "surface", &with_normals);
    let fields = surface["found"]["fields"].as_array().unwrap();
    assert!(fields[0] == "normal" && fields.contains(&json!("mean_curvature")), "{surface}");
    let wave = json!({"type": "plane_wave", "k": [0.5, 0, 0]});
    let (_, frame) = run(on(&surface, json!({"problem": {"type": "laplace_beltrami", "field": wave}})));
    for (value, x) in column(&frame, "value").iter().zip(fibonacci::sphere(1500)) {
        // −(k² − (k·n)²) sin k·x − 2/R (k·n) cos k·x with k = 1/2 along x and R = 2.
        let exact = -0.25 * (1.0 - x[0] * x[0]) * x[0].sin() - 0.5 * x[0] * x[0].cos();
        assert!((value - exact).abs() < 1e-2, "{value} for {exact}");
    }
    let job = on(&surface, json!({"problem": {"type": "poisson", "condition": "dirichlet"}}));
    assert_eq!(service.post("/v1/jobs", &json!({"scene": job})).pointers(), ["/scene/problem/condition"]);
    let estimate = service.post("/v1/estimates", &json!({"scene": on(&surface, json!({}))})).json();
    assert_eq!(estimate["particles"], 1500, "{estimate}");
    // Places have no normals and are no surface.
    let places = upload(&service, "queries", &sphere_xyz(true));
    assert_eq!(service.post("/v1/jobs", &json!({"scene": on(&places, json!({}))})).pointers(), ["/scene/surface"]);
}

#[test]
fn what_is_wrong_with_an_uploaded_surface_is_an_event_or_ends_the_job_with_the_points_named() {
    let (_directory, service) = service(&["--slots", "1"]);
    let job = |bytes: &[u8], clean: &str| {
        let surface = upload(&service, "surface", bytes);
        let surface = json!({"type": "points", "upload": surface["id"], "clean": clean});
        service.submit(&json!({"scene": {"kind": "surface_pde", "surface": surface, "problem": "curvature"}}))
    };
    let whole = String::from_utf8(sphere_xyz(true)).unwrap();
    let lines: Vec<&str> = whole.lines().collect();
    let holed = job(lines[..1450].join("\n").as_bytes(), "drop");
    service.wait_for(&holed, &["succeeded"]);
    let events = service.get(&format!("/v1/jobs/{holed}/events?limit=100")).json();
    let findings: Vec<&Value> =
        events["items"].as_array().unwrap().iter().filter(|event| event["type"] == "finding").collect();
    assert_eq!(findings.len(), 1, "{events}");
    assert!(findings[0].to_string().contains("more: neighbors on one side alone"), "{findings:?}");
    let finding = &findings[0]["data"];
    assert!(finding["code"] == "holes" && finding["severity"] == "warning" && finding["step"] == 0, "{finding}");
    let points = finding["points"].as_array().unwrap();
    assert!(!points.is_empty() && finding["count"].as_u64().unwrap() > points.len() as u64, "{finding}");
    // The same finding is in the job, the report, the log, and marked in the frames.
    let status = service.get(&format!("/v1/jobs/{holed}")).json();
    assert_eq!((&status["health"]["status"], &status["health"]["findings"][0]), (&json!("doubtful"), finding));
    let report = service.get(&format!("/v1/jobs/{holed}/report")).json();
    assert_eq!((&report["health"]["status"], &report["health"]["findings"][0]), (&json!("doubtful"), finding));
    assert!(service.get(&format!("/v1/jobs/{holed}/log")).text().contains("warning (holes)"));
    let doubtful = service.get("/v1/jobs?health=doubtful").json();
    assert_eq!(doubtful["items"].as_array().unwrap().len(), 1, "{doubtful}");
    assert_eq!(service.get("/v1/jobs?health=sound").json()["items"], json!([]));
    assert_eq!(service.get("/v1/jobs?health=fine").status, 422);
    let frame = service.get(&format!("/v1/jobs/{holed}/files/frames/000001.vtkhdf")).bytes;
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("frame.vtkhdf"), frame).unwrap();
    let frame = hdf5::File::open(directory.path().join("frame.vtkhdf")).unwrap();
    let bit = frame.dataset("VTKHDF/FieldData/finding.holes").unwrap().read_raw::<i64>().unwrap()[0];
    let bits = frame.dataset("VTKHDF/PointData/finding").unwrap().read_raw::<i64>().unwrap();
    let marked: Vec<usize> = (0..bits.len()).filter(|point| bits[*point] & bit != 0).collect();
    // Every point is marked; the finding names the first few.
    assert_eq!(marked.len() as u64, finding["count"].as_u64().unwrap());
    assert_eq!(json!(marked[..points.len()]), finding["points"]);
    // The surface has triangles, with three corners each.
    let ends = frame.dataset("VTKHDF/Polygons/Offsets").unwrap().read_raw::<i64>().unwrap();
    assert!(ends.len() > 2_500 && ends[1] == 3, "{}", ends.len());
    // Twins are left out and told, or refused where that is asked for.
    let twins = format!("{whole}{}\n", lines[3]);
    let merged = service.wait_for(&job(twins.as_bytes(), "drop"), &["succeeded"]);
    assert_eq!(merged["health"]["findings"][0]["code"], "points.merged", "{merged}");
    assert!(merged.to_string().contains("point 1500:"), "{merged}");
    let failed = service.wait_for(&job(twins.as_bytes(), "refuse"), &["failed"]);
    assert_eq!(failed["reason"], "input.damaged");
    assert!(failed.to_string().contains("points 3 and 1500 are"), "{failed}");
}

#[test]
fn a_surface_is_run_from_a_local_mesh_too() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    std::fs::write(at("sphere.ply"), sphere_ply()).unwrap();
    let run = |normals: Value, out: &str| {
        let surface = json!({"type": "points", "file": at("sphere.ply")});
        let scene = json!({"kind": "surface_pde", "surface": surface, "problem": "curvature", "normals": normals});
        std::fs::write(at("scene.json"), scene.to_string()).unwrap();
        Command::new(program()).arg("run").arg(at("scene.json")).arg("--out").arg(at(out)).output().unwrap()
    };
    let mut normals = Vec::new();
    for (asked, out) in [(json!({"type": "given", "metric": "normals"}), "given"), (json!("estimated"), "estimated")] {
        let done = run(asked, out);
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let file = hdf5::File::open(at(out).join("frames/000001.vtkhdf")).unwrap();
        normals.push(file.dataset("VTKHDF/PointData/normal").unwrap().read_raw::<f64>().unwrap());
        let mean = file.dataset("VTKHDF/PointData/mean_curvature").unwrap().read_raw::<f64>().unwrap();
        assert!(mean.iter().all(|h| (h - 0.5).abs() < 1e-2));
    }
    let off = |(given, estimated): (&f64, &f64)| (given - estimated).abs();
    assert!(normals[0].iter().zip(&normals[1]).map(off).fold(0.0, f64::max) < 1e-2);
}
