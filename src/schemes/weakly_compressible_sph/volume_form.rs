//! The momentum equation in the volume form, for densities by summation (PCP eq. B.2):
//!
//! m_i du_i/dt = Σ_j w'/r · ((V_i² + V_j²) η_ij u_ij − P_ij x_ij)
//!
//! | term | item |
//! | --- | --- |
//! | viscosity η_ij u_ij | [`UniformViscosity`] or [`SpeciesViscosity`] |
//! | viscosity as the divergence of the whole stress | [`StressViscosity`] |
//! | pressure P_ij = (V_i² + V_j²) P̄_ij (the paper's) | [`VolumePressure`] |
//! | pressure P_ij = (P_i V_i² + P_j V_j²)/a (Hamiltonian) | [`HamiltonianPressure`] |
//!
//! Forces of a pair are opposite, so that momentum is kept to round-off. The Hamiltonian form is minus the gradient of the
//! elastic energy Σ m e(ρ) for volumes V_i = a/Σ_j W_ij: −∂/∂x_k Σ m_i e_i = Σ_i P_i ∂V_i/∂x_k.

use super::config::PressureForm;
use super::flow_state::FlowState;
use super::interactions::pressure::{HamiltonianPressure, VolumePressure};
use super::interactions::viscosity::{SpeciesViscosity, StressViscosity, UniformViscosity};
use super::interactions::volume_pair::{STRESS, VISCOSITY, VOLUME, WALL};
use super::interactions::{NoTerm, PairTerm};
use super::kernel_choice::with_kernel;
use super::mean_shear::MeanShear;
use super::pair_sums::{Pair, Shares};
use super::pair_workspace::PairWorkspace;
use super::walls::{FlowAndWalls, Walls};
use crate::geometry::Vector;
use crate::linear_algebra::number::{Lanes, Number};
use crate::parallel::Interrupted;
use crate::smoothing_kernels::RadialKernel;

/// Which of the forms the forces take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Forms {
    pub pressure: PressureForm,
    /// Whether two viscosities act by the whole stress.
    pub has_whole_stress: bool,
    /// The mean flow of a box in shear.
    pub mean_shear: Option<MeanShear>,
}

/// Sets accelerations to those of the pair forces. Returns Σ_pairs F_x y_ij of a box in shear, 0 elsewhere.
///
/// Points of walls take part as particles do; their forces are set, too.
pub(super) fn accelerate<const D: usize>(
    flow: &FlowState<D>,
    mut walls: Option<&mut Walls<D>>,
    Forms { pressure: form, has_whole_stress, mean_shear }: Forms,
    pairs: &mut PairWorkspace<D>,
    acceleration: &mut [Vector<D>],
) -> Result<f64, Interrupted> {
    let (by_cell, inverse) = (1.0 / pairs.cell, pairs.inverse_smoothing());
    let all = FlowAndWalls { flow, walls: walls.as_deref() };
    pairs.gather(VOLUME, 1.0, |i| all.volume(i) * by_cell);
    match form {
        PressureForm::Mean => pairs.gather(STRESS, 0.0, |i| all.volume(i) * by_cell * all.pressure(i)),
        PressureForm::Hamiltonian => {
            let by_calibration = 1.0 / flow.calibration;
            pairs.gather(STRESS, 0.0, |i| {
                let volume = all.volume(i) * by_cell;
                volume * volume * by_calibration * all.pressure(i)
            });
        }
    }
    let is_uniform = flow.fluids.have_one_viscosity();
    if is_uniform {
        let factor = flow.fluids.inside.viscosity * flow.viscosity_factor * inverse;
        pairs.gather_velocities(factor, mean_shear.as_ref(), |i| all.velocity(i));
    } else {
        pairs.gather(VISCOSITY, 1.0, |i| all.viscosity(i));
        pairs.gather_velocities(flow.viscosity_factor * inverse, mean_shear.as_ref(), |i| all.velocity(i));
    }
    let stress = StressViscosity { least: flow.fluids.least_viscosity() };
    let count = flow.count();
    let ways = Ways { across: mean_shear.map(|shear| shear.axis), has_walls: walls.is_some() };
    if ways.has_walls {
        pairs.gather(VISCOSITY, 1.0, |i| all.viscosity(i));
        pairs.gather(WALL, 0.0, |i| f64::from(u8::from(i >= count)));
    }
    let virial = with_kernel!(pairs.kernel.choice, K => match (form, is_uniform) {
        (PressureForm::Mean, true) => sum_ways::<K, D, 2>(pairs, (UniformViscosity, VolumePressure), NoTerm, ways),
        (PressureForm::Mean, false) => sum_ways::<K, D, 3>(pairs, (SpeciesViscosity, VolumePressure), NoTerm, ways),
        (PressureForm::Hamiltonian, true) => sum_ways::<K, D, 2>(pairs, UniformViscosity, HamiltonianPressure, ways),
        (PressureForm::Hamiltonian, false) if has_whole_stress => {
            sum_ways::<K, D, 3>(pairs, stress, HamiltonianPressure, ways)
        }
        (PressureForm::Hamiltonian, false) => sum_ways::<K, D, 3>(pairs, SpeciesViscosity, HamiltonianPressure, ways),
    })?;
    // ∇W = σ/ε^(D+1) w'(q)/q x/ε.
    let kernel = &pairs.kernel;
    let factor = pairs.cell * pairs.cell * kernel.normalization * kernel.slope() / kernel.smoothing_length;
    for (place, i) in pairs.occupied() {
        let force = pairs.vector_sum(place) * factor;
        if i < count {
            acceleration[i] = force / flow.mass(i);
        } else if let Some(walls) = &mut walls {
            walls.force[i - count] = force;
        }
    }
    Ok(virial * factor * pairs.kernel.smoothing_length)
}

/// The share of its viscosity that a fluid has in the sums over pairs, −(1/D) Σ_j V_j w' r as a mean over the particles: 1 for
/// integrals, and below on a lattice with few neighbors (.9955 for triangles with ε = 1.75 h).
pub(super) fn viscosity_share<const D: usize>(
    flow: &FlowState<D>,
    walls: Option<&Walls<D>>,
    pairs: &mut PairWorkspace<D>,
) -> Result<f64, Interrupted> {
    let all = FlowAndWalls { flow, walls };
    pairs.gather(VOLUME, 0.0, |i| all.volume(i));
    with_kernel!(pairs.kernel.choice, K => pairs.sum_pairs::<1, 1, 1>(|pair| {
        let slope: Lanes = K::slope_over_q(pair.q());
        let (volume, other_volume) = pair.scalar(VOLUME);
        let common = slope * pair.square;
        Shares { own: [common * other_volume], other: [common * volume] }
    }))?;
    let factor = -pairs.kernel.normalization * pairs.kernel.slope() / D as f64;
    let count = flow.count();
    let own = pairs.occupied().filter(|(_, i)| *i < count).map(|(place, _)| pairs.sum(0, place) * factor);
    Ok(own.sum::<f64>() / count as f64)
}

/// In which ways sums of forces differ from that of all pairs of particles.
#[derive(Debug, Clone, Copy)]
struct Ways {
    /// The axis along which a box is sheared: the virial is wanted.
    across: Option<usize>,
    /// Whether some are points of walls: two of them feel no force. Behind walls that face each other they are neighbors around the
    /// box, and walls that pass each other would do work on each other.
    has_walls: bool,
}

/// Scalar columns where there are walls.
const WITH_WALLS: usize = WALL + 1;

/// [`sum_forces`] with as many scalar columns as a scene has.
fn sum_ways<K: RadialKernel, const D: usize, const S: usize>(
    pairs: &mut PairWorkspace<D>,
    terms: impl for<'a> PairTerm<Pair<'a, D, 2, S>, [Lanes; D]>
    + for<'a> PairTerm<Pair<'a, D, 2, WITH_WALLS>, [Lanes; D]>
    + Sync,
    plain_terms: impl for<'a> PairTerm<Pair<'a, D, 2, S>, [Lanes; D]>
    + for<'a> PairTerm<Pair<'a, D, 2, WITH_WALLS>, [Lanes; D]>
    + Sync,
    Ways { across, has_walls }: Ways,
) -> Result<f64, Interrupted> {
    if has_walls {
        sum_forces::<K, D, WITH_WALLS>(pairs, terms, plain_terms, across)
    } else {
        sum_forces::<K, D, S>(pairs, terms, plain_terms, across)
    }
}

/// Sums w'/r times the terms over all pairs, `terms` with the factor V_i² + V_j², and `plain_terms` without it. Returns the sum over
/// pairs of the first component times the way of the pair along the axis `across`, in ε; 0 without one.
fn sum_forces<K: RadialKernel, const D: usize, const S: usize>(
    pairs: &mut PairWorkspace<D>,
    terms: impl for<'a> PairTerm<Pair<'a, D, 2, S>, [Lanes; D]> + Sync,
    plain_terms: impl for<'a> PairTerm<Pair<'a, D, 2, S>, [Lanes; D]> + Sync,
    across: Option<usize>,
) -> Result<f64, Interrupted> {
    let force = |pair: &Pair<'_, D, 2, S>| {
        let slope: Lanes = K::slope_over_q(pair.q());
        let (volume, other_volume) = pair.scalar(VOLUME);
        let squares = Number::mul_add(other_volume, other_volume, volume * volume);
        // −0 is the sum of no terms: adding it changes no number, and costs nothing.
        let force = terms.add_to([Lanes::splat(-0.0); D], pair);
        // Times 1 exactly, or 0 between two points of walls.
        let slope = if S == WITH_WALLS {
            let (own, other) = pair.scalar(S - 1);
            slope * (Lanes::splat(1.0) - own * other)
        } else {
            slope
        };
        if plain_terms.is_none() {
            let common = slope * squares;
            return force.map(|part| common * part);
        }
        let force = plain_terms.add_to(force.map(|part| squares * part), pair);
        force.map(|part| slope * part)
    };
    let mut virial = 0.0;
    if let Some(axis) = across {
        let nothing = Lanes::splat(0.0);
        pairs.sum_pairs::<2, S, 1>(|pair| Shares { own: [force(pair)[0] * pair.dx[axis]], other: [nothing] })?;
        virial = pairs.occupied().map(|(place, _)| pairs.sum(0, place)).sum();
    }
    pairs.sum_pairs::<2, S, D>(|pair| Shares::opposite(force(pair)))?;
    Ok(virial)
}

#[cfg(test)]
mod tests {
    use super::{Forms, PressureForm, accelerate};
    use crate::geometry::Vector;
    use crate::schemes::weakly_compressible_sph::KernelChoice;
    use crate::schemes::weakly_compressible_sph::interactions::density_summation::sum_volumes;
    use crate::schemes::weakly_compressible_sph::test_setting::{KERNELS, Setting, near, setting};

    fn plain(pressure: PressureForm) -> Forms {
        Forms { pressure, has_whole_stress: false, mean_shear: None }
    }

    fn check<const D: usize>(kernel: KernelChoice, ratio: f64) {
        let this = setting::<D>(kernel, ratio);
        let (mut pairs, mut flow) = (this.gathered(), this.flow());
        sum_volumes(&mut pairs, 1.0, &mut flow.volume, &mut []).unwrap();
        flow.derive_densities();
        flow.derive_pressures();
        let mut acceleration = vec![Vector::<D>::zeros(); flow.count()];
        accelerate(&flow, None, plain(PressureForm::Mean), &mut pairs, &mut acceleration).unwrap();
        let (volume, density, pressure, velocity) = (&flow.volume, &flow.density, &flow.pressure, &flow.predicted);
        let forces: Vec<Vector<D>> = acceleration.iter().enumerate().map(|(i, a)| a * flow.mass(i)).collect();
        for i in this.probes() {
            let mut force = Vector::<D>::zeros();
            let mut scale = 0.0;
            this.each(i, |j, dx, r| {
                let squares = volume[i] * volume[i] + volume[j] * volume[j];
                // By volumes; of one mass, as the paper has it, by densities.
                let mean = (volume[i] * pressure[i] + volume[j] * pressure[j]) / (volume[i] + volume[j]);
                if ratio == 1.0 {
                    let papers = (density[i] * pressure[j] + density[j] * pressure[i]) / (density[i] + density[j]);
                    near(mean, papers, 1.0, "mean pressure");
                }
                let (own, other) = (flow.fluid(i).viscosity, flow.fluid(j).viscosity);
                let eta = 2.0 * own * other / (own + other);
                let slope = this.slope(r);
                let along = dx * (-squares * mean * slope / r);
                force += along + (velocity[i] - velocity[j]) * (eta * squares * slope / r);
                scale += along.norm();
            });
            for d in 0..D {
                near(forces[i][d], force[d], scale.max(1.0), "force");
            }
        }
        let all: Vector<D> = forces.iter().sum();
        let norms: f64 = forces.iter().map(Vector::<D>::norm).sum();
        assert!(all.norm() < 1e-14 * norms, "{} of {norms}", all.norm());
    }

    /// With the whole stress a second, larger viscosity acts on no rotation, and forces stay opposite.
    #[test]
    fn the_whole_stress_of_two_viscosities_lets_both_fluids_turn() {
        let mut this = setting::<2>(KernelChoice::WendlandC2, 1.0);
        let forms = Forms { has_whole_stress: true, ..plain(PressureForm::Hamiltonian) };
        let forces = |this: &Setting<2>, viscosity: f64| {
            let (mut pairs, mut flow) = (this.gathered(), this.flow());
            (flow.fluids.inside.viscosity, flow.fluids.outside.viscosity) = (viscosity, 0.5);
            sum_volumes(&mut pairs, 1.0, &mut flow.volume, &mut []).unwrap();
            flow.derive_densities();
            let mut acceleration = vec![Vector::<2>::zeros(); flow.count()];
            accelerate(&flow, None, forms, &mut pairs, &mut acceleration).unwrap();
            acceleration.iter().enumerate().map(|(i, a)| a * flow.mass(i)).collect::<Vec<_>>()
        };
        let stirred = forces(&this, 3.0);
        let scale = stirred.iter().map(Vector::<2>::norm).fold(0.0, f64::max);
        assert!(stirred.iter().sum::<Vector<2>>().norm() < 1e-11 * scale);
        let middle = Vector::<2>::new(0.6, 0.6);
        for (x, velocity) in this.positions.iter().zip(&mut this.velocity) {
            let way = x - middle;
            *velocity = Vector::<2>::new(-way[1], way[0]);
        }
        let (turning, with_one) = (forces(&this, 3.0), forces(&this, 0.5));
        // Across the sides of the box velocities jump.
        let inner = (0..turning.len()).filter(|i| (this.positions[*i] - middle).amax() < 0.8);
        for i in inner {
            assert!((turning[i] - with_one[i]).norm() < 1e-11 * scale, "{i}: {} {}", turning[i], with_one[i]);
        }
    }

    /// The Hamiltonian force of a particle against the change of the energy Σ m e(ρ) when it moves, by central differences.
    fn check_hamiltonian<const D: usize>(ratio: f64) {
        let mut this = setting::<D>(KernelChoice::WendlandC2, ratio);
        for velocity in &mut this.velocity {
            *velocity = Vector::<D>::zeros();
        }
        let energy = |this: &Setting<D>| {
            let (mut pairs, mut flow) = (this.gathered(), this.flow());
            flow.calibration = 1.01;
            sum_volumes(&mut pairs, flow.calibration, &mut flow.volume, &mut []).unwrap();
            flow.derive_densities();
            (0..flow.count()).map(|i| flow.mass(i) * flow.fluid(i).elastic_energy(flow.density[i])).sum::<f64>()
        };
        let (mut pairs, mut flow) = (this.gathered(), this.flow());
        flow.calibration = 1.01;
        sum_volumes(&mut pairs, flow.calibration, &mut flow.volume, &mut []).unwrap();
        flow.derive_densities();
        flow.derive_pressures();
        let mut acceleration = vec![Vector::<D>::zeros(); flow.count()];
        accelerate(&flow, None, plain(PressureForm::Hamiltonian), &mut pairs, &mut acceleration).unwrap();
        let i = 17;
        let (at, step) = (this.positions[i], 1e-5);
        let mut gradient = Vector::<D>::zeros();
        for d in 0..D {
            for side in [1.0, -1.0] {
                this.positions[i] = at;
                this.positions[i][d] += side * step;
                gradient[d] += side * energy(&this) / (2.0 * step);
            }
        }
        let force = acceleration[i] * flow.mass(i);
        assert!((force + gradient).norm() < 1e-5 * force.norm(), "{force} {gradient}");
    }

    #[test]
    fn the_hamiltonian_force_is_minus_the_gradient_of_the_elastic_energy() {
        check_hamiltonian::<2>(1.0);
        check_hamiltonian::<2>(10.0);
        check_hamiltonian::<3>(3.0);
    }

    #[test]
    fn forces_are_those_of_the_paper_and_keep_momentum() {
        for kernel in KERNELS {
            check::<2>(kernel, 1.0);
            check::<2>(kernel, 10.0);
        }
        check::<3>(KernelChoice::WendlandC2, 1.0);
        check::<3>(KernelChoice::CubicSpline, 3.0);
    }
}
