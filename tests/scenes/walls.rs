//! Droplets among walls: what is refused and why, and that walls hold what they should.

use crate::support::{column, error, run, scene};
use meniscus::scene::parse;
use meniscus::scenes::SCENES;
use serde_json::{Value, json};

fn body(axes: &Value, more: &Value) -> Value {
    let mut body = json!({
        "kind": "droplet", "case": "custom", "spacing": 0.05, "end_time": 0.02, "surface_tension": 1,
        "domain": {"low": [0, 0], "high": [1, 1], "axes": axes}, "shape": {"type": "circle", "center": [0.5, 0.5], "radius": 0.2},
        "fluids": {"inside": {"sound_speed": 30}, "outside": {"sound_speed": 30}}
    });
    body.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
    body
}

fn refusals(body: &Value) -> Vec<(String, String)> {
    let violations = parse(body, SCENES).err().unwrap_or_default();
    violations.into_iter().map(|violation| (violation.pointer, violation.detail)).collect()
}

#[test]
fn what_does_not_fit_walls_is_refused_at_its_place() {
    let walls = json!(["periodic", {"low": {}, "high": {}}]);
    let through = json!({"shape": {"type": "circle", "center": [0.5, 0.1], "radius": 0.2}});
    let behind = json!({"shape": {"type": "circle", "center": [0.5, -0.4], "radius": 0.2}});
    let angle = json!(["periodic", {"low": {"contact_angle": 60}}]);
    for (axes, more, pointer, said) in [
        (walls.clone(), through.clone(), "/shape", "/domain/axes/1/low"),
        (angle.clone(), behind, "/shape", "behind a wall"),
        (walls.clone(), json!({"shifting": "pst"}), "/shifting", "walls"),
        (walls.clone(), json!({"density_method": "continuity"}), "/density_method", "walls"),
        (walls.clone(), json!({"geometry": "colorfield"}), "/geometry", "walls"),
        (json!(["periodic", {"low": {"velocity": [0, 1]}}]), json!({}), "/domain/axes/1/low/velocity", "along itself"),
        (json!([{"type": "periodic", "contact_angle": 60}, "periodic"]), json!({}), "/domain/axes/0/contact_angle", ""),
        (
            json!(["periodic", {"low": {"receding_angle": 60}}]),
            json!({}),
            "/domain/axes/1/low/advancing_angle",
            "hysteresis",
        ),
        (json!(["periodic", "periodic", "periodic"]), json!({}), "/domain/axes", "2 dimensions"),
    ] {
        let found = refusals(&body(&axes, &more));
        assert!(found.iter().any(|(at, detail)| at == pointer && detail.contains(said)), "{pointer}: {found:?}");
    }
    // A wall with an angle may cut a drop, and gravity across walls needs no balance.
    assert!(refusals(&body(&angle, &through)).is_empty());
    let unequal = json!({
        "fluids": {"inside": {"density": 0.5, "sound_speed": 30}, "outside": {"sound_speed": 30}},
        "body_force": {"type": "constant", "acceleration": [0, -1]}
    });
    assert!(refusals(&body(&walls, &unequal)).is_empty());
    assert_eq!(refusals(&body(&json!(["periodic", "periodic"]), &unequal))[0].0, "/body_force/balance");
}

#[test]
fn a_drop_on_a_wall_keeps_its_angle_and_a_flow_between_walls_its_profile() {
    let on_wall = json!({
        "spacing": 0.04, "end_time": 0.1, "shape": {"type": "circle", "center": [0.5, -0.2], "radius": 0.4},
        "fluids": {"inside": {"viscosity": 0.1, "sound_speed": 30}, "outside": {"viscosity": 0.1, "sound_speed": 30}}
    });
    let report = run(&body(&json!(["periodic", {"low": {"contact_angle": 60}}]), &on_wall));
    assert!(error(&report, "contact_angle", "max", None) < 0.1);
    assert!(error(&report, "contact_width", "relative", None) < 1e-3);
    let depth = report.health.checks.iter().find(|check| check.name == "wall_depth").unwrap();
    assert_eq!(depth.holds, Some(true));
    let between = json!({
        "surface_tension": 0, "end_time": 4, "shape": {"type": "layer", "height": 0, "thickness": 1}, "spacing": 0.1,
        "fluids": {"inside": {"sound_speed": 10, "viscosity": 0.2}, "outside": {"sound_speed": 10, "viscosity": 0.2}}
    });
    let mut flow = body(&json!(["periodic", {"high": {"velocity": [1, 0]}}]), &between);
    flow["domain"]["high"] = json!([1.2, 1]);
    assert!(error(&run(&flow), "velocity", "relative", None) < 5e-3);
}

#[test]
fn particles_stay_between_walls() {
    let moved = body(
        &json!([{"low": {"type": "free_slip"}}, {"low": {}, "high": {"velocity": [0.5, 0]}}]),
        &json!({"body_force": {"type": "constant", "acceleration": [1, -1], "balance": "mean"}, "end_time": 0.3,
            "shape": {"type": "circle", "center": [0.5, 0.5], "radius": 0.3}}),
    );
    assert_eq!(scene(&moved).dimension(), 2);
    let mut simulation = crate::support::build(&moved, crate::support::PLAN);
    let before = column(simulation.as_ref(), "phase").iter().sum::<f64>();
    while !simulation.is_finished() {
        simulation.step().unwrap();
    }
    let fields = simulation.fields(meniscus::simulation::Selection::All);
    assert!(fields.points.iter().all(|x| (-0.02..1.02).contains(&x[0]) && (-0.02..1.02).contains(&x[1])));
    assert_eq!(column(simulation.as_ref(), "phase").iter().sum::<f64>(), before);
}
