//! `accuracy` in a job: the service chooses the spacing, after a small study where it must.

use crate::service;
use crate::support::{Service, eventually};
use meniscus_jobs::service::store::Store;
use meniscus_jobs::spec::work_precision::{PrecisionMeasured, reference_of};
use serde_json::{Value, json};
use std::time::Duration;

fn wanted(tolerance: f64) -> Value {
    json!({"scene": {"kind": "redistance", "shape": {"type": "ellipse", "semi_axes": [0.6, 0.5]}},
        "accuracy": {"quantity": {"error": {"quantity": "phi", "norm": "rms"}}, "tolerance": tolerance}})
}

fn study_of(service: &Service, job: &Value) -> Value {
    service.get(&format!("/v1/studies/{}", job["lineage"]["study"].as_str().unwrap())).json()
}

#[test]
fn a_job_that_asks_for_an_error_waits_for_its_study_and_reaches_it() {
    let (_directory, mut service) = service(&["--slots", "1"]);
    let body = wanted(1e-7);
    let estimate = service.post("/v1/estimates", &body);
    assert_eq!(estimate.status, 200, "{}", estimate.text());
    assert!(estimate.json()["resolved"].is_null() && estimate.json()["study"]["points"].as_u64().unwrap() >= 3);
    assert_eq!(service.get("/v1/studies").json()["items"], json!([]), "an estimate makes nothing");
    let answer = service.post("/v1/jobs", &body);
    assert_eq!(answer.status, 201, "{}", answer.text());
    let made = answer.json();
    assert_eq!((&made["state"], &made["resolved"]), (&json!("queued"), &Value::Null));
    assert_eq!(made["waiting_for"], made["lineage"]["study"]);
    let id = made["id"].as_str().unwrap();
    let patch = service.request("PATCH", &format!("/v1/jobs/{id}"), &[], Some(br#"{"name": "x"}"#));
    assert!([200, 409].contains(&patch.status), "{}", patch.text());
    let job = service.wait_for(id, &["succeeded"]);
    let chosen = job["resolved"]["scene"]["spacing"].as_f64().unwrap();
    assert!((1e-3..0.1).contains(&chosen), "{chosen}");
    assert!(job["resolved"]["accuracy"]["levels"].as_array().unwrap().len() >= 3);
    assert_eq!(study_of(&service, &job)["outcome"], "tolerance");
    let report = service.get(&format!("/v1/jobs/{id}/report")).json();
    let accuracy = &report["accuracy"];
    assert_eq!((&accuracy["met"], &accuracy["tolerance"]), (&json!(true), &json!(1e-7)), "{accuracy}");
    let (predicted, reached) = (accuracy["predicted"].as_f64().unwrap(), accuracy["reached"].as_f64().unwrap());
    assert!(predicted <= 1e-7 && reached > 1e-9, "met, and not at any price: {accuracy}");
    assert_eq!(job["health"]["findings"], json!([]));
    assert!(service.stop());
    service.fsck();
}

#[test]
fn what_cannot_be_asked_for_is_refused_at_once() {
    let (_directory, service) = service(&[]);
    let body = json!({"scene": {"kind": "redistance", "spacing": 0.1, "repeat": 0},
        "accuracy": {"quantity": {"error": {"quantity": "phi", "norm": "rsm"}}, "tolerance": 1e-16, "relativ": true}});
    let found = service.post("/v1/jobs", &body).pointers();
    for pointer in ["/scene/repeat", "/accuracy/tolerance", "/accuracy/relativ"] {
        assert!(found.iter().any(|at| at == pointer), "{pointer}: {found:?}");
    }
    let body = json!({"scene": {"kind": "redistance", "spacing": 0.1},
        "accuracy": {"quantity": {"error": {"quantity": "phi", "norm": "rsm"}}, "tolerance": 1e-6}});
    assert_eq!(service.post("/v1/jobs", &body).pointers(), ["/scene/spacing", "/accuracy/quantity/error/norm"]);
    let study = json!({"base": wanted(1e-4), "sweep": {"mode": "list", "points": [{}]}});
    assert_eq!(service.post("/v1/studies", &study).pointers(), ["/base/accuracy"]);
    assert_eq!(service.get("/v1/jobs").json()["items"], json!([]));
}

#[test]
fn a_job_that_waits_survives_a_crash_and_takes_its_study_along_when_it_is_canceled() {
    let (_directory, mut service) = service(&["--slots", "1"]);
    // Distances of this scene are slow: its study is under way for a while.
    let mut body = wanted(1e-9);
    body["scene"]["repeat"] = json!(200);
    let id = service.submit(&body);
    service.kill();
    service.restart();
    let job = service.job(&id);
    assert_eq!((&job["state"], &job["resolved"]), (&json!("queued"), &Value::Null));
    assert_eq!(service.act(&id, "cancel").status, 202);
    eventually("its study ends, too", Duration::from_secs(20), || {
        (study_of(&service, &service.job(&id))["state"] == "canceled").then_some(())
    });
    // And the other way about.
    let id = service.submit(&body);
    let study = service.job(&id)["lineage"]["study"].as_str().unwrap().to_owned();
    let answer = service.request("POST", &format!("/v1/studies/{study}/cancel"), &[], Some(b""));
    assert_eq!(answer.status, 202);
    let job = service.wait_for(&id, &["canceled", "failed"]);
    assert_eq!(job["reason"], "dependency.failed");
    assert!(service.stop());
    service.fsck();
}

/// What `meniscus calibrate` would say of the distance: errors hⁿ⁺¹ with the degree n, times a factor.
fn precision(factor: f64) -> Vec<PrecisionMeasured> {
    let scene = json!({"kind": "redistance", "shape": {"type": "circle", "radius": 1.0}});
    let mut rows = Vec::new();
    for degree in [3, 4, 5, 6] {
        let method = json!({"type": "pcp", "degree": degree});
        let mut scene = scene.clone();
        scene["method"] = method.clone();
        let scene = meniscus::scene::parse(&scene, meniscus::scenes::SCENES).unwrap();
        let name = reference_of(scene.as_ref(), Some(("/method", &method)));
        rows.extend([0.3, 0.2, 0.14, 0.1, 0.07, 0.05_f64].map(|spacing| PrecisionMeasured {
            problem: name.clone(),
            quantity: "phi".to_owned(),
            norm: "rms".to_owned(),
            spacing,
            error: factor * spacing.powi(degree + 1),
            cpu_s: 1e-4 * f64::from(degree) * spacing.powi(-2),
        }));
    }
    rows
}

#[test]
fn short_runs_and_one_level_tell_the_spacing_and_the_degree() {
    let (directory, mut service) = service(&["--slots", "1"]);
    assert!(service.stop());
    let store = Store::open(directory.path()).unwrap();
    store.keep_precision(&precision(0.1)).unwrap();
    store.close();
    service.restart();
    let id = service.submit(&wanted(1e-8));
    let job = service.wait_for(&id, &["succeeded"]);
    let accuracy = &job["resolved"]["accuracy"];
    assert!(accuracy["basis"].as_str().unwrap().contains("1 level of std_"), "{accuracy}");
    assert!(accuracy["levels"].as_array().unwrap().len() >= 6, "{accuracy}");
    let study = study_of(&service, &job);
    assert_eq!(study["outcome"], "tolerance", "{study}");
    let report = service.get(&format!("/v1/studies/{}/report", study["id"].as_str().unwrap())).json();
    assert_eq!(report["levels"].as_array().map(Vec::len), Some(1), "{report}");
    let chosen: Vec<&Value> =
        report["alternatives"].as_array().unwrap().iter().filter(|one| one["chosen"] == true).collect();
    assert_eq!(chosen.len(), 1, "{report}");
    assert_eq!(chosen[0]["point"]["/scene/method"]["degree"], job["resolved"]["scene"]["method"]["degree"]);
    let report = service.get(&format!("/v1/jobs/{id}/report")).json();
    assert_eq!(report["accuracy"]["met"], true, "{report}");
    assert!(service.stop());
    service.fsck();
}

#[test]
fn first_levels_that_a_check_ends_are_passed_over() {
    let (_directory, service) = service(&["--slots", "1"]);
    // The filament of this flow is finer than the first levels resolve.
    let body = json!({"scene": {"kind": "vortex", "flow": {"type": "single_vortex", "period": 6}, "end_time": 3},
        "accuracy": {"quantity": {"error": {"quantity": "phi", "norm": "rms"}}, "tolerance": 2e-3}});
    let id = service.submit(&body);
    let job = service.wait_for(&id, &["succeeded", "failed"]);
    assert_eq!(job["state"], "succeeded", "{job}");
    let study = study_of(&service, &job);
    let path = format!("/v1/studies/{}", study["id"].as_str().unwrap());
    let jobs = service.get(&format!("/v1/jobs?study={}", study["id"].as_str().unwrap())).json();
    let failed = jobs["items"].as_array().unwrap().iter().filter(|job| job["state"] == "failed").count();
    assert!(failed >= 1, "{jobs}");
    let report = service.get(&format!("{path}/report")).json();
    assert!(report["levels"][0]["index"].as_u64().unwrap() >= failed as u64, "{report}");
    let spacing = job["resolved"]["scene"]["spacing"].as_f64().unwrap();
    let levels = report["levels"].as_array().unwrap();
    let finest = levels.last().unwrap()["spacing"].as_f64().unwrap();
    assert!(spacing < 1.001 * levels[0]["spacing"].as_f64().unwrap() && spacing > 0.3 * finest, "{spacing}: {report}");
}

#[test]
fn a_quantity_that_no_report_has_fails_the_job_with_a_sentence() {
    let (_directory, service) = service(&["--slots", "1"]);
    let mut body = wanted(1e-5);
    body["accuracy"]["quantity"]["error"]["quantity"] = json!("fi");
    let job = service.wait_for(&service.submit(&body), &["failed"]);
    assert_eq!(job["reason"], "diverged.unresolved");
    assert!(job["message"].as_str().unwrap().contains("no error fi.rms"), "{job}");
}
