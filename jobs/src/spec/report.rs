//! `report.json`: the report of a finished run. What reads it reads this type.

use super::accuracy::AccuracyReport;
use super::health::HealthRecord;
use meniscus::simulation::{Diagnostic, ErrorEntry};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The report of a finished run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunReport {
    /// Errors against exact answers, in the order of their times.
    pub errors: Vec<ErrorEntry>,
    /// Cost of the whole run.
    pub cost: Cost,
    /// Invariants at the end, and what was noticed.
    pub health: HealthRecord,
    /// What the method counted of its own work.
    pub diagnostics: Vec<Diagnostic>,
    /// What came of the accuracy that was asked for.
    #[serde(default)]
    pub accuracy: Option<AccuracyReport>,
    /// Outcomes of automatic choices, and their reasons.
    pub method: BTreeMap<String, String>,
    /// Where the numbers come from.
    pub provenance: Provenance,
}

/// Cost of a run.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// Running time in seconds.
    pub wall_s: f64,
    /// CPU time in seconds.
    pub cpu_s: f64,
    /// Number of steps.
    pub steps: u64,
    /// Particles by steps by running time.
    pub particle_steps_per_s: f64,
    /// Most resident memory.
    pub peak_memory_bytes: u64,
    /// Exclusive CPU seconds by path-like names.
    pub phases: BTreeMap<String, f64>,
}

/// Where the numbers of a run come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// Version and commit of the program.
    pub build: String,
    /// Processor, where the system names it.
    pub cpu: Option<String>,
    /// Instruction set of the numerics.
    pub isa: String,
    /// Threads of the worker.
    pub threads: usize,
    /// Digest of the resolved scene.
    pub scene_sha256: String,
}

/// The part of a report that the store keeps in the job's row, so that tables of thousands open no file.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Results {
    /// Errors, in the order of their times.
    pub errors: Vec<ErrorEntry>,
    /// Cost of the whole run.
    #[serde(default)]
    pub cost: Cost,
}

impl RunReport {
    /// An error by its quantity and norm: the one at a time, or the latest.
    #[must_use]
    pub fn error(&self, quantity: &str, norm: &str, time: Option<f64>) -> Option<&ErrorEntry> {
        let mut named = self.errors.iter().filter(|entry| entry.quantity == quantity && entry.norm == norm);
        match time {
            Some(wanted) => named.find(|entry| (entry.time - wanted).abs() < 1e-6),
            None => named.max_by(|a, b| a.time.total_cmp(&b.time)),
        }
    }

    /// The value of a diagnostic.
    #[must_use]
    pub fn diagnostic(&self, name: &str) -> Option<f64> {
        self.diagnostics.iter().find(|diagnostic| diagnostic.name == name).map(|diagnostic| diagnostic.value)
    }
}
