//! Where the front is exactly, and how far the foot-points are from it: errors, coverage and gaps.
//!
//! Distances of foot-points alone flatter a front with holes, so coverage (the largest distance from the exact front to a
//! foot-point) and the largest gap along it stand beside every error. Means of distances are over the front, not over its foot-points,
//! which are crowded where a grid is refined.

use super::foot_points::FootPoints;
use super::grid::Grid;
use super::system::for_each_near;
use super::topology::Topology;
use super::wavefront::EllipticalWavefront;
use crate::geometry::surfaces::Ball;
use crate::geometry::{Domain, Surface, Vector};
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::{Interrupt, Interrupted};
use crate::schemes::exact_motion::ExactMotion;
use crate::schemes::measured_errors::{ErrorNorms, entry};
use crate::simulation::ErrorEntry;
use rayon::prelude::{IntoParallelRefIterator, IntoParallelRefMutIterator, ParallelIterator};

/// The exact motion of a front, where one is known.
pub enum ExactFrontMotion<const D: usize> {
    /// In a flow.
    Flow(ExactMotion<D>),
    /// With a constant speed: the front is where the distance from the start is speed × time, of all parts together where they merge,
    /// of one of them where they cross.
    Offset {
        /// Parts of the front at the start.
        surfaces: Vec<Box<dyn Surface<D>>>,
        /// Along the outward normal.
        speed: f64,
        /// What happens where they meet.
        topology: Topology,
    },
    /// A wave front in (x, y, θ).
    Rays(EllipticalWavefront),
    /// Of a circle or a sphere by its mean curvature: r² = R² − 2 (D − 1) t.
    Shrinking(Ball<D>),
    /// Not known.
    Unknown,
}

/// Errors of one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FrontErrors {
    pub time: f64,
    /// In the order of [`ENTRIES`]; not finite where nothing is known.
    pub values: [f64; ENTRIES.len()],
}

/// Quantities and norms. The L2 norm of the distance is that of GBPM eq. 18, over the angle.
const ENTRIES: [(&str, &str); 10] = [
    ("front", "mean"),
    ("front", "rms"),
    ("front", "max"),
    ("front", "l2"),
    ("front", "coverage_h"),
    ("front", "gap_h"),
    ("radius", "mean"),
    ("radius", "deviation"),
    ("curvature", "rms"),
    ("front", "count"),
];

impl FrontErrors {
    pub const NUMBERS: usize = 1 + 2 * ENTRIES.len();

    /// For a state, which holds finite numbers alone: whether each value is known, and the value.
    pub fn to_numbers(self) -> Vec<f64> {
        let pair = |value: f64| if value.is_finite() { [1.0, value] } else { [0.0; 2] };
        std::iter::once(self.time).chain(self.values.into_iter().flat_map(pair)).collect()
    }

    pub fn from_numbers(n: &[f64]) -> Self {
        let value = |k: usize| if n[2 * k + 1] > 0.5 { n[2 * k + 2] } else { f64::NAN };
        Self { time: n[0], values: std::array::from_fn(value) }
    }

    pub fn entries(&self) -> Vec<ErrorEntry> {
        let known = ENTRIES.iter().zip(self.values).filter(|(_, value)| value.is_finite());
        known.map(|((quantity, norm), value)| entry(quantity, norm, value, self.time, "exact motion")).collect()
    }
}

/// Spacing of the lattice from which points of an exact surface come, by that of the front.
const SAMPLE: f64 = 0.53;
/// The same by that again where a flow is going to carry the points along.
const DRAWN_APART: f64 = 0.5;
/// Spacing of such samples by that of the foot-points, root mean square, at least.
const LEAST_SAMPLE: f64 = 0.4;
/// Points of the exact curve per spacing.
const POINTS_PER_SPACING: f64 = 20.0;

impl<const D: usize> ExactFrontMotion<D> {
    /// The exact front is a ball with this centre and radius at a time, if it is one.
    fn ball(&self, ball: Option<&Ball<D>>, time: f64) -> Option<Ball<D>> {
        let ball = ball?;
        match self {
            Self::Flow(motion) => {
                let back = motion.flow().is_back(time).then_some(ball.center);
                let center = motion.flow().rigid_path(&ball.center, time).or(back)?;
                Some(Ball { center, radius: ball.radius })
            }
            Self::Offset { speed, .. } => {
                let radius = ball.radius + speed * time;
                (radius > 0.0).then_some(Ball { center: ball.center, radius })
            }
            Self::Shrinking(start) => {
                let square = start.radius * start.radius - 2.0 * (D as f64 - 1.0) * time;
                (square > 0.0).then(|| Ball { center: start.center, radius: square.sqrt() })
            }
            Self::Rays(_) | Self::Unknown => None,
        }
    }

    /// When the front vanishes, where that is known.
    pub(super) fn extinction(&self, ball: Option<&Ball<D>>) -> Option<f64> {
        match (self, ball) {
            (Self::Shrinking(start), _) => Some(start.radius * start.radius / (2.0 * (D as f64 - 1.0))),
            (Self::Offset { speed, .. }, Some(ball)) if *speed < 0.0 => Some(ball.radius / -speed),
            _ => None,
        }
    }

    /// Distances of the foot-points from the exact front, and of the exact front from them.
    pub(super) fn errors(
        &self,
        ball: Option<&Ball<D>>,
        feet: &FootPoints<D>,
        grid: &Grid,
        time: f64,
        interrupt: &Interrupt,
    ) -> Result<Option<FrontErrors>, Interrupted> {
        let ball = self.ball(ball, time);
        let spacing = feet.finest_spacing(grid);
        let mut chains = Vec::new();
        let mut loose = Vec::new();
        let distances: Vec<f64> = if let Some(ball) = &ball {
            chains = ball.outline(spacing / POINTS_PER_SPACING);
            if chains.is_empty() {
                sample(ball, spacing, |x| loose.push(x));
            }
            feet.positions.iter().map(|x| (x - ball.center).norm() - ball.radius).collect()
        } else {
            match self {
                Self::Flow(motion) => {
                    let Some(surface) = motion.surface() else { return Ok(None) };
                    if let Some(front) = motion.front(time, spacing, interrupt)? {
                        chains = front.chains(spacing / POINTS_PER_SPACING);
                        if chains.is_empty() {
                            sample(surface, spacing, |x| loose.extend(front.place_by_formula(&x)));
                        }
                        each(&feet.positions, interrupt, f64::NAN, |x| front.signed_distance(x))
                    } else {
                        // The flow draws the samples apart.
                        let fine = (DRAWN_APART * spacing).max(least_sample_spacing(feet, grid));
                        sample(surface, fine, |x| loose.push(x));
                        loose.par_iter_mut().for_each(|x| {
                            if !interrupt.is_raised() {
                                *x = motion.place_about(x, time);
                            }
                        });
                        each(&feet.positions, interrupt, f64::NAN, |x| {
                            motion.distance_nearby(x, time).unwrap_or(f64::NAN)
                        })
                    }
                }
                Self::Offset { surfaces, speed, topology } => {
                    let way = speed * time;
                    let level = |x: &Vector<D>| offset_distance(surfaces, *topology, x, way);
                    loose = offset_points(surfaces, *topology, spacing, way);
                    feet.positions.iter().map(level).collect()
                }
                Self::Rays(front) => {
                    let points = front.points(spacing / POINTS_PER_SPACING, time);
                    chains = vec![points.into_iter().map(|x| in_dimensions(&x)).collect()];
                    feet.positions.iter().map(|x| front.distance(&in_dimensions(x), time)).collect()
                }
                Self::Shrinking(_) | Self::Unknown => return Ok(None),
            }
        };
        interrupt.check()?;
        let spacings = feet.nodes.iter().map(|node| grid.spacing_of(*node));
        let dimension = if let Self::Rays(_) = self { 1 } else { D as i32 - 1 };
        let norms = along_front(&distances, spacings.clone().map(|own| (own / spacing).powi(dimension)));
        let count = feet.len() as f64;
        let mut cells = CellList::new(Domain::unbounded());
        cells.rebuild(feet.positions.iter().copied(), spacing);
        let coverage = {
            let far = |(i, r): (usize, f64)| r / grid.spacing_of(feet.nodes[i]);
            let nearest = |x: &Vector<D>| cells.nearest(x, f64::INFINITY).map_or(f64::INFINITY, far);
            let largest =
                |points: &[Vector<D>]| each(points, interrupt, 0.0, nearest).into_iter().fold(f64::NAN, f64::max);
            chains.iter().map(|chain| largest(chain)).fold(largest(&loose), f64::max)
        };
        interrupt.check()?;
        let gap = if chains.is_empty() { f64::NAN } else { largest_gap(&chains, &feet.positions, spacings) };
        let mut values = [f64::NAN; ENTRIES.len()];
        values[9] = count;
        if feet.is_empty() {
            // Norms of nothing are no norms: that nothing is there is the error.
            return Ok(Some(FrontErrors { time, values }));
        }
        values[..3].copy_from_slice(&norms);
        (values[4], values[5]) = (coverage, gap);
        if let Some(ball) = &ball {
            let mean = distances.iter().sum::<f64>() / count;
            let square = distances.iter().map(|d| (d - mean) * (d - mean)).sum::<f64>() / count;
            (values[6], values[7]) = (ball.radius + mean, square.sqrt());
            let bend = (D as f64 - 1.0) / ball.radius;
            let mut norms = ErrorNorms::default();
            feet.curvatures.iter().for_each(|curvature| norms.add(curvature - bend));
            values[8] = norms.rms();
            if D == 2 {
                values[3] = over_angle(ball, &feet.positions, &distances);
            }
        }
        Ok(Some(FrontErrors { time, values }))
    }
}

/// Samples are no denser than this: on a refined grid the surface as a whole would have far more of them than foot-points.
fn least_sample_spacing<const D: usize>(feet: &FootPoints<D>, grid: &Grid) -> f64 {
    let squares: f64 = feet.nodes.iter().map(|node| grid.spacing_of(*node).powi(2)).sum();
    LEAST_SAMPLE * (squares / feet.len().max(1) as f64).sqrt()
}

/// Something of each point; of no use after an interrupt.
fn each<const D: usize, T: Copy + Send + Sync>(
    points: &[Vector<D>],
    interrupt: &Interrupt,
    nothing: T,
    find: impl Fn(&Vector<D>) -> T + Sync,
) -> Vec<T> {
    points.par_iter().map(|x| if interrupt.is_raised() { nothing } else { find(x) }).collect()
}

/// Mean, root mean square and maximum over the front, of which every foot-point stands for as much as a cell of its level covers.
fn along_front(distances: &[f64], shares: impl Iterator<Item = f64>) -> [f64; 3] {
    let (mut all, mut sum, mut squares, mut norms) = (0.0, 0.0, 0.0, ErrorNorms::default());
    for (distance, share) in distances.iter().zip(shares) {
        all += share;
        sum += share * distance.abs();
        squares += share * distance * distance;
        norms.add(*distance);
    }
    [sum / all, (squares / all).sqrt(), norms.max()]
}

/// A vector of another number of components; those of a wave front are three either way.
fn in_dimensions<const D: usize, const E: usize>(x: &Vector<D>) -> Vector<E> {
    Vector::<E>::from_fn(|d, _| if d < D { x[d] } else { 0.0 })
}

/// [∫ d² dθ]^½ by the trapezoidal rule over the angles of the foot-points (GBPM eq. 18).
fn over_angle<const D: usize>(ball: &Ball<D>, positions: &[Vector<D>], distances: &[f64]) -> f64 {
    let angle = |x: &Vector<D>| (x[1] - ball.center[1]).atan2(x[0] - ball.center[0]);
    let mut sorted: Vec<(f64, f64)> = positions.iter().map(angle).zip(distances.iter().copied()).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let turn = std::f64::consts::TAU;
    let next = sorted.iter().cycle().skip(1);
    let sum: f64 =
        sorted.iter().zip(next).map(|(a, b)| 0.5 * (a.1 * a.1 + b.1 * b.1) * (b.0 - a.0).rem_euclid(turn)).sum();
    sum.sqrt()
}

/// The distance from the front that has moved by `way` along the normals; its sign is that of the start's level.
fn offset_distance<const D: usize>(
    surfaces: &[Box<dyn Surface<D>>],
    topology: Topology,
    x: &Vector<D>,
    way: f64,
) -> f64 {
    let levels = surfaces.iter().map(|surface| surface.signed_distance(x) - way);
    match topology {
        // The union's outer distance is the least of its parts'.
        Topology::Merge => levels.fold(f64::INFINITY, f64::min),
        Topology::Cross => {
            levels.fold(f64::INFINITY, |best, level| if level.abs() < best.abs() { level } else { best })
        }
    }
}

/// Points of a surface about half a spacing apart, from a lattice of its own: that of the foot-points would find these again.
fn sample<const D: usize>(surface: &dyn Surface<D>, spacing: f64, mut visit: impl FnMut(Vector<D>)) {
    let fine = Grid { spacing: SAMPLE * spacing };
    let reach = 0.5 * fine.spacing * (D as f64).sqrt();
    for_each_near(surface, reach, (&fine, 0), |_, x| visit(surface.nearest(&x).point));
}

/// Points of that front: points of a lattice near it, moved along the ray from the start that passes through them.
fn offset_points<const D: usize>(
    surfaces: &[Box<dyn Surface<D>>],
    topology: Topology,
    spacing: f64,
    way: f64,
) -> Vec<Vector<D>> {
    let mut points = Vec::new();
    let fine = Grid { spacing: SAMPLE * spacing };
    for surface in surfaces {
        for_each_near(surface.as_ref(), way.abs() + fine.spacing, (&fine, 0), |_, x| {
            let exact = surface.nearest(&x);
            if (exact.distance - way).abs() > fine.spacing || exact.distance == 0.0 {
                return;
            }
            let point = exact.point + (x - exact.point) * (way / exact.distance);
            if offset_distance(surfaces, topology, &point, way).abs() < 1e-9 {
                points.push(point);
            }
        });
    }
    points
}

/// The longest part of the chains between the nearest points of the given places, by the coarser spacing of its two ends.
fn largest_gap<const D: usize>(
    chains: &[Vec<Vector<D>>],
    places: &[Vector<D>],
    spacings: impl Iterator<Item = f64> + Clone,
) -> f64 {
    if places.is_empty() {
        return f64::INFINITY;
    }
    let all: Vec<Vector<D>> = chains.iter().flatten().copied().collect();
    let mut cells = CellList::new(Domain::unbounded());
    let step = all.windows(2).map(|pair| (pair[1] - pair[0]).norm()).fold(f64::INFINITY, f64::min);
    cells.rebuild(all.iter().copied(), step.max(f64::MIN_POSITIVE));
    let finest = spacings.clone().fold(f64::INFINITY, f64::min);
    // The spacing of the place that a point is nearest to.
    let mut hits: Vec<Option<f64>> = vec![None; all.len()];
    for (place, spacing) in places.iter().zip(spacings) {
        if let Some((nearest, _)) = cells.nearest(place, f64::INFINITY) {
            let hit = hits[nearest].get_or_insert(spacing);
            *hit = hit.max(spacing);
        }
    }
    let mut first = 0;
    let mut largest = 0.0_f64;
    for chain in chains {
        let hits = &hits[first..first + chain.len()];
        first += chain.len();
        // Once round from the first hit, and on to it again; a chain without a hit is one gap.
        let mut since_hit = 0.0;
        let mut start: Option<(f64, f64)> = None;
        let mut last = finest;
        for (k, hit) in hits.iter().enumerate() {
            if k > 0 {
                since_hit += (chain[k] - chain[k - 1]).norm();
            }
            if let Some(spacing) = *hit {
                if start.is_none() {
                    start = Some((since_hit, spacing));
                } else {
                    largest = largest.max(since_hit / spacing.max(last));
                }
                since_hit = 0.0;
                last = spacing;
            }
        }
        let (before, spacing) = start.unwrap_or((0.0, finest));
        largest = largest.max((since_hit + before) / spacing.max(last));
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::{along_front, largest_gap, over_angle};
    use crate::geometry::Vector;
    use crate::geometry::surfaces::{Ball, Surface};

    #[test]
    fn a_coarse_foot_point_stands_for_more_of_the_front() {
        let [mean, rms, largest] = along_front(&[0.5, -0.1], [1.0, 4.0].into_iter());
        assert!((mean - 0.18).abs() < 1e-15 && (rms - 0.058_f64.sqrt()).abs() < 1e-15);
        assert!((largest - 0.5).abs() < 1e-15);
    }

    fn ball() -> Ball<2> {
        Ball { center: Vector::<2>::new(0.3, 0.1), radius: 0.5 }
    }

    fn at(angle: f64) -> Vector<2> {
        Vector::<2>::new(0.3 + 0.5 * angle.cos(), 0.1 + 0.5 * angle.sin())
    }

    #[test]
    fn a_missing_arc_is_the_largest_gap() {
        let chains = ball().outline(0.001);
        let places: Vec<Vector<2>> = (0..100).map(|k| at(f64::from(k) * 0.05 + 0.4)).collect();
        let missing = std::f64::consts::TAU - 99.0 * 0.05;
        let gap = largest_gap(&chains, &places, std::iter::repeat_n(0.1, 100));
        assert!((gap - 5.0 * missing).abs() < 2e-2);
        // One end at a coarser level: the same way is fewer of its spacings.
        let coarser = (0..100).map(|k| if k == 0 { 0.2 } else { 0.1 });
        assert!((largest_gap(&chains, &places, coarser) - 2.5 * missing).abs() < 1e-2);
        let start = &places[..1];
        assert!((largest_gap(&chains, start, std::iter::once(0.1)) - 5.0 * std::f64::consts::TAU).abs() < 2e-2);
        assert_eq!(largest_gap(&chains, &[], std::iter::empty()), f64::INFINITY);
    }

    #[test]
    fn a_constant_error_is_weighed_by_the_whole_turn() {
        let places: Vec<Vector<2>> = [0.1, 0.5, 2.0, 3.0, 5.0].map(at).to_vec();
        let norm = over_angle(&ball(), &places, &[0.2; 5]);
        assert!((norm - 0.2 * std::f64::consts::TAU.sqrt()).abs() < 1e-12);
    }
}
