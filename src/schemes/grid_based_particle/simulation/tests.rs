use super::{BTreeMap, Ball, CpuClock, FixedStep, GridBasedParticles, Simulation, StepError};
use crate::geometry::Vector;
use crate::geometry::flows::Rotation;
use crate::schemes::grid_based_particle::FrontSystem;
use crate::schemes::grid_based_particle::fixtures::{SPACING, config};
use crate::schemes::grid_based_particle::laws::{FrontAtStart, FrontLaw, MeanCurvature, PrescribedFlow};
use crate::schemes::grid_based_particle::topology::Topology;
use std::sync::Arc;

/// A circle that a law moves in a number of steps.
fn circle(radius: f64, law: impl FrontLaw<2, 1> + 'static, fixed: FixedStep) -> GridBasedParticles<2, 1> {
    let ball = Ball { center: Vector::<2>::new(0.503, 0.507), radius };
    let mut config = config::<2, 1>(law);
    config.method.cosine = -0.2;
    let start = FrontAtStart {
        surface: Box::new(ball.clone()),
        parts: vec![Box::new(ball.clone())],
        ball: Some(ball.clone()),
        topology: Topology::Merge,
    };
    let exact = config.law.exact_motion(start);
    let system = FrontSystem::from_surfaces(&[Box::new(ball.clone())], config);
    GridBasedParticles::new(system, exact, Some(ball), fixed, CpuClock::still(), BTreeMap::new())
}

fn run(simulation: &mut GridBasedParticles<2, 1>) {
    while !simulation.is_finished() {
        simulation.step().unwrap();
    }
}

#[test]
fn a_circle_shrinks_by_its_curvature_and_vanishes() {
    let step = 0.4 * SPACING * SPACING;
    let mut simulation = circle(0.2, MeanCurvature, FixedStep::from_steps(40.0 * step, 40));
    run(&mut simulation);
    let exact = (0.04 - 2.0 * 40.0 * step).sqrt();
    let radii = simulation.system.feet.positions.iter().map(|x| (x - Vector::<2>::new(0.503, 0.507)).norm());
    assert!(radii.map(|radius| (radius - exact).abs()).fold(0.0, f64::max) < 0.05 * SPACING);
    // r² = .04 − 2 t vanishes at t = .02.
    let mut simulation = circle(0.2, MeanCurvature, FixedStep::from_time_step(0.025, step));
    run(&mut simulation);
    let vanished = simulation.vanished.unwrap();
    assert!((vanished - 0.02).abs() < 1e-3 && simulation.system.feet.is_empty(), "{vanished}");
    // The front that is missing is an error too.
    assert!(simulation.errors.iter().all(|errors| errors.values[0].is_nan() && errors.values[9] == 0.0));
}

#[test]
fn errors_are_due_where_a_flow_turns_and_at_the_end() {
    let rotation = Rotation { center: Vector::<2>::new(0.5, 0.0), angular_velocity: std::f64::consts::TAU };
    let law = PrescribedFlow::new(Arc::new(rotation));
    let mut simulation = circle(0.2, law, FixedStep::from_steps(1.0, 40));
    run(&mut simulation);
    let times: Vec<f64> = simulation.errors.iter().map(|errors| errors.time).collect();
    assert_eq!(times.len(), 2);
    assert!((times[0] - 0.5).abs() < 1e-12 && (times[1] - 1.0).abs() < 1e-12);
    // The root mean square distance.
    assert!(simulation.errors.iter().all(|errors| errors.values[1] < 0.05 * SPACING));
}

#[test]
fn a_front_that_grows_against_its_law_ends_the_run() {
    let step = 0.4 * SPACING * SPACING;
    let mut simulation = circle(0.2, MeanCurvature, FixedStep::from_steps(10.0 * step, 10));
    simulation.start_area *= 0.4;
    assert!(matches!(simulation.step(), Err(StepError::Unsolved { step: 1, .. })));
}
