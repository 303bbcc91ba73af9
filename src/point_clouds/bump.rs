//! A plane with a bump (Surface DC-PSE, section 4.4): the graph u(x) = α ζ(‖x − p‖/r) over [−2, 2]².
//!
//! Here p = (−0.5, 0), r = 0.25, and ζ(d) = exp(−1/(1 − d²)) is truncated at d = 0.975. Points are dense where the bump
//! is curved.

use crate::geometry::{Vector, fibonacci};

/// A plane with a bump of a given height.
///
/// ```
/// let bump = meniscus::point_clouds::Bump { height: 1.0 };
/// let top = bump.above(-0.5, 0.0);
/// assert!((top.point[2] - (-1.0_f64).exp()).abs() < 1e-15);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bump {
    /// Factor α of ζ.
    pub height: f64,
}

/// Half the side of the square.
pub const HALF_SIDE: f64 = 2.0;
/// Center p of the bump in the plane.
pub const CENTER: [f64; 2] = [-0.5, 0.0];
/// Radius r of the bump.
pub const RADIUS: f64 = 0.25;
/// Ratio of the spacing to the smallest radius of curvature, at the reference spacing.
const SPACING_PER_CURVATURE_RADIUS: f64 = 0.45;
/// The paper's spacing of the lattice. Finer clouds are finer by the same factor everywhere.
const REFERENCE_SPACING: f64 = 1.0 / 32.0;
/// Smallest ratio of the spacing on the bump to that of the lattice.
const MIN_RATIO: f64 = 0.1;
/// Change of the spacing per length along the surface.
const GRADE: f64 = 0.1;
/// Radius of the graded points. Spacings there equal those of the lattice, and no initial field around the origin is
/// cut.
const OUTER: f64 = 0.7;
/// Gap between the graded points and the nodes of the lattice, in spacings.
const GAP: f64 = 0.35;
/// Number of annuli for the quadrature of the area.
const RINGS: usize = 4000;
/// Number of parts of a cell along each axis for the quadrature of the areas next to the graded points.
const PARTS: usize = 16;
/// Argument at which ζ is truncated. It is exp(−20) there.
const TRUNCATION: f64 = 0.975;

/// The function ζ with its first two derivatives.
fn zeta(d: f64) -> [f64; 3] {
    if d >= TRUNCATION {
        return [0.0; 3];
    }
    let rest = 1.0 - d * d;
    let value = (-1.0 / rest).exp();
    // The derivatives follow from ln ζ = −1/(1 − d²).
    let first = -2.0 * d / (rest * rest);
    let second = -2.0 / (rest * rest) - 8.0 * d * d / rest.powi(3);
    [value, value * first, value * (first * first + second)]
}

/// A point of the surface with the exact geometry there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BumpPoint {
    /// Position of the point.
    pub point: Vector<3>,
    /// Upward unit normal n.
    pub normal: Vector<3>,
    /// Curvature ∇·n, the sum of the principal curvatures.
    pub curvature: f64,
    /// Gauss curvature, the product of the principal curvatures.
    pub gauss: f64,
}

impl Bump {
    /// Slope du/dρ of the profile at the distance ρ from p.
    fn slope(&self, rho: f64) -> f64 {
        self.height * zeta(rho / RADIUS)[1] / RADIUS
    }

    /// The point of the surface above (x, y).
    #[must_use]
    pub fn above(&self, x: f64, y: f64) -> BumpPoint {
        let (dx, dy) = (x - CENTER[0], y - CENTER[1]);
        let rho = dx.hypot(dy);
        let [value, first, second] = zeta(rho / RADIUS);
        let (value, first) = (self.height * value, self.height * first / RADIUS);
        let second = self.height * second / (RADIUS * RADIUS);
        let (ex, ey) = if rho > 0.0 { (dx / rho, dy / rho) } else { (1.0, 0.0) };
        // A surface of revolution has its principal directions along the profile and across it.
        let stretch = (1.0 + first * first).sqrt();
        let along = second / stretch.powi(3);
        let across = if rho > 0.0 { first / (rho * stretch) } else { second };
        BumpPoint {
            point: Vector::<3>::new(x, y, value),
            normal: Vector::<3>::new(-first * ex, -first * ey, 1.0) / stretch,
            curvature: -(along + across),
            gauss: along * across,
        }
    }

    /// Spacing of the points on the bump.
    fn grading(&self) -> Grading {
        let ring = OUTER / RINGS as f64;
        let at = |k: usize| self.above(CENTER[0] + k as f64 * ring, CENTER[1]);
        let mut spacing: Vec<f64> = (0..=RINGS)
            .map(|k| {
                // Principal curvatures from their sum and product.
                let (half, gauss) = (0.5 * at(k).curvature, at(k).gauss);
                let largest = half.abs() + (half * half - gauss).max(0.0).sqrt();
                (SPACING_PER_CURVATURE_RADIUS / (largest * REFERENCE_SPACING)).clamp(MIN_RATIO, 1.0)
            })
            .collect();
        // Two sweeps, inward and outward, bound the change of the spacing along the surface.
        let stretch = |k: usize| (1.0 + self.slope(k as f64 * ring).powi(2)).sqrt();
        let change = |k: usize| GRADE * ring * stretch(k) / REFERENCE_SPACING;
        for k in (0..RINGS).rev() {
            spacing[k] = spacing[k].min(spacing[k + 1] + change(k));
        }
        for k in 1..=RINGS {
            spacing[k] = spacing[k].min(spacing[k - 1] + change(k));
        }
        let density = |k: usize| std::f64::consts::TAU * k as f64 * ring * stretch(k);
        let (mut cumulated, mut area) = (vec![0.0], 0.0);
        for k in 0..RINGS {
            let points = |k: usize| density(k) / spacing[k].powi(2);
            cumulated.push(cumulated[k] + 0.5 * ring * (points(k) + points(k + 1)));
            area += 0.5 * ring * (density(k) + density(k + 1));
        }
        Grading { spacing, cumulated, area }
    }

    /// Number of lattice cells per side for about `count` points.
    #[must_use]
    pub fn cells(&self, count: u64) -> usize {
        let grading = self.grading();
        let squares = (2.0 * HALF_SIDE).powi(2) - std::f64::consts::PI * OUTER.powi(2) + grading.squares();
        // Half the cell of a node on the edge is outside.
        let cells = 2.0 * HALF_SIDE * (count as f64 / squares).sqrt();
        ((cells - 1.0).round() as usize).max(4)
    }

    /// Number of points for a lattice of `cells` per side: graded points and nodes.
    #[must_use]
    pub fn count(&self, cells: usize) -> u64 {
        let spacing = 2.0 * HALF_SIDE / cells as f64;
        let grading = self.grading();
        let clear = OUTER + GAP * spacing * grading.ratio(1.0);
        let nodes = ((cells + 1) as f64).powi(2) - std::f64::consts::PI * (clear / spacing).powi(2);
        (nodes + grading.squares() / (spacing * spacing)).round() as u64
    }

    /// The points of the surface.
    ///
    /// - `cells`: number of lattice cells per side. Where the surface is flat, points are nodes of the lattice. On the
    ///   bump they are graded Fibonacci points.
    /// - `probes`: positions (x, y) that must be points. Each replaces the nearest point.
    #[must_use]
    pub fn points(&self, cells: usize, probes: &[[f64; 2]]) -> BumpPoints {
        let spacing = 2.0 * HALF_SIDE / cells as f64;
        let grading = self.grading();
        let mut found = BumpPoints::default();
        let count = (grading.squares() / (spacing * spacing)).ceil() as usize;
        for x in fibonacci::surface_of_revolution(count, |s| grading.share(s), |s| (s * OUTER, 0.0)) {
            let ratio = grading.ratio(x[0].hypot(x[1]) / OUTER);
            found.points.push(self.above(CENTER[0] + x[0], CENTER[1] + x[1]));
            found.areas.push((ratio * spacing).powi(2));
            found.ratios.push(ratio);
        }
        let scale = grading.area / found.areas.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        found.areas.iter_mut().for_each(|area| *area *= scale);
        let gap = GAP * spacing * grading.ratio(1.0);
        let is_clear = |x: f64, y: f64| (x - CENTER[0]).hypot(y - CENTER[1]) >= OUTER + gap;
        let edge = |k: usize| if k == 0 || k == cells { 0.5 } else { 1.0 };
        let mut nodes = Vec::with_capacity((cells + 1) * (cells + 1));
        for i in 0..=cells {
            for j in 0..=cells {
                let at = |k: usize| -HALF_SIDE + k as f64 * spacing;
                let is_there = is_clear(at(i), at(j));
                nodes.push(is_there.then_some(found.points.len()));
                if is_there {
                    found.points.push(self.above(at(i), at(j)));
                    found.areas.push(edge(i) * edge(j) * spacing * spacing);
                    found.ratios.push(1.0);
                }
            }
        }
        distribute_rim_area(&mut found, &nodes, cells);
        for probe in probes {
            let probe = self.above(probe[0], probe[1]);
            let nearest = found.points.iter().enumerate().map(|(k, p)| (k, (p.point - probe.point).norm()));
            let (nearest, _) = nearest.fold((0, f64::INFINITY), |best, next| if next.1 < best.1 { next } else { best });
            // The probe replaces the nearest point.
            found.points[nearest] = probe;
        }
        found
    }
}

/// The points of a bump with their areas and spacings.
#[derive(Debug, Clone, Default)]
pub struct BumpPoints {
    /// Points with the exact geometry.
    pub points: Vec<BumpPoint>,
    /// Area that each point represents.
    pub areas: Vec<f64>,
    /// Ratio of the spacing around each point to that of the lattice.
    pub ratios: Vec<f64>,
}

/// Distribution of the points over rings of equal width in the plane.
struct Grading {
    /// Ratio of the spacing to that of the lattice, at each ring.
    spacing: Vec<f64>,
    /// Number of points up to each ring, times the area of a lattice cell.
    cumulated: Vec<f64>,
    /// Area of the surface over all rings.
    area: f64,
}

impl Grading {
    /// Number of all graded points, times the area of a lattice cell.
    fn squares(&self) -> f64 {
        self.cumulated.last().copied().unwrap_or(0.0)
    }

    /// Linear interpolation of values at the rings, for s in [0, 1] from the center to the outermost ring.
    fn interpolate(values: &[f64], s: f64) -> f64 {
        let rings = values.len() - 1;
        let place = s.clamp(0.0, 1.0) * rings as f64;
        let k = (place as usize).min(rings - 1);
        values[k] + (place - k as f64) * (values[k + 1] - values[k])
    }

    /// Ratio of the spacing to that of the lattice.
    fn ratio(&self, s: f64) -> f64 {
        Self::interpolate(&self.spacing, s)
    }

    /// Fraction of the graded points within s.
    fn share(&self, s: f64) -> f64 {
        Self::interpolate(&self.cumulated, s) / self.squares()
    }
}

/// Distributes the area of the plane next to the graded points, where lattice cells are cut, to the nearest nodes.
///
/// `nodes` are the points of the lattice nodes; None for nodes that the graded points replace.
fn distribute_rim_area(found: &mut BumpPoints, nodes: &[Option<usize>], cells: usize) {
    let spacing = 2.0 * HALF_SIDE / cells as f64;
    let at = |k: usize| -HALF_SIDE + k as f64 * spacing;
    let from_center = |x: f64, y: f64| (x - CENTER[0]).hypot(y - CENTER[1]);
    let is_near = |i: usize, j: usize| (from_center(at(i), at(j)) - OUTER).abs() < 1.5 * spacing;
    let rim: Vec<(usize, usize)> =
        (0..=cells).flat_map(|i| (0..=cells).map(move |j| (i, j))).filter(|(i, j)| is_near(*i, *j)).collect();
    for (i, j) in &rim {
        if let Some(k) = nodes[i * (cells + 1) + j] {
            found.areas[k] = 0.0;
        }
    }
    let part = spacing / PARTS as f64;
    for (i, j) in &rim {
        for (a, b) in (0..PARTS).flat_map(|a| (0..PARTS).map(move |b| (a, b))) {
            let x = at(*i) - 0.5 * spacing + (a as f64 + 0.5) * part;
            let y = at(*j) - 0.5 * spacing + (b as f64 + 0.5) * part;
            if from_center(x, y) < OUTER {
                continue;
            }
            let mut nearest = (None, f64::INFINITY);
            for (m, n) in (i.saturating_sub(2)..=(i + 2).min(cells))
                .flat_map(|m| (j.saturating_sub(2)..=(j + 2).min(cells)).map(move |n| (m, n)))
            {
                let distance = (x - at(m)).hypot(y - at(n));
                if let Some(k) = nodes[m * (cells + 1) + n]
                    && distance < nearest.1
                {
                    nearest = (Some(k), distance);
                }
            }
            if let (Some(k), _) = nearest {
                found.areas[k] += part * part;
            }
        }
    }
}

/// Mirror images across the edges of the square, of points within `cutoff` of an edge.
///
/// Each image is its position with the index of the mirrored point.
#[must_use]
pub fn images(points: &[Vector<3>], cutoff: f64) -> Vec<(Vector<3>, u32)> {
    let mut found = Vec::new();
    for (k, x) in points.iter().enumerate() {
        // The mirrored coordinate, if an edge is near and the point does not lie on it.
        let mirrored = |c: f64| {
            let edge = HALF_SIDE.copysign(c);
            let gap = (edge - c).abs();
            (gap > 1e-12 && gap < cutoff).then_some(2.0 * edge - c)
        };
        let across = [mirrored(x[0]), mirrored(x[1])];
        for (mx, my) in [(true, false), (false, true), (true, true)] {
            if let (Some(a), Some(b)) =
                (if mx { across[0] } else { Some(x[0]) }, if my { across[1] } else { Some(x[1]) })
            {
                found.push((Vector::<3>::new(a, b, x[2]), k as u32));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::{Bump, HALF_SIDE, images};
    use crate::geometry::Vector;

    #[test]
    fn normals_and_curvatures_are_those_of_differences() {
        let (bump, step) = (Bump { height: 1.0 }, 1e-4);
        for (x, y) in [(-0.45, 0.03), (-0.62, -0.1), (-0.5, 0.0), (1.0, 1.0)] {
            let at = |dx: f64, dy: f64| bump.above(x + dx, y + dy);
            let here = at(0.0, 0.0);
            let z = |dx: f64, dy: f64| at(dx * step, dy * step).point[2];
            let slope = [(z(1.0, 0.0) - z(-1.0, 0.0)) / (2.0 * step), (z(0.0, 1.0) - z(0.0, -1.0)) / (2.0 * step)];
            let normal = Vector::<3>::new(-slope[0], -slope[1], 1.0).normalize();
            assert!((normal - here.normal).norm() < 1e-5);
            // ∇·n over the plane: n does not depend on z.
            let n = |dx: f64, dy: f64| at(dx * step, dy * step).normal;
            let [dx, dy] = [(n(1.0, 0.0) - n(-1.0, 0.0)) / (2.0 * step), (n(0.0, 1.0) - n(0.0, -1.0)) / (2.0 * step)];
            assert!((dx[0] + dy[1] - here.curvature).abs() < 1e-3, "{} {}", dx[0] + dy[1], here.curvature);
        }
    }

    #[test]
    fn areas_add_up_and_images_mirror() {
        let bump = Bump { height: 0.0 };
        let found = bump.points(64, &[[-0.5, 0.0]]);
        // The rim is cut into parts of a sixteenth of a cell.
        assert!((found.areas.iter().sum::<f64>() - 16.0).abs() < 1e-3);
        let positions: Vec<_> = found.points.iter().map(|p| p.point).collect();
        let mirrored = images(&positions, 0.2);
        // Three rows beyond each edge, corners included: 65² nodes become 71².
        assert_eq!(mirrored.len(), 71 * 71 - 65 * 65);
        for (x, k) in mirrored {
            assert!(x[0].abs().max(x[1].abs()) > HALF_SIDE);
            assert!((x - positions[k as usize]).norm() < 0.4 * 2.0_f64.sqrt() + 1e-12);
        }
    }
}
