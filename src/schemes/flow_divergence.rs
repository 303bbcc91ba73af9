//! The divergence of a prescribed flow at its particles, for reports.

use crate::geometry::{Flow, Vector};
use crate::simulation::Diagnostic;

/// The largest |∇·u| over particles at a time; None for built-in flows, which have no divergence.
#[must_use]
pub fn divergence_diagnostic<const D: usize>(
    flow: &dyn Flow<D>,
    positions: &[Vector<D>],
    time: f64,
) -> Option<Diagnostic> {
    let divergences = flow.divergences(positions, time)?;
    let largest =
        divergences.iter().fold(0.0_f64, |most, value| if value.is_nan() { f64::NAN } else { most.max(value.abs()) });
    let doc = "Largest |∇·u| over the particles now; where it is not 0, the flow does not keep areas and volumes.";
    Some(Diagnostic { unit: "1/time".into(), ..Diagnostic::new("flow.divergence_max", largest, doc) })
}
