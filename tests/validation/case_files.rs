//! The verification cases below `tests/validation/cases`: each can be used, and says where its targets come from.

use meniscus_jobs::spec::body::{self, Allowance, NoSources};
use meniscus_jobs::verify::case::job_body;
use meniscus_jobs::verify::measure::Measure;
use meniscus_jobs::verify::{Catalog, catalog};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/validation/cases")
}

fn files(directory: &Path, into: &mut BTreeMap<String, String>) {
    for entry in fs::read_dir(directory).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, into);
        } else {
            let name = path.strip_prefix(root()).unwrap().display().to_string();
            into.insert(name, fs::read_to_string(&path).unwrap());
        }
    }
}

fn assert_resolves(place: &str, run: &Value) {
    let allowance = Allowance { threads: 1, memory_bytes: 64 << 30, local_files: false };
    if let Err(error) = body::parse(&job_body(run), allowance, &NoSources) {
        let violations = error.violations();
        let lines: Vec<String> = violations.iter().map(|v| format!("{}: {}", v.pointer, v.detail)).collect();
        panic!("{place}: {}", lines.join("; "));
    }
}

#[test]
fn the_program_carries_every_file() {
    let mut on_disk = BTreeMap::new();
    files(&root(), &mut on_disk);
    let carried: BTreeMap<String, String> =
        catalog::built_in_files().iter().map(|(name, text)| ((*name).to_owned(), (*text).to_owned())).collect();
    assert_eq!(carried.keys().collect::<Vec<_>>(), on_disk.keys().collect::<Vec<_>>());
    assert!(carried == on_disk, "a file's text differs from that of the program");
}

#[test]
fn every_case_resolves_and_the_directory_reads_as_the_program() {
    let (built_in, read) = (Catalog::built_in().unwrap(), Catalog::from_directory(&root()).unwrap());
    let names = |catalog: &Catalog| -> Vec<String> {
        let of_kind = catalog.kinds.iter().map(|kind| {
            let cases: Vec<&str> = kind.cases.iter().map(|(name, _)| name.as_str()).collect();
            let plots: Vec<&str> = kind.plots.iter().map(|(name, _)| name.as_str()).collect();
            format!("{} {} {cases:?} {plots:?}", kind.kind, kind.document)
        });
        of_kind.collect()
    };
    assert_eq!(names(&built_in), names(&read));
    let mut targets = 0;
    for kind in &built_in.kinds {
        assert!(!kind.cases.is_empty(), "{} has no case", kind.kind);
        for (name, case) in &kind.cases {
            for (run, scene) in &case.runs {
                assert_resolves(&format!("{}/{name}, run {run}", kind.kind), scene);
            }
            let used: Vec<&str> =
                case.targets.iter().flat_map(|target| case.runs_of(target)).map(|(run, _)| run).collect();
            let unused = case.runs.keys().find(|run| !used.contains(&run.as_str()));
            assert_eq!(unused, None, "{}/{name}: no target reads this run", kind.kind);
            targets += case.targets.len();
        }
        for (name, plot) in &kind.plots {
            for run in plot.runs() {
                assert_resolves(&format!("{}/plots/{name}", kind.kind), run);
            }
        }
    }
    assert!(targets >= 362, "{targets} targets; there were 362");
}

#[test]
fn every_target_names_its_source() {
    // Keys of docs/bibliography.md.
    let papers = ["PCP", "GBPM", "Surface DC-PSE"];
    let others = ["Beyond ", "docs/errata.md, ", "OpenFPM and algoim measured", "OpenFPM measured"];
    for kind in &Catalog::built_in().unwrap().kinds {
        for (name, case) in &kind.cases {
            for target in &case.targets {
                let (place, source) = (format!("{}/{name}: {}", kind.kind, target.title), case.source_of(target));
                let is_paper = papers.iter().any(|paper| source.starts_with(&format!("{paper} ")));
                assert!(is_paper || others.iter().any(|other| source.starts_with(other)), "{place}: {source}");
                assert!(!is_paper || source.contains("section "), "{place}: a paper without section: {source}");
            }
        }
    }
}

/// The norm of the error that a measure reads.
fn norm_of(measure: &Measure) -> Option<&str> {
    match measure {
        Measure::Error(of) | Measure::LargestErrorInSpacings(of) | Measure::Ratio(of) | Measure::Difference(of) => {
            Some(&of.norm)
        }
        Measure::Order { norm, .. } => Some(norm),
        Measure::Memory {}
        | Measure::SecondsPerStep { .. }
        | Measure::Seconds { .. }
        | Measure::SecondsRatio { .. }
        | Measure::SecondsPerStepRatio { .. }
        | Measure::Diagnostic { .. } => None,
    }
}

#[test]
fn every_norm_is_one_that_the_kind_of_the_run_declares() {
    for kind in &Catalog::built_in().unwrap().kinds {
        for (name, case) in &kind.cases {
            for target in &case.targets {
                let Some(norm) = norm_of(&target.measure) else { continue };
                for (run, written) in case.runs_of(target) {
                    let body = job_body(written);
                    let scene_kind = meniscus::scenes::find(body["scene"]["kind"].as_str().unwrap()).unwrap();
                    let norms = (scene_kind.quantities)().norms;
                    let is_declared = norms.iter().any(|declared| declared.name == norm);
                    assert!(
                        is_declared,
                        "{}/{name}, run {run}: {} declares no norm {norm}",
                        kind.kind, scene_kind.kind
                    );
                }
            }
        }
    }
}
