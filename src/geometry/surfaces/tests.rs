//! Properties of every shape, each checked independently of the formulas of the shape.

use super::{Ball, Cuboid, Dumbbell, Ellipsoid, RoundedCuboid, Surface, Torus, Union, Vector, ZalesakDisk};
use crate::geometry::block::indices;
use crate::geometry::random::CounterRandom;

mod composed;
mod implicit;

fn plane_shapes() -> Vec<(&'static str, Box<dyn Surface<2>>)> {
    let at = Vector::<2>::new;
    let parts: Vec<Box<dyn Surface<2>>> = vec![
        Box::new(Ball { center: at(-0.6, 0.1), radius: 0.3 }),
        Box::new(Cuboid { center: at(0.5, 0.0), size: at(0.4, 0.6) }),
    ];
    let known: Vec<(&'static str, Box<dyn Surface<2>>)> = vec![
        ("circle", Box::new(Ball { center: at(0.1, -0.2), radius: 0.7 })),
        ("ellipse", Box::new(Ellipsoid { center: at(0.05, 0.1), semi_axes: at(0.75, 0.5) })),
        ("flat ellipse", Box::new(Ellipsoid { center: at(0.0, 0.0), semi_axes: at(0.2, 0.9) })),
        ("box", Box::new(Cuboid { center: at(0.1, 0.1), size: at(1.2, 0.8) })),
        ("rounded box", Box::new(RoundedCuboid { center: at(0.0, 0.1), size: at(1.2, 0.8), corner_radius: 0.15 })),
        ("zalesak disk", Box::new(ZalesakDisk::new(at(0.0, 0.0), 0.75, 0.25, 1.25))),
        ("dumbbell", Box::new(Dumbbell::new(at(0.0, 0.0), 1.0, 0.4, 0.15))),
        ("union", Box::new(Union::new(parts).unwrap())),
    ];
    known.into_iter().chain(composed::plane_shapes()).chain(implicit::plane_shapes()).collect()
}

fn solid_shapes() -> Vec<(&'static str, Box<dyn Surface<3>>)> {
    let at = Vector::<3>::new;
    let known: Vec<(&'static str, Box<dyn Surface<3>>)> = vec![
        ("sphere", Box::new(Ball { center: at(0.1, -0.2, 0.0), radius: 0.7 })),
        ("ellipsoid", Box::new(Ellipsoid { center: at(0.05, 0.1, 0.0), semi_axes: at(0.75, 0.5, 0.5) })),
        ("triaxial", Box::new(Ellipsoid { center: at(0.0, 0.0, 0.0), semi_axes: at(0.4, 0.9, 0.6) })),
        ("box", Box::new(Cuboid { center: at(0.1, 0.1, 0.0), size: at(1.2, 0.8, 1.0) })),
        (
            "rounded box",
            Box::new(RoundedCuboid { center: at(0.0, 0.1, 0.0), size: at(1.2, 0.8, 1.0), corner_radius: 0.15 }),
        ),
        ("torus", Box::new(Torus { center: at(0.0, 0.0, 0.1), major_radius: 0.6, minor_radius: 0.25 })),
        ("dumbbell", Box::new(Dumbbell::new(at(0.0, 0.0, 0.0), 1.0, 0.4, 0.15))),
    ];
    known.into_iter().chain(composed::solid_shapes()).chain(implicit::solid_shapes()).collect()
}

/// Query points spread over the cube [−1.2, 1.2]^D.
fn queries<const D: usize>(count: i64) -> Vec<Vector<D>> {
    let random = CounterRandom::new(11);
    (0..count).map(|i| Vector::<D>::from_fn(|d, _| 1.2 * random.symmetric(&[i, d as i64]))).collect()
}

fn check<const D: usize>(name: &str, surface: &dyn Surface<D>) {
    let eps = 1e-6;
    for x in queries::<D>(3000) {
        let answer = surface.nearest(&x);
        // The distance is that to the closest point, and the closest point lies on the surface.
        assert!((answer.distance.abs() - (x - answer.point).norm()).abs() < 1e-13, "{name} at {x:?}");
        assert!(surface.signed_distance(&answer.point).abs() < 1e-13, "{name}: foot of {x:?} is off the surface");
        if surface.near_medial_axis(&x, 1e-3) {
            continue;
        }
        // The gradient of the distance is a unit vector along x − cp, and equals the normal where there is one.
        let gradient = Vector::<D>::from_fn(|d, _| {
            let mut e = Vector::<D>::zeros();
            e[d] = eps;
            (surface.signed_distance(&(x + e)) - surface.signed_distance(&(x - e))) / (2.0 * eps)
        });
        assert!((gradient.norm() - 1.0).abs() < 1e-5, "{name} at {x:?}: |∇d| = {}", gradient.norm());
        if let Some(normal) = answer.normal {
            assert!((gradient - normal).norm() < 1e-4, "{name} at {x:?}: {gradient:?} against {normal:?}");
        }
        // The curvature is the divergence of the normal, by differences on the surface itself.
        if let (Some(_), Some(curvature)) = (answer.normal, answer.curvature) {
            let step = 1e-5;
            let at = answer.point;
            let mut divergence = 0.0;
            let mut defined = !surface.near_medial_axis(&at, 5e-3);
            for d in 0..D {
                let mut e = Vector::<D>::zeros();
                e[d] = step;
                let (ahead, behind) = (surface.nearest(&(at + e)), surface.nearest(&(at - e)));
                match (ahead.normal, behind.normal) {
                    (Some(p), Some(m)) => divergence += (p[d] - m[d]) / (2.0 * step),
                    _ => defined = false,
                }
                // Across a jump of the curvature the difference sees both sides.
                defined &= ahead.curvature == behind.curvature
                    || ahead.curvature.zip(behind.curvature).is_some_and(|(p, m)| (p - m).abs() < 1e-2);
            }
            if defined {
                let tolerance = 1e-4 * (1.0 + curvature * curvature);
                assert!((divergence - curvature).abs() < tolerance, "{name} at {x:?}: {divergence} for {curvature}");
            }
        }
    }
}

#[test]
fn closest_points_normals_and_curvatures_agree_with_the_distance() {
    for (name, surface) in plane_shapes() {
        check(name, surface.as_ref());
    }
    for (name, surface) in solid_shapes() {
        check(name, surface.as_ref());
    }
}

#[test]
fn no_point_of_the_outline_is_nearer_than_the_closest_point() {
    for (name, surface) in plane_shapes() {
        let chains = surface.outline(1e-3);
        for x in queries::<2>(200) {
            let nearest = chains.iter().flatten().map(|p| (p - x).norm()).fold(f64::INFINITY, f64::min);
            let exact = surface.signed_distance(&x).abs();
            assert!(nearest >= exact - 1e-12 && nearest < exact + 1e-3, "{name}: {nearest} for {exact}");
        }
    }
}

#[test]
fn outlines_enclose_the_area_with_the_inside_on_the_left() {
    for (name, surface) in plane_shapes() {
        let mut area = 0.0;
        for chain in surface.outline(1e-3) {
            for (a, b) in chain.iter().zip(&chain[1..]) {
                area += 0.5 * (a[0] * b[1] - a[1] * b[0]);
            }
        }
        assert!((area - surface.area_or_volume()).abs() < 1e-5, "{name}: {area} for {}", surface.area_or_volume());
    }
}

#[test]
fn volumes_agree_with_counted_points() {
    // One point at random in each cell: only cells that the surface crosses are counted by chance.
    fn count<const D: usize>(surface: &dyn Surface<D>) -> f64 {
        const SIDE: usize = 40;
        let random = CounterRandom::new(12);
        let place = |k: usize, d: usize| {
            let within = 0.5 + 0.5 * random.symmetric(&[k as i64, d as i64]);
            2.4 * ((indices(k, &[SIDE; D])[d] as f64 + within) / SIDE as f64 - 0.5)
        };
        let is_inside = |k: &usize| surface.signed_distance(&Vector::<D>::from_fn(|d, _| place(*k, d))) < 0.0;
        let count = SIDE.pow(D as u32);
        (0..count).filter(is_inside).count() as f64 / count as f64 * 2.4_f64.powi(D as i32)
    }
    for (name, surface) in solid_shapes() {
        // Four standard deviations: the surface crosses at most 6,000 cells.
        let (counted, exact) = (count(surface.as_ref()), surface.area_or_volume());
        assert!((counted - exact).abs() < 0.035, "{name}: {counted} for {exact}");
    }
}

#[test]
fn hard_queries_of_the_ellipse() {
    let ellipse = Ellipsoid { center: Vector::<2>::zeros(), semi_axes: Vector::<2>::new(0.75, 0.5) };
    assert!((ellipse.signed_distance(&Vector::<2>::zeros()) + 0.5).abs() < 1e-15);
    assert!((ellipse.signed_distance(&Vector::<2>::new(0.75, 0.0))).abs() < 1e-15);
    assert!((ellipse.signed_distance(&Vector::<2>::new(0.0, 2.0)) - 1.5).abs() < 1e-15);
    // On the long axis between the centers of curvature the closest points form a pair off the axis.
    let answer = ellipse.nearest(&Vector::<2>::new(0.2, 0.0));
    assert!((answer.point[0] - 0.2 * 0.5625 / 0.3125).abs() < 1e-14);
    assert!(answer.point[1].abs() > 0.3);
    for y in [1e-300, 1e-18, 1e-9] {
        let answer = ellipse.nearest(&Vector::<2>::new(0.2, y));
        assert!((answer.point[0] - 0.36).abs() < 1e-7, "{y}: {:?}", answer.point);
    }
    let circle = Ellipsoid { center: Vector::<2>::zeros(), semi_axes: Vector::<2>::new(0.5, 0.5) };
    assert!((circle.signed_distance(&Vector::<2>::new(1e-20, 0.0)) + 0.5).abs() < 1e-15);
}

#[test]
fn overlapping_parts_are_refused_by_name() {
    let parts: Vec<Box<dyn Surface<2>>> = vec![
        Box::new(Ball { center: Vector::<2>::zeros(), radius: 0.5 }),
        Box::new(Ball { center: Vector::<2>::new(0.9, 0.0), radius: 0.5 }),
    ];
    let message = Union::new(parts).err().map(|e| e.to_string());
    assert_eq!(message.as_deref(), Some("parts 0 and 1 overlap; a union takes separate shapes"));
}
