//! From points to operators, in the form that was chosen.

use super::cloud::{Copies, SurfaceCloud};
use super::conservative;
use super::row_quality::RowQuality;
use super::shape_tensor::{self, ShapeTensor};
use crate::geometry::Vector;
use crate::linear_algebra::SparseRows;
use crate::operators::charts::tangent::Metric;
use crate::operators::{
    Construction, EdgeRule, Functional, NormalCopies, RowKind, StarCloud, StarSupport, Support, SupportDiagnostics,
    TangentChart, charts::Heights, construct, construct_star_rows,
};
use crate::parallel::{Interrupt, Interrupted};
use crate::point_clouds::StarGraph;

/// The form of Surface DC-PSE.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Form {
    /// Fits on the tangent plane, with supports of one radius.
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
    /// Fits on the tangent plane, with supports that follow the stars of points and the local spacing.
    Stars {
        /// Where the metric comes from.
        metric: Metric,
        /// Radius of supports in local spacings.
        cutoff: f64,
        /// Whether the conservative form takes the place of rows that would not hold.
        may_switch: bool,
        /// Whether fits of order 2 take the place of those of a higher one where the surface is not resolved for it.
        may_lower: bool,
    },
    /// The conservative form, exchange between Voronoi cells.
    Conservative,
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

impl Wanted {
    /// Its name, as in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::LaplaceBeltrami => "laplace_beltrami",
            Self::Gradient(0) => "gradient_x",
            Self::Gradient(1) => "gradient_y",
            Self::Gradient(_) => "gradient_z",
        }
    }
}

/// What a problem does with Δ_S.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Use {
    /// Values at points are the result.
    Pointwise,
    /// An equation is solved, so that growing modes matter.
    Equation,
}

/// The operators that a problem asks for.
#[derive(Debug)]
pub struct Operators {
    /// In the order in which they were wanted.
    pub rows: Vec<SparseRows>,
    /// κ = ∇·n and the Gauss curvature of the fitted surface, where heights were fitted.
    pub curvatures: Option<Vec<[f64; 2]>>,
    /// Shape tensors of the fitted surface, where heights were fitted and no operator is wanted; else empty.
    pub shapes: Vec<ShapeTensor>,
    /// Slopes of the fitted surface over the tangent plane of each point, where heights were fitted along stars; else empty.
    pub slopes: Vec<[f64; 2]>,
    /// What became of the points.
    pub fit_diagnostics: SupportDiagnostics,
    /// Kinds of rows, of fits by stars.
    pub quality: Option<RowQuality>,
    /// Whether fits of order 2 took the place of those of a higher one.
    pub is_lowered: bool,
    /// Whether Δ_S is the conservative form, symmetric in areas.
    pub is_conservative: bool,
}

/// Degree and radius in local spacings of the fits that take the place of others, in order.
const LOWER: [StarSupport; 2] = [StarSupport { degree: 5, cutoff: 3.3 }, StarSupport { degree: 3, cutoff: 2.4 }];
/// Share of points without a bounded fit of a higher order beyond which order 2 is better for curvatures and eigenvalues. Measured: 0 on random points of
/// spheres, 2.7 % on the bunny of 1,839 points. There order 2 ranks mean curvatures like a fine mesh with a correlation of 0.94, order 4 with 0.91, and
/// eigenvalues of order 4 are off by up to 10 %, those of the conservative form by 3 %.
const MOST_UNRESOLVED: f64 = 2e-3;
/// Degree of fits with the order of the conservative form.
const LOWEST_DEGREE: usize = 3;
/// The same on curves.
const LOWER_ON_CURVES: [StarSupport; 2] =
    [StarSupport { degree: 5, cutoff: 5.4 }, StarSupport { degree: 3, cutoff: 3.4 }];

impl Method {
    /// Operators on a cloud in D dimensions, M = D − 1. In equations the rows of held points are empty, so that their values stay.
    ///
    /// # Errors
    /// [`Interrupted`].
    pub fn build<const D: usize, const M: usize>(
        &self,
        cloud: &SurfaceCloud<D>,
        wanted: &[Wanted],
        purpose: Use,
        interrupt: &Interrupt,
    ) -> Result<Operators, Interrupted> {
        let mut built = self.build_free::<D, M>(cloud, wanted, purpose, interrupt)?;
        let laplacian = wanted.iter().position(|wanted| *wanted == Wanted::LaplaceBeltrami);
        if let (Use::Equation, Some(place), false) = (purpose, laplacian, cloud.held.is_empty()) {
            let is_held = cloud.held_mask();
            built.rows[place].change_rows(|i, _, weights| {
                if is_held[i] {
                    weights.fill(0.0);
                }
            });
        }
        Ok(built)
    }

    /// Operators before rows of held points are emptied.
    fn build_free<const D: usize, const M: usize>(
        &self,
        cloud: &SurfaceCloud<D>,
        wanted: &[Wanted],
        purpose: Use,
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
                let shapes = shapes(wanted, &cloud.normals, &built.heights);
                Ok(Operators { shapes, ..operators(built, curvatures) })
            }
            Form::Copies { layers, spacing } => {
                let chart = NormalCopies::new(&cloud.points, &cloud.normals, layers, spacing, radius);
                Ok(operators(construct::<D>(&chart, self.support, &functionals(wanted), interrupt)?, None))
            }
            Form::Stars { metric, cutoff, may_switch, may_lower } => {
                let is_held = &if cloud.held.is_empty() { Vec::new() } else { cloud.held_mask() };
                let edges = |conormals| match purpose {
                    Use::Equation => EdgeRule::Equation { conormals, is_held },
                    Use::Pointwise => EdgeRule::OneSided,
                };
                let choice = (cutoff, may_switch, may_lower);
                let (rows, own) = (cloud.rows, &cloud.graph);
                match &cloud.copies {
                    Some(Copies { points, normals, spacings, graph, conormals, source }) => {
                        let edges = edges(conormals.as_slice());
                        let cloud = StarCloud { points, normals, spacings, graph, metric, edges, rows };
                        self.by_stars::<D, M>((cloud, own, Some(source)), choice, wanted, purpose, interrupt)
                    }
                    None => {
                        let SurfaceCloud { points, normals, spacings, conormals, .. } = cloud;
                        let edges = edges(conormals.as_slice());
                        let cloud = StarCloud { points, normals, spacings, graph: own, metric, edges, rows };
                        self.by_stars::<D, M>((cloud, own, None), choice, wanted, purpose, interrupt)
                    }
                }
            }
            Form::Conservative => Ok(conservative_operators(&cloud.graph, None)),
        }
    }

    /// Rows by stars; the conservative form where they would not hold. Columns of copies are those of their `source`, and `own_graph`
    /// is that without copies.
    fn by_stars<const D: usize, const M: usize>(
        &self,
        (cloud, own_graph, source): (StarCloud<'_, D>, &StarGraph, Option<&Vec<u32>>),
        (cutoff, may_switch, may_lower): (f64, bool, bool),
        wanted: &[Wanted],
        purpose: Use,
        interrupt: &Interrupt,
    ) -> Result<Operators, Interrupted> {
        let degree = self.support.degree;
        let lower = if M == 1 { LOWER_ON_CURVES } else { LOWER };
        let first = StarSupport { degree, cutoff };
        let supports: Vec<StarSupport> =
            std::iter::once(first).chain(lower.into_iter().filter(|support| support.degree < degree)).collect();
        let mut built = construct_star_rows::<D, M>(cloud, &supports, &functionals(wanted), interrupt)?;
        let unresolved = built.kinds.iter().filter(|kind| **kind != RowKind::Full).count();
        let is_lowered = may_lower && unresolved as f64 > MOST_UNRESOLVED * built.kinds.len() as f64;
        if is_lowered {
            built = construct_star_rows::<D, M>(cloud, &lower[lower.len() - 1..], &functionals(wanted), interrupt)?;
        }
        if let Some(source) = source {
            built.operators = built.operators.into_iter().map(|rows| rows.renumbered(source)).collect();
        }
        let laplacian = wanted.iter().position(|wanted| *wanted == Wanted::LaplaceBeltrami);
        let judged = laplacian.filter(|_| purpose == Use::Equation).map(|place| &built.operators[place]);
        let open = if degree == LOWEST_DEGREE || is_lowered { own_graph.open_count() } else { 0 };
        let quality = RowQuality::new(&built, judged, interrupt).with_open_points(open);
        interrupt.check()?;
        if may_switch && purpose == Use::Equation && quality.reason_to_switch().is_some() {
            return Ok(conservative_operators(own_graph, Some(quality)));
        }
        let curvatures = (!built.heights.is_empty()).then(|| built.heights.iter().map(bends).collect());
        let fit_diagnostics = SupportDiagnostics { enlarged: built.grown, ..SupportDiagnostics::default() };
        Ok(Operators {
            rows: built.operators,
            curvatures,
            shapes: shapes(wanted, cloud.normals, &built.heights),
            slopes: built
                .heights
                .iter()
                .map(|h| std::array::from_fn(|a| h.first.get(a).copied().unwrap_or(0.0)))
                .collect(),
            fit_diagnostics,
            quality: Some(quality),
            is_lowered,
            is_conservative: false,
        })
    }
}

fn functionals<const M: usize>(wanted: &[Wanted]) -> Vec<Functional<M>> {
    let functional = |wanted: &Wanted| match wanted {
        Wanted::LaplaceBeltrami => Functional::LaplaceBeltrami,
        Wanted::Gradient(axis) => Functional::Gradient(*axis),
    };
    wanted.iter().map(functional).collect()
}

fn operators<const M: usize>(built: Construction<M>, curvatures: Option<Vec<[f64; 2]>>) -> Operators {
    let fit_diagnostics = built.fit_diagnostics;
    let (slopes, quality, is_conservative) = (Vec::new(), None, false);
    Operators {
        rows: built.operators,
        curvatures,
        shapes: Vec::new(),
        slopes,
        fit_diagnostics,
        quality,
        is_lowered: false,
        is_conservative,
    }
}

/// The conservative form of Δ_S; `quality` is that of the rows whose place it takes.
fn conservative_operators(graph: &StarGraph, quality: Option<RowQuality>) -> Operators {
    Operators {
        rows: vec![conservative::rows(graph)],
        curvatures: None,
        shapes: Vec::new(),
        slopes: Vec::new(),
        fit_diagnostics: SupportDiagnostics::default(),
        quality,
        is_lowered: false,
        is_conservative: true,
    }
}

/// Shape tensors of fitted heights, for problems that want no operator but the surface itself.
fn shapes<const D: usize, const M: usize>(
    wanted: &[Wanted],
    normals: &[Vector<D>],
    heights: &[Heights<M>],
) -> Vec<ShapeTensor> {
    if !wanted.is_empty() {
        return Vec::new();
    }
    normals.iter().zip(heights).map(|(n, h)| shape_tensor::from_heights(n, h)).collect()
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
