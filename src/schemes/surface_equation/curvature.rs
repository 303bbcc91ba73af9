//! Mean and Gauss curvature (Surface DC-PSE, section 4.3): from the shape tensor ∇_S n of exact normals, or from
//! the fitted heights where normals are not exact.

use super::cloud::SurfaceCloud;
use super::format_1;
use super::method::Wanted;
use super::problem::{Problem, Tools, Watched, watch};
use super::quantities::{CURVATURE_MEAN, GAUSS_INTEGRAL};
use super::shape_tensor::{self, ShapeTensor};
use super::triangle_curvature;
use crate::geometry::Vector;
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

quantities! {
    /// Fields that frames show of surfaces in space.
    SPACE_FIELDS {
        PRINCIPAL_1 = "principal_curvature_1", "1/length", "Larger principal curvature; NaN before the first step.";
        PRINCIPAL_2 = "principal_curvature_2", "1/length", "Smaller principal curvature; NaN before the first step.";
        DIRECTION_1 = "principal_direction_1", "", "Unit direction of the larger principal curvature, its largest component positive; NaN before the first step.";
        DIRECTION_2 = "principal_direction_2", "", "Unit direction of the smaller principal curvature, its largest component positive; NaN before the first step.";
        SHAPE_X = "shape_tensor_x", "1/length", "Row x of the shape tensor, the surface gradient of the normal; NaN before the first step.";
        SHAPE_Y = "shape_tensor_y", "1/length", "Row y of the shape tensor; NaN before the first step.";
        SHAPE_Z = "shape_tensor_z", "1/length", "Row z of the shape tensor; NaN before the first step.";
    }
}

/// The fields of vectors.
static VECTORS: [&Quantity; 5] = [&DIRECTION_1, &DIRECTION_2, &SHAPE_X, &SHAPE_Y, &SHAPE_Z];

/// Computed curvatures.
#[derive(Debug, Default)]
pub struct Curvature {
    /// H = ∇·n/2 in space, κ = ∇·n in the plane.
    mean: Vec<f64>,
    gauss: Vec<f64>,
    /// The shape tensor at each point in space; NaN before the first step.
    shapes: Vec<ShapeTensor>,
    of_heights: bool,
    /// Points whose mean and Gauss curvature come from triangles.
    from_triangles: u64,
}

impl Curvature {
    /// The fields that frames show of a surface in a space of this dimension, the surface's own excepted.
    #[must_use]
    pub fn shown_fields(dimension: usize) -> Vec<&'static Quantity> {
        let in_space = if dimension == 3 { SPACE_FIELDS } else { &[] };
        FIELDS.iter().chain(in_space).copied().collect()
    }

    /// Of so many points; `of_heights`: heights are fitted.
    #[must_use]
    pub fn new(rows: usize, of_heights: bool) -> Self {
        Self {
            mean: vec![0.0; rows],
            gauss: vec![0.0; rows],
            shapes: vec![[f64::NAN; 6]; rows],
            of_heights,
            from_triangles: 0,
        }
    }
}

impl Curvature {
    /// Mean and Gauss curvature from triangles. Where these are not all around a point, the Gauss curvature stays that of a fit. What
    /// the mean curvature normal lacks there lies along the surface, so that its part along the normal holds.
    fn take_triangles<const D: usize>(&mut self, cloud: &SurfaceCloud<D>) {
        let found = triangle_curvature::curvatures(&cloud.points, &cloud.triangles);
        self.from_triangles = found.iter().filter(|found| found.bend.is_some()).count() as u64;
        for (i, found) in found.iter().enumerate() {
            self.mean[i] = found.bend.map_or(self.mean[i], |bend| share(D) * bend);
            self.gauss[i] = found.gauss.unwrap_or(self.gauss[i]);
        }
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
            self.shapes.clone_from(&operators.shapes);
            if operators.is_lowered {
                self.take_triangles(cloud);
            }
            return Ok(());
        }
        phases.measure("operators/application", || {
            for (i, shape) in derivative_tensor(&operators.rows, &cloud.normals).iter().enumerate() {
                self.mean[i] = share(D) * divergence(shape);
                self.gauss[i] = if D == 3 { sum_of_minors(shape) } else { 0.0 };
                self.shapes[i] = shape_tensor::from_derivatives(shape);
            }
        });
        Ok(())
    }

    fn columns(&self) -> Vec<&'static Quantity> {
        let mut columns = Self::shown_fields(D);
        columns.retain(|quantity| !VECTORS.contains(quantity));
        columns
    }

    fn vector_columns(&self) -> Vec<&'static Quantity> {
        if D == 3 { VECTORS.to_vec() } else { Vec::new() }
    }

    fn vector_column(&self, quantity: &Quantity, cloud: &SurfaceCloud<D>) -> Vec<Vector<D>> {
        let at = |(shape, n): (&ShapeTensor, &Vector<D>)| {
            let n = Vector::<3>::from_fn(|d, _| n[d % D]);
            let found = match VECTORS.iter().position(|vector| *vector == quantity) {
                Some(place @ 0..=1) if shape[0].is_finite() => shape_tensor::principal(shape, &n)[place].1,
                Some(place @ 2..) => shape_tensor::row(shape, place - 2),
                _ => Vector::<3>::repeat(f64::NAN),
            };
            Vector::<D>::from_fn(|d, _| found[d])
        };
        self.shapes.iter().zip(&cloud.normals).map(at).collect()
    }

    fn column(&self, quantity: &Quantity, clock: Clock) -> Vec<f64> {
        if let Some(sign) = [(&PRINCIPAL_1, 1.0), (&PRINCIPAL_2, -1.0)].iter().find(|(known, _)| *known == quantity) {
            // Roots of k² − 2 H k + K; rounding must not make them complex.
            let root = |(h, k): (&f64, &f64)| h + sign.1 * (h * h - k).max(0.0).sqrt();
            let values = self.mean.iter().zip(&self.gauss).map(root);
            return if clock.step == 0 { vec![f64::NAN; self.mean.len()] } else { values.collect() };
        }
        let values = if *quantity == GAUSS_CURVATURE { &self.gauss } else { &self.mean };
        if clock.step == 0 { vec![f64::NAN; values.len()] } else { values.clone() }
    }

    fn watched(&self) -> Watched<'_> {
        watch([("mean_curvature", &self.mean), ("gauss_curvature", &self.gauss)])
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
        if self.from_triangles > 0 {
            section.put_count("from_triangles", self.from_triangles);
        }
        if self.shapes.iter().all(|shape| shape[0].is_finite()) {
            section.put_reals("shape_tensor", self.shapes.as_flattened());
        }
    }

    fn load(&mut self, section: &Section) -> Result<(), LoadError> {
        let mean = section.reals_of("mean_curvature", self.mean.len())?;
        let gauss = section.reals_of("gauss_curvature", self.gauss.len())?;
        // There is none before the step, and in checkpoints of earlier versions.
        let shapes =
            if section.has("shape_tensor") { section.reals_of("shape_tensor", 6 * self.mean.len())? } else { &[] };
        let is_known = section.has("from_triangles");
        self.from_triangles = if is_known { section.count("from_triangles")? } else { 0 };
        for (to, from) in self.shapes.iter_mut().zip(shapes.as_chunks::<6>().0) {
            *to = *from;
        }
        self.mean.copy_from_slice(mean);
        self.gauss.copy_from_slice(gauss);
        Ok(())
    }

    fn translate_format_1(&self, arrays: &Section) -> Result<Section, LoadError> {
        format_1::curvature(arrays)
    }

    fn describe(&self, method: &mut BTreeMap<&'static str, String>) {
        let from = if self.of_heights { "heights fitted over the tangent planes" } else { "the shape tensor ∇_S n" };
        let triangles = match self.from_triangles {
            0 => String::new(),
            count => format!("; mean and Gauss curvature of {count} points from triangles"),
        };
        method.insert("curvature", format!("from {from}{triangles}"));
    }
}
