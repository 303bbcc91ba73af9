//! Mean and Gauss curvature (Surface DC-PSE, section 4.3): from the shape tensor ∇_S n of exact normals, or from
//! the fitted heights where normals are not exact.

use super::cloud::SurfaceCloud;
use super::format_1;
use super::method::Wanted;
use super::problem::{Problem, Tools, Watched};
use super::quantities::{CURVATURE_MEAN, GAUSS_INTEGRAL};
use crate::operators::{derivative_tensor, divergence, sum_of_minors};
use crate::schemes::measured_errors::against_exact;
use crate::simulation::quantity::quantities;
use crate::simulation::{ErrorEntry, LoadError, Observables, Quantity, Section, StepError};
use crate::time::Clock;
use std::collections::BTreeMap;

quantities! {
    /// Fields that frames show.
    FIELDS {
        MEAN_CURVATURE = "mean_curvature", "1/length", "Computed mean curvature; NaN before the first step.";
        GAUSS_CURVATURE = "gauss_curvature", "1/length^2", "Computed Gauss curvature; NaN before the first step.";
    }
}

/// Computed curvatures.
#[derive(Debug, Default)]
pub struct Curvature {
    /// H = ∇·n/2 in space, κ = ∇·n in the plane.
    mean: Vec<f64>,
    gauss: Vec<f64>,
    of_heights: bool,
}

impl Curvature {
    /// The fields that frames show, the surface's own excepted.
    #[must_use]
    pub fn shown_fields() -> Vec<&'static Quantity> {
        FIELDS.to_vec()
    }

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

    fn columns(&self) -> Vec<&'static Quantity> {
        Self::shown_fields()
    }

    fn column(&self, quantity: &Quantity, clock: Clock) -> Vec<f64> {
        let values = if *quantity == GAUSS_CURVATURE { &self.gauss } else { &self.mean };
        if clock.step == 0 { vec![f64::NAN; values.len()] } else { values.clone() }
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
        vec![(&CURVATURE_MEAN, cloud.mean(&self.mean)), (&GAUSS_INTEGRAL, whole)]
    }

    fn save(&self, section: &mut Section) {
        section.put_reals("mean_curvature", &self.mean);
        section.put_reals("gauss_curvature", &self.gauss);
    }

    fn load(&mut self, section: &Section) -> Result<(), LoadError> {
        let mean = section.reals_of("mean_curvature", self.mean.len())?;
        let gauss = section.reals_of("gauss_curvature", self.gauss.len())?;
        self.mean.copy_from_slice(mean);
        self.gauss.copy_from_slice(gauss);
        Ok(())
    }

    fn translate_format_1(&self, arrays: &Section) -> Result<Section, LoadError> {
        format_1::curvature(arrays)
    }

    fn describe(&self, method: &mut BTreeMap<&'static str, String>) {
        let from = if self.of_heights { "heights fitted over the tangent planes" } else { "the shape tensor ∇_S n" };
        method.insert("curvature", format!("from {from}"));
    }
}
