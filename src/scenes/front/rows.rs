//! The rows of `front`, and of `vortex` with grid-based particles: GBPM paper, section 4.

use super::cases::{
    adaptive, along_exact_paths, balls, by_curvature, by_parameter, coarsened, collapsing, disk, dumbbell, front,
    leaving, levels, onward, onward_in_space, optics, other_square, ring, ring_by_curvature, rotated, rotated_cube,
    sphere_by_curvature, square, square_shape, still, still_sphere, three_spheres, touching, translated, vortex,
    vortex_in_space,
};
use super::figures::figures;
use crate::scene::rows::{Measure, Quantity, Reach, Row, Rows, with};
use serde_json::{Value, json};
use std::f64::consts::PI;

fn end(name: &'static str, norm: &'static str) -> Measure {
    Measure::Error(Quantity::at_end(name, norm))
}

fn slope(name: &'static str, norm: &'static str) -> Measure {
    Measure::Order { of: Quantity::at_end(name, norm), floor: 2e-15 }
}

/// All rows.
#[must_use]
pub fn rows() -> Rows {
    let mut rows = Vec::new();
    let mut row =
        |case: String, paper: &'static str, runs: Vec<Value>, measure: Measure, reach: Reach, is_long: bool| {
            rows.push(Row { case, paper, runs, measure, reach, is_long });
        };
    let quadratic = json!({"degree": 2});
    let most = Reach::AtMost;
    for (cells, figure) in [(128, 3e-7), (1024, 7e-11)] {
        let case = format!("circle, quadratic, {}²: L2 of one resampling", cells + 1);
        row(case, "–", vec![still(cells, &quadratic)], end("front", "l2"), most(figure), false);
    }
    let quartic = vec![still(512, &json!({}))];
    row("circle, quartic, 513²: L2 of one resampling".into(), "–", quartic, end("front", "l2"), most(4e-13), false);
    let circles = |more: &Value| [64, 96, 128, 192, 256, 384].map(|cells| still(cells, more)).to_vec();
    for (name, paper, quantity, norm, more, least) in [
        ("circle, quadratic: order of the L2 error", "4.56", "front", "l2", &quadratic, 3.7),
        ("circle, quadratic: order of the curvature", "2.32", "curvature", "rms", &quadratic, 1.7),
        ("circle, quartic: order of the L2 error", "–", "front", "l2", &json!({}), 5.4),
        ("circle, quartic: order of the curvature", "–", "curvature", "rms", &json!({}), 3.6),
    ] {
        row(name.into(), paper, circles(more), slope(quantity, norm), Reach::AtLeast(least), false);
    }
    for (degree, paper, least) in [(2, "4.10", 3.7), (4, "–", 5.4)] {
        let runs = [32, 48, 64, 96, 128].map(|cells| still_sphere(cells, &json!({"degree": degree}))).to_vec();
        let case = format!("sphere, degree {degree}: order of the error");
        row(case, paper, runs, slope("front", "rms"), Reach::AtLeast(least), false);
    }
    let paper = json!({"degree": 2, "integrator": "tvd_rk2", "cfl": 0.95});
    let runs = vec![translated(512, &paper)];
    row("translation, quadratic, 513²: L2".into(), "order 2.98", runs, end("front", "l2"), most(6e-7), false);
    let runs = vec![translated(512, &json!({}))];
    row("translation, quartic, 513²: L2".into(), "–", runs, end("front", "l2"), most(3e-10), false);
    let circle = json!({"type": "circle", "center": [0.5, 0.75], "radius": 0.25});
    let paper = json!({"degree": 2, "integrator": "tvd_rk2", "cfl": 0.75});
    let runs = vec![rotated(512, &circle, 1.0, &paper)];
    row("rotation, quadratic, 513²: L2".into(), "order 1.87", runs, end("front", "l2"), most(5e-6), false);
    let runs = vec![rotated(512, &circle, 1.0, &json!({"cfl": 3}))];
    row("rotation, quartic, 513²: L2".into(), "–", runs, end("front", "l2"), most(3.5e-10), false);
    let runs = vec![by_curvature(128, 0.05, &json!({}))];
    row("mean curvature, circle, 129²: L2 at t = .05".into(), "–", runs, end("front", "l2"), most(5e-5), false);
    for (name, more, least) in [("quadratic", &quadratic, 1.89), ("quartic", &json!({}), 3.5)] {
        let runs = [32, 48, 64, 96, 128].map(|cells| by_curvature(cells, 0.05, more)).to_vec();
        let case = format!("mean curvature, circle, {name}: order of the L2 error at t = .05");
        row(case, "1.89", runs, slope("front", "l2"), Reach::AtLeast(least), false);
    }
    let runs = vec![by_curvature(128, 0.0805, &json!({}))];
    row("mean curvature, circle: extinction".into(), ".08", runs, end("extinction", "absolute"), most(2e-4), false);
    for (cells, figure, seconds) in [(256, 2e-4, 0.6), (512, 1e-5, 2.0)] {
        let run = || vec![vortex(cells, 2.0, &json!({}))];
        let case = |what: &str| format!("single vortex, T = 2, {}²: {what}", cells + 1);
        row(case("deviation of the radius"), "7.05e-4", run(), end("radius", "deviation"), most(figure), false);
        row(case("largest gap"), "–", run(), end("front", "gap_h"), most(1.5), false);
        row(case("CPU seconds"), "–", run(), Measure::Seconds("front/"), most(seconds), false);
    }
    for cells in [512, 256] {
        for cfl in [8, 10, 12, 14, 16] {
            let run = || vec![vortex(cells, 8.0, &json!({"cfl": cfl}))];
            let case = |what: &str| format!("single vortex, T = 8, {}², step factor {cfl}: {what}", cells + 1);
            let mean = Reach::Within { of: 0.15, by: 3e-4 };
            row(case("mean radius"), ".1512", run(), end("radius", "mean"), mean, true);
            let reach = most(if cells == 512 { 1.2e-3 } else { 1e-3 });
            row(case("deviation"), "3.0e-3", run(), end("radius", "deviation"), reach, true);
            row(case("largest gap"), "–", run(), end("front", "gap_h"), most(1.5), true);
            row(case("CPU seconds"), "–", run(), Measure::Seconds("front/"), most(9.0), true);
        }
    }
    for cfl in [8, 12, 16, 24] {
        let run = || vec![adaptive(128, 8.0, cfl)];
        let case = |what: &str| format!("single vortex, T = 8, adaptive 129² to 1025², step factor {cfl}: {what}");
        let mean = Reach::Within { of: 0.15, by: 3e-4 };
        row(case("mean radius"), ".1512", run(), end("radius", "mean"), mean, true);
        row(case("deviation"), "3.0e-3", run(), end("radius", "deviation"), most(1e-3), true);
        row(case("largest gap"), "–", run(), end("front", "gap_h"), most(1.5), true);
        row(case("CPU seconds"), "–", run(), Measure::Seconds("front/"), most(9.0), true);
    }
    for (name, run) in [
        ("257², step factor 24", vortex(256, 8.0, &json!({"cfl": 24}))),
        ("257², step factor 48", vortex(256, 8.0, &json!({"cfl": 48}))),
        ("513², step factor 32", vortex(512, 8.0, &json!({"cfl": 32}))),
        ("adaptive 129² to 1025², step factor 40", adaptive(128, 8.0, 40)),
    ] {
        let run = || vec![along_exact_paths(&run)];
        let case = |what: &str| format!("single vortex, T = 8, dopri5, {name}: {what}");
        row(case("deviation"), "3.0e-3", run(), end("radius", "deviation"), most(1e-4), true);
        row(case("largest gap"), "–", run(), end("front", "gap_h"), most(1.5), true);
        row(case("CPU seconds"), "–", run(), Measure::Seconds("front/"), most(9.0), true);
    }
    for cosine in [-0.3, 0.0, 0.5] {
        let test = json!({"segment_test": {"type": "normals", "cosine": cosine}});
        let run = || vec![vortex(256, 8.0, &test)];
        let case = |what: &str| format!("single vortex, T = 8, 257², normals to {cosine}: {what}");
        row(case("deviation"), "–", run(), end("radius", "deviation"), most(1e-3), true);
        row(case("largest gap"), "–", run(), end("front", "gap_h"), most(1.5), true);
    }
    let both = || vec![onward(1024, &json!({})), onward(128, &coarsened())];
    let case =
        |what: &str| format!("single vortex without reversal, t = 3, adaptive 129² to 1025² by uniform 1025²: {what}");
    let growth = |name, norm| Measure::Growth(Quantity::at_end(name, norm));
    row(case("particles"), "2.0e4 by 2.4e4", both(), growth("front", "count"), most(0.5), true);
    row(case("mean distance"), "picture", both(), growth("front", "mean"), most(1.0), true);
    row(case("largest distance"), "picture", both(), growth("front", "max"), most(1.0), true);
    row(case("CPU seconds"), "–", both(), Measure::SecondsShare("front/"), most(0.5), true);
    for (name, scene, mean, largest) in [
        ("square inward", square(0.8, -1.0), 1e-12, 1e-12),
        ("square outward", square(0.2, 1.0), 5e-4, 0.25 / 256.0),
        ("two circles merge", balls(256, "circle", 0.4, &json!({})), 0.15 / 256.0, 0.15 / 256.0),
        ("two circles cross", balls(256, "circle", 0.2, &json!({"topology": "cross"})), 2e-8, 2e-8),
        ("two circles cross, by their parameter", balls(256, "circle", 0.2, &by_parameter()), 2e-8, 2e-8),
    ] {
        let run = || vec![scene.clone()];
        row(format!("{name}, 257²: mean distance"), "picture", run(), end("front", "mean"), most(mean), false);
        row(format!("{name}, 257²: largest distance"), "picture", run(), end("front", "max"), most(largest), false);
        row(format!("{name}, 257²: coverage"), "–", run(), end("front", "coverage_h"), most(1.5), false);
    }
    for (turns, figure, largest) in [(1.0, 2e-4, Some(0.8 / 256.0)), (10.0, 1e-3, None)] {
        let run = || vec![rotated(256, &disk(), turns, &json!({"cfl": 20}))];
        let case = |what: &str| format!("Zalesak disk, 257², {turns} revolution(s): {what}");
        row(case("mean distance"), "picture", run(), end("front", "mean"), most(figure), turns > 1.0);
        row(case("coverage"), "–", run(), end("front", "coverage_h"), most(1.5), turns > 1.0);
        if let Some(largest) = largest {
            row(case("largest distance"), "picture", run(), end("front", "max"), most(largest), false);
            row(case("CPU seconds"), "–", run(), Measure::Seconds("front/"), most(0.4), false);
        }
    }
    for (name, run, far) in [
        ("Zalesak disk, 101²", rotated(100, &disk(), 1.0, &json!({})), 1e-4),
        ("cube, 51³", rotated_cube(50), 1e-4),
        // Some of its edges lie beside the grid points.
        ("cube, 48³", rotated_cube(47), 0.5 / 47.0),
    ] {
        let case = |what: &str| format!("{name}, 1 revolution: {what}");
        row(case("largest distance"), "–", vec![run.clone()], end("front", "max"), most(far), false);
        row(case("coverage"), "–", vec![run], end("front", "coverage_h"), most(1.5), false);
    }
    let refined = with(levels(3), &json!({"cfl": 20}));
    let both = || vec![rotated(1024, &disk(), 1.0, &json!({"cfl": 20})), rotated(256, &disk(), 1.0, &refined)];
    let case = |what: &str| format!("Zalesak disk, adaptive 257² to 1025², 1 revolution: {what}");
    row(case("mean distance"), "picture", both(), end("front", "mean"), most(2e-4), false);
    row(case("coverage"), "–", both(), end("front", "coverage_h"), most(1.5), false);
    row(case("particles by uniform 1025²"), "picture", both(), growth("front", "count"), most(0.5), false);
    for (name, shape, spacing, time) in [
        ("square .5 on grid points", square_shape(0.5), 1.0 / 64.0, 0.25 / (2.0 * PI)),
        ("square .503 beside them", square_shape(0.503), 1.0 / 64.0, 0.503 * 0.503 / (2.0 * PI)),
        (
            "ellipse (.2, .1)",
            json!({"type": "ellipse", "center": [0.5, 0.5], "semi_axes": [0.2, 0.1]}),
            1.0 / 128.0,
            0.01,
        ),
    ] {
        let run =
            front(64, &json!({"law": "mean_curvature", "shape": shape, "spacing": spacing, "end_time": 1.1 * time}));
        // Once it is smaller than a spacing or two nothing is left to resolve.
        let reach = Reach::Within { of: time, by: 2.0 * spacing * spacing };
        row(
            format!("mean curvature, {name}: extinction at area/2π"),
            "picture",
            vec![run],
            end("extinction", "time"),
            reach,
            false,
        );
    }
    let runs = vec![sphere_by_curvature(32, 0.02, &json!({}))];
    row(
        "mean curvature, sphere .4, 33³: RMS at t = .02".into(),
        "picture",
        runs,
        end("front", "rms"),
        most(5e-5),
        false,
    );
    let runs = [28, 32, 40, 48].map(|cells| sphere_by_curvature(cells, 0.02, &json!({}))).to_vec();
    let case = "mean curvature, sphere, quartic: order of the error at t = .02".into();
    row(case, "–", runs, slope("front", "rms"), Reach::AtLeast(3.5), true);
    let runs = vec![sphere_by_curvature(32, 0.045, &json!({}))];
    // A step is .5 h² = 4.9e-4.
    let case = "mean curvature, sphere .4, 33³: extinction".into();
    row(case, "picture", runs, end("extinction", "absolute"), most(5e-4), false);
    // By a fine outline of its section: the test `bodies_round_break_and_die_by_their_curvature` has it.
    let reach = Reach::Within { of: 5.246e-3, by: 4e-4 };
    let runs = vec![ring_by_curvature()];
    row("mean curvature, torus, 51³: extinction".into(), "–", runs, end("extinction", "time"), reach, false);
    let run = || vec![dumbbell()];
    let reach = Reach::Within { of: 0.15 * 0.15 / 4.0, by: 6e-4 };
    row(
        "mean curvature, dumbbell, 51³: extinction of its balls".into(),
        "–",
        run(),
        end("extinction", "time"),
        reach,
        false,
    );
    for cells in [64, 128, 256] {
        let run = || vec![optics(cells, 0.4)];
        let case = |what: &str| format!("geometrical optics, ellipse, {}³, t = .4: {what}", cells + 1);
        let reach = if cells < 128 { Reach::Shown } else { most(1e-5) };
        row(case("largest distance from the rays"), "picture", run(), end("front", "max"), reach, false);
        row(case("largest gap"), "–", run(), end("front", "gap_h"), most(1.5), false);
    }
    for (degree, figure) in [(2, 7e-6), (4, 1.5e-7)] {
        let law = json!({"type": "flow", "flow": {"type": "translation", "velocity": [0.5, 0.5, 0.5]}});
        let sphere = json!({"type": "sphere", "center": [0.35, 0.35, 0.35], "radius": 0.15});
        let run = front(80, &json!({"law": law, "shape": sphere, "end_time": 0.6, "degree": degree}));
        let case = format!("3D translation, degree {degree}, 81³: RMS");
        row(case, "order 3.22", vec![run], end("front", "rms"), most(figure), false);
    }
    for (cells, figure, seconds) in [(90, 5e-4, 6.0), (180, 3e-4, 30.0)] {
        let run = || vec![vortex_in_space(cells)];
        let case = |what: &str| format!("3D vortex, T = 2, {}³: {what}", cells + 1);
        row(case("deviation"), "6.4e-3", run(), end("radius", "deviation"), most(figure), cells > 90);
        row(case("coverage"), "–", run(), end("front", "coverage_h"), most(1.5), cells > 90);
        row(case("CPU seconds"), "–", run(), Measure::Seconds("front/"), most(seconds), cells > 90);
    }
    for cells in [50, 90] {
        let run = || vec![onward_in_space(cells)];
        let case = |what: &str| format!("3D vortex without reversal, t = 1, {}³: {what}", cells + 1);
        let far = if cells < 90 { 0.03 } else { 0.01 } / f64::from(cells);
        row(case("mean distance"), "picture", run(), end("front", "mean"), most(far), cells > 50);
        row(case("largest distance"), "picture", run(), end("front", "max"), Reach::Shown, cells > 50);
        row(case("coverage"), "–", run(), end("front", "coverage_h"), most(1.5), cells > 50);
    }
    for (name, scene, far) in [
        ("square .25 outward, 129², corners on grid points", other_square(128, 0.25, 1.0), 0.25 / 128.0),
        ("square .503 outward, 65²", other_square(64, 0.503, 1.0), 0.25 / 64.0),
        ("square .8 inward, 101², corners on grid points", other_square(100, 0.8, -1.0), 1e-12),
        ("ring grows until it has no hole, 51³", ring(), 0.25 / 50.0),
        ("three spheres merge, 51³", three_spheres(), 0.3 / 50.0),
    ] {
        row(format!("{name}: largest distance"), "–", vec![scene.clone()], end("front", "max"), most(far), false);
        row(format!("{name}: coverage"), "–", vec![scene], end("front", "coverage_h"), most(1.5), false);
    }
    for (name, more) in [("merge", json!({})), ("cross", json!({"topology": "cross"}))] {
        let run = || vec![balls(50, "sphere", 0.125, &more)];
        let figure = 0.15 / 50.0;
        row(
            format!("two spheres {name}, 51³: largest distance"),
            "picture",
            run(),
            end("front", "max"),
            most(figure),
            false,
        );
        row(format!("two spheres {name}, 51³: coverage"), "–", run(), end("front", "coverage_h"), most(1.5), false);
    }
    for (name, scene) in
        [("a corner collapses to a point, 129²", collapsing()), ("a front leaves the grid, 129²", leaving())]
    {
        let case = format!("hard: {name}: foot-points left");
        row(case, "–", vec![scene], end("front", "count"), most(0.0), false);
    }
    let run = || vec![touching()];
    row(
        "hard: two circles touch, 129²: largest distance".into(),
        "–",
        run(),
        end("front", "max"),
        most(0.25 / 128.0),
        false,
    );
    row("hard: two circles touch, 129²: coverage".into(), "–", run(), end("front", "coverage_h"), most(1.5), false);
    let run = || vec![vortex(128, 8.0, &json!({}))];
    let case = |what: &str| format!("hard: single vortex, T = 8, 129²: {what}");
    row(case("deviation"), "–", run(), end("radius", "deviation"), most(1e-3), false);
    row(case("largest distance"), "–", run(), end("front", "max"), most(0.5 / 128.0), false);
    row(case("largest gap"), "–", run(), end("front", "gap_h"), most(1.5), false);
    Rows { document: "front", rows, figures: figures() }
}

/// Short scenes by which a machine is measured.
pub(super) fn calibration() -> Vec<Value> {
    vec![
        front(128, &json!({"end_time": 0.2})),
        by_curvature(32, 0.02, &json!({})),
        rotated(128, &disk(), 1.0, &json!({"cfl": 2})),
        balls(40, "sphere", 0.1, &json!({})),
        with(still_sphere(40, &json!({})), &json!({"end_time": 0.1})),
        still_sphere(20, &json!({"law": "mean_curvature", "end_time": 0.01, "time_step": 0.001})),
        still(64, &json!({"degree": 2, "end_time": 0.2})),
    ]
}
