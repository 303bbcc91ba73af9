//! Droplets among walls: what is refused and why, and that walls hold what they should.

use crate::support::{PLAN, build, build_with, column, error, run, scene};
use meniscus::scene::cloud::Cloud;
use meniscus::scene::{Clouds, parse};
use meniscus::scenes::SCENES;
use meniscus::simulation::{OutputPlan, Selection, Simulation};
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
fn obstacles_that_do_not_fit_are_refused_at_their_place() {
    let walls = json!(["periodic", {"low": {}, "high": {}}]);
    let disk = |x: f64, radius: f64| json!({"type": "circle", "center": [x, 0.5], "radius": radius});
    let small = json!({"type": "circle", "center": [0.5, 0.5], "radius": 0.1});
    let below = json!({"type": "circle", "center": [0.5, -0.5], "radius": 0.2});
    let layer = json!({"type": "layer", "thickness": 0.2});
    for (obstacle, pointer, said) in [
        (json!({"shape": disk(0.8, 0.2)}), "/shape", "/obstacles/0"),
        (json!({"shape": below}), "/obstacles/0/shape", "behind a wall"),
        (json!({"shape": disk(0.5, 0.45)}), "/obstacles/0/shape", "image"),
        (json!({"shape": layer}), "/obstacles/0/shape", "a body"),
        (json!({"shape": {"type": "sphere", "radius": 1}}), "/obstacles/0/shape/type", ""),
        (json!({"shape": small, "wall": {"velocity": [1, 0]}}), "/obstacles/0/wall/velocity", "stands still"),
        (json!({"shape": small, "wall": {"receding_angle": 9}}), "/obstacles/0/wall/advancing_angle", "hysteresis"),
    ] {
        let found = refusals(&body(&walls, &json!({"obstacles": [obstacle], "spacing": 0.04})));
        assert!(found.iter().any(|(at, detail)| at == pointer && detail.contains(said)), "{pointer}: {found:?}");
    }
    // With a contact angle a drop may sit on it; one that is thinner than neighbors reach is no body.
    let sits = body(
        &walls,
        &json!({"obstacles": [{"shape": disk(0.8, 0.25), "wall": {"contact_angle": 90}}], "spacing": 0.04}),
    );
    assert_eq!(refusals(&sits), []);
    let plate = json!({"type": "box", "center": [0.5, 0.9], "size": [0.4, 0.05]});
    let found = refusals(&body(&walls, &json!({"obstacles": [{"shape": plate}]})));
    assert!(found.len() == 1 && found[0].0 == "/obstacles/0/shape" && found[0].1.contains("thicker"), "{found:?}");
}

/// Bodies by a formula, and by a mesh from outside in space, keep particles out as a disk does.
#[test]
fn bodies_by_formulas_and_meshes_keep_particles_out() {
    let gravity = json!({"type": "constant", "acceleration": [0, -2], "balance": "mean"});
    let by_formula = json!({
        "obstacles": [{"shape": {
            "type": "formula", "level": "(x - 0.5)^2 + (y - 0.05)^2 - 0.09", "low": [0, -0.5], "high": [1, 0.6]
        }}],
        "shape": {"type": "circle", "center": [0.5, 0.7], "radius": 0.2}, "body_force": gravity, "end_time": 0.2,
        "fluids": {"inside": {"density": 2, "sound_speed": 40}, "outside": {"sound_speed": 40}}
    });
    let fields = finished(&body(&json!([{}, {}]), &by_formula)).fields(Selection::All);
    assert!(fields.points.iter().all(|x| (x[0] - 0.5).hypot(x[1] - 0.05) > 0.29));
    let corners = |k: u32| [0, 1, 2].map(|d| 0.6 * f64::from(k >> d & 1) + 0.2);
    let sides = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = sides.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    let cube = Cloud { positions: (0..8).map(corners).collect(), triangles, ..Cloud::default() };
    let by_mesh = json!({
        "kind": "droplet", "case": "custom", "dimension": 3, "spacing": 0.1, "steps": 3, "end_time": 0.003, "surface_tension": 0,
        "domain": {"low": [0, 0, 0], "high": [1.6, 1.6, 1.6]}, "obstacles": [{"shape": {"type": "mesh", "upload": "upl_1"}}],
        "shape": {"type": "sphere", "center": [1.2, 1.2, 1.2], "radius": 0.3}
    });
    let clouds = Clouds::from([("/obstacles/0/shape", cube)]);
    let mut simulation = build_with(&by_mesh, PLAN, &clouds).unwrap();
    while !simulation.is_finished() {
        simulation.step().unwrap();
    }
    let fields = simulation.fields(Selection::All);
    // The cube takes its share of the box, and nobody is in it.
    let mut without = by_mesh.clone();
    without.as_object_mut().unwrap().remove("obstacles");
    let everywhere = build(&without, PLAN).fields(Selection::All).points.len();
    let share = fields.points.len() as f64 / everywhere as f64;
    assert!((share - (1.0 - (0.6_f64 / 1.6).powi(3))).abs() < 0.02, "{share}");
    assert!(fields.points.iter().all(|x| x.iter().any(|part| (part - 0.5).abs() > 0.29)));
    // Without the mesh nothing is built.
    assert!(build_with(&by_mesh, PLAN, &Clouds::default()).is_err());
}

/// d² = R² + r² − 2Rr cos θ for the centers of a drop and of a disk that it meets at an angle θ.
#[test]
fn a_drop_on_a_disk_keeps_its_angle_and_one_that_falls_goes_around_it() {
    let (drop, disk, angle) = (0.4_f64, 0.5_f64, 60.0_f64.to_radians());
    let apart = (drop * drop + disk * disk - 2.0 * drop * disk * angle.cos()).sqrt();
    let sits = |x: f64| {
        json!({
            "domain": {"low": [-1.5, -1.2], "high": [1.5, 1.8]}, "spacing": 0.05, "end_time": 0.1,
            "shape": {"type": "circle", "center": [x, apart], "radius": drop},
            "obstacles": [{"shape": {"type": "circle", "center": [x, 0], "radius": disk}, "wall": {"contact_angle": 60}}]
        })
    };
    let simulation = finished(&body(&Value::Null, &sits(0.0)));
    // Across the sides of the box it is the same.
    for report in [simulation.report(), run(&body(&Value::Null, &sits(1.5)))] {
        assert!(error(&report, "contact_angle", "max", None) < 1.0);
        assert!(error(&report, "area", "relative", None) < 3e-3);
    }
    // The lens that the disk leaves of the drop.
    let share = |r: f64, other: f64| {
        let half = ((apart * apart + r * r - other * other) / (2.0 * apart * r)).acos();
        r * r * (half - half.sin() * half.cos())
    };
    let free = std::f64::consts::PI * drop * drop - share(drop, disk) - share(disk, drop);
    let measured = observable(simulation.as_ref(), "area");
    assert!((measured / free - 1.0).abs() < 5e-3, "{measured} of {free}");
    let falls = json!({
        "domain": {"low": [0, 0], "high": [1, 1.4], "axes": [{}, {}]}, "end_time": 0.6, "surface_tension": 0.2,
        "shape": {"type": "circle", "center": [0.55, 1.05], "radius": 0.18},
        "obstacles": [{"shape": {"type": "circle", "center": [0.5, 0.5], "radius": 0.22}, "wall": {"contact_angle": 150}}],
        "fluids": {"inside": {"density": 2, "viscosity": 0.02, "sound_speed": 20}, "outside": {"viscosity": 0.02, "sound_speed": 20}},
        "body_force": {"type": "constant", "acceleration": [0, -2], "balance": "mean"}
    });
    let fields = finished(&body(&Value::Null, &falls)).fields(Selection::All);
    let depth = fields.points.iter().map(|x| 0.22 - (x[0] - 0.5).hypot(x[1] - 0.5)).fold(0.0, f64::max);
    assert!(depth < 0.01, "{depth}");
}

/// a/a₀ of waves on a layer ten times as viscous as what is around, k = 2π, ρ = τ = 1, η = .1 and .01: numerical Laplace inversion of the
/// linear problem (mpmath, 30 digits). With ∇·(η∇u) in place of the whole stress the error is .06, whatever the spacing.
#[test]
fn waves_between_two_viscosities_are_those_of_linear_theory() {
    const REFERENCES: [(f64, f64); 4] =
        [(0.15, 0.206_202_199), (0.3, -0.487_797_584), (0.45, -0.203_696_597), (0.6, 0.197_195_641)];
    let waves = json!({
        "domain": {"low": [0, 0], "high": [1, 2]}, "spacing": 1.0 / 32.0, "end_time": 0.6,
        "shape": {"type": "layer", "height": 1, "thickness": 1, "amplitude": 0.03, "crest": 0.5},
        "fluids": {"inside": {"viscosity": 0.1, "sound_speed": 20}, "outside": {"viscosity": 0.01, "sound_speed": 20}}
    });
    let mut simulation = build(&body(&Value::Null, &waves), OutputPlan { series_every_steps: 1, ..PLAN });
    let start = observable(simulation.as_ref(), "wave_amplitude");
    for (time, reference) in REFERENCES {
        while observable(simulation.as_ref(), "time") < time - 1e-9 && !simulation.is_finished() {
            simulation.step().unwrap();
        }
        let amplitude = observable(simulation.as_ref(), "wave_amplitude") / start;
        assert!((amplitude - reference).abs() < 0.03, "{amplitude} at {time}, not {reference}");
    }
}

#[test]
fn a_heavy_layer_on_a_light_one_falls_as_linear_theory_says() {
    let falls = json!({
        "domain": {"low": [0, 0], "high": [1, 2], "axes": ["periodic", {}]}, "spacing": 1.0 / 64.0, "surface_tension": 0.02, "end_time": 1,
        "shape": {"type": "layer", "height": 2, "thickness": 2, "amplitude": 0.0155, "crest": 0.5},
        "fluids": {"inside": {"density": 3, "viscosity": 0.06, "sound_speed": 15}, "outside": {"viscosity": 0.02, "sound_speed": 26}},
        "body_force": {"type": "constant", "acceleration": [0, -1], "balance": "mean"}
    });
    let report = run(&body(&Value::Null, &falls));
    assert!(error(&report, "wave_amplitude", "max", None) < 0.03);
    let is_held_back =
        |body: &Value| scene(body).warnings().iter().any(|finding| finding.code == "held_back_by_weight");
    assert!(!is_held_back(&body(&Value::Null, &falls)));
    let mut whole = falls;
    whole["body_force"]["balance"] = json!("none");
    assert!(is_held_back(&body(&Value::Null, &whole)));
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
    // Between two angles a line may rest anywhere: no angle is an error.
    let hysteresis = json!(["periodic", {"low": {"receding_angle": 50, "advancing_angle": 80}}]);
    let report = run(&body(&hysteresis, &on_wall));
    assert!(report.errors.iter().all(|error| error.quantity != "contact_angle"));
    let between = json!({
        "surface_tension": 0, "end_time": 4, "shape": {"type": "layer", "height": 0, "thickness": 1}, "spacing": 0.1,
        "fluids": {"inside": {"sound_speed": 10, "viscosity": 0.2}, "outside": {"sound_speed": 10, "viscosity": 0.2}}
    });
    let mut flow = body(&json!(["periodic", {"high": {"velocity": [1, 0]}}]), &between);
    flow["domain"]["high"] = json!([1.2, 1]);
    assert!(error(&run(&flow), "velocity", "relative", None) < 5e-3);
}

/// Walls that pass each other put in what viscosity takes, ηγ² V t; what lies behind them does no work on itself.
#[test]
fn the_work_of_moving_walls_is_that_of_the_shear_between_them() {
    let start = json!({"inside": ["y", 0], "outside": ["y", 0]});
    let between = json!({
        "surface_tension": 0, "end_time": 0.2, "initial_velocity": start,
        "fluids": {"inside": {"sound_speed": 15, "viscosity": 1}, "outside": {"sound_speed": 15, "viscosity": 1}}
    });
    let walls = json!(["periodic", {"high": {"velocity": [1, 0]}}]);
    let simulation = finished(&body(&walls, &between));
    let work = observable(simulation.as_ref(), "work");
    assert!((work / 0.2 - 1.0).abs() < 0.05, "{work}");
}

#[test]
fn particles_stay_between_walls() {
    let moved = body(
        &json!([{"low": {"type": "free_slip"}}, {"low": {}, "high": {"velocity": [0.5, 0]}}]),
        &json!({"body_force": {"type": "constant", "acceleration": [1, -1], "balance": "mean"}, "end_time": 0.3,
            "shape": {"type": "circle", "center": [0.5, 0.5], "radius": 0.3}}),
    );
    assert_eq!(scene(&moved).dimension(), 2);
    let mut simulation = build(&moved, PLAN);
    let before = column(simulation.as_ref(), "phase").iter().sum::<f64>();
    while !simulation.is_finished() {
        simulation.step().unwrap();
    }
    let fields = simulation.fields(Selection::All);
    assert!(fields.points.iter().all(|x| (-0.02..1.02).contains(&x[0]) && (-0.02..1.02).contains(&x[1])));
    assert_eq!(column(simulation.as_ref(), "phase").iter().sum::<f64>(), before);
}
