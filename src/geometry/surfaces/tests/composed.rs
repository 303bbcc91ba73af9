//! Intersections, differences, complements, polygons, and shapes that are placed.

use super::{queries, solid_shapes as all_solid_shapes};
use crate::geometry::Vector;
use crate::geometry::surfaces::{
    Ball, Cuboid, Dumbbell, Ellipsoid, Placement, Polygon, PolygonError, RoundedCuboid, Solid, Surface, Torus,
    ZalesakDisk,
};
use std::sync::Arc;

type Named<const D: usize> = (&'static str, Box<dyn Surface<D>>);

fn shape<const D: usize>(surface: impl Surface<D> + 'static) -> Solid<D> {
    Solid::Shape(Arc::new(surface))
}

fn without<const D: usize>(from: Solid<D>, minus: Solid<D>) -> Solid<D> {
    Solid::Intersection(vec![from, Solid::Complement(Box::new(minus))])
}

fn named<const D: usize>(name: &'static str, solid: &Solid<D>) -> Named<D> {
    (name, Box::new(solid.surface().unwrap()))
}

fn turned(angle: f64) -> Placement<2> {
    let rotation = Placement::rotation(angle, &Vector::<2>::zeros());
    Placement { rotation, scale: 1.1, shift: Vector::<2>::new(0.05, -0.1) }
}

fn turned_in_space(angle: f64) -> Placement<3> {
    let axis = Vector::<3>::new(1.0, 2.0, 2.0) / 3.0;
    Placement { rotation: Placement::rotation(angle, &axis), scale: 0.9, shift: Vector::<3>::new(0.05, -0.1, 0.0) }
}

/// A polygon that is not convex.
fn arrow() -> Polygon {
    let at = Vector::<2>::new;
    Polygon::new(vec![at(0.8, 0.1), at(-0.2, 0.7), at(0.1, 0.2), at(-0.8, 0.0), at(0.1, -0.1), at(-0.3, -0.8)]).unwrap()
}

pub(super) fn plane_shapes() -> Vec<Named<2>> {
    let at = Vector::<2>::new;
    let disk = |x: f64, radius: f64| shape(Ball { center: at(x, 0.0), radius });
    let rectangle = |w: f64, h: f64| shape(Cuboid { center: at(0.0, 0.05), size: at(w, h) });
    let lens = Solid::Intersection(vec![disk(-0.35, 0.7), disk(0.35, 0.7)]);
    let ring = without(disk(0.0, 0.8), disk(0.1, 0.4));
    let nested =
        without(Solid::Intersection(vec![rectangle(1.3, 1.0), disk(0.0, 0.7)]), lens.clone().placed(&turned(0.7)));
    let oval = shape(Ellipsoid { center: at(0.1, 0.0), semi_axes: at(0.8, 0.4) });
    vec![
        ("polygon", Box::new(arrow())),
        named("lens", &lens),
        named("crescent", &without(disk(-0.2, 0.7), disk(0.3, 0.5))),
        named("ring", &ring),
        named("hole", &Solid::Complement(Box::new(Solid::Complement(Box::new(ring.clone()))))),
        named("notched box", &without(rectangle(1.4, 1.0), rectangle(0.3, 2.0).placed(&turned(0.4)))),
        named("nested", &nested),
        named("turned lens", &lens.placed(&turned(1.1))),
        named("turned box", &rectangle(1.0, 0.6).placed(&turned(0.5))),
        named("cut polygon", &without(shape(arrow()), disk(0.3, 0.2))),
        named("cut ellipse", &without(oval, rectangle(0.4, 0.5).placed(&turned(0.3)))),
        named("cut slot", &without(shape(ZalesakDisk::new(at(0.0, 0.0), 0.75, 0.25, 1.0)), disk(0.7, 0.3))),
        named("cut neck", &without(shape(Dumbbell::new(at(0.0, 0.0), 1.0, 0.4, 0.15)), disk(0.0, 0.2))),
        named("flush", &without(rectangle(1.2, 1.0), shape(Cuboid { center: at(0.4, 0.05), size: at(0.4, 1.0) }))),
    ]
}

pub(super) fn solid_shapes() -> Vec<Named<3>> {
    let at = Vector::<3>::new;
    let ball = |x: f64, radius: f64| shape(Ball { center: at(x, 0.0, 0.0), radius });
    let cuboid = |a: f64, b: f64, c: f64| shape(Cuboid { center: at(0.0, 0.05, 0.0), size: at(a, b, c) });
    let lens = Solid::Intersection(vec![ball(-0.35, 0.7), ball(0.35, 0.7)]);
    let three = Solid::Intersection(vec![
        shape(Ball { center: at(0.3, 0.0, 0.0), radius: 0.7 }),
        shape(Ball { center: at(-0.2, 0.3, 0.0), radius: 0.7 }),
        shape(Ball { center: at(-0.2, -0.3, 0.1), radius: 0.7 }),
    ]);
    let drilled = without(cuboid(1.1, 0.9, 1.0), cuboid(0.3, 0.4, 2.0).placed(&turned_in_space(0.4)));
    let torus = shape(Torus { center: at(0.0, 0.0, 0.1), major_radius: 0.6, minor_radius: 0.25 });
    let round = shape(RoundedCuboid { center: at(0.0, 0.1, 0.0), size: at(1.2, 0.8, 1.0), corner_radius: 0.15 });
    vec![
        named("lens", &lens),
        named("three balls", &three),
        named("turned box", &cuboid(1.0, 0.6, 0.8).placed(&turned_in_space(0.5))),
        named("drilled box", &drilled),
        named("cut torus", &without(torus, cuboid(0.5, 2.0, 2.0).placed(&turned_in_space(0.3)))),
        named("turned nested", &without(ball(0.0, 0.8), lens.placed(&turned_in_space(1.0)))),
        named("cut rounded box", &without(round, ball(0.6, 0.4))),
    ]
}

/// Edges and corners of a box that is composed of itself turned back and forth, against the box.
#[test]
fn a_composed_box_is_the_box() {
    let size = Vector::<3>::new(1.2, 0.8, 1.0);
    let center = Vector::<3>::new(0.1, 0.0, 0.05);
    let whole = Cuboid { center, size };
    let half = |d: usize, sign: f64| {
        let mut longer = size;
        let mut center = center;
        longer[d] += 1.0;
        center[d] += sign * 0.5;
        shape(Cuboid { center, size: longer })
    };
    let composed = Solid::Intersection(vec![half(0, 1.0), half(0, -1.0), half(1, 1.0)]).surface().unwrap();
    for x in queries::<3>(3000) {
        let (found, expected) = (composed.nearest(&x), whole.nearest(&x));
        assert!((found.distance - expected.distance).abs() < 1e-12, "{x:?}: {found:?} for {expected:?}");
        if !whole.near_medial_axis(&x, 1e-6) {
            assert!((found.point - expected.point).norm() < 1e-9, "{x:?}: {found:?} for {expected:?}");
        }
        if expected.normal.is_none() {
            assert!(found.normal.is_none(), "{x:?}: {found:?} for {expected:?}");
        }
    }
    assert!((composed.area_or_volume() - 0.96).abs() < 1e-12, "{}", composed.area_or_volume());
}

/// The rim of a lens of two balls is a circle: distances from it are known.
#[test]
fn the_rim_of_a_lens_is_a_circle() {
    let shapes = solid_shapes();
    let lens = &shapes[0].1;
    let rim = (0.49_f64 - 0.35 * 0.35).sqrt();
    for x in queries::<3>(2000) {
        let around = x[1].hypot(x[2]);
        // Outside both cones of normals at the rim.
        let is_at_rim = around > rim && (around - rim) * 0.35 > x[0].abs() * rim;
        if is_at_rim {
            let answer = lens.nearest(&x);
            assert!((answer.distance - x[0].hypot(around - rim)).abs() < 1e-13, "{x:?}: {answer:?}");
            assert!(answer.normal.is_none(), "{x:?}: {answer:?}");
        }
    }
}

/// Closest points against points of the members' surfaces that lie on the solid, in space.
#[test]
fn no_point_of_a_member_on_the_solid_is_nearer() {
    let at = Vector::<3>::new;
    let ball = Ball { center: at(0.1, 0.0, 0.0), radius: 0.7 };
    let cuboid = Cuboid { center: at(0.3, 0.2, 0.1), size: at(0.8, 0.7, 1.0) };
    let solid = without(shape(ball.clone()), shape(cuboid.clone())).surface().unwrap();
    let points: Vec<Vector<3>> = queries::<3>(60_000)
        .iter()
        .flat_map(|x| [ball.nearest(x).point, cuboid.nearest(x).point])
        .filter(|y| ball.signed_distance(y).max(-cuboid.signed_distance(y)).abs() < 1e-12)
        .collect();
    for x in queries::<3>(500) {
        let nearest = points.iter().map(|p| (p - x).norm()).fold(f64::INFINITY, f64::min);
        let exact = solid.signed_distance(&x).abs();
        assert!(nearest >= exact - 1e-12 && nearest < exact + 0.05, "{nearest} for {exact} at {x:?}");
    }
}

#[test]
fn areas_and_volumes_are_those_of_formulas() {
    let shapes = plane_shapes();
    let area = |name: &str| shapes.iter().find(|shape| shape.0 == name).unwrap().1.area_or_volume();
    // A lens of two disks of radius r whose centers are a apart.
    let (r, a) = (0.7_f64, 0.7_f64);
    let lens = 2.0 * r * r * (a / (2.0 * r)).acos() - 0.5 * a * (4.0 * r * r - a * a).sqrt();
    assert!((area("lens") - lens).abs() < 1e-10, "{} for {lens}", area("lens"));
    let ring = std::f64::consts::PI * (0.64 - 0.16);
    assert!((area("ring") - ring).abs() < 1e-10, "{} for {ring}", area("ring"));
    assert!((area("flush") - 0.8).abs() < 1e-12, "{}", area("flush"));
    let solids = all_solid_shapes();
    let volume = |name: &str| solids.iter().find(|shape| shape.0 == name).unwrap().1.area_or_volume();
    let height: f64 = 0.35;
    let lens = 2.0 * std::f64::consts::PI * height * height * (0.7 - height / 3.0);
    assert!((volume("lens") - lens).abs() < 2e-5 * lens, "{} for {lens}", volume("lens"));
}

#[test]
fn boxes_about_composed_shapes_are_tight() {
    for (name, surface) in plane_shapes() {
        let (low, high) = surface.bounding_box();
        let all: Vec<Vector<2>> = surface.outline(1e-3).into_iter().flatten().collect();
        for d in 0..2 {
            let least = all.iter().map(|x| x[d]).fold(f64::INFINITY, f64::min);
            let most = all.iter().map(|x| x[d]).fold(f64::NEG_INFINITY, f64::max);
            assert!(low[d] <= least + 1e-12 && least < low[d] + 0.25, "{name}: {least} above {}", low[d]);
            assert!(high[d] >= most - 1e-12 && most > high[d] - 0.25, "{name}: {most} below {}", high[d]);
        }
    }
}

#[test]
fn what_leaves_nothing_is_refused() {
    let disk = |x: f64, radius: f64| shape(Ball { center: Vector::<2>::new(x, 0.0), radius });
    for solid in [
        Solid::Intersection(vec![disk(-1.0, 0.4), disk(1.0, 0.4)]),
        without(disk(0.0, 0.3), disk(0.1, 0.9)),
        without(disk(0.0, 0.3), disk(0.0, 0.3)),
    ] {
        assert!(solid.surface().is_err());
    }
}

#[test]
fn polygons_name_what_is_wrong() {
    let at = Vector::<2>::new;
    let bow = Polygon::new(vec![at(0.0, 0.0), at(1.0, 1.0), at(1.0, 0.0), at(0.0, 1.0)]).unwrap_err();
    assert_eq!(bow, [PolygonError::Crossing { first: 0, second: 2, x: 0.5, y: 0.5 }]);
    let twice = Polygon::new(vec![at(0.0, 0.0), at(1.0, 0.0), at(1.0, 0.0), at(0.0, 1.0)]).unwrap_err();
    assert_eq!(twice, [PolygonError::Repeated(1, 2)]);
    // A corner on another edge, and an edge that runs back.
    let touching = Polygon::new(vec![at(0.0, 0.0), at(2.0, 0.0), at(2.0, 1.0), at(1.0, 0.0), at(0.0, 1.0)]);
    assert!(touching.unwrap_err().iter().any(|e| matches!(e, PolygonError::Crossing { first: 0, .. })));
    let back = Polygon::new(vec![at(0.0, 0.0), at(2.0, 0.0), at(1.0, 0.0), at(1.0, 1.0)]);
    assert!(!back.unwrap_err().is_empty());
    assert_eq!(Polygon::new(vec![at(0.0, 0.0), at(1.0, 0.0)]).unwrap_err(), [PolygonError::TooFew(2)]);
}
