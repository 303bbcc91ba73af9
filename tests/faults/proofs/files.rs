//! Mutated files through the process that looks into uploads.

use super::parsers::{Draws, mutate_bytes};
use crate::support::program;
use hdf5::plist::dataset_create::AllocTime;
use meniscus_jobs::formats::hdf5_file::write;
use serde_json::Value;
use std::process::{Command, Stdio};

/// Small files of points with level, normals and faces, in the formats and storages that users send.
pub fn points_files() -> Vec<Vec<u8>> {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("x.h5");
    let made = |(is_latest, storage): &(bool, Storage)| {
        let mut builder = hdf5::FileBuilder::new();
        builder.with_fapl(|plist| if *is_latest { plist.libver_latest() } else { plist.libver_earliest() });
        let file = builder.create(&path).unwrap();
        fill(&file, *storage);
        file.close().unwrap();
        std::fs::read(&path).unwrap()
    };
    let storages = [
        Storage::Piece,
        Storage::Chunks { rows: 100, free: 0, is_filtered: false },
        Storage::Chunks { rows: 100, free: 0, is_filtered: true },
        Storage::Chunks { rows: 2, free: 0, is_filtered: true },
        Storage::Chunks { rows: 2, free: 1, is_filtered: false },
        Storage::Chunks { rows: 1, free: 1, is_filtered: true },
        Storage::Chunks { rows: 1, free: 2, is_filtered: false },
        Storage::Early,
    ];
    [false, true].into_iter().flat_map(|is_latest| storages.map(|storage| made(&(is_latest, storage)))).collect()
}

/// How the numbers of a file are stored.
#[derive(Clone, Copy)]
enum Storage {
    Piece,
    /// Chunks of so many rows; so many axes have no limit.
    Chunks {
        rows: usize,
        free: usize,
        is_filtered: bool,
    },
    /// Chunks that are there from the start.
    Early,
}

fn fill(file: &hdf5::File, storage: Storage) {
    let root = file.create_group("VTKHDF").unwrap();
    let positions: Vec<f32> = (0..300).map(|k| if k % 3 == 2 { 0.5 } else { (k as f32).sin() }).collect();
    let put = |group: &hdf5::Group, name: &str, values: &[f32], columns: usize| {
        let rows = values.len() / columns;
        let builder = group.new_dataset::<f32>();
        let builder = match storage {
            Storage::Piece => builder.shape((rows, columns)),
            Storage::Early => builder.chunk((7, columns)).alloc_time(Some(AllocTime::Early)).shape((rows, columns)),
            Storage::Chunks { rows: chunk, free, is_filtered } => {
                let mut builder = builder.chunk((chunk, columns));
                if is_filtered {
                    builder = builder.shuffle().deflate(4).fletcher32();
                }
                match free {
                    0 => builder.shape((rows, columns)),
                    1 => builder.shape((rows.., columns)),
                    _ => builder.shape((rows.., columns..)),
                }
            }
        };
        builder.create(name).unwrap().write_raw(values).unwrap();
    };
    put(&root, "Points", &positions, 3);
    let data = root.create_group("PointData").unwrap();
    put(&data, "Normals", &positions, 3);
    data.new_dataset::<f64>().shape(100).create("phi").unwrap().write_raw(&[0.25; 100]).unwrap();
    // More than eight members are in dense storage in the latest format.
    for k in 0..12 {
        write(&data, &format!("column_{k}"), 1, &[k]).unwrap();
    }
    let polygons = root.create_group("Polygons").unwrap();
    write(&polygons, "Offsets", 1, &[0_i64, 3, 6]).unwrap();
    write(&polygons, "Connectivity", 1, &[0_i64, 1, 2, 2, 1, 3]).unwrap();
    let vertices = root.create_group("Vertices").unwrap();
    write(&vertices, "Connectivity", 1, &(0..100).collect::<Vec<i64>>()).unwrap();
}

/// Beginnings of the parts of HDF5 files.
const PARTS: [&[u8]; 16] = [
    b"\x89HDF", b"OHDR", b"FRHP", b"FHDB", b"FHIB", b"BTHD", b"BTLF", b"BTIN", b"FAHD", b"FADB", b"EAHD", b"EAIB",
    b"EADB", b"EASB", b"TREE", b"SNOD",
];
/// Bytes behind the beginning of a part that are changed.
const NEAR: usize = 200;

/// Where parts begin.
pub fn parts(bytes: &[u8]) -> Vec<usize> {
    let is_part = |at: &usize| PARTS.iter().any(|part| bytes[*at..].starts_with(part));
    (0..bytes.len()).filter(is_part).collect()
}

/// Changes bytes of a file of known parts: by half anywhere, by half near the beginning of a part.
pub fn mutate_file(bytes: &mut Vec<u8>, parts: &[usize], draws: &mut Draws) {
    if draws.below(2) == 0 {
        return mutate_bytes(bytes, draws);
    }
    for _ in 0..=draws.below(2) {
        let from = parts[draws.below(parts.len())];
        let to = bytes.len().min(from + NEAR);
        let mut piece = bytes[from..to].to_vec();
        mutate_bytes(&mut piece, draws);
        piece.resize(to - from, 0);
        bytes[from..to].copy_from_slice(&piece);
    }
}

/// The reader process always comes to an end of its own with a verdict, or is ended by its limits; whatever it lets
/// through is finite and whole.
pub fn mutated(count: u64, seed: u64) -> String {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("x.h5");
    let files: Vec<(Vec<u8>, Vec<usize>)> =
        points_files().into_iter().map(|bytes| (bytes.clone(), parts(&bytes))).collect();
    let (mut ready, mut rejected, mut ended) = (0, 0, 0);
    for run in 0..count {
        let mut draws = Draws::new(seed, run);
        let (whole, parts) = &files[draws.below(files.len())];
        let mut bytes = whole.clone();
        mutate_file(&mut bytes, parts, &mut draws);
        std::fs::write(&path, &bytes).unwrap();
        let output = Command::new(program())
            .args(["inspect", "--as", ["points", "queries", "surface"][run as usize % 3]])
            .arg(&path)
            .stdin(Stdio::null())
            .stderr(Stdio::null())
            .output()
            .unwrap();
        let line = output.stdout.split(|b| *b == b'\n').next().unwrap_or_default();
        match serde_json::from_slice::<Value>(line) {
            Ok(said) if said["ready"].is_object() => {
                ready += 1;
                let cloud = meniscus_jobs::formats::cloud_file::read(&mut &output.stdout[line.len() + 1..]).unwrap();
                assert_eq!(said["ready"]["points"], cloud.positions.len());
                assert!(cloud.positions.iter().flatten().all(|c| c.is_finite()));
            }
            Ok(said) => {
                assert!(said["rejected"].is_string(), "{said}");
                rejected += 1;
            }
            Err(_) => {
                assert!(!output.status.success(), "run {run} of seed {seed} said nothing");
                ended += 1;
            }
        }
    }
    format!("{count} files: {ready} ready, {rejected} rejected, {ended} ended by the limits (seed {seed})")
}
