//! The parameters of a closest-point level set, as understood.

use crate::geometry::Vector;
use crate::polynomials::multi_index::term_count;
use crate::polynomials::neighborhood::radius_of_count;
use crate::polynomials::{BasisKind, Neighborhood, PolynomialBasis, Regression, Solver};

/// How particles are redistanced. Lengths are in multiples of the spacing h.
#[derive(Debug, Clone, PartialEq)]
pub struct PcpMethod {
    /// Total degree of the local polynomials.
    pub degree: usize,
    /// Basis of the regression.
    pub basis: BasisKind,
    /// Which particles take part in a fit.
    pub neighborhood: NeighborhoodChoice,
    /// How regressions are solved.
    pub solver: Solver,
    /// Whether only particles take part whose last normals agree with that of the fit's center.
    pub same_branch: bool,
    /// k of the weight exp(−k r²/r_c²).
    pub weight: f64,
    /// Least number of neighbors per coefficient.
    pub minimum_ratio: f64,
    /// ξ/h: particles with the other sign within ξ become sample particles.
    pub sample_threshold_h: f64,
    /// ε: iterations end when the error of the foot falls below it.
    pub tolerance: f64,
    /// k_max of the iterations.
    pub max_iterations: u32,
}

/// A neighborhood in multiples of the spacing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NeighborhoodChoice {
    /// All within `cutoff_h` spacings.
    Radius {
        /// r_c/h.
        cutoff_h: f64,
    },
    /// The nearest `count` particles.
    Nearest {
        /// n_n.
        count: usize,
    },
    /// The nearest `count` particles of the initial positions, in which fits are made: for unbroken histories.
    Material {
        /// n_n.
        count: usize,
    },
}

impl PcpMethod {
    /// The regression for particles of spacing h.
    #[must_use]
    pub fn regression<const D: usize>(&self, spacing: f64) -> Regression<D> {
        let neighborhood = match self.neighborhood {
            NeighborhoodChoice::Radius { cutoff_h } => Neighborhood::Radius { cutoff: cutoff_h * spacing },
            NeighborhoodChoice::Nearest { count } | NeighborhoodChoice::Material { count } => {
                Neighborhood::Nearest { count }
            }
        };
        let basis = PolynomialBasis::new(self.basis, self.degree);
        Regression::new(basis, neighborhood, self.weight, self.minimum_ratio, spacing, self.solver)
    }

    /// r_c/h of evenly filled neighborhoods.
    #[must_use]
    pub fn even_cutoff_h<const D: usize>(&self) -> f64 {
        let cutoff = match self.neighborhood {
            NeighborhoodChoice::Radius { cutoff_h } => cutoff_h,
            NeighborhoodChoice::Nearest { count } | NeighborhoodChoice::Material { count } => {
                radius_of_count::<D>(count as f64)
            }
        };
        let terms = term_count::<D>(self.degree) as f64;
        cutoff.max(radius_of_count::<D>(self.minimum_ratio * terms))
    }

    /// How far from the surface the particles of evenly filled neighborhoods lie, in multiples of h.
    #[must_use]
    pub fn even_fit_band_h<const D: usize>(&self) -> f64 {
        self.sample_threshold_h + self.even_cutoff_h::<D>()
    }

    /// How far from the surface particles take part in fits, in multiples of h, growth of the radius included.
    #[must_use]
    pub fn fit_band_h<const D: usize>(&self) -> f64 {
        // Half again over what an even distribution needs leaves room for the growth of a starved neighborhood.
        self.sample_threshold_h + 1.5 * self.even_cutoff_h::<D>() + 1.0
    }

    /// How much farther than the sample a foot may seem from rounding and an early end, for a query at `x`.
    #[must_use]
    pub fn slack<const D: usize>(&self, x: &Vector<D>) -> f64 {
        self.tolerance.max(16.0 * f64::EPSILON * x.amax())
    }
}
