//! The report of a finished run: what the engine reports, with cost and provenance.

use crate::spec::health::{FindingLog, HealthRecord};
use crate::spec::records::Usage;
use crate::spec::report::{Cost, Provenance, RunReport};
use crate::system::build;
use crate::system::process;
use meniscus::simulation::Simulation;
use std::collections::BTreeMap;

/// The report of a run at its end.
#[must_use]
pub fn compose(
    simulation: &dyn Simulation,
    findings: &FindingLog,
    usage: &Usage,
    phases: BTreeMap<String, f64>,
    threads: usize,
    scene_sha256: &str,
) -> RunReport {
    let report = simulation.report();
    let steps = simulation.clock().step;
    let particles = simulation.particle_count() as u64;
    RunReport {
        errors: report.errors,
        cost: Cost {
            wall_s: usage.wall_s,
            cpu_s: usage.cpu_s,
            steps,
            particle_steps_per_s: (steps * particles) as f64 / usage.wall_s.max(1e-9),
            peak_memory_bytes: usage.peak_memory_bytes,
            phases,
        },
        health: HealthRecord { findings: findings.findings().to_vec(), ..findings.health(report.health) },
        diagnostics: report.diagnostics,
        accuracy: None,
        method: report.method.into_iter().map(|(name, outcome)| (name.to_owned(), outcome)).collect(),
        provenance: Provenance {
            build: build::name(),
            cpu: process::cpu_name(),
            isa: build::isa(),
            threads,
            scene_sha256: scene_sha256.to_owned(),
        },
    }
}
