//! Closest points for many queries at once.
//!
//! 1. Find the nearest sample of every query; each search starts from the sample of the query before.
//! 2. Sort the queries by sample.
//! 3. Solve by Newton's method on the polynomial of a sample, for several queries in vector lanes.

use super::redistancing::{ClosestPoint, QueryCounts, Redistancing};
use crate::geometry::Vector;
use crate::linear_algebra::number::LANES;
use crate::parallel::{Interrupt, Interrupted};
use rayon::prelude::{IndexedParallelIterator, ParallelIterator, ParallelSlice, ParallelSliceMut};

/// Number of queries of a parallel task, large enough for searches to profit from the query before.
pub(super) const QUERIES: usize = 256;
/// Mark of a query without a sample within the cutoff.
const NONE: usize = usize::MAX;

/// Closest points of the queries that have a sample within the cutoff, in the order of samples.
#[derive(Debug)]
pub struct ClosestPoints<const D: usize> {
    /// Nearest sample of each query, and the squared distance from it.
    nearest: Vec<(usize, f64)>,
    /// First slot of each sample in `queries`.
    starts: Vec<usize>,
    /// Indices of the queries, sorted by sample.
    queries: Vec<usize>,
    /// Closest points, in the order of `queries`.
    feet: Vec<Option<ClosestPoint<D>>>,
}

impl<const D: usize> Default for ClosestPoints<D> {
    fn default() -> Self {
        Self { nearest: Vec::new(), starts: Vec::new(), queries: Vec::new(), feet: Vec::new() }
    }
}

impl<const D: usize> ClosestPoints<D> {
    /// Indices of the queries with their closest points, each query at most once.
    pub fn iter(&self) -> impl Iterator<Item = (usize, &ClosestPoint<D>)> {
        self.queries.iter().zip(&self.feet).filter_map(|(query, foot)| Some((*query, foot.as_ref()?)))
    }

    /// The sample nearest to a query of [`Self::iter`].
    #[must_use]
    pub fn nearest_sample(&self, query: usize) -> usize {
        self.nearest.get(query).map_or(NONE, |nearest| nearest.0)
    }

    /// One slot per query, in the order of queries, for writing closest points.
    pub(super) fn resize_to_queries(&mut self, queries: usize) -> &mut [Option<ClosestPoint<D>>] {
        self.queries.clear();
        self.queries.extend(0..queries);
        self.feet.resize(queries, None);
        &mut self.feet
    }

    /// Sorts the queries by their nearest samples.
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
    /// [`Self::query`] for many points at once.
    ///
    /// # Errors
    /// [`Interrupted`] when the interrupt is raised.
    pub fn closest_points(
        &self,
        points: &[Vector<D>],
        cutoff: f64,
        results: &mut ClosestPoints<D>,
        interrupt: &Interrupt,
    ) -> Result<(), Interrupted> {
        results.nearest.resize(points.len(), (NONE, 0.0));
        results.nearest.par_chunks_mut(QUERIES).zip(points.par_chunks(QUERIES)).for_each(|(nearest, points)| {
            let mut last = None;
            for (x, slot) in points.iter().zip(nearest) {
                if interrupt.is_raised() {
                    return;
                }
                *slot = self.nearest_sample(x, cutoff, &mut last).unwrap_or((NONE, 0.0));
            }
        });
        interrupt.check()?;
        results.sort_by_sample(self.samples().len());
        let ClosestPoints { nearest, queries, feet, .. } = results;
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
                    let distances: [f64; LANES] = std::array::from_fn(|lane| nearest[lanes[lane.min(last)]].1.sqrt());
                    let count = lanes.len();
                    self.solve(
                        sample,
                        &at[..count],
                        &distances[..count],
                        &mut feet[done..done + count],
                        &mut query_counts,
                    );
                    done += lanes.len();
                }
            }
            query_counts.add_to(&self.fit_diagnostics().counts);
        });
        interrupt.check()
    }
}
