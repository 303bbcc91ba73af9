//! The zero of a level set that particles carry, from fits in space, in coordinates of a stretched cloud or in material
//! coordinates.

use super::detection::Side;
use super::material::MaterialSurface;
use super::queries::ClosestPoints;
use super::redistancing::{ClosestPoint, Redistancing};
use super::rescue::FitDiagnostics;
use super::stretched::StretchedSurface;
use crate::geometry::Vector;
use crate::parallel::{Interrupt, Interrupted};

/// The zero of a level set that particles carry.
#[derive(Debug)]
pub enum LevelSurface<const D: usize> {
    /// Fits over neighbors in space.
    Spatial(Box<Redistancing<D>>),
    /// Fits over neighbors in initial positions.
    Material(Box<MaterialSurface<D>>),
    /// Fits over neighbors in coordinates in which a stretched cloud is even.
    Stretched(Box<StretchedSurface<D>>),
}

/// Distance from the surface, in multiples of h, beyond which the nearest particle decides on which side a point lies,
/// not the foot point.
const FAR: f64 = 2.0;

macro_rules! each {
    ($self:ident, $surface:ident => $value:expr) => {
        match $self {
            Self::Spatial($surface) => $value,
            Self::Material($surface) => $value,
            Self::Stretched($surface) => $value,
        }
    };
}

impl<const D: usize> LevelSurface<D> {
    /// First step of a rebuild: detection of the particles next to the surface. In material coordinates they never
    /// change.
    ///
    /// # Errors
    /// [`Interrupted`] when the interrupt is raised.
    pub fn detect(&mut self, positions: &[Vector<D>], level: &[f64], interrupt: &Interrupt) -> Result<(), Interrupted> {
        match self {
            Self::Spatial(surface) => surface.detect(positions, level, interrupt),
            Self::Stretched(surface) => surface.detect(positions, level, interrupt),
            Self::Material(_) => Ok(()),
        }
    }

    /// Second step of a rebuild: fits and sample points of the surface.
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
        match self {
            Self::Spatial(surface) => surface.fit_samples(positions, level, normals, interrupt),
            Self::Material(surface) => surface.fit(positions, interrupt),
            Self::Stretched(surface) => surface.fit_samples(positions, level, normals, interrupt),
        }
    }

    /// The closest point of the surface to `x`; None without a sample point within `cutoff`.
    #[must_use]
    pub fn query(&self, x: &Vector<D>, cutoff: f64) -> Option<ClosestPoint<D>> {
        each!(self, surface => surface.query(x, cutoff))
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
        each!(self, surface => surface.closest_points(points, cutoff, results, interrupt))
    }

    /// Spacing h of the particles.
    #[must_use]
    pub fn spacing(&self) -> f64 {
        each!(self, surface => surface.spacing())
    }

    /// Sample points of the surface, in a fixed order.
    #[must_use]
    pub fn sample_points(&self) -> Vec<Vector<D>> {
        each!(self, surface => surface.sample_points().collect())
    }

    /// Indices of the particles next to the surface.
    #[must_use]
    pub fn near(&self) -> &[usize] {
        each!(self, surface => surface.near())
    }

    /// Number of particles next to the surface that have a sample point.
    #[must_use]
    pub fn fitted_count(&self) -> usize {
        each!(self, surface => surface.fitted_count())
    }

    /// Side of each particle of the last rebuild; None for fits in initial positions.
    #[must_use]
    pub fn sides(&self) -> Option<&[Side]> {
        match self {
            Self::Spatial(surface) => Some(surface.sides()),
            Self::Stretched(surface) => Some(surface.sides()),
            Self::Material(_) => None,
        }
    }

    /// Calls `visit(j, r²)` for the particles within ξ of particle `i`, among which those of another side make it a
    /// particle next to the surface. Distances r are those in space. Fits in initial positions have none.
    pub(super) fn for_each_near_neighbor(&self, i: usize, positions: &[Vector<D>], visit: impl FnMut(usize, f64)) {
        match self {
            Self::Spatial(surface) => surface.for_each_near_neighbor(&positions[i], visit),
            Self::Stretched(surface) => surface.for_each_near_neighbor(i, positions, visit),
            Self::Material(_) => {}
        }
    }

    /// Longest distance of neighboring particles near particle `i`, by the direction.
    pub(super) fn spacing_at(&self, i: usize) -> f64 {
        match self {
            Self::Spatial(surface) => surface.spacing(),
            Self::Stretched(surface) => surface.map_of(i).longest,
            Self::Material(surface) => surface.spacing(),
        }
    }

    /// Whether the surface has no sample point.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        each!(self, surface => surface.is_lost())
    }

    /// Whether the point `x` with the closest point `foot` lies inside.
    ///
    /// Away from a surface with fits in space, the nearest particle decides, because a foot point at the rim of a gap
    /// has an arbitrary normal. A surface in material coordinates has sample points wherever the flow has stretched it,
    /// while particles may be far apart. There the foot point decides.
    #[must_use]
    pub fn is_inside(&self, x: &Vector<D>, foot: &ClosestPoint<D>) -> bool {
        match self {
            Self::Spatial(surface) if foot.distance > FAR * surface.spacing() => surface.is_nearest_particle_inside(x),
            Self::Stretched(surface) if foot.distance > FAR * surface.spacing() => {
                surface.is_nearest_particle_inside(x)
            }
            _ => !foot.is_outside,
        }
    }

    /// Fallbacks and condition of all fits and queries so far.
    #[must_use]
    pub fn fit_diagnostics(&self) -> &FitDiagnostics {
        each!(self, surface => surface.fit_diagnostics())
    }

    /// The fit diagnostics, for adding those of an earlier part of the run or of a copy.
    pub fn fit_diagnostics_mut(&mut self) -> &mut FitDiagnostics {
        each!(self, surface => surface.fit_diagnostics_mut())
    }
}
