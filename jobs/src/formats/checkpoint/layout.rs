//! Format 2: how the sections of a state lie in a file. A section is a group, an array a data set in it, a single number a
//! data set of one element, or of none where the number is not known.

use super::{CheckpointError, Contents};
use crate::formats::hdf5_file::{count_bytes, real_bytes, write, write_number};
use crate::system::breakpoints::pass;
use crate::system::digest;
use hdf5::Group;
use meniscus::simulation::{Entry, Section};
use serde::{Deserialize, Serialize};

/// One entry of the state.
#[derive(Debug, Clone, Serialize, Deserialize, PartialEq)]
pub struct EntryMeta {
    /// Path below `/state`.
    pub path: String,
    /// Kind of the entry.
    #[serde(flatten)]
    pub kind: EntryKind,
    /// Digest of its bytes; empty for sections.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub sha256: String,
}

/// The kind of an entry.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, PartialEq, Eq)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum EntryKind {
    /// An array of numbers.
    Reals {
        /// Numbers an item.
        components: usize,
    },
    /// An array of whole numbers.
    Counts,
    /// A number, or none.
    Real,
    /// A whole number, or none.
    Count,
    /// A section.
    Section,
}

/// What a file says of the entries of a state.
#[must_use]
pub fn entries_of(state: &Section) -> Vec<EntryMeta> {
    let mut entries = Vec::new();
    describe(state, "", &mut entries);
    entries
}

fn describe(section: &Section, prefix: &str, entries: &mut Vec<EntryMeta>) {
    for (name, entry) in section.entries() {
        let path = format!("{prefix}{name}");
        let (kind, bytes) = match entry {
            Entry::Reals { components, values } => (EntryKind::Reals { components: *components }, real_bytes(values)),
            Entry::Counts(values) => (EntryKind::Counts, count_bytes(values)),
            Entry::Real(value) => (EntryKind::Real, real_bytes(value.as_slice())),
            Entry::Count(value) => (EntryKind::Count, count_bytes(value.as_slice())),
            Entry::Section(inside) => {
                entries.push(EntryMeta { path: path.clone(), kind: EntryKind::Section, sha256: String::new() });
                describe(inside, &format!("{path}/"), entries);
                continue;
            }
        };
        entries.push(EntryMeta { path, kind, sha256: digest::of_bytes(&bytes) });
    }
}

/// Writes a section into a group.
///
/// # Errors
/// Whatever libhdf5 reports.
pub(super) fn write_section(group: &Group, section: &Section) -> hdf5::Result<()> {
    for (name, entry) in section.entries() {
        match entry {
            Entry::Reals { components, values } => {
                write(group, name, *components, values)?;
                pass("checkpoint/array");
            }
            Entry::Counts(values) => {
                write(group, name, 1, values)?;
            }
            Entry::Real(value) => write_number(group, name, *value)?,
            Entry::Count(value) => write_number(group, name, *value)?,
            Entry::Section(inside) => write_section(&group.create_group(name)?, inside)?,
        }
    }
    Ok(())
}

/// Reads the entries of a state, each against its digest.
///
/// # Errors
/// [`CheckpointError`].
pub(super) fn read(contents: &Contents, entries: &[EntryMeta]) -> Result<Section, CheckpointError> {
    let mut state = Section::default();
    for meta in entries {
        let entry = match meta.kind {
            EntryKind::Section if contents.has_group(&meta.path) => Entry::Section(Section::default()),
            EntryKind::Section => return Err(damaged(&meta.path)),
            kind => {
                number_entry(kind, &contents.verified(&meta.path, &meta.sha256)?).ok_or_else(|| damaged(&meta.path))?
            }
        };
        insert(&mut state, &meta.path, entry).ok_or_else(|| damaged(&meta.path))?;
    }
    Ok(state)
}

fn damaged(path: &str) -> CheckpointError {
    CheckpointError::Damaged { what: path.to_owned() }
}

/// An entry from its bytes; none where they are not of its kind.
fn number_entry(kind: EntryKind, bytes: &[u8]) -> Option<Entry> {
    let (words, rest) = bytes.as_chunks::<8>();
    let reals = || words.iter().map(|word| f64::from_le_bytes(*word));
    let counts = || words.iter().map(|word| u64::from_le_bytes(*word));
    let is_sound = rest.is_empty()
        && match kind {
            EntryKind::Reals { components } => components > 0 && words.len().is_multiple_of(components),
            EntryKind::Real | EntryKind::Count => words.len() <= 1,
            EntryKind::Counts => true,
            EntryKind::Section => false,
        };
    is_sound.then(|| match kind {
        EntryKind::Reals { components } => Entry::Reals { components, values: reals().collect() },
        EntryKind::Real => Entry::Real(reals().next()),
        EntryKind::Count => Entry::Count(counts().next()),
        EntryKind::Counts | EntryKind::Section => Entry::Counts(counts().collect()),
    })
}

/// Puts an entry at its path; none where its section is missing, or the path is taken.
fn insert(section: &mut Section, path: &str, entry: Entry) -> Option<()> {
    match path.split_once('/') {
        Some((name, rest)) => insert(section.section_mut(name)?, rest, entry),
        None if section.entry(path).is_ok() => None,
        None => {
            section.put(path, entry);
            Some(())
        }
    }
}
