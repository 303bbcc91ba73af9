//! The rows of `surface_pde` that there are problems for: pointwise operators (Surface DC-PSE paper, section 4).

use crate::scene::rows::{Figure, Measure, Plot, Quantity, Reach, Row, Rows};
use serde_json::{Value, json};

const ERROR: Quantity = Quantity::at_end("value", "relative");
/// Counts of the series by which orders are judged.
const COUNTS: [u64; 4] = [1000, 4000, 16_000, 64_000];

fn wave(count: u64, order: u64) -> Value {
    json!({
        "kind": "surface_pde", "count": count, "repeat": 20,
        "problem": {"type": "laplace_beltrami", "field": {"type": "plane_wave", "k": [2, 1, 1]}},
        "method": {"type": "surface_dcpse", "order": order}
    })
}

/// All rows.
#[must_use]
pub fn rows() -> Rows {
    let mut rows = Vec::new();
    let mut row = |case: String, paper: &'static str, runs: Vec<Value>, measure: Measure, reach: Reach| {
        rows.push(Row { case, paper, runs, measure, reach, is_long: false });
    };
    let reach = [(2, 1e-3, 2.5e-6), (4, 2.5e-6, 6e-6), (6, 1e-8, 15e-6)];
    for (order, error, seconds) in reach {
        let run = wave(16_000, order);
        let case = |what: &str| format!("plane wave k = (2, 1, 1), N = 16,000, order {order}: {what}");
        row(case("error"), "–", vec![run.clone()], Measure::Error(ERROR), Reach::AtMost(error));
        let building = Measure::Seconds("operators/construction");
        row(case("seconds to construct"), "–", vec![run], building, Reach::AtMost(seconds * 16_000.0));
    }
    for (count, order, nanoseconds) in [(16_000, 2, 30.0), (64_000, 4, 75.0)] {
        let case = format!("order {order}, N = {count}: seconds an application");
        let reach = Reach::AtMost(1e-9 * nanoseconds * count as f64);
        let applying = Measure::SecondsPerStep("operators/application");
        row(case, "84 to 200 ns a point (OpenFPM here)", vec![wave(count, order)], applying, reach);
    }
    let harmonic = |count: u64| json!({"kind": "surface_pde", "count": count});
    let case = "Y₄₀, sphere, N = 16,000, order 2: error".to_owned();
    row(case, "4.02e-3 (its own form)", vec![harmonic(16_000)], Measure::Error(ERROR), Reach::AtMost(4.02e-3));
    for (order, least) in [(2, 1.95), (4, 3.9), (6, 5.8)] {
        let case = format!("plane wave, sphere, N = 1,000 to 64,000, order {order}: slope");
        let runs = COUNTS.map(|count| wave(count, order)).to_vec();
        row(case, "–", runs, Measure::Order { of: ERROR, floor: 1e-11 }, Reach::AtLeast(least));
    }
    let lines =
        [2, 4, 6].map(|order| (format!("order {order}"), COUNTS.map(|count| wave(count, order)).to_vec())).to_vec();
    let figures = vec![Figure {
        name: "surface-orders",
        title: "Plane wave on the sphere: relative L2 error",
        plot: Plot::SpeedAgainstError { quantity: ERROR, phases: "operators/construction", lines },
    }];
    Rows { document: "surface", rows, figures }
}

/// Short scenes by which a machine is measured.
pub(super) fn calibration() -> Vec<Value> {
    let run = |count: u64, order: u64| json!({"kind": "surface_pde", "count": count, "repeat": 10, "method": {"type": "surface_dcpse", "order": order}});
    vec![run(8000, 2), run(4000, 4), run(2000, 6)]
}
