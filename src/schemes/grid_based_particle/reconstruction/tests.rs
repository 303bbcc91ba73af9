use super::{Failure, Outcome, Workspace};
use crate::geometry::Vector;
use crate::schemes::grid_based_particle::config::FrontConfig;
use crate::schemes::grid_based_particle::fixtures::{Rest, SPACING, ball, config, feet};
use crate::schemes::grid_based_particle::foot_points::{FootPoint, FootPoints};
use crate::schemes::grid_based_particle::laws::{MeanCurvature, NormalSpeed, PrescribedFlow};
use crate::schemes::grid_based_particle::reconstructor::Reconstructor;
use std::sync::Arc;

/// The closest points of the front through particles to some places.
fn closest<const D: usize, const M: usize>(
    feet: &FootPoints<D>,
    config: &FrontConfig<D, M>,
    places: &[Vector<D>],
) -> Vec<Outcome<D>> {
    let mut reconstructor = Reconstructor::new(config.method.degree);
    reconstructor.sort(feet, &config.grid);
    let reconstruction = reconstructor.reconstruction(feet, config);
    let mut workspace = Workspace::default();
    places.iter().map(|x| reconstruction.closest(x, SPACING, &mut workspace)).collect()
}

/// Particles at spacing 1 h along y = height(x) about the origin, in units of h, with their normals.
fn graph(columns: std::ops::RangeInclusive<i32>, height: impl Fn(f64) -> f64) -> FootPoints<2> {
    let mut feet = FootPoints::default();
    for k in columns {
        let (x, e) = (f64::from(k), 1e-6);
        let slope = (height(x + e) - height(x - e)) / (2.0 * e);
        feet.push(
            0,
            &FootPoint {
                position: Vector::<2>::new(x, height(x)) * SPACING,
                normal: Vector::<2>::new(-slope, 1.0).normalize(),
                curvature: 0.0,
                gauss_curvature: 0.0,
                part: 0,
                parameter: 0.0,
            },
        );
    }
    feet
}

fn in_spacings(x: f64, y: f64) -> Vector<2> {
    Vector::<2>::new(x, y) * SPACING
}

/// Over the normal of its vertex a parabola is a polynomial of degree two.
#[test]
fn a_fit_reproduces_a_polynomial_of_its_degree_exactly() {
    let parabola = graph(-4..=4, |x| 0.1 * x * x);
    for degree in [2, 3, 4] {
        let mut config = config::<2, 1>(NormalSpeed { speed: 1.0 });
        (config.method.degree, config.method.neighbors, config.method.weight) = (degree, degree + 3, 0.5);
        let foot = closest(&parabola, &config, &[in_spacings(0.2, 0.6)])[0].unwrap();
        let (x, y) = (foot.position[0] / SPACING, foot.position[1] / SPACING);
        assert!((y - 0.1 * x * x).abs() < 1e-9, "degree {degree}: {x} {y}");
        // The way to the place is along the normal.
        let way = (in_spacings(0.2, 0.6) - foot.position).normalize();
        assert!((way - foot.normal).norm() < 1e-9);
        // ∇·n of a graph that bends upward is negative.
        let curvature = -0.2 / (1.0 + (0.2 * x).powi(2)).powf(1.5);
        assert!((foot.curvature * SPACING - curvature).abs() < 1e-8);
    }
}

#[test]
fn a_sphere_is_found_with_its_curvatures() {
    let mut config = config::<3, 2>(NormalSpeed { speed: 1.0 });
    (config.method.degree, config.method.neighbors) = (4, 36);
    let (sphere, center) = (feet(ball::<3>(), &config), ball::<3>().center);
    let place = center + Vector::<3>::new(0.3, -0.2, 0.21);
    let foot = closest(&sphere, &config, &[place])[0].unwrap();
    let outward = (place - center).normalize();
    assert!((foot.position - (center + outward * 0.4)).norm() < 1e-8);
    assert!((foot.normal - outward).norm() < 1e-5);
    assert!((foot.curvature - 5.0).abs() < 1e-2 && (foot.gauss_curvature - 6.25).abs() < 3e-2);
}

#[test]
fn a_weight_makes_far_particles_count_less() {
    // A line whose last particles are off by .1 h.
    let bent = graph(-3..=3, |x| if x.abs() > 2.5 { 0.1 } else { 0.0 });
    let height = |weight: f64| {
        let mut config = config::<2, 1>(NormalSpeed { speed: 1.0 });
        (config.method.neighbors, config.method.weight) = (7, weight);
        closest(&bent, &config, &[in_spacings(0.0, 0.5)])[0].unwrap().position[1].abs() / SPACING
    };
    assert!(height(1.0) < 0.01 * height(0.0), "{} {}", height(1.0), height(0.0));
}

#[test]
fn by_curvature_a_sharp_bend_gets_a_quadratic_of_the_nearest_particles() {
    let bend = graph(-6..=6, |x| (1.0 + x * x).sqrt());
    let place = [in_spacings(0.1, 1.6)];
    let with = |degree: usize, neighbors: usize| {
        let mut config = config::<2, 1>(MeanCurvature);
        (config.method.degree, config.method.neighbors, config.method.cosine) = (degree, neighbors, -0.2);
        closest(&bend, &config, &place)[0]
    };
    assert_eq!(with(4, 10), with(2, 6));
    assert!(with(4, 10).is_ok());
    // On a gentle bend the quartic is kept.
    let gentle = graph(-6..=6, |x| 0.01 * x * x);
    let mut config = config::<2, 1>(MeanCurvature);
    (config.method.degree, config.method.neighbors) = (4, 10);
    let quartic = closest(&gentle, &config, &place)[0].unwrap();
    (config.method.degree, config.method.neighbors) = (2, 6);
    assert_ne!(closest(&gentle, &config, &place)[0].unwrap(), quartic);
}

#[test]
fn nothing_lies_beyond_the_end_of_a_segment_in_a_flow() {
    let end = graph(-8..=0, |_| 0.0);
    let places = [in_spacings(0.25, 0.1), in_spacings(0.5, 0.1), in_spacings(-0.5, 0.1)];
    let in_flow = closest(&end, &config::<2, 1>(PrescribedFlow::new(Arc::new(Rest))), &places);
    assert_eq!((in_flow[0], in_flow[1]), (Err(Failure::Extrapolated), Err(Failure::Extrapolated)));
    assert!(in_flow[2].is_ok());
    // With a given speed .3 h are trusted.
    let moving = closest(&end, &config::<2, 1>(NormalSpeed { speed: 1.0 }), &places);
    assert!(moving[0].is_ok() && moving[2].is_ok());
    assert_eq!(moving[1], Err(Failure::Extrapolated));
}

/// Two sides of a right angle that meet between the particles: a fit of one side must not reach past the corner.
#[test]
fn the_sides_of_a_corner_do_not_mix() {
    let mut corner = graph(-8..=0, |_| 0.0);
    let side = graph(-8..=0, |_| 0.0);
    for i in 0..side.len() {
        let mut foot = side.get(i);
        foot.position = Vector::<2>::new(0.5 * SPACING, foot.position[0] - 0.5 * SPACING);
        foot.normal = Vector::<2>::new(1.0, 0.0);
        corner.push(0, &foot);
    }
    let config = config::<2, 1>(PrescribedFlow::new(Arc::new(Rest)));
    let found = closest(&corner, &config, &[in_spacings(-1.5, 0.3), in_spacings(0.7, -2.5)]);
    let (top, right) = (found[0].unwrap(), found[1].unwrap());
    assert!(top.position[1].abs() < 1e-14 && (top.normal[1] - 1.0).abs() < 1e-12);
    assert!((right.position[0] - 0.5 * SPACING).abs() < 1e-14 && (right.normal[0] - 1.0).abs() < 1e-12);
    assert_eq!(closest(&corner, &config, &[in_spacings(0.9, 0.9)])[0], Err(Failure::Extrapolated));
}

#[test]
fn too_few_particles_starve_and_particles_at_one_position_determine_nothing() {
    let config = config::<2, 1>(NormalSpeed { speed: 1.0 });
    let place = [in_spacings(0.0, 0.3)];
    assert_eq!(closest(&FootPoints::default(), &config, &place)[0], Err(Failure::Starved));
    assert_eq!(closest(&graph(0..=1, |_| 0.0), &config, &place)[0], Err(Failure::Starved));
    let mut same = FootPoints::default();
    for _ in 0..9 {
        same.push(0, &graph(0..=0, |_| 0.0).get(0));
    }
    assert_eq!(closest(&same, &config, &place)[0], Err(Failure::Undetermined));
}

/// The parameter is fitted like a height, by the shorter way around.
#[test]
fn a_parameter_is_carried_along_across_its_jump() {
    let mut line = graph(-5..=5, |_| 0.0);
    for i in 0..line.len() {
        line.parameters[i] = (0.01 * (i as f64 - 5.0)).rem_euclid(1.0);
    }
    let mut config = config::<2, 1>(NormalSpeed { speed: 1.0 });
    config.segments.parameter = Some(0.1);
    for x in [-0.4, 0.0, 0.3] {
        let foot = closest(&line, &config, &[in_spacings(x, 0.2)])[0].unwrap();
        let off = foot.parameter - 0.01 * x;
        assert!((off - off.round()).abs() < 1e-12, "{x}: {}", foot.parameter);
    }
}
