//! Orders up to the edge on hemispheres, patches and cylinders, by slopes that are fitted over four spacings.

use super::{Edges, EdgesChoice};
use crate::geometry::Vector;
use crate::geometry::random::CounterRandom;
use crate::parallel::Interrupt;
use crate::point_clouds::PreparedCloud;
use crate::point_clouds::cleaning::Cleaning;
use crate::scene::{self, BuildContext, Cloud, Clouds};
use crate::scenes::surface_pde::field_spec::everywhere;
use crate::simulation::{CpuClock, FieldValues, OutputPlan, Selection, Simulation};
use serde_json::{Value, json};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Shift of points inside by a spacing at most.
const JITTER: f64 = 0.2;

fn shift(seed: i64, i: i64, d: i64) -> f64 {
    JITTER * CounterRandom::new(7).symmetric(&[seed, i, d])
}

/// A hemisphere in rings about the z axis, the last one on its edge.
fn hemisphere(rings: i64) -> Vec<Vector<3>> {
    let step = FRAC_PI_2 / rings as f64;
    let ring = |k: i64| {
        let is_inside = f64::from(u8::from(k > 0 && k < rings));
        let count = (TAU * (k as f64 * step).sin() / step).round().max(1.0) as i64;
        (0..count).map(move |m| {
            let polar = step * (k as f64 + is_inside * shift(k, m, 0));
            let angle = TAU * (m as f64 + shift(k, m, 1)) / count as f64;
            Vector::<3>::new(
                polar.sin() * angle.cos(),
                polar.sin() * angle.sin(),
                if k == rings { 0.0 } else { polar.cos() },
            )
        })
    };
    (0..=rings).flat_map(ring).collect()
}

/// The unit square, with points on its edges.
fn patch(cells: i64) -> Vec<Vector<3>> {
    let at = |i: i64, j: i64| {
        let moved = |k: i64, d: i64| {
            let is_inside = k > 0 && k < cells;
            (k as f64 + if is_inside { shift(i, j, d) } else { 0.0 }) / cells as f64
        };
        Vector::<3>::new(moved(i, 0), moved(j, 1), 0.0)
    };
    (0..=cells).flat_map(|i| (0..=cells).map(move |j| at(i, j))).collect()
}

/// The wall of a cylinder of radius 1/2 and height 1, with points on both edges.
fn cylinder(cells: i64) -> Vec<Vector<3>> {
    let count = (0.5 * TAU * cells as f64).round() as i64;
    let at = |i: i64, j: i64| {
        let is_inside = j > 0 && j < cells;
        let angle = TAU * (i as f64 + 0.5 * (j % 2) as f64 + shift(i, j, 0)) / count as f64;
        let z = (j as f64 + if is_inside { shift(i, j, 1) } else { 0.0 }) / cells as f64;
        Vector::<3>::new(0.5 * angle.cos(), 0.5 * angle.sin(), z)
    };
    (0..=cells).flat_map(|j| (0..count).map(move |i| at(i, j))).collect()
}

fn context(points: &[Vector<3>]) -> BuildContext {
    let positions = points.iter().map(|x| [x[0], x[1], x[2]]).collect();
    let clouds = Clouds::from([("/surface", Cloud { positions, ..Cloud::default() })]);
    let plan = OutputPlan { every_time: None, series_every_steps: 1 };
    BuildContext { plan, interrupt: Interrupt::default(), cpu_clock: CpuClock::still(), clouds }
}

fn finished(body: &Value, points: &[Vector<3>]) -> Box<dyn Simulation> {
    let context = context(points);
    let scene = scene::parse(body, crate::scenes::SCENES).map_err(|errors| format!("{errors:?}")).unwrap();
    let mut simulation = scene.build(context).map_err(|errors| format!("{errors:?}")).unwrap();
    while !simulation.is_finished() {
        simulation.step().unwrap();
    }
    simulation
}

fn column(simulation: &dyn Simulation, name: &str) -> Vec<f64> {
    let fields = simulation.fields(Selection::All);
    let FieldValues::Scalar(values) = &fields.columns.iter().find(|c| c.name == name).unwrap().values else {
        panic!("{name} is no number a point")
    };
    values.clone()
}

/// Relative root mean square error, of both less their means where constants do not count.
fn error(found: &[f64], exact: &[f64], is_free: bool) -> f64 {
    let mean = |values: &[f64]| if is_free { values.iter().sum::<f64>() / values.len() as f64 } else { 0.0 };
    let (a, b) = (mean(found), mean(exact));
    let off: f64 = found.iter().zip(exact).map(|(x, y)| (x - a - y + b).powi(2)).sum();
    (off / exact.iter().map(|y| (y - b).powi(2)).sum::<f64>()).sqrt()
}

/// Slope of log error over log cells.
fn order(cells: &[i64], errors: &[f64]) -> f64 {
    let x: Vec<f64> = cells.iter().map(|n| (*n as f64).ln()).collect();
    let y: Vec<f64> = errors.iter().map(|e| e.ln()).collect();
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (a, b) = (mean(&x), mean(&y));
    let top: f64 = x.iter().zip(&y).map(|(x, y)| (x - a) * (y - b)).sum();
    -top / x.iter().map(|x| (x - a).powi(2)).sum::<f64>()
}

/// The solution of Δ u = sin(k d·x) without its mean, at time t of the heat equation from that field with `time`, on the unit sphere.
/// Legendre coefficients of sin(k s) by Gauss–Legendre sums.
fn on_sphere(k: &Vector<3>, x: &Vector<3>, factor: impl Fn(f64) -> f64) -> f64 {
    let size = k.norm();
    let s = k.dot(x) / size;
    let legendre = |l: usize, s: f64| {
        let (mut before, mut now) = (1.0, s);
        for n in 1..l {
            let n = n as f64;
            (before, now) = (now, ((2.0 * n + 1.0) * s * now - n * before) / (n + 1.0));
        }
        if l == 0 { 1.0 } else { now }
    };
    let samples = 400;
    // Odd degrees alone; the midpoint rule on cos θ = s is exact enough for smooth functions after the change s = sin φ.
    let coefficient = |l: usize| {
        let at = |m: usize| {
            let phi = -FRAC_PI_2 + std::f64::consts::PI * (m as f64 + 0.5) / samples as f64;
            (size * phi.sin()).sin() * legendre(l, phi.sin()) * phi.cos()
        };
        (l as f64 + 0.5) * (0..samples).map(at).sum::<f64>() * std::f64::consts::PI / samples as f64
    };
    (1..16).step_by(2).map(|l| coefficient(l) * factor((l * (l + 1)) as f64) * legendre(l, s)).sum()
}

struct Case {
    name: &'static str,
    points: fn(i64) -> Vec<Vector<3>>,
    body: Value,
    exact: fn(&Vector<3>) -> f64,
    is_free: bool,
}

/// Cells along a side, or rings.
const CELLS: [i64; 4] = [10, 14, 20, 28];

fn body(problem: &Value, edges: &Value, method: &str) -> Value {
    json!({"kind": "surface_pde", "surface": {"type": "points", "upload": "upl_x"}, "problem": problem, "edges": edges, "method": method})
}

fn poisson(k: [f64; 3]) -> Value {
    json!({"type": "poisson", "field": {"type": "plane_wave", "k": k}})
}

fn cases(method: &'static str) -> Vec<Case> {
    const K: f64 = 2.0;
    let heat = json!({"type": "diffusion", "initial": {"type": "plane_wave", "k": [2.0, 1.0, 0.0]}, "end_time": 0.1, "time_step": 0.0025});
    let top = json!({"type": "dirichlet", "value": 0.5, "normal": [0, 0, 1], "offset": 0.5});
    vec![
        Case {
            name: "hemisphere, Poisson, no flux",
            points: hemisphere,
            body: body(&poisson([2.0, 1.0, 0.0]), &json!("neumann"), method),
            exact: |x| on_sphere(&Vector::<3>::new(2.0, 1.0, 0.0), x, |e| -1.0 / e),
            is_free: true,
        },
        Case {
            name: "hemisphere, heat, no flux",
            points: hemisphere,
            body: body(&heat, &json!("neumann"), method),
            exact: |x| on_sphere(&Vector::<3>::new(2.0, 1.0, 0.0), x, |e| (-0.1 * e).exp()),
            is_free: false,
        },
        Case {
            name: "hemisphere, Poisson, held",
            points: hemisphere,
            body: body(&poisson([0.0, 0.0, 2.0]), &json!("dirichlet"), method),
            exact: |x| on_sphere(&Vector::<3>::new(0.0, 0.0, 2.0), x, |e| -1.0 / e),
            is_free: false,
        },
        Case {
            name: "patch, Poisson, no flux",
            points: patch,
            body: body(&poisson([K, 0.0, 0.0]), &json!("neumann"), method),
            exact: |x| {
                let c = (1.0 - K.cos()) / K;
                x[0] / K - (K * x[0]).sin() / (K * K) - 0.5 * c * x[0] * x[0]
            },
            is_free: true,
        },
        Case {
            name: "cylinder, Poisson, no flux",
            points: cylinder,
            body: body(&poisson([0.0, 0.0, K]), &json!("neumann"), method),
            exact: |x| {
                let c = (1.0 - K.cos()) / K;
                x[2] / K - (K * x[2]).sin() / (K * K) - 0.5 * c * x[2] * x[2]
            },
            is_free: true,
        },
        Case {
            name: "cylinder, Poisson, one edge held",
            points: cylinder,
            body: body(&poisson([0.0, 0.0, K]), &top, method),
            exact: |x| {
                let u = |z: f64| z / K - (K * z).sin() / (K * K);
                0.5 + u(x[2]) - u(1.0)
            },
            is_free: false,
        },
    ]
}

#[test]
fn solutions_have_second_order_up_to_the_edge() {
    for method in ["surface_dcpse", "conservative", "auto"] {
        for case in cases(method) {
            let at = |cells: &i64| {
                let points = (case.points)(*cells);
                let simulation = finished(&case.body, &points);
                let report = simulation.report();
                let number = |name: &str| {
                    report.diagnostics.iter().find(|d| d.name == name).map_or(0.0, |diagnostic| diagnostic.value)
                };
                assert!(number("edges.no_flux") + number("edges.held") > 0.0);
                assert_eq!(number("supports.voronoi") + number("supports.positive"), 0.0, "{method} {}", case.name);
                let exact: Vec<f64> = points.iter().map(case.exact).collect();
                error(&column(simulation.as_ref(), "value"), &exact, case.is_free)
            };
            let errors: Vec<f64> = CELLS.iter().map(at).collect();
            let order = order(&CELLS, &errors);
            // Conservative solutions on patches have 2e-3 at 28 cells, all others less.
            assert!(order > 1.85 && errors[3] < 2.5e-3, "{method} {}: order {order}, {errors:?}", case.name);
        }
    }
}

/// Points of the unit square that repeat along both sides, and of a cylinder that repeats along its axis.
fn repeated(cells: i64, is_cylinder: bool) -> Vec<Vector<3>> {
    if is_cylinder {
        return cylinder(cells).into_iter().filter(|x| x[2] < 1.0).collect();
    }
    let at = |i: i64, j: i64| {
        Vector::<3>::new((i as f64 + shift(i, j, 0)) / cells as f64, (j as f64 + shift(i, j, 1)) / cells as f64, 0.0)
    };
    (0..cells).flat_map(|i| (0..cells).map(move |j| at(i, j))).collect()
}

/// Where a surface repeats, solutions have second order across the seam, with fits and with the conservative form; nothing is lost
/// there, and modes are those of a torus.
#[test]
fn surfaces_that_repeat_have_no_seam() {
    const FINE: [i64; 4] = [16, 20, 26, 32];
    let square = json!({"type": "periodic", "period": [1, 0, 0], "second_period": [0, 1, 0]});
    let tube = json!({"type": "periodic", "period": [0, 0, 1]});
    for (is_cylinder, edges, k) in [(false, square.clone(), [TAU, TAU, 0.0]), (true, tube, [0.0, 0.0, TAU])] {
        let size = k.iter().map(|k| k * k).sum::<f64>();
        for method in ["surface_dcpse", "conservative"] {
            let (mut solved, mut heated) = (Vec::new(), Vec::new());
            for cells in FINE {
                let points = repeated(cells, is_cylinder);
                let wave = |x: &[f64; 3]| (k[0] * x[0] + k[1] * x[1] + k[2] * x[2]).sin();
                let check = |problem: &Value, factor: f64| {
                    let simulation = finished(&body(problem, &edges, method), &points);
                    assert_eq!(simulation.particle_count(), points.len());
                    let places = simulation.fields(Selection::All).points;
                    let exact: Vec<f64> = places.iter().map(|x| factor * wave(x)).collect();
                    let report = simulation.report();
                    assert!(report.diagnostic("stars.open").unwrap() < 1.0, "there is no edge");
                    error(&column(simulation.as_ref(), "value"), &exact, true)
                };
                solved.push(check(&poisson(k), -1.0 / size));
                let end = 0.5 / size;
                let heat = json!({
                    "type": "diffusion", "initial": {"type": "plane_wave", "k": k}, "end_time": end, "time_step": end / 100.0
                });
                heated.push(check(&heat, (-0.5_f64).exp()));
            }
            for errors in [&solved, &heated] {
                let order = order(&FINE, errors);
                assert!(
                    order > 1.7 && errors[3] < 1.5e-2,
                    "{method}, cylinder {is_cylinder}: order {order}, {errors:?}"
                );
            }
        }
    }
    // The least eigenvalues of a square torus are (2π)², four times.
    let problem = json!({"type": "eigenvalues", "count": 5});
    let simulation = finished(&body(&problem, &square, "conservative"), &repeated(32, false));
    let found = simulation.report().method["eigenvalues"].clone();
    let values: Vec<f64> = found.split(", ").filter_map(|value| value.parse().ok()).collect();
    assert!(values.len() == 5 && values[1..].iter().all(|value| (value / (TAU * TAU) - 1.0).abs() < 0.02), "{found}");
}

/// Points that are given on both edges are one; periods that lead nowhere are refused.
#[test]
fn periods_that_do_not_fit_are_refused() {
    let lattice: Vec<_> = (0..=20)
        .flat_map(|i| (0..=20).map(move |j| Vector::<3>::new(f64::from(i) / 20.0, f64::from(j) / 20.0, 0.0)))
        .collect();
    let edges = |x: f64| json!({"type": "periodic", "period": [x, 0, 0]});
    let simulation = finished(&body(&poisson([TAU, 0.0, 0.0]), &edges(1.0), "auto"), &lattice);
    assert_eq!(simulation.particle_count(), 20 * 21);
    for (period, words) in [(1.7, "does not go on"), (0.2, "is short")] {
        let given = body(&poisson([TAU, 0.0, 0.0]), &edges(period), "auto");
        let built = scene::parse(&given, crate::scenes::SCENES).unwrap().build(context(&lattice));
        let detail = built.err().unwrap()[0].detail.clone();
        assert!(detail.contains(words), "{detail}");
    }
    let refused = |problem: Value, edges: Value| {
        let given = body(&problem, &edges, "auto");
        scene::parse(&given, crate::scenes::SCENES).err().unwrap()[0].pointer.clone()
    };
    assert_eq!(refused(json!("advection"), edges(1.0)), "/edges");
    assert_eq!(refused(json!("poisson"), json!({"type": "periodic", "period": [0, 0, 0]})), "/edges/period");
}

/// Points at random, cut off without points on the edge: first order, but no flux and no growth.
#[test]
fn ragged_edges_hold() {
    let random = CounterRandom::new(5);
    let draw = |i: i64| Vector::<3>::from_fn(|d, _| random.symmetric(&[i, d as i64]));
    let is_in = |x: &Vector<3>| (0.1..1.0).contains(&x.norm()) && x[2] > 0.0;
    let points: Vec<_> = (0..).map(draw).filter(is_in).map(|x| x.normalize()).take(1500).collect();
    let heat = json!({"type": "diffusion", "initial": {"type": "plane_wave", "k": [2.0, 1.0, 0.0]}, "end_time": 1.0});
    for method in ["surface_dcpse", "conservative", "auto"] {
        let simulation = finished(&body(&heat, &json!("neumann"), method), &points);
        let largest = column(simulation.as_ref(), "value").iter().fold(0.0_f64, |most, u| most.max(u.abs()));
        // The least mode decays by exp(−2).
        assert!(largest < 0.3, "{method}: {largest}");
    }
}

/// Independent random points on the unit sphere.
fn random_sphere(count: usize) -> Vec<Vector<3>> {
    let random = CounterRandom::new(11);
    let draw = |i: i64| Vector::<3>::from_fn(|d, _| random.symmetric(&[i, d as i64]));
    (0..).map(draw).filter(|x| (0.1..1.0).contains(&x.norm())).map(|x| x.normalize()).take(count).collect()
}

/// Single open stars among random points are no edge.
#[test]
fn edges_are_open_stars_in_a_row() {
    let given = body(&poisson([0.0, 0.0, 2.0]), &json!("dirichlet"), "auto");
    let points = random_sphere(4000);
    let built = scene::parse(&given, crate::scenes::SCENES).unwrap().build(context(&points));
    assert_eq!(built.err().unwrap()[0].pointer, "/edges");
    let half: Vec<_> = points.into_iter().filter(|x| x[2] > 0.0).collect();
    let cloud = PreparedCloud::new(&half, None, Cleaning::Drop).unwrap();
    let choice = EdgesChoice::Dirichlet { value: everywhere(1.0), normal: None, offset: 0.0 };
    let edges = Edges::new(&cloud, cloud.points.len(), &choice);
    // Points are 0.056 apart.
    assert!(edges.held_count() > 60, "{}", edges.held_count());
    let inside = edges.held.iter().filter(|i| cloud.points[**i][2] > 0.25).count();
    assert_eq!(inside, 0, "{} held, {} single", edges.held_count(), edges.single);
}

#[test]
fn what_edges_cannot_hold_is_refused() {
    let refused = |more: Value| {
        let mut given = body(&poisson([1.0, 0.0, 0.0]), &json!("dirichlet"), "auto");
        given.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        let errors = scene::parse(&given, crate::scenes::SCENES).err().unwrap_or_default();
        errors.iter().map(|error| error.pointer.clone()).collect::<Vec<_>>()
    };
    assert_eq!(refused(json!({})), Vec::<String>::new());
    assert_eq!(refused(json!({"problem": "curvature"})), ["/edges"]);
    assert_eq!(refused(json!({"surface": "sphere", "method": "surface_dcpse"})), ["/edges"]);
    assert_eq!(refused(json!({"method": "conservative", "solver": "cg"})), ["/solver"]);
    let half = |normal: Value| json!({"edges": {"type": "dirichlet", "normal": normal}});
    assert_eq!(refused(half(json!([0, 0]))), ["/edges/normal"]);
    assert_eq!(refused(half(json!([0, 0, 0]))), ["/edges/normal"]);
    assert_eq!(refused(json!({"edges": {"type": "dirichlet", "offset": 1.0}})), ["/edges/offset"]);
    // A closed surface has no edge.
    let closed = crate::geometry::fibonacci::sphere(300);
    let given = body(&poisson([1.0, 0.0, 0.0]), &json!("dirichlet"), "auto");
    let built = scene::parse(&given, crate::scenes::SCENES).unwrap().build(context(&closed));
    assert_eq!(built.err().unwrap()[0].pointer, "/edges");
}
