//! The papers' cases and the hard ones, against figures with their reasons.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod case_files;
mod bad_runs;
mod droplets;
mod droplets_in_balance;
mod droplets_in_frames;
mod fronts;
mod linear_theory;
mod reading;
mod redistancing;
mod ring;
mod hard_cases;
mod surfaces;
mod varying_tension;
#[path = "../support/mod.rs"]
mod support;

use serde_json::{Value, json};
use support::{PLAN, build, error, pool, run, scene};

#[test]
fn spiraling_vortex_of_the_paper() {
    // PCP table 2 at h = 1/64: RMS 1.42e-2, maximum 2.4e-2. A quarter is what the choice of random and rounding
    // details leaves open in a flow this unstable to them.
    let report = run(&json!({"kind": "vortex", "preset": "paper", "spacing": 0.015625}));
    let (rms, max) = (error(&report, "phi", "rms", Some(8.0)), error(&report, "phi", "max", Some(8.0)));
    assert!((rms / 1.42e-2 - 1.0).abs() < 0.25, "RMS {rms}");
    assert!((max / 2.4e-2 - 1.0).abs() < 0.25, "maximum {max}");
}

#[test]
fn a_dual_field_leaves_only_the_integrators_error() {
    let report = run(&json!({"kind": "vortex", "spacing": 0.015625}));
    assert!(error(&report, "phi", "rms", Some(8.0)) < 3e-6);
    assert!(error(&report, "area", "relative", Some(8.0)) < 2e-5);
    // Half way the filament is thinner than any neighbourhood in space; the paper's method has 6e-2 here, fits in
    // initial positions 1.4e-3.
    assert!(error(&report, "phi", "rms", Some(4.0)) < 2e-3);
}

#[test]
fn material_fits_know_a_filament_thinner_than_two_spacings() {
    // At T/2 of a fine enough run the exact front is met to a thousandth of a spacing.
    let report = run(&json!({"kind": "vortex", "spacing": 0.0078125, "end_time": 4.0, "steps": 120}));
    let (rms, max) = (error(&report, "phi", "rms", Some(4.0)), error(&report, "phi", "max", Some(4.0)));
    assert!(rms < 1e-4 && max < 5e-4, "RMS {rms}, maximum {max}");
}

#[test]
fn a_sphere_in_the_deforming_flow_comes_back() {
    let report = run(&json!({
        "kind": "vortex", "spacing": 0.03125, "end_time": 1, "steps": 20, "band_h": 10, "flow": {"type": "vortex_3d", "period": 1},
        "shape": {"type": "sphere", "center": [0.35, 0.35, 0.35], "radius": 0.15}
    }));
    // Fourth-order paths of 20 steps, and fits of a sphere of 4.8 h to about (h/R)⁵/10 h.
    assert!(error(&report, "phi", "rms", Some(1.0)) < 5e-5);
    assert!(error(&report, "volume", "relative", Some(1.0)) < 1.2e-4);
}

#[test]
fn remeshing_first_costs_the_order() {
    // PCP fig. 3: first order at best, where the particles' own fits have the fifth.
    let at = |kernel: &str, spacing: f64| {
        let method = json!({"type": "remesh", "kernel": kernel});
        let report = run(&json!({"kind": "redistance", "spacing": spacing, "band": 0.125, "method": method}));
        error(&report, "phi", "max", None)
    };
    for kernel in ["lambda44", "lambda44_normalized", "wendland_c2", "gaussian"] {
        let order = (at(kernel, 1.0 / 32.0) / at(kernel, 1.0 / 128.0)).log2() / 2.0;
        assert!((0.6..1.7).contains(&order), "{kernel}: order {order}");
    }
}

#[test]
fn frames_are_looked_at_and_change_nothing() {
    // Whatever is redistanced when: the errors at the end are those of a run without frames, to the last bit.
    let every = json!({"type": "every", "steps": 4});
    let nearest = json!({"type": "pcp", "degree": 3, "neighborhood": {"type": "nearest", "count": 30}});
    for extra in [
        json!({}),
        json!({"method": nearest.clone()}),
        json!({"method": nearest.clone(), "redistance": every.clone()}),
        json!({"method": nearest, "redistance": every, "field": "overwrite"}),
    ] {
        let mut body = json!({
            "kind": "vortex", "spacing": 0.03125, "steps": 45, "end_time": 2,
            "flow": {"type": "single_vortex", "period": 2}
        });
        body.as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
        let errors = |every_time: Option<f64>| {
            pool(2).install(|| {
                let plan = meniscus::simulation::OutputPlan { every_time, ..PLAN };
                let mut simulation = build(&body, plan);
                while !simulation.is_finished() {
                    simulation.step().unwrap();
                }
                simulation.report().errors
            })
        };
        assert_eq!(errors(None), errors(Some(0.1)), "{body}");
    }
}

#[test]
fn a_thin_band_has_the_particles_that_fits_need() {
    let report = run(&json!({"kind": "vortex", "spacing": 0.03125, "band_h": 2, "end_time": 1, "steps": 30}));
    assert!(error(&report, "phi", "max", None) < 0.2 * 0.03125);
}

#[test]
fn what_does_not_go_together_is_refused() {
    let refused = |body: Value, pointer: &str| {
        let found = meniscus::scene::parse(&body, meniscus::scenes::SCENES).err().unwrap();
        assert!(found.iter().any(|v| v.pointer == pointer), "{body}: {found:?}");
    };
    let material = json!({"type": "pcp", "neighborhood": "material"});
    let vortex = |extra: Value| {
        let mut body = json!({"kind": "vortex"});
        body.as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
        body
    };
    refused(vortex(json!({"field": "overwrite", "redistance": "for_output"})), "/redistance/type");
    refused(vortex(json!({"field": "overwrite", "method": material.clone()})), "/method/neighborhood/type");
    refused(json!({"kind": "redistance", "method": material}), "/method/neighborhood/type");
    refused(vortex(json!({"flow": "vortex_3d"})), "/flow/type");
    refused(vortex(json!({"method": {"type": "pcp", "tolerance": 1}})), "/method/tolerance");
    let asked = json!({"type": "points", "file": "x"});
    refused(json!({"kind": "redistance", "repeat": 2, "queries": asked.clone()}), "/repeat");
    refused(json!({"kind": "redistance", "method": "remesh", "queries": asked}), "/method");
}

#[test]
fn the_report_says_what_auto_chose_also_when_a_run_starts_from_the_resolved_scene() {
    for field in ["dual", "overwrite"] {
        let body = json!({"kind": "vortex", "spacing": 0.05, "end_time": 0.5, "steps": 2, "field": field});
        let report = run(&scene(&body).resolved());
        assert_eq!(report.method, run(&body).method);
        assert!(report.method["method"].starts_with("pcp, degree"), "{:?}", report.method);
        assert!(report.method.contains_key("redistance"));
    }
}

#[test]
fn overwriting_by_count_beats_the_papers_method() {
    let report = run(&json!({"kind": "vortex", "field": "overwrite", "spacing": 0.015625}));
    assert!(error(&report, "phi", "rms", Some(8.0)) < 3.5e-3);
}

#[test]
fn rigid_motions_keep_the_shape() {
    // A whole turn in 240 steps: the fourth-order paths are exact to 1e-8; fits of a circle of 7.5 h to about
    // (h/R)⁵/10 h.
    let turn = json!({
        "kind": "vortex", "spacing": 0.02, "band_h": 12, "end_time": std::f64::consts::TAU, "steps": 240,
        "flow": {"type": "rotation", "center": [0.5, 0.5], "angular_velocity": 1}
    });
    let report = run(&turn);
    assert!(error(&report, "phi", "rms", None) < 5e-6);
    assert!(error(&report, "area", "relative", None) < 2e-5);
    let glide = json!({
        "kind": "vortex", "spacing": 0.1, "band_h": 8, "end_time": 1, "steps": 10,
        "shape": {"type": "sphere", "radius": 0.5}, "flow": {"type": "translation", "velocity": [0.3, -1, 2]}
    });
    let report = run(&glide);
    assert!(error(&report, "phi", "rms", None) < 1e-4);
    assert!(error(&report, "volume", "relative", None) < 1e-2);
}

#[test]
fn many_turns_are_measured_against_the_exact_place() {
    // Three hundred turns of a hundred steps: what the error shows must be the integrator's phase, about
    // 2π (2π/100)⁴/120 a turn, and no reference that has lost count.
    let body = json!({
        "kind": "vortex", "spacing": 0.1, "band_h": 4, "end_time": 300, "steps": 30000,
        "flow": {"type": "rotation", "center": [0.5, 0.5], "angular_velocity": std::f64::consts::TAU}
    });
    let rms = error(&run(&body), "phi", "rms", None);
    assert!(rms < 0.02, "{rms}");
}

/// Fallbacks of closest-point queries.
const QUERY_FALLBACKS: &[&str] = &["queries.other_sample", "queries.sample_distance"];
/// Fallbacks of fits.
const FIT_FALLBACKS: &[&str] =
    &["fits.larger_radius", "fits.lower_degree", "fits.orthogonal", "fits.none", "samples.not_projected"];

/// How often a report counts any of these.
fn count(report: &meniscus::simulation::Report, names: &[&str]) -> f64 {
    names.iter().map(|name| report.diagnostic(name).unwrap()).sum()
}

#[test]
fn errors_half_way_do_not_depend_on_when_the_method_redistances() {
    let flow = json!({"type": "single_vortex", "period": 2});
    let body = json!({
        "kind": "vortex", "spacing": 0.03125, "steps": 40, "end_time": 2, "flow": flow, "field": "overwrite",
        "redistance": {"type": "every", "steps": 7}
    });
    assert!(error(&run(&body), "phi", "rms", Some(1.0)) < 0.02);
}

#[test]
fn far_from_the_origin_and_with_a_tiny_cutoff_nothing_is_lost() {
    let far = json!({"kind": "redistance", "shape": {"type": "circle", "center": [1e6, 0], "radius": 0.5}});
    let report = run(&far);
    // Coordinates have ten digits after the point left there.
    assert!(error(&report, "phi", "max", None) < 1e-7 && report.diagnostic("newton.iterations_mean").unwrap() < 10.0);
    assert!(count(&report, QUERY_FALLBACKS) == 0.0);
    let tiny = json!({"kind": "redistance", "method": {"type": "pcp", "cutoff_h": 0.05}});
    let report = run(&tiny);
    assert!(error(&report, "phi", "max", None) < 1e-7);
    assert!(report.diagnostic("fits.lower_degree") == Some(0.0));
}

#[test]
fn zalesak_disk_turns_once() {
    let body = json!({
        "kind": "vortex", "spacing": 0.01, "band_h": 12, "end_time": std::f64::consts::TAU, "steps": 200,
        "shape": {"type": "zalesak_disk", "center": [0.5, 0.75], "radius": 0.15, "slot_width": 0.05, "slot_depth": 0.25},
        "flow": {"type": "rotation", "center": [0.5, 0.5], "angular_velocity": 1}
    });
    // The slot is five particles wide: corners cost half a spacing at most.
    let report = run(&body);
    assert!(error(&report, "phi", "max", None) < 0.006);
    assert!(error(&report, "area", "relative", None) < 5e-3);
}

#[test]
fn bases_agree_and_distortion_costs_little() {
    // A backward-stable solver makes minter and scaled monomials equal; numerics.md measured four digits.
    let at = |basis: &str, jitter: f64| {
        let body = json!({"kind": "redistance", "jitter": jitter, "method": {"type": "pcp", "basis": basis}});
        error(&run(&body), "phi", "rms", None)
    };
    let (calm, wild) = (at("minter", 0.0), at("minter", 0.49));
    assert!(wild / calm < 4.0, "{wild} for {calm}");
    for basis in ["monomial", "monomial_unscaled"] {
        assert!((at(basis, 0.49) / wild - 1.0).abs() < 1e-2, "{basis}");
    }
}

#[test]
fn starved_neighbourhoods_grow_and_say_so() {
    let body = json!({
        "kind": "redistance", "dimension": 3, "spacing": 0.03125, "jitter": 0.49,
        "method": {"type": "pcp", "cutoff_h": 2.1}
    });
    let report = run(&body);
    // 1e-7 at 1/64 in scenes.md is 32 times as much at 1/32 by the fifth order.
    assert!(error(&report, "phi", "rms", None) < 3.2e-6);
    assert!(report.diagnostic("fits.larger_radius").unwrap() > 1000.0);
}

#[test]
fn repeated_redistancing_at_rest_stays_bounded() {
    let report = run(&json!({"kind": "redistance", "repeat": 200}));
    assert!(error(&report, "phi", "max", None) < 1e-4, "{}", error(&report, "phi", "max", None));
}

/// Nothing here may panic, hang, or fail without a count.
#[test]
fn hard_geometries() {
    let hard: Vec<(&str, Value)> = vec![
        (
            "two circles closer than 3 h",
            json!({"shape": {"type": "union", "of": [
            {"type": "circle", "center": [-0.32, 0], "radius": 0.3}, {"type": "circle", "center": [0.32, 0], "radius": 0.3}]}}),
        ),
        ("a filament thinner than 2 h", json!({"shape": {"type": "box", "size": [1, 0.03]}})),
        ("square corners", json!({"shape": {"type": "box", "size": [1, 1]}})),
        (
            "a circle of two particles' width",
            json!({"shape": {"type": "circle", "radius": 0.03}, "initial": "distance"}),
        ),
        ("the highest degree", json!({"method": {"type": "pcp", "degree": 8}})),
        ("the lowest degree", json!({"method": {"type": "pcp", "degree": 1}})),
    ];
    for (name, extra) in hard {
        let mut body = json!({"kind": "redistance", "spacing": 0.02});
        body.as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
        let report = run(&body);
        let max = error(&report, "phi", "max", None);
        // No query worse than half a spacing, or a count in the report says why.
        let excused = count(&report, QUERY_FALLBACKS) + count(&report, FIT_FALLBACKS) > 0.0;
        assert!(max <= 0.01 || excused && max <= 0.05, "{name}: {max} {:?}", report.diagnostics);
    }
}

#[test]
fn a_surface_between_the_particles_is_reported_as_lost() {
    pool(1).install(|| {
        let body = json!({"kind": "redistance", "shape": {"type": "circle", "radius": 0.001, "center": [0.005, 0.005]}, "spacing": 0.02, "jitter": 0, "initial": "distance"});
        let mut simulation = build(&body, PLAN);
        let message = simulation.step().unwrap_err().to_string();
        assert!(message.contains("no sample particle"), "{message}");
    });
}
