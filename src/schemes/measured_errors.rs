//! Root-mean-square and maximum of errors, and the report entries that closest-point schemes share.

use crate::closest_point::rescue::get;
use crate::closest_point::{FitDiagnostics, RescueCounts};
use crate::operators::SupportDiagnostics;
use crate::simulation::quantity::quantities;
use crate::simulation::{Diagnostic, ErrorEntry};

quantities! {
    /// Norms of errors that schemes share.
    pub NORMS {
        RMS = "rms", "of the quantity", "Root mean square over the points.";
        MAX = "max", "of the quantity", "Largest absolute value over the points or the run.";
        MEAN = "mean", "of the quantity", "Mean over the points, or over the named part of the run.";
        RELATIVE = "relative", "", "Size of the error by that of the exact value.";
        ABSOLUTE = "absolute", "of the quantity", "Absolute difference of one number.";
        MAX_RELATIVE = "max_relative", "", "Largest error by the largest exact value.";
    }
}

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

    /// Root mean square √(Σ e²/n).
    #[must_use]
    pub fn rms(&self) -> f64 {
        (self.squares / self.count.max(1) as f64).sqrt()
    }

    /// Largest error max |e|.
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

/// One error as an entry of the report.
#[must_use]
pub fn entry(quantity: &str, norm: &str, value: f64, time: f64, reference: &str) -> ErrorEntry {
    ErrorEntry { quantity: quantity.to_owned(), norm: norm.to_owned(), value, time, reference: reference.to_owned() }
}

/// The fits and queries that needed a rescue.
#[must_use]
pub fn rescued(counts: &RescueCounts) -> u64 {
    get(&counts.lowered) + get(&counts.unfitted) + get(&counts.unprojected) + get(&counts.sample_distance)
}

/// What a closest-point scheme counts of its fits and queries.
#[must_use]
pub fn closest_point_diagnostics(fits: &FitDiagnostics) -> Vec<Diagnostic> {
    let counts = &fits.counts;
    let mut diagnostics: Vec<Diagnostic> =
        counts.described().into_iter().map(|(name, count, doc)| Diagnostic::count(name, count, doc.trim())).collect();
    let solves = get(&counts.queries);
    let mean = get(&counts.iterations) as f64 / solves.max(1) as f64;
    diagnostics.push(Diagnostic::new("newton.iterations_mean", mean, "Newton iterations a query."));
    let worst = "Worst condition of a scaled regression matrix; 0 before the first.";
    diagnostics.push(Diagnostic::new("fits.worst_condition", fits.worst_condition, worst));
    diagnostics
}

/// Names of what is counted of the fits of operators, for a prefix.
macro_rules! fit_names {
    ($prefix:literal) => {
        [
            concat!($prefix, ".larger_radius"),
            concat!($prefix, ".low_rank"),
            concat!($prefix, ".unresolved"),
            concat!($prefix, ".failed"),
            concat!($prefix, ".worst_condition"),
        ]
    };
}

/// Fits of the flow.
pub const FLOW_FITS: [&str; 5] = fit_names!("flow");
/// Fits of surface operators.
pub const SUPPORTS: [&str; 5] = fit_names!("supports");

/// What is counted of the fits of operators.
#[must_use]
pub fn support_diagnostics(names: [&'static str; 5], supports: &SupportDiagnostics) -> Vec<Diagnostic> {
    let SupportDiagnostics { enlarged, low_rank, unresolved, failed, min_pivot, .. } = *supports;
    let [larger_radius, of_low_rank, not_resolved, not_met, worst_condition] = names;
    vec![
        Diagnostic::count(larger_radius, enlarged, "Supports that had to grow."),
        Diagnostic::count(
            of_low_rank,
            low_rank,
            "Points whose moment conditions needed the rank-revealing decomposition.",
        ),
        Diagnostic::count(
            not_resolved,
            unresolved,
            "Points whose supports reach beyond a turn of 60 degrees of the normal.",
        ),
        Diagnostic::count(not_met, failed, "Points whose moment conditions cannot be met."),
        Diagnostic::new(worst_condition, 1.0 / min_pivot, "Largest diagonal entry by its pivot, of all points."),
    ]
}
