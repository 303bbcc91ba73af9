//! The rows of `droplet`: PCP paper, sections 4.3 and 4.4.

use crate::scene::rows::{Figure, Measure, Plot, Quantity, Reach, Row, Rows, with};
use serde_json::{Value, json};

/// The oscillating drop, off the centre: a centred one would hide errors of momentum by its symmetry.
fn oscillating(cells: u32, more: &Value) -> Value {
    let scene = json!({
        "kind": "droplet", "spacing": 1.0 / f64::from(cells),
        "shape": {"type": "ellipse", "center": [0.0131, 0.0072], "semi_axes": [0.75, 0.5]}
    });
    with(scene, more)
}

fn plain(cells: u32) -> Value {
    oscillating(cells, &json!({}))
}

/// Radii of circles at rest.
const RADII: [f64; 5] = [0.2, 0.3, 0.4, 0.5, 0.6];

/// A circle at rest in a box of four radii, sixteen particles to a radius.
fn resting(radius: f64) -> Value {
    json!({
        "kind": "droplet", "case": "static", "spacing": radius / 16.0, "end_time": 0.3,
        "shape": {"type": "circle", "center": [0.0131 * radius, 0.0072 * radius], "radius": radius},
        "domain": {"low": [-2.0 * radius, -2.0 * radius], "high": [2.0 * radius, 2.0 * radius]}
    })
}

/// An ellipsoid in space, to its largest vertical elongation.
fn ellipsoid() -> Value {
    json!({"kind": "droplet", "dimension": 3, "spacing": 0.0625, "end_time": 0.22})
}

fn dividing(cells: u32) -> Value {
    json!({"kind": "droplet", "case": "dividing", "spacing": 1.0 / f64::from(cells)})
}

fn end(name: &'static str, norm: &'static str) -> Measure {
    Measure::Error(Quantity::at_end(name, norm))
}

/// What an oscillating drop must show: case, the paper's figure, the measure, and what to reach at 1/32 and at 1/64.
fn quantities() -> Vec<(&'static str, &'static str, Measure, [Reach; 2])> {
    let most = |coarse, fine| [Reach::AtMost(coarse), Reach::AtMost(fine)];
    let within = |of, coarse, fine| [Reach::Within { of, by: coarse }, Reach::Within { of, by: fine }];
    vec![
        ("κ scatter, least of the run", "8e-4 to 3e-4", end("curvature", "std_least"), most(8e-4, 3e-4)),
        ("κ scatter at the end", "1.5e-3 here with its parameters", end("curvature", "std"), most(1.5e-3, 1e-3)),
        ("mean κ − κ₀ over the last fifth", "4e-3 to 8e-3", end("curvature", "mean_error"), most(8e-4, 3e-4)),
        ("Δp against Young–Laplace", "3e-3", end("pressure_jump", "relative"), most(1e-3, 5e-4)),
        ("Δp by the equation of state alone", "–", end("pressure_eos_jump", "relative"), [Reach::Shown; 2]),
        ("enclosed area", "5e-3 at 1/128", end("area", "relative"), most(9e-4, 3.5e-4)),
        ("κ against √(π/area)", "–", end("curvature", "of_measure"), most(1e-4, 1e-4)),
        (
            "first passage of the deformation",
            "0.0872 (reference)",
            end("deformation", "zero_1"),
            within(0.0872, 0.005, 0.0015),
        ),
        ("second passage", "0.2418 (reference)", end("deformation", "zero_2"), within(0.2418, 0.008, 0.002)),
        (
            "first minimum of the deformation",
            "−0.1767 (reference)",
            end("deformation", "extreme_1"),
            within(-0.1767, 0.005, 0.0015),
        ),
        ("largest Σ m u", "–", end("momentum", "max"), most(2e-3, 2e-3)),
        ("whole run: CPU seconds", "39 and 107 minutes", Measure::Seconds(""), most(15.0, 70.0)),
    ]
}

/// All rows.
#[must_use]
pub fn rows() -> Rows {
    let mut rows = Vec::new();
    let mut row =
        |case: String, paper: &'static str, runs: Vec<Value>, measure: Measure, reach: Reach, is_long: bool| {
            rows.push(Row { case, paper, runs, measure, reach, is_long });
        };
    for (cells, k) in [(32, 0), (64, 1)] {
        for (case, paper, measure, reach) in quantities() {
            row(format!("oscillating, 1/{cells}: {case}"), paper, vec![plain(cells)], measure, reach[k], k == 1);
        }
    }
    let colors = oscillating(32, &json!({"geometry": "colorfield"}));
    let scatter = Reach::Within { of: 0.2, by: 0.12 };
    row(
        "colour field, 1/32: κ scatter at the end".into(),
        "0.105 to 0.3",
        vec![colors.clone()],
        end("curvature", "std"),
        scatter,
        false,
    );
    row("colour field, 1/32: Δp".into(), "2e-2", vec![colors], end("pressure_jump", "relative"), Reach::Shown, false);
    for (cells, paper, text, is_long) in [(32, 0.0120, "0.0120", false), (64, 0.0069, "0.0069", true)] {
        let run = vec![oscillating(cells, &json!({"discretization": "dcpse"}))];
        let case = |what: &str| format!("dcpse, 1/{cells}: {what}");
        let reach = Reach::AtMost(paper);
        row(case("mean κ − κ₀ over the last fifth"), text, run.clone(), end("curvature", "mean_error"), reach, is_long);
        row(case("CPU seconds"), "–", run, Measure::Seconds(""), Reach::AtMost(1200.0), is_long);
    }
    for radius in RADII {
        let case = format!("Young–Laplace, R = {radius}, 16 h to a radius: Δp");
        row(case, "3e-3", vec![resting(radius)], end("pressure_jump", "relative"), Reach::AtMost(1e-3), true);
    }
    let brief = oscillating(128, &json!({"end_time": 0.001}));
    row(
        "density and momentum at 1/128: seconds a step".into(),
        "0.314; OpenFPM 0.313",
        vec![brief],
        Measure::SecondsPerStep("sph/"),
        Reach::AtMost(0.022),
        false,
    );
    for cells in [32, 48, 64, 80] {
        let count = Reach::Within { of: 2.0, by: 0.1 };
        row(
            format!("dividing, 1/{cells}: droplets"),
            "2",
            vec![dividing(cells)],
            end("droplets", "count"),
            count,
            true,
        );
    }
    for (cells, paper, text) in [(32, 5.397, "5.397"), (48, 5.616, "5.616"), (64, 5.567, "5.567"), (80, 5.549, "5.549")]
    {
        let case = format!("dividing, 1/{cells}: mean κ at t = 1");
        let reach = Reach::Within { of: paper, by: 0.03 * paper };
        row(case, text, vec![dividing(cells)], end("curvature", "mean"), reach, true);
    }
    let elongation = end("deformation_time", "extreme_1");
    let near = Reach::Within { of: 0.19, by: 0.01 };
    row("3D, 1/16: largest vertical elongation".into(), "t ≈ 0.19", vec![ellipsoid()], elongation, near, true);
    row("3D, 1/16: CPU seconds".into(), "–", vec![ellipsoid()], Measure::Seconds(""), Reach::AtMost(120.0), true);

    Rows { document: "droplet", rows, figures: figures() }
}

/// The geometries and forces that are compared.
fn variants() -> [(&'static str, Value); 3] {
    [
        ("pcp, balanced", json!({})),
        ("pcp, csf (the paper's force)", json!({"tension_force": "csf"})),
        ("colour field", json!({"geometry": "colorfield"})),
    ]
}

/// Zero crossings of the deformation, from docs/errata.md, "Reference of the oscillating drop".
const DEFORMATION: [(f64, f64); 3] = [(0.0, 0.384_615), (0.0872, 0.0), (0.2418, 0.0)];

fn figures() -> Vec<Figure> {
    let errors = |name, title, quantity, number| {
        let runs = |more: &Value| [16, 24, 32, 48].map(|cells| oscillating(cells, more)).to_vec();
        let lines = variants()[..number].iter().map(|(label, more)| ((*label).to_owned(), runs(more))).collect();
        Figure { name, title, plot: Plot::SpeedAgainstError { quantity, otherwise: None, phases: "", lines } }
    };
    let each = || variants().map(|(label, more)| (format!("{label}, 1/32"), oscillating(32, &more))).to_vec();
    let history = |name, title, column, is_log, marks| {
        let mut lines = each();
        lines.push(("pcp, balanced, 1/64".to_owned(), plain(64)));
        Figure { name, title, plot: Plot::History { column, is_log, lines, marks } }
    };
    let resting_with = |more: &Value| RADII.map(|radius| (1.0 / radius, with(resting(radius), more))).to_vec();
    let young_laplace = Plot::Points {
        across: "1/R",
        quantity: Quantity::at_end("pressure_jump", "mean"),
        lines: variants().map(|(label, more)| (label.to_owned(), resting_with(&more))).to_vec(),
        expected: [0.0, 5.5].map(|bend| (bend, 50.0 * bend)).to_vec(),
    };
    let frames = |name, title, scene, every_time, chosen: &[usize]| Figure {
        name,
        title,
        plot: Plot::Frames { scene, every_time, chosen: chosen.to_vec() },
    };
    vec![
        errors("droplet-scatter", "Oscillating drop: scatter of κ at the end", Quantity::at_end("curvature", "std"), 3),
        errors(
            "droplet-pressure",
            "Oscillating drop: relative error of Δp",
            Quantity::at_end("pressure_jump", "relative"),
            3,
        ),
        // A colour field encloses nothing.
        errors("droplet-area", "Oscillating drop: drift of the area", Quantity::at_end("area", "relative"), 2),
        history("droplet-scatter-time", "Scatter of κ over time (fig. C.15)", "curvature_std", true, Vec::new()),
        history(
            "droplet-curvature-time",
            "Mean κ over time (fig. C.16)",
            "curvature_mean",
            false,
            vec![(1.0, 1.0 / 0.375_f64.sqrt())],
        ),
        history("droplet-deformation", "Deformation over time", "deformation", false, DEFORMATION.to_vec()),
        Figure {
            name: "droplet-profile",
            title: "Pressure across the interface at the end (fig. C.17)",
            // Of a colour field no distance is known.
            plot: Plot::Profile { field: "pressure", reach: 0.3, lines: each()[..2].to_vec() },
        },
        Figure { name: "droplet-young-laplace", title: "Δp over 1/R (fig. 11)", plot: young_laplace },
        frames(
            "droplet-oscillating",
            "Oscillating drop, 1/32 (fig. 10)",
            oscillating(32, &json!({"end_time": 0.25})),
            0.0625,
            &[0, 1, 2, 4],
        ),
        frames(
            "droplet-dividing",
            "Dividing drop, 1/32 (figs. 12 and 13)",
            with(dividing(32), &json!({"end_time": 0.4})),
            0.1,
            &[0, 1, 2, 4],
        ),
        frames("droplet-space", "Ellipsoid drop, 1/16, middle plane (fig. 14)", ellipsoid(), 0.055, &[0, 1, 2, 4]),
    ]
}

/// Short scenes by which a machine is measured.
pub(super) fn calibration() -> Vec<Value> {
    vec![
        json!({"kind": "droplet", "spacing": 0.04, "end_time": 0.03}),
        json!({"kind": "droplet", "case": "dividing", "spacing": 0.04, "end_time": 0.01}),
        json!({"kind": "droplet", "spacing": 0.04, "geometry": "colorfield", "end_time": 0.01}),
        json!({"kind": "droplet", "dimension": 3, "spacing": 0.08, "end_time": 0.003}),
        json!({"kind": "droplet", "spacing": 0.04, "discretization": "dcpse", "end_time": 0.01}),
    ]
}
