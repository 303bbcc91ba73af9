//! The rows of `redistance`: PCP paper, section 4.1, and what goes beyond it.

use crate::scene::rows::{Figure, Measure, Plot, Quantity, Reach, Row, Rows, with};
use serde_json::{Value, json};

const PHI_RMS: Quantity = Quantity::at_end("phi", "rms");
const PHI_MAX: Quantity = Quantity::at_end("phi", "max");
/// Below this errors are round-off.
const FLOOR: f64 = 1e-13;

fn over_spacings(base: &Value, cells: &[u32]) -> Vec<Value> {
    cells.iter().map(|n| with(base.clone(), &json!({"spacing": 1.0 / f64::from(*n)}))).collect()
}

fn pcp(degree: u32, cutoff_h: f64) -> Value {
    json!({"type": "pcp", "degree": degree, "cutoff_h": cutoff_h})
}

fn remesh(kernel: &str) -> Value {
    json!({"kind": "redistance", "band": 0.125, "method": {"type": "remesh", "kernel": kernel}})
}

/// All rows.
#[must_use]
pub fn rows() -> Rows {
    let mut rows = Vec::new();
    let mut row = |case: &str, paper: &'static str, runs: Vec<Value>, measure: Measure, reach: Reach, is_long: bool| {
        rows.push(Row { case: case.to_owned(), paper, runs, measure, reach, is_long });
    };
    let ellipse = json!({"kind": "redistance", "method": pcp(4, 2.5)});
    let plane = [16, 32, 64, 128, 256, 512];
    let order = |of| Measure::Order { of, floor: FLOOR };

    row(
        "2D degree 4, r_c = 2.5 h: order of RMS",
        "4.8",
        over_spacings(&ellipse, &plane),
        order(PHI_RMS),
        Reach::AtLeast(4.9),
        false,
    );
    row("… order of max", "4.8", over_spacings(&ellipse, &plane), order(PHI_MAX), Reach::AtLeast(4.6), false);
    row("… max at 1/128", "–", over_spacings(&ellipse, &[128]), Measure::Error(PHI_MAX), Reach::AtMost(1e-9), false);
    let paper = json!({"kind": "redistance", "preset": "paper"});
    row(
        "… with preset paper",
        "–",
        over_spacings(&paper, &[128]),
        Measure::Error(PHI_MAX),
        Reach::AtMost(2.5e-9),
        false,
    );
    let sixth = with(ellipse.clone(), &json!({"method": pcp(6, 3.5)}));
    row(
        "2D plateau: degree 6 at 1/1024, max",
        "1e-13",
        over_spacings(&sixth, &[1024]),
        Measure::Error(PHI_MAX),
        Reach::AtMost(3e-14),
        true,
    );
    let distance = with(ellipse.clone(), &json!({"initial": "distance"}));
    row(
        "2D degree 4 from a distance: order of RMS",
        "–",
        over_spacings(&distance, &plane),
        order(PHI_RMS),
        Reach::AtLeast(4.8),
        false,
    );
    for (degree, cutoff_h) in [(2, 2.5), (3, 2.5), (5, 3.0), (6, 3.5)] {
        let scene = with(ellipse.clone(), &json!({"method": pcp(degree, cutoff_h)}));
        let runs = over_spacings(&scene, &[16, 24, 32, 48, 64, 96, 128, 192, 256]);
        let reach = Reach::AtLeast(f64::from(degree) + 0.8);
        row(&format!("2D degree {degree}: order of RMS"), "–", runs, order(PHI_RMS), reach, degree > 3);
    }
    row(
        "2D degree 6 at 1/128, max",
        "–",
        over_spacings(&sixth, &[128]),
        Measure::Error(PHI_MAX),
        Reach::AtMost(5e-12),
        false,
    );

    let ellipsoid = json!({"kind": "redistance", "dimension": 3, "band_h": 12, "method": pcp(4, 2.4)});
    let space = [16, 24, 32, 48, 64];
    for (name, paper, least) in
        [("phi", "4.9", 4.9), ("closest_point", "4.8", 4.9), ("normal", "3.8", 3.9), ("curvature", "3.0", 2.9)]
    {
        let of = Quantity::at_end(name, "rms");
        row(
            &format!("3D degree 4, r_c = 2.4 h: order of {name}, RMS"),
            paper,
            over_spacings(&ellipsoid, &space),
            order(of),
            Reach::AtLeast(least),
            true,
        );
    }
    let fifth = with(ellipsoid.clone(), &json!({"method": pcp(5, 2.6)}));
    row(
        "3D degree 5, r_c = 2.6 h: order of phi, RMS",
        "–",
        over_spacings(&fifth, &space),
        order(PHI_RMS),
        Reach::AtLeast(6.0),
        true,
    );

    for basis in ["minter", "monomial", "monomial_unscaled"] {
        let distorted: Vec<Value> = [0.0, 0.1, 0.25, 0.4, 0.49]
            .iter()
            .map(|jitter| {
                let method = json!({"type": "pcp", "basis": basis, "solver": "orthogonal"});
                json!({"kind": "redistance", "spacing": 1.0 / 128.0, "jitter": jitter, "method": method})
            })
            .collect();
        let paper = if basis == "monomial_unscaled" { "100 times worse past .25" } else { "–" };
        row(
            &format!("α = .49 against 0, {basis}: growth of RMS"),
            paper,
            distorted.clone(),
            Measure::Growth(PHI_RMS),
            Reach::AtMost(4.0),
            false,
        );
        row(&format!("… RMS at α = .49, {basis}"), "–", distorted, Measure::Error(PHI_RMS), Reach::Shown, false);
    }
    let starved =
        json!({"kind": "redistance", "dimension": 3, "spacing": 1.0 / 64.0, "jitter": 0.49, "method": pcp(4, 2.1)});
    row(
        "3D starved, r_c = 2.1 h, α = .49, 1/64, max",
        "–",
        vec![starved.clone()],
        Measure::Error(PHI_MAX),
        Reach::AtMost(1e-7),
        false,
    );
    row(
        "… enlargements counted",
        "–",
        vec![starved],
        Measure::Rescued("fits.larger_radius"),
        Reach::AtLeast(1.0),
        false,
    );
    let method = json!({"type": "pcp", "cutoff_h": 3.2, "weight": 3});
    let repeated = json!({"kind": "redistance", "spacing": 1.0 / 64.0, "repeat": 200, "method": method});
    row(
        "200 redistancings at rest, r_c = 3.2 h, weight 3, 1/64, max",
        "–",
        vec![repeated],
        Measure::Error(PHI_MAX),
        Reach::AtMost(1e-5),
        false,
    );

    let square = json!({"kind": "redistance", "shape": {"type": "box", "size": [1.0, 1.0]}});
    let rounded =
        json!({"kind": "redistance", "shape": {"type": "rounded_box", "size": [1.0, 1.0], "corner_radius": 0.2}});
    for (name, scene, least) in [("square", square, 0.9), ("rounded rectangle", rounded, 1.9)] {
        let runs = over_spacings(&scene, &[16, 24, 32, 48, 64, 96, 128, 192, 256]);
        let paper = if least < 1.0 { "1" } else { "2" };
        row(&format!("{name}: order of max"), paper, runs.clone(), order(PHI_MAX), Reach::AtLeast(least), false);
        row("… worst query of all, in h", "–", runs, Measure::WorstInSpacings(PHI_MAX), Reach::AtMost(0.5), false);
    }
    for (kernel, remeshed, redistanced) in [
        ("lambda44", None, 0.95),
        ("lambda44_normalized", Some(0.81), 0.96),
        ("wendland_c2", Some(1.3), 1.3),
        ("gaussian", Some(1.3), 1.3),
    ] {
        let runs = over_spacings(&remesh(kernel), &[32, 48, 64, 96, 128, 192, 256, 384, 512]);
        if let Some(of) = remeshed {
            let paper = if of < 1.0 { "0.81" } else { "1.3" };
            let level = Quantity::at_end("remeshed_level", "max");
            row(
                &format!("{kernel}: order of the remeshed level, max"),
                paper,
                runs.clone(),
                order(level),
                Reach::Within { of, by: 0.2 },
                true,
            );
        }
        let paper = if redistanced < 1.0 { "0.95" } else { "1.3" };
        row(
            &format!("{kernel} and grid closest point: order of phi, max"),
            paper,
            runs,
            order(PHI_MAX),
            Reach::Within { of: redistanced, by: 0.2 },
            true,
        );
    }
    let timed =
        json!({"kind": "redistance", "spacing": 1.0 / 128.0, "band_h": 13, "repeat": 40, "method": pcp(4, 2.8)});
    row(
        "2D 1/128, w = 13 h, r_c = 2.8 h: seconds",
        ".148; OpenFPM .050–.067; algoim .0049",
        vec![timed],
        Measure::SecondsPerStep("redistancing"),
        Reach::AtMost(6e-3),
        false,
    );
    let timed = with(ellipsoid.clone(), &json!({"spacing": 1.0 / 64.0}));
    row(
        "3D 1/64: seconds",
        "OpenFPM 11.6; algoim .73",
        vec![timed],
        Measure::SecondsPerStep("redistancing"),
        Reach::AtMost(0.8),
        false,
    );

    let line = |label: &str, scene: &Value, cells: &[u32]| (label.to_owned(), over_spacings(scene, cells));
    let minter = with(ellipse.clone(), &json!({"band": 0.125, "method": {"type": "pcp", "solver": "orthogonal"}}));
    let monomial =
        with(minter.clone(), &json!({"method": {"type": "pcp", "basis": "monomial", "solver": "orthogonal"}}));
    let unscaled =
        with(minter.clone(), &json!({"method": {"type": "pcp", "basis": "monomial_unscaled", "solver": "orthogonal"}}));
    let moments = with(minter.clone(), &json!({"method": {"type": "pcp"}}));
    let sixth = with(minter.clone(), &json!({"method": pcp(6, 3.5)}));
    let grid = [32, 64, 128, 256, 512];
    let figure = Figure {
        name: "redistance",
        title: "Ellipse, α = .3: max error of φ within 1/16",
        plot: Plot::SpeedAgainstError {
            otherwise: None,
            quantity: PHI_MAX,
            phases: "redistancing",
            lines: vec![
                line("minter, QR", &minter, &grid),
                line("monomial, QR", &monomial, &grid),
                line("unscaled monomial, QR", &unscaled, &grid),
                line("degree 4, moments", &moments, &grid),
                line("degree 6, moments", &sixth, &grid),
                line("Λ₄,₄ + grid", &remesh("lambda44"), &grid),
                line("Λ₄,₄* + grid", &remesh("lambda44_normalized"), &grid),
                line("Wendland C2 + grid", &remesh("wendland_c2"), &grid),
                line("Gaussian + grid", &remesh("gaussian"), &grid),
            ],
        },
    };
    Rows { document: "pcp", rows, figures: vec![figure] }
}

/// Short scenes by which a machine is measured.
pub(super) fn calibration() -> Vec<Value> {
    vec![
        json!({"kind": "redistance", "spacing": 0.0078125, "repeat": 60}),
        json!({"kind": "redistance", "dimension": 3, "spacing": 0.04, "repeat": 4}),
        json!({"kind": "redistance", "spacing": 0.0078125, "method": "remesh"}),
        json!({"kind": "redistance", "preset": "paper", "spacing": 0.0078125, "repeat": 15}),
    ]
}
