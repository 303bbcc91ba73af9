//! Counts of fits, queries and their fallbacks. Every fallback is counted and reported.

use crate::polynomials::Fit;
use std::sync::atomic::{AtomicU64, Ordering};

macro_rules! counters {
    ($($(#[doc = $doc:literal])* $name:ident => $label:literal,)*) => {
        /// Numbers of fits, queries and fallbacks since the start of a simulation.
        #[derive(Debug, Default)]
        pub struct RescueCounts {
            $($(#[doc = $doc])* pub $name: AtomicU64,)*
        }

        impl RescueCounts {
            /// Names, as in reports, and counts in a fixed order.
            #[must_use]
            pub fn entries(&self) -> Vec<(&'static str, u64)> {
                vec![$(($label, self.$name.load(Ordering::Relaxed)),)*]
            }

            /// Adds the counts of another.
            pub fn add(&self, other: &Self) {
                $(add(&self.$name, get(&other.$name));)*
            }

            /// Labels, counts and what each counts, in a fixed order.
            #[must_use]
            pub fn described(&self) -> Vec<(&'static str, u64, &'static str)> {
                vec![$(($label, self.$name.load(Ordering::Relaxed), concat!($($doc,)*)),)*]
            }

            /// Sets every count to what `count` says of its label.
            ///
            /// # Errors
            /// The first error of `count`.
            pub fn set_each<E>(&mut self, mut count: impl FnMut(&'static str) -> Result<u64, E>) -> Result<(), E> {
                $(*self.$name.get_mut() = count($label)?;)*
                Ok(())
            }
        }
    };
}

/// Fallbacks and condition of the fits and queries of a surface.
#[derive(Debug, Default)]
pub struct FitDiagnostics {
    /// Numbers of fits, queries and fallbacks so far.
    pub counts: RescueCounts,
    /// Largest condition number of a scaled regression matrix so far.
    pub worst_condition: f64,
}

impl FitDiagnostics {
    /// Adds the diagnostics of another surface.
    pub fn merge(&mut self, other: &Self) {
        self.counts.add(&other.counts);
        self.worst_condition = self.worst_condition.max(other.worst_condition);
    }
}

counters! {
    /// Number of fits.
    fits => "fits.solved",
    /// Fits whose radius or number of neighbors had to grow.
    enlarged => "fits.larger_radius",
    /// Fits of a lower degree than the method's.
    lowered => "fits.lower_degree",
    /// Fits by orthogonal decomposition in place of moments, because of too few neighbors, a small pivot or values that
    /// are not finite.
    decomposed => "fits.orthogonal",
    /// Near-surface particles without a fit.
    unfitted => "fits.none",
    /// Fits whose zero was not reached, so that there is no sample. In initial positions also points of a stretched
    /// patch that were not reached or were too many.
    unprojected => "samples.not_projected",
    /// Number of queries.
    queries => "newton.solves",
    /// Number of Newton iterations of all queries.
    iterations => "newton.iterations",
    /// Queries that were solved on the polynomial of another sample than the nearest.
    other_sample => "queries.other_sample",
    /// Queries whose result is the nearest sample itself.
    sample_distance => "queries.sample_distance",
}

impl RescueCounts {
    /// Counts a fit, or a missing one, of a method of the given degree.
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

/// Adds `amount` to a counter.
pub(crate) fn add(counter: &AtomicU64, amount: u64) {
    if amount > 0 {
        counter.fetch_add(amount, Ordering::Relaxed);
    }
}

/// Value of a counter.
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
        let saved = counts.entries();
        let mut other = RescueCounts::default();
        let count = |label| saved.iter().find(|(name, _)| *name == label).map(|(_, count)| *count).ok_or(label);
        other.set_each(count).unwrap();
        assert_eq!(other.entries(), counts.entries());
    }
}
