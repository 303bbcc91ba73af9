//! A surface of particles, by whichever fits: in space or in material coordinates.

use super::material::MaterialSurface;
use super::queries::ClosestPoints;
use super::redistancing::{ClosestPoint, Redistancing};
use super::rescue::FitDiagnostics;
use crate::geometry::Vector;
use crate::parallel::{Interrupt, Interrupted};
use rayon::prelude::{IntoParallelRefIterator, ParallelIterator};

/// The zero of a level set carried by particles.
#[derive(Debug)]
pub enum LevelSurface<const D: usize> {
    /// Fits over neighbors in space.
    Spatial(Box<Redistancing<D>>),
    /// Fits over neighbors in the initial positions.
    Material(Box<MaterialSurface<D>>),
}

/// Distance from the surface, in spacings, beyond which the nearest particle tells the side and not the nearest foot.
const FAR: f64 = 2.0;

macro_rules! each {
    ($self:ident, $surface:ident => $value:expr) => {
        match $self {
            Self::Spatial($surface) => $value,
            Self::Material($surface) => $value,
        }
    };
}

impl<const D: usize> LevelSurface<D> {
    /// Step one of a rebuild: which particles lie next to the surface. In material coordinates they stay the same.
    ///
    /// # Errors
    /// [`Interrupted`] when somebody asked to stop.
    pub fn detect(&mut self, positions: &[Vector<D>], level: &[f64], interrupt: &Interrupt) -> Result<(), Interrupted> {
        match self {
            Self::Spatial(surface) => surface.detect(positions, level, interrupt),
            Self::Material(_) => Ok(()),
        }
    }

    /// Step two of a rebuild: fits and points of the surface.
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
        match self {
            Self::Spatial(surface) => surface.fit_samples(positions, level, normals, interrupt),
            Self::Material(surface) => surface.fit(positions, interrupt),
        }
    }

    /// The closest point of the surface for any point with a point of the surface within `reach`.
    #[must_use]
    pub fn query(&self, x: &Vector<D>, cutoff: f64) -> Option<ClosestPoint<D>> {
        each!(self, surface => surface.query(x, cutoff))
    }

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
        each!(self, surface => surface.closest_points(points, cutoff, answers, interrupt))
    }

    /// h.
    #[must_use]
    pub fn spacing(&self) -> f64 {
        each!(self, surface => surface.spacing())
    }

    /// Points of the surface, in a fixed order.
    #[must_use]
    pub fn sample_points(&self) -> Vec<Vector<D>> {
        each!(self, surface => surface.sample_points().collect())
    }

    /// Whether the surface has no point at all.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        each!(self, surface => surface.is_lost())
    }

    /// Whether a point lies inside, given its closest point. Away from a surface in space the nearest particle tells it:
    /// of a surface with gaps, a foot at the rim of a gap faces nowhere in particular. In material coordinates there are
    /// points wherever the flow has stretched the surface, and particles may lie far apart instead.
    #[must_use]
    pub fn is_inside(&self, x: &Vector<D>, foot: &ClosestPoint<D>) -> bool {
        match self {
            Self::Spatial(surface) if foot.distance > FAR * surface.spacing() => surface.is_nearest_particle_inside(x),
            _ => !foot.is_outside,
        }
    }

    /// How sound fits and queries have been so far.
    #[must_use]
    pub fn fit_diagnostics(&self) -> &FitDiagnostics {
        each!(self, surface => surface.fit_diagnostics())
    }

    /// The same, to take over that of an earlier part of the run or of a copy.
    pub fn fit_diagnostics_mut(&mut self) -> &mut FitDiagnostics {
        each!(self, surface => surface.fit_diagnostics_mut())
    }

    /// Mean and maximum of a measure over the points of the surface, in their order; (0, 0) without any.
    pub fn mean_and_max(&self, measure: impl Fn(&Vector<D>) -> f64 + Sync) -> (f64, f64) {
        let values: Vec<f64> = self.sample_points().par_iter().map(&measure).collect();
        // A NaN must not be lost in the maximum.
        let is_broken = values.iter().any(|v| v.is_nan());
        let most = if is_broken { f64::NAN } else { values.iter().copied().fold(0.0, f64::max) };
        (values.iter().sum::<f64>() / values.len().max(1) as f64, most)
    }
}
