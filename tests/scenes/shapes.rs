//! Scenes whose shapes are composed of others, polygons, or meshes from outside.

use super::support::{pool, scene};
use meniscus::parallel::Interrupt;
use meniscus::scene::{BuildContext, Cloud, CloudSizes, Clouds, mesh_size};
use meniscus::simulation::{CpuClock, OutputPlan, Report, Simulation};
use serde_json::{Value, json};

/// A shape of each family, for each kind of scene that takes a shape.
pub fn bodies() -> Vec<Value> {
    let circle = |x: f64, y: f64, radius: f64| json!({"type": "circle", "center": [x, y], "radius": radius});
    let bar = json!({
        "type": "transformed", "of": {"type": "box", "size": [0.1, 0.4]}, "rotate": {"angle": 0.4}, "translate": [0.5, 0.65],
    });
    let slotted = json!({"type": "difference", "from": circle(0.5, 0.75, 0.2), "minus": [bar]});
    let lens = json!({"type": "intersection", "of": [circle(-0.25, 0.0, 0.6), circle(0.25, 0.0, 0.6)]});
    let cube = json!({
        "type": "transformed", "of": {"type": "box", "size": [0.8, 0.6, 0.7]},
        "rotate": {"angle": 0.5, "axis": [1, 2, 2]}, "scale": 1.2, "translate": [0.05, 0, 0],
    });
    let cut = json!({"type": "intersection", "of": [{"type": "sphere", "radius": 0.5}, cube]});
    let arrow = json!({"type": "polygon", "points": [[0.2, 0.3], [0.8, 0.3], [0.75, 0.8], [0.5, 0.5], [0.25, 0.75]]});
    vec![
        json!({"kind": "vortex", "spacing": 0.04, "band_h": 10, "end_time": 0.5, "steps": 6, "shape": slotted}),
        json!({"kind": "redistance", "spacing": 0.125, "repeat": 2, "method": {"type": "pcp", "degree": 2}, "shape": cut}),
        json!({"kind": "front", "spacing": 0.03, "end_time": 0.05, "time_step": 0.01, "shape": arrow}),
        json!({
            "kind": "droplet", "case": "custom", "spacing": 0.1, "end_time": 0.008, "allow_soft": true, "shape": lens,
            "domain": {"low": [-1, -1], "high": [1, 1]},
        }),
    ]
}

/// An octahedron whose triangles are divided, with its points on a sphere about (0.5, 0.5, 0.5).
fn ball_of_triangles(radius: f64) -> Cloud {
    const SIDE: usize = 8;
    let mut cloud = Cloud::default();
    for octant in 0..8_usize {
        let axis = |d: usize| if octant >> d & 1 == 1 { -1.0 } else { 1.0 };
        let point = |i: usize, j: usize| {
            let x = [i as f64, j as f64, (SIDE - i - j) as f64];
            let length = x.iter().map(|c| c * c).sum::<f64>().sqrt();
            std::array::from_fn(|d| 0.5 + radius * axis(d) * x[d] / length)
        };
        let is_mirrored = octant.count_ones() % 2 == 1;
        let mut add = |corners: [[f64; 3]; 3]| {
            let first = cloud.positions.len() as u32;
            cloud.positions.extend(corners);
            let turned = [first, first + 2, first + 1];
            cloud.triangles.push(if is_mirrored { turned } else { [first, first + 1, first + 2] });
        };
        for i in 0..SIDE {
            for j in 0..SIDE - i {
                add([point(i, j), point(i + 1, j), point(i, j + 1)]);
                if i + j + 1 < SIDE {
                    add([point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)]);
                }
            }
        }
    }
    cloud
}

fn built(body: &Value, cloud: &Cloud) -> Box<dyn Simulation> {
    let context = BuildContext {
        plan: OutputPlan { every_time: None, series_every_steps: 10 },
        interrupt: Interrupt::default(),
        cpu_clock: CpuClock::still(),
        clouds: Clouds::from([("/shape", cloud.clone())]),
    };
    scene(body).build(context).unwrap_or_else(|found| panic!("{body}: {found:?}"))
}

fn finished(body: &Value, cloud: &Cloud) -> Report {
    pool(2).install(|| {
        let mut simulation = built(body, cloud);
        while !simulation.is_finished() {
            simulation.step().unwrap();
        }
        simulation.report()
    })
}

#[test]
fn every_kind_of_scene_takes_a_mesh() {
    let cloud = ball_of_triangles(0.3);
    let mesh = json!({"type": "mesh", "upload": "upl_x"});
    let rotation = json!({"type": "translation", "velocity": [0.1, 0, 0]});
    for body in [
        json!({"kind": "redistance", "spacing": 0.05, "method": {"type": "pcp", "degree": 2}, "shape": mesh}),
        json!({
            "kind": "vortex", "spacing": 0.06, "band_h": 8, "end_time": 0.1, "steps": 2, "shape": mesh, "flow": rotation,
            "method": {"type": "pcp", "degree": 2}
        }),
        json!({"kind": "front", "spacing": 0.04, "end_time": 0.02, "time_step": 0.01, "shape": mesh}),
        json!({"kind": "front", "spacing": 0.06, "end_time": 0.001, "law": "mean_curvature", "shape": mesh}),
        json!({
            "kind": "droplet", "case": "custom", "spacing": 0.1, "end_time": 0.002, "steps": 2, "shape": mesh,
            "domain": {"low": [-0.2, -0.2, -0.2], "high": [1.2, 1.2, 1.2]}, "allow_soft": true
        }),
    ] {
        let report = finished(&body, &cloud);
        assert!(report.health.finite, "{body}");
        // The resolved body is the whole scene, and means the same.
        assert_eq!(scene(&body).resolved(), scene(&scene(&body).resolved()).resolved(), "{body}");
        assert_eq!(scene(&body).dimension(), 3);
        if body["kind"] != "droplet" {
            let mut size = meniscus::scene::CloudSize::from(cloud.positions.len() as u64);
            size.area = Some(mesh_size(&cloud).unwrap().area);
            let estimated = scene(&body).estimate(&CloudSizes::from([("/shape", size)])).particles as f64;
            let made = built(&body, &cloud).particle_count() as f64;
            // Of a band as wide as the shape, 2·reach times the area leaves out what curvature adds.
            assert!((estimated / made - 1.0).abs() < 0.35, "{estimated} for {made}: {body}");
        }
    }
}

#[test]
fn corners_in_order_are_a_polygon_of_the_plane() {
    let positions = vec![[0.3, 0.3, 0.0], [0.7, 0.3, 0.0], [0.7, 0.7, 0.0], [0.3, 0.7, 0.0]];
    let square = Cloud { positions, ..Cloud::default() };
    let mesh = json!({"type": "mesh", "file": "square.xyz"});
    let body = json!({"kind": "redistance", "dimension": 2, "spacing": 0.05, "shape": mesh});
    assert!(finished(&body, &square).health.finite);
}

#[test]
fn meshes_that_are_not_closed_are_refused_when_they_are_read() {
    let mut open = ball_of_triangles(0.3);
    open.triangles.pop();
    let mesh = json!({"type": "mesh", "upload": "upl_x"});
    let body = json!({"kind": "redistance", "spacing": 0.05, "shape": mesh});
    let context = BuildContext {
        plan: OutputPlan { every_time: None, series_every_steps: 10 },
        interrupt: Interrupt::default(),
        cpu_clock: CpuClock::still(),
        clouds: Clouds::from([("/shape", open)]),
    };
    let found = scene(&body).build(context).err().unwrap();
    assert_eq!(found.len(), 3);
    assert!(found.iter().all(|error| error.pointer == "/shape" && error.detail.contains("is open")), "{found:?}");
    let scaled = json!({"kind": "redistance", "spacing": 0.05, "shape": mesh, "initial": "scaled"});
    let found = meniscus::scene::parse(&scaled, meniscus::scenes::SCENES).err().unwrap();
    assert_eq!(found[0].pointer, "/initial");
}
