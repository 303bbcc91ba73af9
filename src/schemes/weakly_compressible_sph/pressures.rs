//! Pressures of both fluids, and the jump between them.

use super::interface::Interface;
use super::smoothed_delta::smoothed_step;
use super::species::Species;
use super::system::SphSystem;
use crate::closest_point::enclosed_moments::EnclosedMoments;

/// Pressures of one state; NaN where there is nothing to measure.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pressures {
    /// Mean inside: by the equation of state, and with what the balanced force takes over.
    pub inside: f64,
    /// Particles of that mean.
    pub inside_count: f64,
    /// Mean outside.
    pub outside: f64,
    /// Jump by the equation of state alone.
    pub eos_jump: f64,
    /// Jump by the equation of state with the integral of what the balanced force takes over, across the interface.
    pub measured_jump: f64,
    /// The τκ₀ that the balanced force takes out of the pressure, as a mean over the interface.
    pub balanced: f64,
}

/// Where nothing lies deeper inside than the tension reaches: the part of the greatest depth beyond which particles count.
const DEEP_PART: f64 = 0.5;

impl<const D: usize> SphSystem<D> {
    /// Pressures of the present state.
    ///
    /// The mean pressures are those of particles farther from the interface than 2 ε. In drops so small or thin that there are
    /// none inside, those count that are deeper than half of the greatest depth, each with the share of τκ₀ that is taken
    /// over up to its place.
    ///
    /// The balanced force −τ(κ − κ₀) n δ leaves the part τκ₀ n δ out, which belongs to the pressure. Its integral across the
    /// interface, Σ τκ₀ V δ over the particles by the area of the interface as a quadrature on the fits finds it, is τκ₀ up to
    /// what the particles miss.
    pub(super) fn pressures(&self, moments: Option<&EnclosedMoments<D>>) -> Pressures {
        let far = 2.0 * self.config.smoothing_length;
        let [deep, outside] = [Species::Inside, Species::Outside].map(|species| self.mean_pressure(species, far));
        let inside = if deep.count > 0.0 { deep } else { self.mean_of_deepest() };
        let surface = moments.map_or(f64::NAN, |moments| moments.surface);
        let (absorbed, area) = self.absorbed_over_interface();
        let eos_jump = inside.equation_of_state - outside.equation_of_state;
        Pressures {
            inside: inside.whole,
            inside_count: inside.count,
            outside: outside.whole,
            eos_jump,
            measured_jump: if absorbed == 0.0 { eos_jump } else { eos_jump + absorbed / surface },
            balanced: absorbed / area,
        }
    }

    /// Whether a particle has a signed distance from the interface.
    fn is_near(&self, i: usize) -> bool {
        self.particles.flag(self.columns.in_band)[i] == 1
    }

    /// Mean over a fluid beyond a distance from the interface.
    fn mean_pressure(&self, species: Species, far: f64) -> MeanPressure {
        let phi = self.particles.scalar(self.columns.phi);
        let is_far = |i: &usize| self.flow.species[*i] == species && !(self.is_near(*i) && phi[*i].abs() <= far);
        let particles = (0..phi.len()).filter(is_far);
        MeanPressure::of(particles.map(|i| (self.flow.pressure[i], self.absorbed_pressure(i))))
    }

    /// Mean over the deepest particles inside, where none is far from the interface.
    fn mean_of_deepest(&self) -> MeanPressure {
        let (phi, width) = (self.particles.scalar(self.columns.phi), self.config.smoothing_length);
        let inside = (0..phi.len()).filter(|i| self.flow.species[*i] == Species::Inside && self.is_near(*i));
        let depth = inside.clone().map(|i| -phi[i]).fold(0.0, f64::max);
        let deepest = inside.filter(|i| -phi[*i] >= DEEP_PART * depth);
        MeanPressure::of(deepest.map(|i| {
            let share = smoothed_step(-phi[i], width);
            (self.flow.pressure[i], self.absorbed_pressure(i) * share)
        }))
    }

    /// Σ τκ₀ V δ and Σ V δ over the interface; NaN without a level set.
    fn absorbed_over_interface(&self) -> (f64, f64) {
        let (Interface::LevelSet(level_set), Some(tension)) = (&self.interface, self.tension()) else {
            return (f64::NAN, f64::NAN);
        };
        let phi = self.particles.scalar(self.columns.phi);
        let mut sums = (0.0, 0.0);
        for i in level_set.candidates().iter().copied().filter(|i| self.is_near(*i)) {
            let area = self.flow.volume[i] * tension.profile(phi[i]);
            sums.0 += self.absorbed_inside(i) * area;
            sums.1 += area;
        }
        sums
    }
}

/// Mean pressures over some particles; NaN over none.
#[derive(Debug, Clone, Copy)]
struct MeanPressure {
    count: f64,
    /// By the equation of state.
    equation_of_state: f64,
    /// With what the balanced force takes over.
    whole: f64,
}

impl MeanPressure {
    /// The mean of pressures by the equation of state, each with what is taken over.
    fn of(pressures: impl Iterator<Item = (f64, f64)>) -> Self {
        let mut sums = [0.0; 3];
        for (pressure, absorbed) in pressures {
            sums[0] += 1.0;
            sums[1] += pressure;
            sums[2] += pressure + absorbed;
        }
        let [count, pressure, whole] = sums;
        Self { count, equation_of_state: pressure / count, whole: whole / count }
    }
}
