//! Mistakes in a case are errors with their place.

use super::{Bound, Case, is_case, job_body};
use serde_json::{Value, json};

fn case() -> Value {
    json!({
        "title": "Circle", "source": "A paper, section 1",
        "runs": {"coarse": {"kind": "redistance", "spacing": 0.1}, "fine": {"kind": "redistance", "spacing": 0.05}},
        "targets": [{
            "title": "fine: maximum error", "runs": ["fine"], "bound": {"at_most": 1e-3},
            "measure": {"type": "error", "quantity": "phi", "norm": "max"}
        }]
    })
}

/// The error of a case with one value changed or added.
fn error_of(pointer: &str, name: &str, value: Value) -> String {
    let mut case = case();
    case.pointer_mut(pointer).unwrap()[name] = value;
    Case::parse("circle.json", case.to_string().as_bytes()).unwrap_err().to_string()
}

#[test]
fn a_case_reads_the_runs_that_its_targets_name() {
    let case = Case::parse("circle.json", case().to_string().as_bytes()).unwrap();
    let names: Vec<&str> = case.runs_of(&case.targets[0]).map(|(name, _)| name).collect();
    assert_eq!(names, ["fine"]);
    assert_eq!(case.source_of(&case.targets[0]), "A paper, section 1");
    assert_eq!(case.targets[0].bound, Bound::AtMost(1e-3));
    assert!(!case.targets[0].is_long);
}

#[test]
fn without_names_a_target_reads_all_runs_in_their_order() {
    let mut value = case();
    value["targets"][0].as_object_mut().unwrap().remove("runs");
    let case = Case::parse("circle.json", value.to_string().as_bytes()).unwrap();
    assert_eq!(case.runs_of(&case.targets[0]).map(|(name, _)| name).collect::<Vec<_>>(), ["coarse", "fine"]);
}

#[test]
fn unknown_fields_are_errors_with_their_place() {
    for (pointer, place) in
        [("", "circle.json"), ("/targets/0", "targets[0]"), ("/targets/0/measure", "targets[0].measure")]
    {
        let message = error_of(pointer, "colour", json!(1));
        assert!(message.contains(place) && message.contains("unknown field `colour`"), "{message}");
    }
    let message = error_of("/targets/0", "bound", json!({"within": {"value": 1.0, "tolerance": 0.1, "colour": 1}}));
    assert!(message.contains("targets[0].bound") && message.contains("unknown field `colour`"), "{message}");
    let message = error_of("/targets/0", "measure", json!({"type": "memory", "colour": 1}));
    assert!(message.contains("targets[0].measure") && message.contains("unknown field `colour`"), "{message}");
}

#[test]
fn other_mistakes_are_errors_with_their_place_too() {
    let measure = |value: Value| error_of("/targets/0", "measure", value);
    assert!(measure(json!({"type": "eror"})).contains("unknown variant `eror`"));
    assert!(measure(json!({"type": "error", "quantity": "phi"})).contains("targets[0].measure: missing field `norm`"));
    let ratio = json!({"type": "ratio", "quantity": "phi", "norm": "max"});
    assert!(measure(ratio).contains("targets[0].runs: the measure reads at least 2 runs, not 1"));
    assert!(
        error_of("/targets/0", "runs", json!(["finest"])).contains("no run named \"finest\"; there are coarse, fine")
    );
    assert!(error_of("/runs", "../up", json!({})).contains("runs: \"../up\" names a folder"));
    assert!(error_of("", "runs", json!({})).contains("runs: a case has at least one run"));
    assert!(error_of("", "targets", json!([])).contains("targets: a case has at least one target"));
    assert!(error_of("", "source", json!(" ")).contains("source"));
    let twice = Case::parse("circle.json", b"{\"title\": \"a\", \"title\": \"b\"}").unwrap_err().to_string();
    assert!(twice.contains("line 1, column") && twice.contains("duplicate key"), "{twice}");
}

#[test]
fn no_value_that_is_not_a_number_meets_a_bound() {
    for bound in [Bound::AtMost(1.0), Bound::AtLeast(0.0), Bound::Within { value: 1.0, tolerance: 5.0 }, Bound::None] {
        assert!(!bound.is_met(f64::NAN));
        assert!(bound.is_met(1.0));
    }
}

#[test]
fn a_file_is_a_case_a_job_body_or_a_scene() {
    let scene = json!({"kind": "redistance"});
    let body = json!({"scene": {"kind": "redistance"}, "name": "x"});
    assert!(is_case(&case()) && !is_case(&scene) && !is_case(&body));
    assert_eq!(job_body(&scene), json!({"scene": {"kind": "redistance"}}));
    assert_eq!(job_body(&body), body);
}
