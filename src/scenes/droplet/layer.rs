//! Layers across the box, at rest or with a standing wave on both sides.

use super::room::Room;
use super::spec::Droplet;
use crate::geometry::Vector;
use crate::geometry::surfaces::WavyLayer;
use crate::scenes::shapes::Shape;
use crate::schemes::capillary_wave::CapillaryWave;
use crate::schemes::weakly_compressible_sph::steady_flow::{FlowLayer, SteadyFlow};
use crate::schemes::weakly_compressible_sph::{BodyForce, Fluid, SphConfig, StandingWave};
use crate::spec::{Parameter, Violation};
use serde_json::json;
use std::f64::consts::TAU;

/// The layer that a shape stands for, in a box of a length along x.
pub(super) fn layer_of(shape: &Shape, length: f64) -> Option<WavyLayer> {
    let Shape::Layer { height, thickness, amplitude, wavelength, crest } = shape else { return None };
    let wavelength = wavelength.unwrap_or(length);
    Some(WavyLayer { height: *height, thickness: *thickness, amplitude: *amplitude, wavelength, crest: *crest })
}

/// Relative difference of the box from a whole number of waves.
const WAVE_SLACK: f64 = 1e-9;

/// Checks that a layer fits into a box; its shape gets the wavelength.
pub(super) fn check_layer<const D: usize>(shape: &mut Shape, room: &Room<D>, errors: &mut Vec<Violation>) {
    let (got, lengths) = (shape.clone(), room.lengths());
    let Shape::Layer { thickness, amplitude, wavelength, .. } = shape else { return };
    let wavelength = *wavelength.get_or_insert(lengths[0]);
    let waves = lengths[0] / wavelength;
    if (waves - waves.round()).abs() > WAVE_SLACK * waves || waves < 0.5 {
        let detail = "the box is not a whole number of waves long";
        let allowed = json!(lengths[0] / waves.round().max(1.0));
        errors.push(Violation::new("/shape/wavelength", "conflict", detail, wavelength, allowed));
    }
    if 2.0 * *amplitude >= *thickness {
        let detail = "the sides of the layer would meet in the troughs";
        let allowed = format!("a number < {}", 0.5 * *thickness);
        errors.push(Violation::new("/shape/amplitude", "range", detail, *amplitude, allowed));
    }
    if *thickness + 2.0 * *amplitude >= lengths[1] && !room.is_bounded(1) {
        let detail = "the layer is as thick as the box is high";
        errors.push(Violation::new("/shape", "conflict", detail, got.to_json(), json!(lengths[1])));
    }
}

/// Where linear theory of two unbounded layers holds for a wave of wave number k.
struct Validity {
    /// Least k times the thickness of either layer: ω of the waves on two sides differs by e^(−kd), .2 % at 2π.
    depth: f64,
    /// Largest k a₀: ω falls by (k a₀)²/16.
    steepness: f64,
}

const VALIDITY: Validity = Validity { depth: TAU, steepness: 0.1 };

/// The wave of a layer, with linear theory where it holds: equal kinematic viscosities, one tension, no force from outside but gravity on a
/// layer whose other side lies behind a wall, deep layers and flat waves.
pub(super) fn standing_wave<const D: usize>(
    shape: &Shape,
    spec: &Droplet,
    (tension, force): (f64, Option<&BodyForce<D>>),
    room: &Room<D>,
) -> Option<StandingWave> {
    let lengths = room.lengths();
    let layer = layer_of(shape, lengths[0]).filter(|layer| layer.amplitude > 0.0)?;
    let wavenumber = TAU / layer.wavelength;
    let (inside, outside) = (&spec.fluids.inside, &spec.fluids.outside);
    let kinematic = [inside, outside].map(|fluid| fluid.viscosity / fluid.density);
    let is_alike = (kinematic[0] - kinematic[1]).abs() <= 1e-9 * kinematic[0];
    let ends = [layer.height - 0.5 * layer.thickness, layer.height + 0.5 * layer.thickness];
    let single = single_side(ends, room);
    let thinner = match single {
        Some((height, _)) => (height - room.low[1]).min(room.high[1] - height),
        None => layer.thickness.min(lengths[1] - layer.thickness),
    };
    let gravity = match (force, single) {
        (None, _) => Some(0.0),
        (Some(BodyForce::Constant(g) | BodyForce::WithoutMean(g)), Some(_)) if g.norm() == g[1].abs() => Some(-g[1]),
        (Some(_), _) => None,
    };
    let densities = match single {
        Some((_, true)) => [inside.density, outside.density],
        _ => [outside.density, inside.density],
    };
    let is_linear = wavenumber * thinner >= VALIDITY.depth && wavenumber * layer.amplitude <= VALIDITY.steepness;
    let is_constant = spec.surfactant.is_none() && spec.tension_slope.is_none();
    let holds = is_alike && is_linear && is_constant && room.obstacles.is_empty() && room.mean_shear.is_none();
    let theory = gravity
        .filter(|_| holds)
        .and_then(|gravity| CapillaryWave::new(wavenumber, densities, kinematic[0], (tension, gravity)));
    Some(StandingWave { wavenumber, crest: layer.crest, amplitude: layer.amplitude, theory })
}

/// Where the only side of a layer lies whose other side is behind a wall, and whether the layer is below.
fn single_side<const D: usize>([lower, upper]: [f64; 2], room: &Room<D>) -> Option<(f64, bool)> {
    let is_within = |height: f64| height > room.low[1] && height < room.high[1];
    match (room.is_bounded(1), is_within(lower), is_within(upper)) {
        (true, false, true) => Some((upper, true)),
        (true, true, false) => Some((lower, false)),
        _ => None,
    }
}

/// The steady flow of flat layers between two walls that hold them, driven by the walls and by a force along them.
pub(super) fn steady_flow<const D: usize>(
    shape: &Shape,
    config: &SphConfig<D>,
    room: &Room<D>,
) -> Option<SteadyFlow<D>> {
    let Shape::Layer { height, thickness, amplitude: 0.0, .. } = shape else { return None };
    let container = room.container.as_ref()?;
    let bounded: Vec<usize> = (0..D).filter(|d| container.is_bounded(*d)).collect();
    // Layers lie across y.
    let [1] = bounded[..] else { return None };
    let walls = [2, 3].map(|number| container.wall(number));
    if !walls.iter().all(|wall| wall.holds_fluid) {
        return None;
    }
    let acceleration = match config.body_force {
        Some(BodyForce::Constant(acceleration)) if acceleration[1] == 0.0 => acceleration,
        None => Vector::<D>::zeros(),
        Some(_) => return None,
    };
    let (low, gap) = (room.low[1], room.lengths()[1]);
    let of = |fluid: &Fluid, top: f64| FlowLayer { top, density: fluid.density, viscosity: fluid.viscosity };
    let (inside, outside) = (&config.fluids.inside, &config.fluids.outside);
    let ends = [height - 0.5 * thickness - low, height + 0.5 * thickness - low].map(|end| end.clamp(0.0, gap));
    let layers = [of(outside, ends[0]), of(inside, ends[1]), of(outside, gap)];
    let moves = acceleration.norm() > 0.0 || walls.iter().any(|wall| wall.velocity.norm() > 0.0);
    let flows = layers.iter().all(|layer| layer.viscosity > 0.0) && moves;
    let walls = walls.map(|wall| wall.velocity);
    flows.then(|| SteadyFlow { axis: 1, low, layers: layers.to_vec(), walls, acceleration })
}

/// Signed distance from the nearest image of a layer, in a box of a height that is its period; None between walls.
pub(super) fn distance_from_layer<const D: usize>(layer: &WavyLayer, period: Option<f64>, x: &Vector<D>) -> f64 {
    let Some(height) = period else { return layer.signed_distance(x) };
    let distance = |turns: f64| {
        let mut image = *x;
        image[1] += turns * height;
        layer.signed_distance(&image)
    };
    [-1.0, 0.0, 1.0].into_iter().map(distance).fold(f64::INFINITY, f64::min)
}
