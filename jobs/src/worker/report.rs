//! `report.json`: errors beside costs, and where they come from.

use crate::spec::records::Usage;
use crate::system::build;
use crate::system::process;
use meniscus::simulation::Report;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// The report of a finished run.
#[must_use]
pub fn compose(
    report: &Report,
    usage: &Usage,
    phases: &BTreeMap<String, f64>,
    steps: u64,
    particles: u64,
    threads: usize,
    scene_sha256: &str,
) -> Value {
    json!({
        "errors": report.errors,
        "cost": {
            "wall_s": usage.wall_s,
            "cpu_s": usage.cpu_s,
            "steps": steps,
            "particle_steps_per_s": (steps * particles) as f64 / usage.wall_s.max(1e-9),
            "peak_memory_bytes": usage.peak_memory_bytes,
            "phases": phases,
        },
        "stability": {
            "max_cfl": report.health.max_cfl,
            "worst_condition": report.worst_condition,
            "rescued_fits": report.rescued_fits,
            "newton": {
                "solves": report.newton.solves,
                "iterations_mean": report.newton.iterations_mean,
                "rescued": report.newton.rescued,
            },
            "volume_drift": report.health.volume_drift,
            // No scene of this version moves mass of its own accord.
            "momentum_drift": Value::Null,
        },
        "method": report.method,
        "provenance": {
            "build": build::name(),
            "cpu": process::cpu_name(),
            "isa": build::isa(),
            "threads": threads,
            "scene_sha256": scene_sha256,
        },
    })
}
