//! The rows of `vortex` with closest points: PCP paper, section 4.2, and what goes beyond it.

use crate::scene::rows::{Figure, Measure, Plot, Quantity, Reach, Row, Rows};
use serde_json::{Value, json};
use std::f64::consts::TAU;

const END: Quantity = Quantity::at("phi", "rms", 8.0);
const HALFWAY: Quantity = Quantity::at("phi", "rms", 4.0);

fn paper(cells: u32) -> Value {
    json!({"kind": "vortex", "preset": "paper", "spacing": 1.0 / f64::from(cells)})
}

fn general(cells: u32) -> Value {
    json!({"kind": "vortex", "field": "overwrite", "spacing": 1.0 / f64::from(cells)})
}

fn material(cells: u32) -> Value {
    json!({"kind": "vortex", "spacing": 1.0 / f64::from(cells)})
}

fn dual(cells: u32) -> Value {
    let method = json!({
        "type": "pcp", "neighborhood": {"type": "nearest", "count": 40}, "degree": 3, "tolerance": 1e-12,
        "max_iterations": 100
    });
    let when = json!({"type": "every", "steps": 2});
    json!({"kind": "vortex", "method": method, "redistance": when, "spacing": 1.0 / f64::from(cells)})
}

/// All rows.
#[must_use]
pub fn rows() -> Rows {
    let mut rows = Vec::new();
    let mut row = |case: &str, paper: &'static str, runs: Vec<Value>, measure: Measure, reach: Reach, is_long: bool| {
        rows.push(Row { case: case.to_owned(), paper, runs, measure, reach, is_long });
    };
    for (cells, figure, text) in [(128, 2.90e-3, "2.90e-3"), (256, 1.10e-3, "1.10e-3")] {
        let reach = Reach::Within { of: figure, by: 0.25 * figure };
        row(&format!("preset paper, 1/{cells}: RMS at T"), text, vec![paper(cells)], Measure::Error(END), reach, true);
    }
    for (cells, text, most) in
        [(64, "1.42e-2", 3.5e-3), (128, "2.90e-3", 1e-3), (256, "1.10e-3", 6e-4), (512, "3.98e-4", 2.5e-4)]
    {
        let case = format!("overwrite, auto, 1/{cells}: RMS at T");
        row(&case, text, vec![general(cells)], Measure::Error(END), Reach::AtMost(most), cells > 128);
    }
    let both = |cells| vec![paper(cells), general(cells)];
    row(
        "overwrite, auto, 1/128: time by that of preset paper",
        "1",
        both(128),
        Measure::SecondsShare("redistancing"),
        Reach::AtMost(0.25),
        true,
    );
    for cells in [64, 128, 256] {
        let case = format!("dual, auto, 1/{cells}: RMS at T");
        row(&case, "2.90e-3 at 1/128", vec![material(cells)], Measure::Error(END), Reach::AtMost(3e-6), cells > 128);
    }
    row(
        "dual, auto, 1/128: RMS at T/2",
        "2.3e-2 (its method here)",
        vec![material(128)],
        Measure::Error(HALFWAY),
        Reach::AtMost(1.5e-3),
        false,
    );
    let area = Quantity::at("area", "relative", 8.0);
    row(
        "dual, auto, 1/128: area at T",
        "1.18e-2",
        vec![material(128)],
        Measure::Error(area),
        Reach::AtMost(1e-5),
        false,
    );
    let every = json!({
        "kind": "vortex", "field": "overwrite", "redistance": {"type": "every", "steps": 1}, "spacing": 1.0 / 256.0
    });
    row(
        "240 redistancings, 1/256: seconds",
        "37 (its method here)",
        vec![every],
        Measure::Seconds("redistancing"),
        Reach::AtMost(6.0),
        true,
    );
    let zalesak = json!({
        "kind": "vortex", "spacing": 1.0 / 128.0, "end_time": 1, "steps": 240,
        "flow": {"type": "rotation", "center": [0.5, 0.5], "angular_velocity": TAU},
        "shape": {"type": "zalesak_disk", "center": [0.5, 0.75], "radius": 0.15, "slot_width": 0.05, "slot_depth": 0.25}
    });
    let area = Quantity::at_end("area", "relative");
    row(
        "Zalesak disk, 1/128, one revolution: area",
        "–",
        vec![zalesak],
        Measure::Error(area),
        Reach::AtMost(1e-3),
        false,
    );
    let sphere = json!({
        "kind": "vortex", "spacing": 1.0 / 64.0, "end_time": 2, "steps": 60, "band_h": 12, "flow": "vortex_3d",
        "shape": {"type": "sphere", "center": [0.35, 0.35, 0.35], "radius": 0.15}
    });
    let volume = Quantity::at_end("volume", "relative");
    let halfway = Quantity::at("volume", "relative", 1.0);
    row(
        "3D vortex, T = 2, 1/64: volume at T/2",
        "–",
        vec![sphere.clone()],
        Measure::Error(halfway),
        Reach::AtMost(2e-3),
        false,
    );
    row("3D vortex, T = 2, 1/64: volume at T", "–", vec![sphere], Measure::Error(volume), Reach::AtMost(2e-3), false);

    let line = |label: &str, scene: &dyn Fn(u32) -> Value| (label.to_owned(), [64, 128, 256].map(scene).to_vec());
    let lines = || {
        vec![
            line("preset paper", &paper),
            line("general (overwrite, same branch)", &general),
            line("dual (fits in space)", &dual),
            line("dual, material fits", &material),
        ]
    };
    let figure = |name, title, quantity| Figure {
        name,
        title,
        plot: Plot::SpeedAgainstError { quantity, otherwise: None, phases: "redistancing", lines: lines() },
    };
    let figures = vec![
        figure("vortex-end", "Single vortex, T = 8: RMS error of φ at T", END),
        figure("vortex-halfway", "Single vortex, T = 8: RMS error of φ at T/2", HALFWAY),
    ];
    Rows { document: "pcp", rows, figures }
}

/// Short scenes by which a machine is measured.
pub(super) fn calibration() -> Vec<Value> {
    let vortex = json!({"type": "single_vortex", "period": 2});
    vec![
        json!({"kind": "vortex", "spacing": 0.015625, "flow": vortex, "end_time": 2, "steps": 60}),
        json!({"kind": "vortex", "spacing": 0.015625, "field": "overwrite", "flow": vortex, "end_time": 2, "steps": 60}),
        json!({"kind": "vortex", "dimension": 3, "spacing": 0.04, "flow": {"type": "vortex_3d", "period": 1},
               "shape": {"type": "sphere", "center": [0.35, 0.35, 0.35], "radius": 0.15}, "end_time": 1, "steps": 20}),
        json!({"kind": "vortex", "preset": "paper", "spacing": 0.03125, "flow": vortex, "end_time": 2, "time_step": 0.1}),
        json!({"kind": "vortex", "spacing": 0.008, "end_time": 1,
               "flow": {"type": "rotation", "center": [0.5, 0.5], "angular_velocity": 3}}),
    ]
}
