//! Bodies of `surface_pde`, and how its runs fail.

use super::PLAN;
use super::support::{build, error, pool, run, scene};
use meniscus::parallel::Interrupt;
use meniscus::scene::{BuildContext, CloudSizes, Clouds};
use meniscus::simulation::{CpuClock, Selection};
use serde_json::{Value, json};

/// Every problem, form, surface, sampling, solver and integrator of `surface_pde` once.
pub fn bodies() -> Vec<Value> {
    let dopri5 = json!({"type": "dopri5", "tolerance": 1e-6});
    let scene = |more: Value| {
        let mut body = json!({"kind": "surface_pde", "count": 400});
        body.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        body
    };
    let evolving = |more: Value| {
        let mut problem = json!({"type": "diffusion", "end_time": 0.02, "time_step": 0.005});
        problem.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        problem
    };
    vec![
        scene(json!({"repeat": 3, "method": {"type": "surface_dcpse", "form": "copies"}, "sampling": "random"})),
        scene(json!({"repeat": 3, "method": {"type": "closest_point", "order": 4}, "surface": {"type": "torus"}})),
        scene(json!({"repeat": 3, "surface": "circle", "method": {"type": "surface_dcpse", "form": "copies"}})),
        scene(
            json!({"problem": {"type": "poisson", "condition": "dirichlet"}, "solver": "gmres", "sampling": "random"}),
        ),
        scene(json!({"problem": "poisson", "method": {"type": "surface_dcpse", "order": 4}})),
        scene(json!({"problem": "poisson", "solver": "sparse_lu", "surface": "torus", "normals": "perturbed"})),
        scene(json!({"problem": "curvature", "surface": "ellipsoid"})),
        scene(json!({"problem": "curvature", "surface": "circle", "normals": "estimated"})),
        scene(json!({"problem": evolving(json!({}))})),
        scene(json!({"problem": evolving(json!({"integrator": "bdf2"}))})),
        scene(json!({"problem": evolving(json!({"integrator": dopri5})), "surface": {"type": "bump"}, "count": 1500})),
        scene(json!({"problem": {
            "type": "reaction_diffusion", "end_time": 0.4, "time_step": 0.1, "tolerance": 1e-6, "manufactured": "plane_wave"
        }})),
        scene(
            json!({"problem": {"type": "reaction_diffusion", "model": "gray_scott", "end_time": 0.4, "time_step": 0.1}}),
        ),
        // Neither a step nor a tolerance: what is chosen must be what is resolved.
        scene(json!({"problem": {"type": "diffusion", "end_time": 0.02}})),
        scene(json!({"problem": {"type": "reaction_diffusion", "end_time": 0.4}})),
        scene(json!({"problem": evolving(json!({"integrator": "bdf2"})), "solver": "gmres"})),
        scene(json!({"problem": evolving(json!({"integrator": "bdf2"})), "solver": "sparse_lu"})),
        scene(json!({"problem": "curvature", "surface": "torus", "sampling": "random_raw", "normals": "estimated"})),
        scene(json!({"problem": "gradient", "surface": "torus"})),
        scene(json!({"problem": {"type": "eigenvalues", "count": 6}})),
        scene(json!({"problem": {"type": "eigenvalues", "count": 4}, "surface": "torus", "method": "conservative"})),
        scene(json!({"problem": {"type": "geodesic_distance", "from": [[0, 0, 1], [1, 0, 0]]}})),
        scene(json!({"problem": "geodesic_distance", "surface": "circle"})),
        scene(json!({"problem": {"type": "advection", "end_time": 0.2, "time_step": 0.05}})),
        scene(
            json!({"problem": {"type": "advection", "end_time": 0.2, "time_step": 0.05, "diffusivity": 0.1}, "surface": "circle"}),
        ),
        scene(
            json!({"problem": {"type": "advection", "end_time": 0.2, "time_step": 0.05, "velocity": "stream"}, "surface": "torus"}),
        ),
        scene(json!({"problem": {"type": "moving_diffusion", "end_time": 0.2, "time_step": 0.05}})),
        scene(json!({
            "problem": {"type": "moving_diffusion", "motion": "normal", "end_time": 0.2, "time_step": 0.05}, "surface": "circle"
        })),
    ]
}

/// What cannot be right ends a run, or does not begin it, with words that say why.
#[test]
fn surfaces_that_fail_say_why() {
    let refused = |body: &Value| {
        let context = BuildContext {
            plan: PLAN,
            interrupt: Interrupt::default(),
            cpu_clock: CpuClock::still(),
            clouds: Clouds::new(),
        };
        scene(body).build(context).err().map_or_else(String::new, |found| found[0].detail.clone())
    };
    let field = json!({"type": "truncated_gaussian"});
    let nothing = json!({"kind": "surface_pde", "count": 400, "problem": {"type": "diffusion", "initial": field}});
    assert!(refused(&nothing).contains("zero at all of the 400 points"), "{}", refused(&nothing));
    let failure = |body: &Value| {
        pool(2).install(|| {
            let mut simulation = build(body, PLAN);
            while !simulation.is_finished() {
                if let Err(error) = simulation.step() {
                    return error.to_string();
                }
            }
            String::new()
        })
    };
    // Steps of a hundred times what is stable.
    let unstable = json!({"type": "diffusion", "end_time": 0.4, "time_step": 0.1});
    let reason = failure(&json!({"kind": "surface_pde", "count": 400, "problem": unstable}));
    assert!(reason.contains("max|u|") && reason.contains("cutoff_dn"), "{reason}");
    // Fits of degree 5 to copies that do not reach a neighbour.
    let lonely =
        json!({"type": "surface_dcpse", "form": "copies", "order": 4, "cutoff_dn": 1.1, "normal_spacing": 0.01});
    let reason = failure(&json!({"kind": "surface_pde", "count": 400, "method": lonely}));
    assert!(reason.contains("400 of 400 points") && reason.contains("point 0"), "{reason}");
}

/// The disc of the paper's lattice where the bump is, or would be, is where the second substance is sown.
#[test]
fn a_flat_bump_is_sown_too() {
    let model = json!({"type": "reaction_diffusion", "model": "gray_scott", "end_time": 1});
    let bump = json!({"type": "bump", "height": 0});
    let simulation = build(&json!({"kind": "surface_pde", "surface": bump, "count": 1500, "problem": model}), PLAN);
    let fields = simulation.fields(Selection::All);
    let second = fields.columns.iter().find(|column| column.name == "second_value").unwrap();
    assert!(format!("{:?}", second.values).contains("0.2"), "nothing is sown");
}

/// Second differences of so many points round off to more than the solvers' tolerance, whichever solves.
#[test]
fn poisson_on_a_fine_circle_is_solved_up_to_rounding() {
    for condition in ["dirichlet", "zero_mean"] {
        for solver in ["bicgstab", "gmres", "sparse_lu"] {
            let problem = json!({"type": "poisson", "condition": condition, "field": {"type": "sin_plus_cos", "m": 2}});
            let body = json!({
                "kind": "surface_pde", "surface": "circle", "count": 30_000, "problem": problem, "solver": solver
            });
            let found = error(&run(&body), "value", "relative", None);
            // Rounding by the condition number (N/2)².
            assert!(found < 1e-6, "{condition}, {solver}: {found:e}");
        }
    }
}

#[test]
fn what_is_not_given_follows_from_what_is() {
    let chosen = |body: &Value, place: &str| scene(body).resolved().pointer(place).and_then(Value::as_f64);
    for (order, cutoff) in [(2, 3.5), (4, 4.0), (6, 4.5)] {
        let method = json!({"type": "surface_dcpse", "order": order});
        let body = json!({"kind": "surface_pde", "sampling": "random_raw", "method": method});
        assert_eq!(chosen(&body, "/method/cutoff_dn"), Some(cutoff));
    }
    let copies = json!({"type": "surface_dcpse", "form": "copies"});
    let circle = json!({"type": "circle", "radius": 2});
    let body = json!({"kind": "surface_pde", "surface": circle, "count": 401, "method": copies});
    assert_eq!(chosen(&body, "/method/normal_spacing"), Some(0.015));
    for (order, cutoff) in [(2, 3.5), (4, 5.5)] {
        let body = json!({"kind": "droplet", "discretization": {"type": "dcpse", "order": order}});
        assert_eq!(chosen(&body, "/discretization/cutoff_h"), Some(cutoff));
    }
}

#[test]
fn memory_is_estimated_as_measured() {
    let memory = |body: &Value| scene(body).estimate(&CloudSizes::new()).memory_bytes as f64;
    for (spacing, measured) in [(0.01, 375e6), (0.007, 775e6)] {
        let method = json!({"type": "closest_point", "spacing": spacing});
        let estimated = memory(&json!({"kind": "surface_pde", "count": 2000, "method": method}));
        assert!((estimated / measured - 1.0).abs() < 0.1, "{spacing}: {estimated:e} for {measured:e}");
    }
    let poisson = |restart: u64| {
        let solver = json!({"type": "gmres", "restart": restart});
        memory(&json!({"kind": "surface_pde", "problem": "poisson", "solver": solver}))
    };
    assert!((poisson(160) - poisson(60) - 100.0 * 4000.0 * 8.0).abs() < 10.0);
}

/// What is carried along a surface is neither lost nor made, and turns with the surface.
#[test]
fn a_field_is_carried_and_kept() {
    for (surface, velocity) in [
        (json!("sphere"), json!({"type": "rotation", "axis": [1, 0, 0.5]})),
        (json!({"type": "torus", "minor_radius": 0.4}), json!("rotation")),
        (json!("circle"), json!({"type": "rotation", "rate": -2})),
    ] {
        let errors: Vec<f64> = [1000, 4000]
            .map(|count| {
                let problem = json!({"type": "advection", "velocity": velocity, "end_time": 1});
                let report =
                    run(&json!({"kind": "surface_pde", "surface": surface, "count": count, "problem": problem}));
                let mass = error(&report, "mass", "relative", None);
                assert!(mass < 1e-13, "{surface}: {mass:e}");
                error(&report, "value", "relative", None)
            })
            .to_vec();
        assert!(errors[1] < 0.02 && errors[0] > 3.0 * errors[1], "{surface}: {errors:?}");
    }
    let start = json!({"type": "spherical_harmonic", "l": 2});
    for velocity in [json!({"type": "stream", "k": [1, 2, -1]}), json!({"type": "uniform", "velocity": [0, 0, 1]})] {
        let problem = json!({"type": "advection", "velocity": velocity, "initial": start, "end_time": 0.5});
        let report = run(&json!({"kind": "surface_pde", "count": 2000, "problem": problem}));
        assert!(error(&report, "mass", "relative", None) < 1e-13, "{velocity}");
    }
}

/// A concentration on a sphere or a circle that grows or shrinks falls or rises with its size, and diffuses; nothing is lost.
#[test]
fn a_concentration_follows_a_surface_in_motion() {
    for (surface, motion, most) in [
        ("sphere", json!({"type": "expansion", "rate": 0.7}), 6e-3),
        ("sphere", json!({"type": "normal", "speed": 0.5}), 1.5e-2),
        ("sphere", json!({"type": "normal", "speed": -0.3}), 2e-2),
        ("circle", json!({"type": "normal", "speed": -0.3}), 2e-3),
    ] {
        let problem = json!({"type": "moving_diffusion", "motion": motion, "diffusivity": 0.05, "end_time": 1, "time_step": 0.02});
        let report = run(&json!({"kind": "surface_pde", "surface": surface, "count": 2000, "problem": problem}));
        let (value, mass) = (error(&report, "value", "relative", None), error(&report, "mass", "relative", None));
        assert!(value < most && mass < 1e-13, "{surface} {motion}: {value:e}, {mass:e}");
    }
    let inward = json!({"type": "moving_diffusion", "motion": {"type": "normal", "speed": -2}, "end_time": 0.6});
    let refusal = meniscus::scene::parse(&json!({"kind": "surface_pde", "problem": inward}), meniscus::scenes::SCENES)
        .err()
        .unwrap();
    assert!(refusal[0].pointer == "/problem/motion/speed" && refusal[0].detail.contains("shrinks"), "{refusal:?}");
    let refused = |motion: Value| {
        let problem = json!({"type": "moving_diffusion", "motion": motion});
        let body = json!({"kind": "surface_pde", "problem": problem});
        let errors = meniscus::scene::parse(&body, meniscus::scenes::SCENES).err().unwrap_or_default();
        errors.first().map(|error| error.pointer.clone()).unwrap_or_default()
    };
    assert_eq!(refused(json!("single_vortex")), "/problem/motion/type");
    assert_eq!(refused(json!({"type": "translation", "velocity": [1, 0]})), "/problem/motion/velocity");
}

#[test]
fn supports_that_see_a_bend_are_counted() {
    let coarse =
        |count: u64| run(&json!({"kind": "surface_pde", "count": count})).diagnostic("supports.coarse").unwrap();
    // |κ| r_c is 2 · 2.4 √(4π/N).
    assert_eq!((coarse(400), coarse(4000)), (400.0, 0.0));
}
