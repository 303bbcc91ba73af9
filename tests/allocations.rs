//! A step allocates nothing once its storage has grown to what it needs.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(unsafe_code, reason = "a global allocator that counts cannot be written without")]

#[path = "support/mod.rs"]
#[expect(dead_code, reason = "each test target uses a part")]
mod support;

use meniscus::parallel::Interrupt;
use meniscus::scene::BuildContext;
use meniscus::scene::cloud::{Cloud, Clouds};
use meniscus::simulation::{CpuClock, FieldValues, Selection};
use serde_json::json;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use support::{build, pool};

struct Counting;

thread_local! {
    /// Per thread: the test harness allocates on threads of its own.
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: every call is passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // A thread that is ending has no counter any more.
        let _ = ALLOCATIONS.try_with(|count| count.set(count.get() + 1));
        // SAFETY: as the caller promised.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as the caller promised.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn steps_allocate_nothing_after_warm_up() {
    let bodies = [
        json!({"kind": "redistance", "spacing": 0.03125, "repeat": 12}),
        json!({"kind": "redistance", "dimension": 3, "spacing": 0.125, "repeat": 12}),
        json!({"kind": "redistance", "spacing": 0.03125, "repeat": 12, "method": "remesh"}),
        json!({"kind": "vortex", "spacing": 0.03125, "steps": 12, "end_time": 0.5}),
        json!({
            "kind": "vortex", "spacing": 0.03125, "steps": 12, "end_time": 0.1,
            "redistance": {"type": "every", "steps": 1}, "flow": {"type": "translation", "velocity": [1, 1]}
        }),
        json!({
            "kind": "vortex", "spacing": 0.03125, "steps": 12, "end_time": 0.1, "field": "overwrite",
            "flow": {"type": "translation", "velocity": [1, 1]}
        }),
        json!({"kind": "droplet", "spacing": 0.1, "end_time": 0.02}),
        json!({"kind": "droplet", "spacing": 0.1, "end_time": 0.02, "geometry": "colorfield", "integrator": "predictor_corrector"}),
        json!({"kind": "droplet", "case": "dividing", "spacing": 0.05, "end_time": 0.002}),
        json!({"kind": "droplet", "spacing": 0.1, "end_time": 0.02, "discretization": "dcpse"}),
        json!({"kind": "surface_pde", "count": 500, "repeat": 12}),
        json!({"kind": "surface_pde", "count": 500, "repeat": 12, "method": "closest_point"}),
        json!({"kind": "surface_pde", "count": 500, "problem": {"type": "diffusion", "end_time": 0.012, "time_step": 1e-3}}),
        json!({
            "kind": "surface_pde", "count": 500,
            "problem": {"type": "diffusion", "end_time": 0.012, "time_step": 1e-3, "integrator": "bdf2"}
        }),
        json!({"kind": "surface_pde", "count": 500, "problem": {"type": "reaction_diffusion", "end_time": 0.12, "time_step": 0.01}}),
        // A front that grows would outgrow its storage.
        json!({"kind": "front", "spacing": 0.02, "end_time": 0.12, "time_step": 0.01, "law": {"type": "normal", "speed": -1}}),
        json!({
            "kind": "front", "spacing": 0.02, "end_time": 0.0024, "time_step": 2e-4, "law": "mean_curvature",
            "shape": {"type": "sphere", "center": [0.5, 0.5, 0.5], "radius": 0.25}
        }),
        // In a flow particles at corners and ends stay, and gaps ask for more.
        json!({
            "kind": "front", "spacing": 0.005, "end_time": 0.24, "time_step": 0.02,
            "law": {"type": "flow", "flow": {"type": "rotation", "center": [0.5, 0.5], "angular_velocity": 2}},
            "shape": {"type": "box", "center": [0.5, 0.6], "size": [0.3, 0.3]}
        }),
        json!({
            "kind": "front", "spacing": 0.03, "end_time": 0.24, "time_step": 0.02,
            "law": {"type": "flow", "flow": {"type": "translation", "velocity": [1, 0.5, 0.25]}},
            "shape": {"type": "sphere", "center": [0.5, 0.5, 0.5], "radius": 0.25}
        }),
        // On a refined grid.
        json!({
            "kind": "front", "spacing": 0.03, "end_time": 0.24, "time_step": 0.02, "adaptivity": {"levels": 3},
            "law": {"type": "flow", "flow": {"type": "rotation", "center": [0.5, 0.5], "angular_velocity": 2}},
            "shape": {"type": "ellipse", "center": [0.5, 0.5], "semi_axes": [0.3, 0.15]}
        }),
        json!({
            "kind": "front", "spacing": 0.015625, "end_time": 0.0012, "time_step": 1e-4, "law": "mean_curvature",
            "shape": {"type": "ellipse", "center": [0.5, 0.5], "semi_axes": [0.3, 0.1]}
        }),
    ];
    let plan = meniscus::simulation::OutputPlan { every_time: None, series_every_steps: 1000 };
    for body in bodies {
        // One thread, which does all the work: another one's scratch may first be used late.
        pool(1).install(|| {
            let mut simulation = build(&body, plan);
            for _ in 0..6 {
                simulation.advance().unwrap();
            }
            if body.get("adaptivity").is_some() {
                let fields = simulation.fields(Selection::All);
                let level = fields.columns.iter().find(|column| column.name == "level").unwrap();
                let FieldValues::Scalar(levels) = &level.values else { panic!("numbers") };
                assert!(levels.iter().any(|level| *level != levels[0]), "nothing is refined");
            }
            for step in 7..12 {
                let before = ALLOCATIONS.get();
                simulation.advance().unwrap();
                let made = ALLOCATIONS.get() - before;
                assert_eq!(made, 0, "step {step} of {body}");
            }
        });
    }
}

#[test]
fn steps_on_stretched_points_allocate_nothing_after_warm_up() {
    let mut cloud = Cloud { level: Some(Vec::new()), ..Cloud::default() };
    for k in 0..41 * 161 {
        let (x, y) = (f64::from(k % 41) * 0.05 - 1.0, f64::from(k / 41) * 0.0125 - 1.0);
        cloud.positions.push([x, y, 0.0]);
        cloud.level.as_mut().unwrap().push(x.hypot(y) - 0.6);
    }
    let body = json!({"kind": "redistance", "spacing": 0.05, "repeat": 12, "shape": {"type": "points", "file": "x"}});
    pool(1).install(|| {
        let context = BuildContext {
            plan: support::PLAN,
            interrupt: Interrupt::default(),
            cpu_clock: CpuClock::still(),
            clouds: Clouds::from([("/shape", cloud)]),
        };
        let mut simulation = support::scene(&body).build(context).unwrap();
        for _ in 0..6 {
            simulation.step().unwrap();
        }
        for step in 7..12 {
            let before = ALLOCATIONS.get();
            simulation.step().unwrap();
            assert_eq!(ALLOCATIONS.get() - before, 0, "step {step}");
        }
    });
}
