//! Steps in time (PCP section 4.3; kick–drift–kick after Verlet).

use super::parts::{DensityMethod, Integrator};
use super::system::{EvaluationError, SphSystem};
use crate::geometry::Vector;
use crate::simulation::Phases;

impl<const D: usize> SphSystem<D> {
    /// From `time` over a step, with the accelerations of `time` at hand, to the accelerations of its end. Returns how many
    /// droplets there are where that changed.
    pub(super) fn advance(
        &mut self,
        time: f64,
        step: f64,
        phases: &mut Phases,
    ) -> Result<Option<usize>, EvaluationError> {
        match self.parts.integrator {
            Integrator::KickDriftKick => self.kick_drift_kick(time, step, phases),
            Integrator::PredictorCorrector => self.predict_and_correct(time, step, phases),
        }
    }

    /// 1. Half a kick, a drift. 2. Forces there, viscous ones (and densities by continuity) with what a whole kick would
    ///    give. 3. Half a kick.
    fn kick_drift_kick(&mut self, time: f64, step: f64, phases: &mut Phases) -> Result<Option<usize>, EvaluationError> {
        let half = 0.5 * step;
        phases.measure("sph/advance", || {
            self.kick(half);
            let (velocity, domain) = (&self.velocity, &self.domain);
            for (x, u) in self.particles.positions_mut().iter_mut().zip(velocity) {
                *x = domain.wrap(*x + u * step);
            }
            for ((predicted, u), a) in self.predicted.iter_mut().zip(velocity).zip(&self.acceleration) {
                *predicted = u + a * half;
            }
            self.start.density.clone_from(&self.density);
            add_scaled(&mut self.density, half, &self.density_rate);
        });
        let changed = self.evaluate(time + step, true, phases)?;
        phases.measure("sph/advance", || {
            self.density_from_start();
            self.kick(half);
            self.derive_pressures();
        });
        Ok(changed)
    }

    /// 1. Half a step ahead with what is known. 2. Forces there. 3. The whole step with them. 4. Forces at its end, which the
    ///    next step starts from.
    fn predict_and_correct(
        &mut self,
        time: f64,
        step: f64,
        phases: &mut Phases,
    ) -> Result<Option<usize>, EvaluationError> {
        let half = 0.5 * step;
        phases.measure("sph/advance", || {
            self.start.positions.clone_from_slice(self.particles.positions());
            self.start.velocity.clone_from_slice(&self.velocity);
            self.start.density.clone_from(&self.density);
            self.drift_from_start(half, 0.0);
            self.kick(half);
            self.predicted.copy_from_slice(&self.velocity);
        });
        let first = self.evaluate(time + half, false, phases)?;
        phases.measure("sph/advance", || {
            self.drift_from_start(step, half);
            self.velocity.copy_from_slice(&self.start.velocity);
            self.density_from_start();
            self.kick(step);
            self.predicted.copy_from_slice(&self.velocity);
        });
        Ok(self.evaluate(time + step, true, phases)?.or(first))
    }

    /// u on by its rate, and ρ where it has one.
    fn kick(&mut self, step: f64) {
        for (u, a) in self.velocity.iter_mut().zip(&self.acceleration) {
            *u += a * step;
        }
        add_scaled(&mut self.density, step, &self.density_rate);
    }

    /// x = x₀ + Δt (u₀ + `ahead` a).
    fn drift_from_start(&mut self, step: f64, ahead: f64) {
        let Self { start, acceleration, domain, particles, .. } = self;
        let starts = start.positions.iter().zip(&start.velocity).zip(acceleration);
        for (x, ((x0, u0), a)) in particles.positions_mut().iter_mut().zip(starts) {
            *x = domain.wrap(x0 + (u0 + *a * ahead) * step);
        }
    }

    /// Densities by continuity back to where the step began; those by summation are found, not integrated.
    fn density_from_start(&mut self) {
        if self.parts.density != DensityMethod::Summation {
            self.density.clone_from(&self.start.density);
        }
    }
}

/// What a step starts from.
#[derive(Debug, Default)]
pub(super) struct Start<const D: usize> {
    pub positions: Vec<Vector<D>>,
    pub velocity: Vec<Vector<D>>,
    pub density: Vec<f64>,
}

fn add_scaled(values: &mut [f64], step: f64, rates: &[f64]) {
    for (value, rate) in values.iter_mut().zip(rates) {
        *value += rate * step;
    }
}
