//! Columns of particles that describe the surface (PCP 3.3 and 3.4).
//!
//! These are the signed distance, the closest point, normal and curvature there, and whether a particle lies in the
//! narrow band.

use super::queries::ClosestPoints;
use super::redistancing::ClosestPoint;
use crate::geometry::Vector;
use crate::particles::{FlagKey, Particles, ScalarKey, VectorKey};

/// Keys of the columns that redistancing writes.
#[derive(Debug, Clone, Copy)]
pub struct SurfaceColumns {
    /// Signed distance, valid in the band only.
    pub phi: ScalarKey,
    /// Closest point of the surface.
    pub closest_point: VectorKey,
    /// Outward unit normal at the closest point.
    pub normal: VectorKey,
    /// Curvature ∇·n at the closest point.
    pub curvature: ScalarKey,
    /// 1 in the narrow band, else 0.
    pub in_band: FlagKey,
}

impl SurfaceColumns {
    /// Adds the columns to particles, none of which is in the band yet.
    pub fn add<const D: usize>(particles: &mut Particles<D>) -> Self {
        Self {
            phi: particles.add_scalar("phi", 0.0),
            closest_point: particles.add_vector("closest_point", Vector::<D>::zeros()),
            normal: particles.add_vector("normal", Vector::<D>::zeros()),
            curvature: particles.add_scalar("curvature", 0.0),
            in_band: particles.add_flag("in_band", 0),
        }
    }

    /// Column name and particle of the first value that is not finite.
    #[must_use]
    pub fn find_broken<const D: usize>(&self, particles: &Particles<D>) -> Option<(&'static str, usize)> {
        let scalar = |key| particles.scalar(key).iter().position(|v| !v.is_finite());
        let vector = |key| particles.vector(key).iter().position(|v| v.iter().any(|c| !c.is_finite()));
        [
            ("phi", scalar(self.phi)),
            ("closest_point", vector(self.closest_point)),
            ("normal", vector(self.normal)),
            ("curvature", scalar(self.curvature)),
        ]
        .into_iter()
        .find_map(|(name, particle)| particle.map(|particle| (name, particle)))
    }

    /// Writes the closest point of particle `i`. The sign of the distance is that of the particle's `level` (PCP eq.
    /// 15).
    pub fn write<const D: usize>(
        &self,
        particles: &mut Particles<D>,
        level: ScalarKey,
        i: usize,
        closest: &ClosestPoint<D>,
    ) {
        let inside = particles.scalar(level)[i] < 0.0;
        particles.scalar_mut(self.phi)[i] = if inside { -closest.distance } else { closest.distance };
        particles.vector_mut(self.closest_point)[i] = closest.point;
        particles.vector_mut(self.normal)[i] = closest.normal;
        particles.scalar_mut(self.curvature)[i] = closest.curvature;
    }

    /// Writes the closest points of all particles within `half_band` of the surface, and marks these as the band.
    pub fn store<const D: usize>(
        &self,
        particles: &mut Particles<D>,
        level: ScalarKey,
        results: &ClosestPoints<D>,
        half_band: f64,
    ) {
        // A particle that leaves the band keeps its last normal. A stale normal separates branches better than none
        // (measured).
        particles.flag_mut(self.in_band).fill(0);
        for (i, closest) in results.iter().filter(|(_, a)| a.distance <= half_band) {
            particles.flag_mut(self.in_band)[i] = 1;
            self.write(particles, level, i, closest);
        }
    }
}
