//! Counts of everything that did not go the plain way. A rescue is data: counted and reported, never silent.

use crate::polynomials::Fit;
use std::sync::atomic::{AtomicU64, Ordering};

macro_rules! counters {
    ($($(#[$doc:meta])* $name:ident => $label:literal,)*) => {
        /// How often what happened, over the life of a simulation.
        #[derive(Debug, Default)]
        pub struct RescueCounts {
            $($(#[$doc])* pub $name: AtomicU64,)*
        }

        impl RescueCounts {
            /// Labels and counts in a fixed order.
            #[must_use]
            pub fn entries(&self) -> Vec<(&'static str, u64)> {
                vec![$(($label, self.$name.load(Ordering::Relaxed)),)*]
            }

            /// Adds those of another.
            pub fn add(&self, other: &Self) {
                $(add(&self.$name, get(&other.$name));)*
            }

            /// Takes the counts of an earlier [`Self::entries`] in the same order.
            pub fn restore(&self, counts: &[u64]) {
                let slots = [$(&self.$name,)*];
                for (slot, count) in slots.into_iter().zip(counts) {
                    slot.store(*count, Ordering::Relaxed);
                }
            }
        }
    };
}

/// How sound the fits and queries of a surface have been.
#[derive(Debug, Default)]
pub struct FitDiagnostics {
    /// What did not go the plain way so far.
    pub counts: RescueCounts,
    /// The worst condition of a scaled regression matrix so far.
    pub worst_condition: f64,
}

impl FitDiagnostics {
    /// Adds that of another surface of the same particles.
    pub fn merge(&mut self, other: &Self) {
        self.counts.add(&other.counts);
        self.worst_condition = self.worst_condition.max(other.worst_condition);
    }
}

counters! {
    /// Regressions solved.
    fits => "fits",
    /// Fits whose radius or count had to grow.
    enlarged => "fits.larger_radius",
    /// Fits of a lower degree than asked.
    lowered => "fits.lower_degree",
    /// Fits that moments were asked for and could not do (too few neighbors, too small a pivot, values that are no
    /// numbers), left to orthogonal decomposition.
    decomposed => "fits.orthogonal",
    /// Near-surface particles without any fit.
    unfitted => "fits.none",
    /// Fits whose zero could not be reached: no sample particle; in initial positions also points of a stretched patch
    /// that could not be reached, or were too many.
    unprojected => "samples.not_projected",
    /// Queries solved, the rescued ones included.
    queries => "queries",
    /// Newton iterations of all queries.
    iterations => "queries.iterations",
    /// Queries that went on with another sample's polynomial.
    other_sample => "queries.other_sample",
    /// Queries answered by the nearest sample itself.
    sample_distance => "queries.sample_distance",
}

impl RescueCounts {
    /// Takes a fit, or the want of one, into account for a method of the given degree.
    pub(super) fn count_fit<const D: usize>(&self, fit: Option<&Fit<D>>, degree: usize) {
        add(&self.fits, 1);
        match fit {
            None => add(&self.unfitted, 1),
            Some(fit) => {
                add(&self.enlarged, u64::from(fit.enlargements > 0));
                add(&self.lowered, u64::from(fit.degree < degree));
                add(&self.decomposed, u64::from(fit.decomposed));
            }
        }
    }
}

/// Adds to a counter.
pub(crate) fn add(counter: &AtomicU64, amount: u64) {
    if amount > 0 {
        counter.fetch_add(amount, Ordering::Relaxed);
    }
}

/// Reads a counter.
pub(crate) fn get(counter: &AtomicU64) -> u64 {
    counter.load(Ordering::Relaxed)
}

#[cfg(test)]
mod tests {
    use super::{RescueCounts, add};

    #[test]
    fn counts_survive_a_round_trip() {
        let counts = RescueCounts::default();
        add(&counts.other_sample, 3);
        add(&counts.queries, 70);
        let saved: Vec<u64> = counts.entries().into_iter().map(|e| e.1).collect();
        let other = RescueCounts::default();
        other.restore(&saved);
        assert_eq!(other.entries(), counts.entries());
    }
}
