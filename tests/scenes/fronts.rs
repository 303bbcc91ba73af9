//! Bodies of `front`, and of grid-based particles in `vortex`.

use serde_json::{Value, json};

/// Every law, topology, segment test, refinement and integrator of `front` in both dimensions, and grid-based particles in a vortex.
pub fn bodies() -> Vec<Value> {
    let front = |more: Value| {
        let mut body = json!({"kind": "front", "spacing": 0.04, "end_time": 0.1, "time_step": 0.01});
        body.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        body
    };
    let square = json!({"type": "box", "center": [0.5, 0.5], "size": [0.5, 0.4]});
    let sphere = |c: f64| json!({"type": "sphere", "center": [c, c, c], "radius": 0.12});
    let spheres = json!({"type": "union", "of": [sphere(0.4), sphere(0.6)]});
    let vortex = json!({"type": "flow", "flow": {"type": "vortex_3d", "period": 0.4}});
    vec![
        front(json!({"shape": square, "law": {"type": "normal", "speed": -1}, "preset": "paper"})),
        front(json!({"law": "mean_curvature", "time_step": 8e-4, "end_time": 0.008, "shape": square})),
        front(
            json!({"law": "mean_curvature", "integrator": "tvd_rk2", "time_step": 6e-4, "end_time": 0.006, "shape": sphere(0.5)}),
        ),
        // It vanishes on the way.
        front(json!({"shape": {"type": "circle", "radius": 0.06}, "law": {"type": "normal", "speed": -1}})),
        front(json!({"shape": spheres, "topology": "cross"})),
        front(json!({"shape": spheres, "segment_test": {"type": "parameter", "cosine": 0.4}})),
        front(json!({"shape": sphere(0.35), "law": vortex, "end_time": 0.4, "degree": 4, "time_step": 0.04})),
        // Several blocks of proposals.
        front(json!({"shape": sphere(0.35), "law": vortex, "end_time": 0.4, "spacing": 0.015, "time_step": 0.08})),
        json!({
            "kind": "vortex", "spacing": 0.02, "end_time": 2, "steps": 20, "flow": {"type": "single_vortex", "period": 2},
            "method": {"type": "gbpm", "degree": 3, "tube_radius_h": 1.4}, "integrator": "dopri5"
        }),
        json!({"kind": "vortex", "spacing": 0.03, "method": {"type": "gbpm", "cfl": 6}, "end_time": 3}),
        json!({
            "kind": "vortex", "spacing": 0.04, "end_time": 2,
            "method": {"type": "gbpm", "cfl": 20, "adaptivity": {"levels": 3, "curvature_constant": 0.15}}
        }),
        json!({"kind": "vortex", "preset": "paper", "spacing": 0.03, "method": {"type": "gbpm", "degree": 3}, "end_time": 0.4}),
        front(json!({"shape": spheres, "adaptivity": {"levels": 2}, "spacing": 0.05})),
        front(json!({"shape": square, "adaptivity": {}, "end_time": 0.05})),
        front(json!({
            "law": "geometrical_optics", "shape": {"type": "ellipse", "center": [0.1, 0.2], "semi_axes": [1, 0.6]},
            "spacing": 0.1, "end_time": 0.9, "time_step": 0.1
        })),
        front(
            json!({"law": {"type": "geometrical_optics", "speed": -0.5}, "shape": {"type": "circle", "radius": 0.3}, "adaptivity": {"levels": 2}}),
        ),
    ]
}
