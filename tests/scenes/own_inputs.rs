//! Scenes by formulas of a user, held against the built-in ones that they describe, and what is wrong with formulas.

use super::PLAN;
use super::support::{build, column, pool};
use meniscus::scene;
use meniscus::scenes::SCENES;
use meniscus::simulation::{FieldValues, Selection, Simulation, StepError};
use meniscus::spec::Violation;
use serde_json::{Value, json};

/// The single vortex as formulas.
fn single_vortex() -> Value {
    json!({
        "type": "formula", "period": 1, "parameters": {"T": 1},
        "velocity": ["-2*cos(pi*t/T)*sin(pi*x)^2*sin(pi*y)*cos(pi*y)", "2*cos(pi*t/T)*sin(pi*y)^2*sin(pi*x)*cos(pi*x)"]
    })
}

/// Two drops that fly towards each other.
fn colliding_drops() -> Value {
    json!({
        "kind": "droplet", "case": "static", "spacing": 0.0625, "surface_tension": 0.1, "end_time": 0.0036,
        "domain": {"low": [-1, -0.5], "high": [1, 0.5]},
        "shape": {"type": "union", "of": [
            {"type": "circle", "center": [-0.4, 0], "radius": 0.25}, {"type": "circle", "center": [0.4, 0], "radius": 0.25}
        ]},
        "initial_velocity": {"parts": [["u", 0], ["-u", "0"]], "parameters": {"u": 0.5}}
    })
}

/// A scene of each kind with formulas.
pub fn bodies() -> Vec<Value> {
    let surface = |problem: Value| json!({"kind": "surface_pde", "count": 400, "problem": problem});
    vec![
        json!({"kind": "vortex", "spacing": 0.05, "band_h": 16, "end_time": 1, "steps": 12, "flow": single_vortex()}),
        json!({
            "kind": "vortex", "spacing": 0.05, "band_h": 16, "end_time": 0.5, "steps": 6, "integrator": "dopri5",
            "field": "overwrite", "flow": {"type": "formula", "velocity": ["sin(2*pi*y)", "if(x < 0.5, 0.2, -0.2*t)"]}
        }),
        json!({
            "kind": "vortex", "spacing": 0.1, "band_h": 8, "end_time": 0.3, "steps": 3, "shape": {"type": "sphere", "radius": 0.4},
            "flow": {"type": "formula", "velocity": ["y*z", "-x*z", "x*y/2"]}
        }),
        json!({
            "kind": "front", "spacing": 0.025, "end_time": 0.1, "law": {"type": "flow", "flow": single_vortex()},
            "shape": {"type": "circle", "center": [0.5, 0.75], "radius": 0.15}
        }),
        json!({"kind": "front", "spacing": 0.025, "end_time": 0.05, "law": {"type": "formula", "speed": "1 + 0.5*sin(6*x) - 0.02*k"}}),
        json!({
            "kind": "front", "spacing": 0.05, "end_time": 0.05, "dimension": 3, "shape": {"type": "sphere", "radius": 0.4},
            "law": {"type": "formula", "speed": "a*nz*nz + t", "parameters": {"a": 0.5}}
        }),
        colliding_drops(),
        json!({
            "kind": "droplet", "case": "static", "spacing": 0.0625, "surface_tension": 0.5, "end_time": 0.0024,
            "body_force": {"type": "formula", "acceleration": ["inside*sin(2*pi*y)*t", "0"]}
        }),
        surface(json!({"type": "laplace_beltrami", "field": {"type": "formula", "value": "x*y + exp(z)"}})),
        surface(json!({"type": "poisson", "source": {"type": "formula", "value": "nx*nz + 0.2"}})),
        surface(json!({
            "type": "diffusion", "end_time": 0.02, "time_step": 0.005, "initial": {"type": "formula", "value": "1 + x^3"},
            "source": "a*cos(t)*z", "parameters": {"a": 2}
        })),
        surface(json!({
            "type": "diffusion", "end_time": 0.02, "time_step": 0.005, "integrator": "bdf2", "source": "exp(-4*x^2)"
        })),
        surface(three_species()),
    ]
}

/// A cycle of three substances, each of which eats another.
fn three_species() -> Value {
    json!({
        "type": "reaction_diffusion", "end_time": 0.4, "time_step": 0.1, "tolerance": 1e-6, "model": {
            "type": "formula", "species": ["a", "b", "c"], "diffusivities": [0.01, 0.02, 0],
            "rates": ["a*(1 - a - k*b)", "b*(1 - b - k*c)", "c*(1 - c - k*a) + 0.01*z*t"],
            "initial": ["0.5 + 0.2*x", "0.5 - 0.2*y", "0.3"], "parameters": {"k": 1.8}
        }
    })
}

/// The simulation at its end, or why a step failed.
fn ended(body: &Value) -> Result<Box<dyn Simulation>, StepError> {
    pool(2).install(|| {
        let mut simulation = build(body, PLAN);
        while !simulation.is_finished() {
            simulation.step()?;
        }
        Ok(simulation)
    })
}

fn finished(body: &Value) -> Box<dyn Simulation> {
    ended(body).unwrap()
}

fn failure(body: &Value) -> String {
    ended(body).err().unwrap().to_string()
}

/// Largest difference of a field, NaN with NaN aside.
fn difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).filter(|(a, b)| !(a.is_nan() && b.is_nan())).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn the_single_vortex_by_formula_is_the_built_in_one() {
    let scene = |flow: Value| json!({"kind": "vortex", "spacing": 0.03125, "end_time": 1, "steps": 30, "flow": flow});
    let (built, written) =
        (finished(&scene(json!({"type": "single_vortex", "period": 1}))), finished(&scene(single_vortex())));
    let phi = difference(&column(built.as_ref(), "phi"), &column(written.as_ref(), "phi"));
    assert!(phi < 1e-12, "{phi}");
    let report = written.report();
    let divergence = report.diagnostics.iter().find(|d| d.name == "flow.divergence_max").unwrap();
    assert!(divergence.value < 1e-13, "{}", divergence.value);
    let errors = |simulation: &dyn Simulation| simulation.report().errors.iter().map(|e| e.value).collect::<Vec<_>>();
    let apart = difference(&errors(built.as_ref()), &errors(written.as_ref()));
    assert!(apart < 1e-9, "{apart}");
}

#[test]
fn the_brusselator_by_formulas_is_the_built_in_one() {
    let scene = |model: Value| {
        json!({"kind": "surface_pde", "count": 500, "problem": {
            "type": "reaction_diffusion", "end_time": 0.5, "time_step": 0.02, "noise": 0, "model": model, "manufactured": null
        }})
    };
    // Both start from rest, disturbed alike, so that something happens.
    let built = scene(json!({"type": "brusselator", "a": 3, "b": 9}));
    let written = scene(json!({
        "type": "formula", "species": ["u", "v"], "parameters": {"a": 3, "b": 9}, "diffusivities": [0.005, 0.05],
        "rates": ["a - (b + 1)*u + u^2*v", "b*u - u^2*v"], "initial": ["a", "b/a"]
    }));
    let mut noisy = [built, written];
    for body in &mut noisy {
        body["problem"]["noise"] = json!(0.1);
    }
    let [built, written] = noisy.map(|body| finished(&body));
    for name in ["value", "second_value"] {
        let apart = difference(&column(built.as_ref(), name), &column(written.as_ref(), name));
        assert!(apart < 1e-12, "{name}: {apart}");
    }
}

#[test]
fn a_field_by_formula_has_its_exact_operator() {
    let error = |field: Value| {
        let body = json!({"kind": "surface_pde", "surface": "torus", "count": 2000, "problem": {"type": "laplace_beltrami", "field": field}});
        finished(&body).report().errors.iter().find(|e| e.norm == "relative").map(|e| e.value).unwrap()
    };
    let built = error(json!({"type": "plane_wave", "k": [1, -0.5, 1.5]}));
    let written = error(json!({"type": "formula", "value": "sin(x - y/2 + 1.5*z)"}));
    assert!((built / written - 1.0).abs() < 1e-9, "{built} {written}");
}

#[test]
fn a_constant_speed_by_formula_moves_a_circle_as_it_should() {
    let body = json!({
        "kind": "front", "spacing": 0.0125, "end_time": 0.1, "shape": {"type": "circle", "center": [0.5, 0.5], "radius": 0.25},
        "law": {"type": "formula", "speed": "v - b*k", "parameters": {"v": 1, "b": 0.05}}
    });
    let simulation = finished(&body);
    // dR/dt = v − b/R.
    let mut radius = 0.25;
    let step = 1e-6;
    for _ in 0..100_000 {
        let halfway: f64 = radius + 0.5 * step * (1.0 - 0.05 / radius);
        radius += step * (1.0 - 0.05 / halfway);
    }
    let fields = simulation.fields(Selection::All);
    let worst = fields.points.iter().map(|x| ((x[0] - 0.5).hypot(x[1] - 0.5) - radius).abs()).fold(0.0, f64::max);
    assert!(worst < 2e-5, "{worst}");
}

#[test]
fn colliding_drops_keep_their_momentum() {
    let mut body = colliding_drops();
    body["end_time"] = json!(0.03);
    let simulation = finished(&body);
    let fields = simulation.fields(Selection::All);
    let FieldValues::Vector(velocity) = &fields.columns.iter().find(|c| c.name == "velocity").unwrap().values else {
        panic!("velocities are vectors")
    };
    let fastest = velocity.iter().map(|u| u[0].hypot(u[1])).fold(0.0, f64::max);
    let sum: f64 = velocity.iter().map(|u| u[0]).sum();
    assert!(fastest > 0.1 && sum.abs() < 1e-10, "{fastest} {sum}");
}

fn violations(body: &Value) -> Vec<Violation> {
    scene::parse(body, SCENES).err().unwrap_or_default()
}

#[test]
fn everything_that_is_wrong_with_formulas_is_told_at_once_at_its_place() {
    let body = json!({"kind": "vortex", "flow": {
        "type": "formula", "velocity": ["sinn(x) + w", "y/0"], "parameters": {"x": 1, "a": 2}
    }});
    let found = violations(&body);
    let told: Vec<(&str, Option<&str>)> =
        found.iter().map(|error| (error.pointer.as_str(), error.did_you_mean.as_deref())).collect();
    assert_eq!(
        told,
        [
            ("/flow/parameters/x", None),
            ("/flow/velocity/0", Some("sign")),
            ("/flow/velocity/0", None),
            ("/flow/velocity/1", None)
        ],
        "{found:?}"
    );
    assert!(found[1].detail.contains("column 1") && found[2].detail.contains("column 11"));
    let syntax = violations(&json!({"kind": "vortex", "flow": {"type": "formula", "velocity": ["2x", "(y"]}}));
    let places: Vec<&str> = syntax.iter().map(|error| error.pointer.as_str()).collect();
    assert_eq!(places, ["/flow/velocity/0", "/flow/velocity/1"]);
    let count = violations(&json!({"kind": "vortex", "flow": {"type": "formula", "velocity": ["1", "2", "3"]}}));
    assert_eq!(count[0].pointer, "/flow/velocity");
}

#[test]
fn a_period_that_is_none_is_refused() {
    let flow = json!({"type": "formula", "velocity": ["1", "0"], "period": 2});
    let found = violations(&json!({"kind": "vortex", "flow": flow}));
    assert!(found[0].pointer == "/flow/period" && found[0].detail.contains("2.000e0"), "{found:?}");
}

#[test]
fn a_speed_that_roughens_the_front_is_refused() {
    let found = violations(&json!({"kind": "front", "law": {"type": "formula", "speed": "1 + 0.1*k"}}));
    assert!(found[0].pointer == "/law/speed" && found[0].detail.contains("sharper"), "{found:?}");
}

#[test]
fn a_formula_without_a_value_ends_the_run_and_is_named_with_point_and_time() {
    let body = json!({
        "kind": "vortex", "spacing": 0.05, "band_h": 16, "end_time": 1, "steps": 10,
        "flow": {"type": "formula", "velocity": ["0", "sqrt(0.55 - t)"]}
    });
    let told = failure(&body);
    assert!(told.contains("\"sqrt(0.55 - t)\" is NaN at x = ") && told.contains("t = 0.6"), "{told}");
    let rates = json!({"kind": "surface_pde", "count": 300, "problem": {
        "type": "reaction_diffusion", "end_time": 1, "time_step": 0.1, "tolerance": 1e-6, "model": {
            "type": "formula", "species": ["u"], "rates": ["1/(0.3 - t)^2 + ln(0.3 - t)"], "diffusivities": [1], "initial": ["1"]
        }
    }});
    let told = failure(&rates);
    assert!(told.contains("ln(0.3 - t)") || told.contains("tolerance"), "{told}");
}
