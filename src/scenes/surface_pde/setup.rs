//! From parameters to points and an operator.

use super::parameters::Written;
use super::surfaces;
use crate::geometry::Vector;
use crate::geometry::surfaces::Ellipsoid;
use crate::operators::Support;
use crate::scene::cloud::CloudSizes;
use crate::scene::work::PhaseWork;
use crate::scene::{BuildContext, Estimate, Scene, Understood, Violation};
use crate::scenes::work_estimate;
use crate::schemes::surface_equation::{ExactField, PointwiseOperator, PointwiseParts};
use crate::simulation::{OutputPlan, Simulation};
use serde_json::{Value, json};

struct SurfaceScene {
    resolved: Value,
    surface: Ellipsoid<3>,
    count: u64,
    parts: PointwiseParts,
    cutoff_dn: f64,
}

/// Degree and r_c/δn of an order: the smallest support that holds twice as many neighbours as there are functions, about; larger
/// ones have larger errors (measured on plane waves).
fn support(order: u64) -> Option<(usize, f64)> {
    match order {
        2 => Some((3, 2.4)),
        4 => Some((5, 3.3)),
        6 => Some((7, 4.2)),
        _ => None,
    }
}

pub(super) fn understand(parameters: &Value) -> Understood {
    let written: Written = serde_json::from_value(parameters.clone())
        .map_err(|error| vec![Violation::new("", "type", error.to_string(), parameters, Value::Null)])?;
    let mut violations = Vec::new();
    let mut resolved = parameters.clone();
    let numbers = |value: &Value| Vector::<3>::from_fn(|d, _| value[d].as_f64().unwrap_or(f64::NAN));
    let mut in_space = |value: &Value, pointer: &str| {
        if value.as_array().map_or(0, Vec::len) != 3 {
            violations.push(Violation::new(pointer, "range", "a vector in space has three numbers", value, json!(3)));
        }
        numbers(value)
    };
    let is_sphere = written.surface["type"] == "sphere";
    let semi_axes = if is_sphere {
        Vector::<3>::repeat(written.surface["radius"].as_f64().unwrap_or(1.0))
    } else {
        in_space(&written.surface["semi_axes"], "/surface/semi_axes")
    };
    let field = &written.problem.field;
    let field = if field["type"] == "plane_wave" {
        ExactField::PlaneWave { k: in_space(&field["k"], "/problem/field/k") }
    } else {
        let (l, m) = (field["l"].as_u64().unwrap_or(4) as u32, field["m"].as_f64().unwrap_or(0.0));
        if m.abs() > f64::from(l) || m.fract() != 0.0 {
            let detail = format!("the order is a whole number from −{l} to {l}");
            violations.push(Violation::new("/problem/field/m", "range", detail, &json!(m), json!([-f64::from(l), l])));
        }
        if !is_sphere {
            let detail = "spherical harmonics belong to a sphere";
            violations.push(Violation::new("/problem/field", "conflict", detail, field, json!(["plane_wave"])));
        }
        ExactField::SphericalHarmonic { l, m: m as i32 }
    };
    let Some((degree, default_cutoff)) = support(written.method.order) else {
        let (got, allowed) = (json!(written.method.order), json!([2, 4, 6]));
        violations.push(Violation::new("/method/order", "range", "orders are 2, 4 and 6", &got, allowed));
        return Err(violations);
    };
    if !violations.is_empty() {
        return Err(violations);
    }
    let surface = Ellipsoid { center: Vector::<3>::zeros(), semi_axes };
    let cutoff_dn = written.method.cutoff_dn.unwrap_or(default_cutoff);
    let terms = ((degree + 1) * (degree + 2) / 2 - 1) as f64;
    if let ExactField::PlaneWave { k } = field
        && !(1e-6..1e6).contains(&(k.norm() * surface.semi_axes.max()))
    {
        let detail = "by the size of the surface a wave must have a length that numbers can tell";
        violations.push(Violation::new("/problem/field/k", "range", detail, &written.problem.field["k"], Value::Null));
    }
    // Only points whose normals differ by less than 60° count: a quarter of a sphere, less where it is flat.
    let least_count = (8.0 * terms).ceil();
    if (written.count as f64) < least_count {
        let detail = format!("a fit of {terms} functions wants {least_count} points at least on a closed surface");
        violations.push(Violation::new(
            "/count",
            "range",
            detail,
            &json!(written.count),
            json!({"least": least_count}),
        ));
    }
    let least_cutoff = (1.2 * terms / std::f64::consts::PI).sqrt();
    if cutoff_dn < least_cutoff {
        let detail = format!("a support must hold the neighbours that a fit of {terms} functions needs");
        let allowed = json!({"least": least_cutoff});
        violations.push(Violation::new("/method/cutoff_dn", "range", detail, &json!(cutoff_dn), allowed));
    }
    if !violations.is_empty() {
        return Err(violations);
    }
    resolved["method"]["cutoff_dn"] = json!(cutoff_dn);
    let support = Support { degree, radius: cutoff_dn * surfaces::spacing(&surface, written.count) };
    let parts = PointwiseParts { field, support, repeats: written.repeat };
    Ok(Box::new(SurfaceScene { resolved, surface, count: written.count, parts, cutoff_dn }))
}

impl SurfaceScene {
    /// Neighbours of a point, about.
    fn neighbors(&self) -> f64 {
        std::f64::consts::PI * self.cutoff_dn * self.cutoff_dn
    }
}

impl Scene for SurfaceScene {
    fn resolved(&self) -> Value {
        self.resolved.clone()
    }

    fn field_names(&self) -> Vec<&'static str> {
        vec!["field", "value", "reference", "normal", "curvature", "particle_id"]
    }

    fn estimate(&self, _sizes: &CloudSizes) -> Estimate {
        // Points, normals, four columns; entries once in the rows of the tasks and once in those of the operator.
        let a_point = 150.0 + 2.4 * 12.0 * (self.neighbors() + 1.0);
        Estimate {
            particles: self.count,
            steps: self.parts.repeats,
            time_step: 1.0,
            end_time: self.parts.repeats as f64,
            memory_bytes: (a_point * self.count as f64) as u64,
        }
    }

    fn family(&self) -> String {
        format!("surface_pde/3/intrinsic/{}", self.parts.support.degree)
    }

    fn work(&self, estimate: &Estimate, plan: &OutputPlan) -> Vec<PhaseWork> {
        let Estimate { particles, steps, end_time, .. } = *estimate;
        let points = particles as f64;
        let terms = ((self.parts.support.degree + 1) * (self.parts.support.degree + 2) / 2 - 1) as f64;
        let fit = self.neighbors() * (20.0 + 0.25 * terms * terms) + 0.02 * terms.powi(3);
        let mut work = vec![
            PhaseWork::at_moments("operators/construction", points * fit),
            PhaseWork::every_step("operators/application", points * self.neighbors() * steps as f64),
        ];
        work.extend(work_estimate::around(points, steps, end_time, plan));
        work
    }

    fn build(&self, context: BuildContext) -> Result<Box<dyn Simulation>, Vec<Violation>> {
        let points = surfaces::points(&self.surface, self.count as usize);
        Ok(Box::new(PointwiseOperator::new(points, self.parts, context.interrupt, context.cpu_clock)))
    }
}
