//! Surfaces as points with exact normals and curvatures, by how they are spread.

use super::spec::{SamplingWord, SurfacePde};
use crate::geometry::random::CounterRandom;
use crate::geometry::surfaces::{Ellipsoid, Torus};
use crate::geometry::{Surface, Vector, fibonacci};
use crate::parallel::Interrupt;
use crate::point_clouds::{Bump, bump, relaxation};
use crate::schemes::surface_equation::SurfaceCloud;
use crate::spec::{Parameter, Violation, Word};
use serde_json::{Value, json};
use std::f64::consts::{PI, TAU};

/// A surface about the origin.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Shape {
    Circle {
        radius: f64,
    },
    Ellipsoid(Ellipsoid<3>),
    Torus(Torus),
    Bump(Bump),
    /// Points that come from a file or an upload.
    Points(Extent),
}

/// What lengths of points from outside are, about.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Extent {
    dimension: usize,
    /// Length of a curve, area of a surface.
    measure: f64,
    /// The largest distance from the middle of their box.
    reach: f64,
    /// Where the cap begins.
    cap: f64,
    /// Whether these are lengths of the points. Before they are read those of the unit sphere or circle stand here.
    pub is_known: bool,
}

/// The part of the points along their last axis (a curve's first) that is below the cap.
const BELOW_CAP: f64 = 0.9;

impl Extent {
    /// Of points with a length or area.
    pub fn of<const D: usize>(points: &[Vector<D>], measure: f64) -> Self {
        let low = points.iter().fold(Vector::<D>::repeat(f64::INFINITY), |low, x| low.inf(x));
        let high = points.iter().fold(Vector::<D>::repeat(f64::NEG_INFINITY), |high, x| high.sup(x));
        let middle = 0.5 * (low + high);
        let axis = if D == 3 { 2 } else { 0 };
        Self {
            dimension: D,
            measure,
            reach: points.iter().map(|x| (x - middle).norm()).fold(0.0, f64::max),
            cap: low[axis] + BELOW_CAP * (high[axis] - low[axis]),
            is_known: true,
        }
    }

    /// Stands for points that are not read yet.
    pub fn unknown(dimension: usize) -> Self {
        let measure = if dimension == 2 { TAU } else { 4.0 * PI };
        Self { dimension, measure, reach: 1.0, cap: 2.0 * BELOW_CAP - 1.0, is_known: false }
    }
}

/// How points are spread.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sampling {
    /// At equal angles, or on a lattice.
    Regular,
    /// Equal areas, turned by the golden angle.
    Fibonacci,
    /// At random, relaxed or not.
    Random { is_relaxed: bool },
    /// Where the file has them.
    Given,
}

/// Points of a surface whose number is not given, and before points from outside are read.
pub(super) const DEFAULT_COUNT: u64 = 4000;

/// Places of a bump whose values go into the series (Surface DC-PSE, section 4.4).
const BUMP_PROBES: [[f64; 2]; 2] = [[-0.5, 0.0], [-0.25 * std::f64::consts::SQRT_2, 0.25 * std::f64::consts::SQRT_2]];

impl Shape {
    pub fn is_curve(&self) -> bool {
        self.dimension() == 2
    }

    /// Of the space that it lies in.
    pub fn dimension(&self) -> usize {
        match self {
            Self::Circle { .. } => 2,
            Self::Points(extent) => extent.dimension,
            _ => 3,
        }
    }

    /// The length, or the area: of an ellipsoid by Knud Thomsen's formula to about one per cent (it sets a length alone), of
    /// a bump that of its square.
    fn measure(&self) -> f64 {
        match self {
            Self::Circle { radius } => TAU * radius,
            Self::Ellipsoid(Ellipsoid { semi_axes, .. }) => {
                let [a, b, c] = (*semi_axes).into();
                let p = 1.6075;
                let mean = ((a * b).powf(p) + (a * c).powf(p) + (b * c).powf(p)) / 3.0;
                4.0 * PI * mean.powf(1.0 / p)
            }
            Self::Torus(torus) => 4.0 * PI * PI * torus.major_radius * torus.minor_radius,
            Self::Bump(_) => (2.0 * bump::HALF_SIDE).powi(2),
            Self::Points(extent) => extent.measure,
        }
    }

    /// δn: the arc, or the side of the square, that a point has for itself.
    pub fn spacing(&self, count: u64) -> f64 {
        match self {
            _ if self.is_curve() => self.measure() / count as f64,
            Self::Bump(bump) => 2.0 * bump::HALF_SIDE / bump.cells(count) as f64,
            _ => (self.measure() / count as f64).sqrt(),
        }
    }

    /// Points that it has where so many are asked for, about.
    pub fn points(&self, count: u64) -> u64 {
        if let Self::Bump(bump) = self { bump.count(bump.cells(count)) } else { count }
    }

    /// The least eigenvalue of Δ_S that is not zero, about: of a sphere of the same area, or a circle of the same length.
    pub fn least_eigenvalue(&self) -> f64 {
        match self {
            Self::Circle { radius } => -1.0 / (radius * radius),
            _ if self.is_curve() => -(TAU / self.measure()).powi(2),
            _ => -8.0 * PI / self.measure(),
        }
    }

    /// The radius of a circle or sphere.
    pub fn radius(&self) -> Option<f64> {
        match self {
            Self::Circle { radius } => Some(*radius),
            Self::Ellipsoid(Ellipsoid { semi_axes, .. }) if semi_axes.max() == semi_axes.min() => Some(semi_axes[0]),
            _ => None,
        }
    }

    /// The least eigenvalues of −Δ_S, so many of them, where they are known: l(l + 1)/R² on a sphere, 2 l + 1 times each;
    /// m²/R² on a circle, twice each but for the first.
    pub fn eigenvalues(&self, count: usize) -> Vec<f64> {
        let Some(radius) = self.radius() else { return Vec::new() };
        let repeated = |l: usize| {
            let (value, times) = if self.is_curve() { (l * l, 2.min(l + 1)) } else { (l * (l + 1), 2 * l + 1) };
            std::iter::repeat_n(value as f64 / (radius * radius), times)
        };
        (0..).flat_map(repeated).take(count).collect()
    }

    /// A length that all of the surface is within, about the origin or the middle of points.
    pub fn reach(&self) -> f64 {
        match self {
            Self::Circle { radius } => *radius,
            Self::Ellipsoid(ellipsoid) => ellipsoid.semi_axes.max(),
            Self::Torus(torus) => torus.major_radius + torus.minor_radius,
            Self::Bump(_) => bump::HALF_SIDE,
            Self::Points(extent) => extent.reach,
        }
    }

    /// The length that errors go by: the least radius of the surface, where it has one.
    pub fn size(&self) -> f64 {
        match self {
            Self::Ellipsoid(ellipsoid) => ellipsoid.semi_axes.min(),
            Self::Torus(torus) => torus.minor_radius,
            other => other.reach(),
        }
    }

    /// The exact unit normal at a point of it, z = 0 of a circle; nothing is known of points.
    pub fn normal(&self, x: &Vector<3>) -> Option<Vector<3>> {
        Some(match self {
            Self::Circle { .. } => x.normalize(),
            Self::Ellipsoid(ellipsoid) => ellipsoid.normal_and_curvature(x).0,
            Self::Torus(torus) => torus.nearest(x).normal.unwrap_or_default(),
            Self::Bump(bump) => bump.above(x[0], x[1]).normal,
            Self::Points(_) => return None,
        })
    }

    /// Whether a point, z = 0 of a circle, lies in the cap about the z axis, of a circle about the x axis, or on the top of the bump,
    /// which is also there when it is flat.
    pub fn is_on_cap(&self, x: &Vector<3>) -> bool {
        let cap = |along: f64, top: f64| along > 0.8 * top;
        match self {
            Self::Circle { radius } => cap(x[0], *radius),
            Self::Ellipsoid(ellipsoid) => cap(x[2], ellipsoid.semi_axes[2]),
            Self::Torus(torus) => cap(x[2], torus.minor_radius),
            Self::Points(extent) => x[if extent.dimension == 2 { 0 } else { 2 }] > extent.cap,
            Self::Bump(_) => (x[0] - bump::CENTER[0]).hypot(x[1] - bump::CENTER[1]) < 0.5 * bump::RADIUS,
        }
    }

    /// The surface in space with its closest points, where it has them exactly.
    pub fn in_space(&self) -> Option<&dyn Surface<3>> {
        match self {
            Self::Ellipsoid(ellipsoid) => Some(ellipsoid),
            Self::Torus(torus) => Some(torus),
            Self::Circle { .. } | Self::Bump(_) | Self::Points(_) => None,
        }
    }
}

/// How points are spread; the spec gets what was left open. Points from outside are what they are.
pub(super) fn sampling(spec: &mut SurfacePde, shape: &Shape, errors: &mut Vec<Violation>) -> Sampling {
    if let Shape::Points(_) = shape {
        for (name, given) in [("count", spec.count.to_json()), ("sampling", spec.sampling.to_json())] {
            if !given.is_null() {
                let detail = "number and places of points from outside are those of the file";
                errors.push(Violation::new(format!("/{name}"), "conflict", detail, given, Value::Null));
            }
        }
        return Sampling::Given;
    }
    let (allowed, detail): (&[SamplingWord], &str) = match shape {
        Shape::Circle { .. } => {
            (&[SamplingWord::Regular, SamplingWord::Random, SamplingWord::RandomRaw], "not on this surface")
        }
        Shape::Bump(_) => (&[SamplingWord::Regular], "not on this surface"),
        _ => (&[SamplingWord::Fibonacci, SamplingWord::Random, SamplingWord::RandomRaw], "this surface has no lattice"),
    };
    let chosen = *spec.sampling.get_or_insert(allowed[0]);
    if !allowed.contains(&chosen) {
        let names: Vec<&str> = allowed.iter().map(|word| word.word()).collect();
        errors.push(Violation::new("/sampling", "conflict", detail, chosen.word(), json!(names)));
    }
    spec.count.get_or_insert(DEFAULT_COUNT);
    match chosen {
        SamplingWord::Regular => Sampling::Regular,
        SamplingWord::Random => Sampling::Random { is_relaxed: true },
        SamplingWord::RandomRaw => Sampling::Random { is_relaxed: false },
        SamplingWord::Fibonacci => Sampling::Fibonacci,
    }
}

/// Points of a circle.
pub(super) fn circle(radius: f64, count: usize, sampling: Sampling, seed: u64) -> SurfaceCloud<2> {
    let random = CounterRandom::new(seed);
    let mut angles: Vec<f64> = (0..count)
        .map(|i| match sampling {
            Sampling::Random { .. } => PI * random.symmetric(&[i as i64]),
            _ => TAU * i as f64 / count as f64,
        })
        .collect();
    angles.sort_by(f64::total_cmp);
    if let Sampling::Random { is_relaxed: true } = sampling {
        // Neighbours' middles, a few times over: gaps become more alike.
        for _ in 0..3 {
            let before = angles.clone();
            for (i, angle) in angles.iter_mut().enumerate() {
                let low = if i == 0 { before[count - 1] - TAU } else { before[i - 1] };
                let high = if i + 1 == count { before[0] + TAU } else { before[i + 1] };
                *angle = 0.5 * before[i] + 0.25 * (low + high);
            }
        }
    }
    let normals: Vec<_> = angles.iter().map(|a| Vector::<2>::new(a.cos(), a.sin())).collect();
    SurfaceCloud {
        points: normals.iter().map(|n| n * radius).collect(),
        normals,
        rows: count,
        curvatures: vec![1.0 / radius; count],
        gauss: vec![0.0; count],
        areas: (sampling == Sampling::Regular).then(|| vec![TAU * radius / count as f64; count]),
        ..SurfaceCloud::default()
    }
}

/// Points of a surface in space; `reach` is the support's, for the images of a surface with edges.
pub(super) fn in_space(
    shape: &Shape,
    count: u64,
    sampling: Sampling,
    seed: u64,
    reach: f64,
    interrupt: &Interrupt,
) -> SurfaceCloud<3> {
    if let Shape::Bump(bump) = shape {
        return with_edges(*bump, count, reach);
    }
    let Some(surface) = shape.in_space() else { return SurfaceCloud::default() };
    let points = sample(shape, surface, (count, sampling, seed), interrupt);
    let mut cloud = SurfaceCloud { rows: points.len(), ..SurfaceCloud::default() };
    for x in &points {
        let (normal, curvature, gauss) = exact_geometry(shape, x);
        cloud.normals.push(normal);
        cloud.curvatures.push(curvature);
        cloud.gauss.push(gauss);
    }
    let is_even = sampling == Sampling::Fibonacci
        && match shape {
            Shape::Ellipsoid(ellipsoid) => ellipsoid.semi_axes.max() == ellipsoid.semi_axes.min(),
            _ => true,
        };
    cloud.areas = is_even.then(|| vec![shape.measure() / count as f64; count as usize]);
    cloud.points = points;
    cloud
}

/// Points on a surface, as they are to be spread.
fn sample(
    shape: &Shape,
    surface: &dyn Surface<3>,
    (count, sampling, seed): (u64, Sampling, u64),
    interrupt: &Interrupt,
) -> Vec<Vector<3>> {
    let number = count as usize;
    match (sampling, shape) {
        (Sampling::Random { is_relaxed }, _) => {
            let (low, high) = surface.bounding_box();
            // A shell as thin as the drawing of points allows.
            let mut points = relaxation::random_points(surface, number, 0.02 * (high - low).min(), seed, interrupt);
            if is_relaxed {
                relaxation::relax(&mut points, shape.spacing(count), |x| surface.nearest(x).point, interrupt);
            }
            points
        }
        (_, Shape::Torus(torus)) => {
            let (major, minor) = (torus.major_radius, torus.minor_radius);
            let share = |s: f64| s + minor / major * (TAU * s).sin() / TAU;
            let profile = |s: f64| (major + minor * (TAU * s).cos(), minor * (TAU * s).sin());
            fibonacci::surface_of_revolution(number, share, profile)
        }
        (_, Shape::Ellipsoid(ellipsoid)) => {
            fibonacci::sphere(number).into_iter().map(|u| u.component_mul(&ellipsoid.semi_axes)).collect()
        }
        _ => Vec::new(),
    }
}

/// Outward normal, mean and Gauss curvature of a surface at one of its points; NaN where they are not known exactly.
fn exact_geometry(shape: &Shape, x: &Vector<3>) -> (Vector<3>, f64, f64) {
    match shape {
        Shape::Ellipsoid(ellipsoid) => {
            let (normal, curvature) = ellipsoid.normal_and_curvature(x);
            (normal, curvature, ellipsoid.gauss_curvature(x))
        }
        Shape::Torus(torus) => {
            let nearest = torus.nearest(x);
            (nearest.normal.unwrap_or_default(), nearest.curvature.unwrap_or(f64::NAN), torus.gauss_curvature(x))
        }
        _ => (Vector::<3>::zeros(), f64::NAN, f64::NAN),
    }
}

/// A bump with the images of what lies within reach of its edges.
fn with_edges(bump: Bump, count: u64, reach: f64) -> SurfaceCloud<3> {
    let found = bump.points(bump.cells(count), &BUMP_PROBES);
    let at = |place: &[f64; 2]| found.points.iter().position(|p| p.point[0] == place[0] && p.point[1] == place[1]);
    let mut cloud = SurfaceCloud {
        points: found.points.iter().map(|p| p.point).collect(),
        normals: found.points.iter().map(|p| p.normal).collect(),
        rows: found.points.len(),
        curvatures: found.points.iter().map(|p| p.curvature).collect(),
        gauss: found.points.iter().map(|p| p.gauss).collect(),
        probes: BUMP_PROBES.iter().filter_map(at).collect(),
        source: (0..found.points.len() as u32).collect(),
        scales: found.ratios,
        areas: Some(found.areas),
        ..SurfaceCloud::default()
    };
    // Supports may grow two and a half times.
    for (image, source) in bump::images(&cloud.points, 2.5 * reach) {
        cloud.points.push(image);
        cloud.normals.push(Vector::<3>::z());
        cloud.source.push(source);
    }
    cloud
}

#[cfg(test)]
mod tests {
    use super::{Bump, Ellipsoid, PI, Sampling, Shape, TAU, circle, in_space};
    use crate::geometry::{Surface, Vector};
    use crate::parallel::Interrupt;

    #[test]
    fn points_lie_on_the_surface_and_know_it() {
        let surface = Ellipsoid { center: Vector::<3>::zeros(), semi_axes: Vector::<3>::new(1.0, 0.8, 0.75) };
        for sampling in [Sampling::Fibonacci, Sampling::Random { is_relaxed: true }] {
            let found = in_space(&Shape::Ellipsoid(surface.clone()), 200, sampling, 1, 0.1, &Interrupt::default());
            for ((x, n), curvature) in found.points.iter().zip(&found.normals).zip(&found.curvatures) {
                let nearest = surface.nearest(x);
                assert!(nearest.distance.abs() < 1e-12 && (nearest.normal.unwrap() - n).norm() < 1e-9);
                assert!((nearest.curvature.unwrap() - curvature).abs() < 1e-8);
            }
        }
        let sphere = Shape::Ellipsoid(Ellipsoid { center: Vector::<3>::zeros(), semi_axes: Vector::<3>::repeat(2.0) });
        assert!((sphere.measure() - 16.0 * PI).abs() < 1e-12);
    }

    #[test]
    fn a_bump_has_about_the_points_asked_for_and_both_probes() {
        // Of few points of a high bump most are more than were asked for: the lattice has four cells a side at least.
        for (height, count) in [(0.0, 18_400), (1.0, 18_400), (2.0, 18_400), (10.0, 18_400), (10.0, 60), (0.0, 20)] {
            let shape = Shape::Bump(Bump { height });
            let cloud = in_space(&shape, count, Sampling::Regular, 1, shape.spacing(count), &Interrupt::default());
            if count > 100 {
                assert!((18_000..18_800).contains(&cloud.rows), "α = {height}: {}", cloud.rows);
                // Of a few points both probes may ask for the place of one.
                assert_eq!(cloud.probes.len(), 2);
            }
            let estimated = shape.points(count) as f64;
            // Of a lattice of four cells a side the circle that is left out takes nodes by ones.
            let off = (estimated - cloud.rows as f64).abs();
            assert!(off < 2.5 + 0.02 * estimated, "α = {height}: {estimated} for {}", cloud.rows);
            assert!(cloud.points.len() > cloud.rows && cloud.source.len() == cloud.points.len());
        }
    }

    #[test]
    fn circles_are_spread_by_angle() {
        for sampling in [Sampling::Regular, Sampling::Random { is_relaxed: true }] {
            let cloud = circle(2.0, 50, sampling, 3);
            assert!(cloud.points.iter().all(|x| (x.norm() - 2.0).abs() < 1e-14));
            let mut angles: Vec<f64> = cloud.points.iter().map(|x| x[1].atan2(x[0])).collect();
            angles.sort_by(f64::total_cmp);
            let gap = |i: usize| (angles[(i + 1) % 50] - angles[i]).rem_euclid(TAU);
            let largest = (0..50).map(gap).fold(0.0, f64::max);
            // Even ones are a fiftieth of the circle; random ones leave gaps of ln 50 times that.
            let most = if sampling == Sampling::Regular { 1.0 + 1e-9 } else { 50.0_f64.ln() };
            assert!(largest <= most * TAU / 50.0, "{sampling:?}: {largest}");
        }
    }
}
