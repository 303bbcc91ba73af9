//! Particle shifting towards an even distribution (PCP eqs. B.15 and B.16).

use super::column::Column;
use super::pair_sums::Columns;
use crate::geometry::Vector;
use crate::linear_algebra::number::{Lanes, Number};
use crate::neighbors::Pencils;
use crate::parallel::{Interrupt, Interrupted};
use crate::smoothing_kernels::RadialKernel;

/// The longest displacement, in ε.
const MOST_SHIFT: f64 = 0.02;

/// Σ (1 + 0.2 (W_ij/W(h))⁴) ∇W V_j, but for the kernel's factors. Columns: position in ε; V in h^D. `at_spacing` is w(h/ε).
pub(super) fn sum_concentration<K: RadialKernel, const D: usize>(
    pencils: &Pencils<D>,
    columns: &Columns<'_, D, 1, 1>,
    inverse_smoothing: f64,
    at_spacing: f64,
    gradients: &mut [Column],
    interrupt: &Interrupt,
) -> Result<(), Interrupted> {
    let (one, fifth, by_spacing) = (Lanes::splat(1.0), Lanes::splat(0.2), Lanes::splat(1.0 / at_spacing));
    columns.sum_pairs(pencils, inverse_smoothing, gradients, interrupt, |own, other, dx, square| {
        let q = Number::sqrt(square);
        let (value, slope): (Lanes, Lanes) = (K::value(q), K::slope_over_q(q));
        let ratio = value * by_spacing;
        let ratio2 = ratio * ratio;
        let weight = slope * Number::mul_add(ratio2 * ratio2, fifth, one);
        (dx.map(|part| weight * other.scalars[0] * part), dx.map(|part| -(weight * own.scalars[0] * part)))
    })
}

/// The displacement for a gradient of concentration: −0.05 ε² ∇C, at most 0.02 ε long.
#[must_use]
pub(super) fn displacement<const D: usize>(gradient: Vector<D>, smoothing_length: f64) -> Vector<D> {
    let full = gradient * (-0.05 * smoothing_length * smoothing_length);
    let (length, most) = (full.norm(), MOST_SHIFT * smoothing_length);
    if length < most { full } else { full * (most / length) }
}

/// How much of the part of a displacement across the interface is left out, at a distance in h: all of it next to the
/// interface, nothing from two spacings on. The paper shifts across and redistances from the fits before; those who change
/// side then leave fragments behind where a neck is thinner than fits can tell (measured).
#[must_use]
pub(super) fn part_along(distance_h: f64) -> f64 {
    (2.0 - distance_h.abs()).clamp(0.0, 1.0)
}
