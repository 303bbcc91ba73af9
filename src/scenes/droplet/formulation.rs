//! The formulation of a scene: how particles start, how pressures act, and what becomes of level and curvature. What is not
//! given follows from the force of surface tension: `balanced` has the formulation that keeps drops at rest and energy in
//! balance, the others have that of the paper.

use super::spec::{
    Balance, BoxSpec, CaseName, Droplet, ForceChoice, GeometryChoice, IntegratorWord, LatticeWord, RedistancingChoice,
    TensionWord, VolumesWord,
};
use crate::schemes::weakly_compressible_sph::{LevelUpdate, PressureConfig, PressureForm, Volumes};
use crate::spec::choice::with_defaults;
use crate::spec::{Given, Parameter, Preset, Violation};
use serde_json::{Value, json};

/// Defaults of the balanced force.
struct Balanced {
    /// Background pressure in τκ₀ of a drop at rest, of one that oscillates, and of others. Less leaves particles to drift; more acts as
    /// an elasticity that shifts frequencies and scatters curvatures of a drop in motion. Waves of 32 particles want more than the
    /// ellipse at 1/64 does.
    background_at_rest: f64,
    background_in_oscillation: f64,
    background: f64,
    bulk_damping: f64,
    /// Share of a deviation of the level that is repaired in a repair time, of a drop at rest, of one that oscillates, and of others.
    /// Less keeps a drop at rest quieter, and costs an oscillation less of its amplitude; merging drops need more, or some of them
    /// gain energy.
    relaxation_at_rest: f64,
    relaxation_in_oscillation: f64,
    relaxation: f64,
    /// The same of a drop that rises between walls: it deforms for long, and with less some of it is lost.
    relaxation_in_rise: f64,
    curvature_filter_h: f64,
}

const BALANCED: Balanced = Balanced {
    background_at_rest: 0.2,
    background_in_oscillation: 0.01,
    background: 0.05,
    bulk_damping: 0.2,
    relaxation_at_rest: 0.05,
    relaxation_in_oscillation: 0.02,
    relaxation: 0.1,
    relaxation_in_rise: 0.5,
    curvature_filter_h: 6.0,
};

/// Least radius of the filter of the curvature in h, that of the filter of the level.
const LEAST_FILTER_H: f64 = 2.0;

/// What of a formulation applies to a scene.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scope {
    pub dimension: usize,
    /// Densities by summation over kernels: pressures in the volume form.
    pub is_summation: bool,
}

/// Lattice and ratio ε/h, which belong together.
#[derive(Debug, Clone, Copy)]
pub(super) struct Start {
    pub lattice: LatticeWord,
    /// Smoothing length ε in h that is stable on the lattice; None where the case decides.
    pub smoothing_h: Option<f64>,
}

impl Start {
    /// The lattice of a scene and the ratio ε/h that goes with it; the spec gets what was left open.
    pub fn new(spec: &mut Droplet, Scope { dimension, is_summation }: Scope, errors: &mut Vec<Violation>) -> Self {
        let is_balanced = spec.tension_force == TensionWord::Balanced && is_summation;
        // The lattices whose waves are stable under a background pressure with the fewest neighbors.
        let default = match (is_balanced, dimension) {
            (true, 2) => LatticeWord::Hexagonal,
            (true, _) => LatticeWord::BodyCentered,
            (false, _) => LatticeWord::Cubic,
        };
        let lattice = *spec.lattice.get_or_insert(default);
        let is_flat_only = lattice == LatticeWord::Hexagonal;
        let is_space_only = matches!(lattice, LatticeWord::BodyCentered | LatticeWord::FaceCentered);
        if (is_flat_only && dimension == 3) || (is_space_only && dimension == 2) {
            let detail = format!("there is no such lattice in {dimension} dimensions");
            let allowed = if dimension == 2 {
                json!(["cubic", "hexagonal"])
            } else {
                json!(["cubic", "body_centered", "face_centered"])
            };
            errors.push(Violation::new("/lattice", "conflict", detail, lattice.to_json(), allowed));
        }
        // Stable against lattice waves (docs/results/droplet-notes.md).
        let smoothing_h = match lattice {
            _ if !is_balanced => None,
            LatticeWord::Hexagonal => Some(1.75),
            LatticeWord::BodyCentered => Some(1.77),
            LatticeWord::FaceCentered => Some(1.65),
            LatticeWord::Cubic => Some(2.0),
        };
        Self { lattice, smoothing_h }
    }
}

/// A force with the balance that forces of earlier versions had: none.
fn falling_freely(force: ForceChoice) -> ForceChoice {
    match force {
        ForceChoice::Constant { acceleration, balance: Balance::None } => {
            ForceChoice::Constant { acceleration, balance: Balance::FreeFall }
        }
        other => other,
    }
}

/// A resolved scene without a lattice is of version 0.1 or 0.2.0: its balanced force is what is called `balanced_0_1` now,
/// and no speed of sound was too low for it.
pub(super) fn of_earlier_version(given: Given) -> Preset {
    let is_earlier =
        !given.has(Droplet::lattice()) && given.read(Droplet::tension_force()) == Some(TensionWord::Balanced);
    let is_without_lattice = !given.has(Droplet::lattice());
    let force = given.read(Droplet::body_force()).flatten();
    Preset::default()
        .set_if(is_earlier, Droplet::tension_force(), TensionWord::Balanced01)
        .set_if(is_without_lattice, Droplet::allow_soft(), true)
        .set_if(is_without_lattice && force.is_some(), Droplet::body_force(), force.map(falling_freely))
}

/// Whether a slope of the tension drives a flow along the interface.
fn is_driven(spec: &Droplet) -> bool {
    let of_coverage = spec.surfactant.as_ref().and_then(|surfactant| surfactant.slope.as_ref());
    spec.tension_slope.iter().chain(of_coverage).any(|slope| slope.iter().any(|b| *b != 0.0))
}

/// Whether gravity moves two fluids of different densities between walls.
fn is_rising(spec: &Droplet) -> bool {
    let has_walls = spec.domain.as_ref().is_some_and(BoxSpec::has_walls);
    let pulls = match &spec.body_force {
        Some(ForceChoice::Constant { acceleration, .. }) => acceleration.iter().any(|g| *g != 0.0),
        Some(_) | None => false,
    };
    has_walls && pulls && spec.fluids.inside.density != spec.fluids.outside.density
}

/// Pressures of a scene; the spec gets what was left open. Densities by continuity have none of these parameters.
pub(super) fn pressures(spec: &mut Droplet, scope: Scope, errors: &mut Vec<Violation>) -> PressureConfig {
    let is_balanced = spec.tension_force == TensionWord::Balanced;
    if !scope.is_summation {
        let given: [(&str, Option<Value>); 3] = [
            ("/volumes", spec.volumes.map(|word| word.to_json())),
            ("/background_pressure", spec.background_pressure.map(Value::from)),
            ("/bulk_damping", spec.bulk_damping.map(Value::from)),
        ];
        for (pointer, got) in given.into_iter().filter_map(|(pointer, got)| Some((pointer, got?))) {
            let detail = "it belongs to densities by summation over kernels";
            errors.push(Violation::new(pointer, "conflict", detail, got, Value::Null));
        }
        return PressureConfig::PAPER;
    }
    let is_one_evaluation = spec.integrator == IntegratorWord::KickDriftKick;
    let damping = if is_balanced && is_one_evaluation { BALANCED.bulk_damping } else { 0.0 };
    let bulk_damping = *spec.bulk_damping.get_or_insert(damping);
    if bulk_damping > 0.0 && !is_one_evaluation {
        let detail = "it needs one evaluation a step: integrator kick_drift_kick";
        errors.push(Violation::new("/bulk_damping", "conflict", detail, bulk_damping, json!(0)));
    }
    let background = match spec.case {
        _ if !is_balanced => 0.0,
        _ if is_driven(spec) => BALANCED.background_in_oscillation,
        CaseName::Static => BALANCED.background_at_rest,
        CaseName::Oscillating => BALANCED.background_in_oscillation,
        CaseName::Dividing | CaseName::Custom => BALANCED.background,
    };
    let volumes = if is_balanced { VolumesWord::Calibrated } else { VolumesWord::Plain };
    PressureConfig {
        form: if is_balanced { PressureForm::Hamiltonian } else { PressureForm::Mean },
        volumes: match *spec.volumes.get_or_insert(volumes) {
            VolumesWord::Calibrated => Volumes::Calibrated,
            VolumesWord::Plain => Volumes::Plain,
        },
        background: *spec.background_pressure.get_or_insert(background),
        bulk_damping,
    }
}

/// What becomes of the carried level, and the radius of the curvature's filter; the spec gets what was left open. A color
/// field has neither.
pub(super) fn level_and_curvature(
    spec: &mut Droplet,
    scope: Scope,
    errors: &mut Vec<Violation>,
) -> (LevelUpdate, Option<f64>) {
    if spec.geometry == GeometryChoice::Colorfield {
        let given: [(&str, Option<Value>); 2] = [
            ("/redistancing", spec.redistancing.as_ref().map(Parameter::to_json)),
            ("/curvature_filter_h", spec.curvature_filter_h.map(Value::from)),
        ];
        for (pointer, got) in given.into_iter().filter_map(|(pointer, got)| Some((pointer, got?))) {
            let detail = "a color field has no level: it belongs to geometry pcp";
            errors.push(Violation::new(pointer, "conflict", detail, got, Value::Null));
        }
        return (LevelUpdate::Overwrite, None);
    }
    // Particles that are shifted or whose densities drift have not been tried with a level of their own.
    let is_balanced = spec.tension_force == TensionWord::Balanced && scope.is_summation;
    let default = if is_balanced { with_defaults("transparent") } else { RedistancingChoice::Overwrite };
    let by_case = match spec.case {
        _ if is_rising(spec) => BALANCED.relaxation_in_rise,
        _ if is_driven(spec) => BALANCED.relaxation,
        CaseName::Static => BALANCED.relaxation_at_rest,
        CaseName::Oscillating => BALANCED.relaxation_in_oscillation,
        CaseName::Dividing | CaseName::Custom => BALANCED.relaxation,
    };
    let update = match spec.redistancing.get_or_insert(default) {
        RedistancingChoice::Transparent { relaxation, radius_h } => {
            let relaxation = *relaxation.get_or_insert(by_case);
            LevelUpdate::Transparent { relaxation, radius: *radius_h * spec.spacing }
        }
        RedistancingChoice::Overwrite => LevelUpdate::Overwrite,
    };
    let default = if is_balanced { BALANCED.curvature_filter_h } else { 0.0 };
    let filter_h = *spec.curvature_filter_h.get_or_insert(default);
    if filter_h > 0.0 && filter_h < LEAST_FILTER_H {
        let (detail, allowed) = ("there are too few particles within the radius", json!("0, or a number ≥ 2"));
        errors.push(Violation::new("/curvature_filter_h", "range", detail, filter_h, allowed));
    }
    let filter = filter_h * spec.spacing;
    (update, (filter > 0.0).then_some(filter))
}
