//! The equations in the mass form, for densities by continuity (PCP eqs. B.12 to B.14; errata, PCP B.12 and B.13):
//!
//! du_i/dt = −Σ_j m_j (P_i/ρ_i² + P_j/ρ_j² + Π_ij) ∇W
//!
//! dρ_i/dt = ρ_i Σ_j u_ij·∇W V_j + ξ̂ ε c Σ_j 2 (ρ_i − ρ_j) x_ij·∇W/r² V_j
//!
//! | term | item |
//! | --- | --- |
//! | pressure P_i/ρ_i² + P_j/ρ_j² | [`MassPressure`] |
//! | viscosity Π_ij | [`MonaghanViscosity`] |
//! | compression | [`continuity::compression`] |
//! | diffusion of density | [`continuity::diffusion`] |

use super::flow_state::{FlowState, Rates};
use super::interactions::mass_pair::{
    DENSITY, INVERSE_REFERENCE, MASS, MassPair, PairFluids, STRESS, SpeciesFluids, UniformFluid, VISCOSITY, VOLUME,
};
use super::interactions::pressure::MassPressure;
use super::interactions::viscosity::MonaghanViscosity;
use super::interactions::{PairTerm, continuity};
use super::kernel_choice::with_kernel;
use super::pair_sums::Shares;
use super::pair_workspace::PairWorkspace;
use crate::linear_algebra::number::Lanes;
use crate::parallel::Interrupted;
use crate::smoothing_kernels::RadialKernel;
use std::array::from_fn;

/// Sets accelerations and rates of density. `diffusion` is ξ̂.
pub(super) fn find_rates<const D: usize>(
    flow: &FlowState<D>,
    diffusion: f64,
    pairs: &mut PairWorkspace<D>,
    rates: &mut Rates<D>,
) -> Result<(), Interrupted> {
    let (by_cell, unit) = (1.0 / pairs.cell, flow.fluids.inside.density * pairs.cell);
    let factor = MonaghanViscosity::factor(D);
    pairs.gather_vectors(1.0, |i| flow.predicted[i]);
    pairs.gather(DENSITY, 1.0, |i| flow.density[i]);
    pairs.gather(VOLUME, 1.0, |i| flow.mass(i) / flow.density[i] * by_cell);
    pairs.gather(STRESS, 0.0, |i| flow.pressure[i] / (flow.density[i] * flow.density[i]));
    let is_uniform = flow.fluids.have_one_mass() && flow.fluids.have_one_viscosity();
    if !is_uniform {
        pairs.gather(MASS, 1.0, |i| flow.mass(i) / unit);
        pairs.gather(VISCOSITY, 1.0, |i| factor * flow.fluid(i).kinematic_viscosity());
        pairs.gather(INVERSE_REFERENCE, 1.0, |i| 1.0 / flow.fluid(i).density);
    }
    let fluid = UniformFluid { viscosity: factor * flow.fluids.inside.kinematic_viscosity() };
    let terms = (MassPressure, MonaghanViscosity::new(pairs.inverse_smoothing()));
    with_kernel!(pairs.kernel.choice, K => match (is_uniform, D) {
        (true, 2) => sum_rates::<K, D, 3, 4>(pairs, fluid, terms),
        (true, _) => sum_rates::<K, D, 3, 5>(pairs, fluid, terms),
        (false, 2) => sum_rates::<K, D, 6, 4>(pairs, SpeciesFluids, terms),
        (false, _) => sum_rates::<K, D, 6, 5>(pairs, SpeciesFluids, terms),
    })?;
    let gradient = pairs.kernel.normalization * pairs.kernel.slope() / pairs.kernel.smoothing_length;
    for (place, i) in pairs.occupied() {
        let [compression, spread] = [pairs.sum(D, place), pairs.sum(D + 1, place)];
        let fluid = flow.fluid(i);
        rates.acceleration[i] = pairs.vector_sum(place) * (-unit * gradient);
        // Excesses are of ρ, or of ρ/ρ₀ where the fluids differ; W'/r has one more 1/ε than ∇W by x/ε.
        let scale = if is_uniform { 1.0 } else { fluid.density };
        let spread = diffusion * fluid.sound_speed * scale * spread;
        rates.density[i] = (flow.density[i] * compression + spread) * gradient * pairs.cell;
    }
    Ok(())
}

/// Sums over all pairs, but for factors that are the same for all pairs: D components of the force, compression, diffusion.
/// `N` is D + 2.
fn sum_rates<K: RadialKernel, const D: usize, const S: usize, const N: usize>(
    pairs: &mut PairWorkspace<D>,
    fluids: impl PairFluids<D, S>,
    terms: impl for<'a> PairTerm<MassPair<'a, D, S>, Lanes>,
) -> Result<(), Interrupted> {
    let one = Lanes::splat(1.0);
    pairs.sum_pairs::<2, S, N>(|sides| {
        let slope: Lanes = K::slope_over_q(sides.q());
        let pair = MassPair::new(sides, fluids);
        // −0 is the sum of no terms: adding it changes no number, and costs nothing.
        let force = slope * terms.add_to(Lanes::splat(-0.0), &pair);
        let compression = slope * continuity::compression(&pair);
        let diffusion = slope * continuity::diffusion(&pair);
        // Force and diffusion change their sign with the side, compression does not.
        let shares = |mass: Lanes, volume: Lanes, sign: Lanes| -> [Lanes; N] {
            let (weight, spread) = (sign * mass * force, sign * volume * diffusion);
            from_fn(|n| sides.dx.get(n).map_or(if n == D { volume * compression } else { spread }, |dx| weight * *dx))
        };
        let ((mass, other_mass), (volume, other_volume)) = (pair.constants.masses, sides.scalar(VOLUME));
        Shares { own: shares(other_mass, other_volume, one), other: shares(mass, volume, -one) }
    })
}

#[cfg(test)]
mod tests {
    use super::find_rates;
    use crate::geometry::Vector;
    use crate::geometry::random::CounterRandom;
    use crate::schemes::weakly_compressible_sph::KernelChoice;
    use crate::schemes::weakly_compressible_sph::flow_state::Rates;
    use crate::schemes::weakly_compressible_sph::test_setting::{near, setting};

    fn check<const D: usize>(ratio: f64) {
        let this = setting::<D>(KernelChoice::WendlandC2, ratio);
        let (mut pairs, mut flow) = (this.gathered(), this.flow());
        let random = CounterRandom::new(8);
        for i in 0..flow.count() {
            flow.density[i] = flow.fluid(i).density * (1.0 + 0.05 * random.symmetric(&[i as i64]));
        }
        flow.derive_pressures();
        let mut rates = Rates::none(flow.count(), true);
        find_rates(&flow, 0.05, &mut pairs, &mut rates).unwrap();
        let (density, pressure, velocity) = (&flow.density, &flow.pressure, &flow.predicted);
        let (e, factor) = (this.config.smoothing_length, if D == 2 { 8.0 } else { 10.0 });
        for i in this.probes() {
            let (mut a, mut expected, mut scale) = (Vector::<D>::zeros(), 0.0, 0.0);
            this.each(i, |j, dx, r| {
                let grad = dx * (this.slope(r) / r);
                let u = velocity[i] - velocity[j];
                let (fluid, other) = (flow.fluid(i), flow.fluid(j));
                let (nu_i, nu_j) = (fluid.kinematic_viscosity(), other.kinematic_viscosity());
                let nu = factor * 2.0 * nu_i * nu_j / (nu_i + nu_j);
                let pi = -nu / (0.5 * (density[i] + density[j])) * u.dot(&dx) / (r * r + 0.01 * e * e);
                let part = pressure[i] / density[i].powi(2) + pressure[j] / density[j].powi(2) + pi;
                a -= grad * (flow.mass(j) * part);
                let volume = flow.mass(j) / density[j];
                let excess = (density[i] / fluid.density - density[j] / other.density) * fluid.density;
                expected += density[i] * u.dot(&grad) * volume;
                let spread = 0.05 * e * fluid.sound_speed * 2.0 * excess * dx.dot(&grad) / (r * r) * volume;
                expected += spread;
                scale += spread.abs() + (grad * (flow.mass(j) * part)).norm();
            });
            near(rates.density[i], expected, scale, "rate of density");
            for d in 0..D {
                near(rates.acceleration[i][d], a[d], scale, "acceleration");
            }
        }
        let forces = rates.acceleration.iter().enumerate().map(|(i, a)| a * flow.mass(i));
        let (all, norms) = forces.fold((Vector::<D>::zeros(), 0.0), |(all, norms), f| (all + f, norms + f.norm()));
        assert!(all.norm() < 1e-13 * norms, "{} of {norms}", all.norm());
    }

    #[test]
    fn rates_are_those_of_the_paper_and_keep_momentum() {
        check::<2>(1.0);
        check::<2>(10.0);
        check::<3>(1.0);
    }
}
