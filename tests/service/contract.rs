//! The OpenAPI document against the running service, by schemathesis: whatever fits the document, and much that does not,
//! gets an answer that the document has, and never a 5xx.

use crate::{python, service};
use serde_json::json;
use std::process::Command;

#[test]
fn schemathesis_finds_no_failure() {
    let Some(python) = python() else { return };
    let (_directory, service) = service(&["--slots", "1"]);
    // Something to be found under every path, so that more than "not found" is tried.
    let job = service.submit(&json!({"scene": {"kind": "redistance", "spacing": 0.1}}));
    service.wait_for(&job, &["succeeded"]);
    let checkpoint = service.get(&format!("/v1/jobs/{job}/checkpoints")).json()["items"][0]["id"].clone();
    let study =
        json!({"base": {"scene": {"kind": "redistance", "spacing": 0.1}}, "sweep": {"mode": "list", "points": [{}]}});
    let study = service.post("/v1/studies", &study).json()["id"].clone();
    let upload = service.request("POST", "/v1/uploads?as=queries", &[], Some(b"1 2 3\n")).json()["id"].clone();
    let mut settings = String::new();
    for (place, id) in [("jobs", &json!(job)), ("checkpoints", &checkpoint), ("studies", &study), ("uploads", &upload)]
    {
        settings += &format!(
            "[[operations]]\ninclude-path-regex = \"^/v1/{place}/\"\nexclude-method = \"DELETE\"\nparameters = {{ \"path.id\" = {id} }}\n\n"
        );
    }
    std::fs::write(service.data.join("schemathesis.toml"), settings).unwrap();
    let examples = std::env::var("MENISCUS_EXAMPLES").unwrap_or_else(|_| "20".to_owned());
    let tool = std::path::Path::new(&python).with_file_name("schemathesis");
    let output = Command::new(tool)
        .arg("run")
        .arg(format!("{}/openapi.json", service.url))
        .args([
            "--max-examples",
            &examples,
            "--seed",
            "1",
            "--workers",
            "1",
            "--no-color",
            "--phases",
            "examples,coverage,fuzzing",
        ])
        // Streams go on for as long as the service does.
        .args(["--request-timeout", "20", "--max-response-time", "10"])
        .args([
            "--checks",
            "not_a_server_error,status_code_conformance,content_type_conformance,response_schema_conformance",
        ])
        .current_dir(service.data.clone())
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{text}{}", String::from_utf8_lossy(&output.stderr));
}
