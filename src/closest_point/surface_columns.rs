//! What particles know of the surface: the signed distance, closest point, normal and curvature, and who is in the
//! narrow band (PCP paper, sections 3.3 and 3.4).

use super::queries::ClosestPoints;
use super::redistancing::ClosestPoint;
use crate::geometry::Vector;
use crate::particles::{FlagKey, Particles, ScalarKey, VectorKey};

/// The keys of the columns that redistancing writes.
#[derive(Debug, Clone, Copy)]
pub struct SurfaceColumns {
    /// Signed distance; meaningful in the band alone.
    pub phi: ScalarKey,
    /// Closest point of the surface.
    pub closest_point: VectorKey,
    /// Outward normal at the closest point.
    pub normal: VectorKey,
    /// Curvature at the closest point.
    pub curvature: ScalarKey,
    /// 1 within the narrow band.
    pub in_band: FlagKey,
}

impl SurfaceColumns {
    /// Adds the columns; nobody is in the band yet.
    pub fn add<const D: usize>(particles: &mut Particles<D>) -> Self {
        Self {
            phi: particles.add_scalar("phi", 0.0),
            closest_point: particles.add_vector("closest_point", Vector::<D>::zeros()),
            normal: particles.add_vector("normal", Vector::<D>::zeros()),
            curvature: particles.add_scalar("curvature", 0.0),
            in_band: particles.add_flag("in_band", 0),
        }
    }

    /// The first value that is no number: its column and particle.
    #[must_use]
    pub fn find_broken<const D: usize>(&self, particles: &Particles<D>) -> Option<(&'static str, usize)> {
        let number = |key| particles.scalar(key).iter().position(|v| !v.is_finite());
        let arrow = |key| particles.vector(key).iter().position(|v| v.iter().any(|c| !c.is_finite()));
        [
            ("phi", number(self.phi)),
            ("closest_point", arrow(self.closest_point)),
            ("normal", arrow(self.normal)),
            ("curvature", number(self.curvature)),
        ]
        .into_iter()
        .find_map(|(name, place)| place.map(|particle| (name, particle)))
    }

    /// Writes the answer for one particle; the sign is that of the level before (PCP eq. 15).
    pub fn write<const D: usize>(
        &self,
        particles: &mut Particles<D>,
        level: ScalarKey,
        i: usize,
        answer: &ClosestPoint<D>,
    ) {
        let inside = particles.scalar(level)[i] < 0.0;
        particles.scalar_mut(self.phi)[i] = if inside { -answer.distance } else { answer.distance };
        particles.vector_mut(self.closest_point)[i] = answer.point;
        particles.vector_mut(self.normal)[i] = answer.normal;
        particles.scalar_mut(self.curvature)[i] = answer.curvature;
    }

    /// Writes answers and who is in the band by them.
    pub fn store<const D: usize>(
        &self,
        particles: &mut Particles<D>,
        level: ScalarKey,
        answers: &ClosestPoints<D>,
        half_band: f64,
    ) {
        // Who leaves the band keeps its last normal: an old one still tells branches apart better than none (measured).
        particles.flag_mut(self.in_band).fill(0);
        for (i, answer) in answers.iter().filter(|(_, a)| a.distance <= half_band) {
            particles.flag_mut(self.in_band)[i] = 1;
            self.write(particles, level, i, answer);
        }
    }
}
