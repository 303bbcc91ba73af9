//! Bodies of `surface_pde`, and how its runs fail.

use super::PLAN;
use super::support::{build, pool, scene};
use meniscus::parallel::Interrupt;
use meniscus::scene::{BuildContext, Clouds};
use meniscus::simulation::CpuClock;
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
    let fields = simulation.fields();
    let second = fields.columns.iter().find(|column| column.name == "second_value").unwrap();
    assert!(format!("{:?}", second.values).contains("0.2"), "nothing is sown");
}
