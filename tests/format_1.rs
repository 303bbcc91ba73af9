//! Checkpoints of format 1, written by the build before format 2 (tests/data/checkpoints_format_1): each goes on to the state and
//! the report that the build before came to without a stop, bit for bit on the same instruction set.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "support/mod.rs"]
#[expect(dead_code, reason = "each test target uses a part")]
mod support;

use meniscus::simulation::{Entry, OutputPlan, Report, Section, Simulation, state_of};
use meniscus_jobs::formats::checkpoint::{self, layout, state_for};
use meniscus_jobs::spec::body::resolved_scene;
use meniscus_jobs::system::build;
use serde_json::Value;
use std::path::PathBuf;
use support::{build as simulation_of, pool};

/// Arrays of format 1 whose numbers were told apart by their place; the report and the series show what became of them.
const POSITIONAL: [&str; 18] = [
    "rescues",
    "worst_condition",
    "monitors",
    "redistanced",
    "errors",
    "counters",
    "origin",
    "origin_step",
    "row",
    "flow",
    "flow_pivot",
    "summary",
    "removals",
    "has_vanished",
    "soundness",
    "coarse",
    "least_pivot",
    "work",
];
/// Arrays of format 1 of one number each, which have become numbers of their own.
const NUMBERS: [&str; 4] = ["iterations", "residual", "inner_step", "rate"];

fn files() -> Vec<PathBuf> {
    let directory = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/checkpoints_format_1");
    let entries = std::fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> = entries.filter(|path| path.extension().is_some_and(|end| end == "h5")).collect();
    files.sort();
    files
}

/// The digest of every array of a state, by the last part of its path.
fn digests(state: &Section) -> Vec<(String, String)> {
    let name = |path: String| path.rsplit('/').next().unwrap_or_default().to_owned();
    layout::entries_of(state).into_iter().map(|entry| (name(entry.path), entry.sha256)).collect()
}

/// Diagnostics that were counted before, under the names that they had.
fn check_diagnostics(report: &Report, before: &Value, what: &str) {
    let stability = &before["stability"];
    let rescued = [&stability["rescued_fits"], &stability["newton"]["rescued"]];
    for (name, count) in rescued.into_iter().flat_map(|counts| counts.as_object().unwrap()) {
        let now = match name.as_str() {
            "curvature.bounded" => "curvature.clipped",
            "rows.failed" => "supports.failed",
            other => other,
        };
        assert_eq!(report.diagnostic(now), count.as_f64(), "{name} of {what}");
    }
    if let Some(solves) = report.diagnostic("newton.solves") {
        assert_eq!(Some(solves), stability["newton"]["solves"].as_f64(), "{what}");
        assert_eq!(
            report.diagnostic("newton.iterations_mean"),
            stability["newton"]["iterations_mean"].as_f64(),
            "{what}"
        );
        let worst = [report.diagnostic("fits.worst_condition"), report.diagnostic("flow.worst_condition")];
        let worst = worst.into_iter().flatten().fold(0.0, f64::max);
        assert_eq!(Some(worst), stability["worst_condition"].as_f64(), "{what}");
    }
    assert_eq!(Some(report.health.max_cfl), stability["max_cfl"].as_f64(), "{what}");
    assert_eq!(report.health.volume_drift, stability["volume_drift"].as_f64(), "{what}");
}

fn check_end(simulation: &dyn Simulation, before: &Value, what: &str) {
    let clock = simulation.clock();
    assert_eq!((Some(clock.step), Some(clock.time)), (before["step"].as_u64(), before["time"].as_f64()), "{what}");
    let state = state_of(simulation);
    let found = digests(&state);
    for (name, sha256) in before["arrays"].as_object().unwrap() {
        if POSITIONAL.contains(&name.as_str()) || NUMBERS.contains(&name.as_str()) {
            continue;
        }
        let is_there = found.iter().any(|(other, digest)| other == name && digest == sha256.as_str().unwrap());
        assert!(is_there, "{name} of {what} differs");
    }
    for (quantity, value) in simulation.observables() {
        // Quantities that came later have no value before.
        let Some(text) = before["observables"][quantity.name].as_str() else { continue };
        // Pressures inside thin drops were not known.
        let is_new = quantity.name.starts_with("pressure_") && text == "NaN";
        let is_same =
            is_new || value.is_nan() && text == "NaN" || text.parse::<f64>().unwrap().to_bits() == value.to_bits();
        assert!(is_same, "{} of {what}: {value} for {text}", quantity.name);
    }
    let report = simulation.report();
    // Errors that came later have none before.
    let now = serde_json::to_value(&report.errors).unwrap();
    for error in before["errors"].as_array().unwrap() {
        assert!(now.as_array().unwrap().contains(error), "{error} of {what}");
    }
    check_diagnostics(&report, before, what);
}

#[test]
fn checkpoints_of_format_1_go_on_as_they_did() {
    let files = files();
    assert!(files.len() >= 20);
    for file in files {
        let what = file.file_stem().unwrap().to_string_lossy().into_owned();
        let before: Value = serde_json::from_slice(&std::fs::read(file.with_extension("json")).unwrap()).unwrap();
        let (meta, arrays) = checkpoint::read(&file, None).unwrap();
        assert_eq!(meta.format, 1);
        let output = &meta.body["output"];
        let (every_time, every_steps) = (output["every_time"].as_f64(), output["series_every_steps"].as_u64().unwrap());
        pool(2).install(|| {
            let plan = OutputPlan { every_time, series_every_steps: every_steps };
            let mut simulation = simulation_of(&resolved_scene(&meta.body).unwrap(), plan);
            let state = state_for(simulation.as_ref(), &meta, arrays.clone()).unwrap();
            simulation.load(&state).unwrap();
            assert_eq!(state_of(simulation.as_ref()), state, "what was translated is what is saved again: {what}");
            while !simulation.is_finished() {
                simulation.step().unwrap();
            }
            // Another instruction set rounds otherwise.
            if before["isa"] == build::isa() {
                check_end(simulation.as_ref(), &before, &what);
            }
        });
    }
}

/// What is wrong with the arrays is found before anything is loaded.
#[test]
fn arrays_of_another_length_or_missing_ones_are_refused() {
    for file in files() {
        let (meta, arrays) = checkpoint::read(&file, None).unwrap();
        let plan = OutputPlan { every_time: None, series_every_steps: 10 };
        pool(2).install(|| {
            let mut simulation = simulation_of(&resolved_scene(&meta.body).unwrap(), plan);
            let before = state_of(simulation.as_ref());
            let names: Vec<String> = arrays.entries().map(|(name, _)| name.to_owned()).collect();
            for name in names.iter().filter(|name| *name != "clock") {
                let mut broken = arrays.clone();
                match arrays.entry(name).unwrap() {
                    Entry::Reals { components, values } if !values.is_empty() => {
                        let values = values[..values.len() - 1].to_vec();
                        broken.put(name, Entry::Reals { components: *components, values });
                    }
                    Entry::Counts(values) if !values.is_empty() => broken.put_counts(name, values[1..].to_vec()),
                    _ => continue,
                }
                let loaded = state_for(simulation.as_ref(), &meta, broken).and_then(|state| simulation.load(&state));
                // The droplets of a drop are as many as their curvatures.
                assert!(loaded.is_err() || name == "ball_curvatures", "{name} of {}", file.display());
            }
            if !names.iter().any(|name| name == "ball_curvatures") {
                assert_eq!(state_of(simulation.as_ref()), before);
            }
        });
    }
}
