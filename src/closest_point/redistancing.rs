//! Redistancing as a whole: near-surface particles → fits → sample particles; queries → closest points.

use super::detection::Detection;
use super::method::PcpMethod;
use super::newton::{FootPoint, NewtonEnd, Patch, closest_points};
use super::projection::{Projected, project};
use super::rescue::{FitDiagnostics, RescueCounts, add};
use crate::geometry::{Domain, Vector};
use crate::linear_algebra::number::LANES;
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::{BLOCK, Interrupt, Interrupted, PerThread};
use crate::polynomials::{Fit, FitData, Jet, Regression, RegressionScratch};
use rayon::prelude::{IndexedParallelIterator, ParallelIterator, ParallelSlice, ParallelSliceMut};

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
    /// Whether it is the nearest sample itself, for want of a closest point.
    pub is_sample: bool,
}

/// The surface of a set of particles: sample particles with their polynomials, and the means to rebuild it.
///
/// 1. [`Self::detect`] and [`Self::fit_samples`]: detection of near-surface particles, regression, projection.
/// 2. [`Self::closest_points`](super::queries) or [`Self::query`]: nearest sample, Newton, rescue.
///
/// All storage is reused; a rebuild allocates only while counts grow.
#[derive(Debug)]
pub struct Redistancing<const D: usize> {
    method: PcpMethod,
    domain: Domain<D>,
    spacing: f64,
    regression: Regression<D>,
    detection: Detection<D>,
    fitted: Vec<Option<Sample<D>>>,
    coefficients: Vec<f64>,
    samples: Vec<Sample<D>>,
    sample_cells: CellList<D>,
    scratch: PerThread<RegressionScratch<D>>,
    fit_diagnostics: FitDiagnostics,
}

/// A sample particle: a point of the surface with the polynomial that it was projected with.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample<const D: usize> {
    point: Vector<D>,
    jet: Jet<f64, D>,
    fit: Fit<D>,
    /// Where its coefficients begin.
    place: usize,
}

/// Rounds of moving on to another sample's polynomial before the sample itself is taken.
const MAX_SAMPLE_CHANGES: usize = 4;

impl<const D: usize> Redistancing<D> {
    /// A redistancing without a surface yet, for particles of spacing h.
    #[must_use]
    pub fn new(method: PcpMethod, domain: Domain<D>, spacing: f64) -> Self {
        Self {
            regression: method.regression(spacing),
            method,
            detection: Detection::new(domain.clone()),
            sample_cells: CellList::new(domain.clone()),
            domain,
            spacing,
            fitted: Vec::new(),
            coefficients: Vec::new(),
            samples: Vec::new(),
            scratch: PerThread::new(),
            fit_diagnostics: FitDiagnostics::default(),
        }
    }

    /// h.
    #[must_use]
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Positions of the sample particles.
    pub fn sample_points(&self) -> impl ExactSizeIterator<Item = Vector<D>> + '_ {
        self.samples.iter().map(|sample| sample.point)
    }

    pub(super) fn samples(&self) -> &[Sample<D>] {
        &self.samples
    }

    /// How sound fits and queries have been so far.
    #[must_use]
    pub fn fit_diagnostics(&self) -> &FitDiagnostics {
        &self.fit_diagnostics
    }

    /// The same, to take over that of an earlier part of the run.
    pub fn fit_diagnostics_mut(&mut self) -> &mut FitDiagnostics {
        &mut self.fit_diagnostics
    }

    /// Step one of a rebuild: the particles with another of the opposite sign within ξ (PCP 3.1).
    ///
    /// A level of exactly zero counts as outside.
    ///
    /// # Errors
    /// [`Interrupted`] when somebody asked to stop.
    pub fn detect(&mut self, positions: &[Vector<D>], level: &[f64], interrupt: &Interrupt) -> Result<(), Interrupted> {
        let threshold = self.method.sample_threshold_h * self.spacing;
        self.detection.rebuild(positions, level, threshold, interrupt)
    }

    /// Step two of a rebuild: fits about the near-surface particles and their projection onto the surface.
    ///
    /// `normals` are those of the last redistancing (zero where unknown): where the method says so, only particles
    /// whose normals agree with that of the fit's center take part, so that two sheets of a filament are kept apart.
    ///
    /// # Errors
    /// [`Interrupted`] when somebody asked to stop.
    pub fn fit_samples(
        &mut self,
        positions: &[Vector<D>],
        level: &[f64],
        normals: Option<&[Vector<D>]>,
        interrupt: &Interrupt,
    ) -> Result<(), Interrupted> {
        let terms = self.regression.terms();
        let near = self.detection.near();
        self.fitted.resize(near.len(), None);
        self.coefficients.resize(near.len() * terms, 0.0);
        let (cells, regression, method, scratch, counts) =
            (self.detection.cells(), &self.regression, &self.method, &self.scratch, &self.fit_diagnostics.counts);
        let normals = normals.filter(|_| method.same_branch);
        let is_same_branch = |i: usize, j: usize| {
            // Unknown normals, which are zero, agree with every other.
            normals.is_none_or(|normals| i == j || normals[i].dot(&normals[j]) >= 0.0)
        };
        self.fitted
            .par_chunks_mut(BLOCK)
            .zip(self.coefficients.par_chunks_mut(BLOCK * terms))
            .zip(near.par_chunks(BLOCK))
            .enumerate()
            .for_each(|(block, ((fitted, coefficients), near))| {
                if interrupt.is_raised() {
                    return;
                }
                let mut place = block * BLOCK * terms;
                scratch.with(|scratch| {
                    let lanes = fitted.chunks_mut(LANES).zip(coefficients.chunks_mut(LANES * terms));
                    for ((fitted, coefficients), near) in lanes.zip(near.chunks(LANES)) {
                        let last = near.len() - 1;
                        let centers: [Vector<D>; LANES] = std::array::from_fn(|lane| positions[near[lane.min(last)]]);
                        let admit = |lane: usize, j: usize| is_same_branch(near[lane], j);
                        let data = FitData { search: cells, values: |j, _| level[j], quantities: 1, admit };
                        let fits = regression.fit_lanes(&data, &centers[..near.len()], scratch, coefficients);
                        for ((slot, coefficients), (fit, x)) in
                            fitted.iter_mut().zip(coefficients.chunks(terms)).zip(fits.iter().zip(&centers))
                        {
                            *slot = fit.and_then(|fit| {
                                let polynomial = fit.polynomial(regression.degree(), coefficients);
                                let projected = project(method, &fit, x, |x| {
                                    let jet = polynomial.jet(&(x - fit.center));
                                    Some((jet.value, Vector::<D>::from(jet.gradient), jet))
                                });
                                add(&counts.unprojected, u64::from(projected.is_none()));
                                projected.map(|Projected { x, step, found }| Sample {
                                    point: x + step,
                                    jet: found.translated(&step.into()),
                                    fit,
                                    place,
                                })
                            });
                            place += terms;
                            counts.count_fit(fit.as_ref(), regression.degree());
                        }
                    }
                });
            });
        interrupt.check()?;
        self.samples.clear();
        self.samples.extend(self.fitted.iter().flatten());
        self.fit_diagnostics.worst_condition =
            self.samples.iter().fold(self.fit_diagnostics.worst_condition, |worst, s| worst.max(s.fit.condition));
        self.sample_cells.rebuild(self.samples.iter().map(|s| s.point), SAMPLE_CELL * self.spacing);
        Ok(())
    }

    /// The closest point of the surface for any point whose nearest sample lies within `reach`; None if none does.
    ///
    /// 1. Newton on the nearest sample's polynomial.
    /// 2. Where the iterate leaves that polynomial's support: on with the sample nearest to it.
    /// 3. A foot farther than the sample, or none: the sample itself (counted).
    #[must_use]
    pub fn query(&self, x: &Vector<D>, cutoff: f64) -> Option<ClosestPoint<D>> {
        let (nearest, distance) = self.sample_cells.nearest(x, cutoff)?;
        let mut foot = [None];
        // Only the queries of a redistancing are counted.
        self.solve(nearest, &[*x], &[distance], &mut foot, &mut QueryCounts::default());
        foot[0]
    }

    /// The nearest sample not farther than `reach`, and its squared distance, for one query after another: each search
    /// starts from the sample that `last` holds.
    pub(super) fn nearest_sample(&self, x: &Vector<D>, cutoff: f64, last: &mut Option<usize>) -> Option<(usize, f64)> {
        self.sample_cells.nearest_next(x, cutoff, last, |sample| self.samples[sample].point)
    }

    fn patch(&self, sample: usize) -> Patch<'_, D> {
        let Sample { point, jet, fit, place } = &self.samples[sample];
        let coefficients = &self.coefficients[*place..place + self.regression.terms()];
        Patch { fit, degree: self.regression.degree(), coefficients, start: point, jet }
    }

    /// The point in the frame of a sample: the short way round a periodic axis.
    fn image_near(&self, sample: usize, x: &Vector<D>) -> Vector<D> {
        let point = self.samples[sample].point;
        point + self.domain.displacement(&point, x)
    }

    /// Answers for up to [`LANES`] points that have the same nearest sample, at the given distances from it.
    pub(super) fn solve(
        &self,
        nearest: usize,
        points: &[Vector<D>],
        distances: &[f64],
        feet: &mut [Option<ClosestPoint<D>>],
        query_counts: &mut QueryCounts,
    ) {
        let last = points.len() - 1;
        let queries: [Vector<D>; LANES] = std::array::from_fn(|lane| self.image_near(nearest, &points[lane.min(last)]));
        let (ends, iterations) = closest_points(&self.method, &self.patch(nearest), &queries[..points.len()]);
        query_counts.queries += points.len() as u64;
        query_counts.iterations += iterations;
        for (lane, (x, foot)) in points.iter().zip(feet).enumerate() {
            let distance = distances[lane];
            let found = match ends[lane] {
                NewtonEnd::Converged(foot) => self.accepted(&queries[lane], &foot, distance),
                NewtonEnd::LeftSupport(at) => {
                    self.continue_from_another_sample(nearest, x, &at, distance, query_counts)
                }
                NewtonEnd::Stuck => None,
            };
            query_counts.sample_distance += u64::from(found.is_none());
            *foot = Some(found.unwrap_or_else(|| self.sample_itself(nearest, x, distance)));
        }
    }

    /// The answer of a foot, unless it lies farther from the query than the sample does.
    fn accepted(&self, query: &Vector<D>, foot: &FootPoint<D>, sample_distance: f64) -> Option<ClosestPoint<D>> {
        let offset = query - foot.point;
        let distance = offset.norm();
        // Equal up to the tolerance and the last bits of the coordinates counts as not farther.
        let slack = self.method.slack(query);
        (distance <= sample_distance * (1.0 + 1e-9) + slack).then(|| ClosestPoint {
            point: self.domain.wrap(foot.point),
            distance,
            normal: foot.normal,
            curvature: foot.curvature,
            is_outside: offset.dot(&foot.normal) >= 0.0,
            is_sample: false,
        })
    }

    /// On with the sample nearest to where an iterate left its polynomial's support, a few times.
    fn continue_from_another_sample(
        &self,
        from: usize,
        x: &Vector<D>,
        at: &Vector<D>,
        distance: f64,
        query_counts: &mut QueryCounts,
    ) -> Option<ClosestPoint<D>> {
        let (mut current, mut at) = (from, *at);
        for _ in 0..MAX_SAMPLE_CHANGES {
            let (next, _) = self.sample_cells.nearest(&at, f64::INFINITY)?;
            if next == current {
                return None;
            }
            current = next;
            let query = self.image_near(current, x);
            let (ends, iterations) = closest_points(&self.method, &self.patch(current), &[query]);
            query_counts.iterations += iterations;
            match ends[0] {
                NewtonEnd::Converged(foot) => {
                    let accepted = self.accepted(&query, &foot, distance);
                    query_counts.other_sample += u64::from(accepted.is_some());
                    return accepted;
                }
                NewtonEnd::LeftSupport(place) => at = place,
                NewtonEnd::Stuck => return None,
            }
        }
        None
    }

    fn sample_itself(&self, nearest: usize, x: &Vector<D>, distance: f64) -> ClosestPoint<D> {
        let Sample { point, jet, .. } = &self.samples[nearest];
        let normal = Vector::<D>::from(jet.normal());
        ClosestPoint {
            point: self.domain.wrap(*point),
            distance,
            normal,
            curvature: jet.curvature(),
            is_outside: self.domain.displacement(point, x).dot(&normal) >= 0.0,
            is_sample: true,
        }
    }

    /// Whether the particle nearest to `x` has a negative level: the side of a point away from the surface, also where
    /// the surface has gaps.
    #[must_use]
    pub fn is_nearest_particle_inside(&self, x: &Vector<D>) -> bool {
        self.detection.is_nearest_inside(x)
    }

    /// Whether the surface has no sample at all.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.samples.is_empty()
    }
}

/// Edge of the cells of sample particles, in spacings.
const SAMPLE_CELL: f64 = 3.0;

/// Counts of one block of queries, booked at once to keep threads off each other's cache lines.
#[derive(Debug, Default)]
pub(super) struct QueryCounts {
    pub(super) queries: u64,
    pub(super) iterations: u64,
    pub(super) other_sample: u64,
    pub(super) sample_distance: u64,
}

impl QueryCounts {
    pub(super) fn add_to(&self, counts: &RescueCounts) {
        add(&counts.queries, self.queries);
        add(&counts.iterations, self.iterations);
        add(&counts.other_sample, self.other_sample);
        add(&counts.sample_distance, self.sample_distance);
    }
}
