//! Boxes in shear: the stress of what flows, drops that are drawn out, and what is refused.

use crate::support::{PLAN, build, error};
use meniscus::scene::parse;
use meniscus::scenes::SCENES;
use meniscus::simulation::{FieldValues, Selection, Simulation};
use serde_json::{Value, json};

fn in_shear(rate: f64, more: &Value) -> Value {
    let mut body = json!({
        "kind": "droplet", "case": "custom", "spacing": 0.05, "end_time": 0.5, "surface_tension": 0,
        "domain": {"low": [0, 0], "high": [1, 1], "axes": ["periodic", {"type": "lees_edwards", "shear_rate": rate}]},
        "shape": {"type": "circle", "center": [0.5, 0.5], "radius": 0.2},
        "fluids": {"inside": {"sound_speed": 20, "viscosity": 0.3}, "outside": {"sound_speed": 20, "viscosity": 0.3}}
    });
    body.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
    body
}

/// Runs that go on bit for bit: a drop that lies across the sides of the box, in the plane and in space.
pub fn bodies() -> Vec<Value> {
    let across = json!({
        "surface_tension": 1, "steps": 9, "end_time": 0.0018, "shape": {"type": "circle", "center": [0.1, 0.95], "radius": 0.25},
        "fluids": {"inside": {"sound_speed": 60, "viscosity": 1}, "outside": {"sound_speed": 60}}
    });
    let in_space = json!({
        "dimension": 3, "spacing": 0.125, "steps": 6, "end_time": 0.006, "surface_tension": 0.5,
        "domain": {"low": [0, 0, 0], "high": [1.5, 1.5, 1.6], "axes": ["periodic", "periodic", {"type": "lees_edwards", "shear_rate": -10}]},
        "shape": {"type": "sphere", "center": [0.5, 0.5, 0.1], "radius": 0.4},
        "fluids": {"inside": {"sound_speed": 100}, "outside": {"sound_speed": 100}}
    });
    vec![in_shear(20.0, &across), in_shear(0.0, &in_space)]
}

fn finished(body: &Value) -> Box<dyn Simulation> {
    let mut simulation = build(body, PLAN);
    while !simulation.is_finished() {
        simulation.step().unwrap();
    }
    simulation
}

fn observable(simulation: &dyn Simulation, name: &str) -> f64 {
    simulation.observables().iter().find(|(quantity, _)| quantity.name == name).unwrap().1
}

#[test]
fn a_fluid_in_shear_has_the_stress_of_its_viscosity_and_flows_on_an_average_as_the_box() {
    for rate in [2.0, -0.5] {
        let simulation = finished(&in_shear(rate, &json!({})));
        assert!(error(&simulation.report(), "shear_stress", "relative", None) < 5e-3);
        assert!((observable(simulation.as_ref(), "strain") - 0.5 * rate).abs() < 1e-12);
        let fields = simulation.fields(Selection::All);
        let velocity = fields.columns.iter().find(|column| column.name == "velocity").unwrap();
        let FieldValues::Vector(velocity) = &velocity.values else { panic!("velocities are vectors") };
        for (x, u) in fields.points.iter().zip(velocity) {
            let mean = rate * (x[1] - 0.5);
            assert!((u[0] - mean).hypot(u[1]) < 0.02 * rate.abs(), "{x:?}: {u:?}");
        }
    }
}

/// What is sheared one above the other has one stress: γ by the mean of 1/η. Sides of layers are smeared by the kernel, an error of first
/// order: 3.8 % with 10 particles across a layer, 2.0 % with 20.
#[test]
fn layers_in_shear_share_their_stress() {
    let layers = json!({
        "end_time": 0.5, "spacing": 0.025, "shape": {"type": "layer", "height": 0.5, "thickness": 0.5},
        "fluids": {"inside": {"sound_speed": 20, "viscosity": 0.9}, "outside": {"sound_speed": 20, "viscosity": 0.3}}
    });
    let simulation = finished(&in_shear(1.0, &layers));
    let stress = observable(simulation.as_ref(), "shear_stress");
    assert!((stress / 0.45 - 1.0).abs() < 0.03, "{stress}");
}

#[test]
fn what_does_not_fit_a_box_in_shear_is_refused_at_its_place() {
    let axis = json!({"type": "lees_edwards", "shear_rate": 1});
    let boxed = |axes: Value| json!({"domain": {"low": [0, 0], "high": [1, 1], "axes": axes}});
    let obstacle = json!([{"shape": {"type": "circle", "center": [0.5, 0.5], "radius": 0.3}}]);
    for (more, pointer) in [
        (boxed(json!([axis, "periodic"])), "/domain/axes/0"),
        (boxed(json!([{}, axis])), "/domain/axes/0"),
        (boxed(json!(["periodic", {"type": "lees_edwards"}])), "/domain/axes/1/shear_rate"),
        (json!({"integrator": "predictor_corrector"}), "/integrator"),
        (json!({"density_method": "continuity"}), "/density_method"),
        (json!({"body_force": {"type": "constant", "acceleration": [0, -1]}}), "/body_force"),
        (json!({"tension_slope": [1, 0], "surface_tension": 1}), "/tension_slope"),
        (json!({"obstacles": obstacle}), "/obstacles"),
    ] {
        let found = parse(&in_shear(1.0, &more), SCENES).err().unwrap_or_default();
        assert!(found.iter().any(|violation| violation.pointer == pointer), "{pointer}: {found:?}");
    }
}

/// A drop alone in a slow shear is drawn out by Ca (19λ + 16)/(16λ + 16), and adds φ (1 + 5λ/2)/(1 + λ) to the viscosity; in the plane by Ca,
/// and φ (1 + 2λ)/(1 + λ). Here λ = 1, and images are 8 radii away.
#[test]
fn a_drop_in_a_slow_shear_is_drawn_out_as_taylor_says_wherever_it_lies() {
    let (radius, side, rate) = (0.2_f64, 1.6_f64, 0.25);
    let share = std::f64::consts::PI * radius * radius / (side * side);
    let mut found = Vec::new();
    // The same place of the lattice, in the middle and across the sides.
    for center in [[0.8, 0.8], [0.82, 0.0]] {
        let drop = json!({
            "spacing": 0.04, "end_time": 1.8, "surface_tension": 1,
            "domain": {"low": [0, 0], "high": [side, side], "axes": ["periodic", {"type": "lees_edwards", "shear_rate": rate}]},
            "shape": {"type": "circle", "center": center, "radius": radius},
            "fluids": {"inside": {"sound_speed": 25, "viscosity": 1}, "outside": {"sound_speed": 25, "viscosity": 1}}
        });
        let simulation = finished(&in_shear(0.0, &drop));
        let report = simulation.report();
        assert!(error(&report, "taylor_deformation", "relative", None) < 0.15);
        let more = observable(simulation.as_ref(), "shear_stress") / rate - 1.0;
        assert!((more / (1.5 * share) - 1.0).abs() < 0.15, "{more}");
        assert!(report.health.checks.iter().all(|check| check.holds != Some(false)));
        found.push(observable(simulation.as_ref(), "taylor_deformation"));
    }
    assert!((found[0] / found[1] - 1.0).abs() < 1e-3, "{found:?}");
}
