//! From the points of a cloud from outside to what operators are made of: points without duplicates and strays, local
//! spacings, unit normals, and the graph of stars.

use super::cleaning::{Cleaning, clean};
use super::examination::{EXTENTS, LEAST_SPACING, NormalSource, PointList, Unusable};
use super::given_normals::{self, Verdict};
use super::local_spacing::{self, Nearest, median};
use super::orientation::{orient, orient_pieces};
use super::planes::{Plane, planes};
use super::star_graph::StarGraph;
use super::stars::{CANDIDATES, Stars, refined_normals};
use crate::geometry::Vector;
use crate::parallel::Interrupt;

/// A cloud that operators can be made on.
#[derive(Debug, Clone)]
pub struct PreparedCloud<const D: usize> {
    /// The points that stay.
    pub points: Vec<Vector<D>>,
    /// Index of each of them in the given cloud.
    pub kept: Vec<usize>,
    /// Index of each given point, or of the one that it was merged with; None for strays.
    pub places: Vec<Option<u32>>,
    /// Unit normals.
    pub normals: Vec<Vector<D>>,
    /// Whether normals were given, and not replaced as a whole.
    pub source: NormalSource,
    /// Local spacing at each point, a length.
    pub spacings: Vec<f64>,
    /// Median spacing, a length.
    pub spacing: f64,
    /// Cells of the points.
    pub stars: Stars,
    /// Their graph, with conductances, areas and parts.
    pub graph: StarGraph,
    /// Points left out because another one lies at their place, by their index in the given cloud.
    pub merged: Option<PointList>,
    /// Strays left out, by their index in the given cloud.
    pub dropped: Option<PointList>,
    /// What was found about given normals.
    pub verdict: Option<Verdict>,
    /// Points whose star joins them to a sheet over or under them.
    pub joined_sheets: Option<PointList>,
    /// Pieces that close on themselves, of estimated normals; more than there are parts where bodies touch.
    pub closed_pieces: usize,
}

/// Least width of a neighborhood that is no line.
const LEAST_WIDTH: f64 = 1e-6;
/// Sine of the elevation over both tangent planes at which an edge joins two sheets, and the least |cos| of their normals.
const JOINED: f64 = 0.5;

impl<const D: usize> PreparedCloud<D> {
    /// Prepares points with or without normals.
    ///
    /// 1. Duplicates and strays are left out. 2. Local spacings. 3. Normals: planes, refined twice by stars. 4. Given normals
    ///    are held against them. 5. Stars and their graph. 6. Sides of estimated normals.
    ///
    /// # Errors
    /// [`Unusable`] when nothing can be computed on the points.
    pub fn new(points: &[Vector<D>], given: Option<&[Vector<D>]>, cleaning: Cleaning) -> Result<Self, Unusable> {
        Self::with_interrupt(points, given, cleaning, &Interrupt::default())
    }

    /// The same; what was prepared does not count once `interrupt` is raised.
    ///
    /// # Errors
    /// [`Unusable`] when nothing can be computed on the points.
    pub fn with_interrupt(
        points: &[Vector<D>],
        given: Option<&[Vector<D>]>,
        cleaning: Cleaning,
        interrupt: &Interrupt,
    ) -> Result<Self, Unusable> {
        let least = local_spacing::neighbors_wanted(D) + 1;
        let too_few = |count: usize| if count < least { Err(Unusable::TooFew { count, least }) } else { Ok(()) };
        too_few(points.len())?;
        let cleaned = clean(points, cleaning)?;
        let present: Vec<Vector<D>> = cleaned.kept.iter().map(|i| points[*i]).collect();
        too_few(present.len())?;
        let nearest = Nearest::new(&present, CANDIDATES[D - 2]);
        let unsmoothed = local_spacing::at_each_point(&present, &nearest);
        let spacings = local_spacing::smoothed::<D>(&unsmoothed, &nearest);
        check_spacings(&cleaned.kept, &unsmoothed, &spacings)?;
        let spacing = median(&mut spacings.clone());
        check_scale(&present, spacing)?;
        let planes = planes(&present, &nearest);
        check_planes(&planes)?;
        let first = planes.iter().map(|plane| plane.normal).collect();
        let mut normals = refined_normals(&present, &nearest, first, &spacings, 2);
        let (mut source, mut verdict) = (NormalSource::Estimated, None);
        let mut stars = Stars::new(&present, &nearest, &normals, &spacings);
        if let Some(given) = given {
            let given: Vec<Vector<D>> = cleaned.kept.iter().map(|i| given[*i]).collect();
            let found = given_normals::judge(&given, &normals, &planes, &stars);
            if let Some(better) = found.corrected(&given, &normals) {
                (normals, source) = (better, NormalSource::Given);
                stars = Stars::new(&present, &nearest, &normals, &spacings);
            }
            verdict = Some(found);
        }
        let (graph, mut closed_pieces) = (StarGraph::new(&stars), 0);
        match (&mut verdict, source) {
            (Some(verdict), NormalSource::Given) => verdict.agree(&present, &graph, &mut normals),
            _ => {
                orient(&present, &graph, &mut normals);
                let is_trusted = given_normals::trusted(&stars, &planes);
                closed_pieces = orient_pieces(&present, &graph, &is_trusted, &mut normals, interrupt);
            }
        }
        let joined_sheets = PointList::from_condition(present.len(), |i| joins_sheets(&present, &normals, &graph, i));
        Ok(Self {
            points: present,
            places: cleaned.places(points.len()),
            kept: cleaned.kept,
            normals,
            source,
            spacings,
            spacing,
            stars,
            graph,
            merged: cleaned.merged,
            dropped: cleaned.dropped,
            verdict,
            joined_sheets,
            closed_pieces,
        })
    }
}

/// Local spacings and the graph of stars of points with known normals.
#[must_use]
pub fn spacings_and_graph<const D: usize>(points: &[Vector<D>], normals: &[Vector<D>]) -> (Vec<f64>, StarGraph) {
    let nearest = Nearest::new(points, CANDIDATES[D - 2]);
    let spacings = local_spacing::smoothed::<D>(&local_spacing::at_each_point(points, &nearest), &nearest);
    let graph = StarGraph::new(&Stars::new(points, &nearest, normals, &spacings));
    (spacings, graph)
}

/// Refuses points most of which lie on a line with their neighbors.
fn check_planes<const D: usize>(planes: &[Plane<D>]) -> Result<(), Unusable> {
    let lines = planes.iter().filter(|plane| plane.width < LEAST_WIDTH).count();
    if 2 * lines > planes.len() { Err(Unusable::Line { count: planes.len(), lines }) } else { Ok(()) }
}

/// Refuses points without a spacing, by their numbers in the given cloud.
fn check_spacings(kept: &[usize], unsmoothed: &[f64], smoothed: &[f64]) -> Result<(), Unusable> {
    // The spacing of a point beside them is zero only when smoothed.
    let without = |spacings: &[f64]| -> Vec<usize> {
        kept.iter().zip(spacings).filter(|(_, spacing)| **spacing <= 0.0).map(|(i, _)| *i).collect()
    };
    let stacked = PointList::from_indices(without(unsmoothed)).or_else(|| PointList::from_indices(without(smoothed)));
    stacked.map_or(Ok(()), |list| Err(Unusable::Stacked(list)))
}

/// Whether differences of the coordinates have digits enough.
fn check_scale<const D: usize>(points: &[Vector<D>], spacing: f64) -> Result<(), Unusable> {
    let bounds = |(low, high): (Vector<D>, Vector<D>), x: &Vector<D>| (low.inf(x), high.sup(x));
    let (low, high) = points.iter().fold((points[0], points[0]), bounds);
    let largest = low.abs().sup(&high.abs()).max();
    let extent = (high - low).norm();
    if EXTENTS.contains(&extent) && spacing > LEAST_SPACING * largest {
        return Ok(());
    }
    Err(Unusable::OutOfScale { count: points.len(), extent, spacing, largest })
}

/// Whether an edge of point i stands steeply on both tangent planes while the normals are about parallel.
fn joins_sheets<const D: usize>(points: &[Vector<D>], normals: &[Vector<D>], graph: &StarGraph, i: usize) -> bool {
    graph.neighbors(i).iter().any(|j| {
        let j = *j as usize;
        let d = points[j] - points[i];
        let is_steep = |n: &Vector<D>| d.dot(n).abs() > JOINED * d.norm();
        is_steep(&normals[i]) && is_steep(&normals[j]) && normals[i].dot(&normals[j]).abs() > JOINED
    })
}

#[cfg(test)]
mod tests;
