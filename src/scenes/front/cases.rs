//! The cases of GBPM section 4, and what goes beyond them, as scenes.

use crate::scene::rows::with;
use serde_json::{Value, json};
use std::f64::consts::PI;

pub(super) fn front(cells: u32, more: &Value) -> Value {
    with(json!({"kind": "front", "spacing": 1.0 / f64::from(cells)}), more)
}

/// One resampling without motion.
pub(super) fn still(cells: u32, more: &Value) -> Value {
    let rest = json!({"type": "flow", "flow": {"type": "translation", "velocity": [0, 0]}});
    with(front(cells, &json!({"law": rest, "end_time": 0.01, "time_step": 0.01})), more)
}

pub(super) fn still_sphere(cells: u32, more: &Value) -> Value {
    let rest = json!({"type": "flow", "flow": {"type": "translation", "velocity": [0, 0, 0]}});
    let sphere = json!({"type": "sphere", "center": [0.5, 0.5, 0.5], "radius": 0.25});
    with(still(cells, &json!({"law": rest, "shape": sphere})), more)
}

pub(super) fn translated(cells: u32, more: &Value) -> Value {
    let law = json!({"type": "flow", "flow": {"type": "translation", "velocity": [1, 1]}});
    let shape = json!({"type": "circle", "center": [0.25, 0.25], "radius": 0.2});
    with(front(cells, &json!({"law": law, "shape": shape, "end_time": 0.5})), more)
}

pub(super) fn rotated(cells: u32, shape: &Value, turns: f64, more: &Value) -> Value {
    let law = json!({"type": "flow", "flow": {"type": "rotation", "center": [0.5, 0.5], "angular_velocity": 2}});
    with(front(cells, &json!({"law": law, "shape": shape, "end_time": PI * turns})), more)
}

/// A cube turned once.
pub(super) fn rotated_cube(cells: u32) -> Value {
    let flow = json!({"type": "rotation", "center": [0.5, 0.5, 0.5], "angular_velocity": 2});
    let cube = json!({"type": "box", "center": [0.5, 0.6, 0.5], "size": [0.3, 0.3, 0.3]});
    front(cells, &json!({"law": {"type": "flow", "flow": flow}, "shape": cube, "end_time": PI}))
}

pub(super) fn disk() -> Value {
    json!({"type": "zalesak_disk", "center": [0.5, 0.75], "radius": 0.15, "slot_width": 0.05, "slot_depth": 0.25})
}

/// The vortex that turns back, by grid-based particles.
pub(super) fn vortex(cells: u32, period: f64, method: &Value) -> Value {
    let method = with(json!({"type": "gbpm"}), method);
    json!({
        "kind": "vortex", "spacing": 1.0 / f64::from(cells), "flow": {"type": "single_vortex", "period": period},
        "end_time": period, "method": method
    })
}

pub(super) fn vortex_in_space(cells: u32) -> Value {
    json!({
        "kind": "vortex", "spacing": 1.0 / f64::from(cells), "flow": "vortex_3d", "end_time": 2, "method": "gbpm",
        "shape": {"type": "sphere", "center": [0.35, 0.35, 0.35], "radius": 0.15}
    })
}

/// The same without reversal, to t = 1.
pub(super) fn onward_in_space(cells: u32) -> Value {
    with(vortex_in_space(cells), &json!({"flow": {"type": "vortex_3d", "period": null}, "end_time": 1}))
}

pub(super) fn by_curvature(cells: u32, end_time: f64, more: &Value) -> Value {
    let circle = json!({"type": "circle", "center": [0.5, 0.5], "radius": 0.4});
    with(front(cells, &json!({"law": "mean_curvature", "shape": circle, "end_time": end_time})), more)
}

pub(super) fn sphere_by_curvature(cells: u32, end_time: f64, more: &Value) -> Value {
    let sphere = json!({"type": "sphere", "center": [0.5, 0.5, 0.5], "radius": 0.4});
    by_curvature(cells, end_time, &with(json!({"shape": sphere}), more))
}

pub(super) fn balls(cells: u32, kind: &str, end_time: f64, more: &Value) -> Value {
    let ball = |c: f64| {
        let center = if kind == "circle" { json!([c, c]) } else { json!([c, c, c]) };
        json!({"type": kind, "center": center, "radius": 0.1})
    };
    let shape = json!({"type": "union", "of": [ball(0.4), ball(0.6)]});
    with(front(cells, &json!({"shape": shape, "end_time": end_time})), more)
}

pub(super) fn square_shape(size: f64) -> Value {
    json!({"type": "box", "center": [0.5, 0.5], "size": [size, size]})
}

pub(super) fn square(size: f64, speed: f64) -> Value {
    let law = json!({"type": "normal", "speed": speed});
    front(256, &json!({"shape": square_shape(size), "end_time": 0.3, "law": law}))
}

/// Sizes that put corners on grid points and beside them.
pub(super) fn other_square(cells: u32, size: f64, speed: f64) -> Value {
    let law = json!({"type": "normal", "speed": speed});
    front(cells, &json!({"shape": square_shape(size), "end_time": 0.1, "law": law}))
}

pub(super) fn levels(levels: u32) -> Value {
    json!({"adaptivity": {"levels": levels}})
}

/// The vortex that turns back on a grid of four levels.
pub(super) fn adaptive(cells: u32, period: f64, cfl: u32) -> Value {
    vortex(cells, period, &with(levels(4), &json!({"cfl": cfl})))
}

/// The vortex that never turns, to t = 3.
pub(super) fn onward(cells: u32, method: &Value) -> Value {
    let flow = json!({"type": "single_vortex", "period": null});
    along_exact_paths(&with(vortex(cells, 3.0, method), &json!({"flow": flow})))
}

/// With the paths' error controlled: what a step of many spacings then costs is the resampling's alone.
pub(super) fn along_exact_paths(scene: &Value) -> Value {
    with(scene.clone(), &json!({"integrator": {"type": "dopri5", "tolerance": 1e-9}}))
}

/// Crossing by a parameter that is carried along.
pub(super) fn by_parameter() -> Value {
    json!({"topology": "cross", "segment_test": "parameter"})
}

/// Four levels, and as few resamplings as four levels stand.
pub(super) fn coarsened() -> Value {
    json!({"cfl": 24, "adaptivity": {"levels": 4, "curvature_constant": 0.05}})
}

fn torus() -> Value {
    json!({"type": "torus", "center": [0.5, 0.5, 0.5], "major_radius": 0.25, "minor_radius": 0.1})
}

/// A ring that grows until it has no hole.
pub(super) fn ring() -> Value {
    front(50, &json!({"shape": torus(), "end_time": 0.4}))
}

/// The same by its mean curvature, which collapses everywhere at once.
pub(super) fn ring_by_curvature() -> Value {
    front(50, &json!({"shape": torus(), "law": "mean_curvature", "end_time": 0.007}))
}

/// A thin body whose corners collapse to points, and it with them.
pub(super) fn collapsing() -> Value {
    let shape = json!({"type": "box", "center": [0.5, 0.5], "size": [0.6, 0.06]});
    front(128, &json!({"shape": shape, "law": {"type": "normal", "speed": -1}, "end_time": 0.06}))
}

/// Two circles that touch, but for a rounding error.
pub(super) fn touching() -> Value {
    let circle = |x: f64| json!({"type": "circle", "center": [x, 0.5], "radius": 0.1});
    let shape = json!({"type": "union", "of": [circle(0.4), circle(0.6 + 1e-9)]});
    front(128, &json!({"shape": shape, "end_time": 0.05}))
}

/// A front that leaves any grid.
pub(super) fn leaving() -> Value {
    let law = json!({"type": "flow", "flow": {"type": "translation", "velocity": [1e9, 0]}});
    front(128, &json!({"law": law, "end_time": 0.1, "time_step": 0.05}))
}

pub(super) fn three_spheres() -> Value {
    let ball = |x: f64, y: f64| json!({"type": "sphere", "center": [x, y, 0.5], "radius": 0.1});
    let shape = json!({"type": "union", "of": [ball(0.4, 0.4), ball(0.7, 0.4), ball(0.55, 0.65)]});
    front(50, &json!({"shape": shape, "end_time": 0.15}))
}

pub(super) fn dumbbell() -> Value {
    let shape = json!({
        "type": "dumbbell", "center": [0.5, 0.5, 0.5], "separation": 0.5, "radius": 0.15, "neck_radius": 0.06
    });
    front(50, &json!({"shape": shape, "law": "mean_curvature", "end_time": 0.007}))
}

/// The ellipse that collapses along its rays, as a curve in (x, y, θ).
pub(super) fn optics(cells: u32, end_time: f64) -> Value {
    let shape = json!({"type": "ellipse", "center": [0, 0], "semi_axes": [0.6 * PI, 0.3 * PI]});
    let spacing = 2.0 * PI / f64::from(cells);
    json!({"kind": "front", "law": "geometrical_optics", "shape": shape, "spacing": spacing, "end_time": end_time})
}
