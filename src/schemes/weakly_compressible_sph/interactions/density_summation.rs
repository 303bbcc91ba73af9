//! Density by summation (PCP eq. B.1): the number density of particles is the sum of their kernels.

use crate::linear_algebra::number::Lanes;
use crate::parallel::Interrupted;
use crate::schemes::weakly_compressible_sph::kernel_choice::with_kernel;
use crate::schemes::weakly_compressible_sph::pair_sums::Shares;
use crate::schemes::weakly_compressible_sph::pair_workspace::PairWorkspace;
use crate::smoothing_kernels::RadialKernel;

/// Sets the volume of every particle, and of the points of walls behind them, V_i = a/Σ_j W_ij with the particle itself in the
/// sum. `calibration` is a, without dimension; 1 in PCP eq. B.1.
pub fn sum_volumes<const D: usize>(
    pairs: &mut PairWorkspace<D>,
    calibration: f64,
    volume: &mut [f64],
    wall_volume: &mut [f64],
) -> Result<(), Interrupted> {
    with_kernel!(pairs.kernel.choice, K => pairs.sum_pairs::<1, 0, 1>(|pair| {
        let value: Lanes = K::value(pair.q());
        Shares::equal([value])
    }))?;
    let (own, normalization) = (pairs.kernel.value(0.0), pairs.kernel.normalization);
    for (place, i) in pairs.occupied() {
        let count = volume.len();
        let found = if i < count { &mut volume[i] } else { &mut wall_volume[i - count] };
        *found = calibration / (normalization * (own + pairs.sum(0, place)));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::sum_volumes;
    use crate::schemes::weakly_compressible_sph::test_setting::{KERNELS, Setting, near, setting};

    fn check<const D: usize>(this: &Setting<D>) {
        let mut volume = vec![0.0; this.positions.len()];
        sum_volumes(&mut this.gathered(), 1.0, &mut volume, &mut []).unwrap();
        for i in this.probes() {
            let mut number = this.w(0.0);
            this.each(i, |_, _, r| number += this.w(r));
            near(volume[i], 1.0 / number, volume[i], "volume");
        }
    }

    #[test]
    fn volumes_are_those_of_a_loop_over_all_particles() {
        for kernel in KERNELS {
            check(&setting::<2>(kernel, 1.0));
            check(&setting::<3>(kernel, 1.0));
        }
    }
}
