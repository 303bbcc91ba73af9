//! Laplacians on points that are neither even nor regular: independent points that keep a distance, and graded ones.

use super::support::column;
use super::{body, finished};
use meniscus::geometry::Vector;
use meniscus::geometry::random::CounterRandom;
use meniscus::scene::Cloud;
use serde_json::json;
use std::f64::consts::PI;

const WAVE: [f64; 3] = [1.429_198_7, -0.714_599_3, 2.143_798];

/// Independent points of a surface, each farther from all before than the lesser of their own distances.
fn scattered(
    candidates: impl Iterator<Item = Vector<3>>,
    distance: impl Fn(&Vector<3>) -> f64,
    most: usize,
) -> Vec<Vector<3>> {
    let mut points: Vec<(Vector<3>, f64)> = Vec::new();
    for x in candidates {
        let own = distance(&x);
        if points.iter().all(|(y, theirs)| (x - y).norm_squared() > own.min(*theirs).powi(2)) {
            points.push((x, own));
            if points.len() == most {
                break;
            }
        }
    }
    points.into_iter().map(|(x, _)| x).collect()
}

/// Independent points of the unit sphere.
fn on_sphere(count: i64) -> impl Iterator<Item = Vector<3>> {
    let random = CounterRandom::new(11);
    (0..count).map(move |k| {
        let (z, turn) = (random.symmetric(&[k, 0]), PI * random.symmetric(&[k, 1]));
        let radius = (1.0 - z * z).sqrt();
        Vector::<3>::new(radius * turn.cos(), radius * turn.sin(), z)
    })
}

/// Independent points of the torus (1, .4).
fn on_torus(count: i64) -> impl Iterator<Item = Vector<3>> {
    let random = CounterRandom::new(5);
    (0..count).filter_map(move |k| {
        let draw = |d: i64| random.symmetric(&[k, d]);
        let (around, along) = (PI * draw(0), PI * draw(1));
        let radius = 0.4_f64.mul_add(around.cos(), 1.0);
        // Areas grow with the distance from the axis.
        let is_kept = 0.7 * (draw(2) + 1.0) <= radius;
        is_kept.then(|| Vector::<3>::new(radius * along.cos(), radius * along.sin(), 0.4 * around.sin()))
    })
}

/// Relative error, root mean square, of the Laplacian of sin k·x; normal and curvature at a point are given.
fn error_of(points: &[Vector<3>], order: u64, geometry: impl Fn(&Vector<3>) -> (Vector<3>, f64)) -> f64 {
    let cloud = Cloud { positions: points.iter().map(|x| [x[0], x[1], x[2]]).collect(), ..Cloud::default() };
    let problem = json!({"type": "laplace_beltrami", "field": {"type": "plane_wave", "k": WAVE}});
    let method = json!({"type": "surface_dcpse", "order": order});
    let found = column(&*finished(&body(&json!({"problem": problem, "method": method})), &cloud), "value");
    assert_eq!(found.len(), points.len());
    let wave = Vector::<3>::from(WAVE);
    let (mut off, mut all) = (0.0, 0.0);
    for (x, found) in points.iter().zip(&found) {
        let (normal, curvature) = geometry(x);
        let (along, across) = (wave.dot(x), wave.dot(&normal));
        let exact = -(wave.norm_squared() - across * across) * along.sin() - curvature * across * along.cos();
        off += (found - exact).powi(2);
        all += exact * exact;
    }
    (off / all).sqrt()
}

fn sphere(x: &Vector<3>) -> (Vector<3>, f64) {
    (*x, 2.0)
}

fn torus(x: &Vector<3>) -> (Vector<3>, f64) {
    let from_axis = x[0].hypot(x[1]);
    let center = Vector::<3>::new(x[0] / from_axis, x[1] / from_axis, 0.0);
    ((x - center) / 0.4, 2.5 + (from_axis - 1.0) / (0.4 * from_axis))
}

/// A kind of `cases/surface/torus_10to1`.
#[test]
fn a_laplacian_holds_where_the_density_changes_tenfold() {
    let distance = |x: &Vector<3>| 0.036 * (1.0 + (10.0_f64.sqrt() - 1.0) * (0.5 + x[0] / 2.8));
    let points = scattered(on_torus(120_000), distance, usize::MAX);
    assert!((2200..2600).contains(&points.len()), "{}", points.len());
    let error = error_of(&points, 2, torus);
    assert!(error < 1e-2, "{error}");
}

/// A kind of `cases/surface/diffusion_bluenoise`: 4,000 independent points at least .3 of their spacing apart.
#[test]
fn laplacians_hold_on_points_that_keep_a_distance() {
    let spacing = (4.0 * PI / 4000.0_f64).sqrt();
    let points = scattered(on_sphere(100_000), |_| 0.3 * spacing, 4000);
    assert_eq!(points.len(), 4000);
    for (order, most) in [(2, 9e-3), (4, 1.3e-4), (6, 4e-6)] {
        let error = error_of(&points, order, sphere);
        assert!(error < most, "order {order}: {error}");
    }
}

/// Densities that differ by a factor of fifty.
#[test]
fn laplacians_hold_where_the_density_changes_fiftyfold() {
    let distance = |x: &Vector<3>| 0.0187 * 50.0_f64.sqrt().powf(0.5 * (x[2] + 1.0));
    let points = scattered(on_sphere(200_000), distance, usize::MAX);
    assert!((4800..6000).contains(&points.len()), "{}", points.len());
    for (order, most) in [(2, 9e-3), (4, 5e-4)] {
        let error = error_of(&points, order, sphere);
        assert!(error < most, "order {order}: {error}");
    }
}
