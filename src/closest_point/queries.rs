//! Closest points for many queries at once.
//!
//! 1. The nearest sample of every query, each search starting from the sample of the query before.
//! 2. Queries sorted by sample, so that those of one sample stand side by side.
//! 3. Newton's method on the sample's polynomial for several queries in vector lanes.

use super::redistancing::{ClosestPoint, QueryCounts, Redistancing};
use crate::geometry::Vector;
use crate::linear_algebra::number::LANES;
use crate::parallel::{Interrupt, Interrupted};
use rayon::prelude::{IndexedParallelIterator, ParallelIterator, ParallelSlice, ParallelSliceMut};

/// Queries of one parallel task: enough to profit from the one before.
pub(super) const QUERIES: usize = 256;
/// Mark of a query without a sample in reach.
const NONE: usize = usize::MAX;

/// The answers to the queries that have a sample in reach, in the order of samples.
#[derive(Debug)]
pub struct ClosestPoints<const D: usize> {
    /// Nearest sample and squared distance from it, query by query.
    nearest: Vec<(usize, f64)>,
    /// First place of each sample in `queries`.
    starts: Vec<usize>,
    queries: Vec<usize>,
    feet: Vec<Option<ClosestPoint<D>>>,
}

impl<const D: usize> Default for ClosestPoints<D> {
    fn default() -> Self {
        Self { nearest: Vec::new(), starts: Vec::new(), queries: Vec::new(), feet: Vec::new() }
    }
}

impl<const D: usize> ClosestPoints<D> {
    /// Queries and their answers, each query at most once.
    pub fn iter(&self) -> impl Iterator<Item = (usize, &ClosestPoint<D>)> {
        self.queries.iter().zip(&self.feet).filter_map(|(query, foot)| Some((*query, foot.as_ref()?)))
    }

    /// Room for one answer a query, in the order of queries.
    pub(super) fn resize_to_queries(&mut self, queries: usize) -> &mut [Option<ClosestPoint<D>>] {
        self.queries.clear();
        self.queries.extend(0..queries);
        self.feet.resize(queries, None);
        &mut self.feet
    }

    fn sort_by_sample(&mut self, samples: usize) {
        self.starts.clear();
        self.starts.resize(samples + 1, 0);
        for (sample, _) in self.nearest.iter().filter(|n| n.0 != NONE) {
            self.starts[sample + 1] += 1;
        }
        for k in 0..samples {
            self.starts[k + 1] += self.starts[k];
        }
        self.queries.resize(self.starts[samples], 0);
        for (query, (sample, _)) in self.nearest.iter().enumerate() {
            if *sample != NONE {
                self.queries[self.starts[*sample]] = query;
                self.starts[*sample] += 1;
            }
        }
    }
}

impl<const D: usize> Redistancing<D> {
    /// [`Self::query`] for many points.
    ///
    /// # Errors
    /// [`Interrupted`] when somebody asked to stop.
    pub fn closest_points(
        &self,
        points: &[Vector<D>],
        cutoff: f64,
        answers: &mut ClosestPoints<D>,
        interrupt: &Interrupt,
    ) -> Result<(), Interrupted> {
        answers.nearest.resize(points.len(), (NONE, 0.0));
        answers.nearest.par_chunks_mut(QUERIES).zip(points.par_chunks(QUERIES)).for_each(|(nearest, points)| {
            let mut last = None;
            for (x, slot) in points.iter().zip(nearest) {
                if interrupt.is_raised() {
                    return;
                }
                *slot = self.nearest_sample(x, cutoff, &mut last).unwrap_or((NONE, 0.0));
            }
        });
        interrupt.check()?;
        answers.sort_by_sample(self.samples().len());
        let ClosestPoints { nearest, queries, feet, .. } = answers;
        feet.resize(queries.len(), None);
        let nearest = &*nearest;
        feet.par_chunks_mut(QUERIES).zip(queries.par_chunks(QUERIES)).for_each(|(feet, queries)| {
            if interrupt.is_raised() {
                return;
            }
            let mut query_counts = QueryCounts::default();
            let mut done = 0;
            for same in queries.chunk_by(|a, b| nearest[*a].0 == nearest[*b].0) {
                let sample = nearest[same[0]].0;
                for lanes in same.chunks(LANES) {
                    let last = lanes.len() - 1;
                    let at: [Vector<D>; LANES] = std::array::from_fn(|lane| points[lanes[lane.min(last)]]);
                    let away: [f64; LANES] = std::array::from_fn(|lane| nearest[lanes[lane.min(last)]].1.sqrt());
                    let count = lanes.len();
                    self.solve(sample, &at[..count], &away[..count], &mut feet[done..done + count], &mut query_counts);
                    done += lanes.len();
                }
            }
            query_counts.add_to(&self.fit_diagnostics().counts);
        });
        interrupt.check()
    }
}
