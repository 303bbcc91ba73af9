//! Dimensionless numbers of a droplet scene: as they follow from it, and scenes that are given by them.

use super::cases::Case;
use super::numbers::{SceneNumbers, least_sound_speed, smallest_radius};
use super::spec::{Balance, BoxSpec, CaseName, Droplet, FluidSpec, Fluids, ForceChoice, NumbersSpec};
use crate::scenes::shapes::Shape;
use crate::schemes::weakly_compressible_sph::dimensionless::{DimensionlessNumbers, Scales};
use crate::spec::{Coordinates, Given, Group, Parameter, Preset, Violation};
use serde_json::Value;

/// Speeds of sound of a scene that is given by numbers, by the least that keeps its fluids nearly incompressible.
const STIFFNESS_MARGIN: f64 = 1.25;

/// Relative difference of a given number from that of the scene beyond which they contradict each other.
const SLACK: f64 = 1e-6;

impl NumbersSpec {
    /// The numbers of a scene, with the diameter of its smallest drop and a speed.
    pub(super) fn of(scene: &SceneNumbers, spec: &Droplet, speed: f64) -> Self {
        let numbers = DimensionlessNumbers::from(Scales {
            fluids: spec.fluids.planned(),
            tension: scene.tension,
            diameter: 2.0 * scene.radius.unwrap_or(f64::NAN),
            speed,
            gravity: scene.gravity,
            spacing: spec.spacing,
        });
        let known = |value: f64| value.is_finite().then_some(value);
        Self {
            laplace: known(numbers.laplace),
            ohnesorge: known(numbers.ohnesorge),
            reynolds: known(numbers.reynolds),
            weber: known(numbers.weber),
            capillary: known(numbers.capillary),
            bond: known(numbers.bond),
            density_ratio: known(numbers.density_ratio),
            viscosity_ratio: known(numbers.viscosity_ratio),
            diameter_over_h: known(numbers.diameter_over_h),
            radius_over_h: known(numbers.radius_over_h),
        }
    }

    /// The numbers by their names; those that are not defined are left out.
    pub fn named(&self) -> Vec<(&'static str, f64)> {
        let values = [
            self.laplace,
            self.ohnesorge,
            self.reynolds,
            self.weber,
            self.capillary,
            self.bond,
            self.density_ratio,
            self.viscosity_ratio,
            self.diameter_over_h,
            self.radius_over_h,
        ];
        Self::names().into_iter().zip(values).filter_map(|(name, value)| Some((name, value?))).collect()
    }

    /// An error for each given number that contradicts the scene.
    pub fn check(&self, scene: &Self, errors: &mut Vec<Violation>) {
        let of_scene = scene.named();
        for (name, given) in self.named() {
            let own = of_scene.iter().find(|(of, _)| *of == name).map(|(_, value)| *value);
            if own.is_some_and(|own| (given - own).abs() <= SLACK * own.abs().max(given.abs())) {
                continue;
            }
            let detail = "the fluids, the tension, the shape and the spacing of the scene give another number; leave out \
                          the number or what contradicts it";
            let allowed = own.map_or(Value::Null, Value::from);
            errors.push(Violation::new(format!("/numbers/{name}"), "conflict", detail, given, allowed));
        }
    }
}

/// The values that given numbers stand for: ρ = τ = 1 and, where no shape is given, R = 1. What is given beside them wins.
pub(super) fn implied(given: Given) -> Preset {
    let shape = given.read(Droplet::shape()).flatten();
    let implied = shape.as_ref().and_then(Shape::dimension);
    let dimension = given.read(Droplet::dimension()).flatten().or(implied).unwrap_or(2);
    match dimension {
        3 => implied_in::<3>(given, shape),
        _ => implied_in::<2>(given, shape),
    }
}

fn implied_in<const D: usize>(given: Given, shape: Option<Shape>) -> Preset {
    let Some(numbers) = given.read(Droplet::numbers()).flatten() else { return Preset::default() };
    let name = given.read(Droplet::case()).unwrap_or(CaseName::Oscillating);
    let case = Case::new(name, D, 1.0);
    let given_box = given.read(Droplet::domain()).flatten();
    let (shape, domain, radius) = match (shape, case.shape) {
        (Some(mut shape), _) => {
            let corners = given_box.unwrap_or(case.domain);
            name_wavelength(&mut shape, &corners);
            let surface = shape.surface::<D>("/shape").ok();
            let radius = smallest_radius(&shape, surface.as_ref());
            (shape, corners, radius)
        }
        // The case at the size R = 1. The pulse and the steps of a dividing drop are made for its own size.
        (None, Some(own)) if name != CaseName::Dividing => {
            let surface = own.surface::<D>("/shape").ok();
            let factor = smallest_radius(&own, surface.as_ref()).map_or(1.0, |radius| 1.0 / radius);
            (scaled::<D>(own, factor), given_box.unwrap_or_else(|| scaled_corners(case.domain, factor)), Some(1.0))
        }
        // A custom drop needs a shape.
        (None, _) => return Preset::default(),
    };
    let Some(radius) = radius else { return Preset::default() };
    let (diameter, tension) = (2.0 * radius, 1.0);
    let laplace = numbers.laplace.filter(|laplace| *laplace > 0.0).map(|laplace| (diameter / laplace).sqrt());
    let ohnesorge = numbers.ohnesorge.map(|ohnesorge| ohnesorge * diameter.sqrt());
    let Some(viscosity) = laplace.or(ohnesorge) else { return Preset::default() };
    let inside = FluidSpec { density: 1.0, viscosity, ..FluidSpec::default() };
    let outside = FluidSpec {
        density: numbers.density_ratio.unwrap_or(1.0),
        viscosity: viscosity * numbers.viscosity_ratio.unwrap_or(1.0),
        ..FluidSpec::default()
    };
    let gravity = numbers
        .bond
        .filter(|bond| *bond > 0.0)
        .map_or(0.0, |bond| bond * tension / ((inside.density - outside.density).abs() * diameter * diameter));
    // Without a difference of densities no gravity has that number, and the check of the numbers says so.
    let gravity = if gravity.is_finite() { gravity } else { 0.0 };
    let fall = (gravity * longest_side(&domain)).max(domain.side_speed(radius).powi(2));
    let stiff = |fluid: FluidSpec| {
        let least = least_sound_speed(&fluid, Some(radius), tension, fall);
        FluidSpec { sound_speed: STIFFNESS_MARGIN * least, ..fluid }
    };
    let acceleration = Coordinates((0..D).map(|d| if d == 1 { -gravity } else { 0.0 }).collect());
    let force = ForceChoice::Constant { acceleration, balance: Balance::Mean };
    let spacing = numbers.diameter_over_h.or(numbers.radius_over_h.map(|ratio| 2.0 * ratio));
    Preset::default()
        .set(Droplet::shape(), Some(shape))
        .set(Droplet::domain(), Some(domain))
        .set(Droplet::surface_tension(), Some(tension))
        .set(Droplet::fluids(), Fluids { inside: stiff(inside), outside: stiff(outside) })
        .set_if(gravity > 0.0, Droplet::body_force(), Some(force))
        .set(Droplet::spacing(), diameter / spacing.unwrap_or(DIAMETER_OVER_H))
}

/// D/h where none is given.
const DIAMETER_OVER_H: f64 = 25.6;

fn longest_side(corners: &BoxSpec) -> f64 {
    corners.high.iter().zip(corners.low.iter()).map(|(high, low)| high - low).fold(0.0, f64::max)
}

fn times(numbers: &Coordinates, factor: f64) -> Coordinates {
    Coordinates(numbers.iter().map(|x| factor * x).collect())
}

fn scaled_corners(BoxSpec { low, high, axes }: BoxSpec, factor: f64) -> BoxSpec {
    BoxSpec { low: times(&low, factor), high: times(&high, factor), axes }
}

/// The ball or ellipsoid of a case about the origin, at another size.
fn scaled<const D: usize>(shape: Shape, factor: f64) -> Shape {
    match (shape.as_ball::<D>(), shape.quadric::<D>()) {
        (Some(ball), _) => Shape::ball(D, factor * ball.radius),
        (None, Some((_, axes))) => {
            Shape::ellipsoid(D, std::array::from_fn(|d| factor * axes.get(d).copied().unwrap_or(1.0)))
        }
        (None, None) => shape,
    }
}

/// Waves whose length is not given are as long as the box.
fn name_wavelength(shape: &mut Shape, corners: &BoxSpec) {
    if let (Shape::Layer { wavelength, .. }, [low, ..], [high, ..]) = (shape, &corners.low[..], &corners.high[..]) {
        wavelength.get_or_insert(high - low);
    }
}

/// Checks the numbers that are given against the scene; the spec gets all of them.
pub(super) fn complete(spec: &mut Droplet, scene: &SceneNumbers, errors: &mut Vec<Violation>) {
    let found = NumbersSpec::of(scene, spec, scene.expected_inner_speed(spec));
    if let Some(given) = &spec.numbers {
        // Without tension and viscosity neither is defined.
        let is_open = given.laplace.is_none() && given.ohnesorge.is_none();
        if is_open && found.laplace.or(found.ohnesorge).is_some() {
            let detail = "numbers make a scene with a Laplace number La or an Ohnesorge number Oh";
            errors.push(Violation::new("/numbers/La", "required", detail, Value::Null, "a number > 0"));
        }
        if scene.radius.is_none() {
            let detail =
                "the size of a drop that is known by points is not known before the run: numbers need another shape";
            errors.push(Violation::new("/numbers", "conflict", detail, given.to_json(), Value::Null));
        } else {
            given.check(&found, errors);
        }
    }
    spec.numbers = scene.radius.map(|_| found);
}
