//! Bodies of `droplet`.

use serde_json::{Value, json};

/// Scenes of `droplet` whose states differ in what they hold: forces, integrators, discretizations, a wave, drops side by side.
pub fn bodies() -> Vec<Value> {
    let mut bodies = Vec::new();
    let droplet = |more: Value| -> Value {
        // Driven fast enough that neighbors are listed anew a few times.
        let force = json!({"type": "constant", "acceleration": [300, 100]});
        let mut body =
            json!({"kind": "droplet", "spacing": 0.1, "end_time": 0.014, "body_force": force, "allow_soft": true});
        body.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        body
    };
    bodies.push(droplet(json!({})));
    bodies.push(droplet(json!({"integrator": "predictor_corrector", "tension_force": "csf", "end_time": 0.008})));
    bodies.push(droplet(json!({"geometry": "colorfield", "discretization": {"type": "sph", "kernel": "quintic_spline", "smoothing_h": 1.5}})));
    bodies.push(droplet(json!({
        "surface_tension": 0, "fluids": {"inside": {"density": 2, "viscosity": 0.1}},
        "body_force": {"type": "constant", "acceleration": [300, 100], "balance": "mean"}
    })));
    bodies.push(droplet(json!({"tension_force": "balanced_0_1"})));
    bodies.push(droplet(json!({
        "case": "dividing", "domain": {"low": [-1, -1], "high": [1, 1]}, "end_time": 0.02, "time_step": 1e-3,
        "body_force": {"type": "pulse", "coefficient": 4000, "duration": 0.02},
        "fluids": {"inside": {"density": 1.5}}, "shape": {"type": "circle", "radius": 0.4}
    })));
    bodies.push(json!({
        "kind": "droplet", "dimension": 3, "case": "static", "spacing": 0.16, "steps": 4, "end_time": 4e-3,
        "shape": {"type": "sphere", "radius": 0.7}, "integrator": "predictor_corrector", "shifting": "pst"
    }));
    bodies.push(json!({"kind": "droplet", "spacing": 0.08, "end_time": 0.01, "discretization": "dcpse"}));
    bodies.push(json!({
        "kind": "droplet", "dimension": 3, "case": "static", "spacing": 0.16, "steps": 3, "end_time": 2e-3,
        "shape": {"type": "sphere", "radius": 0.7}, "discretization": {"type": "dcpse", "order": 4, "cutoff_h": 4}
    }));
    bodies.push(json!({
        "kind": "droplet", "case": "custom", "numbers": {"La": 300, "D_over_h": 12}, "velocity": [2, 0.4], "end_time": 0.05,
        "shape": {"type": "layer", "thickness": 1.5, "amplitude": 0.01}, "domain": {"low": [0, 0], "high": [1, 3]}
    }));
    let circle = |x: f64| json!({"type": "circle", "center": [x, 0], "radius": 0.35});
    bodies.push(droplet(json!({
        "case": "custom", "shape": {"type": "union", "of": [circle(-0.45), circle(0.45)]}, "shifting": "pst",
        "fluids": {"outside": {"density": 0.5}},
        "body_force": {"type": "pulse", "coefficient": -60, "duration": 0.01, "A": 0.8, "B": 100}
    })));
    let surfactant = json!({"coverage": 0.3, "slope": [0.4, 0.1], "diffusivity": 0.1, "equation": "linear"});
    bodies.push(droplet(json!({"shape": {"type": "circle", "radius": 0.4}, "surfactant": surfactant})));
    bodies.push(droplet(json!({"shape": {"type": "circle", "radius": 0.4}, "tension_slope": [0.3, 0.2]})));
    bodies.push(json!({
        "kind": "droplet", "dimension": 3, "case": "static", "spacing": 0.16, "steps": 4, "end_time": 4e-3,
        "shape": {"type": "sphere", "radius": 0.6}, "surfactant": {"coverage": 0.5, "slope": [0, 0, 0.2]}
    }));
    // Walls: one that moves, gravity, a drop that sits on a wall, and one in a box in space.
    let drop_on_wall = json!({
        "low": [-1, -0.5], "high": [1, 0.8],
        "axes": ["periodic", {"low": {"contact_angle": 70}, "high": {"velocity": [20, 0]}}]
    });
    bodies.push(droplet(json!({
        "case": "custom", "domain": drop_on_wall, "shape": {"type": "circle", "center": [0, -0.5], "radius": 0.5}, "spacing": 0.07
    })));
    let slip = json!({"type": "free_slip", "advancing_angle": 100, "receding_angle": 80});
    bodies.push(droplet(json!({
        "case": "custom", "domain": {"low": [-0.8, -0.8], "high": [0.8, 0.8], "axes": [{"low": slip, "high": slip}, {"type": "walls"}]},
        "shape": {"type": "circle", "radius": 0.4}, "spacing": 0.07, "fluids": {"inside": {"density": 0.5}},
        "body_force": {"type": "constant", "acceleration": [0, -100], "balance": "mean"}
    })));
    bodies.push(json!({
        "kind": "droplet", "dimension": 3, "case": "custom", "spacing": 0.15, "steps": 4, "end_time": 4e-3, "allow_soft": true,
        "domain": {"low": [-1, -1, -0.6], "high": [1, 1, 0.6], "axes": ["periodic", "periodic", {"low": {"contact_angle": 60}, "high": {}}]},
        "shape": {"type": "sphere", "center": [0, 0, -0.6], "radius": 0.6}, "body_force": {"type": "constant", "acceleration": [0, 0, -9]}
    }));
    // A drop on a body across the sides of the box, heavier and more viscous than what is around.
    bodies.push(droplet(json!({
        "case": "custom", "domain": {"low": [-1, -1], "high": [1, 1]}, "shape": {"type": "circle", "center": [0.6, 0], "radius": 0.4},
        "obstacles": [{"shape": {"type": "circle", "center": [1.1, 0], "radius": 0.35}, "wall": {"contact_angle": 80}}],
        "spacing": 0.07, "fluids": {"inside": {"density": 2, "viscosity": 2}},
        "body_force": {"type": "constant", "acceleration": [10, -50], "balance": "mean"}
    })));
    bodies.push(json!({
        "kind": "droplet", "case": "custom", "spacing": 0.05, "steps": 80, "end_time": 0.2, "surface_tension": 0,
        "domain": {"low": [0, 0], "high": [1, 1], "axes": ["periodic", {"low": {}, "high": {}}]},
        "shape": {"type": "layer", "height": 0, "thickness": 1}, "fluids": {"inside": {"density": 2, "viscosity": 0.1, "sound_speed": 15}, "outside": {"viscosity": 0.05, "sound_speed": 15}},
        "body_force": {"type": "constant", "acceleration": [0, -1]}
    }));
    bodies
}
