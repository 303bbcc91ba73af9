//! The surface of a stretched cloud, from fits in coordinates in which its particles lie evenly.
//!
//! Every patch of the cloud has a linear map X = A x (see [`CloudMetric`]). Distances between particles, the
//! neighborhoods of fits and their supports are those of X, where neighboring particles are one unit apart. Distances
//! from the surface are those of space.

use super::charts::{Chart, Seeds, Spot};
use super::detection::Side;
use super::local_map::{LocalMap, MappedSearch};
use super::method::PcpMethod;
use super::metric::CloudMetric;
use super::queries::ClosestPoints;
use super::redistancing::ClosestPoint;
use super::rescue::{FitDiagnostics, add};
use crate::geometry::{Domain, Vector};
use crate::linear_algebra::number::LANES;
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::{BLOCK, Interrupt, Interrupted, PerThread};
use crate::polynomials::horner::derivatives;
use crate::polynomials::{Fit, FitData, Jet, Regression, RegressionScratch};
use rayon::prelude::{
    IndexedParallelIterator, IntoParallelRefMutIterator, ParallelIterator, ParallelSlice, ParallelSliceMut,
};

/// The zero of a level set on the particles of a stretched cloud that does not move.
#[derive(Debug)]
pub struct StretchedSurface<const D: usize> {
    method: PcpMethod,
    spacing: f64,
    regression: Regression<D>,
    metric: CloudMetric<D>,
    /// Medians of the shortest and of the longest spacing.
    spacings: (f64, f64),
    cells: CellList<D>,
    sides: Vec<Side>,
    /// Whether each particle lies next to the surface, patch by patch.
    is_near: Vec<Vec<bool>>,
    batches: Vec<Batch<D>>,
    near: Vec<usize>,
    /// Fits of the batches, [`LANES`] for each.
    fits: Vec<Option<Fit<D>>>,
    coefficients: Vec<f64>,
    seeds: Seeds<D>,
    scratch: PerThread<RegressionScratch<D>>,
    fit_diagnostics: FitDiagnostics,
}

/// Near-surface particles of one patch that are fitted together.
#[derive(Debug, Clone, Copy)]
struct Batch<const D: usize> {
    map: LocalMap<D>,
    /// Indices of the particles; those beyond `count` repeat the last.
    particles: [usize; LANES],
    count: usize,
}

impl<const D: usize> StretchedSurface<D> {
    /// A surface without points, for particles with the given metric; `spacing` is the length h of the scene.
    #[must_use]
    pub fn new(method: PcpMethod, spacing: f64, metric: CloudMetric<D>) -> Self {
        Self {
            // The particles are one unit apart.
            regression: method.regression(1.0),
            method,
            spacing,
            is_near: (0..metric.patch_count()).map(|patch| vec![false; metric.particles(patch).len()]).collect(),
            spacings: metric.spacings(),
            metric,
            cells: CellList::new(Domain::unbounded()),
            sides: Vec::new(),
            batches: Vec::new(),
            near: Vec::new(),
            fits: Vec::new(),
            coefficients: Vec::new(),
            seeds: Seeds::new(),
            scratch: PerThread::new(),
            fit_diagnostics: FitDiagnostics::default(),
        }
    }

    /// Length h of the scene.
    #[must_use]
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Indices of the particles next to the surface.
    #[must_use]
    pub fn near(&self) -> &[usize] {
        &self.near
    }

    /// Number of particles next to the surface that have a point of the surface.
    #[must_use]
    pub fn fitted_count(&self) -> usize {
        self.seeds.list.len()
    }

    /// Side of each particle.
    #[must_use]
    pub fn sides(&self) -> &[Side] {
        &self.sides
    }

    /// The map of the patch of a particle.
    pub(super) fn map_of(&self, i: usize) -> &LocalMap<D> {
        self.metric.map(self.metric.patch_of(i))
    }

    /// Calls `visit(j, r²)` for the particles within ξ of particle `i` in the coordinates of its patch. The distances r
    /// are those in space.
    pub(super) fn for_each_near_neighbor(&self, i: usize, positions: &[Vector<D>], mut visit: impl FnMut(usize, f64)) {
        let map = self.map_of(i);
        let x = map.map * positions[i];
        MappedSearch { cells: &self.cells, map }.for_each_within(&x, self.method.sample_threshold_h, |j, _, _| {
            visit(j, (positions[j] - positions[i]).norm_squared());
        });
    }

    /// Points of the surface.
    pub fn sample_points(&self) -> impl ExactSizeIterator<Item = Vector<D>> + '_ {
        self.seeds.list.iter().map(|seed| seed.spot.point)
    }

    /// Whether the surface has no point.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.seeds.list.is_empty()
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

    /// Finds the particles with a particle of another side within ξ in the coordinates of their patch.
    ///
    /// # Errors
    /// [`Interrupted`] when the interrupt is raised.
    pub fn detect(&mut self, positions: &[Vector<D>], level: &[f64], interrupt: &Interrupt) -> Result<(), Interrupted> {
        let threshold = self.method.sample_threshold_h;
        self.cells.rebuild(positions.iter().copied(), threshold * self.spacings.1);
        self.sides.clear();
        self.sides.extend(level.iter().map(|level| Side::from_level(*level)));
        let (cells, sides, metric) = (&self.cells, &self.sides, &self.metric);
        let (order, sorted) = (cells.permutation(), cells.sorted());
        self.is_near.par_iter_mut().enumerate().for_each(|(patch, is_near)| {
            if interrupt.is_raised() || !metric.is_next_to_surface(patch) {
                return;
            }
            let map = metric.map(patch);
            for (flag, i) in is_near.iter_mut().zip(metric.particles(patch)) {
                let (x, side) = (positions[*i], sides[*i]);
                *flag = cells.any_within(&x, threshold * map.longest, |slot| {
                    side.is_apart_from(sides[order[slot]])
                        && (map.map * (sorted[slot] - x)).norm_squared() <= threshold * threshold
                });
            }
        });
        interrupt.check()?;
        self.near.clear();
        self.batches.clear();
        for (patch, is_near) in self.is_near.iter().enumerate() {
            let first = self.near.len();
            let found = metric.particles(patch).iter().zip(is_near).filter(|(_, near)| **near);
            self.near.extend(found.map(|(i, _)| *i));
            self.batches.extend(self.near[first..].chunks(LANES).map(|near| Batch {
                map: *metric.map(patch),
                particles: std::array::from_fn(|lane| near[lane.min(near.len() - 1)]),
                count: near.len(),
            }));
        }
        Ok(())
    }

    /// Fits polynomials around the near-surface particles, and projects the particles onto the surface. `normals` are
    /// those of the last redistancing; see [`Redistancing::fit_samples`](super::Redistancing::fit_samples).
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
        self.fits.resize(self.batches.len() * LANES, None);
        self.coefficients.resize(self.batches.len() * LANES * terms, 0.0);
        let (cells, regression, scratch) = (&self.cells, &self.regression, &self.scratch);
        let normals = normals.filter(|_| self.method.same_branch);
        self.fits
            .par_chunks_mut(LANES * BLOCK)
            .zip(self.coefficients.par_chunks_mut(LANES * BLOCK * terms))
            .zip(self.batches.par_chunks(BLOCK))
            .for_each(|((fits, coefficients), batches)| {
                if interrupt.is_raised() {
                    return;
                }
                scratch.with(|scratch| {
                    let lanes = fits.chunks_mut(LANES).zip(coefficients.chunks_mut(LANES * terms));
                    for ((fits, coefficients), Batch { map, particles, count }) in lanes.zip(batches) {
                        let centers = particles.map(|i| map.map * positions[i]);
                        let admit = |lane: usize, j: usize| {
                            let i = particles[lane];
                            normals.is_none_or(|normals| i == j || normals[i].dot(&normals[j]) >= 0.0)
                        };
                        let search = MappedSearch { cells, map };
                        let data = FitData { search: &search, values: |j: usize, _| level[j], quantities: 1, admit };
                        fits.copy_from_slice(&regression.fit_lanes(&data, &centers[..*count], scratch, coefficients));
                    }
                });
            });
        interrupt.check()?;
        self.find_seeds();
        Ok(())
    }

    /// Projects the near-surface particles onto the zeros of their fits.
    fn find_seeds(&mut self) {
        let mut seeds = std::mem::take(&mut self.seeds.list);
        seeds.clear();
        for (patch, fit) in self.fits.iter().enumerate() {
            if patch % LANES >= self.batches[patch / LANES].count {
                continue;
            }
            self.fit_diagnostics.counts.count_fit(fit.as_ref(), self.regression.degree());
            let Some(fit) = fit else { continue };
            self.fit_diagnostics.worst_condition = self.fit_diagnostics.worst_condition.max(fit.condition);
            match self.project(patch, fit, &fit.middle) {
                Some(seed) => seeds.push(seed),
                None => add(&self.fit_diagnostics.counts.unprojected, 1),
            }
        }
        let (shortest, longest) = self.spacings;
        self.seeds.list = seeds;
        self.seeds.sort(SEED_CELL * (shortest * longest).sqrt());
    }

    /// The closest point of the surface to `x`; None without a seed within `cutoff`.
    #[must_use]
    pub fn query(&self, x: &Vector<D>, cutoff: f64) -> Option<ClosestPoint<D>> {
        self.query_from(&self.seeds, x, cutoff)
    }

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
        self.closest_points_from(&self.seeds, (points, cutoff), results, &self.fit_diagnostics.counts, interrupt)
    }

    /// Whether the particle nearest to `x` has a negative level.
    #[must_use]
    pub fn is_nearest_particle_inside(&self, x: &Vector<D>) -> bool {
        self.cells.nearest(x, f64::INFINITY).is_some_and(|(i, _)| self.sides[i] == Side::Inside)
    }
}

/// Edge of the cells of the seeds, in multiples of the mean spacing.
const SEED_CELL: f64 = 3.0;

impl<const D: usize> Chart<D> for StretchedSurface<D> {
    fn method(&self) -> &PcpMethod {
        &self.method
    }

    fn fit(&self, patch: usize) -> Option<&Fit<D>> {
        self.fits[patch].as_ref()
    }

    /// The nearest seed in the coordinates of its fit. In space a seed across the stretch may be nearer, but its fit does
    /// not reach as far.
    fn seed_near(&self, seeds: &Seeds<D>, place: &Vector<D>) -> Option<usize> {
        let (nearest, distance) = seeds.cells.nearest(place, f64::INFINITY)?;
        let map = |seed: usize| &self.batches[seeds.list[seed].patch / LANES].map;
        let mut best = (nearest, (map(nearest).map * (seeds.list[nearest].spot.point - place)).norm_squared());
        seeds.cells.for_each_within(place, distance.max(map(nearest).longest), |seed, dx, _| {
            let r2 = (map(seed).map * dx).norm_squared();
            if r2 < best.1 || r2 <= best.1 && seed < best.0 {
                best = (seed, r2);
            }
        });
        Some(best.0)
    }

    fn spot(&self, patch: usize, fit: &Fit<D>, own: &Vector<D>) -> Option<Spot<D>> {
        let LocalMap { map, inverse, .. } = &self.batches[patch / LANES].map;
        let terms = self.regression.terms();
        let coefficients = &self.coefficients[patch * terms..(patch + 1) * terms];
        let scale = 1.0 / fit.scale;
        let t: [f64; D] = ((own - fit.center) * scale).into();
        let jet = Jet::from_local(&derivatives(self.regression.degree(), |place| coefficients[place], &t), scale);
        let own_gradient = Vector::<D>::from(jet.gradient);
        let own_hessian = nalgebra::SMatrix::<f64, D, D>::from_fn(|d, e| jet.hessian[d][e]);
        // The map is symmetric.
        let hessian = map * own_hessian * map;
        let jet = Jet {
            value: jet.value,
            gradient: (map * own_gradient).into(),
            hessian: std::array::from_fn(|d| std::array::from_fn(|e| hessian[(d, e)])),
        };
        Some(Spot { point: inverse * own, jet, own_gradient, inverse: *map })
    }
}
