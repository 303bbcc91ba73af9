//! Studies that refine: levels one after another until a quantity is known to a tolerance.

use crate::service;
use crate::support::{Service, endless_job, eventually};
use serde_json::{Value, json};
use std::time::Duration;

/// A study of a redistancing, with changes of its sweep.
fn study(changes: &Value) -> Value {
    let mut sweep = json!({
        "mode": "refine", "axis": "/scene/spacing", "from": 0.1, "ratio": 1.5, "levels": {"least": 3, "most": 6},
        "quantity": {"error": {"quantity": "phi", "norm": "rms"}}, "until": {"tolerance": 1e-6},
    });
    for (name, value) in changes.as_object().unwrap() {
        sweep[name] = value.clone();
    }
    json!({"base": {"scene": {"kind": "redistance", "method": {"type": "pcp"}}}, "sweep": sweep})
}

fn submit(service: &Service, body: &Value) -> String {
    let answer = service.post("/v1/studies", body);
    assert_eq!(answer.status, 201, "{}", answer.text());
    answer.json()["id"].as_str().unwrap().to_owned()
}

fn state(service: &Service, id: &str) -> Value {
    service.get(&format!("/v1/studies/{id}")).json()
}

fn ended(service: &Service, id: &str) -> Value {
    eventually("the study ends", Duration::from_secs(120), || {
        let study = state(service, id);
        ["succeeded", "failed", "canceled"].contains(&study["state"].as_str().unwrap()).then_some(study)
    })
}

fn report(service: &Service, id: &str) -> Value {
    service.get(&format!("/v1/studies/{id}/report")).json()
}

fn act(service: &Service, id: &str, action: &str) -> Value {
    let answer = service.request("POST", &format!("/v1/studies/{id}/{action}"), &[], Some(b""));
    assert_eq!(answer.status, 202, "{}", answer.text());
    answer.json()
}

/// The jobs of a study, the oldest first.
fn jobs(service: &Service, id: &str) -> Vec<Value> {
    let answer = service.get(&format!("/v1/studies/{id}/jobs?sort=created_at&limit=100")).json();
    answer["items"].as_array().unwrap().clone()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

#[test]
fn levels_are_made_until_the_tolerance_is_met_and_are_taken_from_equal_jobs() {
    let (_directory, mut service) = service(&["--slots", "2"]);
    let body = study(&json!({}));
    let dry = service.post("/v1/studies?dry_run=true", &body).json();
    assert_eq!(dry["points"].as_array().unwrap().len(), 6);
    assert_eq!(dry["estimate"]["points"], 3, "these are made in any case");
    let id = submit(&service, &body);
    let whole = ended(&service, &id);
    assert_eq!(
        (&whole["state"], &whole["outcome"], &whole["fraction"]),
        (&json!("succeeded"), &json!("tolerance"), &json!(1.0))
    );
    let found = report(&service, &id);
    let levels = found["levels"].as_array().unwrap();
    assert!((3..=6).contains(&levels.len()) && whole["points"] == levels.len(), "{found}");
    assert!(number(&levels.last().unwrap()["value"]) <= 1e-6);
    assert!(number(&levels[levels.len() - 2]["value"]) > 1e-6, "no level was made without need: {found}");
    assert!((number(&found["order"]["value"]) - 5.0).abs() < 0.5, "{found}");
    assert!(number(&found["order"]["low"]) < number(&found["order"]["high"]));
    assert_eq!((&found["tolerance_met"], &found["convergence"]), (&json!(true), &json!("monotone")));
    assert_eq!((&found["next"], &found["reused"], &found["extrapolated"]), (&Value::Null, &json!([]), &Value::Null));
    assert_eq!(levels[1]["job"], jobs(&service, &id)[1]["id"]);
    assert!((number(&levels[1]["spacing"]) - 0.1 / 1.5).abs() < 1e-12);
    let csv = service.get(&format!("/v1/studies/{id}/table")).text();
    assert!(
        csv.starts_with("index,level,/scene/spacing,job,state,reason,cpu_s,wall_s,particles,steps,health,"),
        "{csv}"
    );
    assert_eq!(csv.lines().count(), levels.len() + 1);
    let accept = [("accept", "image/svg+xml")];
    let picture = service.request("GET", &format!("/v1/studies/{id}/report"), &accept, None);
    assert_eq!(picture.header("content-type"), Some("image/svg+xml"));
    assert!(picture.text().contains("theory") && picture.text().contains("phi.rms"));
    // The same levels for a looser tolerance cost nothing more.
    let again = submit(&service, &study(&json!({"until": {"tolerance": 1e-4}})));
    ended(&service, &again);
    let reused = report(&service, &again);
    assert_eq!(reused["reused"].as_array().unwrap().len(), 3, "{reused}");
    assert_eq!((&reused["levels"][2]["value"], &reused["levels"][2]["job"]), (&levels[2]["value"], &levels[2]["job"]));
    assert_eq!((jobs(&service, &again).len(), number(&reused["spent_cpu_s"])), (0, 0.0));
    let anew = submit(&service, &study(&json!({"until": {"tolerance": 1e-4}, "reuse": false})));
    ended(&service, &anew);
    assert_eq!(jobs(&service, &anew).len(), 3);
    // What levels have come to outlives their jobs.
    assert_eq!(service.request("DELETE", &format!("/v1/studies/{id}"), &[], None).status, 204);
    assert_eq!(report(&service, &again)["levels"][0]["value"], reused["levels"][0]["value"]);
    let table = service.request("GET", &format!("/v1/studies/{again}/table"), &[("accept", "application/json")], None);
    assert_eq!(table.json()["rows"].as_array().unwrap().len(), 3);
    assert_eq!(service.request("DELETE", &format!("/v1/studies/{again}"), &[], None).status, 204);
    assert!(service.stop());
    service.fsck();
}

#[test]
fn the_cheapest_alternative_goes_on_and_the_others_stop() {
    let (_directory, service) = service(&["--slots", "1"]);
    let id = submit(
        &service,
        &study(&json!({
            "alternatives": {"/scene/method/degree": [2, 4]}, "until": {"tolerance": 1e-7}, "from": 0.07,
        })),
    );
    ended(&service, &id);
    let found = report(&service, &id);
    let alternatives = found["alternatives"].as_array().unwrap();
    assert_eq!(alternatives[1]["point"], json!({"/scene/method/degree": 4}));
    assert_eq!((&alternatives[0]["chosen"], &alternatives[1]["chosen"]), (&json!(false), &json!(true)), "{found}");
    assert!((number(&alternatives[0]["order"]) - 3.0).abs() < 0.3, "{found}");
    assert_eq!(found["tolerance_met"], true);
    let table = service.request("GET", &format!("/v1/studies/{id}/table"), &[("accept", "application/json")], None);
    let rows = table.json()["rows"].as_array().unwrap().clone();
    let of_degree = |degree: u64| rows.iter().filter(|row| row["/scene/method/degree"] == degree).count();
    assert_eq!(of_degree(2), 3, "the coarse levels alone");
    assert!(of_degree(4) > 3);
}

#[test]
fn points_of_a_surface_are_refined_by_their_count_and_values_are_extrapolated() {
    let (_directory, service) = service(&["--slots", "1"]);
    let sweep = |quantity: Value, tolerance: f64| {
        json!({"base": {"scene": {"kind": "surface_pde"}},
            "sweep": {"mode": "refine", "axis": "/scene/count", "from": 1000, "ratio": 1.4, "levels": {"least": 3, "most": 5},
                "quantity": quantity, "until": {"tolerance": tolerance}}})
    };
    let error = json!({"error": {"quantity": "value", "norm": "relative"}});
    let id = submit(&service, &sweep(error, 1e-9));
    assert_eq!(ended(&service, &id)["outcome"], "levels");
    let found = report(&service, &id);
    assert!((number(&found["order"]["value"]) - 2.0).abs() < 0.2, "{found}");
    assert_eq!((&found["tolerance_met"], &found["asymptotic"]), (&json!(false), &json!(true)), "{found}");
    assert!(number(&found["next"]["value"]) > 1e6 && number(&found["next"]["cpu_s"]) > 1.0, "{found}");
    // The same levels, and a number of their series that is as good as a value without an exact answer.
    let id = submit(&service, &sweep(json!({"series": "error_relative", "of": "at"}), 1e-9));
    ended(&service, &id);
    let found = report(&service, &id);
    assert_eq!(found["reused"].as_array().unwrap().len(), 5);
    let finest = number(&found["levels"][4]["value"]);
    assert!(number(&found["extrapolated"]).abs() < 0.2 * finest, "{found}");
    assert!(number(&found["gci"]) > number(&found["levels"][4]["error_estimate"]));
}

#[test]
fn everything_wrong_with_a_refinement_is_named_at_once() {
    let (_directory, service) = service(&[]);
    let faults = json!({"axis": "spacing", "from": -1, "ratio": 1, "levels": {"least": 1, "most": 20}, "with": {"/scene/repeat": "slowly"},
        "quantity": {"error": {"quantity": "phi"}}, "until": {"tolerance": 0}, "budget": {"cpu": 3}, "reuse": 1});
    let found = service.post("/v1/studies", &study(&faults)).pointers();
    for pointer in [
        "/sweep/axis",
        "/sweep/from",
        "/sweep/ratio",
        "/sweep/levels/least",
        "/sweep/levels/most",
        "/sweep/with/~1scene~1repeat",
        "/sweep/quantity/error/norm",
        "/sweep/until/tolerance",
        "/sweep/budget/cpu",
        "/sweep/reuse",
    ] {
        assert!(found.iter().any(|at| at == pointer), "{pointer}: {found:?}");
    }
    let meaning = |changes: Value| service.post("/v1/studies", &study(&changes)).pointers();
    let found = meaning(
        json!({"axis": "/scene/spacin", "levels": {"least": 5, "most": 4}, "with": {"/scene/time_step": "proportional"},
        "quantity": {"error": {"quantity": "phi", "norm": "rsm"}, "series": "phi_error"}}),
    );
    for pointer in [
        "/sweep/axis",
        "/sweep/levels/least",
        "/sweep/with/~1scene~1time_step",
        "/sweep/quantity",
        "/sweep/quantity/error/norm",
        "/sweep/quantity/series",
    ] {
        assert!(found.iter().any(|at| at == pointer), "{pointer}: {found:?}");
    }
    assert_eq!(
        meaning(json!({"until": {"tolerance": 1e-3, "relative": true}})),
        ["/sweep/until/relative"],
        "of phi.rms no size is known"
    );
    assert_eq!(meaning(json!({"axis": "/scene/jitter", "from": 0.4})), ["/sweep/axis"], "it is no spacing");
    assert_eq!(
        meaning(json!({"alternatives": {"/scene/method/degree": [3, 99]}})),
        ["/sweep/alternatives/~1scene~1method~1degree/1"]
    );
    let degrees: Vec<u64> = vec![4; 17];
    assert_eq!(meaning(json!({"alternatives": {"/scene/method/degree": degrees}})), ["/sweep/alternatives"]);
    let suggestion =
        service.post("/v1/studies", &study(&json!({"quantity": {"error": {"quantity": "phi", "norm": "rsm"}}}))).json();
    assert_eq!(suggestion["errors"][0]["did_you_mean"], "rms");
    assert_eq!(service.get("/v1/studies").json()["items"], json!([]));
}

#[test]
fn what_the_levels_cannot_tell_or_afford_ends_the_study_with_a_sentence() {
    let (_directory, service) = service(&["--slots", "1"]);
    let end = |changes: Value| {
        let id = submit(&service, &study(&changes));
        let study = ended(&service, &id);
        (study["outcome"].as_str().unwrap().to_owned(), study["message"].as_str().unwrap().to_owned(), id)
    };
    let (outcome, message, _) = end(json!({"quantity": {"error": {"quantity": "fi", "norm": "rms"}}}));
    assert!(outcome == "failed" && message.contains("fi.rms") && message.contains("phi.rms"), "{message}");
    let (outcome, message, id) = end(json!({"budget": {"cpu_s": 1e-6}, "until": {"tolerance": 1e-12}, "from": 0.09}));
    assert!(outcome == "budget" && message.contains("CPU seconds"), "{message}");
    assert!(jobs(&service, &id).len() < 3);
    // The third level has ten thousand times as many particles as the first, and a small machine.
    let mut large = study(&json!({"ratio": 10, "levels": {"least": 2, "most": 8}, "until": {"tolerance": 1e-30}}));
    large["base"]["limits"] = json!({"memory_bytes": 64 << 20});
    let id = submit(&service, &large);
    let found = ended(&service, &id);
    assert_eq!(found["outcome"], "memory", "{found}");
    assert!(found["message"].as_str().unwrap().contains("particles need"), "{found}");
    assert_eq!(report(&service, &id)["tolerance_met"], false);
    let (outcome, ..) = end(json!({"quantity": {"report": "/cost/steps"}, "until": {"tolerance": 0.1}}));
    assert_eq!(outcome, "tolerance", "values that are equal are known");
    let (outcome, message, id) = end(json!({"quantity": {"report": "/cost/particle_steps_per_s/x"}}));
    assert!(outcome == "failed" && message.contains("no number at /cost"), "{message}");
    assert_eq!(state(&service, &id)["state"], "failed");
}

#[test]
fn a_study_pauses_between_levels_resumes_cancels_and_repeats_what_was_canceled() {
    let (_directory, mut service) = service(&["--slots", "1"]);
    let slow = json!({"base": endless_job(), "sweep": study(&json!({"from": 0.03}))["sweep"]});
    let id = submit(&service, &slow);
    let level = eventually("the first level runs", Duration::from_secs(20), || {
        jobs(&service, &id).first().filter(|job| job["state"] == "running").cloned()
    });
    act(&service, &id, "pause");
    eventually("it rests", Duration::from_secs(20), || (state(&service, &id)["state"] == "paused").then_some(()));
    assert_eq!(service.request("DELETE", &format!("/v1/studies/{id}"), &[], None).status, 409);
    service.kill();
    service.restart();
    assert_eq!(state(&service, &id)["state"], "paused");
    act(&service, &id, "resume");
    let resumed = |service: &Service| service.job(level["id"].as_str().unwrap())["state"] == "running";
    eventually("it goes on", Duration::from_secs(20), || resumed(&service).then_some(()));
    act(&service, &id, "cancel");
    let study = ended(&service, &id);
    assert_eq!((&study["state"], &study["outcome"]), (&json!("canceled"), &json!("canceled")));
    assert_eq!(jobs(&service, &id).len(), 1);
    act(&service, &id, "retry");
    let repeated =
        eventually("the level is made anew", Duration::from_secs(20), || jobs(&service, &id).get(1).cloned());
    assert_eq!((&repeated["lineage"]["retry_of"], &repeated["lineage"]["study"]), (&level["id"], &json!(id)));
    // One job of it is canceled by itself: the study cannot go on, and says so.
    service.act(repeated["id"].as_str().unwrap(), "cancel");
    let study = ended(&service, &id);
    assert_eq!(study["state"], "canceled");
    assert!(study["message"].as_str().unwrap().contains("level 0 was canceled"), "{study}");
    act(&service, &id, "cancel");
    assert_eq!(service.request("DELETE", &format!("/v1/studies/{id}"), &[], None).status, 204);
    assert!(service.stop());
    service.fsck();
}
