//! Surfaces made of points from outside: what they give, what is said of them before a run, and what is refused.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "../support/mod.rs"]
#[expect(dead_code, reason = "each test target uses a part")]
mod support;

mod problems;
mod scattered;

use meniscus::geometry::{Vector, fibonacci};
use meniscus::parallel::Interrupt;
use meniscus::scene::{BuildContext, Cloud, CloudSizes, Clouds};
use meniscus::scenes::SCENES;
use meniscus::simulation::{CpuClock, OutputPlan, Section, Selection, Simulation, state_of};
use meniscus::spec::Violation;
use meniscus_jobs::formats::checkpoint::layout::entries_of;
use serde_json::{Value, json};
use support::{column, pool, scene};

const PLAN: OutputPlan = OutputPlan { every_time: None, series_every_steps: 1 };

fn body(more: &Value) -> Value {
    let points = json!({"type": "points", "upload": "upl_x"});
    let mut body = json!({"kind": "surface_pde", "surface": points, "problem": "curvature"});
    body.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
    body
}

/// A sphere about a point, with its normals.
fn sphere(count: usize, radius: f64, center: [f64; 3]) -> Cloud {
    let directions = fibonacci::sphere(count);
    let at = |n: &Vector<3>| std::array::from_fn(|d| center[d] + radius * n[d]);
    let normals = directions.iter().map(|n| [n[0], n[1], n[2]]).collect();
    Cloud { positions: directions.iter().map(at).collect(), normals: Some(normals), ..Cloud::default() }
}

fn bare(cloud: Cloud) -> Cloud {
    Cloud { normals: None, ..cloud }
}

fn build(body: &Value, cloud: &Cloud) -> Result<Box<dyn Simulation>, Vec<Violation>> {
    let clouds = Clouds::from([("/surface", cloud.clone())]);
    let context = BuildContext { plan: PLAN, interrupt: Interrupt::default(), cpu_clock: CpuClock::still(), clouds };
    scene(body).build(context)
}

fn finished(body: &Value, cloud: &Cloud) -> Box<dyn Simulation> {
    pool(2).install(|| {
        let mut simulation = build(body, cloud).unwrap();
        while !simulation.is_finished() {
            simulation.step().unwrap();
        }
        simulation
    })
}

/// The sentence that a build is refused with.
fn refusal(body: &Value, cloud: &Cloud) -> String {
    let found = build(body, cloud).err().unwrap();
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!(found[0].pointer, "/surface");
    found[0].detail.clone()
}

#[test]
fn curvatures_of_a_sphere_are_those_of_its_radius() {
    let cloud = sphere(3000, 0.5, [10.0, 0.0, -3.0]);
    for (cloud, normals, most) in [
        (cloud.clone(), json!("given"), 1e-2),
        (cloud.clone(), json!({"type": "given", "metric": "normals"}), 1e-3),
        (cloud.clone(), json!("estimated"), 1e-2),
        (bare(cloud), json!("given"), 1e-2),
    ] {
        let mut simulation = finished(&body(&json!({"normals": normals})), &cloud);
        let off = |name: &str, exact: f64| {
            column(simulation.as_ref(), name).iter().map(|k| (k / exact - 1.0).abs()).fold(0.0, f64::max)
        };
        assert!(off("mean_curvature", 2.0) < most, "{normals}: {}", off("mean_curvature", 2.0));
        assert!(off("gauss_curvature", 4.0) < 3.0 * most, "{normals}: {}", off("gauss_curvature", 4.0));
        assert!(simulation.report().errors.is_empty(), "nobody knows the exact surface");
        assert_eq!(simulation.take_findings(), []);
    }
}

#[test]
fn operators_are_those_of_the_surface_and_no_error_is_made_up() {
    let cloud = sphere(4000, 1.0, [0.0; 3]);
    let (field, order) = (json!({"type": "plane_wave", "k": [2, -1, 3]}), json!({"type": "surface_dcpse", "order": 4}));
    let given = body(&json!({"problem": {"type": "laplace_beltrami", "field": field}, "method": order, "repeat": 2}));
    for cloud in [cloud.clone(), bare(cloud.clone())] {
        let simulation = finished(&given, &cloud);
        let wave = Vector::<3>::new(2.0, -1.0, 3.0);
        let exact = |x: &[f64; 3]| {
            let along = wave.dot(&Vector::<3>::from(*x));
            -(wave.norm_squared() - along * along) * along.sin() - 2.0 * along * along.cos()
        };
        let value = column(simulation.as_ref(), "value");
        let off = value.iter().zip(&cloud.positions).map(|(value, x)| (value - exact(x)).abs()).fold(0.0, f64::max);
        assert!(off < 1e-2, "{off}");
        assert!(simulation.report().errors.is_empty());
    }
    let poisson = body(&json!({"problem": {"type": "poisson", "field": field}, "method": order}));
    let simulation = finished(&poisson, &cloud);
    let errors = simulation.report().errors;
    assert!(errors.iter().all(|error| error.quantity == "solver") && !errors.is_empty(), "{errors:?}");
    let again = json!({"type": "laplace_beltrami", "field": field});
    assert!(scene(&body(&json!({"problem": again}))).resolved()["count"].is_null());
    // A wave that is not given is one by the size of the points, which is known only when they are read.
    let own = finished(&body(&json!({"problem": "laplace_beltrami"})), &sphere(1000, 1e-3, [0.0; 3]));
    let field = column(own.as_ref(), "field");
    assert!(field.iter().any(|f| *f > 0.9) && field.iter().any(|f| *f < -0.9));
}

fn bodies() -> Vec<(Value, Cloud)> {
    let ball = sphere(500, 1.0, [0.3, 0.0, 0.0]);
    let circle = (0..200).map(|i| 0.031_415_926 * f64::from(i)).map(|a| [a.cos(), a.sin(), 0.0]);
    let circle = Cloud { positions: circle.collect(), ..Cloud::default() };
    let evolving = |more: Value| {
        let mut problem = json!({"end_time": 0.02, "time_step": 0.005});
        problem.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        json!({"problem": problem})
    };
    let gray_scott = evolving(json!({"type": "reaction_diffusion", "model": "gray_scott"}));
    let gaussian = json!({"type": "truncated_gaussian", "center": [0.3, 0, 1], "sigma": 1});
    let mut on_circle = evolving(json!({"type": "diffusion", "integrator": "bdf2"}));
    on_circle["dimension"] = json!(2);
    let two = [ball.clone(), sphere(300, 0.5, [4.0, 0.0, 0.0])];
    let lattice = (0..20 * 20).map(|k| [f64::from(k % 20), f64::from(k / 20), 0.0]);
    let patch = Cloud { positions: lattice.collect(), ..Cloud::default() };
    let periodic = json!({"type": "periodic", "period": [20, 0, 0]});
    vec![
        (body(&json!({"problem": "laplace_beltrami", "repeat": 4})), ball.clone()),
        (body(&json!({"problem": "laplace_beltrami", "repeat": 4})), bare(ball.clone())),
        (body(&json!({})), bare(ball.clone())),
        (body(&json!({"problem": "poisson"})), ball.clone()),
        (body(&json!({"problem": "poisson", "method": "conservative"})), bare(ball.clone())),
        (
            body(
                &json!({"problem": {"type": "diffusion", "end_time": 0.02, "time_step": 0.005}, "method": "conservative"}),
            ),
            ball.clone(),
        ),
        (body(&json!({"problem": "poisson", "method": {"type": "auto", "order": 4}})), random_sphere(600)),
        (body(&json!({"problem": "poisson", "solver": "sparse_lu"})), bare(ball.clone())),
        (body(&evolving(json!({"type": "diffusion", "initial": gaussian}))), bare(ball.clone())),
        (body(&gray_scott), ball.clone()),
        (body(&json!({"problem": {"type": "eigenvalues", "count": 5}})), bare(ball.clone())),
        (body(&json!({"problem": {"type": "geodesic_distance", "from": [[0.3, 0, 1]]}})), joined(&two)),
        (body(&evolving(json!({"type": "advection", "velocity": "stream"}))), bare(ball.clone())),
        (body(&evolving(json!({"type": "moving_diffusion", "motion": "normal"}))), bare(ball)),
        (body(&json!({"problem": {"type": "eigenvalues", "count": 4}, "edges": periodic})), patch),
        (body(&on_circle), circle.clone()),
        (body(&json!({"dimension": 2})), circle),
    ]
}

fn same(a: &Section, b: &Section) -> bool {
    entries_of(a) == entries_of(b)
}

#[test]
fn runs_on_points_go_on_bit_for_bit_on_any_number_of_threads() {
    for (body, cloud) in bodies() {
        assert_eq!(scene(&scene(&body).resolved()).resolved(), scene(&body).resolved());
        let states = |threads: usize| -> Vec<Section> {
            pool(threads).install(|| {
                let mut simulation = build(&body, &cloud).unwrap();
                let mut states = vec![state_of(simulation.as_ref())];
                while !simulation.is_finished() {
                    simulation.step().unwrap();
                    states.push(state_of(simulation.as_ref()));
                }
                states
            })
        };
        let unbroken = states(1);
        for threads in [2, 3] {
            assert!(states(threads).iter().zip(&unbroken).all(|(a, b)| same(a, b)), "{threads} threads, {body}");
        }
        let last = unbroken.len() - 1;
        for k in [0, last / 2, last] {
            pool(1 + k % 3).install(|| {
                let mut simulation = build(&body, &cloud).unwrap();
                simulation.load(&unbroken[k]).unwrap();
                while !simulation.is_finished() {
                    simulation.step().unwrap();
                }
                assert!(same(&state_of(simulation.as_ref()), &unbroken[last]), "restart at {k}, {body}");
                let mut shown: Vec<&str> = simulation.fields(Selection::All).columns.iter().map(|c| c.name).collect();
                let mut promised = scene(&body).fields().iter().map(|field| field.name).collect::<Vec<_>>();
                shown.sort_unstable();
                promised.sort_unstable();
                assert_eq!(shown, promised, "{body}");
            });
        }
    }
}

#[test]
fn what_is_wrong_with_points_is_said_before_the_first_step() {
    let cloud = sphere(2000, 1.0, [0.0; 3]);
    let mut holed = cloud.clone();
    holed.positions.truncate(1950);
    holed.normals.as_mut().unwrap().truncate(1950);
    holed.normals.as_mut().unwrap()[70] = [0.0, 0.0, -1.0];
    let mut simulation = build(&body(&json!({})), &holed).unwrap();
    let described = simulation.report().method["points"].clone();
    assert!(described.starts_with("1950 of them") && described.contains("1 part"), "{described}");
    let findings = simulation.take_findings();
    let names: Vec<_> = findings.iter().map(|finding| finding.code.as_ref()).collect();
    assert_eq!(names, ["holes", "inconsistent_normals"]);
    assert!(findings[0].message.contains("more: neighbors on one side alone"), "{}", findings[0].message);
    assert!(findings[1].message.starts_with("point 70:"), "{}", findings[1].message);
    assert_eq!(simulation.take_findings(), []);
    // A wrong normal is replaced.
    pool(2).install(|| simulation.step()).unwrap();
    let mean = column(simulation.as_ref(), "mean_curvature");
    assert!((mean[70] - 1.0).abs() < 1e-2 && mean.iter().all(|h| (h - 1.0).abs() < 0.2), "{}", mean[70]);

    let mut twins = cloud.clone();
    twins.positions[7] = twins.positions[1999];
    let refuse = json!({"surface": {"type": "points", "upload": "upl_x", "clean": "refuse"}});
    assert!(refusal(&body(&refuse), &twins).starts_with("point 1999:"));
    let mut without_length = cloud.clone();
    without_length.normals.as_mut().unwrap()[11] = [0.0; 3];
    assert!(refusal(&body(&json!({})), &without_length).starts_with("point 11:"));
    // Normals that nobody uses are not looked at.
    assert!(build(&body(&json!({"normals": "estimated"})), &without_length).is_ok());
    let exact = body(&json!({"normals": {"type": "given", "metric": "normals"}}));
    assert!(refusal(&exact, &bare(cloud.clone())).contains("no normals"));
    let mut fewer = cloud.clone();
    fewer.normals.as_mut().unwrap().pop();
    assert!(refusal(&body(&json!({})), &fewer).contains("1999 normals for 2000 points"));
    let order = body(&json!({"method": {"type": "surface_dcpse", "order": 6}}));
    assert!(refusal(&order, &sphere(200, 1.0, [0.0; 3])).contains("280 points at least"));
    assert!(refusal(&body(&json!({"dimension": 2})), &cloud).contains("z ="));
}

/// A body with a problem on points.
fn equation(problem: &Value, more: &Value) -> Value {
    let mut body = body(&json!({"problem": problem}));
    body.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
    body
}

fn joined(parts: &[Cloud]) -> Cloud {
    Cloud { positions: parts.iter().flat_map(|part| part.positions.clone()).collect(), ..Cloud::default() }
}

fn diagnostic(simulation: &dyn Simulation, name: &str) -> f64 {
    simulation.report().diagnostic(name).unwrap()
}

fn codes(simulation: &mut dyn Simulation) -> Vec<String> {
    simulation.take_findings().iter().map(|finding| finding.code.to_string()).collect()
}

/// Independent random points on the unit sphere.
fn random_sphere(count: usize) -> Cloud {
    let random = meniscus::geometry::random::CounterRandom::new(21);
    let draw = |i: i64| std::array::from_fn::<f64, 3, _>(|d| random.symmetric(&[i, d as i64]));
    let length = |x: &[f64; 3]| x.iter().map(|c| c * c).sum::<f64>().sqrt();
    let points = (0..).map(draw).filter(|x| (0.1..1.0).contains(&length(x)));
    Cloud { positions: points.map(|x| x.map(|c| c / length(&x))).take(count).collect(), ..Cloud::default() }
}

#[test]
fn duplicates_and_strays_are_left_out_and_told() {
    let mut cloud = bare(sphere(1000, 1.0, [0.0; 3]));
    let copies: Vec<[f64; 3]> = cloud.positions[..20].to_vec();
    cloud.positions.extend(copies);
    cloud.positions.extend([[1.5, 0.0, 0.0], [-40.0, 3.0, 1.0]]);
    let mut simulation = finished(&body(&json!({})), &cloud);
    assert_eq!(diagnostic(simulation.as_ref(), "points.merged"), 20.0);
    assert_eq!(diagnostic(simulation.as_ref(), "points.dropped"), 2.0);
    assert_eq!(codes(simulation.as_mut()), ["points.merged", "points.dropped"]);
    let mean = column(simulation.as_ref(), "mean_curvature");
    assert!(mean.len() == 1000 && mean.iter().all(|h| (h - 1.0).abs() < 2e-2));
}

/// Two spheres with right-hand sides that have means: each part is solved with its own constant.
#[test]
fn poisson_is_solved_part_by_part() {
    let center = [3.0, 0.0, 0.0];
    let cloud = joined(&[sphere(600, 1.0, [0.0; 3]), sphere(600, 1.0, center)]);
    let field = json!({"type": "plane_wave", "k": [1.0, 0.4, -0.3]});
    let mut apart = Vec::new();
    for at in [[0.0; 3], center] {
        let alone = bare(sphere(600, 1.0, at));
        let poisson = equation(&json!({"type": "poisson", "field": field}), &json!({}));
        apart.push(column(finished(&poisson, &alone).as_ref(), "value"));
    }
    for solver in [json!("auto"), json!("sparse_lu"), json!("bicgstab")] {
        let poisson = equation(&json!({"type": "poisson", "field": field}), &json!({"solver": solver}));
        let mut simulation = finished(&poisson, &cloud);
        assert_eq!(diagnostic(simulation.as_ref(), "parts"), 2.0);
        assert_eq!(codes(simulation.as_mut()), ["parts"]);
        let value = column(simulation.as_ref(), "value");
        let off = value.iter().zip(apart.concat()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-6, "{solver}: {off}");
        let health = simulation.health();
        assert!(health.checks.iter().all(|check| check.holds != Some(false)), "{:?}", health.checks);
    }
    // The mean of the wave over a sphere about c is sin(k·c) sin(|k|)/|k|.
    let size = (1.0_f64 + 0.16 + 0.09).sqrt();
    let exact = 3.0_f64.sin() * size.sin() / size;
    let described = finished(&equation(&json!({"type": "poisson", "field": field}), &json!({})), &cloud).report();
    let constants = described.method["condition"].rsplit(": ").next().unwrap().to_owned();
    let second: f64 = constants.split(", ").nth(1).unwrap().parse().unwrap();
    assert!((second - exact).abs() < 1e-3, "{constants}: {exact}");
}

/// On independent random points the heat equation runs, with rows and in the conservative form.
#[test]
fn diffusion_keeps_its_bounds_on_random_points() {
    let cloud = random_sphere(1500);
    let initial = json!({"type": "plane_wave", "k": [2, -1, 3]});
    let problem = json!({"type": "diffusion", "initial": initial, "end_time": 0.1, "time_step": 0.002});
    for method in [json!("auto"), json!("conservative"), json!({"type": "surface_dcpse", "order": 4})] {
        let mut simulation = finished(&equation(&problem, &json!({"method": method})), &cloud);
        let health = simulation.health();
        assert!(health.checks.iter().all(|check| check.holds != Some(false)), "{method}: {:?}", health.checks);
        let drift = health.checks.iter().find(|check| check.name == "mass_drift").unwrap().value.unwrap();
        let bound = if method == json!("conservative") { 1e-9 } else { 5e-3 };
        assert!(drift < bound, "{method}: {drift}");
        assert_eq!(codes(simulation.as_mut()), Vec::<String>::new(), "{method}");
    }
}

/// A named method keeps its rows, and says where they cannot hold; `auto` takes the conservative form there.
#[test]
fn a_surface_that_is_not_resolved_gets_the_conservative_form() {
    // A sphere pressed so flat that its halves are a third of a spacing apart at the rim.
    let mut cloud = bare(sphere(700, 1.0, [0.0; 3]));
    cloud.positions.iter_mut().for_each(|x| x[2] *= 0.05);
    let wave = json!({"type": "plane_wave", "k": [2, -1, 3]});
    let poisson = json!({"type": "poisson", "field": wave});
    let automatic = finished(&equation(&poisson, &json!({})), &cloud);
    let (operator, solver) = (&automatic.report().method["operator"], &automatic.report().method["solver"]);
    assert!(operator.starts_with("conservative:") && solver.starts_with("CG"), "{operator}, {solver}");
    let named = finished(&equation(&poisson, &json!({"method": "surface_dcpse"})), &cloud);
    assert!(named.report().method["operator"].starts_with("rows"));
    // Values at points keep the rows, with findings that name the points at the rim and those whose neighbors are on the other half.
    let mut applied = finished(&equation(&json!({"type": "laplace_beltrami", "field": wave}), &json!({})), &cloud);
    let codes = codes(applied.as_mut());
    for code in ["holes", "close_sheets"] {
        assert!(codes.iter().any(|found| found == code), "{code}: {codes:?}");
    }
}

#[test]
fn concentrations_stay_within_their_bounds_on_graded_points() {
    // Points whose density varies tenfold.
    let cloud = bare(sphere(600, 1.0, [0.0; 3]));
    let positions: Vec<[f64; 3]> =
        cloud.positions.iter().enumerate().filter(|(i, x)| x[2] > 0.0 || i % 10 == 0).map(|(_, x)| *x).collect();
    let cloud = Cloud { positions, ..cloud };
    let problem = json!({"type": "reaction_diffusion", "model": "gray_scott", "diffusivity": 0.002,
        "second_diffusivity": 0.001, "end_time": 100});
    let simulation = finished(&equation(&problem, &json!({})), &cloud);
    for name in ["value", "second_value"] {
        let values = column(simulation.as_ref(), name);
        assert!(values.iter().all(|c| (-1e-2..1.01).contains(c)), "{name}");
    }
}

#[test]
fn wrong_normals_are_replaced_or_refused() {
    let mut cloud = sphere(1500, 1.0, [0.0; 3]);
    cloud.normals.as_mut().unwrap().iter_mut().for_each(|n| n.swap(1, 2));
    let mut simulation = finished(&body(&json!({})), &cloud);
    assert_eq!(codes(simulation.as_mut()), ["normals.wrong_together"]);
    assert!(column(simulation.as_ref(), "mean_curvature").iter().all(|h| (h - 1.0).abs() < 2e-2));
    let exact = body(&json!({"normals": {"type": "given", "metric": "normals"}}));
    assert!(refusal(&exact, &cloud).contains("do not stand on the surface"));
}

#[test]
fn bodies_that_touch_face_outward_each() {
    let cloud = joined(&[sphere(400, 1.0, [-1.0, 0.0, 0.0]), sphere(400, 1.0, [1.0, 0.0, 0.0])]);
    let mut simulation = finished(&body(&json!({})), &cloud);
    assert!(codes(simulation.as_mut()).contains(&"close_sheets".to_owned()));
    let mean = column(simulation.as_ref(), "mean_curvature");
    for half in [&mean[..400], &mean[400..]] {
        let mut half = half.to_vec();
        half.sort_by(f64::total_cmp);
        assert!((half[200] - 1.0).abs() < 2e-2, "{}", half[200]);
    }
}

/// Resolved scenes of earlier versions keep supports of one radius and refuse points with faults.
#[test]
fn scenes_of_earlier_versions_go_on_as_they_were() {
    let points = json!({"type": "points", "upload": "upl_x", "file": null});
    let method = json!({"type": "surface_dcpse", "order": 2, "form": "intrinsic", "cutoff_dn": 2.4});
    let earlier = json!({"kind": "surface_pde", "surface": points, "problem": {"type": "curvature"}, "method": method});
    let now = meniscus::scene::of_earlier_version(earlier, SCENES);
    assert_eq!((&now["method"]["supports"], &now["surface"]["clean"]), (&json!("ball"), &json!("refuse")));
    let simulation = finished(&now, &sphere(800, 1.0, [0.0; 3]));
    assert!(simulation.report().method["operator"].contains("tangent planes"));
    let again = meniscus::scene::of_earlier_version(scene(&now).resolved(), SCENES);
    assert_eq!(again, scene(&now).resolved());
    let sphere = json!({"kind": "surface_pde", "method": {"type": "surface_dcpse", "order": 2}});
    assert_eq!(meniscus::scene::of_earlier_version(sphere.clone(), SCENES), sphere);
}

#[test]
fn odd_clouds_end_in_words_never_in_a_panic() {
    let of = |positions: Vec<[f64; 3]>| Cloud { positions, ..Cloud::default() };
    let line = |step: f64| (0..300).map(|i| [step * f64::from(i), 0.0, 0.0]).collect::<Vec<_>>();
    let mut broken = sphere(500, 1.0, [0.0; 3]);
    broken.positions[3][1] = f64::NAN;
    let clouds = [
        of(Vec::new()),
        of(vec![[1.0, 2.0, 3.0]]),
        of(vec![[1.0, 2.0, 3.0]; 500]),
        of(line(1.0)),
        of(line(1e300)),
        of(line(1e-200)),
        broken,
        sphere(500, 1e200, [0.0; 3]),
        sphere(500, 1.0, [1e14, 0.0, 0.0]),
    ];
    for (k, cloud) in clouds.iter().enumerate() {
        for more in [json!({}), json!({"problem": "laplace_beltrami"})] {
            let said = match build(&body(&more), cloud) {
                Ok(mut simulation) => simulation.step().map_err(|error| error.to_string()),
                Err(found) => Err(found[0].detail.clone()),
            };
            assert!(said.is_err(), "cloud {k}, {more}");
        }
    }
}

#[test]
fn what_points_cannot_do_is_refused_at_its_place() {
    for (more, place) in [
        (json!({"count": 500}), "/count"),
        (json!({"sampling": "random"}), "/sampling"),
        (json!({"normals": "exact"}), "/normals"),
        (json!({"normals": "perturbed"}), "/normals"),
        (json!({"method": "closest_point", "problem": "laplace_beltrami"}), "/method"),
        (json!({"method": {"type": "surface_dcpse", "form": "copies"}}), "/method/form"),
        (json!({"problem": {"type": "poisson", "condition": "dirichlet"}}), "/problem/condition"),
        (json!({"problem": {"type": "poisson", "field": "sin_plus_cos"}}), "/problem/field"),
        (json!({"problem": {"type": "laplace_beltrami", "field": "spherical_harmonic"}}), "/problem/field"),
        (json!({"problem": {"type": "diffusion", "initial": "spherical_harmonic"}}), "/problem/initial"),
        (json!({"problem": {"type": "reaction_diffusion", "manufactured": "plane_wave"}}), "/problem/manufactured"),
        (json!({"surface": "points"}), "/surface"),
        (json!({"surface": {"type": "points", "upload": "a", "file": "b"}}), "/surface"),
        (json!({"surface": "sphere", "normals": "given"}), "/normals"),
        (json!({"method": "conservative"}), "/method"),
        (json!({"problem": "poisson", "solver": "cg"}), "/solver"),
        (json!({"method": {"type": "surface_dcpse", "supports": "ball"}}), "/surface/clean"),
        (json!({"surface": "bump", "method": "auto"}), "/method"),
    ] {
        let found = meniscus::scene::parse(&body(&more), SCENES).err().unwrap();
        assert!(found.iter().any(|v| v.pointer == place), "{more}: {found:?}");
    }
    let sizes = CloudSizes::from([("/surface", 123_456.into())]);
    assert_eq!(scene(&body(&json!({}))).estimate(&sizes).particles, 123_456);
}
