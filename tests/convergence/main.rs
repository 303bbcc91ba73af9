//! Orders of accuracy by fitted slopes against exact surfaces. Max norms of one random cloud scatter between two
//! levels, so slopes are fitted over five and judged by the root mean square.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "../support/mod.rs"]
#[expect(dead_code, reason = "each test target uses a part")]
mod support;

use serde_json::{Value, json};
use support::{error, run, slope};

fn slopes(levels: &[u32], extra: &Value, quantities: &[&str]) -> Vec<f64> {
    let mut points = vec![Vec::new(); quantities.len()];
    for n in levels {
        let h = 1.0 / f64::from(*n);
        let mut body = json!({"kind": "redistance", "spacing": h});
        body.as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
        let report = run(&body);
        for (points, quantity) in points.iter_mut().zip(quantities) {
            points.push((h, error(&report, quantity, "rms", None)));
        }
    }
    points.iter().map(|p| slope(p)).collect()
}

#[test]
fn ellipse_of_the_paper_has_order_five() {
    // PCP fig. 4: observed 4.8, theory 5 for degree 4.
    let found =
        slopes(&[16, 32, 64, 128, 256], &json!({"preset": "paper"}), &["phi", "closest_point", "normal", "curvature"]);
    for (found, least) in found.iter().zip([4.9, 4.6, 3.6, 2.6]) {
        assert!(*found >= least, "{found} for {least}");
    }
}

#[test]
fn every_degree_reaches_its_order() {
    // Theory: degree + 1. Degree 6 meets round-off beyond 1/96.
    for (degree, levels) in [
        (2, &[16, 32, 64, 128, 256][..]),
        (3, &[16, 32, 64, 128]),
        (5, &[16, 32, 64, 128]),
        (6, &[16, 24, 32, 48, 64, 96]),
    ] {
        let body = json!({"method": {"type": "pcp", "degree": degree}});
        let found = slopes(levels, &body, &["phi"])[0];
        assert!(found >= f64::from(degree) + 0.8, "degree {degree}: order {found}");
    }
}

#[test]
fn a_distance_as_input_keeps_the_order() {
    let found = slopes(&[16, 32, 64, 128, 256], &json!({"initial": "distance"}), &["phi"])[0];
    assert!(found >= 4.8, "order {found}");
    let found = slopes(&[16, 32, 64, 128, 256], &json!({"initial": "scaled"}), &["phi"])[0];
    assert!(found >= 4.8, "order {found}");
}

#[test]
fn ellipsoid_of_the_paper() {
    // PCP fig. 5: observed 4.9, 4.8, 3.8, 3.0; these few levels in the test allow a little less.
    let body = json!({"dimension": 3, "preset": "paper"});
    let found = slopes(&[8, 12, 16, 24, 32], &body, &["phi", "closest_point", "normal", "curvature"]);
    for (found, least) in found.iter().zip([4.8, 4.6, 3.6, 2.7]) {
        assert!(*found >= least, "{found} for {least}");
    }
}

#[test]
fn corners_and_rounded_corners_limit_the_order_to_one_and_two() {
    let square = json!({"shape": {"type": "box", "size": [1, 1]}, "band_h": 8});
    let found = slopes(&[16, 32, 64, 128, 256], &square, &["phi"])[0];
    assert!(found >= 0.9, "square: order {found}");
    let rounded = json!({"shape": {"type": "rounded_box", "size": [1.2, 0.8], "corner_radius": 0.2}, "band_h": 8});
    let found = slopes(&[16, 32, 64, 128, 256], &rounded, &["phi"])[0];
    assert!(found >= 1.9, "rounded rectangle: order {found}");
}
