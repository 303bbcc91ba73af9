//! Normals and curvatures of the smoothed colour of the phases (PCP eqs. B.5 to B.10; Adami et al. 2010), with the volume of
//! particle j in the sum of B.6 and curvatures of the sign of this project: positive where the inside is convex.

use super::pair_sums::{Columns, total};
use crate::linear_algebra::number::{Lanes, Number};
use crate::neighbors::Pencils;
use crate::parallel::{Interrupt, Interrupted};
use crate::smoothing_kernels::RadialKernel;

/// |n̂| ε above which a particle is one of the interface (B.7).
pub(super) const THRESHOLD: f64 = 0.01;

/// Σ c_j W V_j (B.5) but for the kernel's factor. Columns: position in ε; V c.
pub(super) fn sum_color<K: RadialKernel, const D: usize>(
    pencils: &Pencils<D>,
    columns: &Columns<'_, D, 1, 1>,
    inverse_smoothing: f64,
    colors: &mut [f64],
    interrupt: &Interrupt,
) -> Result<(), Interrupted> {
    pencils.for_each_place(colors, interrupt, |place, near, color| {
        let own = columns.at(place);
        let mut sum = Lanes::splat(0.0);
        columns.pairs(&own, near, inverse_smoothing, |_, square, other| {
            let value: Lanes = K::value(Number::sqrt(square));
            sum = Number::mul_add(value, other.scalars[0], sum);
        });
        *color = total(sum);
    })
}

/// Σ (c_j − c_i) ∇W V_j (B.6) but for the kernel's factor. Columns: position in ε; c, V in h^D.
pub(super) fn sum_gradient<K: RadialKernel, const D: usize>(
    pencils: &Pencils<D>,
    columns: &Columns<'_, D, 1, 2>,
    inverse_smoothing: f64,
    gradients: &mut [[f64; D]],
    interrupt: &Interrupt,
) -> Result<(), Interrupted> {
    pencils.for_each_place(gradients, interrupt, |place, near, gradient| {
        let own = columns.at(place);
        let mut sums = [Lanes::splat(0.0); D];
        columns.pairs(&own, near, inverse_smoothing, |dx, square, other| {
            let slope: Lanes = K::slope_over_q(Number::sqrt(square));
            let weight = slope * other.scalars[1] * (other.scalars[0] - own.scalars[0]);
            for d in 0..D {
                sums[d] = Number::mul_add(weight, dx[d], sums[d]);
            }
        });
        *gradient = sums.map(total);
    })
}

/// The sums of B.9, Σ N_j W V_j and Σ N_j (n_j − n_i)·∇W V_j, each but for the kernel's factor; nothing where N_i is zero.
/// Columns: position in ε, unit normal; V N in h^D.
pub(super) fn sum_curvature<K: RadialKernel, const D: usize>(
    pencils: &Pencils<D>,
    columns: &Columns<'_, D, 2, 1>,
    inverse_smoothing: f64,
    sums: &mut [[f64; 2]],
    interrupt: &Interrupt,
) -> Result<(), Interrupted> {
    pencils.for_each_place(sums, interrupt, |place, near, sum| {
        *sum = [0.0; 2];
        if columns.scalars[0][place] == 0.0 {
            return;
        }
        let own = columns.at(place);
        let (mut weights, mut divergence) = (Lanes::splat(0.0), Lanes::splat(0.0));
        columns.pairs(&own, near, inverse_smoothing, |dx, square, other| {
            let q = Number::sqrt(square);
            let (value, slope): (Lanes, Lanes) = (K::value(q), K::slope_over_q(q));
            weights = Number::mul_add(value, other.scalars[0], weights);
            for (d, dx) in dx.iter().enumerate() {
                let turn = (other.vectors[1][d] - own.vectors[1][d]) * *dx;
                divergence = Number::mul_add(slope * other.scalars[0], turn, divergence);
            }
        });
        *sum = [total(weights), total(divergence)];
    })
}
