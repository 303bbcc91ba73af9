//! A flow from data: velocities at the nodes of a regular grid, at one or more times.

use super::{Flow, Vector};
use std::fmt;

/// Where the nodes of a regular grid lie, and at which times something is known there.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GridNodes {
    /// Number of nodes along x, y and z; 1 along z in the plane. x runs fastest.
    pub counts: [usize; 3],
    /// The first node.
    pub origin: [f64; 3],
    /// Distance of neighboring nodes along x, y and z.
    pub spacing: [f64; 3],
    /// The times, ascending.
    pub times: Vec<f64>,
}

impl GridNodes {
    /// Number of nodes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.counts.iter().product()
    }

    /// Whether there is no node.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The last node.
    #[must_use]
    pub fn end(&self) -> [f64; 3] {
        std::array::from_fn(|d| self.origin[d] + (self.counts[d].max(1) - 1) as f64 * self.spacing[d])
    }
}

/// Why velocities on a grid are no flow of a scene.
#[derive(Debug, Clone, PartialEq)]
pub enum UnusableGrid {
    /// Nodes along z in the plane, or none in space.
    Dimension {
        /// Nodes along z.
        along_z: usize,
        /// Dimensions of the scene.
        dimension: usize,
    },
    /// The run goes on after the data end.
    TooShort {
        /// First and last time of the data.
        times: [f64; 2],
        /// End of the run.
        end_time: f64,
    },
}

impl fmt::Display for UnusableGrid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Dimension { along_z, dimension } => {
                write!(f, "the grid has {along_z} nodes along z, which is no flow of {dimension} dimensions")
            }
            Self::TooShort { times: [first, last], end_time } => {
                write!(f, "the velocities are known from time {first} to {last}, the run goes from 0 to {end_time}")
            }
        }
    }
}

/// The flow u(x, t) between velocities at nodes: cubic splines in space, which end with the cubic of the last three spans along an
/// axis (not-a-knot), and straight lines in time. Velocities of one time hold for ever. u has two continuous derivatives in space,
/// and an error of fourth order in the spacing of the nodes (de Boor, A Practical Guide to Splines, ch. IV). Beyond the nodes there
/// is no velocity.
#[derive(Debug, Clone, PartialEq)]
pub struct GridFlow<const D: usize> {
    nodes: GridNodes,
    period: Option<f64>,
    /// Coefficients of B-splines, two more than nodes along each axis, x fastest, time after time.
    coefficients: Vec<Vector<D>>,
}

/// Places beyond the last node by this share of a span are round-off.
const ROUND_OFF: f64 = 1e-9;

impl<const D: usize> GridFlow<D> {
    /// A flow until `end_time` from the components of velocities, each with all nodes time after time.
    ///
    /// # Errors
    /// [`UnusableGrid`].
    pub fn new(
        nodes: &GridNodes,
        components: [&[f64]; D],
        period: Option<f64>,
        end_time: f64,
    ) -> Result<Self, UnusableGrid> {
        if (nodes.counts[2] > 1) != (D == 3) {
            return Err(UnusableGrid::Dimension { along_z: nodes.counts[2], dimension: D });
        }
        let (first, last) = (nodes.times.first().copied().unwrap_or(0.0), nodes.times.last().copied().unwrap_or(0.0));
        let reach = period.map_or(end_time, |period| period.max(end_time));
        let slack = ROUND_OFF * (last - first);
        if nodes.times.len() > 1 && (first > slack || last < reach - slack) {
            return Err(UnusableGrid::TooShort { times: [first, last], end_time: reach });
        }
        let mut flow = Self { nodes: nodes.clone(), period, coefficients: Vec::new() };
        let (all, count) = (flow.padded_len(), nodes.len());
        flow.coefficients = vec![Vector::<D>::zeros(); all * nodes.times.len().max(1)];
        for (d, component) in components.iter().enumerate() {
            for (values, out) in component.chunks(count).zip(flow.coefficients.chunks_mut(all)) {
                for (coefficient, out) in coefficients(values, &nodes.counts[..D]).into_iter().zip(out) {
                    out[d] = coefficient;
                }
            }
        }
        Ok(flow)
    }

    fn padded_len(&self) -> usize {
        self.nodes.counts[..D].iter().map(|n| n + 2).product()
    }

    /// The span along an axis, and how far into it a place lies, from 0 to 1; None beyond the nodes.
    fn span(&self, axis: usize, place: f64) -> Option<(usize, f64)> {
        let last = self.nodes.counts[axis] - 1;
        let at = (place - self.nodes.origin[axis]) / self.nodes.spacing[axis];
        if !(-ROUND_OFF..=last as f64 + ROUND_OFF).contains(&at) {
            return None;
        }
        let span = (at.max(0.0) as usize).min(last.saturating_sub(1));
        Some((span, at - span as f64))
    }

    /// The time step of the data before a time, and how far it lies between that and the next.
    fn moment(&self, time: f64) -> (usize, f64) {
        let times = &self.nodes.times;
        let after = times.partition_point(|t| *t <= time);
        match after {
            0 => (0, 0.0),
            _ if after == times.len() => (after - 1, 0.0),
            _ => (after - 1, (time - times[after - 1]) / (times[after] - times[after - 1])),
        }
    }

    /// Σ w c over the 4^D coefficients about a place, with weights along each axis; NaN beyond the nodes.
    fn sum(&self, x: &Vector<D>, time: f64, weights: impl Fn(usize, f64) -> [f64; 4]) -> Vector<D> {
        let mut spans = [0; D];
        let mut along = [[0.0; 4]; D];
        for d in 0..D {
            let Some((span, share)) = self.span(d, x[d]) else { return Vector::<D>::repeat(f64::NAN) };
            (spans[d], along[d]) = (span, weights(d, share));
        }
        let (step, share) = self.moment(time);
        let before = self.at_step(step, &spans, &along);
        if share == 0.0 { before } else { before * (1.0 - share) + self.at_step(step + 1, &spans, &along) * share }
    }

    fn at_step(&self, step: usize, spans: &[usize; D], along: &[[f64; 4]; D]) -> Vector<D> {
        let width = self.nodes.counts[0] + 2;
        let all = self.padded_len();
        let coefficients = &self.coefficients[step * all..(step + 1) * all];
        let mut sum = Vector::<D>::zeros();
        for plane in 0..if D == 3 { 4 } else { 1 } {
            for row in 0..4 {
                let mut start = spans[0] + (spans[1] + row) * width;
                let mut weight = along[1][row];
                if D == 3 {
                    start += (spans[2] + plane) * width * (self.nodes.counts[1] + 2);
                    weight *= along[2][plane];
                }
                let line = coefficients[start..start + 4].iter().zip(along[0]);
                sum += line.fold(Vector::<D>::zeros(), |sum, (c, w)| sum + c * w) * weight;
            }
        }
        sum
    }
}

/// Values of the four cubic B-splines over a span, at a share of it.
fn splines(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [
        s * s * s / 6.0,
        (4.0 - 6.0 * t * t + 3.0 * t * t * t) / 6.0,
        (4.0 - 6.0 * s * s + 3.0 * s * s * s) / 6.0,
        t * t * t / 6.0,
    ]
}

/// Their derivatives by the share.
fn slopes(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [-0.5 * s * s, -2.0 * t + 1.5 * t * t, 2.0 * s - 1.5 * s * s, 0.5 * t * t]
}

/// The coefficients of values at nodes, axis after axis; each axis gets two more.
fn coefficients(values: &[f64], counts: &[usize]) -> Vec<f64> {
    let mut now = values.to_vec();
    let mut shape = counts.to_vec();
    for axis in 0..shape.len() {
        let count = shape[axis];
        let before: usize = shape[..axis].iter().product();
        let lines = now.len() / count;
        let mut next = vec![0.0; lines * (count + 2)];
        for line in 0..lines {
            let (inner, outer) = (line % before, line / before);
            let values: Vec<f64> = (0..count).map(|k| now[inner + before * (k + outer * count)]).collect();
            for (k, coefficient) in line_coefficients(&values).into_iter().enumerate() {
                next[inner + before * (k + outer * (count + 2))] = coefficient;
            }
        }
        (now, shape[axis]) = (next, count + 2);
    }
    now
}

/// Coefficients c₋₁ to cₙ of the spline through n values. With d = δ²c it is f = c + d/6 at the nodes, and so d + δ²d/6 = δ²f. Not-a-knot
/// means δ²d = 0 at the nodes next to the ends, where then d = δ²f.
fn line_coefficients(f: &[f64]) -> Vec<f64> {
    let n = f.len();
    let bend = |i: usize| f[i - 1] - 2.0 * f[i] + f[i + 1];
    let mut d = vec![0.0; n];
    if n == 3 {
        d.fill(bend(1));
    } else if n > 3 {
        (d[1], d[n - 2]) = (bend(1), bend(n - 2));
        // (d₋ + 4 d + d₊)/6 = δ²f between them, by elimination forward and back.
        let mut factors = vec![0.0; n];
        for i in 2..n - 2 {
            let pivot = 4.0 - factors[i - 1];
            factors[i] = 1.0 / pivot;
            d[i] = (6.0 * bend(i) - d[i - 1]) / pivot;
        }
        for i in (2..n - 2).rev() {
            d[i] -= factors[i] * d[i + 1];
        }
        d[0] = 2.0 * d[1] - d[2];
        d[n - 1] = 2.0 * d[n - 2] - d[n - 3];
    }
    let c: Vec<f64> = f.iter().zip(&d).map(|(f, d)| f - d / 6.0).collect();
    // A single node stands for a constant.
    let beyond = |i: usize, next: usize| d[i] + 2.0 * c[i] - c[next];
    let (first, last) = if n > 1 { (beyond(0, 1), beyond(n - 1, n - 2)) } else { (c[0], c[0]) };
    std::iter::once(first).chain(c.iter().copied()).chain([last]).collect()
}

impl<const D: usize> Flow<D> for GridFlow<D> {
    fn velocity(&self, x: &Vector<D>, time: f64) -> Vector<D> {
        self.sum(x, time, |_, share| splines(share))
    }

    fn divergences(&self, points: &[Vector<D>], time: f64) -> Option<Vec<f64>> {
        let stretching = |x: &Vector<D>, axis: usize| {
            let weights = |d: usize, share: f64| if d == axis { slopes(share) } else { splines(share) };
            self.sum(x, time, weights)[axis] / self.nodes.spacing[axis]
        };
        Some(points.iter().map(|x| (0..D).map(|axis| stretching(x, axis)).sum()).collect())
    }

    fn fault(&self, x: &Vector<D>, time: f64) -> Option<String> {
        if (0..D).all(|d| self.span(d, x[d]).is_some()) {
            return None;
        }
        let place = |numbers: &[f64]| numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(", ");
        let (low, high) = (place(&self.nodes.origin[..D]), place(&self.nodes.end()[..D]));
        Some(format!(
            "a particle leaves the grid of velocities: it is at ({}) at time {time}, the nodes go from ({low}) to ({high})",
            place(x.as_slice())
        ))
    }

    fn relative_cost(&self) -> f64 {
        let times = if self.nodes.times.len() > 1 { 2.0 } else { 1.0 };
        times * cost_of_one_time(D)
    }

    fn top_speed(&self, _: &Vector<D>, _: &Vector<D>) -> f64 {
        // B-splines are positive and sum to 1.
        self.coefficients.iter().fold(0.0, |most, c| most.max(c.norm()))
    }

    fn return_time(&self) -> Option<f64> {
        self.period
    }
}

/// Cost of a sum over 4^D coefficients beside a built-in flow, about.
fn cost_of_one_time(dimension: usize) -> f64 {
    if dimension == 2 { 1.5 } else { 4.0 }
}

/// Stands for a flow from data before these are read: at rest, with the cost of two times.
#[derive(Debug, Clone, PartialEq)]
pub struct UnreadFlow {
    /// The period that the scene gives.
    pub period: Option<f64>,
}

impl<const D: usize> Flow<D> for UnreadFlow {
    fn velocity(&self, _: &Vector<D>, _: f64) -> Vector<D> {
        Vector::<D>::zeros()
    }

    fn relative_cost(&self) -> f64 {
        2.0 * cost_of_one_time(D)
    }

    fn top_speed(&self, _: &Vector<D>, _: &Vector<D>) -> f64 {
        0.0
    }

    fn return_time(&self) -> Option<f64> {
        self.period
    }
}

#[cfg(test)]
mod tests {
    use super::{Flow, GridFlow, GridNodes, UnusableGrid, Vector};
    use crate::geometry::block::indices;
    use crate::geometry::flows::SingleVortex;

    /// Nodes over the unit square or cube, at some times.
    fn nodes(count: usize, dimension: usize, times: &[f64]) -> GridNodes {
        let counts = [count, count, if dimension == 3 { count } else { 1 }];
        let spacing = 1.0 / (count - 1) as f64;
        GridNodes { counts, origin: [0.0; 3], spacing: [spacing; 3], times: times.to_vec() }
    }

    fn sampled<const D: usize>(nodes: &GridNodes, u: impl Fn(&[f64; 3], f64) -> [f64; D]) -> GridFlow<D> {
        let place = |k: usize| {
            let node = indices(k, &nodes.counts);
            std::array::from_fn(|d| nodes.origin[d] + node[d] as f64 * nodes.spacing[d])
        };
        let places: Vec<[f64; 3]> = (0..nodes.len()).map(place).collect();
        let values: Vec<[f64; D]> =
            nodes.times.iter().flat_map(|t| places.iter().map(|x| u(x, *t)).collect::<Vec<_>>()).collect();
        let columns: [Vec<f64>; D] = std::array::from_fn(|d| values.iter().map(|u| u[d]).collect());
        GridFlow::new(nodes, std::array::from_fn(|d| columns[d].as_slice()), None, 1.0).unwrap()
    }

    fn cubic(x: &[f64; 3], t: f64) -> [f64; 3] {
        let [x, y, z] = *x;
        [1.0 + x * x * y - z * z * z * t, x * y * z + y * y * y, (2.0 * x - z) * y * y * (1.0 - t)]
    }

    #[test]
    fn cubics_in_space_and_lines_in_time_are_exact_up_to_the_ends() {
        let flow = sampled::<3>(&nodes(5, 3, &[0.0, 0.5, 1.0]), cubic);
        for x in [[0.0, 1.0, 0.03], [0.31, 0.77, 0.98], [0.5, 0.25, 1.0]] {
            for t in [0.0, 0.2, 0.5, 0.9, 1.0] {
                let (found, exact) = (flow.velocity(&Vector::<3>::from(x), t), Vector::<3>::from(cubic(&x, t)));
                assert!((found - exact).norm() < 1e-13, "{x:?} {t}: {found:?} {exact:?}");
                let [x, y, z] = x;
                let exact = 2.0 * x * y + x * z + 3.0 * y * y - y * y * (1.0 - t);
                let divergence = flow.divergences(&[Vector::<3>::new(x, y, z)], t).unwrap()[0];
                assert!((divergence - exact).abs() < 1e-12, "{divergence} {exact}");
            }
        }
    }

    #[test]
    fn errors_are_of_fourth_order_in_the_spacing_of_nodes() {
        let vortex = SingleVortex { period: None };
        let error = |count: usize| {
            let flow =
                sampled::<2>(&nodes(count, 2, &[0.0]), |x, t| vortex.velocity(&Vector::<2>::new(x[0], x[1]), t).into());
            let places = (0..900).map(|k| Vector::<2>::new(f64::from(k % 30) / 29.0, f64::from(k / 30) / 29.0));
            places.map(|x| (flow.velocity(&x, 0.0) - vortex.velocity(&x, 0.0)).norm()).fold(0.0, f64::max)
        };
        let order = (error(17) / error(65)).log2() / 2.0;
        assert!(order > 3.7, "{order}");
    }

    #[test]
    fn few_nodes_give_the_line_and_the_parabola() {
        for (count, power) in [(2, 1), (3, 2)] {
            let flow = sampled::<2>(&nodes(count, 2, &[0.0]), |x, _| [x[0].powi(power), x[1]]);
            let found = flow.velocity(&Vector::<2>::new(0.3, 0.6), 5.0);
            assert!((found - Vector::<2>::new(0.3_f64.powi(power), 0.6)).norm() < 1e-15, "{count}: {found:?}");
        }
    }

    #[test]
    fn beyond_nodes_and_times_nothing_is_known() {
        let flow = sampled::<2>(&nodes(4, 2, &[0.0]), |_, _| [1.0, 2.0]);
        let outside = Vector::<2>::new(1.01, 0.5);
        assert!(flow.velocity(&outside, 0.0).x.is_nan());
        assert!(flow.fault(&outside, 0.25).unwrap().contains("(1.01, 0.5) at time 0.25"));
        assert!(flow.fault(&Vector::<2>::new(1.0, 0.0), 0.0).is_none());
        let (two, values) = (nodes(4, 2, &[0.0, 0.5]), vec![0.0; 32]);
        let short = GridFlow::<2>::new(&two, [&values, &values], None, 1.0).unwrap_err();
        assert_eq!(short, UnusableGrid::TooShort { times: [0.0, 0.5], end_time: 1.0 });
        assert!(GridFlow::<3>::new(&two, [&values, &values, &values], None, 0.5).is_err());
        let speed = flow.top_speed(&outside, &outside);
        assert!((speed - 5.0_f64.sqrt()).abs() < 1e-12);
    }
}
