//! The surface from fits in material coordinates, for particles whose levels were never overwritten.
//!
//! If a flow carries the particles and they keep their levels ψ, then ψ and the position x are smooth functions of the
//! initial position X, however distorted the present distribution is. The neighbors in initial positions never change,
//! and the two sheets of a filament remain separate. The chain rule gives the level set in space:
//!
//! J = ∂x/∂X,  ∇p = J⁻ᵀ ∂ψ,  ∇∇p = J⁻ᵀ (∂∂ψ − Σ_d (∇p)_d ∂∂x_d) J⁻¹.

use super::charts::{Chart, Seed, Seeds, Spot};
use super::detection::Detection;
use super::method::PcpMethod;
use super::newton::tangents;
use super::queries::ClosestPoints;
use super::redistancing::ClosestPoint;
use super::rescue::{FitDiagnostics, add};
use crate::geometry::{Domain, Vector};
use crate::linear_algebra::number::LANES;
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
    seeds: Seeds<D>,
    /// The seeds of each fit.
    found: Vec<Vec<Seed<D>>>,
    scratch: PerThread<RegressionScratch<D>>,
    fit_diagnostics: FitDiagnostics,
}

/// Extent along the surface of the seeds of a patch, in material coordinates and multiples of h.
const SEED_EXTENT: f64 = 0.8;
/// Largest number of seeds to either side along one direction. A larger stretch leaves gaps.
const MAX_SEEDS: i32 = 64;

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
            seeds: Seeds::new(),
            found: Vec::new(),
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

    /// Indices of the particles that started next to the surface.
    #[must_use]
    pub fn near(&self) -> &[usize] {
        self.origin.detection.near()
    }

    /// Number of particles that started next to the surface and have a seed.
    #[must_use]
    pub fn fitted_count(&self) -> usize {
        self.found.iter().filter(|seeds| !seeds.is_empty()).count()
    }

    /// Seeds of the surface, as points in space.
    pub fn sample_points(&self) -> impl ExactSizeIterator<Item = Vector<D>> + '_ {
        self.seeds.list.iter().map(|seed| seed.spot.point)
    }

    /// Whether the surface has no point.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.seeds.list.is_empty()
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
        self.seeds.list.clear();
        for (list, fit) in found.iter().zip(&self.fits) {
            add(&self.fit_diagnostics.counts.unprojected, u64::from(fit.is_some() && list.is_empty()));
            self.seeds.list.extend(list);
        }
        self.found = found;
        self.seeds.sort(2.0 * self.spacing);
        Ok(())
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
                    let start = first.own + along_s * f64::from(i) + along_t * f64::from(j);
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
}

impl<const D: usize> Chart<D> for MaterialSurface<D> {
    fn method(&self) -> &PcpMethod {
        &self.method
    }

    fn fit(&self, patch: usize) -> Option<&Fit<D>> {
        self.fits[patch].as_ref()
    }

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
        Some(Spot { point, jet, own_gradient: Vector::<D>::from(level.gradient), inverse })
    }
}
