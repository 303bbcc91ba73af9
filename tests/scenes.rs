//! What every scene must do, whatever it is: run its example, go on from any step bit for bit, not depend on the
//! number of threads, and declare defaults that are valid.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "support/mod.rs"]
mod support;
#[path = "scenes/data_inputs.rs"]
mod data_inputs;
#[path = "scenes/droplets.rs"]
mod droplets;
#[path = "scenes/fronts.rs"]
mod fronts;
#[path = "scenes/own_inputs.rs"]
mod own_inputs;
#[path = "scenes/shapes.rs"]
mod shapes;
#[path = "scenes/shear.rs"]
mod shear;
#[path = "scenes/surfaces.rs"]
mod surfaces;
#[path = "scenes/walls.rs"]
mod walls;

use meniscus::parallel::Interrupt;
use meniscus::scene::{BuildContext, Cloud, CloudSizes, Clouds};
use meniscus::scenes::SCENES;
use meniscus::simulation::{CpuClock, Entry, OutputPlan, Section, Selection, state_of};
use serde_json::{Value, json};
use support::{build, build_with, pool, scene};

const PLAN: OutputPlan = OutputPlan { every_time: Some(0.21), series_every_steps: 3 };

/// Scenes that between them use every choice which feeds back into the state.
fn bodies() -> Vec<Value> {
    let mut bodies: Vec<Value> =
        SCENES.iter().map(|kind| serde_json::from_str::<Value>(kind.example).unwrap()["scene"].clone()).collect();
    let vortex = |extra: Value| {
        let mut body = json!({"kind": "vortex", "spacing": 0.05, "band_h": 16, "end_time": 1, "steps": 12});
        body.as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
        body
    };
    bodies.push(vortex(json!({"field": "overwrite"})));
    bodies.push(vortex(
        json!({"field": "overwrite", "redistance": {"type": "every", "steps": 5}, "integrator": "tvd_rk2"}),
    ));
    bodies.push(vortex(json!({"redistance": {"type": "every", "steps": 4}, "integrator": "dopri5", "jitter": 0.2})));
    bodies.push(vortex(json!({"redistance": {"type": "every", "steps": 3}, "method": "pcp"})));
    bodies.push(json!({
        "kind": "vortex", "spacing": 0.05, "band_h": 6, "end_time": 0.5, "steps": 5, "flow": "vortex_3d",
        "shape": {"type": "sphere", "center": [0.35, 0.35, 0.35], "radius": 0.15},
        "redistance": {"type": "every", "steps": 2}
    }));
    for kernel in ["lambda44", "gaussian"] {
        bodies.push(json!({
            "kind": "redistance", "spacing": 0.05, "repeat": 3, "method": {"type": "remesh", "kernel": kernel}
        }));
    }
    bodies.extend(droplets::bodies());
    bodies.push(vortex(json!({"flow": {"type": "rotation", "center": [0.5, 0.5], "angular_velocity": 3}})));
    bodies.push(json!({
        "kind": "surface_pde", "surface": {"type": "ellipsoid", "semi_axes": [1, 0.6, 0.8]}, "count": 700, "repeat": 5,
        "problem": {"type": "laplace_beltrami", "field": "plane_wave"}, "method": {"type": "surface_dcpse", "order": 6, "cutoff_dn": 3.8}
    }));
    bodies.extend(surfaces::bodies());
    bodies.extend(fronts::bodies());
    bodies.extend(own_inputs::bodies());
    bodies.extend(shapes::bodies());
    bodies.extend(shear::bodies());
    bodies.push(json!({"kind": "redistance", "dimension": 3, "spacing": 0.125, "repeat": 3, "method": {"type": "pcp", "degree": 3}}));
    bodies.push(json!({
        "kind": "vortex", "spacing": 0.1, "band_h": 8, "end_time": 0.5, "steps": 4,
        "shape": {"type": "sphere", "radius": 0.4}, "flow": {"type": "translation", "velocity": [1, 0, 0.5]},
        "field": "overwrite", "method": {"type": "pcp", "degree": 2}
    }));
    bodies
}

fn states(body: &Value, clouds: &Clouds, threads: usize) -> Vec<Section> {
    pool(threads).install(|| {
        let mut simulation = build_with(body, PLAN, clouds).unwrap();
        let mut states = vec![state_of(simulation.as_ref())];
        while !simulation.is_finished() {
            simulation.step().unwrap();
            states.push(state_of(simulation.as_ref()));
        }
        for state in &states {
            // A checkpoint takes nothing else.
            assert_eq!(state.find_non_finite(), None, "{body}");
        }
        states
    })
}

/// Equality to the last bit.
fn assert_same(a: &Section, b: &Section, what: &str) {
    let names = |section: &Section| section.entries().map(|(name, _)| name.to_owned()).collect::<Vec<_>>();
    assert_eq!(names(a), names(b), "{what}");
    for ((name, x), (_, y)) in a.entries().zip(b.entries()) {
        match (x, y) {
            (Entry::Section(x), Entry::Section(y)) => assert_same(x, y, &format!("{name} of {what}")),
            (Entry::Reals { values: x, .. }, Entry::Reals { values: y, .. }) => {
                assert_eq!(x.len(), y.len(), "{name} of {what}");
                let place = x.iter().zip(y).position(|(x, y)| x.to_bits() != y.to_bits());
                assert_eq!(place, None, "{name} of {what} differs");
            }
            (Entry::Real(x), Entry::Real(y)) => {
                assert_eq!(x.map(f64::to_bits), y.map(f64::to_bits), "{name} of {what}");
            }
            _ => assert_eq!(x, y, "{name} of {what}"),
        }
    }
}

#[test]
fn every_example_runs_to_its_end_with_finite_results() {
    for kind in SCENES {
        let body: Value = serde_json::from_str(kind.example).unwrap();
        pool(2).install(|| {
            let mut simulation = build(&body["scene"], PLAN);
            while !simulation.is_finished() {
                simulation.step().unwrap();
            }
            let report = simulation.report();
            assert!(report.health.finite, "{}", kind.kind);
            assert!(report.errors.iter().all(|e| e.value.is_finite()), "{}: {:?}", kind.kind, report.errors);
            assert!(!report.errors.is_empty(), "{}", kind.kind);
            let names: Vec<&str> = simulation.fields(Selection::All).columns.iter().map(|c| c.name).collect();
            let mut promised: Vec<&str> = scene(&body["scene"]).fields().iter().map(|field| field.name).collect();
            promised.sort_unstable();
            let mut shown = names.clone();
            shown.sort_unstable();
            assert_eq!(shown, promised, "{}", kind.kind);
        });
    }
}

#[test]
fn k_steps_and_a_restore_and_the_rest_equal_the_unbroken_run_for_1_2_and_3_threads() {
    for body in bodies() {
        check_restarts(&body, &Clouds::new());
    }
}

/// k steps, a restore and the rest are the unbroken run, on any number of threads.
fn check_restarts(body: &Value, clouds: &Clouds) {
    let unbroken = states(body, clouds, 1);
    for threads in [2, 3] {
        for (a, b) in states(body, clouds, threads).iter().zip(&unbroken) {
            assert_same(a, b, &format!("{threads} threads, {body}"));
        }
    }
    let last = unbroken.len() - 1;
    for k in [0, 1, last / 2, last - 1, last] {
        let threads = 1 + k % 3;
        pool(threads).install(|| {
            let mut simulation = build_with(body, PLAN, clouds).unwrap();
            simulation.load(&unbroken[k]).unwrap();
            assert_same(&state_of(simulation.as_ref()), &unbroken[k], "restored");
            while !simulation.is_finished() {
                simulation.step().unwrap();
            }
            let what = format!("restart at {k} on {threads} threads, {body}");
            assert_same(&state_of(simulation.as_ref()), &unbroken[last], &what);
        });
    }
}

#[test]
fn looking_changes_nothing() {
    for body in bodies() {
        pool(2).install(|| {
            let mut watched = build(&body, PLAN);
            while !watched.is_finished() {
                watched.step().unwrap();
                let (fields, again) = (watched.fields(Selection::All), watched.fields(Selection::All));
                assert_eq!(fields.points, again.points);
                let _ = (watched.observables(), watched.report(), watched.health());
            }
            assert_same(
                &state_of(watched.as_ref()),
                states(&body, &Clouds::new(), 1).last().unwrap(),
                &body.to_string(),
            );
        });
    }
}

#[test]
fn a_state_of_another_scene_is_refused_and_nothing_changes() {
    let small = build(&json!({"kind": "redistance", "spacing": 0.1}), PLAN);
    let mut large = build(&json!({"kind": "redistance", "spacing": 0.05}), PLAN);
    let before = state_of(large.as_ref());
    assert!(large.load(&state_of(small.as_ref())).unwrap_err().to_string().contains("numbers, this scene needs"));
    assert_same(&state_of(large.as_ref()), &before, "after a refused restore");
    let mut vortex = build(&json!({"kind": "vortex", "spacing": 0.1}), PLAN);
    assert!(vortex.load(&state_of(small.as_ref())).is_err());
    let mut beyond = before.clone();
    beyond.section_mut("clock").unwrap().put_count("step", 99);
    assert!(large.load(&beyond).unwrap_err().to_string().contains("ends at step 1"));
}

#[test]
fn an_interrupt_drops_the_step() {
    let context = BuildContext {
        plan: PLAN,
        interrupt: Interrupt::default(),
        cpu_clock: CpuClock::still(),
        clouds: Clouds::new(),
    };
    let mut simulation = scene(&json!({"kind": "redistance"})).build(context.clone()).unwrap();
    context.interrupt.raise();
    assert_eq!(simulation.step().unwrap_err(), meniscus::simulation::StepError::Interrupted);
}

/// A column of the particles of a state.
fn reals(state: &Section, name: &str) -> Vec<f64> {
    state.section("particles", |particles| particles.reals(name)).unwrap().to_vec()
}

/// Fields, observables and norms of every run are those that its kind declares, each with a sentence.
#[test]
fn what_runs_show_is_declared() {
    for body in bodies() {
        let kind = SCENES.iter().find(|kind| body["kind"] == kind.kind).unwrap();
        let declared = (kind.quantities)();
        pool(2).install(|| {
            let mut simulation = build(&body, PLAN);
            while !simulation.is_finished() {
                simulation.step().unwrap();
            }
            let promised = scene(&body).fields();
            let fields = simulation.fields(Selection::All);
            let shown: Vec<&str> = fields.columns.iter().map(|column| column.name).collect();
            for field in &promised {
                assert!(shown.contains(&field.name), "{} of {body}", field.name);
                assert!(declared.fields.iter().any(|known| known.name == field.name), "{} of {body}", field.name);
            }
            assert_eq!(shown.len(), promised.len(), "{body}");
            let one = [shown[0].to_owned()];
            assert_eq!(simulation.fields(Selection::Named(&one)).columns.len(), 1, "{body}");
            for (quantity, _) in simulation.observables() {
                assert!(declared.observables.contains(&quantity), "{} of {body}", quantity.name);
            }
            for error in simulation.report().errors {
                assert!(declared.norms.iter().any(|known| known.name == error.norm), "{} of {body}", error.norm);
            }
        });
        let lists = declared.fields.iter().chain(&declared.observables).chain(&declared.norms);
        for quantity in lists {
            assert!(quantity.doc.ends_with('.') && quantity.doc.len() > 10, "{quantity:?}");
        }
    }
}

/// Every default that a scene declares lies in its own range, at every depth.
#[test]
fn declared_defaults_are_valid() {
    fn walk(schema: &Value, place: &str) {
        if let Some(default) = schema.get("default").and_then(Value::as_f64) {
            // An optional number has its range among the alternatives.
            let ranges = schema["anyOf"].as_array().map_or_else(|| vec![schema], |options| options.iter().collect());
            let is_within = |range: &&Value| {
                let bound = |name: &str| range.get(name).and_then(Value::as_f64);
                bound("minimum").is_none_or(|least| default >= least)
                    && bound("maximum").is_none_or(|most| default <= most)
                    && bound("exclusiveMinimum").is_none_or(|least| default > least)
                    && bound("exclusiveMaximum").is_none_or(|most| default < most)
            };
            assert!(ranges.iter().all(is_within), "{place}: {default} in {schema}");
        }
        match schema {
            Value::Object(map) => map.iter().for_each(|(name, value)| walk(value, &format!("{place}/{name}"))),
            Value::Array(list) => list.iter().enumerate().for_each(|(k, value)| walk(value, &format!("{place}/{k}"))),
            _ => {}
        }
    }
    for kind in SCENES {
        walk(&kind.json_schema(), kind.kind);
        for preset in kind.preset_names() {
            scene(&json!({"kind": kind.kind, "preset": preset, "spacing": 0.1}));
        }
    }
}

/// A worker, and a restart, take their scene from what was resolved before: the same must come out again, and do the same.
#[test]
fn what_is_resolved_resolves_to_itself() {
    for body in bodies() {
        pool(2).install(|| {
            let [mut written, mut resolved] = [&body, &scene(&body).resolved()].map(|body| build(body, PLAN));
            for _ in 0..3 {
                assert_eq!(resolved.is_finished(), written.is_finished(), "{body}");
                if !written.is_finished() {
                    written.step().unwrap();
                    resolved.step().unwrap();
                }
                assert_same(&state_of(resolved.as_ref()), &state_of(written.as_ref()), &format!("as resolved, {body}"));
            }
        });
    }
    let mut bodies = bodies();
    bodies.push(json!({"kind": "vortex", "preset": "paper"}));
    bodies.push(json!({"kind": "redistance", "preset": "paper", "dimension": 3}));
    bodies.push(json!({"kind": "redistance", "shape": {"type": "box", "size": [1, 1]}, "band": 0.3}));
    for case in ["oscillating", "dividing", "static"] {
        for dimension in [2, 3] {
            bodies.push(json!({"kind": "droplet", "case": case, "dimension": dimension, "spacing": 0.04}));
            bodies.push(
                json!({"kind": "droplet", "case": case, "dimension": dimension, "spacing": 0.04, "preset": "paper"}),
            );
        }
    }
    for body in bodies {
        let once = scene(&body).resolved();
        assert_eq!(scene(&once).resolved(), once, "{body}");
    }
}

/// Parameters that would make nonsense of a legal-looking scene are refused at their place.
#[test]
fn nonsense_is_refused_at_its_place() {
    for (body, place) in [
        (
            json!({"kind": "redistance", "initial": "scaled", "shape": {"type": "circle", "center": [-5, 0], "radius": 0.5}}),
            "/initial",
        ),
        (
            json!({"kind": "redistance", "shape": {"type": "zalesak_disk", "radius": 0.15, "slot_width": 0.28, "slot_depth": 0.05}}),
            "/shape/slot_depth",
        ),
        (json!({"kind": "redistance", "type": "foo"}), "/type"),
        (json!({"kind": "vortex", "end_time": 5e-321, "steps": 60_000_000}), "/end_time"),
        (json!({"kind": "redistance", "method": {"type": "pcp", "weight": 1e5}}), "/method/weight"),
        (json!({"kind": "droplet", "case": "custom"}), "/shape"),
        (json!({"kind": "droplet", "fluids": {"inside": {"density": -1}}}), "/fluids/inside/density"),
        (json!({"kind": "droplet", "fluids": {"inside": {"densty": 1}}}), "/fluids/inside/densty"),
        (json!({"kind": "droplet", "spacing": 0.5}), "/domain"),
        (json!({"kind": "droplet", "domain": {"low": [0, 0], "high": [1, -1]}}), "/domain/high"),
        (json!({"kind": "droplet", "shape": {"type": "circle", "radius": 3}}), "/shape"),
        (json!({"kind": "droplet", "geometry": {"type": "pcp", "band_h": 4}}), "/geometry/band_h"),
        (
            json!({"kind": "droplet", "geometry": {"type": "pcp", "neighborhood": "material"}}),
            "/geometry/neighborhood/type",
        ),
        (json!({"kind": "droplet", "time_step": 1e-3, "steps": 7}), "/time_step"),
        (json!({"kind": "droplet", "tension_slope": [0.1]}), "/tension_slope"),
        (json!({"kind": "droplet", "tension_slope": [3, 0]}), "/tension_slope"),
        (json!({"kind": "droplet", "tension_slope": [0.1, 0], "surfactant": {}}), "/tension_slope"),
        (json!({"kind": "droplet", "tension_slope": [0.1, 0], "tension_force": "csf"}), "/tension_force"),
        (json!({"kind": "droplet", "surfactant": {"coverage": 1}}), "/surfactant/coverage"),
        (json!({"kind": "droplet", "surfactant": {"coverage": 0.9, "elasticity": 1}}), "/surfactant/elasticity"),
        (json!({"kind": "droplet", "surfactant": {"coverage": 0.2, "slope": [1, 0]}}), "/surfactant/slope"),
        (json!({"kind": "droplet", "surfactant": {}, "shifting": "pst"}), "/shifting"),
        (json!({"kind": "droplet", "surfactant": {}, "surface_tension": 0}), "/surface_tension"),
        (json!({"kind": "droplet", "discretization": "dcpse", "geometry": "colorfield"}), "/geometry"),
        (json!({"kind": "droplet", "discretization": "dcpse", "fluids": {"inside": {"viscosity": 1}}}), "/fluids"),
        (json!({"kind": "droplet", "discretization": {"type": "dcpse", "order": 3}}), "/discretization/order"),
        (json!({"kind": "surface_pde", "method": {"type": "surface_dcpse", "order": 3}}), "/method/order"),
        (json!({"kind": "surface_pde", "surface": {"type": "ellipsoid", "semi_axes": [1, 2]}}), "/surface/semi_axes"),
        (
            json!({"kind": "surface_pde", "surface": "ellipsoid", "problem": {"type": "poisson", "field": "spherical_harmonic"}}),
            "/problem/field",
        ),
        (json!({"kind": "surface_pde", "dimension": 2}), "/dimension"),
        (json!({"kind": "surface_pde", "sampling": "regular"}), "/sampling"),
        (json!({"kind": "surface_pde", "surface": {"type": "torus", "minor_radius": 2}}), "/surface/minor_radius"),
        (json!({"kind": "surface_pde", "problem": "curvature", "repeat": 3}), "/repeat"),
        (json!({"kind": "surface_pde", "problem": "curvature", "method": "closest_point"}), "/problem"),
        (json!({"kind": "surface_pde", "surface": "circle", "method": "closest_point"}), "/method"),
        (json!({"kind": "surface_pde", "method": {"type": "surface_dcpse", "layers": 3}}), "/method/layers"),
        (
            json!({"kind": "surface_pde", "normals": "estimated", "method": {"type": "surface_dcpse", "form": "copies"}}),
            "/method/form",
        ),
        (json!({"kind": "surface_pde", "surface": "bump", "problem": "poisson"}), "/problem"),
        (json!({"kind": "surface_pde", "count": 200, "method": {"type": "surface_dcpse", "order": 6}}), "/count"),
        (
            json!({"kind": "surface_pde", "method": {"type": "surface_dcpse", "order": 4, "cutoff_dn": 1.5}}),
            "/method/cutoff_dn",
        ),
        (
            json!({"kind": "surface_pde", "problem": {"type": "laplace_beltrami", "field": {"type": "plane_wave", "k": [0, 0, 0]}}}),
            "/problem/field/k",
        ),
        (
            json!({"kind": "surface_pde", "problem": {"type": "laplace_beltrami", "field": {"type": "spherical_harmonic", "l": 2, "m": -3}}}),
            "/problem/field/m",
        ),
        (
            json!({"kind": "surface_pde", "problem": {"type": "laplace_beltrami", "field": {"type": "plane_wave", "k": [1, 2]}}}),
            "/problem/field/k",
        ),
        (
            json!({"kind": "surface_pde", "surface": "circle", "count": 99, "problem": {"type": "poisson", "field": {"type": "sin_plus_cos", "m": 50}}}),
            "/problem/field/m",
        ),
        // A preset reads what is given only where it is valid.
        (json!({"kind": "droplet", "preset": "paper", "dimension": 4}), "/dimension"),
        (json!({"kind": "front", "preset": "paper", "degree": 9}), "/degree"),
        (json!({"kind": "surface_pde", "surface": {"type": "bump", "height": 10.1}}), "/surface/height"),
        (json!({"kind": "surface_pde", "surface": {"type": "sphere", "radius": 1e-60}}), "/surface"),
        (json!({"kind": "surface_pde", "solver": {"type": "bicgstab", "tolerance": 1e-9}}), "/solver"),
        (json!({"kind": "surface_pde", "problem": "diffusion", "solver": "sparse_lu"}), "/solver"),
    ] {
        let found = meniscus::scene::parse(&body, SCENES).err().unwrap();
        assert!(found.iter().any(|v| v.pointer == place), "{body}: {found:?}");
    }
    let bare = scene(&json!({"kind": "redistance", "preset": "paper", "method": "pcp"})).resolved();
    assert_eq!(bare, scene(&json!({"kind": "redistance", "preset": "paper"})).resolved());
}

#[test]
fn estimates_of_particles_are_within_five_per_cent() {
    for body in bodies() {
        let estimated = scene(&body).estimate(&CloudSizes::new()).particles as f64;
        let made = build(&body, PLAN).particle_count() as f64;
        assert!((estimated / made - 1.0).abs() < 0.05, "{estimated} for {made}: {body}");
    }
}

#[test]
fn points_from_outside_are_redistanced_asked_about_and_carried_along() {
    // Particles of a circle with a level that is no distance, as somebody else's program might write them.
    let circle = |x: f64, y: f64| (x - 0.5).hypot(y - 0.5) - 0.25;
    let mut cloud = Cloud { level: Some(Vec::new()), ..Cloud::default() };
    for k in 0..1600 {
        let (x, y) = (f64::from(k % 40) * 0.025, f64::from(k / 40) * 0.025 + 0.001 * f64::from(k % 7));
        cloud.positions.push([x, y, 0.0]);
        let level = circle(x, y) * (1.3 + 0.4 * x);
        // Whoever has no level knows nothing of the surface.
        cloud.level.as_mut().unwrap().push(if level.abs() < 0.2 { level } else { f64::NAN });
    }
    let positions = vec![[0.5, 0.5, 0.0], [0.9, 0.5, 0.0], [0.5, 0.3, 0.0]];
    let queries = Cloud { positions, ..Cloud::default() };
    let clouds = Clouds::from([("/shape", cloud), ("/queries", queries)]);
    let points = json!({"type": "points", "file": "circle.vtkhdf"});
    let with = |scene_json: Value| {
        let context = BuildContext {
            plan: PLAN,
            interrupt: Interrupt::default(),
            cpu_clock: CpuClock::still(),
            clouds: clouds.clone(),
        };
        scene(&scene_json).build(context)
    };
    pool(2).install(|| {
        let own = json!({"kind": "redistance", "spacing": 0.025, "shape": points.clone()});
        assert_eq!(scene(&own).resolved(), scene(&scene(&own).resolved()).resolved());
        let mut simulation = with(own.clone()).unwrap();
        simulation.step().unwrap();
        let state = state_of(simulation.as_ref());
        let (phi, places) = (reals(&state, "phi"), reals(&state, "position"));
        for (phi, x) in phi.iter().zip(places.chunks(2)) {
            assert!((phi - circle(x[0], x[1])).abs() < 1e-5, "{phi} at {x:?}");
        }
        assert!(simulation.report().errors.is_empty(), "nobody knows the exact surface");
        let mut asked = own.clone();
        asked["queries"] = points.clone();
        let mut simulation = with(asked).unwrap();
        simulation.step().unwrap();
        let phi = reals(&state_of(simulation.as_ref()), "phi");
        for (phi, exact) in phi.iter().zip([-0.25, 0.15, -0.05]) {
            assert!((phi - exact).abs() < 1e-5, "{phi} for {exact}");
        }
        let flow = json!({"type": "rotation", "center": [0, 0], "angular_velocity": 1});
        let carried = json!({
            "kind": "vortex", "spacing": 0.025, "shape": points.clone(), "flow": flow, "end_time": 1, "steps": 30
        });
        let mut simulation = with(carried).unwrap();
        while !simulation.is_finished() {
            simulation.step().unwrap();
        }
        assert!(simulation.health().volume_drift.unwrap().abs() < 1e-4);
        // A drop takes its level from them: the inside has its area, and everybody its side.
        let domain = json!({"low": [0, 0], "high": [1, 1]});
        let drop = json!({
            "kind": "droplet", "case": "custom", "spacing": 0.025, "shape": points.clone(), "domain": domain, "end_time": 2e-3
        });
        let mut simulation = with(drop).unwrap();
        let state = state_of(simulation.as_ref());
        let places = reals(&state, "position");
        let sides = state.section("particles", |particles| particles.counts("phase")).unwrap();
        for (side, x) in sides.iter().zip(places.chunks(2)) {
            assert_eq!(*side == 1, circle(x[0], x[1]) < 0.0, "{x:?}");
        }
        let area = |simulation: &dyn meniscus::simulation::Simulation| {
            simulation.observables().into_iter().find(|(quantity, _)| quantity.name == "area").map_or(f64::NAN, |(_, area)| area)
        };
        let exact = std::f64::consts::PI / 16.0;
        assert!((area(simulation.as_ref()) / exact - 1.0).abs() < 1e-4);
        while !simulation.is_finished() {
            simulation.step().unwrap();
        }
        assert!((area(simulation.as_ref()) / exact - 1.0).abs() < 1e-3);
        // What does not fit is refused in words.
        let mut wrong = own.clone();
        wrong["spacing"] = json!(0.5);
        let found = with(wrong).err().unwrap();
        assert!(found[0].detail.contains("apart"), "{}", found[0].detail);
    });
}
