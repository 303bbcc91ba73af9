//! What `surface_pde` must show (Surface DC-PSE paper, section 4).

use crate::scene::rows::{Figure, Measure, Plot, Quantity, Reach, Row, Rows, with};
use serde_json::{Value, json};

const ERROR: Quantity = Quantity::at_end("value", "relative");
const LARGEST: Quantity = Quantity::at_end("value", "max");
const CONSTRUCTION: Measure = Measure::Seconds("operators/construction");
/// Counts of the series by which orders are judged.
const COUNTS: [u64; 4] = [1000, 4000, 16_000, 64_000];
/// The same on a circle.
const CIRCLE_COUNTS: [u64; 5] = [100, 200, 400, 800, 1600];

fn dcpse(order: u64) -> Value {
    json!({"type": "surface_dcpse", "order": order})
}

fn plane_wave() -> Value {
    json!({"type": "plane_wave", "k": [2, 1, 1]})
}

fn wave(count: u64, order: u64) -> Value {
    json!({
        "kind": "surface_pde", "count": count, "repeat": 20, "method": dcpse(order),
        "problem": {"type": "laplace_beltrami", "field": plane_wave()}
    })
}

/// Y₄₀ about an axis across that of the spiral: the figures of the paper's form were measured so.
fn harmonic(count: u64, method: &Value) -> Value {
    json!({
        "kind": "surface_pde", "count": count, "repeat": 20, "method": method,
        "problem": {"type": "laplace_beltrami", "field": {"type": "spherical_harmonic", "axis": "y"}}
    })
}

fn copies(order: u64) -> Value {
    json!({"type": "surface_dcpse", "form": "copies", "order": order})
}

fn embedding(order: u64) -> Value {
    json!({"type": "closest_point", "order": order})
}

fn circle(count: u64, problem: &Value) -> Value {
    json!({"kind": "surface_pde", "surface": "circle", "count": count, "problem": problem, "method": copies(2)})
}

fn poisson(count: u64, order: u64, condition: &str) -> Value {
    let problem = json!({"type": "poisson", "condition": condition, "field": plane_wave()});
    json!({"kind": "surface_pde", "count": count, "method": dcpse(order), "problem": problem})
}

fn bump(height: f64, count: u64, integrator: &Value) -> Value {
    json!({
        "kind": "surface_pde", "surface": {"type": "bump", "height": height}, "count": count, "method": dcpse(4),
        "problem": {"type": "diffusion", "integrator": integrator, "time_step": 0.002}
    })
}

fn with_step(mut scene: Value, time_step: f64) -> Value {
    scene["problem"]["time_step"] = json!(time_step);
    scene
}

/// The paper's number of points, and that of half its spacing.
const BUMP_COUNTS: [u64; 2] = [18_439, 73_756];

fn manufactured(count: u64, order: u64, surface: &Value) -> Value {
    json!({
        "kind": "surface_pde", "surface": surface, "count": count, "method": dcpse(order),
        "problem": {
            "type": "reaction_diffusion", "end_time": 0.5, "tolerance": 1e-10, "diffusivity": 0.1, "second_diffusivity": 0.1,
            "model": {"type": "brusselator", "a": 1, "b": 2}, "manufactured": plane_wave()
        }
    })
}

fn pattern(surface: &Value) -> Value {
    json!({
        "kind": "surface_pde", "surface": surface, "count": 8000,
        "problem": {"type": "reaction_diffusion", "model": {"type": "brusselator", "b": 5}, "end_time": 100, "tolerance": 1e-5}
    })
}

fn torus() -> Value {
    json!({"type": "torus", "minor_radius": 0.4})
}

/// Collects rows.
struct Table(Vec<Row>);

impl Table {
    fn row(&mut self, case: &str, paper: &'static str, runs: Vec<Value>, measure: Measure, reach: Reach) {
        self.0.push(Row { case: case.to_owned(), paper, runs, measure, reach, is_long: false });
    }

    fn long(&mut self, case: &str, paper: &'static str, runs: Vec<Value>, measure: Measure, reach: Reach) {
        self.0.push(Row { case: case.to_owned(), paper, runs, measure, reach, is_long: true });
    }
}

/// All rows.
#[must_use]
pub fn rows() -> Rows {
    let mut table = Table(Vec::new());
    paper_form(&mut table);
    intrinsic_form(&mut table);
    hard_cases(&mut table);
    solutions(&mut table);
    curvatures(&mut table);
    evolutions(&mut table);
    Rows { document: "surface", rows: table.0, figures: figures() }
}

fn paper_form(table: &mut Table) {
    let figures = [(4000, 2, 1.48e-2), (16_000, 2, 4.02e-3), (4000, 4, 5.06e-4), (16_000, 4, 3.06e-5)];
    for (count, order, of) in figures {
        let case = format!("Y₄₀, paper's form, N = {count}, order {order}: error");
        let text = if order == 2 { "OpenFPM 1.48e-2, 4.02e-3" } else { "OpenFPM 5.06e-4, 3.06e-5" };
        let reach = Reach::Within { of, by: 0.01 * of };
        table.row(&case, text, vec![harmonic(count, &copies(order))], Measure::Error(ERROR), reach);
    }
    for (order, paper, microseconds) in [(2, "160 µs a point (OpenFPM)", 12.0), (4, "600 µs a point (OpenFPM)", 45.0)]
    {
        let case = format!("paper's form, N = 16,000, order {order}: seconds to construct");
        let most = Reach::AtMost(microseconds * 1e-6 * 16_000.0);
        table.row(&case, paper, vec![harmonic(16_000, &copies(order))], CONSTRUCTION, most);
    }
    let applied = json!("laplace_beltrami");
    let runs = CIRCLE_COUNTS.map(|count| circle(count, &applied)).to_vec();
    table.row(
        "circle, paper's set-up, N = 200: largest error",
        "–",
        vec![circle(200, &applied)],
        Measure::Error(LARGEST),
        Reach::AtMost(2.3e-3),
    );
    let reach = Reach::Within { of: 2.0, by: 0.05 };
    table.row(
        "circle, paper's set-up, N = 100 to 1,600: slope",
        "2",
        runs,
        Measure::Order { of: LARGEST, floor: 1e-12 },
        reach,
    );
}

fn intrinsic_form(table: &mut Table) {
    for (order, error, seconds) in [(2, 1e-3, 2.5e-6), (4, 2.5e-6, 6e-6), (6, 1e-8, 15e-6)] {
        let case = |what: &str| format!("plane wave k = (2, 1, 1), N = 16,000, order {order}: {what}");
        let run = vec![wave(16_000, order)];
        table.row(&case("error"), "–", run.clone(), Measure::Error(ERROR), Reach::AtMost(error));
        table.row(&case("seconds to construct"), "–", run, CONSTRUCTION, Reach::AtMost(seconds * 16_000.0));
    }
    for (order, least) in [(2, 1.95), (4, 3.9), (6, 5.8)] {
        let case = format!("plane wave, sphere, N = 1,000 to 64,000, order {order}: slope");
        let runs = COUNTS.map(|count| wave(count, order)).to_vec();
        table.row(&case, "–", runs, Measure::Order { of: ERROR, floor: 1e-11 }, Reach::AtLeast(least));
    }
    for (count, order, nanoseconds) in [(16_000, 2, 30.0), (64_000, 4, 75.0)] {
        let case = format!("order {order}, N = {count}: seconds an application");
        let reach = Reach::AtMost(1e-9 * nanoseconds * count as f64);
        let applying = Measure::SecondsPerStep("operators/application");
        table.row(&case, "84 to 200 ns a point (OpenFPM here)", vec![wave(count, order)], applying, reach);
    }
    for (order, least) in [(2, 1.9), (4, 3.8)] {
        let case = format!("embedding closest-point method, N = 1,000 to 64,000, order {order}: slope");
        let runs = COUNTS.map(|count| with(wave(count, order), &json!({"method": embedding(order)}))).to_vec();
        table.row(&case, "fig. 3", runs, Measure::Order { of: ERROR, floor: 1e-11 }, Reach::AtLeast(least));
    }
    let large = wave(250_000, 4);
    table.row("order 4, N = 250,000: seconds to construct", "–", vec![large.clone()], CONSTRUCTION, Reach::AtMost(4.0));
    table.row(
        "order 4, N = 250,000: resident memory in bytes",
        "–",
        vec![large],
        Measure::Memory,
        Reach::AtMost(1.5e9),
    );
}

fn hard_cases(table: &mut Table) {
    for order in [2, 4] {
        let random = with(wave(16_000, order), &json!({"sampling": "random"}));
        let case = format!("relaxed random points, N = 16,000, order {order}: error by that of Fibonacci points");
        table.row(&case, "–", vec![wave(16_000, order), random], Measure::Growth(ERROR), Reach::AtMost(1.3));
        let raw = with(wave(16_000, order), &json!({"sampling": "random_raw"}));
        let case = format!("random points as drawn, N = 16,000, order {order}: error");
        table.row(&case, "–", vec![raw], Measure::Error(ERROR), Reach::Shown);
    }
    let ellipsoid = |normals: Value| with(wave(16_000, 4), &json!({"surface": "ellipsoid", "normals": normals}));
    let off = |metric: &str| ellipsoid(json!({"type": "perturbed", "sigma": 0.01, "metric": metric}));
    let most = Reach::AtMost(2.5e-6);
    table.row("ellipsoid, normals off by 1e-2, order 4: error", "–", vec![off("heights")], Measure::Error(ERROR), most);
    let case = "the same, normals taken as exact: error";
    table.row(case, "–", vec![off("normals")], Measure::Error(ERROR), Reach::Shown);
    table.row(
        "ellipsoid, normals estimated, order 4: error",
        "–",
        vec![ellipsoid(json!("estimated"))],
        Measure::Error(ERROR),
        most,
    );
    for (surface, count, text) in [
        (json!({"type": "ellipsoid", "semi_axes": [1, 0.5, 0.25]}), 16_000, "ellipsoid 1 : .5 : .25, N = 16,000"),
        // 4π² r R/N = (2π r/6)²
        (json!({"type": "torus", "minor_radius": 0.25}), 144, "torus r/R = .25, six points around the tube"),
        (torus(), 16_000, "torus r/R = .4, N = 16,000"),
    ] {
        // So few points are not enough for fits of degree 5.
        for order in [2, 4].into_iter().filter(|order| count > 200 || *order == 2) {
            let run = with(wave(count, order), &json!({"surface": surface}));
            table.row(&format!("{text}, order {order}: error"), "–", vec![run], Measure::Error(ERROR), Reach::Shown);
        }
    }
}

fn solutions(table: &mut Table) {
    let held = json!({"type": "poisson", "condition": "dirichlet", "field": {"type": "sin_plus_cos", "m": 2}});
    let runs = CIRCLE_COUNTS.map(|count| circle(count, &held)).to_vec();
    let order = Measure::Order { of: LARGEST, floor: 1e-11 };
    table.row("Poisson, circle, paper's set-up, N = 100 to 1,600: slope", "2", runs, order, Reach::AtLeast(1.9));
    for (order, paper, least, most) in [(2, "2", 1.9, 1.1e-3), (4, "4", 3.8, 3e-6)] {
        for (condition, text) in [("dirichlet", "sphere, a great circle held"), ("zero_mean", "sphere, no mean")] {
            let case = |what: &str| format!("Poisson, {text}, order {order}: {what}");
            let run = vec![poisson(16_000, order, condition)];
            table.row(&case("error at N = 16,000"), "–", run.clone(), Measure::Error(ERROR), Reach::AtMost(most));
            let iterations = Measure::Error(Quantity::at_end("solver", "iterations"));
            table.row(&case("iterations to 1e-10"), "–", run.clone(), iterations, Reach::AtMost(65.0));
            table.row(&case("seconds to solve"), "–", run, Measure::Seconds("solver/"), Reach::AtMost(0.5));
            let runs = COUNTS.map(|count| poisson(count, order, condition)).to_vec();
            let slope = Measure::Order { of: ERROR, floor: 1e-10 };
            table.row(&case("slope, N = 1,000 to 64,000"), paper, runs, slope, Reach::AtLeast(least));
        }
    }
    for solver in ["gmres", "sparse_lu"] {
        let run = with(poisson(16_000, 4, "zero_mean"), &json!({"solver": solver}));
        let case = |what: &str| format!("Poisson, sphere, no mean, order 4, {solver}: {what}");
        table.row(&case("error at N = 16,000"), "–", vec![run.clone()], Measure::Error(ERROR), Reach::AtMost(3e-6));
        table.row(&case("seconds to solve"), "–", vec![run], Measure::Seconds("solver/"), Reach::Shown);
    }
}

fn curvatures(table: &mut Table) {
    // Supports of 3.6 δn: the stretched points are unevenly apart, and a tenth more of support is worth a factor of six.
    for (order, cutoff, mean, gauss) in [(2, 2.4, 5e-6, 1.5e-5), (4, 3.6, 1e-8, 3e-8)] {
        let run = json!({
            "kind": "surface_pde", "surface": "ellipsoid", "count": 32_258, "problem": "curvature",
            "method": {"type": "surface_dcpse", "order": order, "cutoff_dn": cutoff}
        });
        for (quantity, text, most) in [("mean_curvature", "mean", mean), ("gauss_curvature", "Gauss", gauss)] {
            let case = format!("{text} curvature, ellipsoid (1, .8, .75), N = 32,258, order {order}: largest error");
            let measure = Measure::Error(Quantity::at_end(quantity, "max"));
            table.row(&case, "2.6e-3 (order 2)", vec![run.clone()], measure, Reach::AtMost(most));
        }
        let points_alone = with(run, &json!({"normals": "estimated"}));
        let case = format!("mean curvature, the same from points alone, order {order}: largest error");
        let measure = Measure::Error(Quantity::at_end("mean_curvature", "max"));
        table.row(&case, "–", vec![points_alone], measure, Reach::Shown);
    }
}

fn evolutions(table: &mut Table) {
    let implicit = json!("bdf2");
    for (height, papers) in [(0.0, [7e-4, 7e-4]), (1.0, [2.6e-3, 1.2e-2]), (2.0, [2.6e-3, 1.2e-2])] {
        let runs = BUMP_COUNTS.map(|count| bump(height, count, &implicit)).to_vec();
        for (probe, most) in ["probe_0", "probe_1"].into_iter().zip(papers) {
            let case = format!("bump, α = {height}: peak at {probe} against half the spacing");
            let paper = if height > 0.0 { "2.6e-3, 1.2e-2" } else { "7e-4" };
            let measure = Measure::Difference(Quantity::at_end(probe, "peak"));
            table.long(&case, paper, runs.clone(), measure, Reach::AtMost(most));
        }
        let case = format!("bump, α = {height}: drift of the mass");
        let drift = Measure::Error(Quantity::at_end("mass", "relative"));
        table.row(&case, "–", vec![bump(height, BUMP_COUNTS[0], &implicit)], drift, Reach::AtMost(1e-3));
        let both = vec![
            bump(height, BUMP_COUNTS[0], &json!({"type": "dopri5", "tolerance": 1e-7})),
            with_step(bump(height, BUMP_COUNTS[0], &implicit), 0.001),
        ];
        let case = format!("bump, α = {height}: peak at probe_0, explicit against implicit");
        table.long(&case, "–", both, Measure::Difference(Quantity::at_end("probe_0", "peak")), Reach::AtMost(1e-4));
    }
    for (surface, text) in [(json!("sphere"), "sphere"), (torus(), "torus")] {
        for (order, least) in [(2, 1.9), (4, 3.8)] {
            let case = format!("reaction–diffusion, manufactured, {text}, N = 1,000 to 8,000, order {order}: slope");
            let runs = [1000, 2000, 4000, 8000].map(|count| manufactured(count, order, &surface)).to_vec();
            table.row(&case, "–", runs, Measure::Order { of: ERROR, floor: 1e-10 }, Reach::AtLeast(least));
        }
        let case = format!("pattern of the Brusselator, {text}: root mean square of du/dt at t = 100");
        let rate = Measure::Error(Quantity::at_end("pattern", "rate"));
        table.long(&case, "–", vec![pattern(&surface)], rate, Reach::AtMost(1e-2));
        let case = format!("pattern of the Brusselator, {text}: deviation of u");
        let spread = Measure::Error(Quantity::at_end("pattern", "std"));
        table.long(&case, "–", vec![pattern(&surface)], spread, Reach::AtLeast(1.0));
    }
}

fn figures() -> Vec<Figure> {
    let series = |run: &dyn Fn(u64) -> Value| COUNTS.map(run).to_vec();
    let operators = |field: &dyn Fn(u64, Value) -> Value| {
        let mut lines = Vec::new();
        for order in [2, 4, 6] {
            lines.push((format!("tangent planes, order {order}"), series(&|count| field(count, dcpse(order)))));
        }
        for order in [2, 4] {
            lines.push((format!("copies, order {order}"), series(&|count| field(count, copies(order)))));
            lines.push((format!("closest point, order {order}"), series(&|count| field(count, embedding(order)))));
        }
        lines
    };
    let y40 = |count: u64, method: Value| harmonic(count, &method);
    let of_wave = |count: u64, method: Value| with(wave(count, 2), &json!({"method": method}));
    let errors = |name, title, phases, lines| Figure {
        name,
        title,
        plot: Plot::SpeedAgainstError { quantity: ERROR, otherwise: None, phases, lines },
    };
    let solved = ["dirichlet", "zero_mean"].into_iter().flat_map(|condition| {
        [2, 4].map(|order| (format!("{condition}, order {order}"), series(&|count| poisson(count, order, condition))))
    });
    let probes = |name, title, column| Figure {
        name,
        title,
        plot: Plot::History {
            column,
            is_log: false,
            lines: [0.0, 1.0, 2.0]
                .map(|height| (format!("α = {height}"), bump(height, BUMP_COUNTS[0], &json!("bdf2"))))
                .to_vec(),
            marks: Vec::new(),
        },
    };
    let curved = |order: u64| {
        [2000, 8000, 32_258].map(|count| {
            json!({"kind": "surface_pde", "surface": "ellipsoid", "count": count, "problem": "curvature", "method": dcpse(order)})
        }).to_vec()
    };
    let frames = |name, title, scene, every_time, chosen: &[usize]| Figure {
        name,
        title,
        plot: Plot::Frames { scene, every_time, chosen: chosen.to_vec() },
    };
    vec![
        errors(
            "surface-construction",
            "Y₄₀ on the sphere: error, and seconds to construct (fig. 3)",
            "operators/construction",
            operators(&y40),
        ),
        errors(
            "surface-application",
            "Y₄₀ on the sphere: error, and seconds of twenty applications (fig. 3)",
            "operators/application",
            operators(&y40),
        ),
        errors(
            "surface-orders",
            "Plane wave on the sphere: error, and seconds to construct",
            "operators/construction",
            operators(&of_wave),
        ),
        errors(
            "surface-poisson",
            "Poisson's equation on the sphere: error, and seconds to solve (fig. 3d)",
            "solver/",
            solved.collect(),
        ),
        Figure {
            name: "surface-curvature",
            title: "Curvature of the ellipsoid: largest error (fig. 4)",
            plot: Plot::SpeedAgainstError {
                otherwise: None,
                quantity: Quantity::at_end("mean_curvature", "max"),
                phases: "operators/construction",
                lines: [2, 4].map(|order| (format!("order {order}"), curved(order))).to_vec(),
            },
        },
        probes("surface-probe-0", "Bump: value at the top (fig. 6a)", "probe_0"),
        probes("surface-probe-1", "Bump: value beside it (fig. 6b)", "probe_1"),
        frames(
            "surface-bump",
            "Diffusion over the bump, α = 1",
            bump(1.0, BUMP_COUNTS[0] / 4, &json!("bdf2")),
            0.1,
            &[0, 1, 3, 10],
        ),
        frames("surface-sphere", "Brusselator on the sphere", pattern(&json!("sphere")), 10.0, &[0, 1, 3, 10]),
        frames("surface-torus", "Brusselator on the torus", pattern(&torus()), 10.0, &[0, 1, 3, 10]),
    ]
}

/// Short scenes by which a machine is measured.
pub(super) fn calibration() -> Vec<Value> {
    let run = |more: Value| with(json!({"kind": "surface_pde"}), &more);
    vec![
        run(json!({"count": 8000, "repeat": 10})),
        run(json!({"count": 4000, "repeat": 10, "method": dcpse(4)})),
        run(json!({"count": 2000, "repeat": 10, "method": dcpse(6)})),
        run(json!({"count": 2000, "repeat": 10, "method": copies(2)})),
        run(json!({"count": 1000, "repeat": 10, "method": copies(4)})),
        run(json!({"count": 2000, "repeat": 10, "method": embedding(2)})),
        run(json!({"count": 1000, "repeat": 10, "method": embedding(4)})),
        run(json!({"count": 4000, "problem": "poisson"})),
        run(json!({"count": 4000, "problem": "poisson", "method": dcpse(4)})),
        run(json!({"count": 2000, "problem": "poisson", "solver": "sparse_lu"})),
        run(json!({"count": 4000, "problem": "curvature"})),
        run(json!({"count": 4000, "problem": {"type": "diffusion", "end_time": 0.02}})),
        run(json!({"count": 4000, "problem": {"type": "diffusion", "end_time": 0.1, "integrator": "bdf2"}})),
        run(json!({"surface": "circle", "count": 4000, "method": copies(2)})),
        run(json!({"surface": "circle", "count": 4000})),
    ]
}
