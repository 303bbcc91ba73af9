//! Parameters of the particle closest-point method.

use crate::geometry::Vector;
use crate::polynomials::multi_index::term_count;
use crate::polynomials::neighborhood::radius_of_count;
use crate::polynomials::{BasisKind, Neighborhood, PolynomialBasis, Regression, Solver};

/// Parameters of the particle closest-point method (PCP).
#[derive(Debug, Clone, PartialEq)]
pub struct PcpMethod {
    /// Total degree of the local polynomials.
    pub degree: usize,
    /// Polynomial basis of the regression.
    pub basis: BasisKind,
    /// Rule by which particles take part in a fit.
    pub neighborhood: NeighborhoodChoice,
    /// Solver of the regressions.
    pub solver: Solver,
    /// Whether only particles take part in a fit whose last normals agree with the normal of the fit's center.
    pub same_branch: bool,
    /// Exponent k of the weight exp(−k r²/r_c²).
    pub weight: f64,
    /// Smallest number of neighbors per coefficient.
    pub minimum_ratio: f64,
    /// Threshold ξ/h: a particle with a particle of the opposite sign within ξ becomes a sample particle.
    pub sample_threshold_h: f64,
    /// Tolerance ε of foot points, an absolute length.
    pub tolerance: f64,
    /// Largest number k_max of iterations.
    pub max_iterations: u32,
}

/// The rule by which particles take part in a fit, with lengths in multiples of h.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NeighborhoodChoice {
    /// All particles within `cutoff_h` spacings.
    Radius {
        /// Cutoff radius r_c/h.
        cutoff_h: f64,
    },
    /// The nearest `count` particles.
    Nearest {
        /// Number n_n of particles.
        count: usize,
    },
    /// The nearest `count` particles in initial positions, in which the fits are made. Levels must never have been
    /// overwritten.
    Material {
        /// Number n_n of particles.
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

    /// Cutoff radius r_c/h of a neighborhood of evenly distributed particles.
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

    /// Half width, in multiples of h, of the band of particles that take part in fits when particles are evenly
    /// distributed.
    #[must_use]
    pub fn even_fit_band_h<const D: usize>(&self) -> f64 {
        self.sample_threshold_h + self.even_cutoff_h::<D>()
    }

    /// Half width, in multiples of h, of the band of particles that can take part in fits, growth of the radius
    /// included.
    #[must_use]
    pub fn fit_band_h<const D: usize>(&self) -> f64 {
        // One and a half times the radius of an even distribution leaves room for the growth of a sparse neighborhood.
        self.sample_threshold_h + 1.5 * self.even_cutoff_h::<D>() + 1.0
    }

    /// Length by which a foot point may seem farther than the sample point because of rounding and tolerance, for a
    /// query at `x`.
    #[must_use]
    pub fn slack<const D: usize>(&self, x: &Vector<D>) -> f64 {
        self.tolerance.max(16.0 * f64::EPSILON * x.amax())
    }
}
