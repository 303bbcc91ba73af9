//! From the spec of a `droplet` scene to two fluids in a box.

use super::carving;
use super::cases::Case;
use super::dimensionless;
use super::flow::{FlowPlan, body_force};
use super::formulation::{Scope, level_and_curvature, pressures};
use super::hydrostatic::{Hydrostatic, pressure_of_height};
use super::layer::{check_layer, standing_wave, steady_flow};
use super::numbers::{SceneNumbers, smallest_radius};
use super::obstacles;
use super::own_motion::{StartMotion, motion_at_start};
use super::room::{Room, check_needs, check_size, surround};
use super::shear;
use super::spec::{BoxSpec, Droplet, GeometryChoice, IntegratorWord, NumbersSpec, Shifting, StopWhen, TensionWord};
use super::start_lattice::{StartLattice, start_lattice};
use super::steps::time_step;
use super::stirring::{self, SHIFTING, SHIFTING_BETWEEN_WALLS, is_stirred};
use super::varying_tension::{StartBox, largest_tension, tension_law};
use crate::geometry::Vector;
use crate::scene::cloud::{CloudReference, CloudSizes};
use crate::scene::work::{Course, PhaseWork};
use crate::scene::{self, BuildContext, Estimate, Planned, Scene, SceneSpec, View};
use crate::scenes::pcp_spec::{Neighborhood, PcpContext};
use crate::scenes::shapes::{Shape, ShapeSurface};
use crate::scenes::work_estimate;
use crate::schemes::weakly_compressible_sph;
use crate::schemes::weakly_compressible_sph::{
    BodyForce, DensityMethod, Discretization, Drop, Geometry, Integrator, LevelUpdate, SphConfig, SphSystem,
    TensionForce, WeaklyCompressibleSph, measurement_interval,
};
use crate::simulation::{Finding, OutputPlan, Quantity, Region, Simulation};
use crate::spec::{Parameter, Violation};
use serde_json::{Value, json};
use std::collections::BTreeMap;

pub(super) struct DropletScene<const D: usize> {
    pub(super) spec: Droplet,
    pub(super) shape: Shape,
    /// Motion of the fluids at the start, where it is given.
    pub(super) motion: Option<StartMotion>,
    /// The surface of the shape; none of a layer, and where points from outside tell it.
    pub(super) surface: Option<ShapeSurface<D>>,
    pub(super) room: Room<D>,
    lattice: StartLattice<D>,
    /// Share of the box that bodies leave free.
    free_share: f64,
    numbers: SceneNumbers,
    pub(super) config: SphConfig<D>,
    time_step: f64,
    steps: u64,
    chosen: BTreeMap<&'static str, String>,
    clouds: Vec<CloudReference>,
}

/// Neighbors per coefficient, where the level is overwritten at every evaluation.
pub(super) const RATIO: f64 = 2.0;
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

/// Where normals and curvatures come from; the spec gets what was left open.
fn geometry(
    spec: &mut Droplet,
    case: &Case,
    scope: Scope,
    (smoothing_h, smoothing_length): (f64, f64),
    errors: &mut Vec<Violation>,
) -> Result<Geometry, Violation> {
    let (level_update, curvature_filter) = level_and_curvature(spec, scope, errors);
    let GeometryChoice::Pcp { band_h, method } = &mut spec.geometry else { return Ok(Geometry::ColorField) };
    if method.neighborhood.is_none() && method.cutoff_h.is_none() {
        method.neighborhood = Some(Neighborhood::Radius { cutoff_h: case.fits.1 });
    }
    let context = PcpContext { pointer: "/geometry", dimension: scope.dimension, default_ratio: RATIO };
    let (planned, full) = method.clone().plan(context)?;
    if let Some(error) = full.refuse_material("/geometry", "particles mix: fits are made in space") {
        return Err(error);
    }
    *method = full;
    let band_h = *band_h.get_or_insert(4.0 * smoothing_h + 1.0);
    let least_band_h = 4.0 * smoothing_length / spec.spacing;
    // Up to rounding: a width that is given as 4 ε/h is wide enough.
    if band_h < least_band_h * (1.0 - 1e-12) {
        let detail = "the smoothed tension reaches 2 ε to both sides";
        let allowed = format!("a number ≥ {least_band_h}");
        return Err(Violation::new("/geometry/band_h", "range", detail, band_h, allowed));
    }
    let half_band = 0.5 * band_h * spec.spacing;
    Ok(Geometry::Pcp { method: planned, half_band, level_update, curvature_filter })
}

/// The shape of a drop, its surface where that is known before the run, and the points that it names.
type DropShape<const D: usize> = (Shape, Option<ShapeSurface<D>>, Option<CloudReference>);

/// The shape of the drop; the spec gets it.
fn drop_shape<const D: usize>(
    spec: &mut Droplet,
    case: &Case,
    (room, corners): (&Room<D>, &BoxSpec),
    errors: &mut Vec<Violation>,
) -> Option<DropShape<D>> {
    let Some(shape) = spec.shape.take().or_else(|| case.shape.clone()) else {
        let allowed = json!({"type": "circle"});
        errors.push(Violation::new("/shape", "required", "a custom drop needs a shape", Value::Null, allowed));
        return None;
    };
    let points = shape.points_reference("/shape", errors);
    let mut shape = shape;
    let mut surface = None;
    if let Shape::Layer { .. } = shape {
        check_layer(&mut shape, room, errors);
    } else if !shape.is_from_outside() {
        surface = shape.surface::<D>("/shape").map_err(|found| errors.extend(found)).ok();
        errors.extend(surface.as_ref().and_then(|surface| check_size(surface.whole.as_ref(), (room, corners), &shape)));
    }
    spec.shape = Some(shape.clone());
    Some((shape, surface, points))
}

/// The smoothing length ε. It is measured by the volume of a particle; version 0.1 and the paper take the spacing as it was given.
fn smoothing_length<const D: usize>(
    spec: &Droplet,
    flow: &FlowPlan,
    (lattice, is_box): (&StartLattice<D>, bool),
    lengths: &Vector<D>,
) -> f64 {
    let is_by_volume = spec.tension_force == TensionWord::Balanced && is_box && lattice.count() >= 1.0;
    let volume = lengths.product() / lattice.count();
    flow.smoothing_h * if is_by_volume { volume.powf(1.0 / D as f64) } else { spec.spacing }
}

/// The box of a scene with its bodies, and the meshes that they name.
fn room<const D: usize>(
    spec: &Droplet,
    case: &Case,
    corners: &BoxSpec,
    errors: &mut Vec<Violation>,
) -> (Room<D>, Vec<CloudReference>) {
    let given = spec.obstacles.as_ref().map_or(&[][..], |obstacles| &obstacles.0);
    let (bodies, clouds) = obstacles::plan::<D>(given, errors);
    let mut room = Room::<D>::new(corners, bodies, errors);
    room.needs_angles = spec.surface_tension.unwrap_or(case.tension) > 0.0;
    (room, clouds)
}

/// 1. Box. 2. Shape. 3. Flow, geometry and forces. 4. Time step. 5. What they mean together.
fn plan<const D: usize>(mut spec: Droplet) -> Planned {
    let mut errors = Vec::new();
    let case = Case::new(spec.case, D, spec.spacing);
    let corners = spec.domain.get_or_insert_with(|| case.domain.clone()).clone();
    let (mut room, mut clouds) = room::<D>(&spec, &case, &corners, &mut errors);
    let (low, lengths) = (room.low, room.lengths());
    let is_box = errors.is_empty();
    let shape = drop_shape(&mut spec, &case, (&room, &corners), &mut errors);
    let flow = FlowPlan::new(&mut spec, &case, D, &mut errors);
    let lattice = start_lattice(&spec, flow.lattice, &lengths, is_box, &mut errors);
    let given_step = spec.time_step.or(if spec.steps.is_none() { case.time_step } else { None });
    let smoothing_length = smoothing_length(&spec, &flow, (&lattice, is_box), &lengths);
    let geometry = geometry(&mut spec, &case, flow.scope, (flow.smoothing_h, smoothing_length), &mut errors);
    let geometry = geometry.map_err(|error| errors.push(error)).ok();
    let tension = *spec.surface_tension.get_or_insert(case.tension);
    let surface = shape.as_ref().and_then(|(_, surface, _)| surface.as_ref());
    let parts = part_count(shape.as_ref().map(|(shape, ..)| shape), surface);
    let (velocity, motion, speeds) = motion_at_start::<D>(&spec, parts, &room, &mut errors);
    let start = StartBox { shape: shape.as_ref().map(|(shape, ..)| shape), surface, low, lengths };
    let speeds = shear::with_shear(speeds, room.mean_shear.as_ref(), (start.shape, start.radius()));
    let numbers =
        SceneNumbers::new(start.radius(), [tension, tension * largest_tension(&spec, &start)], speeds, &lengths);
    let expected_speed = numbers.expected_speed(&spec);
    let scheme = (geometry, smoothing_length, expected_speed, &room);
    let mut config = sph_config(&mut spec, &case, &flow, scheme, given_step, &mut errors);
    (config.is_at_rest, config.start_velocity) = (motion.is_none(), velocity);
    config.tension_law = tension_law(&spec, &start, &config, &mut errors);
    let named = shape.as_ref().map(|(shape, ..)| shape);
    config.wave = named.and_then(|shape| standing_wave(shape, &spec, (tension, config.body_force.as_ref()), &room));
    let (time_step, steps, bound) = time_step(&spec, &config, given_step, &mut errors);
    errors.extend(surround(&mut room, (&lattice, is_box), &config, &corners));
    let drop = shape.as_ref().and_then(|(shape, surface, _)| Some((shape, surface.as_ref()?.whole.as_ref())));
    carving::check(&room, drop, &mut errors);
    enclose(&mut config, named, &spec, (&room, &numbers, flow.scope), &mut errors);
    numbers.check_sound_speeds(&spec, &mut errors);
    dimensionless::complete(&mut spec, &numbers, &mut errors);
    let Some((shape, surface, points)) = shape.filter(|_| errors.is_empty()) else {
        return Err(errors);
    };
    let why = format!("{time_step:.4e}: the longest that {bound} allows at the speed {expected_speed:.4}");
    let chosen = config.is_adaptive.then_some(("time_step", why)).into_iter().collect();
    clouds.extend(points);
    spec.dimension = Some(D);
    spec.time_step = if spec.steps.is_none() { given_step } else { spec.time_step };
    Ok(Box::new(DropletScene {
        spec,
        shape,
        motion,
        surface,
        free_share: carving::free_share(&room),
        room,
        lattice,
        numbers,
        config,
        time_step,
        steps,
        chosen,
        clouds,
    }))
}

/// Puts walls around the fluids, where there are any, or shears the box.
fn enclose<const D: usize>(
    config: &mut SphConfig<D>,
    shape: Option<&Shape>,
    spec: &Droplet,
    (room, numbers, scope): (&Room<D>, &SceneNumbers, Scope),
    errors: &mut Vec<Violation>,
) {
    shear::check(spec, config, scope, errors);
    let is_flat = matches!(shape, Some(Shape::Layer { amplitude: 0.0, .. }));
    config.starts_in_layers = is_flat && (room.container.is_some() || room.mean_shear.is_some());
    if room.container.is_none() {
        return;
    }
    check_needs(spec, scope.is_summation, config.has_tension(), errors);
    config.container.clone_from(&room.container);
    config.steady_flow = shape.and_then(|shape| steady_flow(shape, config, room));
    config.hydrostatic_pressure = pressure_of_height(spec, config, room, numbers);
}

/// Number of parts of a drop; None where its shape is refused.
fn part_count<const D: usize>(shape: Option<&Shape>, surface: Option<&ShapeSurface<D>>) -> Option<usize> {
    // A layer, and what points from outside tell, is one part.
    let is_one = |shape: &&Shape| shape.is_from_outside() || matches!(shape, Shape::Layer { .. });
    surface.map(|surface| surface.parts.len()).or_else(|| shape.filter(is_one).map(|_| 1))
}

/// Geometry, smoothing length, expected speed, and the box.
type SchemeParts<'a, const D: usize> = (Option<Geometry>, f64, f64, &'a Room<D>);

/// What the scheme is made of; the spec gets what was left open.
fn sph_config<const D: usize>(
    spec: &mut Droplet,
    case: &Case,
    flow: &FlowPlan,
    (geometry, smoothing_length, expected_speed, room): SchemeParts<'_, D>,
    given_step: Option<f64>,
    errors: &mut Vec<Violation>,
) -> SphConfig<D> {
    let force = spec.body_force.get_or_insert_with(|| case.body_force.clone());
    let body_force = body_force(force, &spec.fluids, (room, spec.end_time), errors);
    let pressure = pressures(spec, flow.scope, errors);
    let is_stirred = flow.scope.is_summation && is_stirred(spec, body_force.as_ref(), room);
    let default_shifting = if is_stirred { Shifting::Pst } else { flow.default_shifting };
    SphConfig {
        spacing: spec.spacing,
        smoothing_length,
        pressure,
        kernel: flow.kernel,
        fluids: spec.fluids.planned(),
        tension: *spec.surface_tension.get_or_insert(case.tension),
        tension_force: match spec.tension_force {
            TensionWord::Balanced => TensionForce::Balanced,
            TensionWord::Balanced01 => TensionForce::BalancedUncorrected,
            TensionWord::Csf => TensionForce::Csf,
        },
        tension_law: None,
        geometry: geometry.unwrap_or(Geometry::ColorField),
        discretization: flow.discretization,
        density: flow.density,
        is_shifted: *spec.shifting.get_or_insert(default_shifting) == Shifting::Pst,
        shifting_rate: if room.container.is_some() || room.mean_shear.is_some() {
            SHIFTING_BETWEEN_WALLS
        } else {
            SHIFTING
        },
        body_force,
        integrator: match spec.integrator {
            IntegratorWord::KickDriftKick => Integrator::KickDriftKick,
            IntegratorWord::PredictorCorrector => Integrator::PredictorCorrector,
        },
        start_velocity: Vector::<D>::zeros(),
        is_at_rest: true,
        wave: None,
        mean_shear: room.mean_shear,
        container: None,
        starts_in_layers: false,
        steady_flow: None,
        hydrostatic_pressure: 0.0,
        expected_speed,
        is_adaptive: given_step.is_none() && spec.steps.is_none(),
        rest_below: spec.stop_when.as_ref().map(|StopWhen::AtRest { velocity }| *velocity),
    }
}

impl<const D: usize> DropletScene<D> {
    /// What puts fluids between walls to rest under gravity.
    fn hydrostatic(&self) -> Option<Hydrostatic<'_, D>> {
        let Some(BodyForce::Constant(gravity)) = &self.config.body_force else { return None };
        self.room.container.as_ref()?;
        let fluids = &self.config.fluids;
        Some(Hydrostatic { room: &self.room, fluids, gravity: *gravity, spacing: self.config.spacing })
    }

    pub(super) fn lengths(&self) -> Vector<D> {
        self.room.lengths()
    }

    pub(super) fn count(&self) -> u64 {
        (self.lattice.count() * self.free_share).round() as u64
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

    fn size(&self) -> Option<f64> {
        smallest_radius(&self.shape, self.surface.as_ref())
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

    fn regions(&self) -> Vec<Region> {
        let mut regions = vec![Region::All, Region::Inside, Region::Outside];
        if self.config.has_tension() && matches!(self.config.geometry, Geometry::Pcp { .. }) {
            regions.push(Region::Interface);
        }
        regions
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
            memory_bytes: particles.saturating_mul(bytes).saturating_add(self.surfactant_bytes()),
        }
    }

    fn warnings(&self) -> Vec<Finding> {
        let mut warnings = self.numbers.soft_fluids(&self.spec);
        warnings.extend(stirring::held_back(&self.config, &self.room));
        warnings
    }

    fn numbers(&self) -> Vec<(&'static str, f64)> {
        self.spec.numbers.as_ref().map_or_else(Vec::new, NumbersSpec::named)
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
            PhaseWork::every_step("sph/tension", (particles + self.exchange_work()) * evaluations),
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
                Geometry::Pcp { method, half_band, level_update, curvature_filter } => {
                    let band = self.near(2.0 * half_band);
                    let carried = match level_update {
                        LevelUpdate::Transparent { radius, .. } => Some(*radius),
                        LevelUpdate::Overwrite => None,
                    };
                    if let Some(radius) = carried.or(*curvature_filter) {
                        // Each place sums over the clusters within the radius along the interface.
                        let clusters = (radius / self.config.spacing).powi(D as i32 - 1);
                        work.push(PhaseWork::every_step("redistancing/filter", band * clusters * evaluations));
                    }
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
        let domain = self.room.domain();
        let (mut positions, mut behind_walls) = self.lattice.positions(&self.room.low, &lengths, &self.room.layers);
        let container = carving::container_at_build(&self.room, &context.clouds)?;
        let behind = container.as_ref();
        let drop = self.start_drop(&context)?;
        let carved =
            carving::carve(&self.room, behind, &mut positions, &mut behind_walls).map_err(|found| vec![found])?;
        if !carved.is_empty() {
            let level = self.levels_at(&drop, &context, &carved)?;
            let fault = carving::check_drop((&self.room, behind), &self.shape, (&carved, &level));
            if let Some(fault) = fault {
                return Err(vec![fault]);
            }
        }
        let level = self.levels_at(&drop, &context, &positions)?;
        let measure = self.start_measure(&drop, behind);
        let cell = lengths.product() / self.lattice.count();
        let velocities = match &self.motion {
            Some(motion) => Some(self.start_velocities(motion, &positions, &level)?),
            None => None,
        };
        let level = match self.hydrostatic() {
            Some(hydrostatic) => {
                hydrostatic.settle(&mut positions, &level, &mut behind_walls);
                self.levels_at(&drop, &context, &positions)?
            }
            None => level,
        };
        let config = SphConfig { container, ..self.config.clone() };
        let drop = Drop { positions, level, velocities, measure, behind_walls };
        let system = SphSystem::new(config, domain, cell, drop, context.interrupt).map_err(|error| {
            vec![Violation::new("/domain", "range", error.to_string(), self.spec.domain.to_json(), error.least)]
        })?;
        let (plan, clock) = (context.plan, context.cpu_clock);
        let chosen = self.chosen.clone();
        let end_time = self.spec.end_time;
        let mut simulation = WeaklyCompressibleSph::new(system, self.time_step, end_time, plan, clock, chosen);
        simulation.course_mut().findings.extend(self.warnings());
        Ok(Box::new(simulation))
    }
}
