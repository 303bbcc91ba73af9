use super::{Allowance, BodyError, JobBody, JobSource, NoSources, Origin, RestartSource, Sources};
use crate::spec::run_options::RunOptions;
use crate::spec::states::State;
use crate::spec::uploads::Purpose;
use meniscus::scene::CloudSize;
use meniscus::spec::Violation;
use serde_json::{Value, json};
use std::convert::Infallible;

const ALLOWANCE: Allowance = Allowance { threads: 2, memory_bytes: 4 << 30, local_files: false };

fn parse(
    spec: &Value,
    allowance: Allowance,
    sources: &impl Sources<Error = Infallible>,
) -> Result<JobBody, Vec<Violation>> {
    super::parse(spec, allowance, sources).map_err(BodyError::violations)
}

/// Knows one checkpoint of a vortex.
struct OneCheckpoint;

impl Sources for OneCheckpoint {
    type Error = Infallible;

    fn checkpoint(&self, _: &str) -> Result<Option<RestartSource>, Infallible> {
        let first = parse(&json!({"scene": {"kind": "vortex"}}), ALLOWANCE, &NoSources).ok().unwrap();
        let (origin, scene) = (Origin::Checkpoint("ckpt_1".into()), first.resolved.scene);
        Ok(Some(RestartSource { origin, scene, isa: crate::system::build::isa(), step: 240 }))
    }

    fn job(&self, id: &str) -> Result<Option<JobSource>, Infallible> {
        let states = [("job_running", State::Running), ("job_failed", State::Failed), ("job_done", State::Succeeded)];
        let state = states.into_iter().find(|(known, _)| *known == id).map(|(_, state)| state);
        let checkpoint = self.checkpoint("ckpt_1")?;
        let scene = checkpoint.as_ref().unwrap().scene.clone();
        let checkpoint = checkpoint.filter(|_| state == Some(State::Succeeded));
        Ok(state.map(|state| JobSource { state, scene, checkpoint }))
    }

    fn uploaded_checkpoint(&self, _: &str) -> Result<Option<RestartSource>, Infallible> {
        Ok(None)
    }

    fn uploaded_points(&self, id: &str) -> Result<Option<(Purpose, CloudSize)>, Infallible> {
        let purpose = match id {
            "upl_places" => Purpose::Queries,
            "upl_surface" => Purpose::Surface,
            _ => Purpose::Points,
        };
        Ok(Some((purpose, 5000.into())))
    }
}

/// Look-ups that fail.
struct Broken;

impl Sources for Broken {
    type Error = &'static str;

    fn checkpoint(&self, _: &str) -> Result<Option<RestartSource>, &'static str> {
        Err("the store failed")
    }

    fn job(&self, _: &str) -> Result<Option<JobSource>, &'static str> {
        Err("the store failed")
    }

    fn uploaded_checkpoint(&self, _: &str) -> Result<Option<RestartSource>, &'static str> {
        Err("the store failed")
    }

    fn uploaded_points(&self, _: &str) -> Result<Option<(Purpose, CloudSize)>, &'static str> {
        Err("the store failed")
    }
}

#[test]
fn a_failed_lookup_is_no_violation() {
    let points = json!({"type": "points", "upload": "upl_1"});
    for body in [
        json!({"restart": {"checkpoint": "ckpt_1"}}),
        json!({"restart": {"upload": "upl_1"}}),
        json!({"restart": {"job": "job_1"}}),
        json!({"after": ["job_1"], "scene": {"kind": "vortex"}}),
        json!({"scene": {"kind": "redistance", "spacing": 0.05, "shape": points}}),
    ] {
        assert!(matches!(super::parse(&body, ALLOWANCE, &Broken), Err(BodyError::Lookup("the store failed"))));
    }
}

#[test]
fn points_come_from_uploads_of_the_right_purpose() {
    let scene = |shape: &str, places: &str| {
        json!({"scene": {"kind": "redistance", "spacing": 0.05, "shape": {"type": "points", "upload": shape},
               "queries": {"type": "points", "upload": places}}})
    };
    let job = parse(&scene("upl_points", "upl_places"), ALLOWANCE, &OneCheckpoint).ok().unwrap();
    assert_eq!(job.uploads, ["upl_points", "upl_places"]);
    assert_eq!(job.forecast.estimate.particles, 5000);
    let found = parse(&scene("upl_places", "upl_places"), ALLOWANCE, &OneCheckpoint).err().unwrap();
    assert_eq!((found[0].pointer.as_str(), found[0].code), ("/scene/shape", "not_found"));
    let both = json!({"scene": {"kind": "redistance", "shape": {"type": "points", "upload": "a", "file": "b"}}});
    assert_eq!(parse(&both, ALLOWANCE, &OneCheckpoint).err().unwrap()[0].code, "conflict");
    let surface = |id: &str| json!({"scene": {"kind": "surface_pde", "surface": {"type": "points", "upload": id}, "problem": "curvature"}});
    let job = parse(&surface("upl_surface"), ALLOWANCE, &OneCheckpoint).ok().unwrap();
    assert_eq!(
        (job.uploads.as_slice(), job.forecast.estimate.particles),
        (["upl_surface".to_owned()].as_slice(), 5000)
    );
    let found = parse(&surface("upl_points"), ALLOWANCE, &OneCheckpoint).err().unwrap();
    assert_eq!((found[0].pointer.as_str(), found[0].code), ("/scene/surface", "not_found"));
    let none = json!({"scene": {"kind": "vortex", "shape": "points"}});
    assert_eq!(parse(&none, ALLOWANCE, &OneCheckpoint).err().unwrap()[0].code, "required");
}

fn errors(body: &Value) -> Vec<(String, String)> {
    match parse(body, ALLOWANCE, &NoSources) {
        Ok(_) => Vec::new(),
        Err(found) => found.into_iter().map(|v| (v.pointer, v.code.to_owned())).collect(),
    }
}

#[test]
fn files_of_this_machine_are_for_the_foreground_alone() {
    let spec = json!({"scene": {"kind": "redistance", "shape": {"type": "points", "file": "/etc/passwd"}}});
    let found = parse(&spec, ALLOWANCE, &NoSources).err().unwrap();
    assert_eq!((found[0].pointer.as_str(), found[0].code), ("/scene/shape", "not_here"));
    let foreground = Allowance { local_files: true, ..ALLOWANCE };
    assert!(parse(&spec, foreground, &NoSources).is_ok());
}

#[test]
fn every_default_stands_in_the_resolved_body() {
    let body = parse(&json!({"scene": {"kind": "vortex"}}), ALLOWANCE, &NoSources).ok().unwrap();
    let resolved = body.resolved.to_json();
    let scene = &resolved["scene"];
    assert_eq!(scene["field"], "dual");
    assert_eq!(scene["redistance"]["type"], "for_output");
    assert_eq!(scene["method"]["neighborhood"]["type"], "material");
    assert_eq!(resolved["limits"]["threads"], 2);
    assert_eq!(resolved["output"]["series_every_steps"], 10);
    assert_eq!(resolved["checkpoint"]["every_wall_s"], 60.0);
    assert!(RunOptions::from_resolved(&resolved).is_ok());
    // What is resolved is a body of its own with the same meaning.
    let again = parse(&json!({"scene": scene}), ALLOWANCE, &NoSources).ok().unwrap();
    assert_eq!(&again.resolved.scene, scene);
}

#[test]
fn all_errors_come_at_once_with_their_places() {
    let body = json!({
        "scene": {"kind": "vortex", "spacing": -1, "bandh": 3, "shape": {"type": "circle", "radius": "big"}, "flow": "single_vortx"},
        "output": {"every_time": 0, "fields": ["fi"]}, "limits": {"threads": 99}, "nme": "x"
    });
    let found = errors(&body);
    for expected in [
        ("/nme", "unknown_field"),
        ("/scene/spacing", "range"),
        ("/scene/bandh", "unknown_field"),
        ("/scene/shape/radius", "type"),
        ("/scene/flow", "unknown"),
        ("/output/every_time", "range"),
        ("/limits/threads", "range"),
    ] {
        assert!(found.iter().any(|(p, c)| p == expected.0 && c == expected.1), "{expected:?} not in {found:?}");
    }
    let suggestions: Vec<String> =
        parse(&body, ALLOWANCE, &NoSources).err().unwrap().into_iter().filter_map(|v| v.did_you_mean).collect();
    for name in ["name", "band_h", "single_vortex"] {
        assert!(suggestions.iter().any(|s| s == name), "{name} not in {suggestions:?}");
    }
}

#[test]
fn more_particles_than_memory_names_both_fields() {
    let body = json!({"scene": {"kind": "redistance", "dimension": 3, "spacing": 0.002}, "limits": {"memory_bytes": 100_000_000}});
    assert_eq!(errors(&body), [("/scene/spacing".to_owned(), "memory".to_owned())]);
    for scene in [
        json!({"kind": "redistance", "spacing": 1e-6}),
        json!({"kind": "redistance", "spacing": 1e-9}),
        json!({"kind": "vortex", "spacing": 1e-300}),
        json!({"kind": "redistance", "spacing": 1e308}),
        json!({"kind": "redistance", "shape": {"type": "circle", "radius": 1e200}}),
        json!({"kind": "redistance", "shape": {"type": "box", "size": [1e8, 1e-8]}, "spacing": 1e-9}),
        json!({"kind": "vortex", "band_h": 1e10}),
        json!({"kind": "redistance", "band_h": 1e300}),
    ] {
        let found = errors(&json!({"scene": scene}));
        assert!(found.iter().any(|(pointer, _)| pointer == "/scene/spacing"), "{scene}: {found:?}");
    }
}

#[test]
fn restarts_change_only_what_is_safe() {
    let body = json!({"restart": {"checkpoint": "ckpt_1", "overrides": {"/end_time": 12.0}}});
    let job = parse(&body, ALLOWANCE, &OneCheckpoint).ok().unwrap();
    assert_eq!(job.forecast.estimate.steps, 360);
    let body = json!({"restart": {"checkpoint": "ckpt_1", "overrides": {"/spacing": 0.1}}});
    assert_eq!(parse(&body, ALLOWANCE, &OneCheckpoint).err().unwrap()[0].code, "not_restart_safe");
    let body = json!({"restart": {"checkpoint": "ckpt_1", "overrides": {"/end_time": 4.0}}});
    assert_eq!(parse(&body, ALLOWANCE, &OneCheckpoint).err().unwrap()[0].code, "range");
}

#[test]
fn jobs_that_a_body_names_must_be_there_and_able_to_succeed() {
    let places = |body: &Value| {
        let errors = parse(body, ALLOWANCE, &OneCheckpoint).err().unwrap();
        errors.into_iter().map(|error| (error.pointer, error.code)).collect::<Vec<_>>()
    };
    let body = json!({"after": ["job_running", "job_gone", "job_failed"], "scene": {"kind": "vortex"}});
    let expected = [("/after/1".to_owned(), "not_found"), ("/after/2".to_owned(), "conflict")];
    assert_eq!(places(&body), expected);
    for (job, code) in [("job_gone", "not_found"), ("job_failed", "conflict")] {
        assert_eq!(places(&json!({"restart": {"job": job}})), [("/restart/job".to_owned(), code)]);
    }
    let done = parse(&json!({"restart": {"job": "job_done"}}), ALLOWANCE, &OneCheckpoint).ok().unwrap();
    assert_eq!(done.origin, Some(Origin::Checkpoint("ckpt_1".into())));
    // A job that runs is waited for.
    let body = json!({"restart": {"job": "job_running"}, "after": ["job_done"]});
    let waiting = parse(&body, ALLOWANCE, &OneCheckpoint).ok().unwrap();
    assert_eq!(waiting.origin, Some(Origin::Job("job_running".into())));
    assert_eq!(waiting.predecessors, ["job_done", "job_running"]);
}
