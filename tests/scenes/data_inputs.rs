//! Scenes with values of a file: fields, diffusivities, sources and held values at points, and flows on grids; held against exact
//! answers and against formulas that say the same.

use super::check_restarts;
use super::support::{PLAN, build_with, column, error, pool, slope};
use meniscus::geometry::fibonacci;
use meniscus::geometry::flows::GridNodes;
use meniscus::scene::{Cloud, Clouds, Column, parse};
use meniscus::scenes::SCENES;
use meniscus::simulation::{Simulation, StepError};
use serde_json::{Value, json};
use std::f64::consts::PI;

/// A column by its name and its value at a place.
type Named = (&'static str, fn(&[f64; 3]) -> f64);

/// Points of the unit sphere with values.
fn sphere(count: usize, columns: &[Named]) -> Cloud {
    let positions: Vec<[f64; 3]> = fibonacci::sphere(count).iter().map(|x| [x[0], x[1], x[2]]).collect();
    let columns = columns.iter().map(|(name, value)| column_of(name, positions.iter().map(value).collect())).collect();
    Cloud { positions, columns, ..Cloud::default() }
}

fn column_of(name: &str, values: Vec<f64>) -> Column {
    Column { name: name.to_owned(), values }
}

fn on_points(problem: &Value) -> Value {
    json!({"kind": "surface_pde", "surface": {"type": "points", "upload": "upl_s"}, "problem": problem})
}

fn finished(body: &Value, clouds: &Clouds) -> Box<dyn Simulation> {
    pool(2).install(|| {
        let mut simulation = build_with(body, PLAN, clouds).unwrap();
        while !simulation.is_finished() {
            simulation.step().unwrap();
        }
        simulation
    })
}

/// What is wrong with a scene and its data: the place and the sentence of each.
fn refused(body: &Value, clouds: &Clouds) -> Vec<(String, String)> {
    let errors = parse(body, SCENES).err().or_else(|| build_with(body, PLAN, clouds).err()).unwrap_or_default();
    errors.into_iter().map(|error| (error.pointer, error.detail)).collect()
}

fn heat(own: &Value, source: &Value, diffusivity: &Value) -> Value {
    on_points(&json!({
        "type": "diffusion", "end_time": 0.1, "time_step": 0.02, "initial": own, "source": source, "diffusivity": diffusivity
    }))
}

#[test]
fn values_of_the_file_and_of_an_upload_are_those_of_formulas() {
    let columns: [Named; 3] = [("u", |x| x[0] * x[1]), ("s", |x| 2.0 * x[2]), ("d", |x| 1.0 + 0.5 * x[2])];
    let surface = sphere(600, &columns);
    let written = heat(&json!({"type": "formula", "value": "x*y"}), &json!("2*z"), &json!("1 + 0.5*z"));
    let written = finished(&written, &Clouds::from([("/surface", surface.clone())]));
    let data = |name: &str| json!({"type": "data", "name": name});
    let of_file = finished(&heat(&data("u"), &data("s"), &data("d")), &Clouds::from([("/surface", surface.clone())]));
    let upload = |name: Option<&str>| json!({"type": "data", "name": name, "upload": "upl_v"});
    let alone = |k: usize| Cloud { columns: vec![surface.columns[k].clone()], ..Cloud::default() };
    let bare = Cloud { columns: Vec::new(), ..surface.clone() };
    let clouds = Clouds::from([
        ("/surface", bare),
        ("/problem/initial", alone(0)),
        ("/problem/source", alone(1)),
        ("/problem/diffusivity", Cloud { columns: surface.columns.clone(), ..Cloud::default() }),
    ]);
    let of_upload = finished(&heat(&upload(None), &upload(Some("s")), &upload(Some("d"))), &clouds);
    for found in [of_file, of_upload] {
        assert_eq!(column(found.as_ref(), "value"), column(written.as_ref(), "value"));
    }
}

#[test]
fn points_that_were_left_out_have_values_too() {
    // Points 1 and 3 of the file have no face; two points coincide.
    let mut surface = sphere(300, &[]);
    surface.positions.push(surface.positions[7]);
    (surface.left_out, surface.kept) = (2, (0..303).filter(|k| ![1, 3].contains(k)).collect());
    let values: Vec<f64> = (0..303).map(f64::from).collect();
    let clouds = Clouds::from([
        ("/surface", surface.clone()),
        ("/problem/field", Cloud { columns: vec![column_of("k", values)], ..Cloud::default() }),
    ]);
    let body = on_points(&json!({"type": "laplace_beltrami", "field": {"type": "data", "upload": "upl_v"}}));
    let simulation = pool(1).install(|| build_with(&body, PLAN, &clouds).unwrap());
    let rows = simulation.particle_count();
    assert_eq!(rows, 300);
    let found = refused(
        &body,
        &Clouds::from([
            ("/surface", surface),
            ("/problem/field", Cloud { columns: vec![column_of("k", vec![0.0; 301])], ..Cloud::default() }),
        ]),
    );
    assert_eq!(found, [("/problem/field".to_owned(), "there are 301 values for 303 points".to_owned())]);
}

#[test]
fn what_is_wrong_with_data_is_told_at_its_place() {
    let clouds = |columns: Vec<Column>| Clouds::from([("/surface", Cloud { columns, ..sphere(300, &[]) })]);
    let body = heat(&json!({"type": "data", "name": "u"}), &json!("0"), &json!({"type": "data"}));
    let two = vec![column_of("a", vec![1.0; 300]), column_of("b", vec![f64::NAN; 300])];
    let told = refused(&body, &clouds(two));
    assert_eq!(
        told.iter().map(|(at, _)| at.as_str()).collect::<Vec<_>>(),
        ["/problem/initial", "/problem/diffusivity"]
    );
    assert!(
        told[0].1.contains("no column \"u\"; it has \"a\", \"b\"") && told[1].1.contains("name one of"),
        "{told:?}"
    );
    let body = heat(&json!({"type": "data", "name": "b"}), &json!("0"), &json!({"type": "data", "name": "a"}));
    let told = refused(&body, &clouds(vec![column_of("a", vec![-1.0; 300]), column_of("b", vec![2.0; 300])]));
    assert!(told[0].0 == "/problem/diffusivity" && told[0].1.contains("negative at point 0"), "{told:?}");
    let mut values = vec![1.0; 300];
    values[12] = f64::INFINITY;
    let told = refused(&body, &clouds(vec![column_of("a", vec![1.0; 300]), column_of("b", values)]));
    assert!(told[0].1.contains("value 12 (counted from 0) is inf"), "{told:?}");
    let told = refused(&heat(&json!({"type": "data", "name": "u"}), &json!("0"), &json!("-1")), &clouds(Vec::new()));
    assert!(told[0].0 == "/problem/diffusivity", "{told:?}");
    let on_sphere =
        json!({"kind": "surface_pde", "problem": {"type": "laplace_beltrami", "field": {"type": "data", "name": "u"}}});
    assert_eq!(refused(&on_sphere, &Clouds::new())[0].0, "/problem/field");
    let embedded = json!({
        "kind": "surface_pde", "method": "closest_point",
        "problem": {"type": "laplace_beltrami", "field": {"type": "formula", "value": "nx"}}
    });
    assert_eq!(refused(&embedded, &Clouds::new())[0].0, "/problem/field");
}

/// u = z with d = 1 + z/2 rests where −∇·(d ∇u) = 2 z d − |∇z|²/2 is made, on the unit sphere.
#[test]
fn varying_diffusivities_keep_the_order_of_their_operator() {
    for (method, expected) in
        [("conservative", 2.0), ("surface_dcpse", 2.0), ("surface_dcpse", 4.0), ("surface_dcpse", 6.0)]
    {
        let errors: Vec<(f64, f64)> = [500, 1000, 2000, 4000]
            .into_iter()
            .map(|count| {
                let method = match method {
                    "conservative" => json!(method),
                    _ => json!({"type": method, "order": expected}),
                };
                let body = json!({"kind": "surface_pde", "count": count, "method": method, "problem": {
                    "type": "diffusion", "integrator": "bdf2", "end_time": 4, "time_step": 0.2,
                    "initial": {"type": "formula", "value": "z"}, "diffusivity": "1 + z/2",
                    "source": "2*z*(1 + z/2) - (1 - z^2)/2"
                }, "solver": {"type": "bicgstab", "tolerance": 1e-13}});
                let simulation = finished(&body, &Clouds::new());
                let found = column(simulation.as_ref(), "value");
                let exact: Vec<f64> = fibonacci::sphere(count).iter().map(|x| x[2]).collect();
                let off: Vec<f64> = found.iter().zip(&exact).map(|(u, z)| u - z).collect();
                let mean = off.iter().sum::<f64>() / off.len() as f64;
                let rms = (off.iter().map(|off| (off - mean).powi(2)).sum::<f64>() / off.len() as f64).sqrt();
                ((1.0 / f64::from(count as u32)).sqrt(), rms)
            })
            .collect();
        let order = slope(&errors);
        assert!((order - expected).abs() < 0.45, "{method} {expected}: {order} {errors:?}");
        assert!(errors[3].1 < 4e-3, "{method} {expected}: {errors:?}");
    }
}

#[test]
fn a_uniform_diffusivity_slows_the_decay() {
    for (diffusivity, integrator) in [(json!(0.25), "dopri5"), (json!(0.25), "bdf2"), (json!("1/4"), "dopri5")] {
        let body = json!({"kind": "surface_pde", "count": 2000, "problem": {
            "type": "diffusion", "diffusivity": diffusivity, "end_time": 0.2, "time_step": 0.01, "integrator": integrator,
            "initial": {"type": "spherical_harmonic", "l": 2}
        }});
        let simulation = finished(&body, &Clouds::new());
        let found = column(simulation.as_ref(), "value");
        let start = column(
            finished(
                &json!({"kind": "surface_pde", "count": 2000,
            "problem": {"type": "laplace_beltrami", "field": {"type": "spherical_harmonic", "l": 2}}}),
                &Clouds::new(),
            )
            .as_ref(),
            "reference",
        );
        let ratio =
            found.iter().map(|u| u * u).sum::<f64>().sqrt() / start.iter().map(|u| u * u / 36.0).sum::<f64>().sqrt();
        assert!((ratio - (-6.0 * 0.25 * 0.2_f64).exp()).abs() < 2e-3, "{diffusivity} {integrator}: {ratio}");
        if diffusivity == json!(0.25) {
            assert!(error(&simulation.report(), "value", "max", None) < 5e-3);
        }
    }
}

/// Δu = −2x with u = x at the edge of a hemisphere has the solution x.
#[test]
fn edges_hold_formulas_and_data() {
    let errors: Vec<(f64, f64)> = [8, 12, 18, 26]
        .into_iter()
        .map(|rings: u32| {
            let step = 0.5 * PI / f64::from(rings);
            let ring = |k: u32| {
                let polar = f64::from(k) * step;
                let count = (2.0 * PI * polar.sin() / step).round().max(1.0) as u32;
                (0..count).map(move |m| {
                    let angle = 2.0 * PI * (f64::from(m) + 0.5 * f64::from(k % 2)) / f64::from(count);
                    [polar.sin() * angle.cos(), polar.sin() * angle.sin(), if k == rings { 0.0 } else { polar.cos() }]
                })
            };
            let positions: Vec<[f64; 3]> = (0..=rings).flat_map(ring).collect();
            let x: Vec<f64> = positions.iter().map(|x| x[0]).collect();
            let columns = vec![column_of("x", x.clone())];
            let clouds = Clouds::from([("/surface", Cloud { positions, columns, ..Cloud::default() })]);
            let solve = |value: Value| {
                let mut body = on_points(&json!({"type": "poisson", "source": {"type": "formula", "value": "-2*x"}}));
                body["edges"] = json!({"type": "dirichlet", "value": value});
                column(finished(&body, &clouds).as_ref(), "value")
            };
            let (written, data) = (solve(json!("x")), solve(json!({"type": "data", "name": "x"})));
            assert_eq!(written, data);
            let off = written.iter().zip(&x).map(|(u, x)| (u - x).powi(2)).sum::<f64>() / x.len() as f64;
            (step, off.sqrt())
        })
        .collect();
    assert!(slope(&errors) > 1.8 && errors[3].1 < 1e-4, "{errors:?}");
}

#[test]
fn substances_begin_and_spread_by_data() {
    let surface = sphere(300, &[("u", |x| 1.0 + 0.2 * x[0]), ("d", |x| 0.02 + 0.01 * x[2])]);
    let clouds = Clouds::from([("/surface", surface)]);
    let problem = |initial: Value, diffusivity: Value| {
        on_points(
            &json!({"type": "reaction_diffusion", "end_time": 0.5, "time_step": 0.1, "tolerance": 1e-7, "noise": 0, "model": {
                "type": "formula", "species": ["u", "v"], "rates": ["v - u*u", "u - v"],
                "diffusivities": [diffusivity, 0.01], "initial": [initial, 1]
            }}),
        )
    };
    let data = |name: &str| json!({"type": "data", "name": name});
    let (of_data, written) = (problem(data("u"), data("d")), problem(json!("1 + 0.2*x"), json!("0.02 + 0.01*z")));
    let [of_data, written] = [of_data, written].map(|body| finished(&body, &clouds));
    for name in ["value", "second_value"] {
        assert_eq!(column(of_data.as_ref(), name), column(written.as_ref(), name));
    }
    let total = |u: &[f64]| u.iter().sum::<f64>();
    assert!(total(&column(written.as_ref(), "value")).is_finite());
}

/// The single vortex at nodes over a square that holds all particles.
fn sampled_vortex(count: usize, times: usize) -> Cloud {
    let (low, length) = (-0.25, 1.5);
    let nodes = GridNodes {
        counts: [count, count, 1],
        origin: [low, low, 0.0],
        spacing: [length / (count - 1) as f64; 3],
        times: (0..times).map(|k| k as f64 / (times - 1).max(1) as f64).collect(),
    };
    let mut columns = vec![column_of("velocity_x", Vec::new()), column_of("velocity_y", Vec::new())];
    for time in &nodes.times {
        for k in 0..count * count {
            let [x, y] = [k % count, k / count].map(|i| PI * (low + i as f64 * nodes.spacing[0]));
            let turn = (PI * time).cos();
            columns[0].values.push(-turn * x.sin().powi(2) * (2.0 * y).sin());
            columns[1].values.push(turn * y.sin().powi(2) * (2.0 * x).sin());
        }
    }
    Cloud { columns, grid: Some(nodes), ..Cloud::default() }
}

fn vortex(flow: &Value) -> Value {
    json!({"kind": "vortex", "spacing": 0.03125, "band_h": 8, "end_time": 0.5, "steps": 10, "flow": flow})
}

#[test]
fn a_flow_of_data_comes_near_to_the_flow_that_it_samples() {
    let exact = finished(&vortex(&json!({"type": "single_vortex", "period": 1})), &Clouds::new());
    let grid = json!({"type": "grid", "upload": "upl_f"});
    let moved = |count: usize| {
        let clouds = Clouds::from([("/flow", sampled_vortex(count, 257))]);
        let simulation = finished(&vortex(&grid), &clouds);
        let errors = simulation.report();
        assert!(errors.diagnostics.iter().any(|d| d.name == "flow.divergence_max" && d.value > 0.0));
        // Held against its own exact motion it is as good as the built-in flow.
        assert!(error(&errors, "phi", "rms", Some(0.5)) < 2.0 * error(&exact.report(), "phi", "rms", Some(0.5)) + 1e-9);
        positions(simulation.as_ref())
    };
    let reference = positions(exact.as_ref());
    let off = |found: &[[f64; 3]]| {
        let distance = |(a, b): (&[f64; 3], &[f64; 3])| (a[0] - b[0]).hypot(a[1] - b[1]);
        found.iter().zip(&reference).map(distance).fold(0.0, f64::max)
    };
    let (coarse, fine, finest) = (off(&moved(13)), off(&moved(25)), off(&moved(49)));
    assert!(coarse / fine > 9.0 && finest < 1e-5, "{coarse} {fine} {finest}");
}

fn positions(simulation: &dyn Simulation) -> Vec<[f64; 3]> {
    simulation.fields(meniscus::simulation::Selection::All).points.clone()
}

#[test]
fn what_a_flow_of_data_lacks_is_told() {
    let grid = json!({"type": "grid", "upload": "upl_f"});
    let clouds = |cloud: Cloud| Clouds::from([("/flow", cloud)]);
    let mut small = sampled_vortex(17, 1);
    small.grid.as_mut().unwrap().origin = [0.5, 0.5, 0.0];
    let told = refused(&vortex(&grid), &clouds(small));
    assert!(told[0].0 == "/flow" && told[0].1.contains("leaves the grid of velocities"), "{told:?}");
    let mut short = sampled_vortex(17, 2);
    short.grid.as_mut().unwrap().times = vec![0.0, 0.25];
    let told = refused(&vortex(&grid), &clouds(short));
    assert!(told[0].1.contains("known from time 0 to 0.25, the run goes from 0 to 0.5"), "{told:?}");
    let told = refused(&vortex(&json!({"type": "grid"})), &Clouds::new());
    assert!(told[0].0 == "/flow" && told[0].1.contains("a flow comes from an upload"), "{told:?}");
    let front = json!({"kind": "front", "spacing": 0.03, "end_time": 0.1, "law": {"type": "flow", "flow": grid},
        "shape": {"type": "circle", "center": [0.5, 0.75], "radius": 0.15}});
    assert_eq!(refused(&front, &Clouds::new())[0].0, "/time_step");
    // A period after which points are elsewhere is told once the data are read.
    let told =
        refused(&vortex(&json!({"type": "grid", "upload": "upl_f", "period": 0.5})), &clouds(sampled_vortex(33, 1)));
    assert!(told[0].0 == "/flow/period", "{told:?}");
}

/// Scenes of each kind that takes data go on from any step bit for bit, and do not depend on threads.
#[test]
fn runs_with_data_go_on_bit_for_bit() {
    let flow = json!({"type": "grid", "upload": "upl_f"});
    let circle = json!({"type": "circle", "center": [0.5, 0.75], "radius": 0.15});
    let surface = sphere(300, &[("u", |x| 1.0 + x[0]), ("d", |x| 1.0 + 0.5 * x[2])]);
    let data = |name: &str| json!({"type": "data", "name": name});
    let sampled = sampled_vortex(33, 3);
    let moving = {
        let nodes = GridNodes { counts: [3; 3], origin: [-2.0; 3], spacing: [2.0; 3], times: vec![0.0] };
        let column = |d: usize| column_of("v", (0..27).map(|k| 0.1 * (k / 3_usize.pow(d as u32) % 3) as f64).collect());
        Cloud { columns: (0..3).map(column).collect(), grid: Some(nodes), ..Cloud::default() }
    };
    let cases = [
        (vortex(&json!({"type": "grid", "upload": "upl_f"})), Clouds::from([("/flow", sampled.clone())])),
        (
            json!({"kind": "front", "spacing": 0.04, "end_time": 0.2, "time_step": 0.04, "shape": circle,
                "law": {"type": "flow", "flow": flow}}),
            Clouds::from([("/law/flow", sampled_vortex(33, 1))]),
        ),
        (heat(&data("u"), &data("u"), &data("d")), Clouds::from([("/surface", surface.clone())])),
        (
            on_points(
                &json!({"type": "moving_diffusion", "motion": {"type": "grid", "upload": "upl_f"}, "end_time": 0.1,
                "time_step": 0.02, "initial": data("u")}),
            ),
            Clouds::from([("/surface", surface), ("/problem/motion", moving)]),
        ),
    ];
    for (body, clouds) in cases {
        check_restarts(&body, &clouds);
    }
}

/// A wind of 1 along x about the unit square; in space about the unit sphere.
fn wind(dimension: usize) -> Cloud {
    let (low, last) = if dimension == 2 { (-0.25, 3) } else { (-1.5, 6) };
    let mut counts = [last + 1; 3];
    counts[dimension..].fill(1);
    let nodes = GridNodes { counts, origin: [low; 3], spacing: [0.5; 3], times: vec![0.0] };
    let count = nodes.len();
    let component = |d: usize| column_of("velocity", vec![if d == 0 { 1.0 } else { 0.0 }; count]);
    Cloud { columns: (0..dimension).map(component).collect(), grid: Some(nodes), ..Cloud::default() }
}

#[test]
fn particles_that_leave_the_grid_end_the_run_and_are_named() {
    let flow = json!({"type": "grid", "upload": "upl_f"});
    let mut vortex = vortex(&flow);
    (vortex["end_time"], vortex["steps"]) = (json!(2), json!(40));
    let front = json!({"kind": "front", "spacing": 0.04, "end_time": 2, "time_step": 0.04,
        "shape": {"type": "circle", "center": [0.5, 0.75], "radius": 0.15}, "law": {"type": "flow", "flow": flow}});
    let surface = on_points(&json!({"type": "moving_diffusion", "motion": flow, "end_time": 2, "time_step": 0.04,
        "initial": {"type": "formula", "value": "x"}}));
    let cases = [
        (vortex, Clouds::from([("/flow", wind(2))])),
        (front, Clouds::from([("/law/flow", wind(2))])),
        (surface, Clouds::from([("/surface", sphere(300, &[])), ("/problem/motion", wind(3))])),
    ];
    for (body, clouds) in cases {
        let error = pool(2).install(|| {
            let mut simulation = build_with(&body, PLAN, &clouds).unwrap();
            (0..50).find_map(|_| simulation.step().err())
        });
        let Some(StepError::Undefined { reason, step, .. }) = &error else { panic!("{body}: {error:?}") };
        assert!(reason.contains("leaves the grid of velocities") && *step > 3, "{body}: {error:?}");
    }
}
