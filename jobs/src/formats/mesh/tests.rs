//! The same surfaces in every format, what is passed over, and what is refused with which words.

use super::{Mesh, read};

const TETRAHEDRON: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
const OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

fn tetrahedron() -> Mesh {
    read(TETRAHEDRON.as_bytes()).unwrap()
}

/// Reads a mesh and checks it, as every reader of files does.
fn whole(bytes: &[u8]) -> Result<Mesh, String> {
    let mut mesh = read(bytes)?;
    mesh.leave_out_loose_points()?;
    mesh.check().map(|()| mesh)
}

/// The triangles of a mesh as binary STL.
fn stl(mesh: &Mesh, head: &[u8]) -> Vec<u8> {
    let mut bytes = head.to_vec();
    bytes.resize(80, 0);
    bytes.extend((mesh.faces.len() as u32).to_le_bytes());
    for face in &mesh.faces {
        bytes.extend([0; 12]);
        for x in face.iter().flat_map(|k| mesh.points[*k as usize]) {
            bytes.extend((x as f32).to_le_bytes());
        }
        bytes.extend([0; 2]);
    }
    bytes
}

#[test]
fn the_same_tetrahedron_in_every_format() {
    let text = tetrahedron();
    assert_eq!((text.points.len(), text.faces.len(), text.is_closed()), (4, 4, true));
    for (name, big) in [("binary_little_endian", false), ("binary_big_endian", true)] {
        let mut bytes = TETRAHEDRON.split("end_header\n").next().unwrap().replace("ascii", name).into_bytes();
        bytes.extend(b"end_header\n");
        for c in text.points.iter().flatten() {
            let c = *c as f32;
            bytes.extend(if big { c.to_be_bytes() } else { c.to_le_bytes() });
        }
        for face in &text.faces {
            bytes.push(3);
            for v in face {
                bytes.extend(if big { v.to_be_bytes() } else { v.to_le_bytes() });
            }
        }
        assert_eq!(read(&bytes).unwrap(), text);
        assert!(read(&bytes[..bytes.len() - 1]).unwrap_err().contains("too soon"));
    }
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 1 0 0\nf 1//1 3//1 2//1\nf 1//1 2//1 4//1\nf -4//1 -1//1 3//1\nf 2 3 4\n";
    let obj = read(obj.as_bytes()).unwrap();
    assert_eq!((obj.points.as_slice(), obj.normals.len(), obj.is_closed()), (text.points.as_slice(), 4, true));
    let points = read(b"# points\n0 0 0\n1,0,0\n0 1 0\n0 0 1\n").unwrap();
    assert_eq!((&points.points, points.faces.len()), (&text.points, 0));
    // STL has a corner for each triangle; equal ones are one point.
    let mut facets = "solid x\n".to_owned();
    for face in &text.faces {
        facets += "facet normal 0 0 0\n outer loop\n";
        for [x, y, z] in face.iter().map(|k| text.points[*k as usize]) {
            facets += &format!("  vertex {x:e} {y} {}\n", if z == 0.0 { -0.0 } else { z });
        }
        facets += " endloop\nendfacet\n";
    }
    let facets = format!("{facets}endsolid x\n");
    let binary = stl(&text, b"");
    for bytes in [binary.as_slice(), &stl(&text, b"solid x"), facets.as_bytes()] {
        let mesh = read(bytes).unwrap();
        assert_eq!((mesh.points.len(), mesh.faces.len(), mesh.is_closed()), (4, 4, true));
    }
    assert!(read(&binary[..binary.len() - 1]).unwrap_err().contains("284 bytes, but the file has 283"));
    assert!(read(&facets.as_bytes()[..facets.len() - 12]).unwrap_err().contains("endsolid"));
}

#[test]
fn encodings_and_line_ends_do_not_matter() {
    let xyz = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n";
    for text in [TETRAHEDRON, OBJ, xyz] {
        let expected = read(text.as_bytes()).unwrap();
        for end in ["\n", "\r\n", "\r"] {
            let text = text.replace('\n', end);
            let marked = format!("\u{FEFF}{text}");
            let utf_16 = |bytes: fn(u16) -> [u8; 2]| marked.encode_utf16().flat_map(bytes).collect::<Vec<u8>>();
            let encoded = [
                text.clone().into_bytes(),
                marked.clone().into_bytes(),
                utf_16(u16::to_le_bytes),
                utf_16(u16::to_be_bytes),
            ];
            for bytes in encoded {
                assert_eq!(read(&bytes), Ok(expected.clone()), "{end:?}");
            }
        }
    }
    // Binary numbers may begin with the byte of a line end.
    for end in ["\n", "\r\n", "\r"] {
        let head =
            "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty uchar x\nproperty uchar y\nend_header\n";
        let mut bytes = head.replace('\n', end).into_bytes();
        bytes.extend([10, 13]);
        assert_eq!(read(&bytes).unwrap().points, [[10.0, 13.0, 0.0]]);
    }
}

#[test]
fn what_is_not_needed_is_passed_over() {
    let mut latin_1 = TETRAHEDRON.replace("element vertex", "comment Gr??e\nobj_info x\nelement vertex").into_bytes();
    latin_1.iter_mut().filter(|byte| **byte == b'?').for_each(|byte| *byte = 0xF6);
    assert_eq!(read(&latin_1).unwrap(), tetrahedron());
    // 66 further properties, lists among them, an element that no reader knows before the faces and one behind that is cut off.
    let more: String = (0..66).map(|k| format!("property float scalar_{k}\n")).collect();
    let text = TETRAHEDRON
        .replace("element face", &format!("{more}property list int int marks\nelement camera 2\nproperty float a\nproperty list uint8 uint16 b\nelement face"))
        .replace("end_header", "element edge 7\nproperty int a\nend_header");
    let (head, body) = text.split_once("end_header\n").unwrap();
    let mut body: Vec<String> = body.lines().map(str::to_owned).collect();
    body[..4].iter_mut().for_each(|line| *line += &format!(" {} 2 5 6", "7 ".repeat(66)));
    body.splice(4..4, ["1 3 1 2 3".to_owned(), "1 0".to_owned()]);
    let found = read(format!("{head}end_header\n{}\n", body.join("\n")).as_bytes()).unwrap();
    assert!(found.columns.len() == 64 && found.columns.iter().all(|column| column.values == [7.0; 4]));
    assert_eq!(Mesh { columns: Vec::new(), ..found }, tetrahedron());
    // Continued lines, lines as faces, texture coordinates, colors, groups, curves, and words that are no ASCII.
    let obj = "o Gr\u{f6}\u{df}e\nmtllib x\nv 0 0 0 1 .5 .5\nv 1 0 0\nv 0 1 \\\n 0\nv 0 0 1\nvt 0 0\nvn 1 0 0\nl 1 2\nf 1 2\nf 1/1/1 3/1/1 \\\r\n2/1/1 # x\nf 1/1/1 2/1/1 \\\n\\\n4/1/1\ns off\nf -4/-1/-1 -1//-1 3//1\ncurv 1 2\nf 2/1/1 3/1/1 4/1/1\np 1\n";
    let obj = read(obj.as_bytes()).unwrap();
    assert_eq!((obj.faces.clone(), obj.normals.len()), (tetrahedron().faces, 4));
    // Faces may come before their points.
    let (points, faces) = OBJ.split_at(OBJ.find('f').unwrap());
    assert_eq!(read(format!("{faces}{points}").as_bytes()), read(OBJ.as_bytes()));
    // Lines of points with colors, with a value, with a value and colors, with colors and normals.
    let line = |rest: &str| read(format!("X Y Z\n0 0 1 {rest}\n0 1 0 {rest}\n").as_bytes()).unwrap();
    for (rest, normals) in
        [("255 0 12", 0), (".5", 0), (".5 255 0 12", 0), ("0 0 1", 2), ("255 0 12 0 0 1", 2), ("0 0 1 255 0 12", 2)]
    {
        let found = line(rest);
        assert_eq!((found.points.len(), found.normals.len()), (2, normals), "{rest}");
        assert!(found.normals.iter().all(|normal| *normal == [0.0, 0.0, 1.0]));
    }
    let counted = read(b"2\n0 0 1\n// a remark\n0;1;0\n").unwrap();
    assert_eq!(counted.points, [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]);
}

#[test]
fn strips_are_triangles_that_turn_by_turns() {
    let head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n";
    let strips = |list: &[i32]| {
        let list: Vec<String> =
            std::iter::once(list.len() as i32).chain(list.iter().copied()).map(|n| n.to_string()).collect();
        read(format!("{head}{}\n", list.join(" ")).as_bytes())
    };
    assert_eq!(strips(&[0, 1, 2, 3]).unwrap().faces, [[0, 1, 2], [2, 1, 3]]);
    assert_eq!(strips(&[0, 1, 2, -1, 2, 1, 3, -1]).unwrap().faces, [[0, 1, 2], [2, 1, 3]]);
    // Strips are joined by triangles without an area.
    assert_eq!(strips(&[0, 1, 2, 2, 3, 3, 1]).unwrap().faces, [[0, 1, 2]]);
    let long: Vec<i32> = (0..250_000).flat_map(|_| [0, 1, 2, -1]).collect();
    assert_eq!(strips(&long).unwrap().faces.len(), 250_000);
    assert!(strips(&[0, 1, -2]).unwrap_err().contains("-2 is no index"));
}

#[test]
fn points_that_no_face_has_are_left_out() {
    let normals = "vn 1 0 0\nf 1//1 3//1 2//1\nf 1//1 2//1 4//1\nf 1//1 4//1 3//1\nf 2//1 3//1 4//1\n";
    let points = OBJ.split('f').next().unwrap();
    let mut mesh = read(format!("v 7 7 7\n{points}v 8 8 8\n{}", normals.replace("f 1", "f 5")).as_bytes()).unwrap();
    // Points 2 to 5 have faces, the first and the last do not.
    assert_eq!(mesh.points.len(), 6);
    assert_eq!(mesh.leave_out_loose_points(), Ok(2));
    assert_eq!((mesh.points.len(), mesh.normals.len(), mesh.check()), (4, 4, Ok(())));
    assert!(mesh.faces.iter().flatten().all(|corner| *corner < 4));
    let mut mesh = read(format!("{}{OBJ}", "v 7 7 7\n".repeat(9)).as_bytes()).unwrap();
    assert!(mesh.leave_out_loose_points().unwrap_err().contains("9 of 13 points belong to no face"));
}

#[test]
fn what_is_wrong_is_named() {
    let normals = |normal: &str| {
        let names = ["x", "y", "z", "nx", "ny", "nz"].map(|name| format!("property float {name}\n")).concat();
        format!(
            "ply\nformat ascii 1.0\nelement vertex 3\n{names}end_header\n0 0 0 0 0 1\n1 0 0 {normal}\n0 1 0 {normal}\n"
        )
    };
    for (text, part) in [
        ("0 0\n1 2 3 4\n".to_owned(), "line 2 has 4 numbers, but line 1 has 2"),
        ("0 0 x\n".to_owned(), "line 1: \"x\" is no number"),
        ("1\n2\n".to_owned(), "line 2 has 1 number"),
        ("nan 0 0\n".to_owned(), "point 0 (counted from 0) is not finite: NaN 0 0"),
        (
            "0,8394 0,0130 0,5432\n".to_owned(),
            "line 1: \"0,8394\" has a decimal comma; numbers are read with a decimal point (0.8394)",
        ),
        ("0 0 0\n0,8394;0,0130;0,5432\n".to_owned(), "line 2: \"0,8394\" has a decimal comma"),
        ("0 0 0\n-1,5\t2\t3\n".to_owned(), "line 2: \"-1,5\" has a decimal comma"),
        ("0,839454,0,013046,0,543275\n".to_owned(), "decimal comma"),
        ("v 0,5 1 2\n".to_owned(), "line 1: \"0,5\" has a decimal comma"),
        (
            TETRAHEDRON.replace("\n1 0 0\n", "\n1,5 0 0\n"),
            "vertex 1 (counted from 0) of 4: \"1,5\" has a decimal comma",
        ),
        ("v 0 0 0\nf 1 2 3\n".to_owned(), "line 2: there is no point 2 among 1"),
        ("v 0 0 0\nf 0 1 1\n".to_owned(), "counted from 1"),
        ("v 0 0 0\nf 1//7 1 1\n".to_owned(), "no normal 7"),
        (String::new(), "no points"),
        ("\n# nothing\n".to_owned(), "no points"),
        ("0 0 0\n1 0 0 0 0 1\n".to_owned(), "line 2 has 6 numbers, but line 1 has 3"),
        (
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3\n".to_owned(),
            "the normal of point 2 (counted from 0) is not finite",
        ),
        (
            normals("nan nan nan"),
            "the normal of point 1 (counted from 0) and of 1 more is not finite: NaN NaN NaN; write them anew, or leave normals out",
        ),
        (normals("0 -0 0"), "the normal of point 1 (counted from 0) and of 1 more is zero"),
        (normals("1 0 0").replace("property float nz\n", ""), "some of the properties nx, ny, nz"),
        ("ply\nformat ascii 1.0\nelement vertex 99999999999\nend_header\n".to_owned(), "at most"),
        (
            "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nend_header\n1 1\n".to_owned(),
            "vertex 1 (counted from 0) of 2: the file ends too soon",
        ),
        ("ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nend_header\n1\n".to_owned(), "no property \"y\""),
        (
            "ply\nformat ascii 1.0\nelement point 2\nproperty float x\nend_header\n1\n".to_owned(),
            "no element \"vertex\"",
        ),
        ("ply\nformat ascii 1.0\nelement vertex 2\n".to_owned(), "end_header"),
        (TETRAHEDRON.replace("3 1 2 3", "3 1 2 -1"), "face 3 (counted from 0) of 4: -1 is no index of a vertex"),
        (
            TETRAHEDRON.replace("3 1 2 3", "3 1 2 4"),
            "face 3 (counted from 0) has fewer than 3 corners or names a point that is not there",
        ),
        (
            "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nendloop\nendfacet\nendsolid\n"
                .to_owned(),
            "line 7 has 2 corners",
        ),
        ("solid x\nendsolid\n".to_owned(), "no triangles"),
        ("OFF\n4 4 6\n".to_owned(), "an OFF file"),
        ("# vtk DataFile Version 3.0\n".to_owned(), "legacy VTK"),
        ("0 0 0\n\u{0}\n".to_owned(), "byte 6 is 0"),
    ] {
        let message = whole(text.as_bytes()).unwrap_err();
        assert!(message.contains(part), "{text:?}: {message}");
    }
    assert!(whole(b"\x1F\x8B\x08\x00").unwrap_err().contains("gzip"));
}
