//! The flow of a droplet scene: fluids, body force, and its discretization by kernels or fits.

use super::cases::{Case, DEFAULT_DIFFUSION};
use super::formulation::{Scope, Start};
use super::own_motion::formula_force;
use super::room::Room;
use super::spec::{
    Balance, DensityChoice, DiscretizationChoice, Droplet, FluidSpec, Fluids, ForceChoice, GeometryChoice, KernelWord,
    LatticeWord, Shifting,
};
use crate::geometry::Vector;
use crate::operators::Support;
use crate::schemes::weakly_compressible_sph::Fluids as SchemeFluids;
use crate::schemes::weakly_compressible_sph::{BodyForce, DensityMethod, Discretization, Fluid, KernelChoice};
use crate::spec::{Parameter, Violation};
use serde_json::{Value, json};

/// The discretization of the flow, as planned.
pub(super) struct FlowPlan {
    pub discretization: Discretization,
    pub kernel: KernelChoice,
    /// Smoothing length ε in h.
    pub smoothing_h: f64,
    /// Lattice of the start.
    pub lattice: LatticeWord,
    pub scope: Scope,
    pub density: DensityMethod,
    /// Shifting where none is given: fits have no forces that keep particles apart.
    pub default_shifting: Shifting,
}

impl From<&FluidSpec> for Fluid {
    fn from(spec: &FluidSpec) -> Self {
        let FluidSpec { density, viscosity, sound_speed, polytropic } = *spec;
        Self { density, viscosity, sound_speed, polytropic }
    }
}

impl Fluids {
    /// The fluids as the scheme takes them.
    pub(super) fn planned(&self) -> SchemeFluids {
        SchemeFluids { inside: Fluid::from(&self.inside), outside: Fluid::from(&self.outside) }
    }
}

/// The body force in a box until a time.
pub(super) fn body_force<const D: usize>(
    force: &ForceChoice,
    fluids: &Fluids,
    (room, end_time): (&Room<D>, f64),
    errors: &mut Vec<Violation>,
) -> Option<BodyForce<D>> {
    match force {
        ForceChoice::Formula { acceleration, parameters } => {
            formula_force(acceleration, parameters, (&room.low, &room.lengths(), end_time), errors)
        }
        ForceChoice::None => None,
        ForceChoice::Pulse { coefficient, duration, a, b, c } => {
            let lengths = Vector::<D>::from_fn(|d, _| [*a, *b, *c][d]);
            Some(BodyForce::Pulse { coefficient: *coefficient, duration: *duration, lengths })
        }
        ForceChoice::Constant { acceleration, balance } => {
            if acceleration.len() != D {
                let (at, detail) = ("/body_force/acceleration", format!("the scene has {D} dimensions"));
                errors.push(Violation::new(at, "conflict", detail, acceleration.to_json(), format!("{D} numbers")));
            }
            let acceleration_vector = Vector::<D>::from_fn(|d, _| acceleration.get(d).copied().unwrap_or(0.0));
            let (inside, outside) = (fluids.inside.density, fluids.outside.density);
            let is_free = (0..D).any(|d| acceleration_vector[d] != 0.0 && !room.is_bounded(d));
            if *balance == Balance::None && inside != outside && is_free {
                let detail = "along a periodic axis two fluids fall freely together, whatever their densities; balance mean takes \
                              the mean force out and leaves buoyancy; free_fall lets it through";
                errors.push(Violation::new(
                    "/body_force/balance",
                    "conflict",
                    detail,
                    "none",
                    json!(["mean", "free_fall"]),
                ));
            }
            Some(match balance {
                Balance::None | Balance::FreeFall => BodyForce::Constant(acceleration_vector),
                Balance::Mean => BodyForce::WithoutMean(acceleration_vector),
            })
        }
    }
}

impl From<KernelWord> for KernelChoice {
    fn from(word: KernelWord) -> Self {
        match word {
            KernelWord::WendlandC2 => Self::WendlandC2,
            KernelWord::WendlandC4 => Self::WendlandC4,
            KernelWord::CubicSpline => Self::CubicSpline,
            KernelWord::QuinticSpline => Self::QuinticSpline,
        }
    }
}

impl FlowPlan {
    /// Plans the flow of a scene; the spec gets what was left open.
    pub fn new(spec: &mut Droplet, case: &Case, dimension: usize, errors: &mut Vec<Violation>) -> Self {
        if let DiscretizationChoice::Dcpse { order, .. } = spec.discretization {
            check_fits(spec, order, errors);
        }
        let given_density = spec.density_method.clone();
        let is_kernels = matches!(spec.discretization, DiscretizationChoice::Sph { .. });
        let is_summation =
            is_kernels && given_density.as_ref().unwrap_or(&case.density_method) == &DensityChoice::Summation;
        let scope = Scope { dimension, is_summation };
        let start = Start::new(spec, scope, errors);
        let (lattice, default_smoothing) = (start.lattice, start.smoothing_h.unwrap_or(case.smoothing_h));
        match &mut spec.discretization {
            DiscretizationChoice::Sph { kernel, smoothing_h } => {
                let density = given_density.unwrap_or_else(|| case.density_method.clone());
                spec.density_method = Some(density.clone());
                Self {
                    discretization: Discretization::Kernels,
                    kernel: (*kernel).into(),
                    smoothing_h: *smoothing_h.get_or_insert(default_smoothing),
                    lattice,
                    scope,
                    density: match density {
                        DensityChoice::Summation => DensityMethod::Summation,
                        DensityChoice::Continuity { diffusion } => DensityMethod::Continuity { diffusion },
                    },
                    default_shifting: case.shifting,
                }
            }
            DiscretizationChoice::Dcpse { order, cutoff_h, smoothing_h } => {
                // With less, particles crowd.
                let cutoff_h = *cutoff_h.get_or_insert(if *order == 4 { 5.5 } else { 3.5 });
                let diffusion = match given_density {
                    Some(DensityChoice::Continuity { diffusion }) => diffusion,
                    Some(DensityChoice::Summation) | None => DEFAULT_DIFFUSION,
                };
                spec.density_method = Some(DensityChoice::Continuity { diffusion });
                let support = Support { degree: *order as usize + 1, radius: cutoff_h * spec.spacing };
                Self {
                    discretization: Discretization::Dcpse(support),
                    kernel: KernelChoice::WendlandC2,
                    smoothing_h: *smoothing_h.get_or_insert(default_smoothing),
                    lattice,
                    scope,
                    density: DensityMethod::Continuity { diffusion },
                    default_shifting: Shifting::Pst,
                }
            }
        }
    }
}

/// What fits do not go together with.
fn check_fits(spec: &Droplet, order: u64, errors: &mut Vec<Violation>) {
    let mut refuse = |pointer: &str, detail: &str, got: Value, allowed: Value| {
        errors.push(Violation::new(pointer, "conflict", detail, got, allowed));
    };
    if order != 2 && order != 4 {
        refuse("/discretization/order", "there is no discretization of this order", json!(order), json!([2, 4]));
    }
    if let Some(DensityChoice::Summation) = spec.density_method {
        let detail = "dcpse finds densities by continuity";
        refuse("/density_method", detail, json!("summation"), json!(["continuity"]));
    }
    if spec.geometry == GeometryChoice::Colorfield {
        let detail = "color fields are sums over kernels";
        refuse("/geometry", detail, json!("colorfield"), json!(["pcp"]));
    }
    let (inside, outside) = (&spec.fluids.inside, &spec.fluids.outside);
    if inside.viscosity != outside.viscosity || inside.density != outside.density {
        let detail =
            "the fits of dcpse reach across the interface: both fluids must have one density and one viscosity";
        let got = json!([inside.density, outside.density, inside.viscosity, outside.viscosity]);
        refuse("/fluids", detail, got, Value::Null);
    }
}
