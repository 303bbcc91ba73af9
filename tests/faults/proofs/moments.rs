//! Pauses, cancels and stops of the service at random moments of every kind of scene: in set-up, stepping, measuring and
//! finishing.

use crate::common::Expected;
use crate::support::{Service, chance, eventually};
use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// Jobs of a few seconds, each with one long part: a step, a measurement, a set-up, an output or an end.
fn bodies() -> Vec<(&'static str, Value)> {
    vec![
        (
            "measurement",
            json!({"scene": {"kind": "vortex", "spacing": 0.006, "end_time": 0.8}, "output": {"series_every_steps": 1}}),
        ),
        (
            "frames",
            json!({"scene": {"kind": "vortex", "spacing": 0.04, "flow": "vortex_3d", "end_time": 0.2, "steps": 60,
            "shape": {"type": "sphere", "center": [0.35, 0.35, 0.35], "radius": 0.15}}, "output": {"every_time": 0.02}}),
        ),
        ("step", json!({"scene": {"kind": "redistance", "dimension": 3, "spacing": 0.02, "repeat": 3}})),
        ("front", json!({"scene": {"kind": "front", "shape": {"type": "sphere", "radius": 0.3}, "spacing": 0.02}})),
        ("droplet", json!({"scene": {"kind": "droplet", "spacing": 0.0625, "end_time": 0.5}})),
        (
            "set-up",
            json!({"scene": {"kind": "surface_pde", "surface": "sphere", "count": 200_000,
            "problem": {"type": "laplace_beltrami", "field": "plane_wave"}}, "output": {"operators": "matrix_market"}}),
        ),
        (
            "solve",
            json!({"scene": {"kind": "surface_pde", "surface": "sphere", "count": 6_000,
            "problem": {"type": "eigenvalues", "count": 10}}}),
        ),
    ]
}

/// Time within which a worker is to have ended after a request. The contract says two seconds; the machine may be busy. A worker
/// that is deaf is killed after ten.
const PROMPT: Duration = Duration::from_secs(8);

/// What the disturbances of one job came to.
#[derive(Default)]
struct Outcome {
    times: Vec<f64>,
    pauses: u64,
    stops: u64,
    cancels: u64,
}

/// Every scene is disturbed `count` times; results must be as undisturbed, and nothing may be killed.
pub fn of_every_scene(count: u64, seed: u64) -> String {
    let directory = tempfile::tempdir().unwrap();
    let mut service = Service::start(directory.path(), &["--slots", "1"]);
    let mut outcome = Outcome::default();
    for (k, (part, body)) in bodies().iter().enumerate() {
        let began = Instant::now();
        let expected = Expected::of(&service, body);
        let length = began.elapsed().as_secs_f64();
        let (mut done, mut draw) = (0, 0);
        let mut random = || {
            draw += 1;
            chance(seed, 1000 * k as u64 + draw)
        };
        while done < count {
            let id = service.submit(body);
            service.worker_eventually(&id);
            loop {
                if done >= count {
                    break;
                }
                std::thread::sleep(Duration::from_secs_f64(length * random()));
                if service.job(&id)["state"] == "succeeded" {
                    break;
                }
                done += 1;
                match (random() * 3.0) as u64 {
                    0 if !pause(&service, &id, &mut outcome) => break,
                    0 => {}
                    1 => stop(&mut service, part, &mut outcome),
                    _ => {
                        cancel(&service, &id, &mut outcome);
                        break;
                    }
                }
            }
            let job = eventually("it ends", Duration::from_secs(120), || {
                let job = service.job(&id);
                let state = job["state"].as_str().unwrap();
                assert!(state != "failed" && state != "paused", "{part}: {job}");
                ["succeeded", "canceled"].contains(&state).then_some(job)
            });
            if job["state"] == "succeeded" {
                expected.check(&service, &id);
            }
            let events = service.events(&id);
            let is_lost = |event: &Value| event["type"] == "state" && event["data"]["to"] == "interrupted";
            assert!(!events.iter().any(is_lost), "{part}: a worker was killed or lost: {events:?}");
        }
    }
    outcome.times.sort_by(f64::total_cmp);
    let (median, longest) = (outcome.times[outcome.times.len() / 2], outcome.times[outcome.times.len() - 1]);
    let Outcome { pauses, stops, cancels, .. } = outcome;
    format!(
        "{pauses} pauses, {stops} stops and {cancels} cancels in {} scenes, median {median:.2} s, longest {longest:.2} s, nothing \
         killed, all data identical",
        bodies().len()
    )
}

/// Pauses and resumes a job; false where it came to its end first.
fn pause(service: &Service, id: &str, outcome: &mut Outcome) -> bool {
    let asked = Instant::now();
    if service.act(id, "pause").status != 202 {
        return false;
    }
    let state = eventually("it rests", PROMPT, || {
        let state = service.job(id)["state"].as_str().unwrap().to_owned();
        ["paused", "succeeded"].contains(&state.as_str()).then_some(state)
    });
    outcome.times.push(asked.elapsed().as_secs_f64());
    outcome.pauses += 1;
    if state == "succeeded" {
        return false;
    }
    let job = service.job(id);
    let checkpoints = service.get(&format!("/v1/jobs/{id}/checkpoints")).json()["items"].clone();
    let says_so = job["hint"].as_str().unwrap().contains("from its last checkpoint");
    assert_eq!(says_so, !checkpoints.as_array().unwrap().is_empty(), "{} {checkpoints}", job["hint"]);
    service.act(id, "resume");
    true
}

/// Stops the service in good order and starts it again.
fn stop(service: &mut Service, part: &str, outcome: &mut Outcome) {
    let asked = Instant::now();
    assert!(service.stop());
    let time = asked.elapsed();
    assert!(time < PROMPT, "{part}: the stop took {time:?}");
    outcome.times.push(time.as_secs_f64());
    outcome.stops += 1;
    service.restart();
}

fn cancel(service: &Service, id: &str, outcome: &mut Outcome) {
    let asked = Instant::now();
    service.act(id, "cancel");
    eventually("it is canceled", PROMPT, || {
        ["canceled", "succeeded"].contains(&service.job(id)["state"].as_str().unwrap()).then_some(())
    });
    outcome.times.push(asked.elapsed().as_secs_f64());
    outcome.cancels += 1;
}
