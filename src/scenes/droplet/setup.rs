//! From parameters to two fluids in a box.

use super::cases::{Case, case};
use super::flow::Flow;
use super::parameters::{Corners, Force, Stop, Written, WrittenFluid};
use crate::closest_point::{LevelSurface, Redistancing};
use crate::geometry::domain::Axis;
use crate::geometry::{Domain, Surface, Vector};
use crate::neighbors::Pencils;
use crate::parallel::Interrupt;
use crate::polynomials::multi_index::term_count;
use crate::scene::cloud::{self, CloudReference, CloudSizes};
use crate::scene::work::{Course, PhaseWork};
use crate::scene::{BuildContext, Estimate, Scene, Understood, Violation};
use crate::scenes::{pcp_parameters, shapes, work_estimate};
use crate::schemes::weakly_compressible_sph::time_step::{REFERENCE_SPEED, StepLimit, longest_step};
use crate::schemes::weakly_compressible_sph::{
    BodyForce, DensityMethod, Discretization, Drop, Fluid, Fluids, Geometry, Integrator, SphConfig, SphSystem,
    TensionForce, WeaklyCompressibleSph, measurement_interval,
};
use crate::simulation::{OutputPlan, Simulation};
use rayon::prelude::{IntoParallelRefIterator, ParallelIterator};
use serde_json::{Value, json};
use std::collections::BTreeMap;

struct DropletScene<const D: usize> {
    resolved: Value,
    shape: Value,
    low: Vector<D>,
    high: Vector<D>,
    sides: [usize; D],
    config: SphConfig<D>,
    time_step: f64,
    steps: u64,
    end_time: f64,
    chosen: BTreeMap<&'static str, String>,
    clouds: Vec<CloudReference>,
}

/// Neighbours per coefficient, where the level is overwritten at every evaluation.
const RATIO: f64 = 2.0;
/// Particles of a run at most.
const MOST_PARTICLES: f64 = 1e9;
/// Units of a measurement by the particle near the interface, for the enclosed shape; the sums over all particles are 1.
const QUADRATURE: f64 = 10.0;

pub(super) fn understand(parameters: &Value) -> Understood {
    let written: Written = serde_json::from_value(parameters.clone())
        .map_err(|error| vec![Violation::new("", "type", error.to_string(), parameters, Value::Null)])?;
    let implied = written.shape.as_ref().and_then(shapes::implied_dimension);
    match written.dimension.or(implied).unwrap_or(2) {
        3 => scene::<3>(&written, parameters.clone()),
        _ => scene::<2>(&written, parameters.clone()),
    }
}

fn corner<const D: usize>(name: &str, numbers: &[f64], violations: &mut Vec<Violation>) -> Vector<D> {
    if numbers.len() != D {
        let (at, detail) = (format!("/domain/{name}"), format!("the scene has {D} dimensions"));
        let allowed = json!(format!("{D} numbers"));
        violations.push(Violation::new(at, "conflict", detail, &json!(numbers), allowed));
    }
    Vector::<D>::from_fn(|d, _| numbers.get(d).copied().unwrap_or(0.0))
}

fn fluid(written: &WrittenFluid) -> Fluid {
    let WrittenFluid { density, viscosity, sound_speed, polytropic } = *written;
    Fluid { density, viscosity, sound_speed, polytropic }
}

fn body_force<const D: usize>(force: &Force, violations: &mut Vec<Violation>) -> Option<BodyForce<D>> {
    match force {
        Force::None => None,
        Force::Pulse { coefficient, duration, a, b, c } => {
            let lengths = Vector::<D>::from_fn(|d, _| [*a, *b, *c][d]);
            Some(BodyForce::Pulse { coefficient: *coefficient, duration: *duration, lengths })
        }
        Force::Constant { acceleration } => {
            if acceleration.len() != D {
                let detail = format!("the scene has {D} dimensions");
                let allowed = json!(format!("{D} numbers"));
                let at = "/body_force/acceleration";
                violations.push(Violation::new(at, "conflict", detail, &json!(acceleration), allowed));
            }
            Some(BodyForce::Constant(Vector::<D>::from_fn(|d, _| acceleration.get(d).copied().unwrap_or(0.0))))
        }
    }
}

/// The geometry, and its parameters with what was left open.
fn geometry(
    written: &Value,
    case: &Case,
    dimension: usize,
    spacing: f64,
    smoothing_h: f64,
) -> Result<(Geometry, Value), Vec<Violation>> {
    if written["type"] != "pcp" {
        return Ok((Geometry::ColorField, written.clone()));
    }
    let mut open = written.clone();
    if open["neighborhood"].is_null() && open["cutoff_h"].is_null() {
        open["neighborhood"] = json!({"type": "radius", "cutoff_h": case.fits.1});
    }
    let (method, mut full) = pcp_parameters::understand(&open, "/geometry", dimension, RATIO)?;
    if let Some(mut found) = pcp_parameters::refuse_material(&method, "particles mix: fits are made in space") {
        found.pointer = "/geometry/neighborhood/type".to_owned();
        return Err(vec![found]);
    }
    let band_h = written["band_h"].as_f64().unwrap_or(4.0 * smoothing_h + 1.0);
    full["band_h"] = json!(band_h);
    if band_h < 4.0 * smoothing_h {
        let detail = "the smoothed tension reaches 2 ε to both sides";
        let allowed = json!(format!("a number ≥ {}", 4.0 * smoothing_h));
        return Err(vec![Violation::new("/geometry/band_h", "range", detail, &json!(band_h), allowed)]);
    }
    Ok((Geometry::Pcp { method, half_band: 0.5 * band_h * spacing }, full))
}

fn scene<const D: usize>(written: &Written, mut resolved: Value) -> Understood {
    let mut violations = Vec::new();
    let h = written.spacing;
    let case = case(&written.case, D, h);
    let corners = written.domain.clone().unwrap_or(Corners { low: case.low.clone(), high: case.high.clone() });
    let low = corner::<D>("low", &corners.low, &mut violations);
    let high = corner::<D>("high", &corners.high, &mut violations);
    let lengths = high - low;
    if lengths.iter().any(|length| *length <= 0.0) {
        let detail = "the upper corner must lie above the lower one along every axis";
        violations.push(Violation::new("/domain/high", "range", detail, &json!(corners.high), Value::Null));
    }
    let counts = lengths.map(|length| (length / h).round());
    if violations.is_empty() && !(1.0..=MOST_PARTICLES).contains(&counts.product()) {
        let least = (lengths.product() / MOST_PARTICLES).powf(1.0 / D as f64);
        let allowed = json!(format!("a number ≥ {least:.3e} and below every side"));
        violations.push(Violation::new("/spacing", "range", "too many particles, or none", &json!(h), allowed));
    }
    let sides: [usize; D] = std::array::from_fn(|d| counts[d].clamp(0.0, MOST_PARTICLES) as usize);
    let shape = written.shape.clone().or(case.shape.clone()).unwrap_or_else(|| {
        let detail = "a custom drop needs a shape";
        violations.push(Violation::new("/shape", "required", detail, &Value::Null, json!({"type": "circle"})));
        Value::Null
    });
    let of_points = cloud::named(&shape, "/shape", &mut violations);
    if of_points.is_none() && !shape.is_null() {
        match shapes::surface::<D>(&shape, "/shape") {
            Ok(surface) => violations.extend(check_size(surface.as_ref(), &lengths, &shape)),
            Err(found) => violations.extend(found),
        }
    }
    let flow = Flow::understand(written, &case, h, &mut violations);
    let smoothing_h = flow.smoothing_h;
    let geometry = match geometry(&written.geometry, &case, D, h, smoothing_h) {
        Ok((geometry, full)) => {
            resolved["geometry"] = full;
            Some(geometry)
        }
        Err(found) => {
            violations.extend(found);
            None
        }
    };
    let force_json = written.body_force.clone().unwrap_or_else(|| case.body_force.clone());
    let force: Force = serde_json::from_value(force_json.clone()).unwrap_or_else(|error| {
        violations.push(Violation::new("/body_force", "type", error.to_string(), &force_json, Value::Null));
        Force::None
    });
    let shifting = written.shifting.as_deref().unwrap_or(flow.shifting(&case));
    let given_step = written.time_step.or(if written.steps.is_none() { case.time_step } else { None });
    if let (Some(step), Some(_)) = (written.time_step, written.steps) {
        let detail = "steps are given instead of a time step; give one of them";
        violations.push(Violation::new("/time_step", "conflict", detail, &json!(step), Value::Null));
    }
    let config = SphConfig {
        spacing: h,
        smoothing_length: smoothing_h * h,
        kernel: flow.kernel,
        fluids: Fluids { inside: fluid(&written.fluids.inside), outside: fluid(&written.fluids.outside) },
        tension: written.surface_tension.unwrap_or(case.tension),
        tension_force: if written.tension_force == "csf" { TensionForce::Csf } else { TensionForce::Balanced },
        geometry: geometry.unwrap_or(Geometry::ColorField),
        discretization: flow.discretization,
        density: flow.density,
        is_shifted: shifting == "pst",
        body_force: body_force(&force, &mut violations),
        integrator: match written.integrator.as_str() {
            "predictor_corrector" => Integrator::PredictorCorrector,
            _ => Integrator::KickDriftKick,
        },
        is_adaptive: given_step.is_none() && written.steps.is_none(),
        rest_below: written.stop_when.map(|Stop::AtRest { velocity }| velocity),
    };
    let StepLimit { length: limit, cause: bound } = longest_step(&config, REFERENCE_SPEED);
    let time_step = match (given_step, written.steps) {
        (Some(step), _) => step,
        (None, Some(steps)) => written.end_time / steps as f64,
        // A whole number of steps to a unit of time, whatever the end: a later end repeats the same steps.
        (None, None) => 1.0 / (1.0 / limit).ceil(),
    };
    let steps = (written.end_time / time_step - 1e-9).ceil();
    if !(time_step.is_normal() && (1.0..=1e9).contains(&steps)) {
        let detail = "the run would have too many steps or none";
        let allowed = json!(format!("a number from {:e} to {:e}", written.end_time * 1e-9, written.end_time));
        violations.push(Violation::new("/time_step", "range", detail, &json!(time_step), allowed));
    }
    let domain = domain_of(&low, &lengths);
    if violations.is_empty()
        && let Err(error) = Pencils::<D>::new(&domain, config.cutoff())
    {
        violations.push(Violation::new("/domain", "range", error.to_string(), &resolved["domain"], json!(error.least)));
    }
    if !violations.is_empty() {
        return Err(violations);
    }
    let mut chosen = BTreeMap::new();
    if config.is_adaptive {
        let why = format!("{time_step:.4e}: the longest that {bound} allows at the speed {REFERENCE_SPEED}");
        chosen.insert("time_step", why);
    }
    for (name, value) in [
        ("dimension", json!(D)),
        ("shape", shape.clone()),
        ("domain", json!({"low": corners.low, "high": corners.high})),
        ("surface_tension", json!(config.tension)),
        ("discretization", flow.full),
        ("density_method", flow.full_density),
        ("shifting", json!(shifting)),
        ("body_force", force_json),
    ] {
        resolved[name] = value;
    }
    if written.steps.is_none() {
        resolved["time_step"] = json!(given_step);
    }
    Ok(Box::new(DropletScene {
        resolved,
        shape,
        low,
        high,
        sides,
        config,
        time_step,
        steps: steps as u64,
        end_time: written.end_time,
        chosen,
        clouds: of_points.into_iter().collect(),
    }))
}

/// A violation where the drop does not fit into the box.
fn check_size<const D: usize>(surface: &dyn Surface<D>, lengths: &Vector<D>, shape: &Value) -> Option<Violation> {
    let (low, high) = surface.bounding_box();
    let fits = (high - low).iter().zip(lengths.iter()).all(|(size, length)| size < length);
    let detail = "the drop is as large as the box";
    (!fits).then(|| Violation::new("/shape", "conflict", detail, shape, json!(lengths.as_slice())))
}

fn domain_of<const D: usize>(low: &Vector<D>, lengths: &Vector<D>) -> Domain<D> {
    Domain::new(std::array::from_fn(|d| Axis::Periodic { start: low[d], length: lengths[d] }))
}

impl<const D: usize> DropletScene<D> {
    /// Work of the forces: sums over pairs, or fits.
    fn momentum_work(&self, pairs: f64, particles: f64) -> f64 {
        let Discretization::Dcpse(support) = self.config.discretization else { return pairs };
        let cutoff = support.radius / self.config.spacing;
        let nodes = if D == 2 { 3.1 } else { 4.2 } * cutoff.powi(D as i32);
        let terms = term_count::<D>(support.degree) as f64;
        particles * nodes * (40.0 + 0.25 * terms * terms)
    }

    fn lengths(&self) -> Vector<D> {
        self.high - self.low
    }

    fn count(&self) -> u64 {
        self.sides.iter().map(|side| *side as u64).product()
    }

    /// Centres of the cells of the box.
    fn positions(&self) -> Vec<Vector<D>> {
        let lengths = self.lengths();
        (0..self.count() as usize)
            .map(|k| {
                let mut rest = k;
                Vector::<D>::from_fn(|d, _| {
                    let index = rest % self.sides[d];
                    rest /= self.sides[d];
                    self.low[d] + (index as f64 + 0.5) * lengths[d] / self.sides[d] as f64
                })
            })
            .collect()
    }

    /// Signed distances from the nearest image of a shape.
    fn levels(&self, surface: &dyn Surface<D>, positions: &[Vector<D>]) -> Vec<f64> {
        let lengths = self.lengths();
        let (low, high) = surface.bounding_box();
        let images: Vec<Vector<D>> = (0..3_usize.pow(D as u32))
            .map(|image| {
                let turns = Vector::<D>::from_fn(|d, _| (image / 3_usize.pow(d as u32) % 3) as f64 - 1.0);
                turns.component_mul(&lengths)
            })
            .collect();
        positions
            .par_iter()
            .map(|x| {
                let mut least = f64::INFINITY;
                for image in &images {
                    let y = x + image;
                    // No point of the shape is nearer than its box.
                    let away = (low - y).sup(&(y - high)).sup(&Vector::<D>::zeros()).norm();
                    if away < least {
                        least = least.min(surface.signed_distance(&y));
                    }
                }
                least
            })
            .collect()
    }

    /// Signed distances from the surface of points that came from elsewhere.
    fn levels_of_points(&self, context: &BuildContext, positions: &[Vector<D>]) -> Result<Vec<f64>, Violation> {
        let (points, level) = cloud::points_with_levels::<D>(&context.clouds, "/shape")?;
        if let Some(found) = cloud::check_spacing(&points, self.config.spacing) {
            return Err(found);
        }
        let domain = domain_of(&self.low, &self.lengths());
        let points: Vec<Vector<D>> = points.iter().map(|x| domain.wrap(*x)).collect();
        let method = match &self.config.geometry {
            Geometry::Pcp { method, .. } => method.clone(),
            Geometry::ColorField => pcp_parameters::defaults(D, RATIO)?,
        };
        let mut surface = LevelSurface::Spatial(Box::new(Redistancing::new(method, domain, self.config.spacing)));
        let never = Interrupt::default();
        let fitted =
            surface.detect(&points, &level, &never).and_then(|()| surface.fit_samples(&points, &level, None, &never));
        if fitted.is_err() || surface.is_lost() {
            let detail = "phi of the points has no zero between them".to_owned();
            return Err(Violation::new("/shape", "data", detail, &Value::Null, json!("PointData/phi of both signs")));
        }
        let distance = |x: &Vector<D>| {
            let foot = surface.query(x, f64::INFINITY)?;
            Some(if surface.is_inside(x, &foot) { -foot.distance } else { foot.distance })
        };
        Ok(positions.par_iter().map(|x| distance(x).unwrap_or(f64::INFINITY)).collect())
    }
}

impl<const D: usize> Scene for DropletScene<D> {
    fn resolved(&self) -> Value {
        self.resolved.clone()
    }

    fn field_names(&self) -> Vec<&'static str> {
        let mut names = Vec::new();
        if self.config.has_tension() {
            match self.config.geometry {
                Geometry::Pcp { .. } => names.extend(["phi", "closest_point", "normal", "curvature"]),
                Geometry::ColorField => names.extend(["normal", "curvature"]),
            }
        }
        names.extend(["velocity", "density", "pressure", "phase"]);
        if !self.config.fluids.have_one_mass() {
            names.push("mass");
        }
        names.push("particle_id");
        names
    }

    fn clouds(&self) -> Vec<CloudReference> {
        self.clouds.clone()
    }

    fn estimate(&self, _sizes: &CloudSizes) -> Estimate {
        let particles = self.count();
        // Columns, their gathered copies, a state and a frame in the making; ranges of neighbours.
        let bytes = if D == 2 { 900 } else { 1750 };
        Estimate {
            particles,
            steps: self.steps,
            time_step: self.time_step,
            end_time: self.steps as f64 * self.time_step,
            memory_bytes: particles.saturating_mul(bytes),
        }
    }

    fn family(&self) -> String {
        let geometry = match &self.config.geometry {
            Geometry::Pcp { method, .. } => work_estimate::method_name(method),
            Geometry::ColorField => "colorfield".to_owned(),
        };
        let flow = if let Discretization::Dcpse(_) = self.config.discretization { "/dcpse" } else { "" };
        format!("droplet/{D}/{geometry}{flow}")
    }

    fn work(&self, estimate: &Estimate, plan: &OutputPlan) -> Vec<PhaseWork> {
        let Estimate { particles, steps, end_time, .. } = *estimate;
        let (particles, steps_done) = (particles as f64, steps as f64);
        let evaluations = steps_done * if self.config.integrator == Integrator::KickDriftKick { 1.0 } else { 2.0 };
        let support = self.config.kernel.support() * self.config.smoothing_length / self.config.spacing;
        let ball = if D == 2 { std::f64::consts::PI } else { 4.0 / 3.0 * std::f64::consts::PI };
        let pairs = particles * ball * support.powi(D as i32) * evaluations;
        let mut work = vec![
            PhaseWork::every_step("sph/momentum", self.momentum_work(2.0 * pairs, particles * evaluations)),
            PhaseWork::every_step("sph/gather", particles * evaluations),
            PhaseWork::every_step("sph/advance", particles * evaluations),
            PhaseWork::every_step("sph/tension", particles * evaluations),
            PhaseWork::every_step("neighbors", particles * steps_done),
        ];
        if self.config.density == DensityMethod::Summation {
            work.push(PhaseWork::every_step("sph/density", pairs));
        }
        if self.config.is_shifted {
            work.push(PhaseWork::every_step("sph/shifting", pairs));
        }
        // Steps that are measured for both reasons count twice: they are few.
        let measurements =
            steps_done / plan.series_every_steps.max(1) as f64 + steps_done / measurement_interval(steps) as f64;
        let measured = |weight: f64| PhaseWork::every_step("measure", (measurements + 2.0) * weight);
        if self.config.has_tension() {
            work.push(PhaseWork::every_step("droplets", particles * steps_done));
            match &self.config.geometry {
                Geometry::Pcp { method, half_band } => {
                    let band = self.near(2.0 * half_band);
                    let reach_h = half_band / self.config.spacing;
                    work.extend(work_estimate::redistancing::<D>(
                        method,
                        band,
                        reach_h,
                        1.0,
                        evaluations,
                        Course::EveryStep,
                    ));
                    work.push(measured(particles + QUADRATURE * band));
                }
                Geometry::ColorField => {
                    work.push(PhaseWork::every_step("sph/color", 3.0 * pairs));
                    work.push(measured(particles));
                }
            }
        } else {
            work.push(measured(particles));
        }
        work.extend(work_estimate::around(particles, steps, end_time, plan));
        work
    }

    fn build(&self, context: BuildContext) -> Result<Box<dyn Simulation>, Vec<Violation>> {
        let lengths = self.lengths();
        let domain = domain_of(&self.low, &lengths);
        let positions = self.positions();
        let (level, measure) = if self.clouds.is_empty() {
            let surface = shapes::surface::<D>(&self.shape, "/shape")?;
            (self.levels(surface.as_ref(), &positions), surface.measure())
        } else {
            (self.levels_of_points(&context, &positions).map_err(|found| vec![found])?, f64::NAN)
        };
        let cell = lengths.product() / self.count() as f64;
        let drop = Drop { positions, level, measure };
        let system = SphSystem::new(self.config.clone(), domain, cell, drop, context.interrupt).map_err(|error| {
            vec![Violation::new("/domain", "range", error.to_string(), &self.resolved["domain"], json!(error.least))]
        })?;
        let (plan, clock) = (context.plan, context.cpu_clock);
        let chosen = self.chosen.clone();
        Ok(Box::new(WeaklyCompressibleSph::new(system, self.time_step, self.end_time, plan, clock, chosen)))
    }
}

impl<const D: usize> DropletScene<D> {
    /// Particles within a band of this width about the drop, about: that of a ball of its measure, which is taken for a fifth of the
    /// box where it is not known.
    fn near(&self, width: f64) -> f64 {
        let surface = shapes::surface::<D>(&self.shape, "/shape");
        let measure = surface.map_or_else(|_| self.lengths().product() / 5.0, |surface| surface.measure());
        let area = if D == 2 {
            2.0 * (std::f64::consts::PI * measure).sqrt()
        } else {
            (36.0 * std::f64::consts::PI).cbrt() * measure.powf(2.0 / 3.0)
        };
        (area * width / self.config.spacing.powi(D as i32)).min(self.count() as f64)
    }
}
