//! Surface tensions that vary: by a slope in space, or by a surfactant.

use super::numbers::smallest_radius;
use super::spec::{Droplet, EquationWord, IntegratorWord, MOST_COVERAGE, Shifting, SurfactantSpec, TensionWord};
use super::vectors::vector;
use crate::geometry::Vector;
use crate::scenes::shapes::{PlainShape, Shape, ShapeSurface};
use crate::schemes::weakly_compressible_sph::{EquationOfState, Geometry, SphConfig, SurfactantConfig, TensionLaw};
use crate::spec::choice::Choice;
use crate::spec::{Coordinates, Parameter, Violation};
use serde_json::json;

/// Least tension anywhere on the interface at the start, by that of the scene.
const LEAST_TENSION: f64 = 0.1;
/// Relative rounding of a bound that was told and given back.
const SLACK: f64 = 1e-9;

/// The drop in its box at the start.
pub(super) struct StartBox<'a, const D: usize> {
    pub shape: Option<&'a Shape>,
    pub surface: Option<&'a ShapeSurface<D>>,
    pub low: Vector<D>,
    pub lengths: Vector<D>,
}

impl<const D: usize> StartBox<'_, D> {
    /// Radius of the smallest drop, as [`smallest_radius`] has it.
    pub fn radius(&self) -> Option<f64> {
        smallest_radius(self.shape?, self.surface)
    }

    /// Lower and upper corner of the drop, from the middle of the box; those of the box where the shape is known by points alone. A
    /// layer reaches across the box but for y.
    fn corners(&self) -> (Vector<D>, Vector<D>) {
        let (mut low, mut high) = (self.lengths * -0.5, self.lengths * 0.5);
        let middle = self.low + self.lengths * 0.5;
        if let Some(Shape::Layer { height, thickness, amplitude, .. }) = self.shape {
            let half = 0.5 * thickness + amplitude;
            (low[1], high[1]) = (height - half - middle[1], height + half - middle[1]);
        } else if let Some(surface) = self.surface {
            let corners = surface.whole.bounding_box();
            (low, high) = (corners.0 - middle, corners.1 - middle);
        }
        (low, high)
    }

    /// Least and largest value of slope·x over the corners of the drop.
    fn range(&self, slope: &Vector<D>) -> [f64; 2] {
        let (low, high) = self.corners();
        let ends = (0..D).map(|d| (slope[d] * low[d], slope[d] * high[d]));
        ends.fold([0.0; 2], |[least, most], (a, b)| [least + a.min(b), most + a.max(b)])
    }

    /// Whether the band of a drop crosses the side of the box where a slope jumps.
    fn crosses_jump(&self, slope: &Vector<D>, half_band: f64) -> bool {
        let (low, high) = self.corners();
        (0..D).any(|d| slope[d] != 0.0 && low[d].abs().max(high[d].abs()) + half_band > 0.5 * self.lengths[d])
    }
}

/// Largest tension on the drop at the start, by that of the scene.
pub(super) fn largest_tension<const D: usize>(spec: &Droplet, start: &StartBox<'_, D>) -> f64 {
    let slope = spec.tension_slope.as_ref().filter(|slope| slope.len() == D);
    slope.map_or(1.0, |slope| 1.0 + start.range(&Vector::<D>::from_fn(|d, _| slope[d]))[1].max(0.0))
}

/// What the tension depends on, where it is not the same everywhere.
pub(super) fn tension_law<const D: usize>(
    spec: &Droplet,
    start: &StartBox<'_, D>,
    config: &SphConfig<D>,
    errors: &mut Vec<Violation>,
) -> Option<TensionLaw<D>> {
    let half_band = 2.0 * config.smoothing_length;
    let slope = spec.tension_slope.as_ref().and_then(|slope| of_slope(slope, start, half_band, errors));
    let surfactant = spec.surfactant.as_ref();
    let surfactant = surfactant.and_then(|surfactant| of_surfactant(surfactant, start, half_band, errors));
    if let (Some(_), Some(slope)) = (&spec.surfactant, &spec.tension_slope) {
        let detail = "a scene has a surfactant or a slope of its tension, not both";
        errors.push(Violation::new("/tension_slope", "conflict", detail, slope.to_json(), json!(null)));
    }
    if spec.surfactant.is_some() || spec.tension_slope.is_some() {
        check_needs(spec, config, errors);
    }
    slope.or(surfactant.map(TensionLaw::Surfactant))
}

/// Errors where the rest of a scene does not suit a tension that varies.
fn check_needs<const D: usize>(spec: &Droplet, config: &SphConfig<D>, errors: &mut Vec<Violation>) {
    let needs = [
        (spec.tension_force == TensionWord::Balanced, "tension_force", spec.tension_force.to_json(), json!("balanced")),
        (matches!(config.geometry, Geometry::Pcp { .. }), "geometry", json!(spec.geometry.name()), json!("pcp")),
        (
            spec.integrator == IntegratorWord::KickDriftKick,
            "integrator",
            spec.integrator.to_json(),
            json!("kick_drift_kick"),
        ),
        (spec.shifting != Some(Shifting::Pst), "shifting", json!("pst"), json!("none")),
        (config.has_tension(), "surface_tension", json!(config.tension), json!("a number > 0")),
    ];
    for (_, name, got, allowed) in needs.into_iter().filter(|(holds, ..)| !holds) {
        let detail = "a surfactant and a slope of the tension do not go with it";
        errors.push(Violation::new(format!("/{name}"), "conflict", detail, got, allowed));
    }
}

/// A slope, checked over the drop.
fn of_slope<const D: usize>(
    slope: &Coordinates,
    start: &StartBox<'_, D>,
    half_band: f64,
    errors: &mut Vec<Violation>,
) -> Option<TensionLaw<D>> {
    let vector = vector_of::<D>("/tension_slope", slope, errors)?;
    let [least, most] = start.range(&vector);
    if 1.0 + least < LEAST_TENSION * (1.0 - SLACK) {
        let lowest = 1.0 + least;
        let detail = format!("the surface tension falls to {lowest:.3e} of that of the scene at a corner of the drop");
        let factor = (LEAST_TENSION - 1.0) / least;
        let allowed = json!((vector * factor).as_slice());
        errors.push(Violation::new("/tension_slope", "range", detail, slope.to_json(), allowed));
    }
    refuse_jump("/tension_slope", slope, (&vector, start, half_band), errors);
    let is_ball =
        matches!(start.shape.and_then(Shape::as_plain), Some(PlainShape::Circle { .. } | PlainShape::Sphere { .. }));
    (vector != Vector::<D>::zeros()).then_some(TensionLaw::Slope { slope: vector, largest: 1.0 + most, is_ball })
}

/// A surfactant, checked over the drop.
fn of_surfactant<const D: usize>(
    spec: &SurfactantSpec,
    start: &StartBox<'_, D>,
    half_band: f64,
    errors: &mut Vec<Violation>,
) -> Option<SurfactantConfig<D>> {
    let slope = match &spec.slope {
        Some(slope) => vector_of::<D>("/surfactant/slope", slope, errors),
        None => Some(Vector::<D>::zeros()),
    };
    let equation = match spec.equation {
        EquationWord::Linear => EquationOfState::Linear,
        EquationWord::Langmuir => EquationOfState::Langmuir,
    };
    let (coverage, elasticity, diffusivity) = (spec.coverage, spec.elasticity, spec.diffusivity);
    let config = SurfactantConfig {
        equation,
        elasticity,
        coverage,
        slope: slope.unwrap_or_else(Vector::<D>::zeros),
        diffusivity,
    };
    let [least, most] = start.range(&config.slope).map(|change| coverage + change);
    if let Some(given) = spec.slope.as_ref().filter(|_| least < 0.0 || most > MOST_COVERAGE) {
        let detail = format!(
            "the coverage at the start reaches from {least:.3e} to {most:.3e} over the drop; 0 to {MOST_COVERAGE} are possible"
        );
        let factor =
            (coverage / (coverage - least)).min((MOST_COVERAGE - coverage) / (most - coverage)).clamp(0.0, 1.0);
        let allowed = json!((config.slope * factor).as_slice());
        errors.push(Violation::new("/surfactant/slope", "range", detail, given.to_json(), allowed));
    }
    let tension = config.tension(most.min(MOST_COVERAGE));
    if tension < LEAST_TENSION * (1.0 - SLACK) {
        let detail = format!("the surface tension at the start falls to {tension:.3} of that of the clean interface");
        let largest = elasticity * (1.0 - LEAST_TENSION) / (1.0 - tension);
        let allowed = format!("a number up to {}", (largest * 1e4).floor() * 1e-4);
        errors.push(Violation::new("/surfactant/elasticity", "range", detail, elasticity, allowed));
    }
    if let Some(given) = &spec.slope {
        refuse_jump("/surfactant/slope", given, (&config.slope, start, half_band), errors);
    }
    slope.map(|_| config)
}

/// An error where the jump of a slope at a side of the box lies on the interface.
fn refuse_jump<const D: usize>(
    pointer: &str,
    given: &Coordinates,
    (slope, start, half_band): (&Vector<D>, &StartBox<'_, D>, f64),
    errors: &mut Vec<Violation>,
) {
    if start.crosses_jump(slope, half_band) {
        let detail = match start.shape {
            Some(Shape::Layer { .. }) => {
                "the slope jumps at a side of the box that the layer touches; along y it may have one"
            }
            Some(Shape::Points { .. } | Shape::Mesh { .. }) => {
                "the slope jumps at the sides of the box, and where points lie is not known yet"
            }
            _ => {
                "the slope jumps at a side of the box, which the drop's band of 2 ε touches; put the drop into the middle"
            }
        };
        errors.push(Violation::new(pointer, "conflict", detail, given.to_json(), json!(null)));
    }
}

fn vector_of<const D: usize>(pointer: &str, given: &Coordinates, errors: &mut Vec<Violation>) -> Option<Vector<D>> {
    let before = errors.len();
    let found = vector::<D>(pointer, given, errors);
    (errors.len() == before).then_some(found)
}
