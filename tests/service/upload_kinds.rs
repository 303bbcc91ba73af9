//! Files as other programs write them: each is read, or refused with a reason that says what helps. The service and
//! `meniscus run` find and say the same.

use crate::support::{Service, program};
use crate::uploads::upload;
use crate::{files_of, manifest, service};
use serde_json::{Value, json};
use std::path::Path;
use std::process::{Command, Output};

/// A sphere of triangles between circles of latitude.
fn sphere() -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let (rings, around) = (15, 30);
    let mut points = vec![[0.0, 0.0, 1.0]];
    for ring in 1..=rings {
        let (sin, z) = (std::f64::consts::PI * f64::from(ring) / f64::from(rings + 1)).sin_cos();
        points.extend((0..around).map(|k| {
            let (y, x) = (std::f64::consts::TAU * f64::from(k) / f64::from(around)).sin_cos();
            [sin * x, sin * y, z]
        }));
    }
    points.push([0.0, 0.0, -1.0]);
    let at = |ring: u32, k: u32| 1 + (ring - 1) * around as u32 + k % around as u32;
    let (rings, around, last) = (rings as u32, around as u32, points.len() as u32 - 1);
    let mut faces = Vec::new();
    for k in 0..around {
        faces.push([0, at(1, k), at(1, k + 1)]);
        faces.push([last, at(rings, k + 1), at(rings, k)]);
        for ring in 1..rings {
            faces.push([at(ring, k), at(ring + 1, k), at(ring + 1, k + 1)]);
            faces.push([at(ring, k), at(ring + 1, k + 1), at(ring, k + 1)]);
        }
    }
    (points, faces)
}

/// What is right for a file: so many points and faces, with normals or not, or words of the reason.
enum Right {
    Read { points: usize, faces: usize, has_normals: bool },
    Refused(&'static str),
}

/// A line of a file for each item.
fn lines<T>(items: &[T], line: impl Fn(&T) -> String) -> String {
    items.iter().map(|item| line(item) + "\n").collect()
}

/// The kinds of `cases/files`, made anew.
fn cases() -> Vec<(&'static str, Vec<u8>, Right)> {
    let (points, faces) = sphere();
    let (count, triangles) = (points.len(), faces.len());
    let read = |faces: usize, has_normals: bool| Right::Read { points: count, faces, has_normals };
    let xyz = lines(&points, |[x, y, z]| format!("{x} {y} {z}"));
    let comma = lines(&points, |x| x.map(|c| format!("{c:.6}").replace('.', ",")).join(" "));
    let ply = |more: &str, normal: &dyn Fn(usize) -> String, tail: &str| {
        let names = ["x", "y", "z", "nx", "ny", "nz"].map(|name| format!("property float {name}\n")).concat();
        let numbered: Vec<(usize, &[f64; 3])> = points.iter().enumerate().collect();
        let rows = lines(&numbered, |(k, [x, y, z])| format!("{x} {y} {z} {}{tail}", normal(*k)));
        format!("ply\nformat ascii 1.0\nelement vertex {count}\n{names}{more}end_header\n{rows}")
    };
    let own = |k: usize| points[k].map(|c| c.to_string()).join(" ");
    let more: String = (0..60).map(|k| format!("property float scalar_f{k}\n")).collect();
    let mut latin_1 = ply("comment Gr?n\n", &own, "").into_bytes();
    latin_1.iter_mut().filter(|byte| **byte == b'?').for_each(|byte| *byte = 0xFC);
    let vertices = lines(&points, |[x, y, z]| format!("v {x} {y} {z}"));
    let normals = lines(&points, |[x, y, z]| format!("vn {x} {y} {z}"));
    let plain = lines(&faces, |face| format!("f {} {} {}", face[0] + 1, face[1] + 1, face[2] + 1));
    let continued = lines(&faces, |face| format!("f {} {} \\\n{}", face[0] + 1, face[1] + 1, face[2] + 1));
    let with_normals = lines(&faces, |face| face.map(|k| format!(" {0}//{0}", k + 1)).concat().replacen(' ', "f ", 1));
    let mut stl = vec![0; 80];
    stl.extend((triangles as u32).to_le_bytes());
    for face in &faces {
        stl.extend([0; 12]);
        stl.extend(face.iter().flat_map(|k| points[*k as usize]).flat_map(|c| (c as f32).to_le_bytes()));
        stl.extend([0; 2]);
    }
    let strip: Vec<String> =
        faces.iter().flat_map(|face| face.map(|k| k.to_string()).into_iter().chain(["-1".to_owned()])).collect();
    let strips = format!(
        "ply\nformat ascii 1.0\nelement vertex {count}\nproperty float x\nproperty float y\nproperty float z\n\
         element tristrips 1\nproperty list int int vertex_indices\nend_header\n{xyz}{} {}\n",
        strip.len(),
        strip.join(" ")
    );
    let of = |k: usize, odd: &str| if k == 5 { odd.to_owned() } else { own(k) };
    vec![
        ("tristrips.ply", strips.into_bytes(), read(triangles, false)),
        ("66_properties.ply", ply(&more, &own, &" 1".repeat(60)).into_bytes(), read(0, true)),
        ("latin1_comment.ply", latin_1, read(0, true)),
        ("cr_only.ply", ply("", &own, "").replace('\n', "\r").into_bytes(), read(0, true)),
        ("two_corner_face.obj", format!("{vertices}f 1 2\n{plain}").into_bytes(), read(triangles, false)),
        ("continuation.obj", format!("{vertices}{continued}").into_bytes(), read(triangles, false)),
        (
            "unreferenced_vertex.obj",
            format!("{vertices}{normals}v 0 0 0\n{with_normals}").into_bytes(),
            read(triangles, true),
        ),
        ("binary.stl", stl, read(triangles, false)),
        ("bom.xyz", format!("\u{FEFF}{xyz}").into_bytes(), read(0, false)),
        ("decimal_comma.xyz", comma.into_bytes(), Right::Refused("line 1: \"0,000000\" has a decimal comma")),
        (
            "nan_normal.ply",
            ply("", &|k| of(k, "nan nan nan"), "").into_bytes(),
            Right::Refused("the normal of point 5"),
        ),
        (
            "zero_normals.ply",
            ply("", &|_| "0 0 0".to_owned(), "").into_bytes(),
            Right::Refused("and of 451 more is zero"),
        ),
    ]
}

/// Runs a scene in the foreground.
fn run(directory: &Path, scene: &Value) -> Output {
    let body = directory.join("scene.json");
    std::fs::write(&body, scene.to_string()).unwrap();
    let out = directory.join("out");
    let _ = std::fs::remove_dir_all(&out);
    Command::new(program()).arg("run").arg(&body).arg("--out").arg(&out).output().unwrap()
}

fn curvature(file: &Path) -> Value {
    json!({"kind": "surface_pde", "surface": {"type": "points", "file": file}, "problem": "curvature"})
}

#[test]
fn meshes_are_taken_as_they_come_or_refused_with_what_helps() {
    let (_directory, service) = service(&["--slots", "1"]);
    let directory = tempfile::tempdir().unwrap();
    for (name, bytes, right) in cases() {
        let said = upload(&service, "surface", &bytes);
        let path = directory.path().join(name);
        std::fs::write(&path, &bytes).unwrap();
        let done = run(directory.path(), &curvature(&path));
        let printed = String::from_utf8_lossy(&done.stderr).into_owned() + &String::from_utf8_lossy(&done.stdout);
        match right {
            Right::Read { points, faces, has_normals } => {
                let found = &said["found"];
                assert_eq!(said["state"], "ready", "{name}: {said}");
                let expected = (&json!(points), &json!(faces), &json!(has_normals));
                assert_eq!((&found["points"], &found["faces"], &found["normals"]), expected, "{name}: {said}");
                assert_eq!(found["is_closed"], if faces > 0 { json!(true) } else { Value::Null }, "{name}");
                let left_out = if name.starts_with("unreferenced") { json!(1) } else { Value::Null };
                assert_eq!(found["points_left_out"], left_out, "{name}");
                assert!(done.status.success(), "{name}: {printed}");
                let report = std::fs::read_to_string(directory.path().join("out/report.json")).unwrap();
                assert_eq!(report.contains("points.without_face"), !left_out.is_null(), "{name}: {report}");
            }
            Right::Refused(part) => {
                let reason = said["reason"].as_str().unwrap_or_default();
                assert!(said["state"] == "rejected" && reason.contains(part), "{name}: {said}");
                assert!(!done.status.success() && printed.contains(reason), "{name}: {printed}");
            }
        }
    }
}

/// The files that `tests/python/hdf5_kinds.py` writes, and what it says of them.
fn hdf5_kinds(directory: &Path) -> Option<Vec<Value>> {
    files_of("hdf5_kinds.py", directory)?;
    manifest(directory).as_array().cloned()
}

/// What the inspection of a file hands over: its line, and positions, level and normals of the points.
pub(crate) fn inspected(path: &Path, purpose: &str) -> (Value, Option<meniscus::scene::Cloud>) {
    let output = Command::new(program()).args(["inspect", "--as", purpose]).arg(path).output().unwrap();
    let line = output.stdout.split(|b| *b == b'\n').next().unwrap_or_default();
    let said: Value = serde_json::from_slice(line).unwrap_or_default();
    let mut rest = output.stdout.get(line.len() + 1..).unwrap_or_default();
    (said, meniscus_jobs::formats::cloud_file::read(&mut rest).ok())
}

#[test]
fn hdf5_of_h5py_and_vtk_is_read_in_every_format_and_storage() {
    let directory = tempfile::tempdir().unwrap();
    let Some(kinds) = hdf5_kinds(directory.path()) else { return };
    let numbers = |list: &Value| serde_json::from_value::<Option<Vec<f64>>>(list.clone()).unwrap();
    for kind in &kinds {
        let name = kind["name"].as_str().unwrap();
        let path = directory.path().join(name).with_extension("vtkhdf");
        let (said, cloud) = inspected(&path, "surface");
        let cloud = cloud.unwrap_or_else(|| panic!("{name}: {said}"));
        assert!(numbers(&kind["points"]) == Some(cloud.positions.as_flattened().to_vec()), "{name}");
        assert!(numbers(&kind["normals"]) == cloud.normals.map(|normals| normals.as_flattened().to_vec()), "{name}");
        assert_eq!(said["ready"]["faces"], kind["faces"], "{name}: {said}");
        let (said, cloud) = inspected(&path, "points");
        let cloud = cloud.unwrap_or_else(|| panic!("{name}: {said}"));
        assert!(numbers(&kind["phi"]) == cloud.level, "{name}");
    }
    assert!(kinds.len() > 80, "{}", kinds.len());
}

#[test]
fn files_of_vtk_run_in_the_service_and_in_the_foreground() {
    let directory = tempfile::tempdir().unwrap();
    let Some(kinds) = hdf5_kinds(directory.path()) else { return };
    let (_directory, service) = service(&["--slots", "1"]);
    for name in ["vtk_f4_0", "vtk_mesh", "crowded_12_latest"] {
        if !kinds.iter().any(|kind| kind["name"] == name) {
            continue;
        }
        let path = directory.path().join(name).with_extension("vtkhdf");
        let surface = upload(&service, "surface", &std::fs::read(&path).unwrap());
        let mut scene = curvature(&path);
        scene["surface"] = json!({"type": "points", "upload": surface["id"]});
        service.wait_for(&service.submit(&json!({ "scene": scene })), &["succeeded"]);
        let done = run(directory.path(), &curvature(&path));
        assert!(done.status.success(), "{name}: {}", String::from_utf8_lossy(&done.stderr));
        let frame = hdf5::File::open(directory.path().join("out/frames/000001.vtkhdf")).unwrap();
        let mut mean: Vec<f64> = frame.dataset("VTKHDF/PointData/mean_curvature").unwrap().read_raw().unwrap();
        mean.sort_by(f64::total_cmp);
        assert!((mean[mean.len() / 2] - 0.5).abs() < 2e-2, "{name}: {}", mean[mean.len() / 2]);
    }
    check_levels(&service, directory.path());
}

/// Points with a level in 32 bits, as VTK writes them, are redistanced.
fn check_levels(service: &Service, directory: &Path) {
    let path = directory.join("level.vtkhdf");
    let file = hdf5::FileBuilder::new().with_fapl(|plist| plist.libver_latest()).create(&path).unwrap();
    let root = file.create_group("VTKHDF").unwrap();
    let data = root.create_group("PointData").unwrap();
    let places: Vec<[f32; 3]> =
        (0..65 * 65).map(|k| [(k % 65) as f32 / 32.0 - 1.0, (k / 65) as f32 / 32.0 - 1.0, 0.0]).collect();
    let phi: Vec<f32> = places.iter().map(|x| x[0].hypot(x[1]) - 0.5).collect();
    let points = root.new_dataset::<f32>().chunk((25_000, 3)).shape((places.len().., 3));
    points.create("Points").unwrap().write_raw(places.as_flattened()).unwrap();
    data.new_dataset::<f32>().deflate(4).chunk(999).shape(phi.len()..).create("phi").unwrap().write_raw(&phi).unwrap();
    drop((points, data, root));
    file.close().unwrap();
    let found = upload(service, "points", &std::fs::read(&path).unwrap());
    assert_eq!((&found["state"], &found["found"]["points"]), (&json!("ready"), &json!(4225)), "{found}");
    let mut scene =
        json!({"kind": "redistance", "dimension": 2, "spacing": 0.03125, "shape": {"type": "points", "file": path}});
    let done = run(directory, &scene);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    scene["shape"] = json!({"type": "points", "upload": found["id"]});
    service.wait_for(&service.submit(&json!({ "scene": scene })), &["succeeded"]);
}
