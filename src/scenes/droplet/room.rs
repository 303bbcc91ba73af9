//! The box of a scene: its corners, its walls, and the layers of points behind them.

use super::given_wall::wall;
use super::obstacles::PlannedObstacle;
use super::shear::mean_shear;
use super::spec::{AxisSpec, BoxSpec, Droplet, GeometryChoice};
use super::start_lattice::StartLattice;
use super::vectors::vector;
use crate::geometry::domain::Axis;
use crate::geometry::{Domain, Surface, Vector};
use crate::neighbors::Pencils;
use crate::scenes::shapes::Shape;
use crate::schemes::weakly_compressible_sph::walls::{Container, Wall};
use crate::schemes::weakly_compressible_sph::{MeanShear, SphConfig};
use crate::spec::{Choice, Parameter, Violation};
use serde_json::{Value, json};

/// The space for the fluids, and what is around it.
#[derive(Clone)]
pub(super) struct Room<const D: usize> {
    pub low: Vector<D>,
    pub high: Vector<D>,
    pub container: Option<Container<D>>,
    /// The mean flow where the box is in shear.
    pub mean_shear: Option<MeanShear>,
    /// Cells of the lattice behind each end of each axis; 0 along periodic ones.
    pub layers: [usize; D],
    /// Thickness of these layers.
    depth: Vector<D>,
    /// Bodies in the box.
    pub obstacles: Vec<PlannedObstacle<D>>,
    /// Whether an interface that meets walls needs their contact angles.
    pub needs_angles: bool,
    /// The least thickness of layers of points behind walls.
    pub least_layer: f64,
}

impl<const D: usize> Room<D> {
    /// The box of a spec.
    pub fn new(spec: &BoxSpec, obstacles: Vec<PlannedObstacle<D>>, errors: &mut Vec<Violation>) -> Self {
        let low = vector::<D>("/domain/low", &spec.low, errors);
        let high = vector::<D>("/domain/high", &spec.high, errors);
        if (high - low).iter().any(|length| *length <= 0.0) {
            let detail = "the upper corner must lie above the lower one along every axis";
            errors.push(Violation::new("/domain/high", "range", detail, spec.high.to_json(), Value::Null));
        }
        let sides = sides(spec, errors).or_else(|| (!obstacles.is_empty()).then_some([const { None }; D]));
        let axes = spec.axes.as_ref().map_or(&[][..], |axes| &axes.0);
        let mean_shear = if axes.len() == D { mean_shear(axes, (&low, &high), errors) } else { None };
        let container = sides.map(|sides| Container::new(low, high, sides));
        Self {
            low,
            high,
            container,
            mean_shear,
            layers: [0; D],
            depth: Vector::<D>::zeros(),
            obstacles,
            needs_angles: true,
            least_layer: 0.0,
        }
    }

    /// Lengths of the space for the fluids.
    pub fn lengths(&self) -> Vector<D> {
        self.high - self.low
    }

    /// Whether an axis has walls.
    pub fn is_bounded(&self, axis: usize) -> bool {
        self.container.as_ref().is_some_and(|container| container.is_bounded(axis))
    }

    /// Adds layers of the lattice behind the walls, at least of a thickness.
    pub fn add_layers(&mut self, lattice: &StartLattice<D>, thickness: f64) {
        let edges = lattice.edges(&self.lengths());
        self.least_layer = thickness;
        for d in 0..D {
            if !self.is_bounded(d) {
                continue;
            }
            self.layers[d] = (thickness / edges[d]).ceil().clamp(1.0, 1e6) as usize;
            self.depth[d] = self.layers[d] as f64 * edges[d];
        }
    }

    /// The space in which positions are compared: with its layers a box is periodic along every axis, and what lies behind one wall
    /// is farther from what lies in front of the other than anything reaches.
    pub fn domain(&self) -> Domain<D> {
        let lengths = self.lengths() + self.depth * 2.0;
        Domain::new(std::array::from_fn(|d| Axis::Periodic { start: self.low[d] - self.depth[d], length: lengths[d] }))
    }

    /// Gravity as it presses on walls, and the speed that walls and a gravity along them set the fluids going at.
    ///
    /// Along a periodic axis a force meets no wall: between walls that hold the fluids it drives the flow of Poiseuille, at most
    /// |g| H²/(8ν), or what falls freely until then.
    pub fn driven(&self, spec: &Droplet, acceleration: &Vector<D>) -> (f64, f64) {
        let Some(container) = &self.container else { return (acceleration.norm(), 0.0) };
        let bounded = |d: usize| if container.is_bounded(d) { acceleration[d] } else { 0.0 };
        let across = Vector::<D>::from_fn(|d, _| bounded(d));
        let along = (acceleration - across).norm();
        let holds = container.walls().any(|wall| wall.holds_fluid);
        let kinematic = [&spec.fluids.inside, &spec.fluids.outside].map(|fluid| fluid.viscosity / fluid.density);
        let least = kinematic[0].min(kinematic[1]);
        let poiseuille = self.gap().filter(|_| holds).map_or(f64::INFINITY, |gap| along * gap * gap / (8.0 * least));
        let falling = (2.0 * along * self.lengths().max()).sqrt();
        let slide = if along > 0.0 { poiseuille.min(falling) } else { 0.0 };
        (across.norm(), slide.max(self.wall_speed()))
    }

    /// The largest speed of a wall.
    pub fn wall_speed(&self) -> f64 {
        let walls = self.container.iter().flat_map(Container::walls);
        walls.map(|wall| wall.velocity.norm()).fold(0.0, f64::max)
    }

    /// The shortest distance of walls that face each other.
    pub fn gap(&self) -> Option<f64> {
        let lengths = self.lengths();
        (0..D).filter(|d| self.is_bounded(*d)).map(|d| lengths[d]).reduce(f64::min)
    }

    /// By how much a drop between two corners reaches through a wall, and through which, of those walls that have no contact angle.
    pub fn pierced(&self, spec: &BoxSpec, low: &Vector<D>, high: &Vector<D>) -> Option<(String, f64)> {
        let axes = spec.axes.iter().flat_map(|axes| axes.0.iter().enumerate());
        let walls = axes.filter_map(|(d, axis)| match axis {
            AxisSpec::Walls { low, high } => Some((d, [("low", low.has_angle()), ("high", high.has_angle())])),
            AxisSpec::Periodic | AxisSpec::LeesEdwards { .. } => None,
        });
        let beyond = |d: usize, end: usize| if end == 0 { self.low[d] - low[d] } else { high[d] - self.high[d] };
        let all = walls.flat_map(|(d, ends)| {
            ends.into_iter().enumerate().map(move |(end, (name, has_angle))| (d, end, name, has_angle))
        });
        let all = all.filter(|_| self.needs_angles);
        let pierced = all.filter(|(d, end, _, has_angle)| !has_angle && beyond(*d, *end) > 0.0);
        pierced.map(|(d, end, name, _)| (format!("/domain/axes/{d}/{name}"), beyond(d, end))).next()
    }

    /// Whether a part between two corners may lie behind walls.
    pub fn cuts(&self, low: &Vector<D>, high: &Vector<D>) -> bool {
        !self.obstacles.is_empty()
            || (0..D).any(|d| self.is_bounded(d) && (low[d] < self.low[d] || high[d] > self.high[d]))
    }
}

/// The walls along each axis; None where there are none.
fn sides<const D: usize>(spec: &BoxSpec, errors: &mut Vec<Violation>) -> Option<[Option<[Wall<D>; 2]>; D]> {
    let axes = &spec.axes.as_ref()?.0;
    if axes.len() != D {
        let detail = format!("the scene has {D} dimensions");
        errors.push(Violation::new("/domain/axes", "conflict", detail, axes.len(), json!(D)));
        return None;
    }
    let mut sides = [const { None }; D];
    for (d, axis) in axes.iter().enumerate() {
        if let AxisSpec::Walls { low, high } = axis {
            let place = |name: &str| format!("/domain/axes/{d}/{name}");
            sides[d] = Some([wall(low, d, &place("low"), errors), wall(high, d, &place("high"), errors)]);
        }
    }
    sides.iter().any(Option::is_some).then_some(sides)
}

/// An error where the drop does not fit into the box.
pub(super) fn check_size<const D: usize>(
    surface: &dyn Surface<D>,
    (room, corners): (&Room<D>, &BoxSpec),
    shape: &Shape,
) -> Option<Violation> {
    let ((low, high), lengths) = (surface.bounding_box(), room.lengths());
    let refused =
        |detail: String, allowed: Value| Some(Violation::new("/shape", "conflict", detail, shape.to_json(), allowed));
    if let Some((wall, depth)) = room.pierced(corners, &low, &high) {
        let detail = format!(
            "the drop reaches {depth:.4} through the wall {wall}; give that wall a contact_angle, so that the drop sits on it, or \
             move the drop"
        );
        return refused(detail, json!([room.low.as_slice(), room.high.as_slice()]));
    }
    let misses = |d: usize| room.is_bounded(d) && (high[d] <= room.low[d] || low[d] >= room.high[d]);
    if (0..D).any(misses) {
        return refused("the drop lies behind a wall".to_owned(), json!([room.low.as_slice(), room.high.as_slice()]));
    }
    let fits = (0..D).all(|d| room.is_bounded(d) || high[d] - low[d] < lengths[d]);
    if fits { None } else { refused("the drop is as large as the box".to_owned(), json!(lengths.as_slice())) }
}

/// Adds the layers behind walls; an error where neighbors reach around the box.
pub(super) fn surround<const D: usize>(
    room: &mut Room<D>,
    (lattice, is_box): (&StartLattice<D>, bool),
    config: &SphConfig<D>,
    corners: &BoxSpec,
) -> Option<Violation> {
    if !is_box || lattice.count() < 1.0 {
        return None;
    }
    room.add_layers(lattice, config.layer_thickness());
    check_cutoff(&room.domain(), config, corners)
}

/// An error where neighbors reach around the box.
fn check_cutoff<const D: usize>(domain: &Domain<D>, config: &SphConfig<D>, corners: &BoxSpec) -> Option<Violation> {
    let error = Pencils::<D>::new(domain, config.cutoff()).err()?;
    Some(Violation::new("/domain", "range", error.to_string(), corners.to_json(), error.least))
}

/// Errors where the rest of a scene does not suit walls.
pub(super) fn check_needs(spec: &Droplet, is_summation: bool, has_tension: bool, errors: &mut Vec<Violation>) {
    let density = spec.density_method.as_ref().map_or(Value::Null, Parameter::to_json);
    let needs = [
        (is_summation, "/density_method", density, json!("summation")),
        (
            !has_tension || spec.geometry != GeometryChoice::Colorfield,
            "/geometry",
            json!(spec.geometry.name()),
            json!("pcp"),
        ),
    ];
    for (_, pointer, got, allowed) in needs.into_iter().filter(|(holds, ..)| !holds) {
        errors.push(Violation::new(pointer, "conflict", "it does not go with walls", got, allowed));
    }
}
