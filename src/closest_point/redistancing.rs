//! Redistancing as a whole: near-surface particles → fits → sample particles; queries → closest points.

use super::method::PcpMethod;
use super::newton::{NewtonEnd, closest_point};
use super::projection::project;
use super::rescue::{RescueCounts, add};
use crate::geometry::{Domain, Vector};
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::{BLOCK, Interrupt, Interrupted, PerThread};
use crate::polynomials::{Fit, LocalPolynomial, Regression, RegressionScratch};
use rayon::prelude::{
    IndexedParallelIterator, IntoParallelRefIterator, ParallelIterator, ParallelSlice, ParallelSliceMut,
};

/// The answer to a query.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosestPoint<const D: usize> {
    /// The closest point of the surface.
    pub point: Vector<D>,
    /// |x − point| ≥ 0.
    pub distance: f64,
    /// ∇p/|∇p| there: outward.
    pub normal: Vector<D>,
    /// ∇·n there.
    pub curvature: f64,
    /// Whether the query lies on the outer side, by the normal.
    pub is_outside: bool,
}

/// The surface of a set of particles: sample particles with their polynomials, and the means to rebuild it.
///
/// 1. [`Self::rebuild`]: detection of near-surface particles, regression, projection.
/// 2. [`Self::closest_points`] or [`Self::query`]: nearest sample, Newton, rescue.
///
/// All storage is reused; a rebuild allocates only while counts grow.
#[derive(Debug)]
pub struct Redistancing<const D: usize> {
    method: PcpMethod,
    domain: Domain<D>,
    spacing: f64,
    regression: Regression<D>,
    cells: CellList<D>,
    is_near: Vec<bool>,
    is_inside: Vec<bool>,
    near: Vec<usize>,
    fitted: Vec<Option<Sample<D>>>,
    coefficients: Vec<f64>,
    /// Sample particles, with the place of their coefficients.
    samples: Vec<(Sample<D>, usize)>,
    sample_cells: CellList<D>,
    scratch: PerThread<RegressionScratch<D>>,
    counts: RescueCounts,
    worst_condition: f64,
}

#[derive(Debug, Clone, Copy)]
struct Sample<const D: usize> {
    point: Vector<D>,
    normal: Vector<D>,
    fit: Fit<D>,
}

/// Rounds of moving on to another sample's polynomial before the sample itself is taken.
const MOST_HOPS: usize = 4;

impl<const D: usize> Redistancing<D> {
    /// A redistancing without a surface yet, for particles of spacing h.
    #[must_use]
    pub fn new(method: PcpMethod, domain: Domain<D>, spacing: f64) -> Self {
        Self {
            regression: method.regression(spacing),
            method,
            cells: CellList::new(domain.clone()),
            sample_cells: CellList::new(domain.clone()),
            domain,
            spacing,
            is_near: Vec::new(),
            is_inside: Vec::new(),
            near: Vec::new(),
            fitted: Vec::new(),
            coefficients: Vec::new(),
            samples: Vec::new(),
            scratch: PerThread::new(),
            counts: RescueCounts::default(),
            worst_condition: 0.0,
        }
    }

    /// h.
    #[must_use]
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Positions of the sample particles.
    pub fn sample_points(&self) -> impl ExactSizeIterator<Item = Vector<D>> + '_ {
        self.samples.iter().map(|(sample, _)| sample.point)
    }

    /// What did not go the plain way so far.
    #[must_use]
    pub fn counts(&self) -> &RescueCounts {
        &self.counts
    }

    /// The worst condition of a scaled regression matrix so far.
    #[must_use]
    pub fn worst_condition(&self) -> f64 {
        self.worst_condition
    }

    /// Takes over the worst condition of an earlier part of the same run.
    pub fn restore_worst_condition(&mut self, condition: f64) {
        self.worst_condition = condition;
    }

    /// Step one of a rebuild: the particles with another of the opposite sign within ξ (PCP 3.1).
    ///
    /// A level of exactly zero counts as outside.
    ///
    /// # Errors
    /// [`Interrupted`] when somebody asked to stop.
    pub fn detect(&mut self, positions: &[Vector<D>], level: &[f64], interrupt: &Interrupt) -> Result<(), Interrupted> {
        let threshold = self.method.sample_threshold_h * self.spacing;
        self.cells.rebuild(positions.iter().copied(), threshold);
        self.is_near.resize(positions.len(), false);
        self.is_inside.clear();
        self.is_inside.extend(level.iter().map(|l| *l < 0.0));
        let cells = &self.cells;
        self.is_near.par_chunks_mut(BLOCK).enumerate().for_each(|(block, flags)| {
            if interrupt.is_raised() {
                return;
            }
            for (k, flag) in flags.iter_mut().enumerate() {
                let i = block * BLOCK + k;
                let inside = level[i] < 0.0;
                *flag = false;
                cells.for_each_within(&positions[i], threshold, |j, _, _| *flag |= (level[j] < 0.0) != inside);
            }
        });
        interrupt.check()?;
        self.near.clear();
        self.near.extend((0..positions.len()).filter(|&i| self.is_near[i]));
        Ok(())
    }

    /// Step two of a rebuild: fits about the near-surface particles and their projection onto the surface.
    ///
    /// # Errors
    /// [`Interrupted`] when somebody asked to stop.
    pub fn fit_samples(
        &mut self,
        positions: &[Vector<D>],
        level: &[f64],
        interrupt: &Interrupt,
    ) -> Result<(), Interrupted> {
        let terms = self.regression.terms();
        self.fitted.resize(self.near.len(), None);
        self.coefficients.resize(self.near.len() * terms, 0.0);
        let (cells, regression, method, scratch, counts) =
            (&self.cells, &self.regression, &self.method, &self.scratch, &self.counts);
        self.fitted
            .par_chunks_mut(BLOCK)
            .zip(self.coefficients.par_chunks_mut(BLOCK * terms))
            .zip(self.near.par_chunks(BLOCK))
            .for_each(|((fitted, coefficients), near)| {
                if interrupt.is_raised() {
                    return;
                }
                scratch.with(|scratch| {
                    for ((slot, coefficients), &i) in fitted.iter_mut().zip(coefficients.chunks_mut(terms)).zip(near) {
                        let x = &positions[i];
                        let fit = regression.fit(cells, x, level, scratch, coefficients);
                        *slot = fit.and_then(|fit| {
                            let polynomial = fit.polynomial(&regression.basis, coefficients);
                            let projected = project(method, &polynomial, &fit, x);
                            add(&counts.unprojected, u64::from(projected.is_none()));
                            projected.map(|p| Sample { point: p.point, normal: p.normal, fit })
                        });
                        count_fit(counts, fit.as_ref(), regression.basis.degree());
                    }
                });
            });
        interrupt.check()?;
        self.samples.clear();
        for (place, sample) in self.fitted.iter().enumerate() {
            if let Some(sample) = sample {
                self.worst_condition = self.worst_condition.max(sample.fit.condition);
                self.samples.push((*sample, place));
            }
        }
        self.sample_cells.rebuild(self.samples.iter().map(|(s, _)| s.point), 2.0 * self.spacing);
        Ok(())
    }

    fn polynomial(&self, sample: usize) -> (&Sample<D>, LocalPolynomial<'_, D>) {
        let (sample, place) = &self.samples[sample];
        let terms = self.regression.terms();
        let coefficients = &self.coefficients[place * terms..(place + 1) * terms];
        (sample, sample.fit.polynomial(&self.regression.basis, coefficients))
    }

    /// The closest point of the surface for any point whose nearest sample lies within `reach`; None if none does.
    ///
    /// 1. Newton on the nearest sample's polynomial.
    /// 2. Where the iterate leaves that polynomial's support: on with the sample nearest to it.
    /// 3. A foot farther than the sample, or none: the sample itself (counted).
    #[must_use]
    pub fn query(&self, x: &Vector<D>, reach: f64) -> Option<ClosestPoint<D>> {
        // Only the queries of a redistancing are counted.
        self.solve(x, reach, &mut Tally::default())
    }

    fn solve(&self, x: &Vector<D>, reach: f64, tally: &mut Tally) -> Option<ClosestPoint<D>> {
        let (nearest, sample_distance) = self.sample_cells.nearest(x, reach)?;
        tally.queries += 1;
        let mut current = nearest;
        let mut start = self.samples[nearest].0.point;
        for hop in 0..=MOST_HOPS {
            let (sample, polynomial) = self.polynomial(current);
            // Everything in the frame of this sample, the short way round a periodic axis.
            let query = sample.point + self.domain.displacement(&sample.point, x);
            let (end, iterations) = closest_point(&self.method, &polynomial, &sample.fit, &query, &start);
            tally.iterations += u64::from(iterations);
            match end {
                NewtonEnd::Converged(foot) => {
                    let distance = (query - foot.point).norm();
                    // Equal up to the tolerance and the last bits of the coordinates counts as not farther.
                    let slack = self.method.tolerance.max(16.0 * f64::EPSILON * query.amax());
                    if distance <= sample_distance * (1.0 + 1e-9) + slack {
                        tally.hopped += u64::from(hop > 0);
                        let normal = foot.jet.normal();
                        return Some(ClosestPoint {
                            point: self.domain.wrap(foot.point),
                            distance,
                            normal,
                            curvature: foot.jet.curvature(),
                            is_outside: (query - foot.point).dot(&normal) >= 0.0,
                        });
                    }
                    break;
                }
                NewtonEnd::LeftSupport(at) => {
                    let Some((next, _)) = self.sample_cells.nearest(&at, f64::INFINITY) else {
                        break;
                    };
                    if next == current {
                        break;
                    }
                    current = next;
                    let point = self.samples[next].0.point;
                    start = point;
                }
                NewtonEnd::Stuck => break,
            }
        }
        tally.sample_distance += 1;
        let (sample, polynomial) = self.polynomial(nearest);
        let offset = self.domain.displacement(&sample.point, x);
        Some(ClosestPoint {
            point: self.domain.wrap(sample.point),
            distance: sample_distance,
            normal: sample.normal,
            curvature: polynomial.jet(&(sample.point - sample.fit.centre)).curvature(),
            is_outside: offset.dot(&sample.normal) >= 0.0,
        })
    }

    /// [`Self::query`] for many points in parallel; `answers` has one place a point.
    ///
    /// # Errors
    /// [`Interrupted`] when somebody asked to stop.
    pub fn closest_points(
        &self,
        points: &[Vector<D>],
        reach: f64,
        answers: &mut [Option<ClosestPoint<D>>],
        interrupt: &Interrupt,
    ) -> Result<(), Interrupted> {
        answers.par_chunks_mut(BLOCK).zip(points.par_chunks(BLOCK)).for_each(|(answers, points)| {
            if interrupt.is_raised() {
                return;
            }
            let mut tally = Tally::default();
            for (answer, x) in answers.iter_mut().zip(points) {
                *answer = self.solve(x, reach, &mut tally);
            }
            tally.book(&self.counts);
        });
        interrupt.check()
    }

    /// Whether the particle nearest to `x` has a negative level: the side of a point away from the surface, also where
    /// the surface has gaps.
    #[must_use]
    pub fn is_nearest_particle_inside(&self, x: &Vector<D>) -> bool {
        self.cells.nearest(x, f64::INFINITY).is_some_and(|(i, _)| self.is_inside[i])
    }

    /// Whether the surface has no sample at all.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.samples.is_empty()
    }

    /// Mean and maximum of a measure over the sample particles, in their order; (0, 0) without samples.
    pub fn over_samples(&self, measure: impl Fn(&Vector<D>) -> f64 + Sync) -> (f64, f64) {
        let values: Vec<f64> = self.samples.par_iter().map(|(sample, _)| measure(&sample.point)).collect();
        // A NaN must not be lost in the maximum.
        let is_broken = values.iter().any(|v| v.is_nan());
        let most = if is_broken { f64::NAN } else { values.iter().copied().fold(0.0, f64::max) };
        (values.iter().sum::<f64>() / values.len().max(1) as f64, most)
    }
}

/// Counts of one block of queries, booked at once to keep threads off each other's cache lines.
#[derive(Debug, Default)]
struct Tally {
    queries: u64,
    iterations: u64,
    hopped: u64,
    sample_distance: u64,
}

impl Tally {
    fn book(&self, counts: &RescueCounts) {
        add(&counts.queries, self.queries);
        add(&counts.iterations, self.iterations);
        add(&counts.hopped, self.hopped);
        add(&counts.sample_distance, self.sample_distance);
    }
}

fn count_fit<const D: usize>(counts: &RescueCounts, fit: Option<&Fit<D>>, degree: usize) {
    add(&counts.fits, 1);
    match fit {
        None => add(&counts.unfitted, 1),
        Some(fit) => {
            add(&counts.enlarged, u64::from(fit.enlargements > 0));
            add(&counts.lowered, u64::from(fit.degree < degree));
        }
    }
}
