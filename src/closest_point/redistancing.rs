//! Redistancing with fits in space: from particles to sample points, and from queries to closest points.

use super::detection::{Detection, Side};
use super::method::PcpMethod;
use super::newton::{FootPoint, NewtonEnd, Patch, closest_points};
use super::projection::{Projected, project};
use super::rescue::{FitDiagnostics, RescueCounts, add};
use crate::geometry::{Domain, Vector};
use crate::linear_algebra::number::LANES;
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::{BLOCK, Interrupt, Interrupted, PerThread};
use crate::polynomials::{Fit, FitData, Jet, LocalPolynomial, Regression, RegressionScratch};
use rayon::prelude::{IndexedParallelIterator, ParallelIterator, ParallelSlice, ParallelSliceMut};

/// Closest point of the surface to a query point x, with the geometry there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosestPoint<const D: usize> {
    /// The closest point of the surface.
    pub point: Vector<D>,
    /// Distance ‖x − point‖ ≥ 0.
    pub distance: f64,
    /// Outward unit normal ∇p/‖∇p‖ at the point.
    pub normal: Vector<D>,
    /// Curvature ∇·n at the point.
    pub curvature: f64,
    /// Whether x lies on the side to which the normal points.
    pub is_outside: bool,
    /// Whether the point is the nearest sample itself, since no closest point was found.
    pub is_sample: bool,
}

/// The zero of a level set on particles: sample points with their polynomials.
///
/// 1. [`Self::detect`] and [`Self::fit_samples`] rebuild the surface: detection of near-surface particles, regression,
///    projection.
/// 2. [`Self::closest_points`](super::queries) or [`Self::query`] find closest points: nearest sample, Newton's method,
///    fallbacks.
///
/// All memory is reused. A rebuild allocates only when numbers of particles or samples grow.
///
/// ```
/// use meniscus::closest_point::method::NeighborhoodChoice;
/// use meniscus::closest_point::{PcpMethod, Redistancing};
/// use meniscus::geometry::{Domain, Vector};
/// use meniscus::parallel::Interrupt;
/// use meniscus::polynomials::{BasisKind, Solver};
///
/// // A circle of radius 0.5 as the level x² + y² − 1/4 of particles on a lattice.
/// let h = 1.0 / 16.0;
/// let nodes = (0..33 * 33).map(|k| Vector::<2>::new((k % 33) as f64, (k / 33) as f64));
/// let positions: Vec<Vector<2>> = nodes.map(|x| (x * h).add_scalar(-1.0)).collect();
/// let level: Vec<f64> = positions.iter().map(|x| x.norm_squared() - 0.25).collect();
/// let method = PcpMethod {
///     degree: 4,
///     basis: BasisKind::Minter,
///     neighborhood: NeighborhoodChoice::Radius { cutoff_h: 2.8 },
///     solver: Solver::Moments,
///     same_branch: false,
///     weight: 2.0,
///     minimum_ratio: 1.5,
///     sample_threshold_h: 1.5,
///     tolerance: 1e-12,
///     max_iterations: 100,
/// };
/// let mut surface = Redistancing::new(method, Domain::unbounded(), h);
/// let never = Interrupt::default();
/// surface.detect(&positions, &level, &never).unwrap();
/// surface.fit_samples(&positions, &level, None, &never).unwrap();
/// let closest = surface.query(&Vector::<2>::new(0.6, 0.0), 1.0).unwrap();
/// assert!((closest.distance - 0.1).abs() < 1e-10 && (closest.curvature - 2.0).abs() < 1e-8);
/// ```
#[derive(Debug)]
pub struct Redistancing<const D: usize> {
    method: PcpMethod,
    domain: Domain<D>,
    spacing: f64,
    regression: Regression<D>,
    detection: Detection<D>,
    /// Sample of each near-surface particle; None where fit or projection failed.
    fitted: Vec<Option<Sample<D>>>,
    /// Coefficients of the polynomials of all near-surface particles.
    coefficients: Vec<f64>,
    /// The samples of `fitted`, without gaps.
    samples: Vec<Sample<D>>,
    sample_cells: CellList<D>,
    scratch: PerThread<RegressionScratch<D>>,
    fit_diagnostics: FitDiagnostics,
}

/// A point of the surface with the polynomial by which it was found.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample<const D: usize> {
    point: Vector<D>,
    /// Value, gradient and Hessian of the polynomial at the point.
    jet: Jet<f64, D>,
    fit: Fit<D>,
    /// Index of the first coefficient of the polynomial.
    first: usize,
}

impl<const D: usize> Sample<D> {
    /// Projects the near-surface particle at `x` onto the zero of its polynomial; None when the projection fails.
    ///
    /// `first` is the index of the first coefficient of the polynomial.
    fn project(
        method: &PcpMethod,
        fit: Fit<D>,
        x: &Vector<D>,
        polynomial: &LocalPolynomial<'_, D>,
        first: usize,
    ) -> Option<Self> {
        let Projected { x, step, found } = project(method, &fit, x, |x| {
            let jet = polynomial.jet(&(x - fit.center));
            Some((jet.value, Vector::<D>::from(jet.gradient), jet))
        })?;
        Some(Self { point: x + step, jet: found.translated(&step.into()), fit, first })
    }
}

/// Largest number of changes to another sample's polynomial before the nearest sample itself is the result.
const MAX_SAMPLE_CHANGES: usize = 4;

impl<const D: usize> Redistancing<D> {
    /// A surface without samples, for particles of spacing h.
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

    /// Replaces the domain, before particles are detected anew.
    pub fn set_domain(&mut self, domain: &Domain<D>) {
        self.detection.set_domain(domain);
        self.sample_cells.set_domain(domain);
        self.domain = domain.clone();
    }

    /// Spacing h of the particles.
    #[must_use]
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Sample points of the surface.
    pub fn sample_points(&self) -> impl ExactSizeIterator<Item = Vector<D>> + '_ {
        self.samples.iter().map(|sample| sample.point)
    }

    /// Indices of the particles next to the surface.
    #[must_use]
    pub fn near(&self) -> &[usize] {
        self.detection.near()
    }

    /// Number of particles next to the surface that have a sample.
    #[must_use]
    pub fn fitted_count(&self) -> usize {
        self.samples.len()
    }

    /// Side of each particle.
    #[must_use]
    pub fn sides(&self) -> &[Side] {
        self.detection.sides()
    }

    /// Calls `visit(j, r²)` for the particles within ξ of `x`.
    pub(super) fn for_each_near_neighbor(&self, x: &Vector<D>, mut visit: impl FnMut(usize, f64)) {
        let threshold = self.method.sample_threshold_h * self.spacing;
        self.detection.cells().for_each_within(x, threshold, |j, _, r2| visit(j, r2));
    }

    /// All samples.
    pub(super) fn samples(&self) -> &[Sample<D>] {
        &self.samples
    }

    /// Fallbacks and condition of all fits and queries so far.
    #[must_use]
    pub fn fit_diagnostics(&self) -> &FitDiagnostics {
        &self.fit_diagnostics
    }

    /// The fit diagnostics, for adding those of an earlier part of the run.
    pub fn fit_diagnostics_mut(&mut self) -> &mut FitDiagnostics {
        &mut self.fit_diagnostics
    }

    /// First step of a rebuild: finds the particles with a particle of the opposite sign within ξ (PCP 3.1).
    ///
    /// A particle with a level of exactly zero belongs to both sides.
    ///
    /// # Errors
    /// [`Interrupted`] when the interrupt is raised.
    pub fn detect(&mut self, positions: &[Vector<D>], level: &[f64], interrupt: &Interrupt) -> Result<(), Interrupted> {
        let threshold = self.method.sample_threshold_h * self.spacing;
        self.detection.rebuild(positions, level, threshold, interrupt)
    }

    /// Second step of a rebuild: fits polynomials around the near-surface particles and projects the particles onto the
    /// surface.
    ///
    /// `normals` are those of the last redistancing, zero where they are unknown. With [`PcpMethod::same_branch`], only
    /// particles whose normals agree with the normal of the fit's center take part in a fit. This separates the two
    /// sheets of a filament.
    ///
    /// # Errors
    /// [`Interrupted`] when the interrupt is raised.
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
            // An unknown normal, which is zero, agrees with every other.
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
                let mut first = block * BLOCK * terms;
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
                                let sample = Sample::project(method, fit, x, &polynomial, first);
                                add(&counts.unprojected, u64::from(sample.is_none()));
                                sample
                            });
                            first += terms;
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

    /// The closest point of the surface to `x`; None without a sample within `cutoff`.
    ///
    /// 1. Solve by Newton's method on the polynomial of the nearest sample.
    /// 2. If the iterate leaves the support of the polynomial, continue with the sample nearest to the iterate.
    /// 3. If the foot point is farther away than the sample, or if there is none, return the sample itself.
    #[must_use]
    pub fn query(&self, x: &Vector<D>, cutoff: f64) -> Option<ClosestPoint<D>> {
        let (nearest, distance) = self.sample_cells.nearest(x, cutoff)?;
        let mut foot = [None];
        // Only the queries of `closest_points` are counted.
        self.solve(nearest, &[*x], &[distance], &mut foot, &mut QueryCounts::default());
        foot[0]
    }

    /// The nearest sample within `cutoff` and its squared distance, for a sequence of queries. A search starts from the
    /// sample `last`.
    pub(super) fn nearest_sample(&self, x: &Vector<D>, cutoff: f64, last: &mut Option<usize>) -> Option<(usize, f64)> {
        self.sample_cells.nearest_next(x, cutoff, last, |sample| self.samples[sample].point)
    }

    /// The polynomial of a sample.
    fn patch(&self, sample: usize) -> Patch<'_, D> {
        let Sample { point, jet, fit, first } = &self.samples[sample];
        let coefficients = &self.coefficients[*first..first + self.regression.terms()];
        Patch { fit, degree: self.regression.degree(), coefficients, start: point, jet }
    }

    /// The periodic image of `x` that is nearest to a sample.
    fn image_near(&self, sample: usize, x: &Vector<D>) -> Vector<D> {
        let point = self.samples[sample].point;
        point + self.domain.displacement(&point, x)
    }

    /// Writes the closest points of up to [`LANES`] points to `feet`. All points have the same nearest sample, at the
    /// given distances.
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

    /// The closest point from a foot point, unless it lies farther from the query than the sample does.
    fn accepted(&self, query: &Vector<D>, foot: &FootPoint<D>, sample_distance: f64) -> Option<ClosestPoint<D>> {
        let offset = query - foot.point;
        let distance = offset.norm();
        // A distance that is equal up to the tolerance and the last bits of the coordinates does not count as farther.
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

    /// Continues with the sample nearest to `at`, where the iterate left the support of a polynomial, up to
    /// [`MAX_SAMPLE_CHANGES`] times.
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

    /// The nearest sample as the closest point.
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

    /// Whether the particle nearest to `x` has a negative level. This tells the side of a point away from the surface,
    /// also where the surface has gaps.
    #[must_use]
    pub fn is_nearest_particle_inside(&self, x: &Vector<D>) -> bool {
        self.detection.is_nearest_inside(x)
    }

    /// Whether the surface has no sample.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.samples.is_empty()
    }
}

/// Edge of the cells of the sample points, in multiples of h.
const SAMPLE_CELL: f64 = 3.0;

/// Counts of a block of queries. They are added to the total at once, so that threads do not compete for its cache
/// lines.
#[derive(Debug, Default)]
pub(super) struct QueryCounts {
    pub(super) queries: u64,
    pub(super) iterations: u64,
    pub(super) other_sample: u64,
    pub(super) sample_distance: u64,
}

impl QueryCounts {
    /// Adds these counts to the total.
    pub(super) fn add_to(&self, counts: &RescueCounts) {
        add(&counts.queries, self.queries);
        add(&counts.iterations, self.iterations);
        add(&counts.other_sample, self.other_sample);
        add(&counts.sample_distance, self.sample_distance);
    }
}
