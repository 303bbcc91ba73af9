//! Fronts by grid-based particles against exact motions, with coverage beside every error, and the hard cases that must neither
//! panic nor leave stray particles.

use crate::ring::extinction_of_ring;
use crate::support::{build, error, run};
use meniscus::scene::parse;
use meniscus::scenes::SCENES;
use meniscus::simulation::{FieldValues, OutputPlan, Selection, Simulation, StepError};
use serde_json::{Value, json};

fn front(more: &Value) -> Value {
    let mut body = json!({"kind": "front", "spacing": 1.0 / 128.0});
    body.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
    body
}

fn balls(kind: &str) -> Value {
    let ball = |c: f64| {
        let center = if kind == "circle" { json!([c, c]) } else { json!([c, c, c]) };
        json!({"type": kind, "center": center, "radius": 0.1})
    };
    json!({"type": "union", "of": [ball(0.4), ball(0.6)]})
}

fn at_end(body: &Value) -> Box<dyn Simulation> {
    let mut simulation = build(body, OutputPlan { every_time: None, series_every_steps: 1000 });
    while !simulation.is_finished() {
        simulation.step().unwrap();
    }
    simulation
}

/// Rows of GBPM 4.4: straight sides are exact to round-off until they meet; merged circles leave nothing inside.
#[test]
fn fronts_of_given_speed_merge_cross_and_keep_corners() {
    let square = |size: f64| json!({"type": "box", "center": [0.5, 0.5], "size": [size, size]});
    let inward = json!({"shape": square(0.8), "law": {"type": "normal", "speed": -1}, "end_time": 0.3});
    for (more, largest) in [
        (inward, 1e-12),
        (json!({"shape": square(0.2), "end_time": 0.3}), 0.25 / 128.0),
        (json!({"shape": balls("circle"), "end_time": 0.4}), 0.15 / 128.0),
        (json!({"shape": balls("circle"), "end_time": 0.2, "topology": "cross"}), 2e-6),
        (json!({"shape": balls("sphere"), "end_time": 0.125, "spacing": 0.02}), 0.15 * 0.02),
        (json!({"shape": balls("sphere"), "end_time": 0.125, "spacing": 0.02, "topology": "cross"}), 0.15 * 0.02),
    ] {
        let report = run(&front(&more));
        let (far, coverage) = (error(&report, "front", "max", None), error(&report, "front", "coverage_h", None));
        assert!(far <= largest, "{more}: {far:e}");
        assert!(coverage <= 1.0, "{more}: coverage {coverage}");
    }
}

/// However corners lie in the grid and however long the step is, an opening one becomes an arc and a closing one stays; thin
/// bodies grow, and several that meet leave nothing inside.
#[test]
fn corners_and_meetings_do_not_depend_on_the_grid() {
    let square = |center: f64, size: f64| json!({"type": "box", "center": [center, 0.5], "size": [size, size]});
    let inward = |size: f64| json!({"shape": square(0.5, size), "law": {"type": "normal", "speed": -1}, "end_time": 0.2, "spacing": 0.01});
    let outward = |size: f64, cfl: f64| json!({"shape": square(0.503, size), "end_time": 0.1, "cfl": cfl});
    let thin = json!({"type": "box", "center": [0.5, 0.5], "size": [0.6, 0.004]});
    let disk =
        json!({"type": "zalesak_disk", "center": [0.5, 0.5], "radius": 0.3, "slot_width": 0.1, "slot_depth": 0.4});
    let ball = |kind: &str, x: f64, y: f64| {
        let center = if kind == "circle" { json!([x, y]) } else { json!([x, y, 0.5]) };
        json!({"type": kind, "center": center, "radius": 0.1})
    };
    let three = |kind: &str| json!({"type": "union", "of": [ball(kind, 0.4, 0.4), ball(kind, 0.7, 0.4), ball(kind, 0.55, 0.65)]});
    let ring = json!({"type": "torus", "center": [0.5, 0.5, 0.5], "major_radius": 0.25, "minor_radius": 0.1});
    let touching = json!({"type": "union", "of": [ball("circle", 0.4, 0.5), ball("circle", 0.6, 0.5)]});
    let cube = json!({"type": "box", "center": [0.5, 0.5, 0.5], "size": [0.2, 0.2, 0.2]});
    let h = 1.0 / 128.0;
    for (more, largest) in [
        (inward(0.8), 1e-12),
        (inward(0.53), 1e-12),
        (json!({"shape": square(0.5, 0.25), "end_time": 0.1}), 0.25 * h),
        (outward(0.21, 0.2), 0.3 * h),
        (outward(0.21, 1.0), 0.25 * h),
        (outward(0.21, 3.0), 0.25 * h),
        (json!({"shape": thin, "end_time": 0.1}), 0.25 * h),
        (json!({"shape": disk, "end_time": 0.25}), 0.25 * h),
        (json!({"shape": three("circle"), "end_time": 0.3}), 0.3 * h),
        (json!({"shape": balls("circle"), "end_time": 0.4, "spacing": 0.03}), 0.15 * 0.03),
        (json!({"shape": touching, "end_time": 0.2}), 0.15 * h),
        (json!({"shape": three("sphere"), "end_time": 0.15, "spacing": 0.02}), 0.3 * 0.02),
        (json!({"shape": ring, "end_time": 0.4, "spacing": 0.02}), 0.25 * 0.02),
        (json!({"shape": cube, "end_time": 0.05, "spacing": 0.01}), 0.25 * 0.01),
    ] {
        let report = run(&front(&more));
        let (far, coverage) = (error(&report, "front", "max", None), error(&report, "front", "coverage_h", None));
        assert!(far <= largest, "{more}: {far:e}");
        assert!(coverage <= 1.0, "{more}: coverage {coverage}");
    }
}

/// A square loses area at the rate 2π, a dumbbell breaks at its neck, and nothing is left of any.
#[test]
fn bodies_round_break_and_die_by_their_curvature() {
    let square = |size: f64| json!({"type": "box", "center": [0.5, 0.5], "size": [size, size]});
    for size in [0.25, 0.4, 0.5, 0.503] {
        let time = size * size / std::f64::consts::TAU;
        let body =
            json!({"shape": square(size), "law": "mean_curvature", "end_time": 1.1 * time, "spacing": 1.0 / 64.0});
        let report = run(&front(&body));
        let off = error(&report, "extinction", "time", None) - time;
        assert!(off.abs() < 1.5 / 64.0 / 64.0, "{size}: {off:e}");
    }
    // What is not sharp has quartics: the bound of the row for 129² holds at 65² already, and for a sphere at 33³.
    let circle = json!({"type": "circle", "center": [0.5, 0.5], "radius": 0.4});
    let sphere = json!({"type": "sphere", "center": [0.5, 0.5, 0.5], "radius": 0.4});
    for (shape, cells, norm) in [(circle, 64.0, "l2"), (sphere, 32.0, "rms")] {
        let body = json!({"shape": shape, "law": "mean_curvature", "end_time": 0.02, "spacing": 1.0 / cells});
        let off = error(&run(&front(&body)), "front", norm, None);
        assert!(off < 5e-5, "{body}: {off:e}");
    }
    let dumbbell = json!({
        "type": "dumbbell", "center": [0.5, 0.5, 0.5], "separation": 0.5, "radius": 0.15, "neck_radius": 0.06
    });
    let body = |end_time: f64| {
        at_end(&front(&json!({"shape": dumbbell, "law": "mean_curvature", "end_time": end_time, "spacing": 0.02})))
    };
    let places: Vec<f64> = body(0.003).fields(Selection::All).points.iter().map(|x| x[0]).collect();
    assert!(places.iter().all(|x| (x - 0.5).abs() > 0.05), "the neck is gone");
    assert!(places.iter().any(|x| *x < 0.3) && places.iter().any(|x| *x > 0.7), "both balls are there");
    assert_eq!(body(0.0065).particle_count(), 0);
    // A ring collapses everywhere at once, at the time of a fine outline of its section; nothing of it becomes a sheet.
    let ring = json!({"type": "torus", "center": [0.5123, 0.5071, 0.5037], "major_radius": 0.25, "minor_radius": 0.1});
    let report = run(&front(&json!({"shape": ring, "law": "mean_curvature", "spacing": 0.025, "end_time": 0.008})));
    let time = extinction_of_ring(0.25, 0.1);
    assert!((time - 5.246e-3).abs() < 1e-5, "the row has another time: {time:e}");
    assert!((error(&report, "extinction", "time", None) - time).abs() < 1.5 * 0.025 * 0.025);
}

/// GBPM 3.5: refined where it turns, with fewer particles and no less exact; and what the paper's open problem was, closed.
#[test]
fn a_refined_grid_follows_thin_filaments() {
    let vortex = |spacing: f64, method: Value| {
        let flow = json!({"type": "single_vortex", "period": 4});
        run(&json!({"kind": "vortex", "spacing": spacing, "flow": flow, "end_time": 4, "method": method}))
    };
    let refined = vortex(1.0 / 64.0, json!({"type": "gbpm", "cfl": 16, "adaptivity": {"levels": 3}}));
    let uniform = vortex(1.0 / 256.0, json!({"type": "gbpm", "cfl": 16}));
    let at = |report, name, norm, time| error(report, name, norm, Some(time));
    for report in [&refined, &uniform] {
        assert!(at(report, "front", "gap_h", 4.0) < 1.5);
        assert!(at(report, "radius", "deviation", 4.0) < 3e-4);
    }
    assert!(at(&refined, "front", "count", 2.0) < 0.5 * at(&uniform, "front", "count", 2.0));
    assert!(at(&refined, "front", "mean", 2.0) < 2.0 * at(&uniform, "front", "mean", 2.0));
}

/// Levels follow the front, not the rounding of its normals; and a front by mean curvature may be refined.
#[test]
fn a_resting_front_keeps_its_levels() {
    let ellipse = json!({"type": "ellipse", "center": [0, 0], "semi_axes": [0.5, 0.2]});
    let body = json!({
        "shape": ellipse, "spacing": 0.05, "law": {"type": "normal", "speed": 1e-9}, "time_step": 1, "end_time": 6,
        "adaptivity": {"levels": 4, "curvature_constant": 0.1}
    });
    let mut simulation = build(&front(&body), OutputPlan { every_time: None, series_every_steps: 1000 });
    let mut counts = Vec::new();
    while !simulation.is_finished() {
        simulation.step().unwrap();
        counts.push(simulation.particle_count());
    }
    assert!(counts.windows(2).all(|pair| pair[0] == pair[1]), "{counts:?}");
    let sphere = json!({"type": "sphere", "center": [0.5, 0.5, 0.5], "radius": 0.4});
    let refined = at_end(&front(&json!({
        "shape": sphere, "spacing": 0.079, "law": "mean_curvature", "end_time": 0.01, "adaptivity": {"levels": 2}
    })));
    let deviation = error(&refined.report(), "front", "max", None);
    assert!(deviation < 0.01, "{deviation:e}");
    assert!(error(&refined.report(), "front", "coverage_h", None) < 1.5);
}

/// What would take more than there is is refused when it is read, not found out later.
#[test]
fn set_ups_beyond_measure_are_refused() {
    let needle = json!({"type": "ellipse", "center": [0, 0], "semi_axes": [1, 1e-9]});
    let vortex = json!({"type": "flow", "flow": {"type": "single_vortex", "period": 2}});
    for (place, body) in [
        ("/spacing", json!({"law": "geometrical_optics", "shape": needle, "spacing": 0.05})),
        ("/spacing", json!({"law": "geometrical_optics", "spacing": 1e-9})),
        ("/spacing", json!({"shape": {"type": "circle", "center": [1e7, 0], "radius": 0.25}})),
        ("/time_step", json!({"law": vortex, "end_time": 2, "cfl": 1e-300})),
        ("/adaptivity/levels", json!({"adaptivity": {"levels": 9}})),
    ] {
        let places = refusals(&body);
        assert!(!places.is_empty() && places.iter().all(|found| found == place), "{body}: {places:?}");
    }
}

fn refusals(body: &Value) -> Vec<String> {
    let violations = parse(&front(body), SCENES).err().unwrap_or_default();
    violations.into_iter().map(|violation| violation.pointer).collect()
}

/// Steps, numbers of particles and weights with which motion by curvature blows up, slowly or at once; those beside them hold for
/// many steps: curvatures tell long before distances do.
#[test]
fn motion_by_curvature_is_stable_or_refused() {
    let sphere = json!({"type": "sphere", "center": [0.5, 0.503, 0.49], "radius": 0.4});
    let circle = json!({"type": "circle", "center": [0.5, 0.503], "radius": 0.4});
    // cells, steps in h² that hold with the fewest particles and that are refused, by the degree and the integrator; the bound of
    // the curvature.
    for (shape, cells, (degree, fewest, weight), integrator, (holds, refused), steps, most) in [
        (&circle, 96.0, (2, 6, 0.0), "rk4", (0.79, 0.81), 600.0, 2e-2),
        (&circle, 96.0, (4, 10, 0.0), "rk4", (0.79, 0.81), 600.0, 2e-4),
        (&circle, 96.0, (4, 10, 1.0), "rk4", (0.49, 0.51), 900.0, 2e-4),
        (&circle, 96.0, (4, 10, 0.0), "tvd_rk2", (0.57, 0.58), 600.0, 2e-4),
        (&sphere, 40.0, (2, 14, 0.0), "rk4", (0.69, 0.71), 50.0, 0.2),
        (&sphere, 40.0, (3, 16, 0.0), "tvd_rk2", (0.46, 0.47), 70.0, 0.2),
        (&sphere, 40.0, (4, 32, 0.0), "rk4", (0.54, 0.56), 60.0, 5e-3),
        (&sphere, 40.0, (4, 32, 0.5), "rk4", (0.49, 0.51), 60.0, 5e-3),
        (&sphere, 40.0, (4, 32, 0.0), "tvd_rk2", (0.39, 0.4), 80.0, 5e-3),
    ] {
        let body = |factor: f64| {
            let step = factor / cells / cells;
            json!({
                "shape": shape, "law": "mean_curvature", "spacing": 1.0 / cells, "degree": degree, "neighbors": fewest, "weight": weight,
                "integrator": integrator, "time_step": step, "end_time": steps * step
            })
        };
        assert_eq!(refusals(&body(refused)), ["/time_step"], "{}", body(refused));
        let off = error(&run(&front(&body(holds))), "curvature", "rms", None);
        assert!(off < most, "{}: {off:e}", body(holds));
    }
    for (shape, degree, fewest) in
        [(&circle, 2, 6), (&circle, 3, 7), (&circle, 4, 10), (&sphere, 2, 14), (&sphere, 3, 16), (&sphere, 4, 32)]
    {
        let body = |neighbors: u32| json!({"shape": shape, "law": "mean_curvature", "spacing": 0.05, "degree": degree, "neighbors": neighbors});
        assert_eq!(refusals(&body(fewest - 1)), ["/neighbors"]);
        assert!(refusals(&body(fewest)).is_empty());
    }
    assert_eq!(refusals(&json!({"law": "mean_curvature", "weight": 1.1})), ["/weight"]);
    assert_eq!(
        refusals(&json!({"law": "mean_curvature", "shape": sphere, "spacing": 0.05, "weight": 0.6})),
        ["/weight"]
    );
    let more = json!({"law": "mean_curvature", "shape": sphere, "spacing": 0.05, "degree": 2, "normal_weight": 0.2});
    assert_eq!(refusals(&more), ["/normal_weight"]);
    // All at once: the bound of the step does not wait for the number of particles to be right.
    let both = json!({"law": "mean_curvature", "shape": sphere, "spacing": 0.05, "neighbors": 20, "time_step": 0.6 * 0.05 * 0.05});
    assert_eq!(refusals(&both), ["/time_step", "/neighbors"]);
    // The paper's ten particles of a surface would blow up with its own step.
    let paper = front(
        &json!({"shape": sphere, "law": "mean_curvature", "spacing": 1.0 / 32.0, "end_time": 0.02, "preset": "paper"}),
    );
    assert!(error(&run(&paper), "curvature", "rms", None) < 0.5);
}

/// GBPM 3.3.3: the parameter of every new foot-point is that of its place, in a flow and after it has crossed another part.
#[test]
fn a_parameter_is_carried_along_and_redistributed() {
    let test = json!({"type": "parameter"});
    let turning = json!({"type": "flow", "flow": {"type": "rotation", "center": [0.5, 0.5], "angular_velocity": 1}});
    let crossing = json!({
        "shape": balls("circle"), "end_time": 0.2, "topology": "cross", "segment_test": test
    });
    let turned = json!({"law": turning, "segment_test": test, "end_time": 1.0, "cfl": 1});
    // Centre of part k at the end, and how far all of it has turned.
    for (more, centers, angle) in [(turned, vec![0.5], 1.0), (crossing, vec![0.4, 0.6], 0.0)] {
        let (before, after) = (front(&more), at_end(&front(&more)));
        let start = build(&before, OutputPlan { every_time: None, series_every_steps: 1000 });
        let column = |simulation: &dyn Simulation, name: &str| {
            let fields = simulation.fields(Selection::All);
            let column = fields.columns.iter().find(|column| column.name == name).unwrap();
            let FieldValues::Scalar(values) = &column.values else { panic!("a number") };
            values.clone()
        };
        let angles = |simulation: &dyn Simulation, back: f64| -> Vec<f64> {
            let parts = column(simulation, "segment");
            let points = simulation.fields(Selection::All).points;
            let center = |part: &f64| centers[*part as usize];
            let angle = |x: &[f64; 3], part: &f64| (x[1] - center(part)).atan2(x[0] - center(part)) - back;
            points.iter().zip(&parts).map(|(x, part)| angle(x, part) / std::f64::consts::TAU).collect()
        };
        let offsets = |simulation: &dyn Simulation, back: f64| -> Vec<f64> {
            let parameters = column(simulation, "parameter");
            // The outline may run either way round.
            let shares = angles(simulation, back);
            parameters.iter().zip(shares).map(|(parameter, share)| (parameter - share).rem_euclid(1.0)).collect()
        };
        let (first, last) = (offsets(start.as_ref(), 0.0), offsets(after.as_ref(), angle));
        let reference = first[0];
        let off = |offset: &f64| (offset - reference - (offset - reference).round()).abs();
        assert!(first.iter().all(|offset| off(offset) < 1e-4), "{more}");
        assert!(last.iter().all(|offset| off(offset) < 2e-4), "{more}");
        assert!(error(&after.report(), "front", "coverage_h", None) < 1.0);
    }
}

/// GBPM 4.6, through the focus: past t = .47 the front crosses itself in the plane.
#[test]
fn wave_fronts_follow_their_rays() {
    let pi = std::f64::consts::PI;
    let shape = json!({"type": "ellipse", "center": [0, 0], "semi_axes": [0.6 * pi, 0.3 * pi]});
    for (end_time, speed) in [(0.4, 1.0), (1.2, 1.0), (0.4, -1.0)] {
        let law = json!({"type": "geometrical_optics", "speed": speed});
        let body = json!({"kind": "front", "law": law, "shape": shape, "spacing": pi / 64.0, "end_time": end_time});
        let report = run(&body);
        assert!(error(&report, "front", "max", None) < 1e-5, "{body}");
        assert!(error(&report, "front", "gap_h", None) < 1.5, "{body}");
    }
}

/// Nothing that runs ends well with figures of nothing.
#[test]
fn what_cannot_be_followed_is_said() {
    let gone =
        json!({"shape": {"type": "circle", "radius": 0.05}, "law": {"type": "normal", "speed": -1}, "end_time": 0.1});
    let report = run(&front(&gone));
    assert!(!report.errors.iter().any(|e| e.quantity == "front" && e.norm != "count"), "{:?}", report.errors);
    assert!(error(&report, "front", "count", None).abs() < 1e-12);
    // So thin that its tips are far below the grid.
    let thin = json!({"type": "ellipse", "center": [0.5, 0.5], "semi_axes": [0.4, 0.02]});
    let mut open = at_end(&front(&json!({"shape": thin, "law": "mean_curvature", "end_time": 0.002})));
    assert!(open.take_findings().iter().any(|finding| finding.code == "front_open"));
    let fast = front(&json!({"law": {"type": "normal", "speed": 1e308}, "time_step": 10, "end_time": 20}));
    let mut lost = build(&fast, OutputPlan { every_time: None, series_every_steps: 1000 });
    assert!(matches!(lost.step(), Err(StepError::NonFinite { .. })));
}

/// The rows' bounds for 257², at 129² by what order 4 makes of it; and no gap.
#[test]
fn the_vortex_that_turns_back_is_closed_and_round() {
    let flow = json!({"type": "single_vortex", "period": 2});
    let report = run(&json!({"kind": "vortex", "spacing": 1.0 / 128.0, "flow": flow, "end_time": 2, "method": "gbpm"}));
    assert!(error(&report, "radius", "deviation", None) < 3e-4);
    assert!(error(&report, "front", "gap_h", None) < 1.5);
    let sphere = json!({"type": "sphere", "center": [0.35, 0.35, 0.35], "radius": 0.15});
    let report = run(&json!({
        "kind": "vortex", "spacing": 1.0 / 50.0, "flow": "vortex_3d", "end_time": 2, "method": "gbpm", "shape": sphere
    }));
    // Half way the sheet is thinner than the grid resolves.
    assert!(error(&report, "front", "max", None) < 0.01, "a stray sheet");
    assert!(error(&report, "radius", "deviation", None) < 1e-3);
    assert!(error(&report, "front", "coverage_h", None) < 1.5);
    assert!(error(&report, "front", "mean", Some(1.0)) < 0.04 / 50.0);
    assert!(error(&report, "front", "coverage_h", Some(1.0)) < 1.5);
}

/// In a flow no side of a body grows past its corners and edges, and the mouth of a slot of a few spacings stays open: exact as the
/// paths, and within half a spacing where some edges lie beside the grid points.
#[test]
fn sides_end_at_their_corners() {
    let disk =
        json!({"type": "zalesak_disk", "center": [0.5, 0.75], "radius": 0.15, "slot_width": 0.05, "slot_depth": 0.25});
    let cube = json!({"type": "box", "center": [0.5, 0.6, 0.5], "size": [0.3, 0.3, 0.3]});
    for (shape, center, spacings, most) in [
        (disk, json!([0.5, 0.5]), vec![0.008, 0.01, 0.0125, 0.015], 5e-5),
        (cube.clone(), json!([0.5, 0.5, 0.5]), vec![0.02], 5e-5),
        (cube, json!([0.5, 0.5, 0.5]), vec![0.0213], 0.5 * 0.0213),
    ] {
        let flow = json!({"type": "rotation", "center": center, "angular_velocity": 2});
        for spacing in spacings {
            let report = run(&front(&json!({
                "law": {"type": "flow", "flow": flow}, "shape": shape, "spacing": spacing, "end_time": std::f64::consts::PI
            })));
            let (far, coverage) = (error(&report, "front", "max", None), error(&report, "front", "coverage_h", None));
            assert!(far < most && coverage < 1.5, "{shape} {spacing}: {far:e}, coverage {coverage}");
        }
    }
}

/// T = 8 at 129², a filament far below the grid: neither few long steps nor many short ones leave strays.
#[test]
fn the_filament_comes_back_whatever_the_step() {
    for (cfl, integrator) in [(4, "rk4"), (8, "rk4"), (24, "dopri5")] {
        let report = run(&json!({
            "kind": "vortex", "spacing": 1.0 / 128.0, "end_time": 8, "integrator": integrator, "method": {"type": "gbpm", "cfl": cfl}
        }));
        let (deviation, far) = (error(&report, "radius", "deviation", None), error(&report, "front", "max", None));
        assert!(deviation < 2e-4 && far < 2e-3, "step factor {cfl}: {deviation:e}, {far:e}");
        assert!(error(&report, "front", "gap_h", None) < 1.5, "step factor {cfl}");
    }
}

/// A quadratic of six particles and their normals, by one of sixteen particles; normals are exact in a flow alone.
#[test]
fn normals_take_part_in_flows() {
    let law = json!({"type": "flow", "flow": {"type": "translation", "velocity": [0.5, 0.5, 0.5]}});
    let sphere = json!({"type": "sphere", "center": [0.35, 0.35, 0.35], "radius": 0.15});
    let off = |more: Value| {
        let mut body = front(&json!({"spacing": 0.025, "law": law, "shape": sphere, "end_time": 0.2}));
        body.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        error(&run(&body), "front", "rms", None)
    };
    let (with, without) = (off(json!({})), off(json!({"normal_weight": 0})));
    assert!(with < 0.5 * without, "{with:e} {without:e}");
    let refused =
        parse(&front(&json!({"law": "mean_curvature", "normal_weight": 0.1, "degree": 4, "neighbors": 3})), SCENES);
    let places: Vec<String> = refused.err().unwrap().into_iter().map(|violation| violation.pointer).collect();
    assert_eq!(places, ["/normal_weight", "/neighbors"]);
}

/// r² = R² − 2 (D − 1) t, down to the last cell: within a few h² of the time, and the front is gone.
#[test]
fn balls_shrink_by_their_curvature_until_they_vanish() {
    for (shape, spacing, extinction) in [
        (json!({"type": "circle", "center": [0.5, 0.5], "radius": 0.25}), 1.0 / 64.0, 0.03125),
        (json!({"type": "sphere", "center": [0.5, 0.5, 0.5], "radius": 0.25}), 1.0 / 24.0, 0.015625),
    ] {
        let body = front(&json!({
            "shape": shape, "spacing": spacing, "law": "mean_curvature", "end_time": 1.3 * extinction
        }));
        let mut simulation = at_end(&body);
        assert_eq!(simulation.particle_count(), 0, "{body}");
        let findings = simulation.take_findings();
        assert!(findings.iter().any(|finding| finding.code == "front_vanished"), "{findings:?}");
        let report = simulation.report();
        let off = error(&report, "extinction", "absolute", None);
        assert!(off < 2.0 * spacing * spacing, "{body}: {off:e}");
    }
}

/// A corner that collapses to a point, circles that touch, a front that leaves any box.
#[test]
fn hard_cases_neither_panic_nor_leave_stray_particles() {
    let thin = json!({"type": "box", "center": [0.5, 0.5], "size": [0.6, 0.06]});
    let mut collapsed =
        at_end(&front(&json!({"shape": thin, "law": {"type": "normal", "speed": -1}, "end_time": 0.06})));
    assert_eq!(collapsed.particle_count(), 0);
    assert!(collapsed.take_findings().iter().any(|finding| finding.message.contains("swept")));
    let circle = |x: f64| json!({"type": "circle", "center": [x, 0.5], "radius": 0.1});
    let touching = json!({"type": "union", "of": [circle(0.4), circle(0.6 + 1e-9)]});
    let report = run(&front(&json!({"shape": touching, "end_time": 0.05})));
    assert!(error(&report, "front", "max", None) < 0.25 / 128.0);
    let far = json!({"type": "flow", "flow": {"type": "translation", "velocity": [1e9, 0]}});
    let gone = at_end(&front(&json!({"law": far, "end_time": 0.1, "time_step": 0.05})));
    let report = gone.report();
    assert!(
        gone.particle_count() == 0 && report.diagnostic("particles.outside").unwrap() > 0.0,
        "{:?}",
        report.diagnostics
    );
}

/// Every foot-point is within γ of its own grid point, and no grid point has two.
#[test]
fn foot_points_and_grid_points_are_one_to_one() {
    let simulation = at_end(&front(&json!({"end_time": 0.1})));
    let fields = simulation.fields(Selection::All);
    let column = fields.columns.iter().find(|column| column.name == "grid_point").unwrap();
    let FieldValues::Vector(nodes) = &column.values else { panic!("a vector") };
    let mut seen = std::collections::BTreeSet::new();
    for (y, p) in fields.points.iter().zip(nodes) {
        let distance = (0..3).map(|d| (y[d] - p[d]).powi(2)).sum::<f64>().sqrt();
        assert!(distance <= 1.1 / 128.0 * (1.0 + 1e-12));
        assert!(seen.insert(p.map(f64::to_bits)), "twice: {p:?}");
    }
}
