//! From parameters to points, a method and a problem. Points from outside are unknown until a run is built ([`points`]).

use super::parameters::Written;
use super::points;
use super::problems::{self, ProblemChoice, Start};
use super::surfaces::{self, DEFAULT_COUNT, Extent, Sampling, Shape};
use crate::geometry::random::CounterRandom;
use crate::geometry::surfaces::{Ellipsoid, Torus};
use crate::geometry::{Surface, Vector};
use crate::operators::Support;
use crate::operators::charts::tangent::Metric;
use crate::point_clouds::{Bump, normals};
use crate::scene::cloud::{self, CloudReference, CloudSizes};
use crate::scene::work::PhaseWork;
use crate::scene::{BuildContext, Estimate, Scene, Understood, Violation};
use crate::scenes::work_estimate;
use crate::schemes::embedding_closest_point::{EmbeddingClosestPoint, EmbeddingParts, SurfaceData};
use crate::schemes::surface_equation::{EvolutionIntegrator, Form, Method, SurfaceCloud, SurfaceEquation};
use crate::simulation::{OutputPlan, Simulation};
use crate::time::FixedStep;
use serde_json::{Value, json};

/// Where normals come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Normals {
    Exact,
    Estimated,
    Perturbed {
        sigma: f64,
    },
    /// With points from outside; estimated where they have none and nothing depends on it.
    Given {
        must_be_there: bool,
    },
}

/// The method of the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Scheme {
    Dcpse(Method),
    Embedding { order: usize, spacing: f64 },
}

pub(super) struct SurfaceScene {
    pub written: Written,
    pub resolved: Value,
    shape: Shape,
    count: u64,
    sampling: Sampling,
    pub normals: Normals,
    scheme: Scheme,
    problem: ProblemChoice,
    pub fixed: FixedStep,
    points: Option<CloudReference>,
}

/// Distances of points.
const LENGTHS: std::ops::RangeInclusive<f64> = 1e-50..=1e50;

/// Degree and r_c/δn of an order: the smallest support that holds twice as many neighbours as there are functions, about; larger
/// ones have larger errors (measured on plane waves). Points as drawn at random want more: with less, operators have growing modes.
fn support(order: u64, is_curve: bool, is_copies: bool, sampling: Sampling) -> Option<(usize, f64)> {
    let degree = match order {
        2 | 4 | 6 => order as usize + 1,
        _ => return None,
    };
    let is_raw = sampling == Sampling::Random { is_relaxed: false };
    let cutoff = match (is_copies, is_curve, order) {
        (true, true, _) => 4.1,
        (true, false, _) => 2.9,
        // On a curve neighbours lie in a row.
        (false, true, 2) => 3.4,
        (false, true, 4) => 5.4,
        (false, true, _) => 7.4,
        (false, false, _) if is_raw => 3.0 + 0.25 * order as f64,
        (false, false, 2) => 2.4,
        (false, false, 4) => 3.3,
        (false, false, _) => 4.2,
    };
    Some((degree, cutoff))
}

pub(super) fn understand(parameters: &Value) -> Understood {
    let written: Written = serde_json::from_value(parameters.clone())
        .map_err(|error| vec![Violation::new("", "type", error.to_string(), parameters, Value::Null)])?;
    let mut violations = Vec::new();
    let mut resolved = parameters.clone();
    let points = cloud::named(&written.surface, "/surface", &mut violations);
    let shape = shape(&written, &mut violations);
    let dimension = shape.dimension() as u64;
    if let Some(given) = written.dimension.filter(|given| *given != dimension) {
        let detail = format!("this surface lies in {dimension} dimensions");
        violations.push(Violation::new("/dimension", "conflict", detail, &json!(given), json!(dimension)));
    }
    resolved["dimension"] = json!(dimension);
    let count = written.count.unwrap_or(DEFAULT_COUNT);
    let sampling = surfaces::sampling(&written, &shape, &mut resolved, &mut violations);
    let normals = normals(&written, &shape, &mut resolved, &mut violations);
    let spacing = shape.spacing(count);
    if !matches!(shape, Shape::Points(_)) && !LENGTHS.contains(&spacing) {
        let detail = "squares of the distance of points and of its inverse must be numbers";
        let allowed = json!({"least": LENGTHS.start(), "most": LENGTHS.end()});
        violations.push(Violation::new("/surface", "range", detail, &json!(spacing), allowed));
    }
    let (scheme, problem) = choices(&written, (&shape, sampling, count), &mut resolved, &mut violations);
    if let (Some(Scheme::Embedding { .. }), Some(problem)) = (&scheme, &problem) {
        if shape.in_space().is_none() {
            let (detail, got) = ("the embedding method is for spheres, ellipsoids and tori", json!("closest_point"));
            violations.push(Violation::new("/method", "conflict", detail, &got, json!(["surface_dcpse"])));
        }
        if !matches!(problem, ProblemChoice::LaplaceBeltrami { .. }) {
            let detail = "the embedding method is there for the operator applied to a field";
            let allowed = json!(["laplace_beltrami"]);
            violations.push(Violation::new("/problem", "conflict", detail, &written.problem["type"], allowed));
        }
    }
    let default_solver = json!({"type": "bicgstab", "tolerance": 1e-10, "max_iterations": 5000});
    if problem.as_ref().is_some_and(|problem| problem.solver().is_none()) && written.solver != default_solver {
        let detail = "nothing is solved here: systems of equations are those of `poisson` and of `bdf2`";
        violations.push(Violation::new("/solver", "conflict", detail, &written.solver, default_solver));
    }
    let is_applied = matches!(problem, Some(ProblemChoice::LaplaceBeltrami { .. }) | None);
    if written.repeat > 1 && !is_applied {
        let detail = "only the operator that is applied to a field is applied again";
        violations.push(Violation::new("/repeat", "conflict", detail, &json!(written.repeat), json!(1)));
    }
    let (Some(scheme), Some(problem)) = (scheme, problem.filter(|_| violations.is_empty())) else {
        return Err(violations);
    };
    let fixed = match &problem {
        ProblemChoice::LaplaceBeltrami { .. } => FixedStep { time_step: 1.0, steps: written.repeat },
        ProblemChoice::Poisson { .. } | ProblemChoice::Curvature { .. } => FixedStep { time_step: 1.0, steps: 1 },
        ProblemChoice::Evolution { end_time, time_step, .. } => FixedStep::from_limit(*end_time, *time_step),
    };
    if let ProblemChoice::Evolution { start, integrator, .. } = &problem {
        let evolving = &mut resolved["problem"];
        evolving["time_step"] = json!(fixed.time_step);
        // A time step alone asks for steps of that length: that steps are controlled must be said.
        if let EvolutionIntegrator::Controlled { tolerance } = integrator {
            match start {
                Start::Field(_) => evolving["integrator"]["tolerance"] = json!(tolerance),
                Start::Reaction { .. } => evolving["tolerance"] = json!(tolerance),
            }
        }
    }
    Ok(Box::new(SurfaceScene { written, resolved, shape, count, sampling, normals, scheme, problem, fixed, points }))
}

/// Method and problem for a shape and a number of points; again for points from outside, once they are read.
pub(super) fn choices(
    written: &Written,
    (shape, sampling, count): (&Shape, Sampling, u64),
    resolved: &mut Value,
    violations: &mut Vec<Violation>,
) -> (Option<Scheme>, Option<ProblemChoice>) {
    let normals = &resolved["normals"];
    let metric = match normals["type"].as_str() {
        Some("exact") => Metric::FromNormals,
        Some("perturbed" | "given") if normals["metric"] == "normals" => Metric::FromNormals,
        _ => Metric::FromHeights,
    };
    let scheme = scheme(written, shape, count, metric, sampling, resolved, violations);
    (scheme, problems::understand(written, shape, metric, resolved, violations))
}

/// Where normals come from: nobody knows those of points from outside exactly, and those of other surfaces are not given.
fn normals(written: &Written, shape: &Shape, resolved: &mut Value, violations: &mut Vec<Violation>) -> Normals {
    let (default, allowed, detail) = match shape {
        Shape::Points(_) => (
            json!({"type": "given", "metric": "heights"}),
            ["given", "estimated"].as_slice(),
            "the exact normals of points from outside are not known; `given` takes theirs",
        ),
        _ => {
            let detail = "the normals of this surface are known, nobody gives them";
            (json!({"type": "exact"}), ["exact", "estimated", "perturbed"].as_slice(), detail)
        }
    };
    let chosen = written.normals.clone().unwrap_or(default);
    let name = chosen["type"].as_str().unwrap_or_default();
    if !allowed.contains(&name) {
        violations.push(Violation::new("/normals", "conflict", detail, &json!(name), json!(allowed)));
    }
    let normals = match name {
        "estimated" => Normals::Estimated,
        "perturbed" => Normals::Perturbed { sigma: chosen["sigma"].as_f64().unwrap_or(0.01) },
        "given" => Normals::Given { must_be_there: chosen["metric"] == "normals" },
        _ => Normals::Exact,
    };
    resolved["normals"] = chosen;
    normals
}

fn shape(written: &Written, violations: &mut Vec<Violation>) -> Shape {
    let surface = &written.surface;
    let number = |name: &str| surface[name].as_f64().unwrap_or(1.0);
    let center = Vector::<3>::zeros();
    match surface["type"].as_str() {
        Some("circle") => Shape::Circle { radius: number("radius") },
        Some("ellipsoid") => {
            let axes = &surface["semi_axes"];
            let semi_axes = problems::in_space(axes, "/surface/semi_axes", violations);
            Shape::Ellipsoid(Ellipsoid { center, semi_axes })
        }
        Some("torus") => {
            let (major_radius, minor_radius) = (number("major_radius"), number("minor_radius"));
            if minor_radius >= major_radius {
                let detail = "the tube must be thinner than its circle";
                let (got, allowed) = (json!(minor_radius), json!({"below": major_radius}));
                violations.push(Violation::new("/surface/minor_radius", "range", detail, &got, allowed));
            }
            Shape::Torus(Torus { center, major_radius, minor_radius })
        }
        Some("bump") => Shape::Bump(Bump { height: number("height") }),
        Some("points") => Shape::Points(Extent::unknown(written.dimension.map_or(3, |dimension| dimension as usize))),
        _ => Shape::Ellipsoid(Ellipsoid { center, semi_axes: Vector::<3>::repeat(number("radius")) }),
    }
}

fn scheme(
    written: &Written,
    shape: &Shape,
    count: u64,
    metric: Metric,
    sampling: Sampling,
    resolved: &mut Value,
    violations: &mut Vec<Violation>,
) -> Option<Scheme> {
    let method = &written.method;
    let order = method["order"].as_u64().unwrap_or(2);
    let spacing = shape.spacing(count);
    let wrong_order = |allowed: Value| {
        Violation::new("/method/order", "range", "there is no method of this order", &json!(order), allowed)
    };
    if method["type"] == "closest_point" {
        if order != 2 && order != 4 {
            violations.push(wrong_order(json!([2, 4])));
        }
        if let Some(given) = written.normals.as_ref().filter(|normals| normals["type"] != "exact") {
            let detail = "the embedding method has exact closest points and asks for no normals";
            violations.push(Violation::new("/normals", "conflict", detail, &given["type"], json!(["exact"])));
        }
        let grid = method["spacing"].as_f64().unwrap_or(spacing);
        resolved["method"]["spacing"] = json!(grid);
        return Some(Scheme::Embedding { order: order as usize, spacing: grid });
    }
    let is_curve = shape.is_curve();
    let is_copies = method["form"] == "copies";
    let Some((degree, default_cutoff)) = support(order, is_curve, is_copies, sampling) else {
        violations.push(wrong_order(json!([2, 4, 6])));
        return None;
    };
    let cutoff_dn = method["cutoff_dn"].as_f64().unwrap_or(default_cutoff);
    resolved["method"]["cutoff_dn"] = json!(cutoff_dn);
    if is_copies {
        let n = count as f64;
        let apart = if let Shape::Circle { radius } = shape { 3.0 * radius / (n - 1.0) } else { spacing };
        let apart = method["normal_spacing"].as_f64().unwrap_or(apart);
        let layers = method["layers"].as_u64().unwrap_or(if is_curve { 4 } else { 2 }) as u32;
        resolved["method"]["normal_spacing"] = json!(apart);
        resolved["method"]["layers"] = json!(layers);
        if metric == Metric::FromHeights || matches!(shape, Shape::Bump(_) | Shape::Points(_)) {
            let detail = "copies along normals want exact normals and a closed surface";
            violations.push(Violation::new("/method/form", "conflict", detail, &json!("copies"), json!(["intrinsic"])));
        }
        let support = Support { degree, radius: cutoff_dn * apart };
        return Some(Scheme::Dcpse(Method { support, form: Form::Copies { layers, spacing: apart } }));
    }
    for name in ["layers", "normal_spacing"] {
        if !method[name].is_null() {
            let (place, detail) = (format!("/method/{name}"), "there are no copies in the intrinsic form");
            violations.push(Violation::new(place, "conflict", detail, &method[name], Value::Null));
        }
    }
    let terms = if is_curve { degree as f64 } else { ((degree + 1) * (degree + 2) / 2 - 1) as f64 };
    // Only points whose normals differ by less than 60° count: a quarter of a sphere, less where it is flat.
    let least_count = (8.0 * terms).ceil();
    if (count as f64) < least_count {
        let detail = format!("a fit of {terms} functions wants {least_count} points at least on a closed surface");
        let place = if let Shape::Points(_) = shape { "/surface" } else { "/count" };
        violations.push(Violation::new(place, "range", detail, &json!(count), json!({"least": least_count})));
    }
    let least_cutoff = if is_curve { 0.6 * terms } else { (1.2 * terms / std::f64::consts::PI).sqrt() };
    if cutoff_dn < least_cutoff {
        let detail = format!("a support must hold the neighbours that a fit of {terms} functions needs");
        let allowed = json!({"least": least_cutoff});
        violations.push(Violation::new("/method/cutoff_dn", "range", detail, &json!(cutoff_dn), allowed));
    }
    Some(Scheme::Dcpse(Method {
        support: Support { degree, radius: cutoff_dn * spacing },
        form: Form::Intrinsic { metric },
    }))
}

impl SurfaceScene {
    /// Entries of a row, about.
    fn entries(&self, method: &Method) -> f64 {
        let cutoff = method.support.radius / self.shape.spacing(self.count);
        let is_curve = self.shape.is_curve();
        1.0 + if is_curve { 2.0 * cutoff } else { std::f64::consts::PI * cutoff * cutoff }
    }

    /// Nodes of a fit, about.
    fn nodes(&self, method: &Method) -> f64 {
        let surface = self.entries(method);
        match method.form {
            Form::Intrinsic { .. } => surface,
            Form::Copies { layers, .. } => surface * (1.0 + 1.6 * f64::from(layers)),
        }
    }

    /// Steps of a controlled integrator to one of the scene, when stability binds them: 2 δn² by the diffusivity.
    fn inner_steps(&self, count: u64) -> f64 {
        let spacing = self.shape.spacing(count);
        (self.fixed.time_step * self.problem.diffusivity() / (2.0 * spacing * spacing)).max(1.0)
    }

    /// Functions of a fit.
    fn terms(&self, method: &Method) -> f64 {
        let n = method.support.degree as f64;
        let is_curve = self.shape.is_curve();
        let coordinates = if is_curve { 1 } else { 2 } + usize::from(matches!(method.form, Form::Copies { .. }));
        match coordinates {
            1 => n,
            2 => (n + 1.0) * (n + 2.0) / 2.0 - 1.0,
            _ => (n + 1.0) * (n + 2.0) * (n + 3.0) / 6.0 - 1.0,
        }
    }

    /// The cloud with the normals that operators are made with.
    fn cloud<const D: usize>(
        &self,
        mut cloud: SurfaceCloud<D>,
        radius: f64,
    ) -> Result<SurfaceCloud<D>, Vec<Violation>> {
        match self.normals {
            Normals::Exact | Normals::Given { .. } => {}
            Normals::Perturbed { sigma } => {
                let random = CounterRandom::new(self.written.seed ^ 0x6e6f_726d);
                for (i, normal) in cloud.normals[..cloud.rows].iter_mut().enumerate() {
                    let off = Vector::<D>::from_fn(|d, _| sigma * random.symmetric(&[i as i64, d as i64]));
                    *normal = (*normal + off).normalize();
                }
            }
            Normals::Estimated => {
                let found = normals::estimate::<D>(&cloud.points, radius);
                let found = found.map_err(|failed| {
                    let refused =
                        Violation::new("/normals", "data", failed.to_string(), &json!("estimated"), Value::Null);
                    vec![refused]
                })?;
                cloud.normals = found;
            }
        }
        Ok(cloud)
    }
}

impl Scene for SurfaceScene {
    fn resolved(&self) -> Value {
        self.resolved.clone()
    }

    fn field_names(&self) -> Vec<&'static str> {
        let mut names = self.problem.field_names(&self.shape);
        names.extend(["normal", "particle_id"]);
        if self.points.is_none() {
            names.push("curvature");
        }
        names
    }

    fn clouds(&self) -> Vec<CloudReference> {
        self.points.iter().cloned().collect()
    }

    fn estimate(&self, sizes: &CloudSizes) -> Estimate {
        let particles = sizes.get("/surface").copied().unwrap_or_else(|| self.shape.points(self.count));
        let points = particles as f64;
        let memory = match &self.scheme {
            // Points, normals, columns; entries once in the rows of the tasks and once in those of the operator.
            Scheme::Dcpse(method) => {
                let entries = self.entries(method);
                points * (250.0 + 2.4 * 12.0 * entries * self.problem.copies() + self.problem.fill(entries, points))
            }
            Scheme::Embedding { order, spacing } => {
                let area = points * self.shape.spacing(self.count).powi(2);
                let bounds = self.shape.in_space().map(Surface::bounding_box);
                points * 250.0 + bounds.map_or(0.0, |bounds| EmbeddingParts::memory(*order, *spacing, area, bounds))
            }
        };
        Estimate {
            particles,
            steps: self.fixed.steps,
            time_step: self.fixed.time_step,
            end_time: self.fixed.clock(self.fixed.steps).time,
            memory_bytes: memory as u64,
        }
    }

    fn family(&self) -> String {
        let dimension = self.shape.dimension();
        let problem = self.problem.name();
        match &self.scheme {
            Scheme::Dcpse(Method { support, form: Form::Intrinsic { .. } }) => {
                format!("surface_pde/{dimension}/intrinsic/{}/{problem}", support.degree)
            }
            Scheme::Dcpse(Method { support, .. }) => {
                format!("surface_pde/{dimension}/copies/{}/{problem}", support.degree)
            }
            Scheme::Embedding { order, .. } => format!("surface_pde/{dimension}/embedding/{order}"),
        }
    }

    fn work(&self, estimate: &Estimate, plan: &OutputPlan) -> Vec<PhaseWork> {
        let Estimate { particles, steps, end_time, .. } = *estimate;
        let points = particles as f64;
        let mut work = match &self.scheme {
            Scheme::Dcpse(method) => {
                let (nodes, terms) = (self.nodes(method), self.terms(method));
                let fit = nodes * (20.0 + 0.25 * terms * terms) + 0.02 * terms.powi(3);
                let application = points * self.entries(method);
                let mut work = vec![PhaseWork::at_moments("operators/construction", points * fit)];
                work.extend(self.problem.work(application, points, steps as f64, self.inner_steps(particles)));
                work
            }
            Scheme::Embedding { order, spacing } => {
                let band = 2.0 * EmbeddingParts::half_band(*order) * (self.shape.spacing(self.count) / spacing).powi(2);
                let stencil = (*order as f64 + 2.0).powi(3);
                vec![
                    PhaseWork::at_moments("operators/construction", points * band * (200.0 + stencil)),
                    PhaseWork::every_step("operators/application", points * band * stencil * steps as f64),
                ]
            }
        };
        work.extend(work_estimate::around(points, steps, end_time, plan));
        work
    }

    fn build(&self, context: BuildContext) -> Result<Box<dyn Simulation>, Vec<Violation>> {
        if let Shape::Points(_) = self.shape {
            return if self.shape.is_curve() {
                points::build::<2, 1>(self, context)
            } else {
                points::build::<3, 2>(self, context)
            };
        }
        let BuildContext { interrupt, cpu_clock, .. } = context;
        match (&self.scheme, &self.shape) {
            (Scheme::Dcpse(method), Shape::Circle { radius }) => {
                let cloud = surfaces::circle(*radius, self.count as usize, self.sampling, self.written.seed);
                let cloud = self.cloud(cloud, method.support.radius)?;
                let problem = self.problem.build(&self.shape, &cloud, self.written.seed, self.fixed.time_step)?;
                Ok(Box::new(SurfaceEquation::<2, 1>::new(cloud, *method, problem, self.fixed, interrupt, cpu_clock)))
            }
            (Scheme::Dcpse(method), shape) => {
                let reach = method.support.radius;
                let cloud = surfaces::in_space(shape, self.count, self.sampling, self.written.seed, reach, &interrupt);
                let cloud = self.cloud(cloud, reach)?;
                let problem = self.problem.build(shape, &cloud, self.written.seed, self.fixed.time_step)?;
                Ok(Box::new(SurfaceEquation::<3, 2>::new(cloud, *method, problem, self.fixed, interrupt, cpu_clock)))
            }
            (Scheme::Embedding { order, spacing }, shape) => {
                let cloud = surfaces::in_space(shape, self.count, self.sampling, self.written.seed, 0.0, &interrupt);
                let Some((field, values, operated)) = self.problem.known(shape, &cloud) else { return Err(Vec::new()) };
                let surface: Box<dyn Surface<3>> = match shape {
                    Shape::Torus(torus) => Box::new(torus.clone()),
                    Shape::Ellipsoid(ellipsoid) => Box::new(ellipsoid.clone()),
                    Shape::Circle { .. } | Shape::Bump(_) | Shape::Points(_) => return Err(Vec::new()),
                };
                let parts = EmbeddingParts { order: *order, spacing: *spacing, repeats: self.fixed.steps };
                let SurfaceCloud { points, normals, curvatures, .. } = cloud;
                let data = SurfaceData { points, normals, curvatures, field: values, reference: operated };
                let field = Box::new(move |x: &Vector<3>| field.value(x));
                Ok(Box::new(EmbeddingClosestPoint::new(surface, field, data, parts, interrupt, cpu_clock)))
            }
        }
    }
}
