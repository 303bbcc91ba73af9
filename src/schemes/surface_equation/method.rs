//! From points to operators, in the form that was chosen.

use super::cloud::SurfaceCloud;
use crate::linear_algebra::SparseRows;
use crate::operators::charts::tangent::Metric;
use crate::operators::{
    Construction, Functional, NormalCopies, Support, SupportDiagnostics, TangentChart, charts::Heights, construct,
};
use crate::parallel::{Interrupt, Interrupted};

/// The form of Surface DC-PSE.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Form {
    /// Fits on the tangent plane.
    Intrinsic {
        /// Where the metric comes from.
        metric: Metric,
    },
    /// Fits in space to copies along normals, the paper's.
    Copies {
        /// N_n, to either side.
        layers: u32,
        /// Distance δn of the copies.
        spacing: f64,
    },
}

/// How operators are made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Method {
    /// Degree and radius of the fits.
    pub support: Support,
    /// Form of the operators.
    pub form: Form,
}

/// An operator that a problem needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wanted {
    /// Laplace–Beltrami operator Δ_S.
    LaplaceBeltrami,
    /// A component of ∇_S.
    Gradient(usize),
}

/// The operators that a problem asks for.
#[derive(Debug)]
pub struct Operators {
    /// In the order of the wishes.
    pub rows: Vec<SparseRows>,
    /// κ = ∇·n and the Gauss curvature of the fitted surface, where heights were fitted.
    pub curvatures: Option<Vec<[f64; 2]>>,
    /// What became of the points.
    pub fit_diagnostics: SupportDiagnostics,
}

impl Method {
    /// Operators on a cloud in D dimensions, M = D − 1.
    ///
    /// # Errors
    /// [`Interrupted`].
    pub fn build<const D: usize, const M: usize>(
        &self,
        cloud: &SurfaceCloud<D>,
        wanted: &[Wanted],
        interrupt: &Interrupt,
    ) -> Result<Operators, Interrupted> {
        let radius = self.support.radius;
        match self.form {
            Form::Intrinsic { metric } => {
                let mut chart = TangentChart::new(&cloud.points, &cloud.normals, metric, radius);
                if !cloud.source.is_empty() {
                    chart = chart.with_images(cloud.rows, &cloud.source);
                }
                if !cloud.scales.is_empty() {
                    chart = chart.with_scales(&cloud.scales);
                }
                let built = construct::<M>(&chart, self.support, &functionals(wanted), interrupt)?;
                let curvatures = (!built.heights.is_empty()).then(|| built.heights.iter().map(bends).collect());
                Ok(operators(built, curvatures))
            }
            Form::Copies { layers, spacing } => {
                let chart = NormalCopies::new(&cloud.points, &cloud.normals, layers, spacing, radius);
                Ok(operators(construct::<D>(&chart, self.support, &functionals(wanted), interrupt)?, None))
            }
        }
    }
}

fn functionals<const M: usize>(wanted: &[Wanted]) -> Vec<Functional<M>> {
    let of = |wanted: &Wanted| match wanted {
        Wanted::LaplaceBeltrami => Functional::LaplaceBeltrami,
        Wanted::Gradient(axis) => Functional::Gradient(*axis),
    };
    wanted.iter().map(of).collect()
}

fn operators<const M: usize>(built: Construction<M>, curvatures: Option<Vec<[f64; 2]>>) -> Operators {
    Operators { rows: built.operators, curvatures, fit_diagnostics: built.fit_diagnostics }
}

/// ∇·n = −g^ab h_ab/√det g and K = det h_ab/(det g)² of a graph over its plane.
fn bends<const M: usize>(h: &Heights<M>) -> [f64; 2] {
    let det = 1.0 + h.first.iter().map(|slope| slope * slope).sum::<f64>();
    let mut bend = 0.0;
    for a in 0..M {
        for b in 0..M {
            bend += (f64::from(u8::from(a == b)) - h.first[a] * h.first[b] / det) * h.second[a][b];
        }
    }
    let gauss =
        if M == 2 { (h.second[0][0] * h.second[1][1] - h.second[0][1] * h.second[1][0]) / (det * det) } else { 0.0 };
    [-bend / det.sqrt(), gauss]
}
