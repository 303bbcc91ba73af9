//! Checkpoints: the state of a simulation and the counters of its output, in an HDF5 file that proves itself.
//!
//! `/state/NAME` holds the arrays, `/meta` a JSON text with the body, build, instruction set, format version,
//! counters and a SHA-256 of every data set, `/meta_sha256` the digest of that text. A reader refuses what does not
//! match.

use crate::formats::hdf5_file::{count_bytes, real_bytes, write};
use crate::formats::structure::{self, Refusal};
use crate::spec::body::resolved_scene;
use crate::spec::records::FileRecord;
use crate::system::artifacts;
use crate::system::breakpoints::pass;
use crate::system::build;
use crate::system::digest;
use crate::system::process::free_space;
use meniscus::scene;
use meniscus::scenes::SCENES;
use meniscus::simulation::State;
use meniscus::simulation::state::{CountArray, RealArray};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// Version of the layout.
pub const FORMAT: u32 = 1;

/// What a checkpoint says of itself.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Meta {
    /// Version of the layout.
    pub format: u32,
    /// Program that wrote it.
    pub build: String,
    /// Instruction set of that program.
    pub isa: String,
    /// Job that wrote it.
    pub job: String,
    /// The job's resolved body.
    pub body: Value,
    /// Step.
    pub step: u64,
    /// Scene time.
    pub time: f64,
    /// What was written up to here.
    pub counters: Counters,
    /// The arrays, in order.
    pub arrays: Vec<ArrayMeta>,
}

/// Output written before a checkpoint; an attempt that goes on from it continues there.
#[derive(Debug, Clone, Default, Serialize, Deserialize, PartialEq)]
pub struct Counters {
    /// Frames, with the attempt that wrote each.
    pub frames: Vec<(u64, FileRecord)>,
    /// Frames that earlier jobs wrote before this job began.
    pub frames_before: u64,
    /// Attempt whose series file the next number belongs to.
    pub series_epoch: u64,
    /// Bytes of the series file.
    pub series_bytes: u64,
    /// CPU seconds by phase so far.
    pub phases: BTreeMap<String, f64>,
}

/// One array of the state.
#[derive(Debug, Clone, Serialize, Deserialize, PartialEq)]
pub struct ArrayMeta {
    /// Name.
    pub name: String,
    /// Numbers per entry; 0 marks whole numbers.
    pub components: usize,
    /// Digest of its bytes.
    pub sha256: String,
}

/// Why a checkpoint could not be written or was refused.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The state holds a value that is no number.
    #[error("{array} is not finite at entry {entry}")]
    NonFinite {
        /// Which array.
        array: String,
        /// Which entry.
        entry: usize,
    },
    /// Less space than the file needs.
    #[error("{needed} bytes are needed, {free} are free: No space left on device")]
    NoSpace {
        /// Size of the file.
        needed: u64,
        /// Space left.
        free: u64,
    },
    /// The file does not match its own or the expected digests.
    #[error("{what} does not match its digest")]
    Damaged {
        /// Which part.
        what: String,
    },
    /// Written by another version of the layout.
    #[error("the format is {got}, this program reads {FORMAT}")]
    Format {
        /// Its version.
        got: u32,
    },
    /// The file is no whole HDF5 file, or none of ours.
    #[error("{0}")]
    Structure(#[from] Refusal),
    /// libhdf5 failed.
    #[error("{0}")]
    Hdf5(#[from] hdf5::Error),
    /// The system failed.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// The meta text cannot be read.
    #[error("the meta text is unreadable: {0}")]
    Meta(#[from] serde_json::Error),
}

/// Writes and verifies a checkpoint: free-space check, unfinished file, close, fsync, reopen and verify, rename,
/// fsync of the directory. Returns digest and size of the file.
///
/// # Errors
/// [`CheckpointError`]; no file of the final name exists then.
pub fn write_verified(path: &Path, mut meta: Meta, state: &State) -> Result<(String, u64), CheckpointError> {
    check_finite(state)?;
    let payload: usize = state.reals.iter().map(|a| a.values.len()).sum::<usize>()
        + state.counts.iter().map(|a| a.values.len()).sum::<usize>();
    let needed = payload as u64 * 8 + (1 << 20);
    if let Some(free) = free_space(path.parent().unwrap_or(Path::new(".")))
        && free < needed
    {
        return Err(CheckpointError::NoSpace { needed, free });
    }
    meta.arrays = arrays_of(state);
    let beside = artifacts::unfinished(path);
    pass("checkpoint/begin");
    let written = write_file(&beside, &meta, state)
        .and_then(|()| {
            pass("checkpoint/closed");
            std::fs::File::open(&beside)?.sync_all().map_err(CheckpointError::from)
        })
        .and_then(|()| {
            pass("checkpoint/synced");
            read(&beside, None).map(|_| ())
        })
        .and_then(|()| {
            pass("checkpoint/verified");
            artifacts::finish(path).map_err(CheckpointError::from)
        });
    if let Err(error) = written {
        // A leftover would only take space; failing to remove it changes nothing.
        let _ = std::fs::remove_file(&beside);
        return Err(error);
    }
    Ok(digest::of_file(path)?)
}

/// Reads and verifies a checkpoint; the digest of the whole file too, where it is known. Without libhdf5, which can hang
/// or divide by zero over a damaged file.
///
/// # Errors
/// [`CheckpointError`].
pub fn read(path: &Path, sha256: Option<&str>) -> Result<(Meta, State), CheckpointError> {
    if let Some(expected) = sha256
        && digest::of_file(path)?.0 != expected
    {
        return Err(CheckpointError::Damaged { what: "the file".to_owned() });
    }
    let file = std::fs::File::open(path)?;
    let structure = structure::read(&file)?;
    let bytes_of = |place: &str, element_bytes: u64| {
        let data_set = structure
            .data_sets
            .get(place)
            .filter(|found| found.element_bytes == element_bytes)
            .ok_or_else(|| CheckpointError::Damaged { what: place.to_owned() })?;
        structure::contents(&file, place, data_set).map_err(CheckpointError::from)
    };
    let text = bytes_of("/meta", 1)?;
    let expected = bytes_of("/meta_sha256", 1)?;
    if digest::of_bytes(&text).as_bytes() != expected {
        return Err(CheckpointError::Damaged { what: "meta".to_owned() });
    }
    let meta: Meta = serde_json::from_slice(&text)?;
    if meta.format != FORMAT {
        return Err(CheckpointError::Format { got: meta.format });
    }
    let mut state = State { step: meta.step, time: meta.time, ..State::default() };
    for array in &meta.arrays {
        let bytes = bytes_of(&format!("/state/{}", array.name), 8)?;
        if digest::of_bytes(&bytes) != array.sha256 {
            return Err(CheckpointError::Damaged { what: array.name.clone() });
        }
        let words = bytes.as_chunks::<8>().0.iter();
        let name = array.name.clone();
        if array.components == 0 {
            state.counts.push(CountArray { name, values: words.map(|word| u64::from_le_bytes(*word)).collect() });
        } else {
            let values = words.map(|word| f64::from_le_bytes(*word)).collect();
            state.reals.push(RealArray { name, components: array.components, values });
        }
    }
    check_finite(&state)?;
    Ok((meta, state))
}

/// Whether a checkpoint's body and another describe runs of the same physics: equal but for restart-safe fields.
#[must_use]
pub fn is_same_scene(a: &Value, b: &Value) -> bool {
    let plain = |body: &Value| {
        // A build before may have left out what this one writes as null: what is resolved resolves to the same again.
        let scene = resolved_scene(body).unwrap_or_default();
        let mut scene = scene::parse(&scene, SCENES).map_or(scene, |scene| scene.resolved());
        let safe = meniscus::scenes::kind_of(&scene).map(scene::SceneKind::restart_safe);
        if let Some(map) = scene.as_object_mut() {
            for pointer in safe.unwrap_or_default() {
                map.shift_remove(pointer.trim_start_matches('/'));
            }
        }
        scene
    };
    plain(a) == plain(b)
}

/// An empty meta for the program that runs.
#[must_use]
pub fn meta(job: &str, body: &Value, step: u64, time: f64, counters: Counters) -> Meta {
    Meta {
        format: FORMAT,
        build: build::name(),
        isa: build::isa(),
        job: job.to_owned(),
        body: body.clone(),
        step,
        time,
        counters,
        arrays: Vec::new(),
    }
}

fn check_finite(state: &State) -> Result<(), CheckpointError> {
    for array in &state.reals {
        if let Some(entry) = array.values.iter().position(|v| !v.is_finite()) {
            return Err(CheckpointError::NonFinite {
                array: array.name.clone(),
                entry: entry / array.components.max(1),
            });
        }
    }
    Ok(())
}

fn arrays_of(state: &State) -> Vec<ArrayMeta> {
    let reals = state.reals.iter().map(|a| ArrayMeta {
        name: a.name.clone(),
        components: a.components,
        sha256: digest::of_bytes(&real_bytes(&a.values)),
    });
    let counts = state.counts.iter().map(|a| ArrayMeta {
        name: a.name.clone(),
        components: 0,
        sha256: digest::of_bytes(&count_bytes(&a.values)),
    });
    reals.chain(counts).collect()
}

fn write_file(path: &Path, meta: &Meta, state: &State) -> Result<(), CheckpointError> {
    let file = hdf5::File::create(path)?;
    let group = file.create_group("state")?;
    for array in &state.reals {
        write(&group, &array.name, array.components, &array.values)?;
        pass("checkpoint/array");
    }
    for array in &state.counts {
        write(&group, &array.name, 1, &array.values)?;
    }
    let text = serde_json::to_vec(meta)?;
    write(&file, "meta", 1, &text)?;
    write(&file, "meta_sha256", 1, digest::of_bytes(&text).as_bytes())?;
    pass("checkpoint/written");
    file.close()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::{CheckpointError, Counters, is_same_scene, meta, read, write_verified};
    use meniscus::simulation::State;
    use serde_json::json;

    fn state() -> State {
        let mut state = State { step: 7, time: 0.7, ..State::default() };
        state.push_reals("phi", &[1.0, -2.5, f64::MIN_POSITIVE / 3.0]);
        state.push_counts("rescues", vec![3, u64::MAX]);
        state.push_reals("errors", &[]);
        state
    }

    #[test]
    fn what_is_read_is_what_was_written() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("7.h5");
        let (sha256, size) =
            write_verified(&path, meta("job", &json!({}), 7, 0.7, Counters::default()), &state()).unwrap();
        assert_eq!(std::fs::metadata(&path).unwrap().len(), size);
        let (meta, restored) = read(&path, Some(&sha256)).unwrap();
        assert_eq!(restored, state());
        assert_eq!(meta.job, "job");
        // Two writes give the same bytes: no times inside.
        let again = directory.path().join("again.h5");
        assert_eq!(
            write_verified(&again, super::meta("job", &json!({}), 7, 0.7, Counters::default()), &state()).unwrap().0,
            sha256
        );
    }

    #[test]
    fn every_flipped_bit_of_the_content_is_refused_or_harmless() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("7.h5");
        let (sha256, _) =
            write_verified(&path, meta("job", &json!({}), 7, 0.7, Counters::default()), &state()).unwrap();
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
        broken.push_reals("psi", &[0.0, f64::NAN]);
        let error = write_verified(&path, meta("job", &json!({}), 7, 0.7, Counters::default()), &broken).unwrap_err();
        assert!(matches!(error, CheckpointError::NonFinite { ref array, entry: 1 } if array == "psi"));
        assert!(std::fs::read_dir(directory.path()).unwrap().next().is_none());
    }

    #[test]
    fn scenes_are_the_same_but_for_what_a_restart_may_change() {
        let body = |end: f64, h: f64| json!({"scene": {"kind": "vortex", "end_time": end, "spacing": h}});
        assert!(is_same_scene(&body(8.0, 0.1), &body(9.0, 0.1)));
        assert!(!is_same_scene(&body(8.0, 0.1), &body(8.0, 0.2)));
    }
}
