use super::{CheckpointError, Counters, Meta, is_same_scene, layout, meta, read, write_verified};
use crate::system::digest;
use meniscus::scene;
use meniscus::scenes::SCENES;
use meniscus::simulation::Section;
use serde_json::json;
use std::path::Path;

fn state() -> Section {
    let mut state = Section::default();
    state.put_section("clock", |clock| {
        clock.put_count("step", 7);
        clock.put_real("time", 0.7);
    });
    state.put_section("particles", |particles| {
        particles.put_reals("phi", &[1.0, -2.5, f64::MIN_POSITIVE / 3.0]);
        particles.put_section("inner", |inner| inner.put_counts("rescues", [3, u64::MAX]));
        particles.put_section("empty", |_| ());
    });
    state.put_reals("errors", &[]);
    state.put_optional("vanished_at", None);
    state.put_optional_count("redistanced_at_step", None);
    state
}

fn about() -> Meta {
    meta("job", &json!({}), 7, 0.7, Counters::default())
}

#[test]
fn what_is_read_is_what_was_written() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("7.h5");
    let (sha256, size) = write_verified(&path, about(), &state()).unwrap();
    assert_eq!(std::fs::metadata(&path).unwrap().len(), size);
    let (meta, restored) = read(&path, Some(&sha256)).unwrap();
    assert_eq!(restored, state());
    assert_eq!(restored.optional("vanished_at").unwrap(), None);
    assert_eq!(meta.job, "job");
    // Two writes give the same bytes: no times inside.
    let again = directory.path().join("again.h5");
    assert_eq!(write_verified(&again, about(), &state()).unwrap().0, sha256);
}

#[test]
fn every_flipped_bit_of_the_content_is_refused_or_harmless() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("7.h5");
    let (sha256, _) = write_verified(&path, about(), &state()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    for k in (0..bytes.len()).step_by(37) {
        let mut broken = bytes.clone();
        broken[k] ^= 1 << (k % 8);
        std::fs::write(&path, &broken).unwrap();
        assert!(read(&path, Some(&sha256)).is_err());
        // Without the file's digest, whatever still reads must be the same state.
        if let Ok((_, restored)) = read(&path, None) {
            assert_eq!(restored, state(), "byte {k}");
        }
    }
}

#[test]
fn a_state_that_is_not_finite_never_becomes_a_file() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("7.h5");
    let mut broken = state();
    broken.put_section("fluid", |fluid| fluid.put_reals("psi", &[0.0, f64::NAN]));
    let error = write_verified(&path, about(), &broken).unwrap_err();
    assert!(matches!(error, CheckpointError::NonFinite { ref array, entry: 1 } if array == "fluid/psi"));
    assert!(std::fs::read_dir(directory.path()).unwrap().next().is_none());
}

/// A file with the digests that its meta text asks for, whatever that says.
fn forge(path: &Path, change: impl FnOnce(&mut Meta)) {
    let mut meta = about();
    meta.entries = layout::entries_of(&state());
    change(&mut meta);
    super::write_file(path, &meta, &state()).unwrap();
    assert_eq!(digest::of_file(path).unwrap().0.len(), 64);
}

/// What is changed in a checkpoint, and how.
type Change = (&'static str, fn(&mut Meta));

#[test]
fn a_meta_text_that_contradicts_the_file_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("7.h5");
    forge(&path, |_| ());
    assert!(read(&path, None).is_ok());
    let changes: [Change; 6] = [
        ("a section that is no group", |meta| meta.entries[0].path = "nowhere".to_owned()),
        ("an entry twice", |meta| meta.entries.push(meta.entries[1].clone())),
        ("an entry in a number", |meta| meta.entries[1].path = "clock/step/time".to_owned()),
        ("an array for a number", |meta| {
            let place = meta.entries.iter().position(|entry| entry.path == "particles/phi").unwrap();
            meta.entries[place].kind = layout::EntryKind::Real;
        }),
        ("items of no numbers", |meta| {
            let place = meta.entries.iter().position(|entry| entry.path == "particles/phi").unwrap();
            meta.entries[place].kind = layout::EntryKind::Reals { components: 0 };
        }),
        ("another format", |meta| meta.format = 3),
    ];
    for (what, change) in changes {
        forge(&path, change);
        assert!(read(&path, None).is_err(), "{what}");
    }
}

#[test]
fn scenes_are_the_same_but_for_what_a_restart_may_change() {
    let body = |end: f64, h: f64| {
        let mut scene = scene::parse(&json!({"kind": "vortex", "spacing": h}), SCENES).unwrap().resolved();
        scene["end_time"] = json!(end);
        json!({"scene": scene})
    };
    assert!(is_same_scene(&body(8.0, 0.1), &body(9.0, 0.1)));
    assert!(!is_same_scene(&body(8.0, 0.1), &body(8.0, 0.2)));
    let without_scene = serde_json::json!({"label": "x"});
    assert!(!is_same_scene(&without_scene, &without_scene), "two bodies without a scene are not the same scene");
}
