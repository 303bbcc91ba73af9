//! How the flow of a droplet scene is discretized: kernels or fits, and where densities come from.

use super::cases::{Case, DEFAULT_DIFFUSION};
use super::spec::{DensityChoice, DiscretizationChoice, Droplet, GeometryChoice, KernelWord, Shifting};
use crate::operators::Support;
use crate::schemes::weakly_compressible_sph::{DensityMethod, Discretization, KernelChoice};
use crate::spec::Violation;
use serde_json::{Value, json};

/// The discretization of the flow, as planned.
pub(super) struct FlowPlan {
    pub discretization: Discretization,
    pub kernel: KernelChoice,
    /// Smoothing length ε in h.
    pub smoothing_h: f64,
    pub density: DensityMethod,
    /// Shifting where none is given: fits have no forces that keep particles apart.
    pub default_shifting: Shifting,
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
    pub fn new(spec: &mut Droplet, case: &Case, errors: &mut Vec<Violation>) -> Self {
        if let DiscretizationChoice::Dcpse { order, .. } = spec.discretization {
            check_fits(spec, order, errors);
        }
        let given_density = spec.density_method.clone();
        match &mut spec.discretization {
            DiscretizationChoice::Sph { kernel, smoothing_h } => {
                let density = given_density.unwrap_or_else(|| case.density_method.clone());
                spec.density_method = Some(density.clone());
                Self {
                    discretization: Discretization::Kernels,
                    kernel: (*kernel).into(),
                    smoothing_h: *smoothing_h.get_or_insert(case.smoothing_h),
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
                    smoothing_h: *smoothing_h.get_or_insert(case.smoothing_h),
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
