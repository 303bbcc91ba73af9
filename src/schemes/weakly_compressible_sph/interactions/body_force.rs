//! Body forces: accelerations from outside.

use super::{LimitContext, LimitsStep, Moment, ParticleForce, StepLimit};
use crate::formulas::{BLOCK, Bound, Input};
use crate::geometry::Vector;
use crate::schemes::weakly_compressible_sph::fluids::Fluid;
use crate::schemes::weakly_compressible_sph::species::{Fluids, Species};
use rayon::prelude::{IndexedParallelIterator, ParallelIterator, ParallelSlice, ParallelSliceMut};
use std::f64::consts::PI;
use std::sync::Arc;

/// A force from outside.
#[derive(Debug, Clone, PartialEq)]
pub enum BodyForce<const D: usize> {
    /// The same acceleration of every particle.
    Constant(Vector<D>),
    /// An acceleration g of which the mean force is taken out, (1 − ρ̄/ρ) g with the mean density ρ̄ of the box: buoyancy in a
    /// box without walls. As given, before ρ̄ is known.
    WithoutMean(Vector<D>),
    /// An acceleration for each species.
    BySpecies {
        /// The acceleration g of which the mean force was taken out.
        whole: Vector<D>,
        /// Of the fluid inside.
        inside: Vector<D>,
        /// Of the fluid outside.
        outside: Vector<D>,
    },
    /// An acceleration along x of the fluid inside, F sin(π t/T) sin(π x/A) cos(π y/2B), in space times cos(π z/2C)
    /// (PCP eqs. 29, 30).
    Pulse {
        /// The strength F.
        coefficient: f64,
        /// The duration T; the force is zero afterwards.
        duration: f64,
        /// The lengths A, B and, in space, C.
        lengths: Vector<D>,
    },
    /// An acceleration by formulas of a user.
    Formula(Arc<FormulaForce>),
}

/// Accelerations by formulas of the place, of the species and of time.
#[derive(Debug, Clone, PartialEq)]
pub struct FormulaForce {
    acceleration: Bound,
    strength: f64,
}

impl FormulaForce {
    /// Formulas of x, y, (z,) inside and t, and the largest acceleration that is expected.
    #[must_use]
    pub fn new(acceleration: Bound, strength: f64) -> Self {
        Self { acceleration, strength }
    }

    fn at<const D: usize>(&self, x: &Vector<D>, time: f64, species: Species) -> Vector<D> {
        Vector::<D>::from_column_slice(&self.acceleration.at(&Self::place(x, time, species)))
    }

    fn place<const D: usize>(x: &Vector<D>, time: f64, species: Species) -> Vec<f64> {
        x.iter().copied().chain([f64::from(u8::from(species == Species::Inside)), time]).collect()
    }

    /// Adds the accelerations of all particles.
    fn add<const D: usize>(
        &self,
        acceleration: &mut [Vector<D>],
        positions: &[Vector<D>],
        species: &[Species],
        time: f64,
    ) {
        let blocks = acceleration.par_chunks_mut(BLOCK).zip(positions.par_chunks(BLOCK)).zip(species.par_chunks(BLOCK));
        blocks.for_each(|((acceleration, positions), species)| {
            let mut columns = [[0.0; BLOCK]; 4];
            for (i, (x, species)) in positions.iter().zip(species).enumerate() {
                for d in 0..D {
                    columns[d][i] = x[d];
                }
                columns[D][i] = f64::from(u8::from(*species == Species::Inside));
            }
            let count = positions.len();
            let inputs: [Input<'_>; 5] =
                std::array::from_fn(
                    |k| {
                        if k <= D { Input::Column(&columns[k][..count]) } else { Input::Uniform(time) }
                    },
                );
            self.acceleration.block(&inputs[..D + 2], count, |d, i, value| acceleration[i][d] += value);
        });
    }
}

impl<const D: usize> BodyForce<D> {
    /// The acceleration of a particle.
    #[must_use]
    pub fn acceleration(&self, x: &Vector<D>, time: f64, species: Species) -> Vector<D> {
        match self {
            Self::Constant(acceleration) | Self::WithoutMean(acceleration) => *acceleration,
            Self::BySpecies { inside, outside, .. } => match species {
                Species::Inside => *inside,
                Species::Outside => *outside,
            },
            Self::Pulse { coefficient, duration, lengths } => {
                let mut acceleration = Vector::<D>::zeros();
                if species == Species::Inside && time < *duration {
                    let across: f64 = (1..D).map(|d| (0.5 * PI * x[d] / lengths[d]).cos()).product();
                    let along = (PI * x[0] / lengths[0]).sin();
                    acceleration[0] = coefficient * (PI * time / duration).sin() * along * across;
                }
                acceleration
            }
            Self::Formula(force) => force.at(x, time, species),
        }
    }

    /// Why the force has no value for a particle, where a formula has none.
    #[must_use]
    pub fn fault(&self, x: &Vector<D>, time: f64, species: Species) -> Option<String> {
        let Self::Formula(force) = self else { return None };
        force
            .acceleration
            .fault(&FormulaForce::place(x, time, species))
            .map(|fault| format!("{fault} (the body force)"))
    }

    /// The same force in a box of a mean density, where its mean is to be taken out.
    #[must_use]
    pub fn without_mean(self, mean_density: f64, fluids: &Fluids) -> Self {
        let Self::WithoutMean(acceleration) = self else { return self };
        let share = |species: Species| acceleration * (1.0 - mean_density / fluids[species].density);
        Self::BySpecies { whole: acceleration, inside: share(Species::Inside), outside: share(Species::Outside) }
    }

    /// Direction of a constant acceleration.
    #[must_use]
    pub fn constant_direction(&self) -> Option<Vector<D>> {
        match self {
            Self::Constant(whole) | Self::WithoutMean(whole) | Self::BySpecies { whole, .. } => {
                whole.try_normalize(0.0)
            }
            Self::Pulse { .. } | Self::Formula(_) => None,
        }
    }

    /// Size g of a constant acceleration, whether or not its mean force is taken out; 0 of other forces.
    #[must_use]
    pub fn constant_strength(&self) -> f64 {
        match self {
            Self::Constant(whole) | Self::WithoutMean(whole) | Self::BySpecies { whole, .. } => whole.norm(),
            Self::Pulse { .. } | Self::Formula(_) => 0.0,
        }
    }

    /// The largest acceleration.
    #[must_use]
    pub fn strength(&self) -> f64 {
        match self {
            Self::Constant(acceleration) | Self::WithoutMean(acceleration) => acceleration.norm(),
            Self::BySpecies { inside, outside, .. } => inside.norm().max(outside.norm()),
            Self::Pulse { coefficient, .. } => coefficient.abs(),
            Self::Formula(force) => force.strength,
        }
    }
}

impl<const D: usize> ParticleForce<D> for BodyForce<D> {
    fn add_to(&self, acceleration: &mut [Vector<D>], moment: &Moment<'_, D>) {
        if let Self::Formula(force) = self {
            force.add(acceleration, moment.particles.positions(), &moment.flow.species, moment.time);
            return;
        }
        let particles = moment.particles.positions().iter().zip(&moment.flow.species);
        for (acceleration, (x, species)) in acceleration.iter_mut().zip(particles) {
            *acceleration += self.acceleration(x, moment.time, *species);
        }
    }
}

impl<const D: usize> LimitsStep for BodyForce<D> {
    /// A factor of √(ε/a).
    fn step_limit(&self, _fluid: &Fluid, context: &LimitContext) -> StepLimit {
        let length = context.numbers.body_force * (context.smoothing_length / self.strength()).sqrt();
        StepLimit { length, cause: "the force from outside" }
    }
}

#[cfg(test)]
mod tests {
    use super::{BodyForce, Species, Vector};

    #[test]
    fn a_pulse_drives_the_halves_of_the_inside_apart_until_it_ends() {
        let pulse = BodyForce::<2>::Pulse { coefficient: 4.0, duration: 0.5, lengths: Vector::<2>::new(1.0, 1.0) };
        let at = |x: f64, time, species| pulse.acceleration(&Vector::<2>::new(x, 0.0), time, species)[0];
        assert!((at(0.5, 0.25, Species::Inside) - pulse.strength()).abs() < 1e-14);
        assert_eq!(at(-0.5, 0.25, Species::Inside), -at(0.5, 0.25, Species::Inside));
        assert_eq!(at(0.5, 0.25, Species::Outside), 0.0);
        assert_eq!(at(0.5, 0.5, Species::Inside), 0.0);
    }

    #[test]
    fn a_constant_force_is_the_same_for_all_species() {
        let gravity = BodyForce::<3>::Constant(Vector::<3>::new(0.0, 3.0, -4.0));
        let x = Vector::<3>::new(0.1, 0.2, 0.3);
        assert_eq!(gravity.strength(), 5.0);
        for species in Species::ALL {
            assert_eq!(gravity.acceleration(&x, 1.0, species), Vector::<3>::new(0.0, 3.0, -4.0));
        }
    }
}
