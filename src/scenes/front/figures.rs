//! The paper's figures, and what stands beside them.

use super::cases::{
    adaptive, along_exact_paths, balls, coarsened, disk, dumbbell, front, levels, onward, onward_in_space, optics,
    rotated, square, square_shape, still, translated, vortex, vortex_in_space,
};
use crate::scene::rows::{Figure, Plot, Quantity, with};
use serde_json::{Value, json};
use std::f64::consts::PI;

/// All pictures.
pub(super) fn figures() -> Vec<Figure> {
    let against = |name, title, quantity, otherwise, phases, lines: Vec<(&str, Vec<Value>)>| {
        let lines = lines.into_iter().map(|(label, runs)| (label.to_owned(), runs)).collect();
        Figure { name, title, plot: Plot::SpeedAgainstError { quantity, otherwise, phases, lines } }
    };
    let frames = |name, title, scene, every_time, chosen: &[usize]| Figure {
        name,
        title,
        plot: Plot::Frames { scene, every_time, chosen: chosen.to_vec() },
    };
    let history = |name, title, lines: Vec<(&str, Value)>| {
        let lines = lines.into_iter().map(|(label, run)| (label.to_owned(), run)).collect();
        Figure { name, title, plot: Plot::History { column: "foot_points", is_log: false, lines, marks: Vec::new() } }
    };
    let quartic = |cells| vortex(cells, 8.0, &json!({}));
    let uniform = || [128, 192, 256, 384, 512].map(quartic).to_vec();
    let refined = || [32, 64, 128].map(|cells| adaptive(cells, 8.0, 24)).to_vec();
    let far = |cells| along_exact_paths(&vortex(cells, 8.0, &json!({"cfl": 24})));
    let few = |cells| along_exact_paths(&adaptive(cells, 8.0, 40));
    let particles = || [64, 128, 256].map(|n| json!({"kind": "vortex", "spacing": 1.0 / f64::from(n)})).to_vec();
    let overwritten = || {
        let scene = |n: u32| json!({"kind": "vortex", "field": "overwrite", "spacing": 1.0 / f64::from(n)});
        [64, 128, 256].map(scene).to_vec()
    };
    let side_by_side = || {
        vec![
            ("GBPM, uniform", uniform()),
            ("GBPM, four levels", refined()),
            ("GBPM, four levels, dopri5", [32, 64, 128].map(few).to_vec()),
            ("PCP, material fits", particles()),
            ("PCP, overwritten", overwritten()),
        ]
    };
    let at = |time| (Quantity::at("front", "mean", time), Some(Quantity::at("samples", "mean", time)));
    let ((end_error, end_samples), (half_error, half_samples)) = (at(8.0), at(4.0));
    let cells = [64, 96, 128, 192, 256, 384, 512];
    let resampled = |more: Value| cells.map(|cells| still(cells, &more)).to_vec();
    let circle = json!({"type": "circle", "center": [0.5, 0.75], "radius": 0.25});
    let paper = json!({"degree": 2, "integrator": "tvd_rk2", "cfl": 0.75});
    let moved = |more: &Value| [64, 128, 256, 512].map(|cells| translated(cells, more)).to_vec();
    let turned = |more: &Value| [64, 128, 256, 512].map(|cells| rotated(cells, &circle, 1.0, more)).to_vec();
    let l2 = Quantity::at_end("front", "l2");
    let disk_at = |cells, more: &Value| rotated(cells, &disk(), 1.0, more);
    let by_curvature = |shape: Value, end_time: f64| {
        front(128, &json!({"law": "mean_curvature", "shape": shape, "end_time": end_time}))
    };
    vec![
        against(
            "front-reconstruction",
            "One resampling of a circle: L2 error (figs. 4, 5)",
            l2,
            None,
            "front/",
            vec![("quadratic", resampled(json!({"degree": 2}))), ("quartic", resampled(json!({})))],
        ),
        against(
            "front-motions",
            "Translation and rotation of a circle: L2 error (fig. 6)",
            l2,
            None,
            "front/",
            vec![
                ("translation, quadratic, TVD-RK2", moved(&paper)),
                ("translation, quartic, RK4", moved(&json!({}))),
                ("rotation, quadratic, TVD-RK2", turned(&paper)),
                ("rotation, quartic, RK4", turned(&json!({"cfl": 3}))),
            ],
        ),
        against(
            "front-vortex",
            "Single vortex, T = 8: deviation of the radius",
            Quantity::at_end("radius", "deviation"),
            None,
            "front/",
            vec![
                ("uniform, step factor 10", uniform()),
                ("four levels, step factor 24", refined()),
                ("uniform, 24, dopri5", [128, 192, 256, 384, 512].map(far).to_vec()),
                ("four levels, 40, dopri5", [32, 64, 128].map(few).to_vec()),
            ],
        ),
        against(
            "front-pcp-end",
            "Single vortex, T = 8: mean distance from the exact front at T, GBPM and PCP",
            end_error,
            end_samples,
            "",
            side_by_side(),
        ),
        against(
            "front-pcp-halfway",
            "Single vortex, T = 8: mean distance from the exact front at T/2, GBPM and PCP",
            half_error,
            half_samples,
            "",
            side_by_side(),
        ),
        history(
            "front-count",
            "Single vortex, T = 8: foot-points over time (fig. 11)",
            vec![("257²", quartic(256)), ("513²", quartic(512)), ("129² to 1025²", adaptive(128, 8.0, 24))],
        ),
        history(
            "front-count-onward",
            "Single vortex without reversal: foot-points over time (fig. 11)",
            vec![("1025²", onward(1024, &json!({}))), ("129² to 1025²", onward(128, &coarsened()))],
        ),
        history(
            "front-count-zalesak",
            "Zalesak's disk: foot-points over time (fig. 9)",
            vec![
                ("257²", disk_at(256, &json!({"cfl": 20}))),
                ("1025²", disk_at(1024, &json!({"cfl": 20}))),
                ("257² to 1025²", disk_at(256, &with(levels(3), &json!({"cfl": 20})))),
            ],
        ),
        frames("front-spiral", "Single vortex, T = 8, 513² (fig. 12)", quartic(512), 2.0, &[0, 1, 2, 4]),
        frames(
            "front-adaptive",
            "Single vortex without reversal, 129² to 1025² (fig. 10)",
            onward(128, &coarsened()),
            1.0,
            &[0, 1, 2, 3],
        ),
        frames("front-merge", "Two circles merge (fig. 16)", balls(256, "circle", 0.4, &json!({})), 0.1, &[0, 1, 2, 4]),
        frames(
            "front-cross",
            "Two circles cross (fig. 18)",
            balls(256, "circle", 0.2, &json!({"topology": "cross"})),
            0.05,
            &[0, 1, 2, 4],
        ),
        frames("front-square", "Square inward (fig. 14)", square(0.8, -1.0), 0.1, &[0, 1, 2, 3]),
        frames("front-square-outward", "Square outward (fig. 13)", square(0.2, 1.0), 0.1, &[0, 1, 2, 3]),
        frames(
            "front-zalesak",
            "Zalesak's disk, one revolution (fig. 7)",
            disk_at(256, &json!({"cfl": 20})),
            PI / 2.0,
            &[0, 1, 2],
        ),
        frames(
            "front-square-curvature",
            "Square by its mean curvature (fig. 21)",
            by_curvature(square_shape(0.8), 0.1),
            0.02,
            &[0, 1, 2, 4],
        ),
        frames("front-vortex-space", "3D vortex, T = 2, 91³", vortex_in_space(90), 0.5, &[0, 1, 2, 4]),
        frames(
            "front-vortex-space-onward",
            "3D vortex without reversal, 91³",
            onward_in_space(90),
            0.25,
            &[0, 1, 2, 4],
        ),
        frames(
            "front-spheres",
            "Two spheres merge (fig. 17)",
            balls(50, "sphere", 0.125, &json!({})),
            0.025,
            &[0, 1, 2, 5],
        ),
        frames("front-dumbbell", "Dumbbell by its mean curvature", dumbbell(), 0.001, &[0, 1, 2, 4]),
        frames("front-wavefront", "Elliptical wave front in the plane (fig. 22)", optics(128, 1.2), 0.4, &[0, 1, 2, 3]),
    ]
}
