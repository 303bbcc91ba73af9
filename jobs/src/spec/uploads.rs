//! Files from outside: what they are to be used as, and what was found in them. They are hostile until a short-lived
//! process under limits ([`crate::inspection`]) has looked into them: HDF5 files by our own reading of their structure
//! ([`crate::formats::structure`]) before libhdf5 sees a byte, meshes by our own parsers ([`crate::formats::mesh`]).
//! Points leave that process in a plain format ([`crate::formats::cloud_file`]), so that no other process opens the file.

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// What a file is to be used as.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Purpose {
    /// A checkpoint to begin with.
    Checkpoint,
    /// Particles with their level.
    Points,
    /// A surface: points, normals where there are some, faces where there are some.
    Surface,
    /// Places to ask about.
    Queries,
}

impl Purpose {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Checkpoint, Self::Points, Self::Surface, Self::Queries];

    /// The word that stands for it.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Checkpoint => "checkpoint",
            Self::Points => "points",
            Self::Surface => "surface",
            Self::Queries => "queries",
        }
    }

    /// From its word.
    #[must_use]
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|purpose| purpose.word() == word)
    }
}

/// What was found in a file, as JSON for clients: of points `points`, `fields`, `low`, `high`; of checkpoints `body`,
/// `step`, `time`, `isa`, `build`.
pub type Findings = Value;

/// Points that a file may hold at most.
pub const MOST_POINTS: u64 = 20_000_000;
