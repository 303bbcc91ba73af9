//! Redistancing of points from outside: stretched clouds, particles on the surface, and checks that end bad runs.

use crate::support::{PLAN, column, pool, scene, slope};
use meniscus::geometry::random::CounterRandom;
use meniscus::parallel::Interrupt;
use meniscus::scene::BuildContext;
use meniscus::scene::cloud::{Cloud, Clouds};
use meniscus::simulation::{CpuClock, Simulation, StepError};
use serde_json::{Value, json};

/// Points of the plane or of space with a level.
struct Points {
    dimension: usize,
    positions: Vec<[f64; 3]>,
    level: Vec<f64>,
}

/// A simulation of points, or what keeps it from being built.
fn build(points: &Points, spacing: f64, repeat: u64) -> Result<Box<dyn Simulation>, String> {
    let cloud = Cloud { positions: points.positions.clone(), level: Some(points.level.clone()), ..Cloud::default() };
    let shape = json!({"type": "points", "file": "points.vtkhdf"});
    let body = json!({
        "kind": "redistance", "dimension": points.dimension, "spacing": spacing, "shape": shape, "repeat": repeat
    });
    let context = BuildContext {
        plan: PLAN,
        interrupt: Interrupt::default(),
        cpu_clock: CpuClock::still(),
        clouds: Clouds::from([("/shape", cloud)]),
    };
    scene(&body).build(context).map_err(|found| found[0].detail.clone())
}

/// Runs to the end; the findings and the signed distances, or why the run ended.
fn run(points: &Points, spacing: f64, repeat: u64) -> Result<(Vec<String>, Vec<f64>), StepError> {
    pool(2).install(|| {
        let mut simulation = build(points, spacing, repeat).unwrap();
        let mut findings = Vec::new();
        while !simulation.is_finished() {
            simulation.step()?;
            findings.extend(simulation.take_findings().into_iter().map(|finding| finding.code.into_owned()));
        }
        assert!(simulation.health().checks.iter().all(|check| check.holds == Some(true)));
        Ok((findings, column(simulation.as_ref(), "phi")))
    })
}

/// Root mean square and largest error, over the points that count.
fn errors(
    points: &Points,
    phi: &[f64],
    exact: impl Fn(&[f64; 3]) -> f64,
    counts: impl Fn(&[f64; 3]) -> bool,
) -> (f64, f64) {
    let of = points.positions.iter().zip(phi).filter(|(x, _)| counts(x)).map(|(x, phi)| (phi - exact(x)).abs());
    let (sum, max, n) = of.fold((0.0, 0.0_f64, 0), |(sum, max, n), e| (sum + e * e, max.max(e), n + 1));
    ((sum / f64::from(n)).sqrt(), max)
}

fn norm(x: &[f64; 3]) -> f64 {
    x.iter().map(|c| c * c).sum::<f64>().sqrt()
}

/// A circle or sphere of radius 0.6 in a lattice with the given spacings, turned, and moved by up to `jitter` spacings.
/// The level is no distance.
fn ball_in_lattice(spacings: &[f64], angle: f64, jitter: f64) -> Points {
    let random = CounterRandom::new(11);
    let dimension = spacings.len();
    let counts: Vec<i64> = spacings.iter().map(|s| (1.5 / s).ceil() as i64).collect();
    let total: i64 = counts.iter().map(|n| 2 * n + 1).product();
    let mut positions = Vec::new();
    for k in 0..total {
        let mut rest = k;
        let mut x = [0.0; 3];
        for d in 0..dimension {
            let index = rest % (2 * counts[d] + 1) - counts[d];
            rest /= 2 * counts[d] + 1;
            x[d] = spacings[d] * (index as f64 + jitter * random.symmetric(&[k, d as i64]));
        }
        let (sin, cos) = angle.sin_cos();
        (x[0], x[1]) = (cos * x[0] - sin * x[1], sin * x[0] + cos * x[1]);
        if x.iter().all(|c| c.abs() <= 1.0) {
            positions.push(x);
        }
    }
    let level = positions.iter().map(|x| (norm(x) - 0.6) * (1.2 + 0.3 * x[0])).collect();
    Points { dimension, positions, level }
}

fn ball(x: &[f64; 3]) -> f64 {
    norm(x) - 0.6
}

#[test]
fn stretched_clouds_are_redistanced_with_either_spacing() {
    let h = 1.0 / 32.0;
    for ratio in [2.0, 4.0, 10.0] {
        for (angle, jitter) in [(0.0, 0.0), (0.5, 0.0), (0.785, 0.1), (0.5, 0.3)] {
            let points = ball_in_lattice(&[h, h / ratio], angle, jitter);
            for spacing in [h, h / ratio] {
                let (findings, phi) = run(&points, spacing, 1).unwrap();
                let (_, max) = errors(&points, &phi, ball, |_| true);
                // A lattice of spacing h has 4e-7; 1e-3 of the shorter spacing is 3e-6 at 10 : 1.
                assert!(max < 1e-3 * h / ratio, "{ratio} {angle} {jitter} {spacing}: {max}");
                assert!(findings.is_empty(), "{ratio} {angle} {jitter} {spacing}: {findings:?}");
            }
        }
    }
}

#[test]
fn errors_on_stretched_clouds_fall_with_the_order_of_the_fits() {
    for ratio in [1.0, 2.0, 4.0, 10.0] {
        let measured: Vec<(f64, f64)> = [16.0, 24.0, 32.0, 48.0]
            .iter()
            .map(|cells| {
                let h = 1.0 / cells;
                let points = ball_in_lattice(&[h, h / ratio], 0.5, 0.1);
                let (_, phi) = run(&points, h, 1).unwrap();
                (h, errors(&points, &phi, ball, |_| true).0)
            })
            .collect();
        let order = slope(&measured);
        // Degree 4 has order 5; four clouds of jittered particles leave half an order open.
        assert!(order > 4.5, "{ratio}: {order}, {measured:?}");
    }
}

#[test]
fn a_stretch_that_varies_and_a_stretch_in_space_are_found() {
    // Rings around a circle, whose distance falls from 1/50 to a tenth of that at the circle.
    let level = |k: f64| 0.3 * k * (1.0 + 9.0 * k * k) / 10.0;
    let mut rings = Points { dimension: 2, positions: Vec::new(), level: Vec::new() };
    for i in 0..200 {
        for j in -40..=40 {
            let (angle, r) = (f64::from(i) / 200.0 * std::f64::consts::TAU, 0.6 + level(f64::from(j) / 40.0));
            rings.positions.push([r * angle.cos(), r * angle.sin(), 0.0]);
            rings.level.push(r - 0.6);
        }
    }
    let (findings, phi) = run(&rings, 0.0188, 1).unwrap();
    let (_, max) = errors(&rings, &phi, ball, |_| true);
    // The level is linear across the rings and constant along them; at the shorter spacing of 7e-4 this is 3e-3.
    assert!(max < 2e-6 && findings.is_empty(), "{max} {findings:?}");
    let h = 0.125;
    for spacings in [[h, h, 0.25 * h], [h, 0.25 * h, 0.25 * h]] {
        let points = ball_in_lattice(&spacings, 0.4, 0.0);
        for spacing in [h, 0.25 * h] {
            let (findings, phi) = run(&points, spacing, 1).unwrap();
            let (rms, max) = errors(&points, &phi, ball, |_| true);
            // An even lattice of spacing h, 4.8 h to the radius, has 9e-4 h and 6e-3 h.
            assert!(rms < 1e-3 * h && max < 6e-3 * h && findings.is_empty(), "{spacings:?}: {rms} {max} {findings:?}");
        }
    }
}

/// Nodes of a lattice of spacing h with the level of `exact`, in which round-off is cut to an exact zero.
fn lattice(dimension: usize, half: i64, h: f64, zero: f64, exact: impl Fn(&[f64; 3]) -> f64) -> Points {
    let side = 2 * half + 1;
    let mut points = Points { dimension, positions: Vec::new(), level: Vec::new() };
    for k in 0..side.pow(dimension as u32) {
        let x: [f64; 3] = std::array::from_fn(|d| {
            let index = k / side.pow(d as u32) % side - half;
            if d < dimension { index as f64 * h } else { 0.0 }
        });
        let level = exact(&x);
        points.positions.push(x);
        points.level.push(if level.abs() < 1e-12 { zero } else { level });
    }
    points
}

/// Distance from a slab of thickness t with its middle at `middle` along the last axis.
fn slab(dimension: usize, half_length: f64, thickness: f64, middle: f64) -> impl Fn(&[f64; 3]) -> f64 {
    move |x| {
        let last = dimension - 1;
        let half = |d: usize| if d == last { 0.5 * thickness } else { half_length };
        let out: Vec<f64> =
            (0..dimension).map(|d| if d == last { (x[d] - middle).abs() } else { x[d].abs() } - half(d)).collect();
        let outside = out.iter().map(|q| q.max(0.0).powi(2)).sum::<f64>().sqrt();
        outside + out.iter().copied().fold(f64::NEG_INFINITY, f64::max).min(0.0)
    }
}

#[test]
fn faces_on_particles_stay_where_they_are() {
    for (dimension, half, h) in [(2, 32, 1.0 / 32.0), (3, 12, 1.0 / 12.0)] {
        let long = 0.5 * f64::from(half) * h;
        for (thickness, middle) in [(2.0, 0.0), (3.0, 0.5), (4.0, 0.0)] {
            let exact = slab(dimension, long, thickness * h, middle * h);
            for (zero, repeat) in [(0.0, 1), (-0.0, 2), (0.0, 5)] {
                let points = lattice(dimension, i64::from(half), h, zero, &exact);
                let (_, phi) = run(&points, h, repeat).unwrap();
                let on_faces = |x: &[f64; 3]| (0..dimension - 1).all(|d| x[d].abs() <= long - 3.0 * h);
                let (_, max) = errors(&points, &phi, &exact, on_faces);
                // Fits reach over the middle of a slab of 2 h at first, and 0.12 h are what faces between particles have.
                assert!(max < 0.12 * h, "{dimension}D, {thickness} h, {repeat} times: {} h", max / h);
                let is_kept = points.level.iter().zip(&phi).all(|(level, phi)| *level != 0.0 || *phi == 0.0);
                assert!(is_kept, "a level of zero stays zero");
            }
        }
    }
}

#[test]
fn circles_and_planes_through_particles_are_as_exact_as_others() {
    let h = 1.0 / 32.0;
    // A circle of 15 h passes through (9, 12), (12, 9) and (15, 0): twelve particles have a level of zero.
    let circle = |x: &[f64; 3]| norm(x) - 15.0 * h;
    for repeat in [1, 3] {
        let points = lattice(2, 32, h, -0.0, circle);
        assert_eq!(points.level.iter().filter(|level| **level == 0.0).count(), 12);
        let (findings, phi) = run(&points, h, repeat).unwrap();
        let (_, max) = errors(&points, &phi, circle, |_| true);
        // Fits of a circle of 15 h to about (h/R)⁵ 10 h.
        assert!(max < 5e-5 * h && findings.is_empty(), "{max} {findings:?}");
        for dimension in [2, 3] {
            let plane = |x: &[f64; 3]| x[dimension - 1];
            let points = lattice(dimension, 10, h, 0.0, plane);
            let (findings, phi) = run(&points, h, repeat).unwrap();
            let (_, max) = errors(&points, &phi, plane, |_| true);
            // A plane is met to round-off.
            assert!(max < 1e-11 * h && findings.is_empty(), "{max} {findings:?}");
        }
    }
}

#[test]
fn layers_that_are_not_resolved_end_with_a_sentence() {
    let h = 1.0 / 16.0;
    let unresolved = |points: &Points, what: &str| {
        let error = run(points, h, 2).unwrap_err();
        assert!(matches!(error, StepError::Unresolved { .. }), "{what}: {error}");
        let text = error.to_string();
        assert!(text.contains("% of the particles") && text.contains("its limit"), "{what}: {text}");
    };
    for dimension in [2, 3] {
        let half = if dimension == 2 { 16 } else { 8 };
        let last = dimension - 1;
        // Two faces one spacing apart, both on particles: none lies between them.
        let thin = slab(dimension, 6.0 * h, h, 0.5 * h);
        unresolved(&lattice(dimension, half, h, 0.0, thin), "faces one spacing apart");
        let layer = |x: &[f64; 3]| if x[last].abs() < 1.5 * h { 0.0 } else { x[last] };
        unresolved(&lattice(dimension, half, h, 0.0, layer), "a layer of zeros");
        let touching = |x: &[f64; 3]| x[last].abs();
        unresolved(&lattice(dimension, half, h, 0.0, touching), "a level that touches zero");
    }
}

#[test]
fn spacings_that_are_not_those_of_the_points_are_refused() {
    let points = ball_in_lattice(&[1.0 / 16.0, 1.0 / 64.0], 0.0, 0.0);
    let found = build(&points, 0.5, 1).err().unwrap();
    assert!(found.contains("the points are stretched: they lie"), "{found}");
    let points = ball_in_lattice(&[1.0 / 16.0, 1.0 / 16.0], 0.0, 0.0);
    assert!(build(&points, 0.5, 1).err().unwrap().contains("apart"));
}

#[test]
fn results_on_stretched_clouds_do_not_depend_on_threads_or_stops() {
    let points = ball_in_lattice(&[1.0 / 16.0, 1.0 / 64.0], 0.5, 0.2);
    let state = |threads: usize, stop: Option<u64>| {
        pool(threads).install(|| {
            let mut simulation = build(&points, 1.0 / 64.0, 3).unwrap();
            while !simulation.is_finished() {
                simulation.step().unwrap();
                if Some(simulation.clock().step) == stop {
                    let state = meniscus::simulation::state_of(simulation.as_ref());
                    simulation = build(&points, 1.0 / 64.0, 3).unwrap();
                    simulation.load(&state).unwrap();
                }
            }
            let bits: Vec<u64> = column(simulation.as_ref(), "phi").iter().map(|phi| phi.to_bits()).collect();
            (bits, simulation.health().checks, simulation.report().diagnostics)
        })
    };
    let unbroken = state(1, None);
    for (threads, stop) in [(2, None), (3, Some(1)), (2, Some(2)), (1, Some(3))] {
        assert_eq!(state(threads, stop), unbroken, "{threads} {stop:?}");
    }
}

#[test]
fn checks_never_fire_on_the_papers_cases() {
    let directory = std::path::PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/validation/cases/redistance");
    let mut seen = 0;
    for entry in std::fs::read_dir(directory).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|end| end != "json") {
            continue;
        }
        let case: Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        for (name, body) in case["runs"].as_object().unwrap() {
            let body = body.get("scene").unwrap_or(body);
            let size = scene(body).estimate(&meniscus::scene::cloud::CloudSizes::new());
            // What takes more than a second or two is left to `meniscus verify`.
            if size.particles * size.steps > 200_000 {
                continue;
            }
            seen += 1;
            pool(2).install(|| {
                let mut simulation = crate::support::build(body, PLAN);
                while !simulation.is_finished() {
                    simulation.step().unwrap();
                    assert_eq!(simulation.take_findings(), Vec::new(), "{path:?} {name}");
                }
                assert!(simulation.health().checks.iter().all(|check| check.holds != Some(false)), "{path:?} {name}");
            });
        }
    }
    assert!(seen > 30, "{seen}");
}
