//! Particle shifting towards an even distribution (PCP eqs. B.15 and B.16).

use crate::geometry::Vector;
use crate::linear_algebra::number::{Lanes, Number};
use crate::parallel::Interrupted;
use crate::schemes::weakly_compressible_sph::kernel_choice::with_kernel;
use crate::schemes::weakly_compressible_sph::pair_sums::Shares;
use crate::schemes::weakly_compressible_sph::pair_workspace::PairWorkspace;
use crate::smoothing_kernels::RadialKernel;

/// Constants of the shifting.
struct Tuning {
    /// Factor of (W_ij/W(h))⁴ in the concentration (the paper's).
    crowding: f64,
    /// The longest displacement, in ε (the paper's).
    longest: f64,
    /// Distance from the interface, in h, from which particles are shifted fully. Next to the interface they are shifted along it
    /// alone. The paper shifts them across too; those that change side then leave fragments where a neck is thinner than
    /// fits can tell (measured with the dividing drop).
    free_from: f64,
}

const TUNING: Tuning = Tuning { crowding: 0.2, longest: 0.02, free_from: 2.0 };

/// Scalar column: volumes in units of the cell.
const VOLUME: usize = 0;

/// Calls `found` with the gradient of the concentration at every particle, and behind them at the points of walls,
/// ∇C_i = Σ_j (1 + 0.2 (W_ij/W(h))⁴) ∇W V_j (B.15). `spacing` is h.
pub fn concentration<const D: usize>(
    pairs: &mut PairWorkspace<D>,
    volume: impl Fn(usize) -> f64,
    spacing: f64,
    mut found: impl FnMut(usize, Vector<D>),
) -> Result<(), Interrupted> {
    let by_cell = 1.0 / pairs.cell;
    pairs.gather(VOLUME, 0.0, |i| volume(i) * by_cell);
    let at_spacing = pairs.kernel.value(spacing / pairs.kernel.smoothing_length);
    let (one, crowding, by_spacing) =
        (Lanes::splat(1.0), Lanes::splat(TUNING.crowding), Lanes::splat(1.0 / at_spacing));
    with_kernel!(pairs.kernel.choice, K => pairs.sum_pairs::<1, 1, D>(|pair| {
        let q = pair.q();
        let (value, slope): (Lanes, Lanes) = (K::value(q), K::slope_over_q(q));
        let (volume, other_volume) = pair.scalar(VOLUME);
        let ratio = value * by_spacing;
        let ratio2 = ratio * ratio;
        let weight = slope * Number::mul_add(ratio2 * ratio2, crowding, one);
        Shares {
            own: pair.dx.map(|part| weight * other_volume * part),
            other: pair.dx.map(|part| -(weight * volume * part)),
        }
    }))?;
    let kernel = &pairs.kernel;
    let factor = pairs.cell * kernel.normalization * kernel.slope() / kernel.smoothing_length;
    for (place, i) in pairs.occupied() {
        found(i, pairs.vector_sum(place) * factor);
    }
    Ok(())
}

/// The displacement for a gradient of the concentration times a rate, −rate ε² ∇C, at most 0.02 ε and `way` long (B.16, with a rate
/// of .05).
#[must_use]
pub fn displacement<const D: usize>(gradient: Vector<D>, smoothing_length: f64, way: f64) -> Vector<D> {
    let full = gradient * -(smoothing_length * smoothing_length);
    let (length, most) = (full.norm(), (TUNING.longest * smoothing_length).min(way));
    if length < most { full } else { full * (most / length) }
}

/// The share of a displacement across the interface that is left out, at a distance from the interface in h: 1 within one
/// spacing, 0 from two spacings on.
#[must_use]
pub fn share_left_out(distance_h: f64) -> f64 {
    (TUNING.free_from - distance_h.abs()).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::{concentration, displacement, share_left_out};
    use crate::geometry::Vector;
    use crate::schemes::weakly_compressible_sph::KernelChoice;
    use crate::schemes::weakly_compressible_sph::interactions::density_summation::sum_volumes;
    use crate::schemes::weakly_compressible_sph::test_setting::setting;

    #[test]
    fn concentrations_push_from_the_crowded_to_the_empty() {
        let this = setting::<2>(KernelChoice::WendlandC2, 1.0);
        let mut pairs = this.gathered();
        let mut volume = vec![0.0; this.positions.len()];
        sum_volumes(&mut pairs, 1.0, &mut volume, &mut []).unwrap();
        let mut gradients = vec![Vector::<2>::zeros(); volume.len()];
        concentration(&mut pairs, |i| volume[i], this.config.spacing, |i, g| gradients[i] = g).unwrap();
        for i in this.probes() {
            let mut expected = Vector::<2>::zeros();
            this.each(i, |j, dx, r| {
                let weight = 1.0 + 0.2 * (this.w(r) / this.w(this.config.spacing)).powi(4);
                expected += dx * (weight * this.slope(r) / r * volume[j]);
            });
            assert!((gradients[i] - expected).norm() < 1e-6 * (1.0 + expected.norm()));
        }
        let far = displacement(Vector::<2>::new(5.0, 0.0), 0.2, f64::INFINITY);
        assert!((far + Vector::<2>::new(0.004, 0.0)).norm() < 1e-15, "at most 0.02 ε, against the gradient");
    }

    #[test]
    fn particles_at_the_interface_are_shifted_along_it_alone() {
        assert_eq!([0.0, -0.5, 1.0, 1.5, -2.0, 9.0].map(share_left_out), [1.0, 1.0, 1.0, 0.5, 0.0, 0.0]);
    }
}
