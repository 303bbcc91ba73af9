//! Mean and Gauss curvature (Surface DC-PSE paper, section 4.3): from the shape tensor ∇_S n of exact normals, or from
//! the fitted heights where normals are not exact.

use super::cloud::SurfaceCloud;
use super::method::Wanted;
use super::problem::{Problem, Tools, Watched};
use crate::operators::{derivative_tensor, divergence, sum_of_minors};
use crate::schemes::measured_errors::against_exact;
use crate::simulation::state::check_length;
use crate::simulation::{ErrorEntry, Observables, RestoreError, State, StepError};
use crate::time::Clock;
use std::collections::BTreeMap;

/// Curvatures as computed.
#[derive(Debug, Default)]
pub struct Curvature {
    /// H = ∇·n/2 in space, κ = ∇·n in the plane.
    mean: Vec<f64>,
    gauss: Vec<f64>,
    of_heights: bool,
}

impl Curvature {
    /// Of so many points; `of_heights`: heights are fitted.
    #[must_use]
    pub fn new(rows: usize, of_heights: bool) -> Self {
        Self { mean: vec![0.0; rows], gauss: vec![0.0; rows], of_heights }
    }
}

/// The share of ∇·n that is called the mean curvature.
fn share(dimension: usize) -> f64 {
    1.0 / (dimension - 1) as f64
}

impl<const D: usize> Problem<D> for Curvature {
    fn wanted(&self) -> Vec<Wanted> {
        if self.of_heights { Vec::new() } else { (0..D).map(Wanted::Gradient).collect() }
    }

    fn step(&mut self, tools: Tools<'_, D>) -> Result<(), StepError> {
        let Tools { cloud, operators, phases, .. } = tools;
        if let Some(curvatures) = &operators.curvatures {
            for (i, [bend, gauss]) in curvatures.iter().enumerate() {
                (self.mean[i], self.gauss[i]) = (share(D) * bend, *gauss);
            }
            return Ok(());
        }
        phases.measure("operators/application", || {
            for (i, shape) in derivative_tensor(&operators.rows, &cloud.normals).iter().enumerate() {
                self.mean[i] = share(D) * divergence(shape);
                self.gauss[i] = if D == 3 { sum_of_minors(shape) } else { 0.0 };
            }
        });
        Ok(())
    }

    fn columns(&self, clock: Clock) -> Vec<(&'static str, Vec<f64>)> {
        let shown = |values: &[f64]| if clock.step == 0 { vec![f64::NAN; values.len()] } else { values.to_vec() };
        vec![("mean_curvature", shown(&self.mean)), ("gauss_curvature", shown(&self.gauss))]
    }

    fn watched(&self) -> Watched<'_> {
        [("mean_curvature", &self.mean), ("gauss_curvature", &self.gauss)]
    }

    fn errors(&self, cloud: &SurfaceCloud<D>, clock: Clock) -> Vec<ErrorEntry> {
        let is_unknown = cloud.curvatures.is_empty() || cloud.curvatures.iter().any(|kappa| kappa.is_nan());
        if clock.step == 0 || is_unknown {
            return Vec::new();
        }
        let exact: Vec<f64> = cloud.curvatures.iter().map(|kappa| share(D) * kappa).collect();
        let mut errors = against_exact("mean_curvature", &self.mean, &exact, clock.time, "exact at the points");
        if D == 3 {
            errors.extend(against_exact(
                "gauss_curvature",
                &self.gauss,
                &cloud.gauss,
                clock.time,
                "exact at the points",
            ));
        }
        errors
    }

    fn observables(&self, cloud: &SurfaceCloud<D>, clock: Clock) -> Observables {
        // Gauss and Bonnet: ∫ K is 2π times the Euler characteristic.
        let whole = if clock.step == 0 || cloud.areas.is_none() { f64::NAN } else { cloud.integral(&self.gauss) };
        let mean = self.mean.iter().sum::<f64>() / self.mean.len().max(1) as f64;
        vec![("curvature_mean", mean), ("gauss_integral", whole)]
    }

    fn save(&self, state: &mut State) {
        state.push_reals("mean_curvature", &self.mean);
        state.push_reals("gauss_curvature", &self.gauss);
    }

    fn load(&mut self, state: &State) -> Result<(), RestoreError> {
        let (mean, gauss) = (state.reals("mean_curvature")?, state.reals("gauss_curvature")?);
        check_length("mean_curvature", mean.len(), self.mean.len())?;
        check_length("gauss_curvature", gauss.len(), self.gauss.len())?;
        self.mean.copy_from_slice(mean);
        self.gauss.copy_from_slice(gauss);
        Ok(())
    }

    fn describe(&self, method: &mut BTreeMap<&'static str, String>) {
        let from = if self.of_heights { "heights fitted over the tangent planes" } else { "the shape tensor ∇_S n" };
        method.insert("curvature", format!("from {from}"));
    }
}
