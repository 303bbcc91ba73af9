//! Surfaces of level functions.

use super::queries;
use crate::geometry::Vector;
use crate::geometry::level::{BallLevel, Hessian, LevelFunction, LevelJet};
use crate::geometry::surfaces::{Ball, Ellipsoid, ImplicitError, ImplicitSurface, Surface};
use std::sync::Arc;

type Named<const D: usize> = (&'static str, Box<dyn Surface<D>>);

/// Σ (x_i/a_i)^p − 1 with an even power p.
struct Powers<const D: usize> {
    power: i32,
    axes: Vector<D>,
}

impl<const D: usize> LevelFunction<D> for Powers<D> {
    fn value(&self, x: &Vector<D>) -> f64 {
        (0..D).map(|d| (x[d] / self.axes[d]).powi(self.power)).sum::<f64>() - 1.0
    }

    fn jet(&self, x: &Vector<D>) -> LevelJet<D> {
        let p = f64::from(self.power);
        let slope = |d: usize| p * (x[d] / self.axes[d]).powi(self.power - 1) / self.axes[d];
        let second = |d: usize| p * (p - 1.0) * (x[d] / self.axes[d]).powi(self.power - 2) / self.axes[d].powi(2);
        LevelJet {
            value: self.value(x),
            gradient: Vector::<D>::from_fn(|d, _| slope(d)),
            hessian: Hessian::<D>::from_diagonal(&Vector::<D>::from_fn(|d, _| second(d))),
        }
    }
}

/// |x − a|² |x + a|² − b⁴: a curve of Cassini, of one piece or two.
struct Cassini<const D: usize> {
    focus: f64,
    radius: f64,
}

impl<const D: usize> LevelFunction<D> for Cassini<D> {
    fn value(&self, x: &Vector<D>) -> f64 {
        self.jet(x).value
    }

    fn jet(&self, x: &Vector<D>) -> LevelJet<D> {
        let mut a = Vector::<D>::zeros();
        a[0] = self.focus;
        let (u, v) = (x - a, x + a);
        let (p, q) = (u.norm_squared(), v.norm_squared());
        LevelJet {
            value: p * q - self.radius.powi(4),
            gradient: (u * q + v * p) * 2.0,
            hessian: Hessian::<D>::identity() * (2.0 * (p + q)) + (u * v.transpose() + v * u.transpose()) * 4.0,
        }
    }
}

/// max(|x|, |y|) − 1/2, with kinks.
struct Square;

impl LevelFunction<2> for Square {
    fn value(&self, x: &Vector<2>) -> f64 {
        x.amax() - 0.5
    }

    fn jet(&self, x: &Vector<2>) -> LevelJet<2> {
        let mut gradient = Vector::<2>::zeros();
        let axis = usize::from(x[1].abs() > x[0].abs());
        gradient[axis] = x[axis].signum();
        LevelJet { value: self.value(x), gradient, hessian: Hessian::<2>::zeros() }
    }
}

/// A power of another level.
struct Power<L>(L, i32);

impl<L: LevelFunction<2>> LevelFunction<2> for Power<L> {
    fn value(&self, x: &Vector<2>) -> f64 {
        self.0.value(x).powi(self.1)
    }

    fn jet(&self, x: &Vector<2>) -> LevelJet<2> {
        let p = f64::from(self.1);
        let jet = self.0.jet(x);
        let slope = p * jet.value.powi(self.1 - 1);
        let second = p * (p - 1.0) * jet.value.powi(self.1 - 2);
        LevelJet {
            value: self.value(x),
            gradient: jet.gradient * slope,
            hessian: jet.hessian * slope + jet.gradient * jet.gradient.transpose() * second,
        }
    }
}

/// A level with a pole at the origin.
struct Pole;

impl LevelFunction<2> for Pole {
    fn value(&self, x: &Vector<2>) -> f64 {
        1.0 - 0.01 / x.norm()
    }

    fn jet(&self, x: &Vector<2>) -> LevelJet<2> {
        LevelJet { value: self.value(x), gradient: Vector::<2>::zeros(), hessian: Hessian::<2>::zeros() }
    }
}

fn surface<const D: usize>(level: impl LevelFunction<D> + 'static) -> ImplicitSurface<D> {
    within(level, 2.0).unwrap()
}

fn within<const D: usize>(
    level: impl LevelFunction<D> + 'static,
    half: f64,
) -> Result<ImplicitSurface<D>, ImplicitError> {
    ImplicitSurface::new(Arc::new(level), Vector::<D>::repeat(-half), Vector::<D>::repeat(half))
}

pub(super) fn plane_shapes() -> Vec<Named<2>> {
    let at = Vector::<2>::new;
    vec![
        ("disk by a level", Box::new(surface(BallLevel { center: at(0.1, -0.2), radius: 0.7 }))),
        ("quadric", Box::new(surface(Ellipsoid { center: at(0.05, 0.1), semi_axes: at(0.75, 0.5) }))),
        ("eighth powers", Box::new(surface(Powers { power: 8, axes: at(0.8, 0.6) }))),
        ("one piece of Cassini", Box::new(surface(Cassini::<2> { focus: 0.6, radius: 0.63 }))),
        ("two pieces of Cassini", Box::new(surface(Cassini::<2> { focus: 0.6, radius: 0.57 }))),
    ]
}

pub(super) fn solid_shapes() -> Vec<Named<3>> {
    let at = Vector::<3>::new;
    vec![
        ("ball by a level", Box::new(surface(BallLevel { center: at(0.1, -0.2, 0.0), radius: 0.7 }))),
        ("quadric", Box::new(surface(Ellipsoid { center: at(0.0, 0.0, 0.0), semi_axes: at(0.4, 0.9, 0.6) }))),
        ("fourth powers", Box::new(surface(Powers { power: 4, axes: at(0.8, 0.6, 0.7) }))),
        ("two pieces of Cassini", Box::new(surface(Cassini::<3> { focus: 0.6, radius: 0.55 }))),
    ]
}

fn compare<const D: usize>(found: &dyn Surface<D>, exact: &dyn Surface<D>, tolerance: f64) {
    for x in queries::<D>(2000) {
        if exact.near_medial_axis(&x, 0.05) {
            continue;
        }
        let (found, exact) = (found.nearest(&x), exact.nearest(&x));
        assert!((found.distance - exact.distance).abs() < tolerance, "{x:?}: {found:?} for {exact:?}");
        assert!((found.point - exact.point).norm() < tolerance, "{x:?}: {found:?} for {exact:?}");
        assert!((found.normal.unwrap() - exact.normal.unwrap()).norm() < tolerance, "{x:?}: {found:?} for {exact:?}");
        let (found, exact) = (found.curvature.unwrap(), exact.curvature.unwrap());
        assert!((found - exact).abs() < 10.0 * tolerance * (1.0 + exact.abs()), "{x:?}: {found:?} for {exact:?}");
    }
    let (found, exact) = (found.area_or_volume(), exact.area_or_volume());
    assert!((found - exact).abs() < 1e-9 * exact, "{found} for {exact}");
}

/// spec/inputs.md: a disk by formula equals `circle` to 1e-9. Here it is round-off, times what Newton's method amplifies.
#[test]
fn disks_and_balls_by_levels_are_circles_and_spheres() {
    let ball = Ball { center: Vector::<2>::new(0.1, -0.2), radius: 0.7 };
    compare(&surface(BallLevel { center: ball.center, radius: 0.7 }), &ball, 1e-12);
    compare(&surface(Ellipsoid { center: ball.center, semi_axes: Vector::<2>::repeat(0.7) }), &ball, 1e-12);
    let ball = Ball { center: Vector::<3>::new(0.1, -0.2, 0.0), radius: 0.7 };
    compare(&surface(BallLevel { center: ball.center, radius: 0.7 }), &ball, 1e-12);
    let small = Ball { center: Vector::<2>::new(0.1, -0.2), radius: 0.05 };
    compare(&surface(Ellipsoid { center: small.center, semi_axes: Vector::<2>::repeat(0.05) }), &small, 1e-12);
}

#[test]
fn quadrics_are_ellipses_and_ellipsoids() {
    let ellipse = Ellipsoid { center: Vector::<2>::new(0.05, 0.1), semi_axes: Vector::<2>::new(0.75, 0.5) };
    compare(&surface(ellipse.clone()), &ellipse, 1e-11);
    let triaxial = Ellipsoid { center: Vector::<3>::zeros(), semi_axes: Vector::<3>::new(0.4, 0.9, 0.6) };
    compare(&surface(triaxial.clone()), &triaxial, 1e-11);
}

#[test]
fn two_pieces_are_found_and_their_areas_add_up() {
    let two = surface(Cassini::<2> { focus: 0.6, radius: 0.57 });
    assert_eq!(two.outline(0.01).len(), 2);
    assert!(two.near_medial_axis(&Vector::<2>::new(1e-4, 0.3), 1e-3));
    assert!(!two.near_medial_axis(&Vector::<2>::new(0.7, 0.5), 1e-3));
    assert_eq!(surface(Cassini::<2> { focus: 0.6, radius: 0.63 }).outline(0.01).len(), 1);
}

/// At a kink there is no normal, and the distance is that of the sampling's steps downhill.
#[test]
fn corners_of_a_level_are_found() {
    let square = surface(Square);
    for x in queries::<2>(1000) {
        let answer = square.nearest(&x);
        let beyond = x.abs().map(|c| (c - 0.5).max(0.0)).norm();
        let exact = if beyond > 0.0 { beyond } else { x.amax() - 0.5 };
        assert!((answer.distance - exact).abs() < 1e-9, "{x:?}: {answer:?} for {exact}");
        if x.abs().min() > 0.52 {
            assert!(answer.normal.is_none(), "{x:?}: {answer:?}");
        }
    }
    assert!((square.area_or_volume() - 1.0).abs() < 1e-3, "{}", square.area_or_volume());
}

#[test]
fn levels_without_a_surface_say_what_to_give() {
    let circle = |radius: f64| BallLevel { center: Vector::<2>::zeros(), radius };
    let message =
        |found: Result<ImplicitSurface<2>, ImplicitError>| found.err().map(|e| e.to_string()).unwrap_or_default();
    let none = message(within(circle(-1.0), 2.0));
    assert!(none.contains("no zero in the box") && none.contains("1.000e0") && none.contains("low and high"), "{none}");
    let side = message(within(circle(3.0), 2.0));
    assert!(side.contains("no zero"), "{side}");
    let side = message(within(circle(2.5), 2.0));
    assert!(side.contains("reaches the side"), "{side}");
    let pole = message(within(Pole, 2.0));
    assert!(pole.contains("not finite at (0.0000, 0.0000)"), "{pole}");
    let cube = message(within(Power(circle(0.5), 3), 2.0));
    assert!(cube.contains("without a slope"), "{cube}");
}
