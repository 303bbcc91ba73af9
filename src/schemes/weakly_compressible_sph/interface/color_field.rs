//! The interface as the smoothed color of the species (PCP eqs. B.5 to B.10; Adami 2010): normals from its gradient,
//! curvatures from their divergence.
//!
//! The sum of B.6 runs over j with its volume (errata, PCP B.6). Curvatures have the sign of this project: positive where the
//! inside is convex (errata, PCP B.9).

use crate::closest_point::SurfaceColumns;
use crate::geometry::Vector;
use crate::linear_algebra::number::{Lanes, Number};
use crate::parallel::Interrupted;
use crate::particles::Particles;
use crate::schemes::weakly_compressible_sph::flow_state::FlowState;
use crate::schemes::weakly_compressible_sph::kernel_choice::with_kernel;
use crate::schemes::weakly_compressible_sph::pair_sums::Shares;
use crate::schemes::weakly_compressible_sph::pair_workspace::PairWorkspace;
use crate::smoothing_kernels::RadialKernel;

/// The least |n̂| ε of a particle at the interface (B.7).
const THRESHOLD: f64 = 0.01;

/// Scalar column: V c in units of the cell, then the smoothed color c.
const COLOR: usize = 0;
/// Scalar column: volumes V in units of the cell.
const VOLUME: usize = 1;
/// Scalar column: volumes V in units of the cell at the interface, 0 elsewhere.
const SHARE: usize = 0;
/// Vector column: unit normals.
const NORMAL: usize = 1;

/// Gradient, normals and curvatures of the color field, one entry a particle.
#[derive(Debug)]
pub struct ColorField<const D: usize> {
    /// n̂, outward; zero away from the interface.
    pub gradient: Vec<Vector<D>>,
    /// Outward unit normals; zero away from the interface.
    pub normal: Vec<Vector<D>>,
    /// Curvatures; zero away from the interface.
    pub curvature: Vec<f64>,
}

impl<const D: usize> ColorField<D> {
    pub fn new(count: usize) -> Self {
        Self {
            gradient: vec![Vector::<D>::zeros(); count],
            normal: vec![Vector::<D>::zeros(); count],
            curvature: vec![0.0; count],
        }
    }

    /// 1. Colors. 2. Their gradients and normals. 3. Curvatures.
    pub fn find(&mut self, flow: &FlowState<D>, pairs: &mut PairWorkspace<D>) -> Result<(), Interrupted> {
        let by_cell = 1.0 / pairs.cell;
        pairs.gather(COLOR, 0.0, |i| flow.volume[i] * by_cell * flow.species[i].color());
        pairs.gather(VOLUME, 0.0, |i| flow.volume[i] * by_cell);
        smooth_colors(pairs)?;
        self.find_normals(pairs)?;
        pairs.gather_vectors(1.0, |i| self.normal[i]);
        let is_away = |i: usize| self.normal[i] == Vector::<D>::zeros();
        pairs.gather(SHARE, 0.0, |i| if is_away(i) { 0.0 } else { flow.volume[i] * by_cell });
        self.find_curvatures(pairs)
    }

    /// Writes normals and curvatures to the particles.
    pub fn store(&self, particles: &mut Particles<D>, columns: &SurfaceColumns) {
        for (band, normal) in particles.flag_mut(columns.in_band).iter_mut().zip(&self.normal) {
            *band = u8::from(normal.norm_squared() > 0.0);
        }
        particles.vector_mut(columns.normal).copy_from_slice(&self.normal);
        particles.scalar_mut(columns.curvature).copy_from_slice(&self.curvature);
    }

    /// n̂ = −Σ_j (c_j − c_i) ∇W V_j (B.6): colors fall outwards.
    fn find_normals(&mut self, pairs: &mut PairWorkspace<D>) -> Result<(), Interrupted> {
        with_kernel!(pairs.kernel.choice, K => pairs.sum_pairs::<1, 2, D>(|pair| {
            let slope: Lanes = K::slope_over_q(pair.q());
            let ((color, other_color), (volume, other_volume)) = (pair.scalar(COLOR), pair.scalar(VOLUME));
            // Both the difference and ∇W change sign with the side.
            let common = slope * (other_color - color);
            Shares {
                own: pair.dx.map(|part| common * other_volume * part),
                other: pair.dx.map(|part| common * volume * part),
            }
        }))?;
        let inverse = pairs.inverse_smoothing();
        let kernel = pairs.kernel.normalization * pairs.cell;
        let (least, factor) = (THRESHOLD * inverse, -kernel * pairs.kernel.slope() * inverse);
        for (place, i) in pairs.occupied() {
            let found = pairs.vector_sum(place) * factor;
            let is_at_interface = found.norm() > least;
            self.gradient[i] = if is_at_interface { found } else { Vector::<D>::zeros() };
            self.normal[i] = if is_at_interface { found.normalize() } else { Vector::<D>::zeros() };
        }
        Ok(())
    }

    /// κ = Σ_j N_j (n_j − n_i)·∇W V_j/Σ_j N_j W V_j with N = 1 at the interface, else 0 (B.8, B.9).
    fn find_curvatures(&mut self, pairs: &mut PairWorkspace<D>) -> Result<(), Interrupted> {
        // A pair with a particle away from the interface adds nothing that is used to either side.
        let is_at_interface = |scalars: &[&[f64]; 1], place: usize| scalars[SHARE][place] != 0.0;
        with_kernel!(pairs.kernel.choice, K => pairs.sum_pairs_where::<2, 1, 2>(is_at_interface, |pair| {
            let q = pair.q();
            let (value, slope): (Lanes, Lanes) = (K::value(q), K::slope_over_q(q));
            let [normal, other_normal] = [pair.own.vectors[NORMAL], pair.other.vectors[NORMAL]];
            let mut turn = Lanes::splat(0.0);
            for (d, dx) in pair.dx.iter().enumerate() {
                turn = Number::mul_add(other_normal[d] - normal[d], *dx, turn);
            }
            let (share, other_share) = pair.scalar(SHARE);
            Shares {
                own: [value * other_share, slope * other_share * turn],
                other: [value * share, slope * share * turn],
            }
        }))?;
        let (own, slope, inverse) = (pairs.kernel.value(0.0), pairs.kernel.slope(), pairs.inverse_smoothing());
        for (place, i) in pairs.occupied() {
            let share = pairs.scalar(SHARE, place);
            // With the particle's own share of the weights.
            let weights = pairs.sum(0, place) + own * share;
            // ∇·n with ∇W about i, turned to the sign of a divergence.
            let found = pairs.sum(1, place) * slope * inverse / weights;
            self.curvature[i] = if share > 0.0 && weights > 0.0 { found } else { 0.0 };
        }
        Ok(())
    }
}

/// Replaces the gathered V c by the smoothed color c_i = Σ_j c_j W V_j with the particle itself in the sum (B.5).
fn smooth_colors<const D: usize>(pairs: &mut PairWorkspace<D>) -> Result<(), Interrupted> {
    with_kernel!(pairs.kernel.choice, K => pairs.sum_pairs::<1, 1, 1>(|pair| {
        let value: Lanes = K::value(pair.q());
        let (color, other_color) = pair.scalar(COLOR);
        Shares { own: [value * other_color], other: [value * color] }
    }))?;
    let (own, kernel) = (pairs.kernel.value(0.0), pairs.kernel.normalization * pairs.cell);
    pairs.update_scalar(COLOR, |color, sum| (own * color + sum) * kernel);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::ColorField;
    use crate::geometry::Vector;
    use crate::schemes::weakly_compressible_sph::KernelChoice;
    use crate::schemes::weakly_compressible_sph::interactions::density_summation::sum_volumes;
    use crate::schemes::weakly_compressible_sph::species::Species;
    use crate::schemes::weakly_compressible_sph::test_setting::setting;

    #[test]
    fn the_color_field_of_a_disk_has_outward_normals_and_its_curvature() {
        let this = setting::<2>(KernelChoice::WendlandC2, 1.0);
        let center = Vector::<2>::new(0.6, 0.6);
        let radius = 0.8;
        let away: Vec<Vector<2>> = this.positions.iter().map(|x| this.domain.displacement(&center, x)).collect();
        let (mut pairs, mut flow) = (this.gathered(), this.flow());
        flow.species = away.iter().map(|dx| Species::from_level(dx.norm() - radius)).collect();
        sum_volumes(&mut pairs, 1.0, &mut flow.volume, &mut []).unwrap();
        let count = flow.count();
        let mut field = ColorField::new(count);
        field.find(&flow, &mut pairs).unwrap();
        // At the interface itself: outward, and the curvature of the circle within its known scatter.
        let is_near = |i: &usize| (away[*i].norm() - radius).abs() < 0.5 * this.config.spacing;
        let at: Vec<usize> = (0..count).filter(is_near).collect();
        let mean = at.iter().map(|i| field.curvature[*i]).sum::<f64>() / at.len() as f64;
        assert!(at.iter().all(|i| field.normal[*i].dot(&away[*i].normalize()) > 0.9));
        assert!((mean * radius - 1.0).abs() < 0.15, "{mean}");
        // The jump of the color across the interface is one.
        let row: f64 = (0..count).map(|i| field.gradient[i].norm() * flow.volume[i]).sum();
        assert!((row / (2.0 * std::f64::consts::PI * radius) - 1.0).abs() < 0.05, "{row}");
    }
}
