//! From the spec of a `droplet` scene to two fluids in a box.

use super::cases::Case;
use super::flow::{FlowPlan, body_force};
use super::spec::{Corners, Droplet, GeometryChoice, IntegratorWord, Shifting, StopWhen, TensionWord};
use crate::closest_point::{LevelSurface, Redistancing};
use crate::geometry::domain::Axis;
use crate::geometry::{Domain, Surface, Vector};
use crate::neighbors::Pencils;
use crate::parallel::Interrupt;
use crate::polynomials::multi_index::term_count;
use crate::scene::cloud::{self, CloudReference, CloudSizes};
use crate::scene::work::{Course, PhaseWork};
use crate::scene::{self, BuildContext, Estimate, Planned, Scene, SceneSpec, View};
use crate::scenes::pcp_spec::{Neighborhood, PcpContext, PcpSpec};
use crate::scenes::shapes::Shape;
use crate::scenes::work_estimate;
use crate::schemes::weakly_compressible_sph;
use crate::schemes::weakly_compressible_sph::time_step::{REFERENCE_SPEED, StepLimit, longest_step};
use crate::schemes::weakly_compressible_sph::{
    DensityMethod, Discretization, Drop, Fluid, Fluids, Geometry, Integrator, SphConfig, SphSystem, TensionForce,
    WeaklyCompressibleSph, measurement_interval,
};
use crate::simulation::{OutputPlan, Quantity, Simulation};
use crate::spec::{Coordinates, Parameter, Violation};
use rayon::prelude::{IntoParallelRefIterator, ParallelIterator};
use serde_json::{Value, json};
use std::collections::BTreeMap;

struct DropletScene<const D: usize> {
    spec: Droplet,
    shape: Shape,
    low: Vector<D>,
    high: Vector<D>,
    sides: [usize; D],
    config: SphConfig<D>,
    time_step: f64,
    steps: u64,
    chosen: BTreeMap<&'static str, String>,
    clouds: Vec<CloudReference>,
}

/// Neighbors per coefficient, where the level is overwritten at every evaluation.
const RATIO: f64 = 2.0;
/// Number of particles of a run at most.
const MOST_PARTICLES: f64 = 1e9;
/// Units of a measurement for each particle near the interface, for the enclosed shape; the sums over all particles are 1.
const QUADRATURE: f64 = 10.0;

impl SceneSpec for Droplet {
    fn plan(self) -> Planned {
        let implied = self.shape.as_ref().and_then(Shape::dimension);
        match self.dimension.or(implied).unwrap_or(2) {
            3 => plan::<3>(self),
            _ => plan::<2>(self),
        }
    }
}

fn corner<const D: usize>(name: &str, numbers: &Coordinates, errors: &mut Vec<Violation>) -> Vector<D> {
    if numbers.len() != D {
        let (at, detail) = (format!("/domain/{name}"), format!("the scene has {D} dimensions"));
        errors.push(Violation::new(at, "conflict", detail, numbers.to_json(), format!("{D} numbers")));
    }
    Vector::<D>::from_fn(|d, _| numbers.get(d).copied().unwrap_or(0.0))
}

/// Where normals and curvatures come from; the spec gets what was left open.
fn geometry(spec: &mut Droplet, case: &Case, dimension: usize, smoothing_h: f64) -> Result<Geometry, Violation> {
    let GeometryChoice::Pcp { band_h, method } = &mut spec.geometry else { return Ok(Geometry::ColorField) };
    if method.neighborhood.is_none() && method.cutoff_h.is_none() {
        method.neighborhood = Some(Neighborhood::Radius { cutoff_h: case.fits.1 });
    }
    let context = PcpContext { pointer: "/geometry", dimension, default_ratio: RATIO };
    let (planned, full) = method.clone().plan(context)?;
    if let Some(error) = full.refuse_material("/geometry", "particles mix: fits are made in space") {
        return Err(error);
    }
    *method = full;
    let least_band_h = 4.0 * smoothing_h;
    let band_h = *band_h.get_or_insert(least_band_h + 1.0);
    if band_h < least_band_h {
        let detail = "the smoothed tension reaches 2 ε to both sides";
        let allowed = format!("a number ≥ {least_band_h}");
        return Err(Violation::new("/geometry/band_h", "range", detail, band_h, allowed));
    }
    Ok(Geometry::Pcp { method: planned, half_band: 0.5 * band_h * spec.spacing })
}

/// The box, with how many particles lie along each side.
struct Sides<const D: usize> {
    low: Vector<D>,
    high: Vector<D>,
    counts: [usize; D],
}

fn sides<const D: usize>(spec: &Droplet, corners: &Corners, errors: &mut Vec<Violation>) -> Sides<D> {
    let low = corner::<D>("low", &corners.low, errors);
    let high = corner::<D>("high", &corners.high, errors);
    let lengths = high - low;
    if lengths.iter().any(|length| *length <= 0.0) {
        let detail = "the upper corner must lie above the lower one along every axis";
        errors.push(Violation::new("/domain/high", "range", detail, corners.high.to_json(), Value::Null));
    }
    let counts = lengths.map(|length| (length / spec.spacing).round());
    if errors.is_empty() && !(1.0..=MOST_PARTICLES).contains(&counts.product()) {
        let least = (lengths.product() / MOST_PARTICLES).powf(1.0 / D as f64);
        let allowed = format!("a number ≥ {least:.3e} and below every side");
        errors.push(Violation::new("/spacing", "range", "too many particles, or none", spec.spacing, allowed));
    }
    Sides { low, high, counts: std::array::from_fn(|d| counts[d].clamp(0.0, MOST_PARTICLES) as usize) }
}

/// The shape of the drop and the points that it names; the spec gets the shape.
fn drop_shape<const D: usize>(
    spec: &mut Droplet,
    case: &Case,
    lengths: &Vector<D>,
    errors: &mut Vec<Violation>,
) -> Option<(Shape, Option<CloudReference>)> {
    let Some(shape) = spec.shape.take().or_else(|| case.shape.clone()) else {
        let allowed = json!({"type": "circle"});
        errors.push(Violation::new("/shape", "required", "a custom drop needs a shape", Value::Null, allowed));
        return None;
    };
    let points = shape.points_reference("/shape", errors);
    match &shape {
        Shape::Points { .. } => {}
        known => match known.surface::<D>("/shape") {
            Ok(surface) => errors.extend(check_size(surface.as_ref(), lengths, &shape)),
            Err(found) => errors.extend(found),
        },
    }
    spec.shape = Some(shape.clone());
    Some((shape, points))
}

/// 1. Box. 2. Shape. 3. Flow, geometry and forces. 4. Time step. 5. What they mean together.
fn plan<const D: usize>(mut spec: Droplet) -> Planned {
    let mut errors = Vec::new();
    let case = Case::new(spec.case, D, spec.spacing);
    let corners = spec.domain.get_or_insert_with(|| case.domain.clone()).clone();
    let Sides { low, high, counts } = sides::<D>(&spec, &corners, &mut errors);
    let lengths = high - low;
    let shape = drop_shape(&mut spec, &case, &lengths, &mut errors);
    let flow = FlowPlan::new(&mut spec, &case, &mut errors);
    let geometry = geometry(&mut spec, &case, D, flow.smoothing_h).map_err(|error| errors.push(error)).ok();
    let given_step = spec.time_step.or(if spec.steps.is_none() { case.time_step } else { None });
    let config = sph_config(&mut spec, &case, &flow, geometry, given_step, &mut errors);
    let (time_step, steps, bound) = time_step(&spec, &config, given_step, &mut errors);
    if errors.is_empty()
        && let Err(error) = Pencils::<D>::new(&domain_of(&low, &lengths), config.cutoff())
    {
        let got = corners.to_json();
        errors.push(Violation::new("/domain", "range", error.to_string(), got, error.least));
    }
    let Some((shape, points)) = shape.filter(|_| errors.is_empty()) else {
        return Err(errors);
    };
    let mut chosen = BTreeMap::new();
    if config.is_adaptive {
        let why = format!("{time_step:.4e}: the longest that {bound} allows at the speed {REFERENCE_SPEED}");
        chosen.insert("time_step", why);
    }
    spec.dimension = Some(D);
    if spec.steps.is_none() {
        spec.time_step = given_step;
    }
    let clouds = points.into_iter().collect();
    Ok(Box::new(DropletScene { spec, shape, low, high, sides: counts, config, time_step, steps, chosen, clouds }))
}

/// What the scheme is made of; the spec gets what was left open.
fn sph_config<const D: usize>(
    spec: &mut Droplet,
    case: &Case,
    flow: &FlowPlan,
    geometry: Option<Geometry>,
    given_step: Option<f64>,
    errors: &mut Vec<Violation>,
) -> SphConfig<D> {
    let force = spec.body_force.get_or_insert_with(|| case.body_force.clone());
    let body_force = body_force(force, errors);
    SphConfig {
        spacing: spec.spacing,
        smoothing_length: flow.smoothing_h * spec.spacing,
        kernel: flow.kernel,
        fluids: Fluids { inside: Fluid::from(&spec.fluids.inside), outside: Fluid::from(&spec.fluids.outside) },
        tension: *spec.surface_tension.get_or_insert(case.tension),
        tension_force: match spec.tension_force {
            TensionWord::Balanced => TensionForce::Balanced,
            TensionWord::Csf => TensionForce::Csf,
        },
        geometry: geometry.unwrap_or(Geometry::ColorField),
        discretization: flow.discretization,
        density: flow.density,
        is_shifted: *spec.shifting.get_or_insert(flow.default_shifting) == Shifting::Pst,
        body_force,
        integrator: match spec.integrator {
            IntegratorWord::KickDriftKick => Integrator::KickDriftKick,
            IntegratorWord::PredictorCorrector => Integrator::PredictorCorrector,
        },
        is_adaptive: given_step.is_none() && spec.steps.is_none(),
        rest_below: spec.stop_when.as_ref().map(|StopWhen::AtRest { velocity }| *velocity),
    }
}

/// The time step, the number of steps, and what binds the step.
fn time_step<const D: usize>(
    spec: &Droplet,
    config: &SphConfig<D>,
    given_step: Option<f64>,
    errors: &mut Vec<Violation>,
) -> (f64, u64, &'static str) {
    if let (Some(step), Some(_)) = (spec.time_step, spec.steps) {
        let detail = "steps are given instead of a time step; give one of them";
        errors.push(Violation::new("/time_step", "conflict", detail, step, Value::Null));
    }
    let StepLimit { length: limit, cause: bound } = longest_step(config, REFERENCE_SPEED);
    let time_step = match (given_step, spec.steps) {
        (Some(step), _) => step,
        (None, Some(steps)) => spec.end_time / steps as f64,
        // A whole number of steps to a unit of time, whatever the end: a later end repeats the same steps.
        (None, None) => 1.0 / (1.0 / limit).ceil(),
    };
    let steps = (spec.end_time / time_step - 1e-9).ceil();
    if !(time_step.is_normal() && (1.0..=1e9).contains(&steps)) {
        let detail = "the run would have too many steps or none";
        let allowed = format!("a number from {:e} to {:e}", spec.end_time * 1e-9, spec.end_time);
        errors.push(Violation::new("/time_step", "range", detail, time_step, allowed));
    }
    (time_step, steps as u64, bound)
}

/// An error where the drop does not fit into the box.
fn check_size<const D: usize>(surface: &dyn Surface<D>, lengths: &Vector<D>, shape: &Shape) -> Option<Violation> {
    let (low, high) = surface.bounding_box();
    let fits = (high - low).iter().zip(lengths.iter()).all(|(size, length)| size < length);
    let detail = "the drop is as large as the box";
    (!fits).then(|| Violation::new("/shape", "conflict", detail, shape.to_json(), json!(lengths.as_slice())))
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

    /// Centers of the cells of the box.
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
            Geometry::ColorField => {
                let context = PcpContext { pointer: "/geometry", dimension: D, default_ratio: RATIO };
                PcpSpec::default().plan(context)?.0
            }
        };
        let mut surface = LevelSurface::Spatial(Box::new(Redistancing::new(method, domain, self.config.spacing)));
        let never = Interrupt::default();
        let fitted =
            surface.detect(&points, &level, &never).and_then(|()| surface.fit_samples(&points, &level, None, &never));
        if fitted.is_err() || surface.is_lost() {
            let detail = "phi of the points has no zero between them".to_owned();
            return Err(Violation::new("/shape", "data", detail, Value::Null, json!("PointData/phi of both signs")));
        }
        let distance = |x: &Vector<D>| {
            let foot = surface.query(x, f64::INFINITY)?;
            Some(if surface.is_inside(x, &foot) { -foot.distance } else { foot.distance })
        };
        Ok(positions.par_iter().map(|x| distance(x).unwrap_or(f64::INFINITY)).collect())
    }
}

impl<const D: usize> Scene for DropletScene<D> {
    fn kind(&self) -> &'static str {
        super::KIND.kind
    }

    fn dimension(&self) -> usize {
        D
    }

    fn spacing(&self) -> Option<f64> {
        Some(self.spec.spacing)
    }

    fn resolved(&self) -> Value {
        scene::resolved(super::KIND.kind, &self.spec)
    }

    fn view(&self) -> View {
        let has_distance = self.config.has_tension() && matches!(self.config.geometry, Geometry::Pcp { .. });
        if has_distance { View::DISTANCE } else { View::Nothing }
    }

    fn fields(&self) -> Vec<&'static Quantity> {
        weakly_compressible_sph::frame_fields::shown(&self.config)
    }

    fn clouds(&self) -> Vec<CloudReference> {
        self.clouds.clone()
    }

    fn estimate(&self, _sizes: &CloudSizes) -> Estimate {
        let particles = self.count();
        // Columns, their gathered copies, a state and a frame in the making; ranges of neighbors.
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
            let surface = self.shape.surface::<D>("/shape")?;
            (self.levels(surface.as_ref(), &positions), surface.area_or_volume())
        } else {
            (self.levels_of_points(&context, &positions).map_err(|found| vec![found])?, f64::NAN)
        };
        let cell = lengths.product() / self.count() as f64;
        let drop = Drop { positions, level, measure };
        let system = SphSystem::new(self.config.clone(), domain, cell, drop, context.interrupt).map_err(|error| {
            vec![Violation::new("/domain", "range", error.to_string(), self.spec.domain.to_json(), error.least)]
        })?;
        let (plan, clock) = (context.plan, context.cpu_clock);
        let chosen = self.chosen.clone();
        Ok(Box::new(WeaklyCompressibleSph::new(system, self.time_step, self.spec.end_time, plan, clock, chosen)))
    }
}

impl<const D: usize> DropletScene<D> {
    /// Particles within a band of this width about the drop, about: that of a ball of its measure, which is taken for a fifth of the
    /// box where it is not known.
    fn near(&self, width: f64) -> f64 {
        let surface = self.shape.surface::<D>("/shape");
        let measure = surface.map_or_else(|_| self.lengths().product() / 5.0, |surface| surface.area_or_volume());
        let area = if D == 2 {
            2.0 * (std::f64::consts::PI * measure).sqrt()
        } else {
            (36.0 * std::f64::consts::PI).cbrt() * measure.powf(2.0 / 3.0)
        };
        (area * width / self.config.spacing.powi(D as i32)).min(self.count() as f64)
    }
}
