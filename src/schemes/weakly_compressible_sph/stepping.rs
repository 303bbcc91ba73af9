//! Steps in time (PCP section 4.3; kick–drift–kick after Verlet).

use super::config::{Integrator, SphConfig};
use super::system::{EvaluationError, Instant, SphSystem};
use crate::geometry::Vector;
use crate::simulation::Phases;

/// The time integrator with its storage.
#[derive(Debug)]
pub(super) struct Stepper<const D: usize> {
    integrator: Integrator,
    is_density_integrated: bool,
    start: Start<D>,
}

/// The values that a step starts from.
#[derive(Debug)]
struct Start<const D: usize> {
    /// Of the predictor–corrector alone.
    positions: Vec<Vector<D>>,
    /// Of the predictor–corrector alone.
    velocity: Vec<Vector<D>>,
    density: Vec<f64>,
}

impl<const D: usize> Stepper<D> {
    pub fn new(config: &SphConfig<D>, count: usize) -> Self {
        let kept = if config.integrator == Integrator::PredictorCorrector { count } else { 0 };
        let zeros = || vec![Vector::<D>::zeros(); kept];
        Self {
            integrator: config.integrator,
            is_density_integrated: config.is_density_integrated(),
            start: Start { positions: zeros(), velocity: zeros(), density: Vec::new() },
        }
    }

    /// Advances the system from `time` by a step, from the rates at `time` to the rates at the end. Returns the number of
    /// droplets where it changed.
    pub fn advance(
        &mut self,
        system: &mut SphSystem<D>,
        time: f64,
        step: f64,
        phases: &mut Phases,
    ) -> Result<Option<usize>, EvaluationError> {
        match self.integrator {
            Integrator::KickDriftKick => self.kick_drift_kick(system, time, step, phases),
            Integrator::PredictorCorrector => self.predict_and_correct(system, time, step, phases),
        }
    }

    /// 1. Half a kick, a drift. 2. Forces there, viscous forces (and densities by continuity) with the velocities of a whole
    ///    kick. 3. Half a kick.
    fn kick_drift_kick(
        &mut self,
        system: &mut SphSystem<D>,
        time: f64,
        step: f64,
        phases: &mut Phases,
    ) -> Result<Option<usize>, EvaluationError> {
        let half = 0.5 * step;
        phases.measure("sph/advance", || {
            kick(system, half);
            system.slide_images(time + step);
            let (flow, domain, shear) = (&mut system.flow, &system.domain, &system.config.mean_shear);
            for (x, u) in system.particles.positions_mut().iter_mut().zip(&flow.velocity) {
                let way = shear.as_ref().map_or_else(|| u * step, |shear| shear.way(x, u, step));
                *x = domain.wrap(*x + way);
            }
            let kicked = flow.velocity.iter().zip(&system.rates.acceleration);
            for (predicted, (u, a)) in flow.predicted.iter_mut().zip(kicked) {
                *predicted = shear.as_ref().map_or_else(|| u + a * half, |shear| shear.kicked(u, a, half));
            }
            self.start.density.clone_from(&flow.density);
            add_scaled(&mut flow.density, half, &system.rates.density);
        });
        let changed = system.evaluate(Instant { time: time + step, elapsed: step, may_shift: true }, phases)?;
        phases.measure("sph/advance", || {
            self.density_from_start(system);
            kick(system, half);
            system.flow.derive_pressures();
        });
        Ok(changed)
    }

    /// 1. Half a step ahead with the present rates. 2. Rates there. 3. The whole step with them. 4. Rates at its end, which the
    ///    next step starts from.
    fn predict_and_correct(
        &mut self,
        system: &mut SphSystem<D>,
        time: f64,
        step: f64,
        phases: &mut Phases,
    ) -> Result<Option<usize>, EvaluationError> {
        let half = 0.5 * step;
        phases.measure("sph/advance", || {
            self.start.positions.clone_from_slice(system.particles.positions());
            self.start.velocity.clone_from_slice(&system.flow.velocity);
            self.start.density.clone_from(&system.flow.density);
            self.drift_from_start(system, half, 0.0);
            kick(system, half);
            predict_present(system);
        });
        let first = system.evaluate(Instant { time: time + half, elapsed: half, may_shift: false }, phases)?;
        phases.measure("sph/advance", || {
            self.drift_from_start(system, step, half);
            system.flow.velocity.copy_from_slice(&self.start.velocity);
            self.density_from_start(system);
            kick(system, step);
            predict_present(system);
        });
        Ok(system.evaluate(Instant { time: time + step, elapsed: half, may_shift: true }, phases)?.or(first))
    }

    /// x = x₀ + Δt (u₀ + `ahead` a).
    fn drift_from_start(&self, system: &mut SphSystem<D>, step: f64, ahead: f64) {
        let starts = self.start.positions.iter().zip(&self.start.velocity).zip(&system.rates.acceleration);
        for (x, ((x0, u0), a)) in system.particles.positions_mut().iter_mut().zip(starts) {
            *x = system.domain.wrap(x0 + (u0 + *a * ahead) * step);
        }
    }

    /// Sets integrated densities back to the start of the step; summed densities are found anew by the next evaluation.
    fn density_from_start(&self, system: &mut SphSystem<D>) {
        if self.is_density_integrated {
            system.flow.density.clone_from(&self.start.density);
        }
    }
}

/// Advances velocities, and integrated densities, by their rates.
fn kick<const D: usize>(system: &mut SphSystem<D>, step: f64) {
    let shear = &system.config.mean_shear;
    for (u, a) in system.flow.velocity.iter_mut().zip(&system.rates.acceleration) {
        *u = shear.as_ref().map_or_else(|| *u + a * step, |shear| shear.kicked(u, a, step));
    }
    add_scaled(&mut system.flow.density, step, &system.rates.density);
}

/// Takes the present velocities for the predicted ones.
fn predict_present<const D: usize>(system: &mut SphSystem<D>) {
    system.flow.predicted.copy_from_slice(&system.flow.velocity);
}

fn add_scaled(values: &mut [f64], step: f64, rates: &[f64]) {
    for (value, rate) in values.iter_mut().zip(rates) {
        *value += rate * step;
    }
}

#[cfg(test)]
mod tests {
    use super::{Instant, Stepper};
    use crate::geometry::Vector;
    use crate::parallel::Interrupt;
    use crate::schemes::weakly_compressible_sph::test_setting::setting;
    use crate::schemes::weakly_compressible_sph::{
        BodyForce, DensityMethod, Integrator, KernelChoice, SphConfig, SphSystem,
    };
    use crate::simulation::{CpuClock, Phases};

    #[test]
    fn in_free_fall_the_center_of_mass_moves_as_a_point_does() {
        let this = setting::<2>(KernelChoice::WendlandC2, 3.0);
        let gravity = Vector::<2>::new(0.5, -9.0);
        let (step, steps) = (1e-4, 6);
        for integrator in [Integrator::KickDriftKick, Integrator::PredictorCorrector] {
            for density in [DensityMethod::Summation, DensityMethod::Continuity { diffusion: 0.1 }] {
                let body_force = Some(BodyForce::Constant(gravity));
                let config = SphConfig { tension: 0.0, integrator, density, body_force, ..this.config.clone() };
                let mut stepper = Stepper::new(&config, this.positions.len());
                let drop = this.drop(1.0);
                let mut system =
                    SphSystem::new(config, this.domain.clone(), this.cell, drop, Interrupt::default()).unwrap();
                let mut phases = Phases::new(CpuClock::still());
                system.evaluate(Instant::default(), &mut phases).unwrap();
                for k in 0..steps {
                    stepper.advance(&mut system, f64::from(k) * step, step, &mut phases).unwrap();
                }
                let flow = &system.flow;
                let (mut mass, mut momentum, mut moved) = (0.0, Vector::<2>::zeros(), Vector::<2>::zeros());
                for (i, x) in system.particles.positions().iter().enumerate() {
                    mass += flow.mass(i);
                    momentum += flow.velocity[i] * flow.mass(i);
                    moved += this.domain.displacement(&this.positions[i], x) * flow.mass(i);
                }
                let time = step * f64::from(steps);
                // Both integrators are exact for a constant acceleration.
                assert!((momentum / mass - gravity * time).norm() < 1e-12, "{integrator:?}, {density:?}");
                assert!((moved / mass - gravity * (0.5 * time * time)).norm() < 1e-13, "{integrator:?}, {density:?}");
            }
        }
    }
}
