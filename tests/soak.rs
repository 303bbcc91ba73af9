//! `make soak`: the proofs by the hundred. Every proof is tried COUNT times more (in batches, each with a seed that is
//! printed); what is done stands in soak-output/totals.json, so that a soak that was cut off goes on, and counts add up
//! over runs. ONLY=name,name picks proofs.
#![expect(clippy::unwrap_used, reason = "a proof fails by panicking")]

#[path = "faults/common.rs"]
mod common;
#[path = "faults/proofs/mod.rs"]
mod proofs;
#[path = "support/service.rs"]
#[expect(dead_code, reason = "each test target uses a part")]
mod support;

use proofs::PROOFS;
use serde_json::{Value, json};
use std::panic::catch_unwind;
use std::path::Path;
use std::time::Instant;

const TOTALS: &str = "soak-output/totals.json";

fn totals() -> Value {
    std::fs::read(TOTALS).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_else(|| json!({}))
}

#[expect(clippy::print_stdout, reason = "a soak tells what it does")]
fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    // `cargo test` and nextest list and run every target; a soak runs when it is asked for.
    if std::env::var_os("MENISCUS_SOAK").is_none() || arguments.iter().any(|a| a == "--list") {
        return;
    }
    let share: f64 = std::env::var("COUNT").ok().and_then(|c| c.parse().ok()).unwrap_or(20.0) / 1000.0;
    let only: Vec<String> =
        std::env::var("ONLY").unwrap_or_default().split_terminator(',').map(str::to_owned).collect();
    for name in &only {
        // A slip must not look like a proof.
        assert!(PROOFS.iter().any(|proof| proof.name == name), "there is no proof {name:?}");
    }
    std::fs::create_dir_all(Path::new(TOTALS).parent().unwrap()).unwrap();
    let mut failed = false;
    for proof in PROOFS.iter().filter(|proof| only.is_empty() || only.iter().any(|name| name == proof.name)) {
        // COUNT is of a thousand: the same share of every proof's full number.
        let mut left = ((proof.full as f64 * share).ceil() as u64).max(1);
        while left > 0 {
            let count = left.min(proof.batch);
            left -= count;
            let seed = support::seed();
            let began = Instant::now();
            let outcome = catch_unwind(|| (proof.run)(count, seed));
            let mut totals = totals();
            let entry = &mut totals[proof.name];
            match outcome {
                Ok(said) => {
                    let done = entry["done"].as_u64().unwrap_or(0) + count;
                    let seconds = entry["seconds"].as_f64().unwrap_or(0.0) + began.elapsed().as_secs_f64();
                    let failures = entry["failures"].as_array().cloned().unwrap_or_default();
                    *entry =
                        json!({"done": done, "of": proof.full, "seconds": seconds, "last": said, "failures": failures});
                    println!("{:<42} {done:>8} of {:<8} {said}", proof.name, proof.full);
                }
                Err(_) => {
                    failed = true;
                    let mut failures = entry["failures"].as_array().cloned().unwrap_or_default();
                    failures.push(json!({"seed": seed, "count": count}));
                    entry["failures"] = json!(failures);
                    println!("{:<42} FAILED with MENISCUS_SEED={seed}, {count} tries", proof.name);
                }
            }
            std::fs::write(TOTALS, serde_json::to_vec_pretty(&totals).unwrap()).unwrap();
        }
    }
    assert!(!failed, "a promise is broken; {TOTALS} has the seeds");
}
