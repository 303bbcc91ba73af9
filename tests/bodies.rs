//! Bodies of jobs and studies against the answers of build db9067b (0.1): all scenes of the tests, and two thousand bodies that
//! were generated from the schemas, accepted and refused. The same JSON is accepted, the same defaults result, and every error
//! is found at the same place.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use flate2::read::GzDecoder;
use meniscus::scene::CloudSize;
use meniscus_jobs::spec::body::{self, Allowance, BodyError, JobSource, NoSources, Origin, RestartSource, Sources};
use meniscus_jobs::spec::calibration::Calibration;
use meniscus_jobs::spec::study;
use meniscus_jobs::spec::uploads::Purpose;
use meniscus_jobs::system::build;
use serde::Deserialize;
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use std::convert::Infallible;
use std::io::{BufRead, BufReader};
use std::path::Path;

const ALLOWANCE: Allowance = Allowance { threads: 2, memory_bytes: 4 << 30, local_files: false };

/// A body and what the build before answered.
#[derive(Deserialize)]
struct Recorded {
    body: Value,
    answer: Value,
}

/// An error: where, which, and the spelling that was suggested. Texts may change.
type Place = (String, String, Option<String>);

/// Knows one checkpoint of a vortex, and an upload of each purpose.
struct Known;

impl Sources for Known {
    type Error = Infallible;

    fn checkpoint(&self, id: &str) -> Result<Option<RestartSource>, Infallible> {
        let first = body::parse(&json!({"scene": {"kind": "vortex"}}), ALLOWANCE, &NoSources).ok();
        let origin = Origin::Checkpoint("ckpt_1".into());
        let source =
            first.map(|first| RestartSource { origin, scene: first.resolved.scene, isa: build::isa(), step: 240 });
        Ok(source.filter(|_| id == "ckpt_1"))
    }

    fn job(&self, _: &str) -> Result<Option<JobSource>, Self::Error> {
        Ok(None)
    }

    fn uploaded_checkpoint(&self, _: &str) -> Result<Option<RestartSource>, Infallible> {
        Ok(None)
    }

    fn uploaded_points(&self, id: &str) -> Result<Option<(Purpose, CloudSize)>, Infallible> {
        Ok(match id {
            "upl_points" => Some((Purpose::Points, 5000.into())),
            "upl_surface" => Some((Purpose::Surface, 5000.into())),
            "upl_places" => Some((Purpose::Queries, 5000.into())),
            _ => None,
        })
    }
}

fn recorded() -> Vec<Recorded> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/answers_0_1.jsonl.gz");
    let lines = BufReader::new(GzDecoder::new(std::fs::File::open(file).unwrap())).lines();
    lines.map(|line| serde_json::from_str(&line.unwrap()).unwrap()).collect()
}

/// What this build answers otherwise, on purpose: a missing or misspelled name is told as such, `points` without a source is told
/// once, and whole numbers may be written 2.0. The code before, the code now.
const CHANGED: [(&str, &str, &str, &str); 7] = [
    ("/sweep/mode", "unknown", "/sweep", "required"),
    ("/sweep/mode", "unknown", "/sweep/mode", "unknown"),
    ("/sweep/mode", "unknown", "/sweep/axes", "required"),
    ("/sweep/axes", "type", "/sweep/axes", "required"),
    ("/sweep/points", "type", "/sweep/points", "required"),
    ("/max_parallel", "range", "/max_parallel", "type"),
    ("/scene/integrator/type", "required", "/scene/integrator/tpe", "unknown_field"),
];

/// Whether every error of the build before is found again, or told better now. More errors at once are welcome.
fn are_found(before: &BTreeSet<Place>, now: &BTreeSet<Place>) -> bool {
    let is_known = |pointer: &str, code: &str| now.iter().any(|(p, c, _)| p == pointer && c == code);
    before.iter().all(|place| {
        let (pointer, code, _) = place;
        let is_changed =
            |(p, c, new_p, new_c): &(&str, &str, &str, &str)| p == pointer && c == code && is_known(new_p, new_c);
        // A shape of points without a source was told twice: as required, and as of the wrong type.
        let is_told_once = code == "type" && is_known(pointer, "required");
        now.contains(place) || CHANGED.iter().any(is_changed) || is_told_once
    })
}

/// What is not given and what is null are the same; why something was chosen is a text.
fn without_nulls(value: &Value) -> Value {
    match value {
        Value::Object(map) => {
            let kept = map.iter().filter(|(name, value)| !value.is_null() && *name != "chosen");
            Value::Object(kept.map(|(name, value)| (name.clone(), without_nulls(value))).collect::<Map<_, _>>())
        }
        Value::Array(list) => list.iter().map(without_nulls).collect(),
        // 2 and 2.0 are one number.
        Value::Number(number) => json!(number.as_f64()),
        other => other.clone(),
    }
}

/// Whether everything that the build before answered stands in the answer of this one. A parameter that came later may be there too.
fn holds_all(now: &Value, before: &Value) -> bool {
    match (now, before) {
        (Value::Object(now), Value::Object(before)) => {
            before.iter().all(|(name, value)| now.get(name).is_some_and(|now| holds_all(now, value)))
        }
        (Value::Array(now), Value::Array(before)) => {
            now.len() == before.len() && now.iter().zip(before).all(|(now, before)| holds_all(now, before))
        }
        (now, before) => now == before,
    }
}

fn places(error: BodyError<Infallible>) -> BTreeSet<Place> {
    let BodyError::Invalid(errors) = error;
    errors.iter().map(|e| (e.pointer.clone(), e.code.to_owned(), e.did_you_mean.clone())).collect()
}

fn recorded_places(answer: &Value) -> Option<BTreeSet<Place>> {
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let place = |e: &Value| (text(&e["pointer"]), text(&e["code"]), e["did_you_mean"].as_str().map(str::to_owned));
    Some(answer.get("errors")?.as_array()?.iter().map(place).collect())
}

/// The body with the name that the former balanced force of droplets has now, and their scene if it is one. Since 0.3 that force
/// has another formulation, and steps follow from the scene's own numbers.
fn renamed(body: &Value) -> (Value, bool) {
    let mut body = body.clone();
    let is_droplet = body.pointer("/scene/kind") == Some(&json!("droplet"));
    let is_former = matches!(body.pointer("/scene/tension_force").and_then(Value::as_str), None | Some("balanced"));
    let is_paper = body.pointer("/scene/preset").is_some();
    let is_named = body.pointer("/scene/tension_force").is_some();
    if is_droplet
        && is_former
        && (is_named || !is_paper)
        && body.pointer("/scene/tension_force").is_none_or(Value::is_string)
    {
        body["scene"]["tension_force"] = json!("balanced_0_1");
    }
    (body, is_droplet)
}

/// Numbers of a droplet's answer that may differ: what follows from the step that the scene chooses, and from more observables.
const CHOSEN_STEPS: [&str; 5] = ["steps", "time_step", "end_time", "memory_bytes", "disk_bytes"];

/// What is refused since: fluids that are too soft, and free fall of two densities.
fn is_newly_refused(places: &BTreeSet<Place>) -> bool {
    let is_new = |pointer: &str| pointer.ends_with("/sound_speed") || pointer == "/scene/body_force/balance";
    !places.is_empty() && places.iter().all(|(pointer, _, _)| is_new(pointer))
}

/// An answer of a droplet without what may differ, and with the former name of its force.
fn as_before(mut answer: Value) -> Value {
    if let Some(force) = answer.pointer_mut("/resolved/scene/tension_force")
        && *force == json!("balanced_0_1")
    {
        *force = json!("balanced");
    }
    if let Some(map) = answer.as_object_mut() {
        for name in CHOSEN_STEPS {
            map.remove(name);
        }
    }
    answer
}

/// Answers about curvatures without what more fields change: since 0.3 frames have principal curvatures and the shape tensor, too.
/// They take more room, never less.
fn with_fields_as_before(mut now: Value, before: &mut Value) -> Value {
    let fields = "/resolved/output/fields";
    let known: Vec<Value> = before.pointer(fields).and_then(Value::as_array).cloned().unwrap_or_default();
    if let Some(Value::Array(list)) = now.pointer_mut(fields) {
        list.retain(|field| known.contains(field));
    }
    let mut bytes = [&mut now, before].map(|answer| answer.as_object_mut().and_then(|map| map.remove("disk_bytes")));
    if let [Some(now), Some(before)] = &mut bytes {
        assert!(now.as_u64() >= before.as_u64(), "{now} bytes on disk, {before} before");
    }
    now
}

/// The answer of this build, as far as it is compared.
fn answer(body: &Value) -> Result<Value, BTreeSet<Place>> {
    if let Some(given) = body.get("study") {
        let study = study::parse(given, ALLOWANCE, 2, &Known, &Calibration::default(), |_| ());
        let study = study.map_err(places)?;
        return Ok(json!({
            "axes": study.axes, "points": study.points, "max_parallel": study.max_parallel, "on_failure": study.on_failure,
            "name": study.name, "labels": study.labels,
        }));
    }
    let job = body::parse(body, ALLOWANCE, &Known).map_err(places)?;
    let estimate = job.forecast.estimate;
    Ok(json!({
        "resolved": job.resolved.to_json(), "kind": job.kind, "uploads": job.uploads, "particles": estimate.particles,
        "steps": estimate.steps, "time_step": estimate.time_step, "end_time": estimate.end_time,
        "memory_bytes": estimate.memory_bytes, "disk_bytes": job.forecast.disk_bytes, "family": job.forecast.family,
    }))
}

#[test]
fn bodies_are_answered_as_by_the_build_before() {
    let all = recorded();
    assert!(all.len() >= 2000);
    let accepted = all.iter().filter(|one| recorded_places(&one.answer).is_none()).count();
    assert!((900..1100).contains(&accepted), "{accepted} of {} were accepted", all.len());
    let mut differing = Vec::new();
    for Recorded { body, answer: before } in &all {
        let (body, is_droplet) = renamed(body);
        let body = &body;
        let mut now = answer(body);
        let mut before = before.clone();
        if is_droplet {
            now = now.map(as_before);
            before = as_before(before);
        }
        let problem = body.pointer("/scene/problem");
        if problem.is_some_and(|p| p == "curvature" || p["type"] == "curvature") {
            now = now.map(|now| with_fields_as_before(now, &mut before));
        }
        let before = &before;
        let is_same = match (&now, recorded_places(before)) {
            (Ok(now), None) => holds_all(&without_nulls(now), &without_nulls(before)),
            (Err(now), Some(before)) => are_found(&before, now),
            (Ok(_), Some(_)) => body.pointer("/study/max_parallel") == Some(&json!(2.0)),
            (Err(now), None) => is_droplet && is_newly_refused(now),
        };
        if !is_same {
            differing.push(format!("{body}\n  before: {before}\n  now: {now:?}"));
        }
    }
    assert!(differing.is_empty(), "{} differ:\n{}", differing.len(), differing.join("\n"));
}
