//! From the spec of a `redistance` scene to resting particles.

use super::cloud_spacing;
use super::spec::{Initial, Kernel, Method, Queries, Redistance};
use crate::closest_point::PcpMethod;
use crate::geometry::Surface;
use crate::geometry::lattice::Lattice;
use crate::scene::cloud::{self, CloudReference, CloudRole, CloudSizes};
use crate::scene::work::{Course, PhaseWork};
use crate::scene::{self, BuildContext, Estimate, Planned, Scene, SceneSpec, View};
use crate::scenes::particle_estimate::{check_extent, half_extent, memory_bytes, shape_particles};
use crate::scenes::pcp_spec::PcpContext;
use crate::scenes::shapes::{Shape, ShapeSurface};
use crate::scenes::work_estimate;
use crate::schemes::static_redistancing;
use crate::schemes::static_redistancing::{
    InitialLevel, RemeshingKernel, StaticParts, StaticRedistancing, StaticSystem, grid_method,
};
use crate::simulation::{OutputPlan, Quantity, Simulation};
use crate::spec::{Choice, Parameter, Violation};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Width of the band that is not given, in h.
const DEFAULT_BAND_H: f64 = 12.0;

struct RedistanceScene<const D: usize> {
    spec: Redistance,
    shape: Shape,
    /// The surface of the shape; none where points from outside tell it.
    surface: Option<ShapeSurface<D>>,
    lattice: Lattice,
    method: PcpMethod,
    remeshing: Option<RemeshingKernel>,
    initial: InitialLevel<D>,
    half_band: f64,
    clouds: Vec<CloudReference>,
}

impl SceneSpec for Redistance {
    fn plan(self) -> Planned {
        let implied = self.shape.as_ref().and_then(Shape::dimension);
        match self.dimension.or(implied).unwrap_or(2) {
            3 => plan::<3>(self),
            _ => plan::<2>(self),
        }
    }
}

/// 1. Shape, points and queries. 2. Method. 3. Level at the start. 4. Band. 5. What they mean together.
fn plan<const D: usize>(mut spec: Redistance) -> Planned {
    let mut errors = Vec::new();
    let shape = spec.shape.get_or_insert_with(|| Shape::ellipsoid(D, [0.75, 0.5, 0.5])).clone();
    let points = shape.points_reference("/shape", &mut errors);
    let surface = if shape.is_from_outside() {
        None
    } else {
        shape.surface::<D>("/shape").map_err(|found| errors.extend(found)).ok()
    };
    let asked = match &spec.queries {
        Queries::Particles => None,
        Queries::Points { source } => source.reference("/queries", CloudRole::Queries, &mut errors),
    };
    // A mesh is a surface, without a level of its own.
    let has_points = points.as_ref().is_some_and(|points| points.role == CloudRole::Points);
    check_sources(&spec, has_points, asked.is_some(), &mut errors);
    let method = method(&mut spec, D).map_err(|error| errors.push(error)).ok();
    if let Method::Pcp { method } = &spec.method {
        errors
            .extend(method.refuse_material("/method", "particles at rest have no initial positions beside their own"));
    }
    let initial = initial::<D>(&mut spec, &shape, has_points, &mut errors);
    let band = band(&mut spec, &mut errors);
    if let (Some(surface), Some((method, _))) = (&surface, &method) {
        let reach = (0.5 * band).max(method.fit_band_h::<D>() * spec.spacing);
        errors.extend(check_extent(surface.whole.as_ref(), reach, spec.spacing));
        if initial == InitialLevel::Scaled && !is_scaling_positive(surface.whole.as_ref(), reach) {
            let detail = "the factor 1 + 0.5 x + 0.3 y must be positive over the whole band";
            errors.push(Violation::new("/initial", "conflict", detail, "scaled", json!(["quadric", "distance"])));
        }
    }
    if let (Shape::Mesh { .. }, InitialLevel::Scaled) = (&shape, &initial) {
        let detail = "where a mesh lies, and so the sign of 1 + 0.5 x + 0.3 y, is not known before it is read";
        errors.push(Violation::new("/initial", "conflict", detail, "scaled", json!(["distance"])));
    }
    let Some((method, remeshing)) = method.filter(|_| errors.is_empty()) else {
        return Err(errors);
    };
    spec.dimension = Some(D);
    let lattice = Lattice { spacing: spec.spacing, offset: 0.0, jitter: spec.jitter, seed: spec.seed };
    let clouds = points.into_iter().chain(asked).collect();
    Ok(Box::new(RedistanceScene::<D> {
        spec,
        shape,
        surface,
        lattice,
        method,
        remeshing,
        initial,
        half_band: 0.5 * band,
        clouds,
    }))
}

/// What does not go together with points from outside.
fn check_sources(spec: &Redistance, has_points: bool, is_asked: bool, errors: &mut Vec<Violation>) {
    if is_asked && spec.repeat > 1 {
        let detail = "points that are only asked about have no level to be redistanced again";
        errors.push(Violation::new("/repeat", "conflict", detail, spec.repeat, 1));
    }
    if let Method::Remesh { .. } = spec.method
        && (is_asked || has_points)
    {
        let detail = "the remeshing baseline works with particles about a shape alone";
        errors.push(Violation::new("/method", "conflict", detail, "remesh", json!(["pcp"])));
    }
}

/// The method, with the kernel of a remeshing; the spec gets what was left open.
fn method(spec: &mut Redistance, dimension: usize) -> Result<(PcpMethod, Option<RemeshingKernel>), Violation> {
    match &mut spec.method {
        Method::Pcp { method } => {
            // Of several in a row, distances become the input of the next redistancing.
            let default_ratio = if spec.repeat > 1 { 2.0 } else { 1.5 };
            let context = PcpContext { pointer: "/method", dimension, default_ratio };
            let (planned, full) = method.clone().plan(context)?;
            *method = full;
            Ok((planned, None))
        }
        Method::Remesh { kernel } => {
            let default = 1.5 * (1.0 / (16.0 * spec.spacing)).powf(0.35);
            let kernel = match kernel {
                Kernel::Lambda44 => RemeshingKernel::Lambda44,
                Kernel::Lambda44Normalized => RemeshingKernel::Lambda44Normalized,
                Kernel::WendlandC2 { smoothing_h } => {
                    RemeshingKernel::WendlandC2 { smoothing_h: *smoothing_h.get_or_insert(default) }
                }
                Kernel::Gaussian { smoothing_h } => {
                    RemeshingKernel::Gaussian { smoothing_h: *smoothing_h.get_or_insert(default) }
                }
            };
            Ok((grid_method(), Some(kernel)))
        }
    }
}

/// The level-set function at the start. Points come with their level: there is nothing to choose.
fn initial<const D: usize>(
    spec: &mut Redistance,
    shape: &Shape,
    has_points: bool,
    errors: &mut Vec<Violation>,
) -> InitialLevel<D> {
    if let (true, Some(given)) = (has_points, &spec.initial) {
        errors.push(Violation::new(
            "/initial",
            "conflict",
            "points come with their level",
            given.to_json(),
            Value::Null,
        ));
    }
    let quadric = shape.quadric::<D>();
    let default = if quadric.is_some() { Initial::Quadric } else { Initial::Distance };
    let chosen = spec.initial.clone().unwrap_or(default);
    let level = match (&chosen, quadric) {
        (Initial::Distance, _) => InitialLevel::Distance,
        (Initial::Scaled, _) => InitialLevel::Scaled,
        (Initial::Quadric, Some((center, semi_axes))) => InitialLevel::Quadric { center, semi_axes },
        (Initial::Quadric, None) => {
            if !has_points {
                let detail = "the quadric belongs to circles, spheres, ellipses and ellipsoids";
                let allowed = json!(["distance", "scaled"]);
                errors.push(Violation::new("/initial", "conflict", detail, chosen.name(), allowed));
            }
            InitialLevel::Distance
        }
    };
    spec.initial = (!has_points).then_some(chosen);
    level
}

/// The width of the band; the spec then has it as a length.
fn band(spec: &mut Redistance, errors: &mut Vec<Violation>) -> f64 {
    if let (Some(band), Some(_)) = (spec.band, spec.band_h) {
        let detail = "band_h is the band in multiples of h; give one of them";
        errors.push(Violation::new("/band", "conflict", detail, band, Value::Null));
    }
    let in_spacings = spec.band_h.take().unwrap_or(DEFAULT_BAND_H);
    *spec.band.get_or_insert(in_spacings * spec.spacing)
}

/// Whether 1 + 0.5 x + 0.3 y is positive wherever particles are made.
fn is_scaling_positive<const D: usize>(surface: &dyn Surface<D>, reach: f64) -> bool {
    let (low, _) = surface.bounding_box();
    1.0 + 0.5 * (low[0] - reach) + 0.3 * (low[1] - reach) > 0.0
}

impl<const D: usize> Scene for RedistanceScene<D> {
    fn kind(&self) -> &'static str {
        super::KIND.kind
    }

    fn dimension(&self) -> usize {
        D
    }

    fn spacing(&self) -> Option<f64> {
        Some(self.lattice.spacing)
    }

    fn size(&self) -> Option<f64> {
        self.surface.as_ref().map(|surface| half_extent(surface.whole.as_ref()))
    }

    fn choices(&self) -> Vec<(&'static str, Vec<Value>)> {
        let degree = |degree: u64| json!({"type": "pcp", "degree": degree});
        vec![("/method", [3, 4, 5, 6].map(degree).to_vec())]
    }

    /// Fits of degree n about smooth shapes: the distance has the order n + 1, and every derivative loses one.
    fn order(&self, quantity: &str, _norm: &str) -> Option<f64> {
        let Method::Pcp { method } = &self.spec.method else { return None };
        self.shape.quadric::<D>()?;
        let lost = match quantity {
            "phi" | "closest_point" => 0.0,
            "normal" => 1.0,
            "curvature" => 2.0,
            _ => return None,
        };
        Some(method.degree as f64 + 1.0 - lost)
    }

    fn resolved(&self) -> Value {
        scene::resolved(super::KIND.kind, &self.spec)
    }

    fn view(&self) -> View {
        View::DISTANCE
    }

    fn fields(&self) -> Vec<&'static Quantity> {
        static_redistancing::quantities::fields()
    }

    fn clouds(&self) -> Vec<CloudReference> {
        self.clouds.clone()
    }

    fn estimate(&self, sizes: &CloudSizes) -> Estimate {
        let beyond = self.remeshing.map_or(0.0, RemeshingKernel::reach_h::<D>) * self.lattice.spacing;
        let reach = self.half_band.max(self.method.fit_band_h::<D>() * self.lattice.spacing) + beyond;
        let surface = self.surface.as_ref().map(|surface| surface.whole.as_ref());
        let particles = shape_particles(surface, sizes.get("/shape"), reach, self.lattice.spacing);
        Estimate {
            particles,
            steps: self.spec.repeat,
            time_step: 1.0,
            end_time: self.spec.repeat as f64,
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
        let times = self.spec.repeat as f64;
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
            repeats: self.spec.repeat,
            method: self.method.clone(),
            remeshing: self.remeshing,
        };
        let clouds = &context.clouds;
        let is_needed = |pointer: &str| self.clouds.iter().any(|cloud| cloud.pointer == pointer);
        let surface = self.shape.surface_at_build(self.surface.as_ref(), clouds, (self.half_band, parts.spacing))?;
        let mut system = if let Some(surface) = &surface {
            StaticSystem::about(surface.boxed(), &self.lattice, self.initial, parts, context.interrupt)
        } else {
            let (points, levels) = cloud::points_with_levels::<D>(clouds, "/shape").map_err(|found| vec![found])?;
            let metric = cloud_spacing::metric(&points, &levels, parts.spacing, &context.interrupt)?;
            StaticSystem::of_points(points, &levels, metric, parts, context.interrupt)
        };
        if is_needed("/queries") {
            system = system.asked_about(cloud::points::<D>(clouds, "/queries").map_err(|found| vec![found])?);
        }
        Ok(Box::new(StaticRedistancing::new(system, context.cpu_clock, method).with_plan(context.plan)))
    }
}
