//! Steps that are cut into parts, steps that fail, and the end of a run at rest.

use super::WeaklyCompressibleSph;
use crate::parallel::Interrupt;
use crate::schemes::weakly_compressible_sph::pacing::PACING;
use crate::schemes::weakly_compressible_sph::test_setting::{Setting, setting};
use crate::schemes::weakly_compressible_sph::time_step::longest_step;
use crate::schemes::weakly_compressible_sph::{KernelChoice, SphConfig, SphSystem};
use crate::simulation::{CpuClock, OutputPlan, Simulation, StepError};
use std::collections::BTreeMap;

fn run(this: &Setting<2>, config: SphConfig<2>, time_step: f64) -> WeaklyCompressibleSph<2> {
    let drop = this.drop(1.0);
    let system = SphSystem::new(config, this.domain.clone(), this.cell, drop, Interrupt::default()).unwrap();
    let plan = OutputPlan { every_time: None, series_every_steps: 1000 };
    WeaklyCompressibleSph::new(system, time_step, 1000.0 * time_step, plan, CpuClock::still(), BTreeMap::new())
}

fn free() -> (Setting<2>, SphConfig<2>, f64) {
    let this = setting::<2>(KernelChoice::WendlandC2, 1.0);
    let config = SphConfig { tension: 0.0, ..this.config.clone() };
    let limit = longest_step(&config, 0.0).length;
    (this, config, limit)
}

#[test]
fn a_step_beyond_the_limit_is_cut_into_parts_unless_the_time_step_was_given() {
    let (this, config, limit) = free();
    let mut cut = run(&this, config.clone(), 2.5 * limit);
    cut.step().unwrap();
    assert_eq!(cut.parts_of_step, 3);
    let given = SphConfig { is_adaptive: false, ..config.clone() };
    let mut whole = run(&this, given, 0.5 * limit);
    whole.step().unwrap();
    assert_eq!(whole.parts_of_step, 1);
    let Err(StepError::TimeStepFloor { stable, time_step, .. }) = run(&this, config, 100.0 * limit).step() else {
        panic!("a hundred parts are too many")
    };
    assert!((time_step / stable - 100.0).abs() < 1e-9);
}

#[test]
fn particles_faster_than_sound_end_a_run() {
    let (this, config, limit) = free();
    let mut fast = run(&this, SphConfig { is_adaptive: false, ..config }, 0.1 * limit);
    fast.system.flow.velocity[5][0] = 30.0;
    let Err(StepError::TooFast { particle, speed, sound_speed, .. }) = fast.step() else { panic!("no error") };
    assert_eq!((particle, sound_speed), (5, 20.0));
    assert!(speed > sound_speed);
}

#[test]
fn a_run_ends_after_enough_steps_below_the_speed_of_rest() {
    let (this, config, limit) = free();
    let mut resting = run(&this, SphConfig { rest_below: Some(1e3), ..config }, 0.2 * limit);
    for _ in 1..PACING.steps_of_rest {
        resting.step().unwrap();
    }
    assert!(!resting.is_finished());
    resting.step().unwrap();
    assert!(resting.is_finished());
    let findings = resting.take_findings();
    assert_eq!(findings.len(), 1, "{findings:?}");
}
