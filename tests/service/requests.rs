//! Requests that are wrong, and documents that describe the right ones.

use crate::service;
use serde_json::{Value, json};
use std::process::Command;

#[test]
fn bad_bodies_name_every_error_and_start_nothing() {
    let (_directory, service) = service(&[]);
    let raw = |text: &str| service.request("POST", "/v1/jobs", &[], Some(text.as_bytes()));
    for unparsable in [
        "",
        "{",
        "{\"scene\": NaN}",
        "{\"scene\": {\"kind\": \"vortex\", \"spacing\": 1e999}}",
        "{\"a\": 1, \"a\": 2}",
        "[1] x",
    ] {
        let answer = raw(unparsable);
        assert_eq!(answer.status, 400, "{unparsable}");
        assert_eq!(answer.header("content-type"), Some("application/problem+json"));
    }
    let cases: Vec<(Value, Vec<&str>)> = vec![
        (json!([]), vec![""]),
        (json!({}), vec!["/scene"]),
        (json!({"scene": 3}), vec!["/scene"]),
        (json!({"scene": {}}), vec!["/scene/kind"]),
        (json!({"scene": {"kind": "vortx"}}), vec!["/scene/kind"]),
        (
            json!({"scene": {"kind": "vortex", "spacing": -0.1, "colour": 1}, "priorty": 1}),
            vec!["/priorty", "/scene/colour", "/scene/spacing"],
        ),
        (json!({"scene": {"kind": "vortex", "shape": {"type": "sphere", "radius": 0.1}}}), vec!["/scene/flow/type"]),
        (
            json!({"scene": {"kind": "vortex", "shape": {"type": "circle", "center": [0, 0, 0], "radius": 1}}}),
            vec!["/scene/shape/center"],
        ),
        (json!({"scene": {"kind": "vortex", "time_step": 0.1, "steps": 3}}), vec!["/scene/time_step"]),
        (json!({"scene": {"kind": "vortex", "preset": "papr"}}), vec!["/scene/preset"]),
        (
            json!({"scene": {"kind": "redistance", "method": {"type": "pcp", "degree": 9, "basis": "legendre"}}}),
            vec!["/scene/method/basis", "/scene/method/degree"],
        ),
        (
            json!({"scene": {"kind": "redistance", "shape": {"type": "union", "of": [{"type": "circle", "radius": 1}, {"type": "circle"}]}}}),
            vec!["/scene/shape/of/1/radius"],
        ),
        (
            json!({"scene": {"kind": "redistance", "shape": {"type": "union", "of": [{"type": "circle", "radius": 1}, {"type": "circle", "radius": 0.5}]}}}),
            vec!["/scene/shape/of"],
        ),
        (json!({"scene": {"kind": "redistance", "dimension": 3, "spacing": 0.0005}}), vec!["/scene/spacing"]),
        (json!({"scene": {"kind": "redistance"}, "output": {"fields": ["phi", "curvatur"]}}), vec!["/output/fields/1"]),
        (
            json!({"scene": {"kind": "redistance"}, "checkpoint": {"keep": 1}, "limits": {"wall_s": "x"}}),
            vec!["/checkpoint/keep", "/limits/wall_s"],
        ),
        (json!({"restart": {"checkpoint": "ckpt_nothing"}}), vec!["/restart/checkpoint"]),
        (json!({"restart": {"checkpoint": "ckpt_nothing"}, "scene": {"kind": "redistance"}}), vec!["/restart"]),
    ];
    for (body, expected) in cases {
        let answer = service.post("/v1/jobs", &body);
        assert_eq!(answer.status, 422, "{body}: {}", answer.text());
        let mut found = answer.pointers();
        found.sort();
        assert_eq!(found, expected, "{body}: {}", answer.text());
        for error in answer.json()["errors"].as_array().unwrap() {
            assert!(error["detail"].is_string() && error.get("got").is_some() && error.get("allowed").is_some());
        }
    }
    let many_frames = json!({"scene": {"kind": "redistance", "spacing": 0.002, "repeat": 1_000_000}, "output": {"every_time": 0.001}});
    let answer = service.post("/v1/jobs", &many_frames);
    assert_eq!(answer.status, 507, "{}", answer.text());
    assert!(answer.json()["detail"].as_str().unwrap().contains("every_time"));
    let typo = service.post("/v1/jobs", &json!({"scene": {"kind": "vortx"}})).json();
    assert_eq!(typo["errors"][0]["did_you_mean"], "vortex");
    assert_eq!(service.get("/v1/jobs").json()["items"], json!([]));
}

#[test]
fn other_requests_get_problems_too() {
    let (_directory, service) = service(&[]);
    for (method, path, status) in [
        ("GET", "/nothing", 404),
        ("GET", "/v1/jobs/job_nothing", 404),
        ("GET", "/v1/jobs/job_nothing/events", 404),
        ("GET", "/v1/jobs/job_nothing/files/../../../etc/passwd", 404),
        ("GET", "/v1/scenes/nothing", 404),
        ("GET", "/v1/checkpoints/nothing/content", 404),
        ("PUT", "/v1/jobs", 405),
        ("GET", "/v1/jobs?limit=0", 422),
        ("GET", "/v1/jobs?stat=running", 422),
        ("GET", "/v1/jobs?state=asleep", 422),
        ("GET", "/v1/jobs?sort=size", 422),
        ("GET", "/v1/jobs?created_after=yesterday", 422),
        ("GET", "/v1/jobs/%FF", 400),
        ("POST", "/v1/jobs/job_nothing/cancel", 404),
        ("DELETE", "/v1/jobs/job_nothing", 404),
    ] {
        let body: Option<&[u8]> = if method == "POST" || method == "PUT" { Some(b"") } else { None };
        let answer = service.request(method, path, &[], body);
        assert_eq!(answer.status, status, "{method} {path}: {}", answer.text());
        assert_eq!(answer.header("content-type"), Some("application/problem+json"), "{method} {path}");
        assert_eq!(answer.json()["status"], status);
        assert!(answer.header("x-request-id").is_some());
        assert!(!answer.text().contains(service.data.to_str().unwrap()));
        let explained = service.get(answer.json()["type"].as_str().unwrap());
        assert_eq!((explained.status, explained.header("content-type")), (200, Some("text/plain; charset=utf-8")));
        assert!(explained.text().starts_with(answer.json()["title"].as_str().unwrap()), "{}", explained.text());
    }
    assert_eq!(service.get("/problems/nothing").status, 404);
    // curl waits for a word before it sends a large body, and gets the answer instead.
    let large = service.data.join("large.json");
    std::fs::write(&large, vec![b' '; 2 << 20]).unwrap();
    let said = Command::new("curl")
        .args(["-s", "-o", "/dev/null", "-w", "%{http_code}", "--data-binary"])
        .arg(format!("@{}", large.display()))
        .arg(format!("{}/v1/jobs", service.url))
        .output()
        .unwrap();
    assert_eq!(String::from_utf8_lossy(&said.stdout), "413");
    // The service is none the worse for it.
    assert_eq!(service.get("/readyz").status, 200);
}

#[test]
fn all_errors_of_a_query_come_at_once() {
    let (_directory, service) = service(&[]);
    let query = "stat=queued&state=queued,asleep&limit=501&created_after=yesterday&sort=create_at&label.a=1";
    let answer = service.get(&format!("/v1/jobs?{query}"));
    assert_eq!(answer.status, 422, "{}", answer.text());
    assert_eq!(answer.pointers(), ["stat", "state", "limit", "created_after", "sort"]);
    let errors = answer.json()["errors"].clone();
    assert_eq!(errors[0]["did_you_mean"], "state");
    assert_eq!((&errors[1]["got"], &errors[1]["code"]), (&json!("asleep"), &json!("unknown")));
    assert!(errors[1]["allowed"].as_array().unwrap().contains(&json!("canceled")));
    assert_eq!((&errors[2]["code"], &errors[2]["allowed"]), (&json!("range"), &json!("1 to 500")));
    assert_eq!(errors[4]["did_you_mean"], "created_at");
    let answer = service.request("POST", "/v1/uploads?nam=x", &[], Some(b"1 2 3\n"));
    assert_eq!(answer.pointers(), ["nam", "as"]);
    assert_eq!(
        answer.json()["errors"][1]["allowed"],
        json!(["checkpoint", "points", "surface", "queries", "mesh", "values", "flow"])
    );
}

#[test]
fn documents_describe_the_service() {
    let (_directory, service) = service(&[]);
    assert_eq!(service.get("/healthz").json()["status"], "ok");
    let index = service.get("/v1").json();
    assert!(index["limits"]["memory_bytes"].as_u64().unwrap() > 1 << 28);
    let document = service.get("/openapi.json").json();
    assert!(document["openapi"].as_str().unwrap().starts_with("3.1"));
    for path in ["/v1/jobs", "/v1/jobs/{id}/files/{path}", "/v1/jobs/{id}/events", "/v1/checkpoints/{id}/content"] {
        assert!(
            document["paths"][path].is_object(),
            "{path} is not documented: {:?}",
            document["paths"].as_object().unwrap().keys()
        );
    }
    let scenes = service.get("/v1/scenes").json();
    assert_eq!(scenes["items"].as_array().unwrap().len(), meniscus::scenes::SCENES.len());
    for scene in scenes["items"].as_array().unwrap() {
        assert_eq!(scene["schema"]["$schema"], "https://json-schema.org/draft/2020-12/schema");
        assert_eq!(scene["schema"]["additionalProperties"], false);
        assert_eq!(
            service.get(&format!("/v1/scenes/{}", scene["kind"].as_str().unwrap())).json()["title"],
            scene["title"]
        );
    }
}

#[test]
fn a_second_service_on_the_same_directory_and_a_public_address_are_refused() {
    let (_directory, service) = service(&[]);
    let run = |arguments: &[&str]| Command::new(crate::support::program()).args(arguments).output().unwrap();
    let data = service.data.to_str().unwrap();
    let second = run(&["serve", "--bind", "127.0.0.1:0", "--data", data]);
    assert!(!second.status.success());
    assert!(String::from_utf8_lossy(&second.stderr).contains("another service uses this data directory"));
    let public = run(&["serve", "--bind", "0.0.0.0:0", "--data", data]);
    assert!(!public.status.success());
    assert!(String::from_utf8_lossy(&public.stderr).contains("not a loopback address"));
}
