//! From parameters to resting particles.

use super::parameters::Written;
use crate::closest_point::PcpMethod;
use crate::geometry::lattice::Lattice;
use crate::geometry::{Surface, Vector};
use crate::scene::cloud::{self, CloudReference, CloudSizes};
use crate::scene::work::{Course, PhaseWork};
use crate::scene::{BuildContext, Estimate, Scene, Understood, Violation};
use crate::scenes::particle_estimate::{band_particles, check_extent, memory_bytes};
use crate::scenes::{pcp_parameters, shapes, work_estimate};
use crate::schemes::static_redistancing::{
    InitialLevel, RemeshingKernel, StaticParts, StaticRedistancing, StaticSystem, grid_method,
};
use crate::simulation::{OutputPlan, Simulation};
use serde_json::{Value, json};
use std::collections::BTreeMap;

struct RedistanceScene<const D: usize> {
    resolved: Value,
    shape: Value,
    lattice: Lattice,
    method: PcpMethod,
    remeshing: Option<RemeshingKernel>,
    initial: InitialLevel<D>,
    half_band: f64,
    repeats: u64,
    clouds: Vec<CloudReference>,
}

pub(super) fn understand(parameters: &Value) -> Understood {
    let written: Written = serde_json::from_value(parameters.clone())
        .map_err(|error| vec![Violation::new("", "type", error.to_string(), parameters, Value::Null)])?;
    let implied = written.shape.as_ref().and_then(shapes::implied_dimension);
    match written.dimension.or(implied).unwrap_or(2) {
        3 => scene::<3>(&written, parameters.clone()),
        _ => scene::<2>(&written, parameters.clone()),
    }
}

fn scene<const D: usize>(written: &Written, mut resolved: Value) -> Understood {
    let mut violations = Vec::new();
    let default_shape = if D == 2 {
        json!({"type": "ellipse", "center": null, "semi_axes": [0.75, 0.5]})
    } else {
        json!({"type": "ellipsoid", "center": null, "semi_axes": [0.75, 0.5, 0.5]})
    };
    let shape = written.shape.clone().unwrap_or(default_shape);
    let of_points = cloud::named(&shape, "/shape", &mut violations);
    let surface = match &of_points {
        _ if shape["type"] == "points" => None,
        _ => shapes::surface::<D>(&shape, "/shape").map_err(|found| violations.extend(found)).ok(),
    };
    let asked = cloud::named(&written.queries, "/queries", &mut violations);
    if asked.is_some() && written.repeat > 1 {
        let detail = "points that are only asked about have no level to be redistanced again";
        violations.push(Violation::new("/repeat", "conflict", detail, &json!(written.repeat), json!(1)));
    }
    if written.method["type"] == "remesh" && (asked.is_some() || of_points.is_some()) {
        let detail = "the remeshing baseline knows particles about a shape alone";
        violations.push(Violation::new("/method", "conflict", detail, &json!("remesh"), json!(["pcp"])));
    }
    // Overwritten every step: distances become the input of the next redistancing.
    let default_ratio = if written.repeat > 1 { 2.0 } else { 1.5 };
    let remeshing = (written.method["type"] == "remesh").then(|| {
        let (kernel, full) = remeshing_kernel(&written.method["kernel"], written.spacing);
        resolved["method"]["kernel"] = full;
        kernel
    });
    let understood = match remeshing {
        Some(_) => Ok((grid_method(), resolved["method"].clone())),
        None => pcp_parameters::understand(&written.method, "/method", D, default_ratio),
    };
    let method = match understood {
        Ok((method, full)) => {
            resolved["method"] = full;
            let detail = "particles at rest have no initial positions beside their own";
            violations.extend(pcp_parameters::refuse_material(&method, detail));
            Some(method)
        }
        Err(found) => {
            violations.extend(found);
            None
        }
    };
    let is_ellipse = matches!(shape["type"].as_str(), Some("ellipse" | "ellipsoid" | "circle" | "sphere"));
    let default_initial = if is_ellipse { "quadric" } else { "distance" };
    let initial_name = written.initial.as_ref().and_then(|v| v["type"].as_str()).unwrap_or(default_initial).to_owned();
    let initial = match initial_name.as_str() {
        "distance" => InitialLevel::Distance,
        "scaled" => InitialLevel::Scaled,
        _ => {
            if !is_ellipse && of_points.is_none() {
                let detail = "the quadric belongs to circles, spheres, ellipses and ellipsoids";
                violations.push(Violation::new(
                    "/initial",
                    "conflict",
                    detail,
                    &json!(initial_name),
                    json!(["distance", "scaled"]),
                ));
            }
            quadric::<D>(&shape)
        }
    };
    if let (Some(_), Some(given)) = (&of_points, &written.initial) {
        let detail = "points come with their level";
        violations.push(Violation::new("/initial", "conflict", detail, given, Value::Null));
    }
    if written.band.is_some() && written.band_h.is_some() {
        let detail = "band_h is the band in multiples of h; give one of them";
        violations.push(Violation::new("/band", "conflict", detail, &json!(written.band), Value::Null));
    }
    let band = written.band.unwrap_or(written.band_h.unwrap_or(12.0) * written.spacing);
    if let (Some(surface), Some(method)) = (&surface, &method) {
        let reach = (0.5 * band).max(method.fit_band_h::<D>() * written.spacing);
        violations.extend(check_extent(surface.as_ref(), reach, written.spacing));
        if initial == InitialLevel::Scaled && !is_scaling_positive(surface.as_ref(), reach) {
            let detail = "the factor 1 + 0.5 x + 0.3 y must be positive over the whole band";
            let allowed = json!(["quadric", "distance"]);
            violations.push(Violation::new("/initial", "conflict", detail, &json!("scaled"), allowed));
        }
    }
    let Some(method) = method.filter(|_| violations.is_empty()) else {
        return Err(violations);
    };
    resolved["dimension"] = json!(D);
    resolved["shape"] = shape.clone();
    // Points come with their level: there is nothing to choose.
    resolved["initial"] = if of_points.is_some() { Value::Null } else { json!({"type": initial_name}) };
    resolved["band"] = json!(band);
    if let Some(map) = resolved.as_object_mut() {
        map.shift_remove("band_h");
    }
    let lattice = Lattice { spacing: written.spacing, offset: 0.0, jitter: written.jitter, seed: written.seed };
    Ok(Box::new(RedistanceScene::<D> {
        resolved,
        shape,
        lattice,
        method,
        remeshing,
        initial,
        half_band: 0.5 * band,
        repeats: written.repeat,
        clouds: of_points.into_iter().chain(asked).collect(),
    }))
}

/// The kernel of a remeshing, and its parameters with what was left open.
fn remeshing_kernel(written: &Value, spacing: f64) -> (RemeshingKernel, Value) {
    let mut full = written.clone();
    let default = 1.5 * (1.0 / (16.0 * spacing)).powf(0.35);
    let smoothing_h = written["smoothing_h"].as_f64().unwrap_or(default);
    let kernel = match written["type"].as_str() {
        Some("lambda44") => RemeshingKernel::Lambda44,
        Some("wendland_c2") => RemeshingKernel::WendlandC2 { smoothing_h },
        Some("gaussian") => RemeshingKernel::Gaussian { smoothing_h },
        _ => RemeshingKernel::Lambda44Normalized,
    };
    if let RemeshingKernel::WendlandC2 { .. } | RemeshingKernel::Gaussian { .. } = kernel {
        full["smoothing_h"] = json!(smoothing_h);
    }
    (kernel, full)
}

/// Whether 1 + 0.5 x + 0.3 y is positive wherever particles are made.
fn is_scaling_positive<const D: usize>(surface: &dyn Surface<D>, reach: f64) -> bool {
    let (low, _) = surface.bounding_box();
    1.0 + 0.5 * (low[0] - reach) + 0.3 * (low[1] - reach) > 0.0
}

/// The quadric of a shape that has one.
fn quadric<const D: usize>(shape: &Value) -> InitialLevel<D> {
    let number = |name: &str, d: usize| shape[name].get(d).and_then(Value::as_f64);
    let center = Vector::<D>::from_fn(|d, _| number("center", d).unwrap_or(0.0));
    let radius = shape["radius"].as_f64().unwrap_or(1.0);
    let semi_axes = Vector::<D>::from_fn(|d, _| number("semi_axes", d).unwrap_or(radius));
    InitialLevel::Quadric { center, semi_axes }
}

impl<const D: usize> Scene for RedistanceScene<D> {
    fn resolved(&self) -> Value {
        self.resolved.clone()
    }

    fn field_names(&self) -> Vec<&'static str> {
        vec!["phi", "closest_point", "normal", "curvature", "particle_id"]
    }

    fn clouds(&self) -> Vec<CloudReference> {
        self.clouds.clone()
    }

    fn estimate(&self, sizes: &CloudSizes) -> Estimate {
        let beyond = self.remeshing.map_or(0.0, RemeshingKernel::reach_h::<D>) * self.lattice.spacing;
        let reach = self.half_band.max(self.method.fit_band_h::<D>() * self.lattice.spacing) + beyond;
        let particles = sizes.get("/shape").copied().unwrap_or_else(|| {
            shapes::surface::<D>(&self.shape, "/shape")
                .map_or(0, |surface| band_particles(surface.as_ref(), reach, self.lattice.spacing))
        });
        Estimate {
            particles,
            steps: self.repeats,
            time_step: 1.0,
            end_time: self.repeats as f64,
            memory_bytes: memory_bytes::<D>(particles, &self.method),
        }
    }

    fn family(&self) -> String {
        format!("redistance/{D}/{}", work_estimate::method_name(&self.method))
    }

    fn work(&self, estimate: &Estimate, plan: &OutputPlan) -> Vec<PhaseWork> {
        let Estimate { particles, steps, end_time, .. } = *estimate;
        let particles = particles as f64;
        let reach_h = self.half_band / self.lattice.spacing;
        let reach_h = reach_h.max(self.method.fit_band_h::<D>());
        let times = self.repeats as f64;
        let mut work =
            work_estimate::redistancing::<D>(&self.method, particles, reach_h, 1.0, times, Course::EveryStep);
        if self.remeshing.is_some() {
            work.push(PhaseWork::every_step("remeshing", particles * times));
        }
        work.extend(work_estimate::around(particles, steps, end_time, plan));
        work
    }

    fn build(&self, context: BuildContext) -> Result<Box<dyn Simulation>, Vec<Violation>> {
        let name = if self.remeshing.is_some() { "remeshing to a grid, as given" } else { "pcp, as given" };
        let method = BTreeMap::from([("method", name.to_owned())]);
        let parts = StaticParts {
            spacing: self.lattice.spacing,
            half_band: self.half_band,
            repeats: self.repeats,
            method: self.method.clone(),
            remeshing: self.remeshing,
        };
        let clouds = &context.clouds;
        let is_needed = |pointer: &str| self.clouds.iter().any(|cloud| cloud.pointer == pointer);
        let mut system = if is_needed("/shape") {
            let (points, levels) = cloud::points_with_levels::<D>(clouds, "/shape").map_err(|found| vec![found])?;
            if let Some(found) = cloud::check_spacing(&points, parts.spacing) {
                return Err(vec![found]);
            }
            StaticSystem::of_points(points, &levels, parts, context.interrupt)
        } else {
            let surface = shapes::surface::<D>(&self.shape, "/shape")?;
            StaticSystem::about(surface, &self.lattice, self.initial, parts, context.interrupt)
        };
        if is_needed("/queries") {
            system = system.asked_about(cloud::points::<D>(clouds, "/queries").map_err(|found| vec![found])?);
        }
        Ok(Box::new(StaticRedistancing::new(system, context.cpu_clock, method)))
    }
}
