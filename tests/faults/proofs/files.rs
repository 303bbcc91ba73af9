//! Mutated files through the process that looks into uploads.

use super::parsers::{Draws, mutate_bytes};
use crate::support::program;
use meniscus_jobs::formats::hdf5_file::write;
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Stdio};

/// A small file of points with their level, as users send them.
pub fn points_file(path: &Path) {
    let file = hdf5::File::create(path).unwrap();
    let root = file.create_group("VTKHDF").unwrap();
    let positions: Vec<f64> = (0..300).map(|k| if k % 3 == 2 { 0.0 } else { f64::from(k).sin() }).collect();
    write(&root, "Points", 3, &positions).unwrap();
    let data = root.create_group("PointData").unwrap();
    write(&data, "phi", 1, &positions[..100]).unwrap();
    drop((data, root));
    file.close().unwrap();
}

/// The reader process always comes to an end of its own with a verdict, or is ended by its limits; whatever it lets
/// through is finite and whole.
pub fn mutated(count: u64, seed: u64) -> String {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("x.h5");
    points_file(&path);
    let whole = std::fs::read(&path).unwrap();
    let (mut ready, mut rejected, mut ended) = (0, 0, 0);
    for run in 0..count {
        let mut bytes = whole.clone();
        mutate_bytes(&mut bytes, &mut Draws::new(seed, run));
        std::fs::write(&path, &bytes).unwrap();
        let output = Command::new(program())
            .args(["inspect", "--as", if run % 2 == 0 { "points" } else { "queries" }])
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
