//! How far a surface and its answers can be trusted: counts of one redistancing, and what they contradict.

use super::detection::Side;
use super::level_surface::LevelSurface;
use super::queries::ClosestPoints;
use crate::geometry::Vector;
use rayon::prelude::{IntoParallelRefIterator, ParallelIterator};

/// Counts of one redistancing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Coverage {
    /// Particles next to the surface.
    pub near: u64,
    /// Of these, particles without a sample: no fit was found, or its zero was not reached.
    pub lost: u64,
    /// Points that were asked about.
    pub asked: u64,
    /// Of these, points whose answer is the nearest sample itself, since no closest point was found.
    pub by_sample: u64,
    /// Of these, points without a sample within the cutoff.
    pub out_of_reach: u64,
}

impl Coverage {
    /// The counts of a surface and of the answers about `asked` points.
    #[must_use]
    pub fn new<const D: usize>(surface: &LevelSurface<D>, answers: &ClosestPoints<D>, asked: usize) -> Self {
        let (mut answered, mut by_sample) = (0, 0);
        for (_, answer) in answers.iter() {
            answered += 1;
            by_sample += u64::from(answer.is_sample);
        }
        let near = surface.near().len() as u64;
        let lost = near - surface.fitted_count() as u64;
        Self { near, lost, asked: asked as u64, by_sample, out_of_reach: asked as u64 - answered }
    }

    /// Share of the particles next to the surface that have no sample.
    #[must_use]
    pub fn lost_share(&self) -> f64 {
        self.lost as f64 / self.near.max(1) as f64
    }

    /// Share of the points whose answer is the nearest sample itself, or that have none.
    #[must_use]
    pub fn unreached_share(&self) -> f64 {
        (self.by_sample + self.out_of_reach) as f64 / self.asked.max(1) as f64
    }
}

/// Crossings of the surface between particles next to it, against the distances that were found.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Crossings {
    /// Particles with a level of exactly zero.
    pub zeros: u64,
    /// Of these, particles that do not have a particle of either side within ξ: the level touches zero there, or is zero
    /// over a whole layer.
    pub one_sided: u64,
    /// Particles next to the surface.
    pub near: u64,
    /// Of these, particles without another one of their side within ξ: the surface about them is smaller than a spacing.
    pub lone: u64,
    /// Largest length by which the distance of a particle exceeds that to a particle of another side, in spacings.
    ///
    /// The surface passes between the two, so that the exact distance is never longer. A missed face shows here with the
    /// distance by which it was missed.
    pub missed: f64,
}

impl Crossings {
    fn merged(self, other: Self) -> Self {
        let (zeros, one_sided) = (self.zeros + other.zeros, self.one_sided + other.one_sided);
        let (near, lone) = (self.near + other.near, self.lone + other.lone);
        Self { zeros, one_sided, near, lone, missed: self.missed.max(other.missed) }
    }

    /// Share of the particles on the surface without a particle of either side.
    #[must_use]
    pub fn one_sided_share(&self) -> f64 {
        self.one_sided as f64 / self.zeros.max(1) as f64
    }

    /// Share of the particles next to the surface that are alone on their side of it.
    #[must_use]
    pub fn lone_share(&self) -> f64 {
        self.lone as f64 / self.near.max(1) as f64
    }
}

impl<const D: usize> LevelSurface<D> {
    /// Compares the distances of particles next to the surface with their crossings; None for fits in initial positions.
    ///
    /// - `positions`: the particles of the last rebuild.
    /// - `distance`: distance of a particle from the surface, without sign.
    #[must_use]
    pub fn crossings(
        &self,
        positions: &[Vector<D>],
        distance: impl Fn(usize) -> Option<f64> + Sync,
    ) -> Option<Crossings> {
        let sides = self.sides()?;
        let sums = self.near().par_iter().map(|i| {
            let side = sides[*i];
            let (mut nearest, mut has) = (f64::INFINITY, [side == Side::Inside, side == Side::Outside]);
            let mut is_lone = true;
            self.for_each_near_neighbor(*i, positions, |j, r2| {
                let other = sides[j];
                is_lone &= j == *i || side.is_apart_from(other);
                has[0] |= other == Side::Inside;
                has[1] |= other == Side::Outside;
                if side.is_apart_from(other) {
                    nearest = nearest.min(r2);
                }
            });
            let is_on = side == Side::On;
            let longest = if is_on { 0.0 } else { nearest.sqrt() };
            // A particle without an answer is counted as out of reach.
            let missed = distance(*i).map_or(0.0, |distance| (distance - longest) / self.spacing_at(*i));
            Crossings {
                zeros: u64::from(is_on),
                one_sided: u64::from(is_on && has != [true; 2]),
                near: 1,
                lone: u64::from(is_lone && !is_on),
                missed: missed.max(0.0),
            }
        });
        // Sums of whole numbers and a maximum do not depend on the order of their terms.
        let mut crossings = sums.reduce(Crossings::default, Crossings::merged);
        // Particles on the surface that are not next to another side are surrounded by zeros.
        let zeros = sides.iter().filter(|side| **side == Side::On).count() as u64;
        crossings.one_sided += zeros - crossings.zeros;
        crossings.zeros = zeros;
        Some(crossings)
    }
}
