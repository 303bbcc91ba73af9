//! A pair of particles as the mass form of the equations sees it: which columns are gathered, and what follows from them for
//! one fluid or for several.

use crate::linear_algebra::number::{Lanes, Number};
use crate::schemes::weakly_compressible_sph::pair_sums::{Pair, harmonic_mean};

/// Vector column: velocities.
pub const VELOCITY: usize = 1;
/// Scalar column: densities ρ.
pub const DENSITY: usize = 0;
/// Scalar column: volumes V in units of the cell.
pub const VOLUME: usize = 1;
/// Scalar column: P/ρ².
pub const STRESS: usize = 2;
/// Scalar column, where the fluids differ: masses in units of a particle's inside.
pub const MASS: usize = 3;
/// Scalar column, where the fluids differ: k ν with the factor k of the viscosity.
pub const VISCOSITY: usize = 4;
/// Scalar column, where the fluids differ: 1/ρ₀.
pub const INVERSE_REFERENCE: usize = 5;

/// A pair with the values that its terms share.
#[derive(Debug, Clone, Copy)]
pub struct MassPair<'a, const D: usize, const S: usize> {
    pub sides: &'a Pair<'a, D, 2, S>,
    /// u_ij·x_ij/ε: negative where the particles approach.
    pub approach: Lanes,
    /// The fluids' constants.
    pub constants: PairConstants,
}

/// The constants of the fluids of a pair.
#[derive(Debug, Clone, Copy)]
pub struct PairConstants {
    /// Masses of the two particles in units of a particle's inside.
    pub masses: (Lanes, Lanes),
    /// k ν_ij.
    pub viscosity: Lanes,
    /// The excess of the density of i over that of j: ρ_i − ρ_j, or of ρ/ρ₀ where the fluids differ.
    pub excess: Lanes,
}

/// Fluids whose constants the loop over pairs must know.
pub trait PairFluids<const D: usize, const S: usize>: Copy + Sync {
    /// The constants of a pair.
    fn constants(self, pair: &Pair<'_, D, 2, S>) -> PairConstants;
}

/// One mass and one viscosity k ν for all pairs: three scalar columns.
#[derive(Debug, Clone, Copy)]
pub struct UniformFluid {
    /// k ν.
    pub viscosity: f64,
}

impl<const D: usize> PairFluids<D, 3> for UniformFluid {
    #[inline(always)]
    fn constants(self, pair: &Pair<'_, D, 2, 3>) -> PairConstants {
        let (density, other_density) = pair.scalar(DENSITY);
        let one = Lanes::splat(1.0);
        PairConstants { masses: (one, one), viscosity: Lanes::splat(self.viscosity), excess: density - other_density }
    }
}

/// Masses and viscosities by species: six scalar columns.
#[derive(Debug, Clone, Copy)]
pub struct SpeciesFluids;

impl<const D: usize> PairFluids<D, 6> for SpeciesFluids {
    #[inline(always)]
    fn constants(self, pair: &Pair<'_, D, 2, 6>) -> PairConstants {
        let ((density, other_density), (inverse, other_inverse)) =
            (pair.scalar(DENSITY), pair.scalar(INVERSE_REFERENCE));
        PairConstants {
            masses: pair.scalar(MASS),
            viscosity: harmonic_mean(pair.scalar(VISCOSITY)),
            excess: density * inverse - other_density * other_inverse,
        }
    }
}

impl<'a, const D: usize, const S: usize> MassPair<'a, D, S> {
    #[inline(always)]
    pub fn new(sides: &'a Pair<'a, D, 2, S>, fluids: impl PairFluids<D, S>) -> Self {
        let mut approach = Lanes::splat(0.0);
        for (du, dx) in sides.difference(VELOCITY).into_iter().zip(sides.dx) {
            approach = Number::mul_add(du, *dx, approach);
        }
        Self { sides, approach, constants: fluids.constants(sides) }
    }
}
