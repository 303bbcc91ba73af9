//! What the service and `meniscus run` find in files of points.

use super::read;
use crate::spec::uploads::{PointContents, Purpose};
use meniscus::scene::Cloud;
use std::fs::File;

/// Reads bytes as a file for a purpose.
fn found(bytes: &[u8], purpose: Purpose) -> Result<(PointContents, Cloud), String> {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("x");
    std::fs::write(&path, bytes).unwrap();
    read(&mut File::open(&path).unwrap(), purpose)
}

/// A VTKHDF file of a tetrahedron in 32 bits, changed before it is closed.
fn tetrahedron(change: impl Fn(&hdf5::Group)) -> Vec<u8> {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("x.h5");
    let file = hdf5::File::create(&path).unwrap();
    let root = file.create_group("VTKHDF").unwrap();
    let points = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    put(&root, "Points", &points, &[4, 3]);
    let data = root.create_group("PointData").unwrap();
    put(&data, "Normals", &points.map(|c| c - 0.25), &[4, 3]);
    let polygons = root.create_group("Polygons").unwrap();
    put(&polygons, "Offsets", &[0_i64, 3, 6, 9, 12], &[5]);
    put(&polygons, "Connectivity", &[0_i32, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3], &[12]);
    change(&root);
    drop((polygons, data, root));
    file.close().unwrap();
    std::fs::read(&path).unwrap()
}

fn put<T: hdf5::H5Type>(group: &hdf5::Group, name: &str, values: &[T], shape: &[usize]) {
    group.new_dataset::<T>().shape(shape).create(name).unwrap().write_raw(values).unwrap();
}

#[test]
fn faces_and_normals_of_vtk_are_those_of_a_surface() {
    let (contents, cloud) = found(&tetrahedron(|_| ()), Purpose::Surface).unwrap();
    assert_eq!(contents.faces.as_ref().map(|faces| (faces.faces, faces.is_closed)), Some((4, Some(true))));
    assert_eq!((contents.normals, contents.fields.len()), (Some(true), 1));
    assert_eq!(cloud.triangles, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]);
    assert_eq!(cloud.normals.unwrap()[1], [0.75, -0.25, -0.25]);
    // Places have neither.
    let (contents, cloud) = found(&tetrahedron(|_| ()), Purpose::Queries).unwrap();
    assert_eq!((contents.normals, contents.faces, cloud.normals, cloud.triangles.len()), (None, None, None, 0));
    assert!(found(&tetrahedron(|_| ()), Purpose::Points).unwrap_err().contains("/VTKHDF/PointData/phi"));
}

/// Of a mesh the area and the volume are told; one that is not closed is refused by its edges.
#[test]
fn meshes_are_measured_and_must_be_closed() {
    let (contents, cloud) = found(&tetrahedron(|_| ()), Purpose::Mesh).unwrap();
    assert_eq!((contents.normals, cloud.normals.is_none(), cloud.triangles.len()), (None, true, 4));
    assert!((contents.volume.unwrap() - 1.0 / 6.0).abs() < 1e-15);
    assert!((contents.area.unwrap() - 1.5 - 0.75_f64.sqrt()).abs() < 1e-14);
    let open = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\n";
    let refusal = found(open.as_bytes(), Purpose::Mesh).unwrap_err();
    assert!(refusal.contains("edge from (1.0000, 0.0000, 0.0000) to (0.0000, 1.0000, 0.0000) is open"), "{refusal}");
    assert_eq!(refusal.matches("is open").count(), 3, "{refusal}");
    let (contents, cloud) = found(b"0 0\n2 0\n2 1\n0 1\n", Purpose::Mesh).unwrap();
    assert_eq!((contents.area, contents.volume, cloud.triangles.len()), (Some(6.0), Some(2.0), 0));
    let refusal = found(b"0 0\n1 1\n1 0\n0 1\n", Purpose::Mesh).unwrap_err();
    assert!(refusal.contains("edges 0 and 2 cross"), "{refusal}");
}

#[test]
fn strips_and_pieces_are_joined() {
    let (_, cloud) = found(
        &tetrahedron(|root| {
            root.unlink("Polygons").unwrap();
            let strips = root.create_group("Strips").unwrap();
            put(&strips, "Offsets", &[0_i64, 4], &[2]);
            put(&strips, "Connectivity", &[0_i64, 1, 2, 3], &[4]);
        }),
        Purpose::Surface,
    )
    .unwrap();
    assert_eq!(cloud.triangles, [[0, 1, 2], [2, 1, 3]]);
    // Two pieces of three points, whose faces count from the first point of each.
    let bytes = tetrahedron(|root| {
        for name in ["Points", "PointData", "Polygons"] {
            root.unlink(name).unwrap();
        }
        put(
            root,
            "Points",
            &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0, 1.0, 0.0, 2.0, 0.0, 1.0, 2.0],
            &[6, 3],
        );
        put(root, "NumberOfPoints", &[3_i64, 3], &[2]);
        let polygons = root.create_group("Polygons").unwrap();
        put(&polygons, "NumberOfCells", &[1_i64, 1], &[2]);
        put(&polygons, "Offsets", &[0_i64, 3, 0, 3], &[4]);
        put(&polygons, "Connectivity", &[0_i64, 1, 2, 2, 1, 0], &[6]);
    });
    assert_eq!(found(&bytes, Purpose::Surface).unwrap().1.triangles, [[0, 1, 2], [5, 4, 3]]);
}

#[test]
fn points_without_a_face_are_counted_unless_they_are_vertices() {
    let cut = |vertices: usize| {
        tetrahedron(|root| {
            let polygons = root.group("Polygons").unwrap();
            for name in ["Offsets", "Connectivity"] {
                polygons.unlink(name).unwrap();
            }
            put(&polygons, "Offsets", &[0_i64, 3], &[2]);
            put(&polygons, "Connectivity", &[0_i64, 2, 3], &[3]);
            let group = root.create_group("Vertices").unwrap();
            put(&group, "Connectivity", &vec![0_i64; vertices], &[vertices]);
        })
    };
    let (contents, cloud) = found(&cut(0), Purpose::Surface).unwrap();
    assert_eq!((contents.points, contents.points_left_out, cloud.left_out), (3, Some(1), 1));
    assert_eq!((cloud.triangles, cloud.normals.unwrap().len()), (vec![[0, 1, 2]], 3));
    let (contents, cloud) = found(&cut(4), Purpose::Surface).unwrap();
    assert_eq!((contents.points, contents.points_left_out, cloud.triangles), (4, None, vec![[0, 2, 3]]));
}

#[test]
fn what_is_wrong_in_hdf5_is_named() {
    let with = |name: &'static str, change: fn(&hdf5::Group)| {
        found(
            &tetrahedron(|root| {
                let (group, name) = name.rsplit_once('/').unwrap();
                let group = if group.is_empty() { root.clone() } else { root.group(group).unwrap() };
                if group.link_exists(name) {
                    group.unlink(name).unwrap();
                }
                change(&group);
            }),
            Purpose::Surface,
        )
        .unwrap_err()
    };
    for (message, part) in [
        (with("/Points", |_| ()), "there is no data set /VTKHDF/Points"),
        (with("/Points", |group| put(group, "Points", &[0_i32; 12], &[4, 3])), "floating-point"),
        (with("/Points", |group| put(group, "Points", &[0.0; 8], &[4, 2])), "[4, 2], not [n, 3]"),
        (
            with("PointData/Normals", |group| put(group, "Normals", &[0.0; 9], &[3, 3])),
            "PointData/Normals must be [4, 3]",
        ),
        (with("PointData/Normals", |group| put(group, "Normals", &[0.0; 12], &[4, 3])), "and of 3 more is zero"),
        (with("Polygons/Offsets", |group| put(group, "Offsets", &[0_i64, 13], &[2])), "an offset leads beyond"),
        (with("Polygons/Connectivity", |group| put(group, "Connectivity", &[4_i64; 12], &[12])), "not among 4"),
        (with("Polygons/Connectivity", |group| put(group, "Connectivity", &[-1_i64; 12], &[12])), "not among 4"),
        (
            with("/Steps", |group| put(&group.create_group("Steps").unwrap(), "Values", &[0.0, 1.0], &[2])),
            "2 time steps in /VTKHDF/Steps",
        ),
    ] {
        assert!(message.contains(part), "{message}");
    }
}
