//! Wave fronts of geometrical optics as curves in (x, y, θ) (GBPM 4.6). Where a front crosses itself in the plane, the
//! directions tell its branches apart.

use super::foot_points::{FootPoint, FootPoints};
use super::grid::{Grid, Node};
use super::method::FrontMethod;
use crate::geometry::Vector;

/// The wave front that starts on an ellipse, along its inner normals, with a constant speed.
///
/// Position of parameter φ at time t: (a cos φ + c t cos θ, b sin φ + c t sin θ, θ) with θ = π + arg(b cos φ + i a sin φ) without
/// jumps. One turn is a curve from θ = π to 3 π; its ends are at one position of the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EllipticalWavefront {
    /// Center in the plane.
    pub center: [f64; 2],
    /// a and b, the semi-axes of the ellipse.
    pub semi_axes: [f64; 2],
    /// c, the speed of the rays.
    pub speed: f64,
}

/// Tuning constants of the search for closest points of the curve at the start.
struct WavefrontTuning {
    /// Points of the curve per spacing from which Newton's iteration starts.
    starts_per_spacing: f64,
    /// Half the edge of the box of grid points about such a point, in radii of the tube.
    box_radius: f64,
    /// Largest number of Newton steps.
    most_iterations: usize,
    /// Relative length of a Newton step that changes nothing.
    still: f64,
    /// Least second derivative of half the squared distance, relative to that on the curve; below it the step is that on the
    /// curve.
    least_bend: f64,
}

const TUNING: WavefrontTuning =
    WavefrontTuning { starts_per_spacing: 4.0, box_radius: 1.5, most_iterations: 50, still: 1e-15, least_bend: 1e-3 };
/// One turn of φ and of θ.
const TURN: f64 = std::f64::consts::TAU;

impl EllipticalWavefront {
    /// θ of a parameter φ.
    fn direction(&self, phi: f64) -> f64 {
        let [a, b] = self.semi_axes;
        // θ − π differs from φ by less than a right angle.
        let lead = ((a - b) * phi.sin() * phi.cos()).atan2(b * phi.cos().powi(2) + a * phi.sin().powi(2));
        std::f64::consts::PI + phi + lead
    }

    /// φ of a direction θ.
    fn parameter(&self, theta: f64) -> f64 {
        let [a, b] = self.semi_axes;
        let psi = theta - std::f64::consts::PI;
        let lag = ((b - a) * psi.sin() * psi.cos()).atan2(a * psi.cos().powi(2) + b * psi.sin().powi(2));
        psi + lag
    }

    /// The position of parameter φ at a time.
    #[must_use]
    pub fn place(&self, phi: f64, time: f64) -> Vector<3> {
        let ([a, b], theta, way) = (self.semi_axes, self.direction(phi), self.speed * time);
        Vector::<3>::new(
            self.center[0] + a * phi.cos() + way * theta.cos(),
            self.center[1] + b * phi.sin() + way * theta.sin(),
            theta,
        )
    }

    /// First and second derivatives of the position by φ at time 0.
    fn derivatives(&self, phi: f64) -> [Vector<3>; 2] {
        let [a, b] = self.semi_axes;
        let (sin, cos) = phi.sin_cos();
        let square = (b * cos).powi(2) + (a * sin).powi(2);
        let bend = -a * b * 2.0 * (a * a - b * b) * sin * cos / (square * square);
        [Vector::<3>::new(-a * sin, b * cos, a * b / square), Vector::<3>::new(-a * cos, -b * sin, bend)]
    }

    /// The distance of a place from the exact position with the same direction.
    pub(super) fn distance(&self, x: &Vector<3>, time: f64) -> f64 {
        (x - self.place(self.parameter(x[2]), time)).norm()
    }

    /// Points of the exact front about `spacing` apart at the start.
    pub(super) fn points(&self, spacing: f64, time: f64) -> Vec<Vector<3>> {
        let number = self.number(spacing);
        (0..=number).map(|k| self.place(TURN * k as f64 / number as f64, time)).collect()
    }

    fn number(&self, spacing: f64) -> usize {
        (self.length() / spacing).ceil().max(64.0) as usize
    }

    /// A bound of the curve's length at the start, by how fast places and directions change.
    #[must_use]
    pub fn length(&self) -> f64 {
        let [a, b] = self.semi_axes;
        TURN * (a.max(b) + a.max(b) / a.min(b))
    }

    /// The corners of a box about the curve until a time.
    #[must_use]
    pub fn bounding_box(&self, time: f64) -> (Vector<3>, Vector<3>) {
        let way = (self.speed * time).abs();
        let reach = Vector::<3>::new(self.semi_axes[0] + way, self.semi_axes[1] + way, TURN);
        let center = Vector::<3>::new(self.center[0], self.center[1], TURN);
        (center - reach, center + reach)
    }

    /// The foot points of all grid points within the tube, and the two ends of the curve.
    #[must_use]
    pub fn foot_points(&self, grid: &Grid, method: &FrontMethod) -> FootPoints<3> {
        let radius = method.tube_radius * grid.spacing;
        let mut near: Vec<(Node, f64)> = Vec::new();
        for x in self.points(grid.spacing / TUNING.starts_per_spacing, 0.0) {
            let corner = |side: f64| grid.nearest(&x.add_scalar(side), 0);
            let (Some(low), Some(high)) = (corner(-TUNING.box_radius * radius), corner(TUNING.box_radius * radius))
            else {
                continue;
            };
            Grid::for_each_in(&low, &high, |at| {
                let p = grid.center(at, 0);
                if let Some(phi) = self.closest(&p, self.parameter(x[2]))
                    && (p - self.place(phi, 0.0)).norm() <= radius
                {
                    near.push((Grid::node(at, 0), phi));
                }
            });
        }
        let distance = |(node, phi): &(Node, f64)| (grid.place::<3>(*node) - self.place(*phi, 0.0)).norm();
        near.sort_by(|a, b| a.0.cmp(&b.0).then(distance(a).total_cmp(&distance(b))));
        near.dedup_by_key(|(node, _)| *node);
        for phi in [0.0, TURN] {
            near.extend(grid.nearest(&self.place(phi, 0.0), 0).map(|at| (Grid::node(&at, 0), phi)));
        }
        let mut feet = FootPoints::default();
        for (node, phi) in near {
            let [first, second] = self.derivatives(phi);
            let square = first.norm_squared();
            let across = second - first * (second.dot(&first) / square);
            let foot = FootPoint {
                position: self.place(phi, 0.0),
                normal: first / square.sqrt(),
                curvature: across.norm() / square,
                gauss_curvature: 0.0,
                part: 0,
                parameter: phi / TURN,
            };
            feet.push(node, &foot);
        }
        feet
    }

    /// The parameter of the closest point at time 0; None outside the one turn.
    fn closest(&self, p: &Vector<3>, start: f64) -> Option<f64> {
        let mut phi = start;
        for _ in 0..TUNING.most_iterations {
            let rest = self.place(phi, 0.0) - p;
            let [first, second] = self.derivatives(phi);
            let slope = first.norm_squared();
            let bend = slope + rest.dot(&second);
            let step = rest.dot(&first) / if bend > TUNING.least_bend * slope { bend } else { slope };
            phi -= step;
            if step.abs() <= TUNING.still * (1.0 + phi.abs()) {
                break;
            }
        }
        (0.0..=TURN).contains(&phi).then_some(phi)
    }
}

#[cfg(test)]
mod tests {
    use super::{EllipticalWavefront, TURN};
    use std::f64::consts::PI;

    const FRONT: EllipticalWavefront =
        EllipticalWavefront { center: [0.1, -0.2], semi_axes: [0.6 * PI, 0.3 * PI], speed: 1.0 };

    #[test]
    fn directions_are_inner_normals_and_turn_once() {
        for k in 0..=20 {
            let phi = TURN * f64::from(k) / 20.0;
            let theta = FRONT.direction(phi);
            let inward = (-phi.cos() / FRONT.semi_axes[0], -phi.sin() / FRONT.semi_axes[1]);
            let length = inward.0.hypot(inward.1);
            assert!((theta.cos() - inward.0 / length).abs() < 1e-14 && (theta.sin() - inward.1 / length).abs() < 1e-14);
            assert!((FRONT.parameter(theta) - phi).abs() < 1e-13);
        }
        assert!((FRONT.direction(TURN) - FRONT.direction(0.0) - TURN).abs() < 1e-14);
    }

    #[test]
    fn derivatives_are_those_of_places() {
        let (phi, e) = (0.7, 1e-5);
        let [first, second] = FRONT.derivatives(phi);
        let [before, at, after] = [phi - e, phi, phi + e].map(|phi| FRONT.place(phi, 0.0));
        assert!(((after - before) / (2.0 * e) - first).norm() < 1e-9);
        assert!(((after - at * 2.0 + before) / (e * e) - second).norm() < 1e-4);
    }
}
