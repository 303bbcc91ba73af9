//! Surface tensions that vary: by a slope in space, or by a surfactant.

use super::spec::{Droplet, EquationWord, IntegratorWord, Shifting, SurfactantSpec, TensionWord};
use super::vectors::vector;
use crate::geometry::Vector;
use crate::scenes::shapes::Shape;
use crate::schemes::weakly_compressible_sph::{EquationOfState, Geometry, SphConfig, SurfactantConfig, TensionLaw};
use crate::spec::{Coordinates, Parameter, Violation};
use serde_json::json;

/// Least tension anywhere on the interface at the start, by that of the scene.
const LEAST_TENSION: f64 = 0.1;

/// The drop in its box at the start.
pub(super) struct StartBox<'a, const D: usize> {
    pub shape: Option<&'a Shape>,
    pub low: Vector<D>,
    pub lengths: Vector<D>,
}

impl<const D: usize> StartBox<'_, D> {
    /// Lower and upper corner of the drop, from the middle of the box; that of the box where the shape is known by points alone, and
    /// of a layer.
    fn corners(&self) -> (Vector<D>, Vector<D>) {
        let whole = (self.lengths * -0.5, self.lengths * 0.5);
        let middle = self.low + self.lengths * 0.5;
        let known = self.shape.filter(|shape| !matches!(shape, Shape::Layer { .. } | Shape::Points { .. }));
        let surface = known.and_then(|shape| shape.surface::<D>("/shape").ok());
        surface.map_or(whole, |surface| {
            let (low, high) = surface.bounding_box();
            (low - middle, high - middle)
        })
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

/// What the tension depends on, where it is not the same everywhere.
pub(super) fn tension_law<const D: usize>(
    spec: &Droplet,
    start: &StartBox<'_, D>,
    config: &SphConfig<D>,
    errors: &mut Vec<Violation>,
) -> Option<TensionLaw<D>> {
    let (pointer, got) = match (&spec.surfactant, &spec.tension_slope) {
        (Some(surfactant), None) => ("/surfactant", surfactant.to_json()),
        (None, Some(slope)) => ("/tension_slope", slope.to_json()),
        (None, None) => return None,
        (Some(_), Some(slope)) => {
            let detail = "a scene has a surfactant or a slope of its tension, not both";
            errors.push(Violation::new("/tension_slope", "conflict", detail, slope.to_json(), json!(null)));
            return None;
        }
    };
    let needs = [
        (spec.tension_force == TensionWord::Balanced, "tension_force", "balanced"),
        (matches!(config.geometry, Geometry::Pcp { .. }), "geometry", "pcp"),
        (spec.integrator == IntegratorWord::KickDriftKick, "integrator", "kick_drift_kick"),
        (spec.shifting != Some(Shifting::Pst), "shifting", "none"),
        (config.has_tension(), "surface_tension", "a number > 0"),
    ];
    for (_, name, allowed) in needs.into_iter().filter(|(holds, _, _)| !holds) {
        let detail = format!("a tension that varies needs {name}: {allowed}");
        errors.push(Violation::new(pointer, "conflict", detail, got.clone(), json!({name: allowed})));
    }
    let half_band = 2.0 * config.smoothing_length;
    match (&spec.surfactant, &spec.tension_slope) {
        (Some(surfactant), _) => of_surfactant(surfactant, start, half_band, errors).map(TensionLaw::Surfactant),
        (None, Some(slope)) => of_slope(slope, start, half_band, errors),
        (None, None) => None,
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
    if 1.0 + least < LEAST_TENSION {
        let detail =
            format!("the surface tension falls to {:.3} of that of the scene at a corner of the drop", 1.0 + least);
        let factor = (LEAST_TENSION - 1.0) / least;
        let allowed = json!((vector * factor).as_slice());
        errors.push(Violation::new("/tension_slope", "range", detail, slope.to_json(), allowed));
    }
    refuse_jump("/tension_slope", slope, (&vector, start, half_band), errors);
    Some(TensionLaw::Slope { slope: vector, largest: 1.0 + most })
}

/// A surfactant, checked over the drop.
fn of_surfactant<const D: usize>(
    spec: &SurfactantSpec,
    start: &StartBox<'_, D>,
    half_band: f64,
    errors: &mut Vec<Violation>,
) -> Option<SurfactantConfig<D>> {
    let slope = match &spec.slope {
        Some(slope) => vector_of::<D>("/surfactant/slope", slope, errors)?,
        None => Vector::<D>::zeros(),
    };
    let equation = match spec.equation {
        EquationWord::Linear => EquationOfState::Linear,
        EquationWord::Langmuir => EquationOfState::Langmuir,
    };
    let (coverage, elasticity, diffusivity) = (spec.coverage, spec.elasticity, spec.diffusivity);
    let config = SurfactantConfig { equation, elasticity, coverage, slope, diffusivity };
    let [least, most] = start.range(&slope).map(|change| coverage + change);
    if let Some(given) = spec.slope.as_ref().filter(|_| least < 0.0 || most >= 1.0) {
        let detail = format!("the coverage at the start reaches from {least:.3} to {most:.3} over the drop");
        let allowed = "coverages from 0 to below 1";
        errors.push(Violation::new("/surfactant/slope", "range", detail, given.to_json(), allowed));
    }
    let tension = config.tension(most);
    if most < 1.0 && tension < LEAST_TENSION {
        let detail = format!("the surface tension at the start falls to {tension:.3} of that of the clean interface");
        let largest = elasticity * (1.0 - LEAST_TENSION) / (1.0 - tension);
        let allowed = format!("a number up to {largest:.4}");
        errors.push(Violation::new("/surfactant/elasticity", "range", detail, elasticity, allowed));
    }
    if let Some(given) = &spec.slope {
        refuse_jump("/surfactant/slope", given, (&slope, start, half_band), errors);
    }
    Some(config)
}

/// An error where the jump of a slope at a side of the box lies on the interface.
fn refuse_jump<const D: usize>(
    pointer: &str,
    given: &Coordinates,
    (slope, start, half_band): (&Vector<D>, &StartBox<'_, D>, f64),
    errors: &mut Vec<Violation>,
) {
    if start.crosses_jump(slope, half_band) {
        let detail = "the slope jumps at the side of the box, which the interface touches; \
            put the drop into the middle, or let the slope lie along a layer's normal";
        errors.push(Violation::new(pointer, "conflict", detail, given.to_json(), json!(null)));
    }
}

fn vector_of<const D: usize>(pointer: &str, given: &Coordinates, errors: &mut Vec<Violation>) -> Option<Vector<D>> {
    let before = errors.len();
    let found = vector::<D>(pointer, given, errors);
    (errors.len() == before).then_some(found)
}
