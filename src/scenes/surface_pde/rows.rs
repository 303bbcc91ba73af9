//! The rows of `surface_pde` that there are problems for: pointwise operators (Surface DC-PSE paper, section 4).

use crate::scene::rows::{Figure, Measure, Plot, Quantity, Reach, Row, Rows};
use serde_json::{Value, json};

const ERROR: Quantity = Quantity::at_end("value", "relative");
/// Counts of the series by which orders are judged.
const COUNTS: [u64; 4] = [1000, 4000, 16_000, 64_000];

fn wave(count: u64, order: u64) -> Value {
    // `spacing` is no parameter here: δn is what errors are drawn over.
    json!({
        "kind": "surface_pde", "count": count, "repeat": 20,
        "problem": {"type": "laplace_beltrami", "field": {"type": "plane_wave", "k": [2, -1, 3]}},
        "method": {"type": "surface_dcpse", "order": order}
    })
}

/// All rows.
#[must_use]
pub fn rows() -> Rows {
    let mut rows = Vec::new();
    let mut row = |case: String, paper: &'static str, runs: Vec<Value>, measure: Measure, reach: f64| {
        rows.push(Row { case, paper, runs, measure, reach: Reach::AtMost(reach), is_long: false });
    };
    let reach = [(2, 1e-3, 2.5e-6), (4, 2.5e-6, 6e-6), (6, 1e-8, 15e-6)];
    for (order, error, seconds) in reach {
        let run = wave(16_000, order);
        let case = |what: &str| format!("plane wave, sphere, N = 16,000, order {order}: {what}");
        row(case("error"), "–", vec![run.clone()], Measure::Error(ERROR), error);
        let building = Measure::Seconds("operators/construction");
        row(case("seconds to construct"), "–", vec![run], building, seconds * 16_000.0);
    }
    for (count, order, nanoseconds) in [(16_000, 2, 30.0), (64_000, 4, 75.0)] {
        let case = format!("order {order}, N = {count}: seconds an application");
        let reach = 1e-9 * nanoseconds * count as f64;
        let applying = Measure::SecondsPerStep("operators/application");
        row(case, "84 to 200 ns a point (OpenFPM here)", vec![wave(count, order)], applying, reach);
    }
    let harmonic = |count: u64| json!({"kind": "surface_pde", "count": count});
    let case = "Y₄₀, sphere, N = 16,000, order 2: error".to_owned();
    row(case, "4.02e-3 (its own form)", vec![harmonic(16_000)], Measure::Error(ERROR), 4.02e-3);
    let lines = [2, 4, 6].map(|order| {
        let points = COUNTS.map(|count| ((count as f64).log10(), wave(count, order)));
        (format!("order {order}"), points.to_vec())
    });
    let figures = vec![Figure {
        name: "surface-orders",
        title: "Plane wave on the sphere: relative L2 error over log₁₀ N",
        plot: Plot::Points { across: "log10 N", quantity: ERROR, lines: lines.to_vec(), expected: Vec::new() },
    }];
    Rows { document: "surface", rows, figures }
}

/// Short scenes by which a machine is measured.
pub(super) fn calibration() -> Vec<Value> {
    let run = |count: u64, order: u64| json!({"kind": "surface_pde", "count": count, "repeat": 10, "method": {"type": "surface_dcpse", "order": order}});
    vec![run(8000, 2), run(4000, 4), run(2000, 6)]
}
