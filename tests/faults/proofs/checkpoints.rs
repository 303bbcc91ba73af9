//! Checkpoints: kills in the middle of writing, damage of every kind.

use crate::common::{Expected, checkpoint_files};
use crate::support::{Service, chance, eventually, long_job, steady_job};
use meniscus::simulation::Section;
use meniscus_jobs::formats::checkpoint::{Counters, meta, read, write_verified};
use serde_json::{Value, json};
use std::path::Path;
use std::time::Duration;

/// Every operation of writing a checkpoint and of publishing it, by the place before or after it.
const PLACES: [&str; 14] = [
    "checkpoint/begin",
    "checkpoint/array",
    "checkpoint/written",
    "checkpoint/closed",
    "checkpoint/synced",
    "checkpoint/verified",
    "artifact/synced",
    "artifact/renamed",
    "artifact/named",
    "checkpoint/unrecorded",
    "checkpoint/recorded",
    "checkpoint/imported",
    "checkpoint/pruned",
    "checkpoint/array",
];

/// A process is ended at each of these places: the job goes on from a whole checkpoint to the same data.
pub fn kills_between_operations(count: u64, seed: u64) -> String {
    let directory = tempfile::tempdir().unwrap();
    let mut expected = None;
    let mut fired = 0;
    for round in 0..count {
        let place = PLACES[(round as usize) % PLACES.len()];
        // The service sees several checkpoints at once where it is late: its own places are passed less often.
        let is_of_service = ["checkpoint/imported", "checkpoint/pruned"].contains(&place);
        let number = if is_of_service { 1 } else { 2 + (4.0 * chance(seed, round)) as u64 };
        let data = directory.path().join(round.to_string());
        std::fs::create_dir(&data).unwrap();
        let mark = data.join("fired");
        let mut service = Service::start_with(
            &data,
            &["--slots", "1"],
            &[("MENISCUS_BREAK", &format!("{place}:{number}:{}", mark.display()))],
        );
        let body = steady_job();
        let id = service.submit(&body);
        eventually(&format!("it succeeds after an end at {place}"), Duration::from_secs(60), || {
            if service.has_ended() {
                // It was the service that came to its end.
                service.restart();
            }
            (service.try_job(&id)?["state"] == "succeeded").then_some(())
        });
        fired += u64::from(mark.exists());
        assert!(mark.exists(), "{place} was never passed {number} times");
        let expected = expected.get_or_insert_with(|| Expected::of(&service, &body));
        expected.check(&service, &id);
        assert!(service.stop());
        service.fsck();
    }
    format!("{fired} ends between operations at {} places, all data identical", PLACES.len())
}

fn sample(directory: &Path) -> (std::path::PathBuf, String, Section) {
    let mut state = Section::default();
    let numbers: Vec<f64> = (0..3000).map(|k| f64::from(k).sin()).collect();
    state.put_section("clock", |clock| {
        clock.put_count("step", 7);
        clock.put_real("time", 0.7);
    });
    state.put_section("particles", |particles| {
        particles.put_reals("position", &numbers);
        particles.put_reals("phi", &numbers[..1000]);
    });
    state.put_counts("rescues", 0..100);
    state.put_optional("vanished_at", None);
    let path = directory.join("sample.h5");
    let body: Value = json!({"scene": {"kind": "redistance"}});
    let (sha256, _) = write_verified(&path, meta("job", &body, 7, 0.7, Counters::default()), &state).unwrap();
    (path, sha256, state)
}

/// Files cut at random lengths: refused with and without the digest of the whole.
pub fn truncations(count: u64, seed: u64) -> String {
    let directory = tempfile::tempdir().unwrap();
    let (path, sha256, _) = sample(directory.path());
    let bytes = std::fs::read(&path).unwrap();
    let cut = directory.path().join("cut.h5");
    for k in 0..count {
        let length = (bytes.len() as f64 * chance(seed, k)) as usize;
        std::fs::write(&cut, &bytes[..length]).unwrap();
        assert!(read(&cut, Some(&sha256)).is_err(), "{length} bytes");
        assert!(read(&cut, None).is_err(), "{length} of {} bytes", bytes.len());
    }
    format!("{count} lengths refused")
}

/// Single bits turned over: refused by the digest; without it refused, or harmless because the state is the same.
pub fn flipped_bits(count: u64, seed: u64) -> String {
    let directory = tempfile::tempdir().unwrap();
    let (path, sha256, state) = sample(directory.path());
    let bytes = std::fs::read(&path).unwrap();
    let broken_path = directory.path().join("broken.h5");
    let mut harmless = 0;
    for k in 0..count {
        let bit = (bytes.len() as f64 * 8.0 * chance(seed, k)) as usize;
        let mut broken = bytes.clone();
        broken[bit / 8] ^= 1 << (bit % 8);
        std::fs::write(&broken_path, &broken).unwrap();
        assert!(read(&broken_path, Some(&sha256)).is_err(), "bit {bit}");
        if let Ok((_, restored)) = read(&broken_path, None) {
            assert_eq!(restored, state, "bit {bit}");
            harmless += 1;
        }
    }
    format!("{count} bits refused by the digest of the file; {harmless} of them touch nothing that is read")
}

/// The newest checkpoint of a paused job is damaged: it is named and passed over, the one before is used, the data are
/// identical.
pub fn fall_back(count: u64, seed: u64) -> String {
    let directory = tempfile::tempdir().unwrap();
    let service = Service::start(directory.path(), &["--slots", "1"]);
    let body = long_job();
    let expected = Expected::of(&service, &body);
    for round in 0..count {
        let id = service.submit(&body);
        eventually("two checkpoints are kept", Duration::from_secs(20), || {
            (checkpoint_files(&service, &id).len() >= 2).then_some(())
        });
        service.act(&id, "pause");
        service.wait_for(&id, &["paused"]);
        let file = checkpoint_files(&service, &id).pop().unwrap();
        let mut bytes = std::fs::read(&file).unwrap();
        let place = (bytes.len() as f64 * chance(seed, round)) as usize;
        if round % 2 == 0 {
            bytes.truncate(place);
        } else {
            bytes[place] ^= 0x10;
        }
        std::fs::write(&file, bytes).unwrap();
        service.act(&id, "resume");
        let job = service.wait_for(&id, &["succeeded"]);
        let warnings = job["warnings"].as_array().unwrap();
        assert_eq!(warnings.len(), 1, "{warnings:?}");
        assert!(warnings[0]["message"].as_str().unwrap().contains("passed over"));
        expected.check(&service, &id);
    }
    format!("{count} damaged newest checkpoints passed over for the one before, all data identical")
}
