//! Root-mean-square and maximum of errors, and the report entries that closest-point schemes share.

use crate::closest_point::rescue::get;
use crate::closest_point::{FitDiagnostics, RescueCounts};
use crate::simulation::report::Newton;
use crate::simulation::{ErrorEntry, Health, Report};
use std::collections::BTreeMap;

/// Sums of errors in the order of adding.
#[derive(Debug, Clone, Copy, Default)]
pub struct ErrorNorms {
    squares: f64,
    largest: f64,
    count: u64,
}

impl ErrorNorms {
    /// Takes one error into account.
    pub fn add(&mut self, error: f64) {
        self.squares += error * error;
        // A NaN must not be lost in a maximum.
        let is_broken = error.is_nan() || self.largest.is_nan();
        self.largest = if is_broken { f64::NAN } else { self.largest.max(error.abs()) };
        self.count += 1;
    }

    /// √(Σ e²/n).
    #[must_use]
    pub fn rms(&self) -> f64 {
        (self.squares / self.count.max(1) as f64).sqrt()
    }

    /// max |e|.
    #[must_use]
    pub fn max(&self) -> f64 {
        self.largest
    }

    /// Whether nothing was added.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The two norms as report entries.
    #[must_use]
    pub fn entries(&self, quantity: &str, time: f64, reference: &str) -> Vec<ErrorEntry> {
        [("rms", self.rms()), ("max", self.max())]
            .map(|(norm, value)| entry(quantity, norm, value, time, reference))
            .to_vec()
    }
}

/// ‖e‖₂/‖exact‖₂, max |e|, and max |e| by the largest of the exact values, of a field that is known exactly.
#[must_use]
pub fn against_exact(quantity: &str, found: &[f64], exact: &[f64], time: f64, reference: &str) -> Vec<ErrorEntry> {
    let (mut errors, mut sizes) = (ErrorNorms::default(), ErrorNorms::default());
    for (found, exact) in found.iter().zip(exact) {
        errors.add(found - exact);
        sizes.add(*exact);
    }
    let norms =
        [("relative", errors.rms() / sizes.rms()), ("max", errors.max()), ("max_relative", errors.max() / sizes.max())];
    norms.map(|(norm, value)| entry(quantity, norm, value, time, reference)).to_vec()
}

/// One report entry.
#[must_use]
pub fn entry(quantity: &str, norm: &str, value: f64, time: f64, reference: &str) -> ErrorEntry {
    ErrorEntry { quantity: quantity.to_owned(), norm: norm.to_owned(), value, time, reference: reference.to_owned() }
}

/// The fits and queries that needed a rescue.
#[must_use]
pub fn rescued(counts: &RescueCounts) -> u64 {
    get(&counts.lowered) + get(&counts.unfitted) + get(&counts.unprojected) + get(&counts.sample_distance)
}

/// The report of a closest-point scheme from its parts.
#[must_use]
pub fn closest_point_report(
    fit_diagnostics: &FitDiagnostics,
    errors: Vec<ErrorEntry>,
    health: Health,
    method: BTreeMap<&'static str, String>,
) -> Report {
    let counts = &fit_diagnostics.counts;
    let entries = counts.entries();
    let some = |labels: &[&str]| {
        entries.iter().filter(|(name, count)| labels.contains(name) && *count > 0).copied().collect::<BTreeMap<_, _>>()
    };
    let solves = get(&counts.queries);
    Report {
        errors,
        health,
        worst_condition: fit_diagnostics.worst_condition,
        rescued_fits: some(&[
            "fits.larger_radius",
            "fits.lower_degree",
            "fits.orthogonal",
            "fits.none",
            "samples.not_projected",
        ]),
        newton: Newton {
            solves,
            iterations_mean: get(&counts.iterations) as f64 / solves.max(1) as f64,
            rescued: some(&["queries.other_sample", "queries.sample_distance"]),
        },
        method,
    }
}
