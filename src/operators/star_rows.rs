//! Rows that hold on real clouds: the intrinsic fits with supports found by walking along stars, and with fallbacks.
//!
//! The row of a point is taken from the first of these that works:
//!
//! 1. A fit of the wanted degree whose row is bounded. The support grows until it is.
//! 2. A fit of a lower degree.
//! 3. A positive row: a quadratic fit that drops neighbors until no weight is negative.
//! 4. The row of the Voronoi cell of the point.
//!
//! At an edge without flux fits keep to that condition at the points of the edge in their support. So they have their order there,
//! too, and are bounded. Where values at points are wanted, fits at edges are one-sided and need no bound.
//!
//! A row is bounded if its weight w_ii is negative and R_i = Σ_{j≠i} |w_ij|/|w_ii| is at most 3. Measured on 120 operators on
//! clouds of all kinds: with a limit of 1.5 to 6 no operator has a growing mode, with 10 and more some have.

mod fallback;
mod growth;
mod walk;

use super::charts::tangent::{Metric, tangent_terms};
use super::charts::{Functional, Heights};
use super::fits::BLOCK;
use crate::geometry::Vector;
use crate::linear_algebra::SparseRows;
use crate::parallel::{Interrupt, Interrupted};
use crate::point_clouds::StarGraph;
use growth::GrowingFits;
use rayon::prelude::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};
use walk::Walk;

/// What the rows of points near an edge keep to.
#[derive(Debug, Clone, Copy)]
pub enum EdgeRule<'a, const D: usize> {
    /// Values at points are wanted: a fit whose support has points of the edge need not be bounded.
    OneSided,
    /// An equation is solved. The derivative of the field along the conormal vanishes at the points that have one, and a fit with
    /// such points in its support keeps to that condition. The rows of points that hold a value are not used, whatever they are.
    Equation {
        /// Conormals of points that nothing flows through; may be empty.
        conormals: &'a [Option<Vector<D>>],
        /// Whether each point holds a value; may be empty.
        is_held: &'a [bool],
    },
}

/// A cloud with its stars.
#[derive(Debug, Clone, Copy)]
pub struct StarCloud<'a, const D: usize> {
    /// Positions of the points.
    pub points: &'a [Vector<D>],
    /// Unit normals. Their sides have no effect on operators.
    pub normals: &'a [Vector<D>],
    /// Local spacing at each point, a length.
    pub spacings: &'a [f64],
    /// The graph of stars.
    pub graph: &'a StarGraph,
    /// Origin of the metric.
    pub metric: Metric,
    /// What the rows of points near an edge keep to.
    pub edges: EdgeRule<'a, D>,
    /// Number of points that get a row; those behind are there as neighbors alone.
    pub rows: usize,
}

/// Degree of polynomials, and the radius of supports in local spacings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StarSupport {
    /// Total degree of the polynomials, at most 7.
    pub degree: usize,
    /// Radius of the support in local spacings.
    pub cutoff: f64,
}

/// What the row of a point is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowKind {
    /// A fit of the wanted degree.
    Full,
    /// A fit of a lower degree.
    LowerOrder,
    /// A quadratic fit whose weights are positive.
    Positive,
    /// The row of the Voronoi cell.
    Voronoi,
}

/// Operators for a list of functionals, with the kinds of their rows.
#[derive(Debug)]
pub struct StarRows<const M: usize> {
    /// One operator per functional, in the order of the functionals.
    pub operators: Vec<SparseRows>,
    /// Heights of the surface over the plane of each point; empty where the metric comes from normals.
    pub heights: Vec<Heights<M>>,
    /// Kind of each row.
    pub kinds: Vec<RowKind>,
    /// Points whose support grew.
    pub grown: u64,
    /// Largest R_i of all rows of Δ_S.
    pub largest_ratio: f64,
}

/// The row of one point.
#[derive(Debug)]
struct Row<const M: usize> {
    columns: Vec<u32>,
    /// Weights by functional, each in the order of the columns.
    weights: Vec<Vec<f64>>,
    heights: Heights<M>,
    kind: RowKind,
    is_grown: bool,
    ratio: f64,
}

/// Largest R_i of a bounded row.
const MOST_RATIO: f64 = 3.0;

/// R_i of a row with the given weights of the neighbors; infinite where the weight of the point itself is not negative.
fn ratio(weights: impl Iterator<Item = f64>) -> f64 {
    let (sum, size) = weights.fold((0.0, 0.0), |(sum, size), w| (sum + w, size + w.abs()));
    if sum > 0.0 { size / sum } else { f64::INFINITY }
}

/// Builds one operator per functional on a cloud with stars. `supports` are the wanted one and those of lower degree that
/// may take its place, in this order.
///
/// # Errors
/// [`Interrupted`] when the interrupt is raised.
///
/// ```
/// use meniscus::geometry::{Vector, fibonacci};
/// use meniscus::operators::charts::tangent::Metric;
/// use meniscus::operators::{EdgeRule, Functional, StarCloud, StarSupport, construct_star_rows};
/// use meniscus::parallel::Interrupt;
/// use meniscus::point_clouds::{PreparedCloud, cleaning::Cleaning};
///
/// // Δ_S z = −2 z on the unit sphere.
/// let points: Vec<Vector<3>> = fibonacci::sphere(1000);
/// let found = PreparedCloud::new(&points, None, Cleaning::Drop).unwrap();
/// let cloud = StarCloud {
///     points: &points,
///     normals: &found.normals,
///     spacings: &found.spacings,
///     graph: &found.graph,
///     metric: Metric::FromHeights,
///     edges: EdgeRule::OneSided,
///     rows: points.len(),
/// };
/// let supports = [StarSupport { degree: 3, cutoff: 2.4 }];
/// let built = construct_star_rows::<3, 2>(cloud, &supports, &[Functional::LaplaceBeltrami], &Interrupt::default()).unwrap();
/// let z: Vec<f64> = points.iter().map(|x| x[2]).collect();
/// let mut laplacian = vec![0.0; 1000];
/// built.operators[0].apply(&z, &mut laplacian);
/// assert!(z.iter().zip(&laplacian).all(|(z, value)| (value + 2.0 * z).abs() < 2e-2));
/// ```
pub fn construct_star_rows<const D: usize, const M: usize>(
    cloud: StarCloud<'_, D>,
    supports: &[StarSupport],
    functionals: &[Functional<M>],
    interrupt: &Interrupt,
) -> Result<StarRows<M>, Interrupted> {
    let count = cloud.rows;
    let builder = Builder { cloud, functionals, fits: supports.iter().map(|s| GrowingFits::new(*s)).collect() };
    let blocks: Vec<Block<M>> = (0..count.div_ceil(BLOCK))
        .into_par_iter()
        .with_min_len(1)
        .map_init(Workspace::default, |workspace, block| {
            if interrupt.is_raised() {
                return Block::default();
            }
            builder.block(block * BLOCK..((block + 1) * BLOCK).min(count), workspace)
        })
        .collect();
    interrupt.check()?;
    let stacked = |k: usize| SparseRows::stacked(blocks.iter().map(|block| &block.operators[k]));
    Ok(StarRows {
        operators: (0..functionals.len()).map(stacked).collect(),
        heights: if cloud.metric == Metric::FromHeights {
            blocks.iter().flat_map(|block| block.heights.iter().copied()).collect()
        } else {
            Vec::new()
        },
        kinds: blocks.iter().flat_map(|block| block.kinds.iter().copied()).collect(),
        grown: blocks.iter().map(|block| block.grown).sum(),
        largest_ratio: blocks.iter().fold(0.0, |most, block| most.max(block.largest_ratio)),
    })
}

/// Rows of consecutive points.
#[derive(Default)]
struct Block<const M: usize> {
    operators: Vec<SparseRows>,
    heights: Vec<Heights<M>>,
    kinds: Vec<RowKind>,
    grown: u64,
    largest_ratio: f64,
}

/// Workspace of a thread.
#[derive(Default)]
struct Workspace<const M: usize> {
    walk: Walk<M>,
    fits: growth::Workspace<M>,
}

/// The cloud, the functionals and the fits of a construction.
struct Builder<'a, const D: usize, const M: usize> {
    cloud: StarCloud<'a, D>,
    functionals: &'a [Functional<M>],
    /// Fits of the wanted degree, then of lower ones.
    fits: Vec<GrowingFits<M>>,
}

impl<const D: usize, const M: usize> Builder<'_, D, M> {
    /// The rows of a range of points, each from the first method that works.
    fn block(&self, points: std::ops::Range<usize>, workspace: &mut Workspace<M>) -> Block<M> {
        let first = points.start;
        let mut rows: Vec<Option<Row<M>>> = points.clone().map(|_| None).collect();
        for (stage, fits) in self.fits.iter().enumerate() {
            let open: Vec<usize> = points.clone().filter(|i| rows[i - first].is_none()).collect();
            let kind = if stage == 0 { RowKind::Full } else { RowKind::LowerOrder };
            fits.rows(self, &open, workspace, |i, row| rows[i - first] = Some(Row { kind, ..row }));
        }
        let mut block = Block { operators: vec![SparseRows::default(); self.functionals.len()], ..Block::default() };
        for (i, row) in points.zip(rows) {
            let row = row.unwrap_or_else(|| fallback::row(self, i, workspace));
            for (operator, weights) in block.operators.iter_mut().zip(&row.weights) {
                operator.push_row(&row.columns, weights);
            }
            block.heights.push(row.heights);
            block.kinds.push(row.kind);
            block.grown += u64::from(row.is_grown);
            block.largest_ratio = block.largest_ratio.max(row.ratio);
        }
        block
    }

    /// A functional at point i as a sum of partial derivatives.
    fn terms(&self, functional: Functional<M>, i: usize, heights: &Heights<M>, terms: &mut Vec<([u8; M], f64)>) {
        terms.clear();
        let heights = (self.cloud.metric == Metric::FromHeights).then_some(heights);
        tangent_terms(&self.cloud.normals[i], functional, heights, terms);
    }
}

#[cfg(test)]
mod tests;
