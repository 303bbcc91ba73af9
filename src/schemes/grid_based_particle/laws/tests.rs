use super::{
    FrontAtStart, FrontLaw, GeometricalOptics, MeanCurvature, MotionStep, MovingFront, NormalSpeed, PrescribedFlow,
    StabilityPlan, Stages, StepPlan, Topology,
};
use crate::geometry::flows::{Rotation, SingleVortex, Vortex3d};
use crate::geometry::{Flow, Vector};
use crate::parallel::Interrupt;
use crate::schemes::grid_based_particle::fixtures::{SPACING, ball, config, feet};
use crate::schemes::grid_based_particle::foot_points::FootPoints;
use crate::time::PathIntegrator;
use std::sync::Arc;

/// Particles after one step without reconstructions, and the longest displacement in spacings.
fn advanced<const D: usize, const M: usize>(
    law: &dyn FrontLaw<D, M>,
    start: &FootPoints<D>,
    step: f64,
) -> (FootPoints<D>, f64) {
    let (mut feet, mut stages, interrupt) = (start.clone(), Stages::default(), Interrupt::default());
    let mut front = MovingFront { feet: &mut feet, stages: &mut stages, renew_geometry: &mut |_| Ok(()) };
    let integrator = PathIntegrator::Rk4;
    let motion = MotionStep { time: 0.3, step, integrator, spacing: SPACING, interrupt: &interrupt };
    let longest = law.advance(&mut front, &motion).unwrap();
    (feet, longest)
}

fn check_motion<const D: usize, const M: usize>(law: impl FrontLaw<D, M> + 'static) {
    let config = config::<D, M>(law);
    let start = feet(ball::<D>(), &config);
    let step = 1e-6;
    let (end, longest) = advanced(config.law.as_ref(), &start, step);
    let mut largest = 0.0_f64;
    for i in 0..start.len() {
        let moved = (end.positions[i] - start.positions[i]) / step;
        let velocity = config.law.velocity(&start, i, 0.3);
        assert!((moved - velocity).norm() < 1e-4 * (1.0 + velocity.norm()), "{moved} {velocity}");
        largest = largest.max(moved.norm() * step / SPACING);
    }
    assert!((longest - largest).abs() < 1e-9 * (1.0 + largest));
}

#[test]
fn a_short_step_moves_particles_by_their_velocity() {
    check_motion::<2, 1>(NormalSpeed { speed: -0.7 });
    check_motion::<3, 2>(NormalSpeed { speed: 0.7 });
    check_motion::<2, 1>(MeanCurvature);
    check_motion::<3, 2>(MeanCurvature);
    check_motion::<2, 1>(PrescribedFlow::new(Arc::new(SingleVortex { period: Some(2.0) })));
    check_motion::<3, 2>(PrescribedFlow::new(Arc::new(Vortex3d { period: Some(2.0) })));
}

/// The signs that decide about topology are those of the motion.
#[test]
fn displacements_along_the_normal_are_those_of_the_motion() {
    let laws: [Arc<dyn FrontLaw<2, 1>>; 3] =
        [Arc::new(NormalSpeed { speed: -0.7 }), Arc::new(NormalSpeed { speed: 0.7 }), Arc::new(MeanCurvature)];
    for law in laws {
        let start = feet(ball::<2>(), &config::<2, 1>(NormalSpeed { speed: 1.0 }));
        let (end, _) = advanced(law.as_ref(), &start, 1e-5);
        for i in 0..start.len() {
            let moved = (end.positions[i] - start.positions[i]).dot(&start.normals[i]);
            let expected = law.normal_displacement(&start, i, 0.3, 1e-5);
            assert!((moved - expected).abs() < 1e-9 && law.facing(&start, i) == expected.signum());
        }
    }
}

/// A rotation turns normals as it turns positions.
#[test]
fn a_flow_carries_normals_along() {
    let rotation = Rotation { center: Vector::<3>::new(0.2, 0.1, 0.0), angular_velocity: 2.0 };
    let config = config::<3, 2>(PrescribedFlow::new(Arc::new(rotation)));
    let start = feet(ball::<3>(), &config);
    let (end, _) = advanced(config.law.as_ref(), &start, 0.1);
    let center = rotation.rigid_path(&ball::<3>().center, 0.1).unwrap();
    for i in 0..end.len() {
        assert!((end.normals[i] - (end.positions[i] - center).normalize()).norm() < 1e-5);
    }
}

fn plan<const D: usize>(cfl: Option<f64>) -> StepPlan<D> {
    let stability = StabilityPlan { integrator: PathIntegrator::Rk4, dimension: D, degree: 4, weight: 0.0 };
    let extent = Some((Vector::<D>::zeros(), Vector::<D>::repeat(1.0)));
    StepPlan { finest: SPACING, cfl, extent, stability }
}

#[test]
fn default_steps_follow_the_speed_the_period_and_stability() {
    let step = |law: &dyn FrontLaw<2, 1>, cfl| law.default_time_step(&plan::<2>(cfl));
    assert!((step(&NormalSpeed { speed: -3.0 }, None) - 0.25 * SPACING).abs() < 1e-15);
    assert!((step(&NormalSpeed { speed: -3.0 }, Some(3.0)) - SPACING).abs() < 1e-15);
    let vortex = |period| PrescribedFlow::new(Arc::new(SingleVortex { period }));
    assert!((step(&vortex(None), None) - 10.0 * SPACING).abs() < 1e-15);
    assert!((step(&vortex(Some(0.32)), None) - 0.01).abs() < 1e-15);
    assert!((step(&MeanCurvature, None) - 0.5 * SPACING * SPACING).abs() < 1e-15);
    let optics = GeometricalOptics::new(-2.0);
    assert!((optics.default_time_step(&plan::<3>(None)) - SPACING).abs() < 1e-15);
}

#[test]
fn only_motion_by_curvature_has_a_longest_step_and_refuses_error_control() {
    let stability = plan::<2>(None).stability;
    let curvature: &dyn FrontLaw<2, 1> = &MeanCurvature;
    assert_eq!((curvature.longest_step(&stability), curvature.takes_error_control()), (Some(0.8), false));
    let two_stages = StabilityPlan { integrator: PathIntegrator::TvdRk2, ..stability };
    assert!((curvature.longest_step(&two_stages).unwrap() - 0.8 * 0.718).abs() < 1e-15);
    let weighted = StabilityPlan { weight: 0.5, ..stability };
    assert_eq!(curvature.longest_step(&weighted), Some(0.5));
    let speed: &dyn FrontLaw<2, 1> = &NormalSpeed { speed: 1.0 };
    assert_eq!((speed.longest_step(&stability), speed.takes_error_control()), (None, true));
}

fn start<const D: usize>() -> FrontAtStart<D> {
    let parts: Vec<Box<dyn crate::geometry::Surface<D>>> = vec![Box::new(ball::<D>())];
    FrontAtStart { surface: Box::new(ball::<D>()), parts, ball: Some(ball::<D>()), topology: Topology::Merge }
}

/// The exact ball of each law moves with the velocity that the law gives its particles.
#[test]
fn exact_motions_move_as_the_particles_do() {
    let time = 1e-4;
    let radius = |law: &dyn FrontLaw<3, 2>| law.exact_motion(start()).ball(&ball(), time).unwrap().radius;
    assert!((radius(&NormalSpeed { speed: -2.0 }) - (0.4 - 2.0 * time)).abs() < 1e-15);
    assert!((radius(&MeanCurvature) - (0.4 - time * 2.0 / 0.4)).abs() < 1e-6);
    let rotation = Rotation { center: Vector::<3>::zeros(), angular_velocity: 2.0 };
    let law: &dyn FrontLaw<3, 2> = &PrescribedFlow::new(Arc::new(rotation));
    let turned = law.exact_motion(start()).ball(&ball(), time).unwrap();
    assert!((turned.center - rotation.rigid_path(&ball::<3>().center, time).unwrap()).norm() < 1e-15);
}

#[test]
fn stretches_are_those_of_the_motion() {
    let stretch = |law: &dyn FrontLaw<2, 1>, end_time: f64| law.stretch(&start(), end_time);
    // A circle that grows from .4 to .8 is twice as long.
    assert!((stretch(&NormalSpeed { speed: 1.0 }, 0.4).most - 2.0).abs() < 1e-12);
    assert_eq!(stretch(&NormalSpeed { speed: -1.0 }, 0.4).most, 1.0);
    assert_eq!(stretch(&MeanCurvature, 0.4).most, 1.0);
    let vortex = PrescribedFlow::new(Arc::new(SingleVortex { period: Some(8.0) }));
    let stretched = stretch(&vortex, 8.0);
    assert!(stretched.most > stretched.mean && stretched.mean > 1.2, "{stretched:?}");
    let law: &dyn FrontLaw<3, 2> = &PrescribedFlow::new(Arc::new(Vortex3d { period: None }));
    assert_eq!(law.stretch(&start(), 1.0).most, 4.0);
}
