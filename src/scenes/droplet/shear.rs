//! A box in shear: which axis shears it, and what does not go with it.

use super::formulation::Scope;
use super::spec::{AxisSpec, Droplet, GeometryChoice, IntegratorWord};
use crate::geometry::Vector;
use crate::scenes::shapes::Shape;
use crate::schemes::weakly_compressible_sph::{MeanShear, SphConfig};
use crate::spec::{Choice, Parameter, Violation};
use serde_json::{Value, json};

/// The mean flow of a box whose images slide past each other; `corners` are its lower and its upper one.
pub(super) fn mean_shear<const D: usize>(
    axes: &[AxisSpec],
    (low, high): (&Vector<D>, &Vector<D>),
    errors: &mut Vec<Violation>,
) -> Option<MeanShear> {
    let rate = |axis: &AxisSpec| match axis {
        AxisSpec::LeesEdwards { shear_rate } => Some(*shear_rate),
        AxisSpec::Periodic | AxisSpec::Walls { .. } => None,
    };
    let mut sheared = axes.iter().enumerate().filter_map(|(axis, spec)| Some((axis, rate(spec)?)));
    let (axis, rate) = sheared.next()?;
    let mut refuse = |at: usize, detail: &str| {
        let place = format!("/domain/axes/{at}");
        errors.push(Violation::new(place, "conflict", detail, axes[at].to_json(), json!("periodic")));
    };
    if axis == 0 {
        refuse(axis, "images slide along x, so that the flow changes along y or z");
    }
    if let Some((second, _)) = sheared.next() {
        refuse(second, "a box is sheared along one axis");
    }
    if let Some(wall) = axes.iter().position(|axis| matches!(axis, AxisSpec::Walls { .. })) {
        refuse(wall, "a box in shear has no walls: walls that move shear as well");
    }
    let (middle, length) = (0.5 * (low[axis] + high[axis]), high[axis] - low[axis]);
    (axis > 0).then_some(MeanShear { axis, rate, middle, length })
}

/// The speeds of a scene (gravity, velocity at the start, own speed) with that by which a shear moves the fluids about its mean flow: γR
/// around a drop, up to that of the sides where layers share the shear.
pub(super) fn with_shear(
    [gravity, start, own]: [f64; 3],
    mean_shear: Option<&MeanShear>,
    (shape, radius): (Option<&Shape>, Option<f64>),
) -> [f64; 3] {
    let Some(shear) = mean_shear else { return [gravity, start, own] };
    let half = 0.5 * shear.length;
    let is_layer = matches!(shape, Some(Shape::Layer { .. }));
    let reach = radius.filter(|_| !is_layer).map_or(half, |radius| radius.min(half));
    [gravity, start, own.max(shear.rate.abs() * reach)]
}

/// Errors where the rest of a scene does not suit a box in shear.
pub(super) fn check<const D: usize>(spec: &Droplet, config: &SphConfig<D>, scope: Scope, errors: &mut Vec<Violation>) {
    if config.mean_shear.is_none() {
        return;
    }
    let density = spec.density_method.as_ref().map_or(Value::Null, Parameter::to_json);
    let needs = [
        (scope.is_summation, "/density_method", density, json!("summation")),
        (
            spec.integrator == IntegratorWord::KickDriftKick,
            "/integrator",
            spec.integrator.to_json(),
            json!("kick_drift_kick"),
        ),
        (
            !config.has_tension() || spec.geometry != GeometryChoice::Colorfield,
            "/geometry",
            json!(spec.geometry.name()),
            json!("pcp"),
        ),
        (config.body_force.is_none(), "/body_force", spec.body_force.to_json(), json!({"type": "none"})),
        (spec.tension_slope.is_none(), "/tension_slope", spec.tension_slope.to_json(), Value::Null),
        (spec.surfactant.is_none(), "/surfactant", spec.surfactant.to_json(), Value::Null),
        (spec.obstacles.is_none(), "/obstacles", spec.obstacles.to_json(), Value::Null),
    ];
    for (_, pointer, got, allowed) in needs.into_iter().filter(|(holds, ..)| !holds) {
        errors.push(Violation::new(pointer, "conflict", "it does not go with a box in shear", got, allowed));
    }
}
