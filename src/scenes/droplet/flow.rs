//! How the flow of a droplet scene is discretized: kernels or fits, and where densities come from.

use super::cases::Case;
use super::parameters::{Density, Discretization as WrittenFlow, Written};
use crate::operators::Support;
use crate::scene::Violation;
use crate::schemes::weakly_compressible_sph::{DensityMethod, Discretization, KernelChoice};
use serde_json::{Value, json};

/// The flow as understood.
pub(super) struct Flow {
    pub discretization: Discretization,
    pub kernel: KernelChoice,
    pub smoothing_h: f64,
    pub density: DensityMethod,
    /// Its parameters with what was left open.
    pub full: Value,
    /// Those of the density.
    pub full_density: Value,
}

/// A kernel by its name.
fn kernel(name: &str) -> KernelChoice {
    match name {
        "wendland_c4" => KernelChoice::WendlandC4,
        "cubic_spline" => KernelChoice::CubicSpline,
        "quintic_spline" => KernelChoice::QuinticSpline,
        _ => KernelChoice::WendlandC2,
    }
}

impl Flow {
    /// Shifting that is not given: fits have no forces that keep particles apart.
    pub fn shifting(&self, case: &Case) -> &'static str {
        if self.discretization == Discretization::Kernels { case.shifting } else { "pst" }
    }

    pub fn understand(written: &Written, case: &Case, spacing: f64, violations: &mut Vec<Violation>) -> Self {
        let default = if case.density_method == "continuity" {
            Density::Continuity { diffusion: 0.05 }
        } else {
            Density::Summation
        };
        match &written.discretization {
            WrittenFlow::Sph { kernel: name, smoothing_h } => {
                let smoothing_h = smoothing_h.unwrap_or(case.smoothing_h);
                let (density, full_density) = match written.density_method.unwrap_or(default) {
                    Density::Summation => (DensityMethod::Summation, json!({"type": "summation"})),
                    Density::Continuity { diffusion } => {
                        (DensityMethod::Continuity { diffusion }, json!({"type": "continuity", "diffusion": diffusion}))
                    }
                };
                Self {
                    discretization: Discretization::Kernels,
                    kernel: kernel(name),
                    smoothing_h,
                    density,
                    full: json!({"type": "sph", "kernel": name, "smoothing_h": smoothing_h}),
                    full_density,
                }
            }
            WrittenFlow::Dcpse { order, cutoff_h, smoothing_h } => {
                check_fits(written, *order, violations);
                let smoothing_h = smoothing_h.unwrap_or(case.smoothing_h);
                // Less, and particles crowd.
                let cutoff_h = cutoff_h.unwrap_or(if *order == 4 { 5.5 } else { 3.5 });
                let support = Support { degree: *order as usize + 1, radius: cutoff_h * spacing };
                let diffusion = match written.density_method {
                    Some(Density::Continuity { diffusion }) => diffusion,
                    _ => 0.05,
                };
                Self {
                    discretization: Discretization::Dcpse(support),
                    kernel: kernel("wendland_c2"),
                    smoothing_h,
                    density: DensityMethod::Continuity { diffusion },
                    full: json!({"type": "dcpse", "order": order, "cutoff_h": cutoff_h, "smoothing_h": smoothing_h}),
                    full_density: json!({"type": "continuity", "diffusion": diffusion}),
                }
            }
        }
    }
}

/// What fits do not go together with.
fn check_fits(written: &Written, order: u64, violations: &mut Vec<Violation>) {
    let mut refuse = |pointer: &str, detail: &str, got: Value, allowed: Value| {
        violations.push(Violation::new(pointer, "conflict", detail, &got, allowed));
    };
    if order != 2 && order != 4 {
        refuse("/discretization/order", "there is no discretization of this order", json!(order), json!([2, 4]));
    }
    if let Some(Density::Summation) = written.density_method {
        let detail = "dcpse finds densities by continuity";
        refuse("/density_method", detail, json!("summation"), json!(["continuity"]));
    }
    if written.geometry["type"] == "colorfield" {
        let detail = "colour fields are sums over kernels";
        refuse("/geometry", detail, json!("colorfield"), json!(["pcp"]));
    }
    let (inside, outside) = (&written.fluids.inside, &written.fluids.outside);
    if inside.viscosity != outside.viscosity || inside.density != outside.density {
        let detail = "fits go across the interface: both fluids must have one density and one viscosity";
        let got = json!([inside.density, outside.density, inside.viscosity, outside.viscosity]);
        refuse("/fluids", detail, got, Value::Null);
    }
}
