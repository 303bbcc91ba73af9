//! The surface from fits in material coordinates, for particles whose levels were never overwritten.
//!
//! If a flow carries the particles and they keep their levels ψ, then ψ and the position x are smooth functions of the
//! initial position X, however distorted the present distribution is. The neighbors in initial positions never change,
//! and the two sheets of a filament remain separate. The chain rule gives the level set in space:
//!
//! J = ∂x/∂X,  ∇p = J⁻ᵀ ∂ψ,  ∇∇p = J⁻ᵀ (∂∂ψ − Σ_d (∇p)_d ∂∂x_d) J⁻¹,
//!
//! Closest points are therefore found by the same Newton steps as in space, where a step s changes X by J⁻¹ s.

use super::detection::Detection;
use super::method::PcpMethod;
use super::newton::{ACCEPTED, LONGEST_STEP, Progress, is_last_step, newton_step, tangents};
use super::projection::{Projected, project};
use super::queries::{ClosestPoints, QUERIES};
use super::redistancing::{ClosestPoint, QueryCounts};
use super::rescue::{FitDiagnostics, add};
use crate::geometry::{Domain, Vector};
use crate::linear_algebra::number::LANES;
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::{BLOCK, Interrupt, Interrupted, PerThread};
use crate::polynomials::horner::derivatives;
use crate::polynomials::{Fit, FitData, Jet, Regression, RegressionScratch};
use nalgebra::SMatrix;
use rayon::prelude::{IndexedParallelIterator, ParallelIterator, ParallelSlice, ParallelSliceMut};
use std::sync::Arc;

/// The particles at the start, which never change.
#[derive(Debug)]
struct Origin<const D: usize> {
    /// Initial positions X.
    positions: Vec<Vector<D>>,
    /// Levels ψ.
    level: Vec<f64>,
    /// Particles that started next to the surface.
    detection: Detection<D>,
}

/// The zero of a level set in material coordinates.
#[derive(Debug)]
pub struct MaterialSurface<const D: usize> {
    method: PcpMethod,
    spacing: f64,
    regression: Regression<D>,
    origin: Arc<Origin<D>>,
    fits: Vec<Option<Fit<D>>>,
    coefficients: Vec<f64>,
    /// Points of the surface, several per fit where the flow has stretched it.
    seeds: Vec<Seed<D>>,
    /// The seeds of each fit.
    found: Vec<Vec<Seed<D>>>,
    seed_cells: CellList<D>,
    scratch: PerThread<RegressionScratch<D>>,
    fit_diagnostics: FitDiagnostics,
}

/// A point of the surface with the fit by which it was found.
#[derive(Debug, Clone, Copy)]
struct Seed<const D: usize> {
    /// Index of the fit.
    patch: usize,
    /// Material coordinates X of the point.
    material: Vector<D>,
    /// Results of the fit at the point.
    spot: Spot<D>,
}

/// Results of the fits at a material point X.
#[derive(Debug, Clone, Copy)]
struct Spot<const D: usize> {
    /// Position x(X) in space.
    point: Vector<D>,
    /// Value, gradient and Hessian of the level set in space.
    jet: Jet<f64, D>,
    /// Gradient ∂ψ/∂X of the level in material coordinates.
    material_gradient: Vector<D>,
    /// The inverse J⁻¹ of the deformation gradient.
    inverse: SMatrix<f64, D, D>,
}

/// Extent along the surface of the seeds of a patch, in material coordinates and multiples of h.
const SEED_EXTENT: f64 = 0.8;
/// Largest number of seeds to either side along one direction. A larger stretch leaves gaps.
const MAX_SEEDS: i32 = 64;
/// Largest number of changes to another seed's fit before the nearest seed itself is the result.
const MAX_SAMPLE_CHANGES: usize = 4;

impl<const D: usize> MaterialSurface<D> {
    /// The surface of particles at their initial positions, with the levels that they keep.
    ///
    /// An interrupt leaves a surface without points. The run then ends before its first step.
    #[must_use]
    pub fn new(method: PcpMethod, spacing: f64, positions: &[Vector<D>], level: &[f64], interrupt: &Interrupt) -> Self {
        let mut detection = Detection::new(Domain::unbounded());
        if detection.rebuild(positions, level, method.sample_threshold_h * spacing, interrupt).is_err() {
            detection = Detection::new(Domain::unbounded());
        }
        let origin = Origin { positions: positions.to_vec(), level: level.to_vec(), detection };
        Self::from_origin(method, spacing, Arc::new(origin))
    }

    /// A surface without points, for particles with the given start.
    fn from_origin(method: PcpMethod, spacing: f64, origin: Arc<Origin<D>>) -> Self {
        Self {
            regression: method.regression(spacing),
            method,
            spacing,
            origin,
            fits: Vec::new(),
            coefficients: Vec::new(),
            seeds: Vec::new(),
            found: Vec::new(),
            seed_cells: CellList::new(Domain::unbounded()),
            scratch: PerThread::new(),
            fit_diagnostics: FitDiagnostics::default(),
        }
    }

    /// A surface of the same particles, not yet fitted to present positions.
    #[must_use]
    pub fn fresh(&self) -> Self {
        Self::from_origin(self.method.clone(), self.spacing, Arc::clone(&self.origin))
    }

    /// Spacing h of the particles at the start.
    #[must_use]
    pub fn spacing(&self) -> f64 {
        self.spacing
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

    /// Seeds of the surface, as points in space.
    pub fn sample_points(&self) -> impl ExactSizeIterator<Item = Vector<D>> + '_ {
        self.seeds.iter().map(|seed| seed.spot.point)
    }

    /// Whether the surface has no point.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.seeds.is_empty()
    }

    /// Fits ψ(X) and x(X) around the particles that started next to the surface, and finds the seeds of all fits.
    ///
    /// # Errors
    /// [`Interrupted`] when the interrupt is raised.
    pub fn fit(&mut self, positions: &[Vector<D>], interrupt: &Interrupt) -> Result<(), Interrupted> {
        let quantities = 1 + D;
        let size = quantities * self.regression.terms();
        let origin = Arc::clone(&self.origin);
        let near = origin.detection.near();
        self.fits.resize(near.len(), None);
        self.coefficients.resize(near.len() * size, 0.0);
        let (regression, scratch) = (&self.regression, &self.scratch);
        self.fits
            .par_chunks_mut(LANES)
            .zip(self.coefficients.par_chunks_mut(LANES * size))
            .zip(near.par_chunks(LANES))
            .for_each(|((fits, coefficients), near)| {
                if interrupt.is_raised() {
                    return;
                }
                let last = near.len() - 1;
                let centers: [Vector<D>; LANES] = std::array::from_fn(|lane| origin.positions[near[lane.min(last)]]);
                let values = |j: usize, q: usize| if q == 0 { origin.level[j] } else { positions[j][q - 1] };
                let data =
                    FitData { search: origin.detection.cells(), values, quantities, admit: |_: usize, _: usize| true };
                scratch.with(|scratch| {
                    let found = regression.fit_lanes(&data, &centers[..near.len()], scratch, coefficients);
                    fits.copy_from_slice(&found[..near.len()]);
                });
            });
        interrupt.check()?;
        for fit in &self.fits {
            self.fit_diagnostics.counts.count_fit(fit.as_ref(), self.regression.degree());
            self.fit_diagnostics.worst_condition = fit.map_or(self.fit_diagnostics.worst_condition, |fit| {
                self.fit_diagnostics.worst_condition.max(fit.condition)
            });
        }
        let mut found = std::mem::take(&mut self.found);
        found.resize_with(near.len(), Vec::new);
        found.par_chunks_mut(BLOCK).enumerate().for_each(|(block, lists)| {
            if !interrupt.is_raised() {
                for (k, list) in lists.iter_mut().enumerate() {
                    self.find_seeds(block * BLOCK + k, list);
                }
            }
        });
        interrupt.check()?;
        self.seeds.clear();
        for (list, fit) in found.iter().zip(&self.fits) {
            add(&self.fit_diagnostics.counts.unprojected, u64::from(fit.is_some() && list.is_empty()));
            self.seeds.extend(list);
        }
        self.found = found;
        self.seed_cells.rebuild(self.seeds.iter().map(|seed| seed.spot.point), 2.0 * self.spacing);
        Ok(())
    }

    /// Results of the fits of a patch at a material point; None where the deformation gradient is singular.
    #[inline]
    fn spot(&self, patch: usize, fit: &Fit<D>, material: &Vector<D>) -> Option<Spot<D>> {
        let terms = self.regression.terms();
        let degree = self.regression.degree();
        let coefficients = &self.coefficients[patch * (1 + D) * terms..(patch + 1) * (1 + D) * terms];
        let scale = 1.0 / fit.scale;
        let t: [f64; D] = ((material - fit.center) * scale).into();
        let jet_of = |quantity: usize| {
            let own = &coefficients[quantity * terms..(quantity + 1) * terms];
            Jet::from_local(&derivatives(degree, |place| own[place], &t), scale)
        };
        let level = jet_of(0);
        let map: [Jet<f64, D>; D] = std::array::from_fn(|d| jet_of(1 + d));
        let jacobian = SMatrix::<f64, D, D>::from_fn(|d, a| map[d].gradient[a]);
        let inverse = jacobian.try_inverse()?;
        let gradient = inverse.transpose() * Vector::<D>::from(level.gradient);
        let material_hessian = SMatrix::<f64, D, D>::from_fn(|a, b| {
            level.hessian[a][b] - (0..D).map(|d| gradient[d] * map[d].hessian[a][b]).sum::<f64>()
        });
        let hessian = inverse.transpose() * material_hessian * inverse;
        let point = Vector::<D>::from_fn(|d, _| map[d].value);
        let jet = Jet {
            value: level.value,
            gradient: gradient.into(),
            hessian: std::array::from_fn(|d| std::array::from_fn(|e| hessian[(d, e)])),
        };
        Some(Spot { point, jet, material_gradient: Vector::<D>::from(level.gradient), inverse })
    }

    /// Projects a material point onto ψ = 0 along ∂ψ/∂X.
    ///
    /// This is the shortest way in material coordinates. The gradient in space may lead far along the surface.
    fn project(&self, patch: usize, fit: &Fit<D>, start: &Vector<D>) -> Option<Seed<D>> {
        let Projected { x, step, .. } = project(&self.method, fit, start, |x| {
            let spot = self.spot(patch, fit, x)?;
            Some((spot.jet.value, spot.material_gradient, ()))
        })?;
        let material = x + step;
        self.spot(patch, fit, &material).map(|spot| Seed { patch, material, spot })
    }

    /// Finds the seeds of a patch: its projected center, and points along the surface every h where the flow has
    /// stretched it.
    fn find_seeds(&self, patch: usize, seeds: &mut Vec<Seed<D>>) {
        seeds.clear();
        let Some(fit) = &self.fits[patch] else { return };
        let Some(first) = self.project(patch, fit, &fit.middle) else { return };
        seeds.push(first);
        let (s, t) = tangents(&first.spot.jet.normal());
        let along_s = first.spot.inverse * Vector::<D>::from(s) * self.spacing;
        let along_t = first.spot.inverse * Vector::<D>::from(t) * self.spacing;
        let extent = SEED_EXTENT * self.spacing;
        let seeds_along = |direction: &Vector<D>| {
            let wanted = extent / direction.norm();
            // Seeds cannot cover a larger stretch.
            add(&self.fit_diagnostics.counts.unprojected, u64::from(wanted > f64::from(MAX_SEEDS)));
            (wanted as i32).min(MAX_SEEDS)
        };
        let (last_i, last_j) = (seeds_along(&along_s), if D == 3 { seeds_along(&along_t) } else { 0 });
        for j in -last_j..=last_j {
            for i in -last_i..=last_i {
                if i != 0 || j != 0 {
                    let start = first.material + along_s * f64::from(i) + along_t * f64::from(j);
                    match self.project(patch, fit, &start) {
                        Some(seed) => seeds.push(seed),
                        None => add(&self.fit_diagnostics.counts.unprojected, 1),
                    }
                }
            }
        }
    }

    /// The closest point of the surface to `x`; None without a seed within `cutoff`.
    #[must_use]
    pub fn query(&self, x: &Vector<D>, cutoff: f64) -> Option<ClosestPoint<D>> {
        let (nearest, distance) = self.seed_cells.nearest(x, cutoff)?;
        Some(self.solve(nearest, distance, x, &mut QueryCounts::default()))
    }

    /// The closest point for a query whose nearest seed lies at the given distance.
    ///
    /// Newton's method starts from the nearest seed. If it leaves the fit, it continues from the seed nearest to the
    /// iterate. If the foot point is farther away than the nearest seed, or if there is none, the result is the seed
    /// itself.
    fn solve(&self, nearest: usize, distance: f64, x: &Vector<D>, query_counts: &mut QueryCounts) -> ClosestPoint<D> {
        query_counts.queries += 1;
        let mut current = nearest;
        for changes in 0..=MAX_SAMPLE_CHANGES {
            match self.newton(&self.seeds[current], x, query_counts) {
                Ok(closest) => {
                    let slack = self.method.slack(x);
                    if closest.distance <= distance * (1.0 + 1e-9) + slack {
                        query_counts.other_sample += u64::from(changes > 0);
                        return closest;
                    }
                    break;
                }
                Err(Some(left)) => match self.seed_cells.nearest(&left, f64::INFINITY) {
                    Some((next, _)) if next != current => current = next,
                    _ => break,
                },
                Err(None) => break,
            }
        }
        query_counts.sample_distance += 1;
        let Spot { point, jet, .. } = &self.seeds[nearest].spot;
        closest_point(x, point, jet, true)
    }

    /// The closest point on the fit of a seed. The error is the position where the iteration left the fit, or None
    /// where it did not converge.
    fn newton(
        &self,
        seed: &Seed<D>,
        x: &Vector<D>,
        query_counts: &mut QueryCounts,
    ) -> Result<ClosestPoint<D>, Option<Vector<D>>> {
        let fit = self.fits[seed.patch].as_ref().ok_or(None)?;
        let mut material = seed.material;
        let mut spot = seed.spot;
        let mut last = f64::INFINITY;
        let mut left = false;
        let mut progress = Progress::default();
        for _ in 0..self.method.max_iterations {
            query_counts.iterations += 1;
            let offset: [f64; D] = (x - spot.point).into();
            let step = newton_step(&spot.jet, &offset);
            let mut shift = spot.inverse * Vector::<D>::from(step);
            let length = shift.norm();
            if !length.is_finite() {
                return Err(None);
            }
            if is_last_step(&self.method, length, last, fit.radius, material.amax()) {
                let foot = spot.point + Vector::<D>::from(step);
                return Ok(closest_point(x, &foot, &spot.jet.translated(&step), false));
            }
            if progress.is_stuck(length) {
                return Err(None);
            }
            let longest = LONGEST_STEP * fit.radius;
            if length > longest {
                shift *= longest / length;
            }
            material += shift;
            // An iteration may leave the support once and come back. It ends when it stays outside.
            let outside = (material - fit.middle).norm_squared() > fit.radius * fit.radius;
            spot = self.spot(seed.patch, fit, &material).ok_or(None)?;
            if outside && (left || length <= ACCEPTED * fit.radius) {
                return Err(Some(spot.point));
            }
            left = outside;
            last = length;
        }
        Err(None)
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
        let feet = results.resize_to_queries(points.len());
        feet.par_chunks_mut(QUERIES).zip(points.par_chunks(QUERIES)).for_each(|(feet, points)| {
            if interrupt.is_raised() {
                return;
            }
            let mut query_counts = QueryCounts::default();
            let mut last = None;
            for (foot, x) in feet.iter_mut().zip(points) {
                let nearest = self.seed_cells.nearest_next(x, cutoff, &mut last, |seed| self.seeds[seed].spot.point);
                *foot = nearest.map(|(seed, r2)| self.solve(seed, r2.sqrt(), x, &mut query_counts));
            }
            query_counts.add_to(&self.fit_diagnostics.counts);
        });
        interrupt.check()
    }
}

/// The closest point `foot` to `x` with the geometry of the level set there.
fn closest_point<const D: usize>(
    x: &Vector<D>,
    foot: &Vector<D>,
    jet: &Jet<f64, D>,
    is_sample: bool,
) -> ClosestPoint<D> {
    let offset = x - foot;
    let normal = Vector::<D>::from(jet.normal());
    ClosestPoint {
        point: *foot,
        distance: offset.norm(),
        normal,
        curvature: jet.curvature(),
        is_outside: offset.dot(&normal) >= 0.0,
        is_sample,
    }
}
