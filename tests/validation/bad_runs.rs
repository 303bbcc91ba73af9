//! Runs that must not pass for a success: the files of `tests/validation/bad`, each with what must become of it.

use crate::support::pool;
use meniscus::parallel::Interrupt;
use meniscus::scene::{BuildContext, Clouds};
use meniscus::simulation::{CpuClock, OutputPlan, Severity};
use meniscus_jobs::spec::body::{self, Allowance, NoSources};
use meniscus_jobs::spec::states::Reason;
use meniscus_jobs::verify::bad_case::Fate;
use meniscus_jobs::verify::checks::bad_cases;
use serde_json::Value;

fn fate(body: &Value) -> Fate {
    let allowance = Allowance { threads: 2, memory_bytes: 1 << 33, local_files: false };
    let body = match body::parse(body, allowance, &NoSources) {
        Ok(body) => body,
        Err(error) => return Fate::Refused(error.violations()[0].pointer.clone()),
    };
    let plan = OutputPlan { every_time: None, series_every_steps: 10 };
    let context =
        BuildContext { plan, interrupt: Interrupt::default(), cpu_clock: CpuClock::still(), clouds: Clouds::new() };
    let mut simulation = body.scene.build(context).unwrap();
    let mut doubt = None;
    while !simulation.is_finished() {
        if let Err(error) = simulation.step() {
            // A person reads the message.
            let message = error.to_string();
            assert!(!message.contains('{') && message.contains(' '), "{message}");
            return Fate::Ended(Reason::from(&error).word().to_owned());
        }
        let findings = simulation.take_findings();
        doubt = doubt.or_else(|| findings.into_iter().find(|finding| finding.severity == Severity::Warning));
    }
    doubt.map_or(Fate::Sound, |finding| Fate::Doubtful(finding.code.to_string()))
}

fn check(kind: &str) {
    let cases: Vec<_> = bad_cases().unwrap().into_iter().filter(|(name, _)| name.starts_with(kind)).collect();
    assert!(!cases.is_empty());
    for (name, case) in cases {
        assert_eq!(pool(2).install(|| fate(&case.body())), case.expect, "{name}: {}", case.title);
    }
}

#[test]
fn bad_droplets_end_or_are_refused() {
    check("droplet/");
}

#[test]
fn bad_vortices_end() {
    check("vortex/");
}

#[test]
fn bad_redistancings_end() {
    check("redistance/");
}

#[test]
fn bad_fronts_and_equations_end_or_are_refused() {
    check("front/");
    check("surface_pde/");
}
