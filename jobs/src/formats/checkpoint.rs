//! Checkpoints: the state of a simulation and the counters of its output, in an HDF5 file that proves itself.
//!
//! Under `/state` every section of the state is a group, and every entry of a section a data set in it ([`layout`]).
//! `/meta` holds a JSON text with the body, build, instruction set, format version, counters and a SHA-256 of every
//! data set, `/meta_sha256` the digest of that text. A reader refuses what does not match. Files of format 1, which
//! held flat arrays, are read by [`format_1`].

pub mod format_1;
pub mod layout;

use crate::formats::hdf5_file::{create, write};
use crate::formats::structure::{self, Refusal, Structure};
use crate::spec::body::resolved_scene;
use crate::spec::records::FileRecord;
use crate::system::artifacts;
use crate::system::breakpoints::pass;
use crate::system::build;
use crate::system::digest;
use crate::system::process::free_space;
use layout::{EntryKind, EntryMeta};
use meniscus::scene;
use meniscus::scenes::SCENES;
use meniscus::simulation::{Finding, LoadError, Section, Simulation};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// Version of the layout.
pub const FORMAT: u32 = 2;

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
    /// Step of the simulation.
    pub step: u64,
    /// Scene time of that step.
    pub time: f64,
    /// What was written up to here.
    pub counters: Counters,
    /// Entries of the state, in the order of their paths.
    #[serde(default)]
    pub entries: Vec<EntryMeta>,
    /// Arrays of the state in format 1.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub arrays: Vec<format_1::ArrayMeta>,
}

impl Meta {
    /// Paths of the arrays of the state, with the numbers an item; 0 marks whole numbers.
    #[must_use]
    pub fn list(&self) -> Vec<(&str, usize)> {
        let old = self.arrays.iter().map(|array| (array.name.as_str(), array.components));
        let new = self.entries.iter().filter_map(|entry| match entry.kind {
            EntryKind::Reals { components } => Some((entry.path.as_str(), components)),
            EntryKind::Counts => Some((entry.path.as_str(), 0)),
            EntryKind::Real | EntryKind::Count | EntryKind::Section => None,
        });
        old.chain(new).collect()
    }
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
    /// Findings so far.
    #[serde(default)]
    pub findings: Vec<Finding>,
    /// Whether frame and series row of its own step were not written yet.
    #[serde(default)]
    pub is_before_output: bool,
}

/// Why a checkpoint could not be written or was refused.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The state holds a value that is no number.
    #[error("{array} is not finite at entry {entry}")]
    NonFinite {
        /// Path of the array.
        array: String,
        /// Index of the item.
        entry: usize,
    },
    /// Less space than the file needs.
    #[error("{needed} bytes are needed, {free} are free: No space left on device")]
    NoSpace {
        /// Size of the file.
        needed: u64,
        /// Space that is free, in bytes.
        free: u64,
    },
    /// The file does not match its own or the expected digests.
    #[error("{what} does not match its digest")]
    Damaged {
        /// The part that does not match.
        what: String,
    },
    /// Written by another version of the layout.
    #[error("the format is {got}, this program reads formats 1 to {FORMAT}")]
    Format {
        /// Version of the file.
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
pub fn write_verified(path: &Path, mut meta: Meta, state: &Section) -> Result<(String, u64), CheckpointError> {
    check_finite(state)?;
    let needed = state.numbers() as u64 * 8 + (1 << 20);
    if let Some(free) = free_space(path.parent().unwrap_or(Path::new(".")))
        && free < needed
    {
        return Err(CheckpointError::NoSpace { needed, free });
    }
    meta.entries = layout::entries_of(state);
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
/// or divide by zero over a damaged file. The state of a file of format 1 needs [`state_for`] before it is loaded.
///
/// # Errors
/// [`CheckpointError`].
pub fn read(path: &Path, sha256: Option<&str>) -> Result<(Meta, Section), CheckpointError> {
    if let Some(expected) = sha256
        && digest::of_file(path)?.0 != expected
    {
        return Err(CheckpointError::Damaged { what: "the file".to_owned() });
    }
    let file = std::fs::File::open(path)?;
    let contents = Contents { structure: structure::read(&file)?, file };
    let text = contents.bytes("/meta", 1)?;
    let expected = contents.bytes("/meta_sha256", 1)?;
    if digest::of_bytes(&text).as_bytes() != expected {
        return Err(CheckpointError::Damaged { what: "meta".to_owned() });
    }
    let meta: Meta = serde_json::from_slice(&text)?;
    let state = match meta.format {
        1 => format_1::read(&contents, &meta)?,
        FORMAT => layout::read(&contents, &meta.entries)?,
        got => return Err(CheckpointError::Format { got }),
    };
    check_finite(&state)?;
    Ok((meta, state))
}

/// The state that a checkpoint holds for a simulation: as it was read, or translated from format 1.
///
/// # Errors
/// [`LoadError`] where the arrays of format 1 are not those of the simulation.
pub fn state_for(simulation: &dyn Simulation, meta: &Meta, state: Section) -> Result<Section, LoadError> {
    if meta.format == 1 { simulation.translate_format_1(&state) } else { Ok(state) }
}

/// An open file and its structure.
pub(crate) struct Contents {
    file: std::fs::File,
    structure: Structure,
}

impl Contents {
    /// The bytes of a data set whose elements have a size.
    fn bytes(&self, place: &str, element_bytes: u64) -> Result<Vec<u8>, CheckpointError> {
        let found = self.structure.data_sets.get(place).filter(|found| found.element_bytes == element_bytes);
        let data_set = found.ok_or_else(|| CheckpointError::Damaged { what: place.to_owned() })?;
        Ok(structure::contents(&self.file, place, data_set)?)
    }

    /// The bytes of a data set of the state, which must have a digest.
    fn verified(&self, path: &str, sha256: &str) -> Result<Vec<u8>, CheckpointError> {
        let bytes = self.bytes(&format!("/state/{path}"), 8)?;
        if digest::of_bytes(&bytes) != sha256 {
            return Err(CheckpointError::Damaged { what: path.to_owned() });
        }
        Ok(bytes)
    }

    /// Whether there is a group of the state.
    fn has_group(&self, path: &str) -> bool {
        self.structure.groups.contains(&format!("/state/{path}"))
    }
}

/// Whether a checkpoint's body and another describe runs of the same physics: equal but for restart-safe fields.
#[must_use]
pub fn is_same_scene(a: &Value, b: &Value) -> bool {
    let plain = |body: &Value| {
        // A build before may have left out what this one writes as null: what is resolved resolves to the same again.
        let scene = resolved_scene(body).ok()?;
        let mut scene = scene::parse(&scene, SCENES).map_or(scene, |scene| scene.resolved());
        let safe = meniscus::scenes::kind_of(&scene).map(scene::SceneKind::restart_safe);
        if let Some(map) = scene.as_object_mut() {
            for pointer in safe.unwrap_or_default() {
                map.shift_remove(pointer.trim_start_matches('/'));
            }
        }
        Some(scene)
    };
    // Two bodies without a scene say nothing of each other.
    matches!((plain(a), plain(b)), (Some(a), Some(b)) if a == b)
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
        entries: Vec::new(),
        arrays: Vec::new(),
    }
}

fn check_finite(state: &Section) -> Result<(), CheckpointError> {
    match state.find_non_finite() {
        Some((array, entry)) => Err(CheckpointError::NonFinite { array, entry }),
        None => Ok(()),
    }
}

fn write_file(path: &Path, meta: &Meta, state: &Section) -> Result<(), CheckpointError> {
    let file = create(path)?;
    layout::write_section(&file.create_group("state")?, state)?;
    let text = serde_json::to_vec(meta)?;
    write(&file, "meta", 1, &text)?;
    write(&file, "meta_sha256", 1, digest::of_bytes(&text).as_bytes())?;
    pass("checkpoint/written");
    file.close()?;
    Ok(())
}

#[cfg(test)]
mod tests;
