//! The longest stable time step: each interaction answers for its own limit, for the fluid of each species.

use super::config::{Discretization, Integrator, SphConfig};
use super::interactions::TensionForce;
use super::interactions::pressure::SoundWaves;
use super::interactions::viscosity::ViscousDiffusion;
use super::interactions::{LimitContext, LimitsStep, StabilityNumbers};
use super::species::Species;
use super::surfactant;
use super::tension_law::TensionLaw;

pub use super::interactions::StepLimit;

/// Kick–drift–kick with sums over kernels: the largest numbers that were measured to hold. The paper's viscous number does not
/// (errata, PCP B.11).
const KICK_DRIFT_KICK: StabilityNumbers =
    StabilityNumbers { acoustic: 0.4, viscous: 0.06, capillary: 0.4, body_force: 0.25 };

/// The same with the balanced force, whose pair force is Hamiltonian and whose kernels are narrow: 1.2 holds and 1.6 does not (an ellipse at
/// 16 particles a radius, whose results at 0.4 and 0.8 agree to four digits).
const BALANCED: StabilityNumbers = StabilityNumbers { acoustic: 0.6, ..KICK_DRIFT_KICK };

/// Predictor–corrector with sums over kernels: the paper's numbers (PCP eq. B.11).
const PREDICTOR_CORRECTOR: StabilityNumbers =
    StabilityNumbers { acoustic: 0.25, viscous: 0.125, capillary: 0.25, body_force: 0.25 };

/// Either integrator with fits. Gradients by fits see shorter waves than sums over kernels: an acoustic number of 0.4 fails at
/// once, 0.17 holds (measured).
const FITS: StabilityNumbers = StabilityNumbers { acoustic: 0.17, viscous: 0.06, capillary: 0.25, body_force: 0.25 };

fn stability_numbers<const D: usize>(config: &SphConfig<D>) -> StabilityNumbers {
    let is_balanced = config.tension_force == TensionForce::Balanced && !config.is_density_integrated();
    match (config.discretization, config.integrator) {
        (Discretization::Dcpse(_), _) => FITS,
        (Discretization::Kernels, Integrator::KickDriftKick) if is_balanced => BALANCED,
        (Discretization::Kernels, Integrator::KickDriftKick) => KICK_DRIFT_KICK,
        (Discretization::Kernels, Integrator::PredictorCorrector) => PREDICTOR_CORRECTOR,
    }
}

/// The longest stable step at a largest speed: the shortest of the limits of all interactions.
#[must_use]
pub fn longest_step<const D: usize>(config: &SphConfig<D>, speed: f64) -> StepLimit {
    let fluids = Species::ALL.map(|species| config.fluids[species]);
    // A mean shear moves neighbors past each other.
    let support = config.kernel.support() * config.smoothing_length;
    let shear = config.mean_shear.map_or(0.0, |shear| shear.rate.abs() * support);
    let context = LimitContext {
        smoothing_length: config.smoothing_length,
        speed: speed + shear,
        least_viscosity: if config.has_whole_stress() { config.fluids.least_viscosity() } else { f64::INFINITY },
        numbers: stability_numbers(config),
    };
    let tension = config.surface_tension();
    let on_fluids: [&dyn LimitsStep; 3] = [&SoundWaves, &ViscousDiffusion, &tension];
    let of_fluids =
        fluids.iter().flat_map(|fluid| on_fluids.map(|interaction| interaction.step_limit(fluid, &context)));
    let of_force = config.body_force.as_ref().map(|force| force.step_limit(&fluids[0], &context));
    let of_law = config.tension_law.map(|law| match law {
        TensionLaw::Slope { largest, .. } => {
            let at_scene = fluids.map(|fluid| tension.step_limit(&fluid, &context));
            let [a, b] = at_scene.map(|limit| limit.length / largest.max(1.0).sqrt());
            StepLimit { length: a.min(b), cause: "capillary waves where the tension is largest" }
        }
        TensionLaw::Surfactant(surfactant) => {
            let length = surfactant::longest_step(surfactant.diffusivity, config.spacing);
            StepLimit { length, cause: "diffusion of the surfactant" }
        }
    });
    let none = StepLimit { length: f64::INFINITY, cause: "nothing" };
    of_fluids
        .chain(of_force)
        .chain(of_law)
        .fold(none, |least, limit| if limit.length < least.length { limit } else { least })
}

#[cfg(test)]
mod tests {
    use super::{Integrator, longest_step};
    use crate::geometry::Vector;
    use crate::schemes::weakly_compressible_sph::test_setting::setting;
    use crate::schemes::weakly_compressible_sph::{BodyForce, KernelChoice};

    #[test]
    fn limits_are_those_of_the_papers_and_the_measured_ones() {
        let mut config = setting::<2>(KernelChoice::WendlandC2, 1.0).config;
        config.tension = 0.0;
        let e = config.smoothing_length;
        assert!((longest_step(&config, 3.0).length - (0.4 * e / 23.0).min(0.06 * e * e / 0.4)).abs() < 1e-15);
        config.integrator = Integrator::PredictorCorrector;
        config.fluids.outside.viscosity = 1e-6;
        config.fluids.inside.viscosity = 1e-6;
        assert!((longest_step(&config, 3.0).length - 0.25 * e / 23.0).abs() < 1e-15);
        config.tension = 1e6;
        assert_eq!(longest_step(&config, 3.0).cause, "capillary waves");
        config.body_force = Some(BodyForce::Constant(Vector::<2>::new(1e12, 0.0)));
        assert_eq!(longest_step(&config, 3.0).cause, "the force from outside");
    }
}
