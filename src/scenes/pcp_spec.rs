//! The parameters of the closest-point method (`"type": "pcp"`), shared by the scenes that use it.

use crate::closest_point::PcpMethod;
use crate::closest_point::method::NeighborhoodChoice;
use crate::polynomials::Solver;
use crate::polynomials::basis::BasisKind;
use crate::polynomials::multi_index::term_count;
use crate::spec::{Choice, Interval, POSITIVE, Violation, whole};
use serde_json::{Value, json};

crate::words! {
    /// Basis of the regressions.
    pub enum BasisWord {
        /// products of Newton factors on unisolvent nodes
        Minter = "minter",
        /// monomials, centered and scaled
        Monomial = "monomial",
        /// monomials, neither centered nor scaled, for comparison
        MonomialUnscaled = "monomial_unscaled",
    }
}

crate::words! {
    /// How the least-squares problems are solved.
    pub enum SolverWord {
        /// Gram matrices of scaled monomials, several fits at once
        Moments = "moments",
        /// QR decomposition in the basis
        Orthogonal = "orthogonal",
    }
}

crate::choice! {
    /// The particles that take part in a fit.
    pub enum Neighborhood {
        /// all particles within a radius, which grows until there are enough
        Radius = "radius" {
            /// radius r_c in h
            cutoff_h: f64 = 2.5, in POSITIVE;
        }
        /// the nearest particles
        Nearest = "nearest" {
            /// number of particles
            count: usize = 30, in whole(4, 10_000);
        }
        /// the nearest particles of the initial positions, in which fits are made; for particles that keep their level
        Material = "material" {
            /// number of particles
            count: usize = 30, in whole(4, 10_000);
        }
    }
}

crate::group! {
    /// The closest-point method.
    pub struct PcpSpec: Default {
        /// total degree of the local polynomials
        degree: usize = 4, in whole(1, 8);
        /// basis of the regressions; monomial_unscaled is neither centered nor scaled, for comparison
        basis: BasisWord = BasisWord::Minter;
        /// particles that take part in a fit; radius 2.5 h when not given
        neighborhood: Option<Neighborhood>;
        /// short for neighborhood radius {cutoff_h}
        cutoff_h: Option<f64>, in POSITIVE;
        /// whether only particles take part in a fit whose last normals agree with that of its center
        same_branch: bool = true;
        /// moments: Gram matrices of scaled monomials, several fits at once, the same polynomial in every basis, with
        /// orthogonal where they are too ill-conditioned; orthogonal: QR in the basis, as in the paper
        solver: SolverWord = SolverWord::Moments;
        /// k in the weight exp(−k r²/r_c²)
        weight: f64 = 2.0, in WEIGHT;
        /// neighbors per coefficient up to which the radius grows; when not given, 1 where a count of neighbors is given,
        /// else 2 for a level that is overwritten and 1.5 for others
        minimum_ratio: Option<f64>, in Interval::at_least(1.0).and_at_most(20.0);
        /// particles with another of the opposite sign within so many h become sample particles
        sample_threshold_h: f64 = 1.5, in Interval::above(0.5).and_at_most(10.0);
        /// error of a closest point at which iterations end
        tolerance: f64 = 1e-14, in TOLERANCE;
        /// largest number of iterations of a solve
        max_iterations: u32 = 1000, in whole(1, 100_000);
        /// why this was chosen, where `auto` chose it
        chosen: Option<String>;
    }
}

/// Beyond 50 the outer neighbors weigh nothing and fits starve.
const WEIGHT: Interval = Interval::at_least(0.0).and_at_most(50.0);
/// A looser tolerance would take points off the surface for points of it.
const TOLERANCE: Interval = Interval::above(0.0).and_at_most(1e-6);
/// Radius of a neighborhood that is not given, in h.
const DEFAULT_CUTOFF_H: f64 = 2.5;

/// Where the parameters of a method stand, and what a fit must hold there.
#[derive(Debug, Clone, Copy)]
pub struct PcpContext {
    /// JSON pointer to the parameters.
    pub pointer: &'static str,
    /// Dimension of the scene.
    pub dimension: usize,
    /// Neighbors per coefficient, where they are not given and the neighborhood is a radius.
    pub default_ratio: f64,
}

impl PcpSpec {
    /// What the paper's sections state in common: unweighted fits by QR that never grow. Tolerance and iterations differ.
    #[must_use]
    pub fn paper(degree: usize, neighborhood: Option<Neighborhood>, tolerance: f64, max_iterations: u32) -> Self {
        Self {
            degree,
            neighborhood,
            same_branch: false,
            solver: SolverWord::Orthogonal,
            weight: 0.0,
            minimum_ratio: Some(1.0),
            tolerance,
            max_iterations,
            ..Self::default()
        }
    }

    /// The method, and the parameters with everything filled in.
    ///
    /// # Errors
    /// Where the parameters do not fit together.
    pub fn plan(mut self, context: PcpContext) -> Result<(PcpMethod, Self), Violation> {
        let PcpContext { pointer, dimension, default_ratio } = context;
        if let (Some(_), Some(cutoff_h)) = (&self.neighborhood, self.cutoff_h) {
            let detail = "cutoff_h is short for a neighborhood; give one of them";
            return Err(Violation::new(format!("{pointer}/cutoff_h"), "conflict", detail, cutoff_h, Value::Null));
        }
        let radius = Neighborhood::Radius { cutoff_h: self.cutoff_h.take().unwrap_or(DEFAULT_CUTOFF_H) };
        let neighborhood = self.neighborhood.get_or_insert(radius).planned();
        let terms = if dimension == 2 { term_count::<2>(self.degree) } else { term_count::<3>(self.degree) };
        if let NeighborhoodChoice::Nearest { count } | NeighborhoodChoice::Material { count } = neighborhood
            && count < terms
        {
            let detail = format!("degree {} has {terms} coefficients", self.degree);
            let at = format!("{pointer}/neighborhood/count");
            return Err(Violation::new(at, "range", detail, count, format!("a whole number ≥ {terms}")));
        }
        // In initial positions branches are apart by themselves.
        self.same_branch &= !matches!(neighborhood, NeighborhoodChoice::Material { .. });
        let minimum_ratio = *self.minimum_ratio.get_or_insert(match neighborhood {
            // A given count is taken as it is, without a margin.
            NeighborhoodChoice::Nearest { .. } | NeighborhoodChoice::Material { .. } => 1.0,
            NeighborhoodChoice::Radius { .. } => default_ratio,
        });
        let method = PcpMethod {
            degree: self.degree,
            basis: match self.basis {
                BasisWord::Minter => BasisKind::Minter,
                BasisWord::Monomial => BasisKind::Monomial,
                BasisWord::MonomialUnscaled => BasisKind::MonomialUnscaled,
            },
            neighborhood,
            solver: match self.solver {
                SolverWord::Moments => Solver::Moments,
                SolverWord::Orthogonal => Solver::Orthogonal,
            },
            same_branch: self.same_branch,
            weight: self.weight,
            minimum_ratio,
            sample_threshold_h: self.sample_threshold_h,
            tolerance: self.tolerance,
            max_iterations: self.max_iterations,
        };
        Ok((method, self))
    }

    /// An error where fits in initial positions are asked for particles that do not keep their level.
    #[must_use]
    pub fn refuse_material(&self, pointer: &str, detail: &str) -> Option<Violation> {
        let material = self.neighborhood.as_ref().filter(|n| matches!(n, Neighborhood::Material { .. }))?;
        let at = format!("{pointer}/neighborhood/type");
        Some(Violation::new(at, "conflict", detail, material.name(), json!(["radius", "nearest"])))
    }
}

impl Neighborhood {
    fn planned(&self) -> NeighborhoodChoice {
        match *self {
            Self::Radius { cutoff_h } => NeighborhoodChoice::Radius { cutoff_h },
            Self::Nearest { count } => NeighborhoodChoice::Nearest { count },
            Self::Material { count } => NeighborhoodChoice::Material { count },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Neighborhood, PcpContext, PcpSpec};

    const PLANE: PcpContext = PcpContext { pointer: "/method", dimension: 2, default_ratio: 1.5 };

    #[test]
    fn a_plan_fills_in_everything_and_plans_to_itself() {
        for spec in [
            PcpSpec::default(),
            PcpSpec { cutoff_h: Some(3.0), ..PcpSpec::default() },
            PcpSpec { neighborhood: Some(Neighborhood::Material { count: 24 }), ..PcpSpec::default() },
        ] {
            let (method, full) = spec.plan(PLANE).unwrap();
            assert!(full.neighborhood.is_some() && full.minimum_ratio.is_some() && full.cutoff_h.is_none());
            assert_eq!(full.clone().plan(PLANE).unwrap(), (method, full));
        }
    }

    #[test]
    fn a_count_below_the_number_of_coefficients_is_refused() {
        let few = PcpSpec { neighborhood: Some(Neighborhood::Nearest { count: 14 }), ..PcpSpec::default() };
        assert_eq!(few.plan(PLANE).unwrap_err().pointer, "/method/neighborhood/count");
    }
}
