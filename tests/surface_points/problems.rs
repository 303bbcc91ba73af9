//! Problems on points from outside: modes, distances, surfaces in motion, and the triangles of a file.

use super::support::{column, pool};
use super::{bare, body, build, finished, random_sphere, refusal, sphere};
use meniscus::geometry::{Vector, fibonacci};
use meniscus::scene::Cloud;
use meniscus::simulation::{FieldValues, Fields, Selection};
use serde_json::{Value, json};

/// Two parts have two constants; the harmonics of each follow, three times each.
#[test]
fn eigenvalues_are_those_of_all_parts() {
    let [mut cloud, other] = [sphere(1000, 1.0, [0.0; 3]), sphere(500, 0.5, [3.0, 0.0, 0.0])];
    cloud.positions.extend(&other.positions);
    let problem = json!({"type": "eigenvalues", "count": 14});
    for method in ["auto", "conservative"] {
        let simulation = finished(&body(&json!({"problem": problem, "method": method})), &bare(cloud.clone()));
        let found = simulation.report().method["eigenvalues"].clone();
        let values: Vec<f64> = found.split(", ").filter_map(|value| value.parse().ok()).collect();
        // 0 and 0; 2 thrice; 6 five times; of the small one 2/R² = 8 thrice.
        let exact = [0.0, 0.0, 2.0, 2.0, 2.0, 6.0, 6.0, 6.0, 6.0, 6.0, 8.0, 8.0];
        assert_eq!(values.len(), exact.len(), "{found}");
        for (value, exact) in values.iter().zip(exact) {
            assert!((value - exact).abs() < 0.02 * exact + 1e-8, "{method}: {found}");
        }
        assert!(
            simulation.health().checks.iter().any(|check| check.name == "mode_residual" && check.holds == Some(true))
        );
    }
}

/// A half sphere whose edge holds zero has the harmonics that are odd in z alone.
#[test]
fn modes_are_zero_where_an_edge_holds_zero() {
    let whole = fibonacci::sphere(3000);
    let ring = (0..97).map(|k| std::f64::consts::TAU * f64::from(k) / 97.0).map(|a| [a.cos(), a.sin(), 0.0]);
    let above = whole.iter().filter(|x| x[2] > 0.03).map(|x| [x[0], x[1], x[2]]);
    let cloud = Cloud { positions: above.chain(ring).collect(), ..Cloud::default() };
    let modes = |edges: Value| {
        let problem = json!({"type": "eigenvalues", "count": 3});
        let simulation = finished(&body(&json!({"problem": problem, "edges": edges})), &cloud);
        let found = simulation.report().method["eigenvalues"].clone();
        found.split(", ").filter_map(|value| value.parse().ok()).collect::<Vec<f64>>()
    };
    for (edges, exact) in [(json!("neumann"), [0.0, 2.0, 2.0]), (json!("dirichlet"), [2.0, 6.0, 6.0])] {
        let found = modes(edges.clone());
        assert_eq!(found.len(), 3, "{edges}");
        let is_near = |(value, exact): (&f64, &f64)| (value - exact).abs() < 0.02 * exact + 1e-8;
        assert!(found.iter().zip(&exact).all(is_near), "{edges}: {found:?}");
    }
}

/// More modes than points, and a source far from the surface: a run ends, or a person is told.
#[test]
fn what_is_asked_of_too_few_points_is_refused_or_told() {
    let cloud = bare(sphere(150, 1.0, [0.0; 3]));
    let problem = json!({"type": "eigenvalues", "count": 200});
    let refused = build(&body(&json!({"problem": problem, "method": "conservative"})), &cloud).err().unwrap();
    assert_eq!(refused[0].pointer, "/problem/count");
    let problem = json!({"type": "geodesic_distance", "from": [[0, 0, 4]]});
    let found = finished(&body(&json!({"problem": problem})), &cloud).take_findings();
    assert!(found.iter().any(|finding| finding.code == "source_far"), "{found:?}");
}

/// On uneven points a distance is rough, and a person is told so.
#[test]
fn distances_on_random_points_are_doubtful() {
    let problem = json!({"type": "geodesic_distance"});
    for (cloud, is_told) in [(random_sphere(2000), true), (bare(sphere(2000, 1.0, [0.0; 3])), false)] {
        let found = finished(&body(&json!({"problem": problem})), &cloud).take_findings();
        assert_eq!(found.iter().any(|finding| finding.code == "rough_distance"), is_told, "{found:?}");
    }
}

/// A sheet that is pulled apart is torn; a body that a flow turns inside out ends the run.
#[test]
fn surfaces_that_move_too_far_are_told_or_end_the_run() {
    let cloud = bare(sphere(600, 0.15, [0.35; 3]));
    let moving = |motion: Value, end: f64, step: f64| {
        let problem = json!({"type": "moving_diffusion", "motion": motion, "end_time": end, "time_step": step});
        let mut simulation = build(&body(&json!({"problem": problem})), &cloud).unwrap();
        pool(2).install(|| {
            while !simulation.is_finished() {
                if let Err(error) = simulation.step() {
                    return (error.to_string(), simulation);
                }
            }
            (String::new(), simulation)
        })
    };
    let (reason, _) = moving(json!({"type": "normal", "speed": -0.2}), 1.5, 0.05);
    assert!(reason.contains("inside out"), "{reason}");
    let (reason, mut simulation) = moving(json!({"type": "vortex_3d", "period": null}), 2.5, 0.02);
    let told = simulation.take_findings();
    assert!(
        !reason.is_empty() || told.iter().any(|finding| ["torn", "uneven"].contains(&&*finding.code)),
        "{reason} {told:?}"
    );
}

/// Points on parts without a source have no distance, and a person is told so.
#[test]
fn distances_end_where_a_part_ends() {
    let [mut cloud, other] = [sphere(1000, 1.0, [0.0; 3]), sphere(500, 0.5, [3.0, 0.0, 0.0])];
    cloud.positions.extend(&other.positions);
    let problem = json!({"type": "geodesic_distance", "from": [[0, 0, 1.1]]});
    let mut simulation = finished(&body(&json!({"problem": problem})), &bare(cloud.clone()));
    let distance = column(&*simulation, "distance");
    let source = simulation.report().method["sources"].clone();
    let source: usize = source.strip_prefix("points ").unwrap().parse().unwrap();
    let from = Vector::<3>::from(cloud.positions[source]);
    for (x, found) in cloud.positions[..1000].iter().zip(&distance) {
        let exact = from.dot(&Vector::<3>::from(*x)).clamp(-1.0, 1.0).acos();
        assert!((exact - found).abs() < 0.05, "{exact} {found}");
    }
    assert!(distance[1000..].iter().all(|d| d.is_nan()));
    let found = simulation.take_findings();
    assert!(found.iter().any(|finding| finding.code == "unreached" && finding.count == 500), "{found:?}");
}

/// A deforming flow brings a body back: without diffusion the concentration is back, too. Nothing is lost on the way.
#[test]
fn a_concentration_comes_back_with_its_body() {
    let cloud = bare(sphere(2000, 0.15, [0.35; 3]));
    let motion = json!({"type": "vortex_3d", "period": 1});
    let run = |diffusivity: f64, end: f64| {
        let problem = json!({
            "type": "moving_diffusion", "motion": motion, "diffusivity": diffusivity, "end_time": end, "time_step": 0.01,
            "initial": {"type": "plane_wave", "k": [4, 8, -6]}
        });
        finished(&body(&json!({"problem": problem})), &cloud)
    };
    let start = |x: &[f64; 3]| (4.0 * x[0] + 8.0 * x[1] - 6.0 * x[2]).sin();
    let found = column(&*run(0.0, 1.0), "value");
    for (x, value) in cloud.positions.iter().zip(&found) {
        assert!((start(x) - value).abs() < 1e-4, "{} {value}", start(x));
    }
    // Half-way the surface has another area, and diffusion has levelled the concentration; what there is is still there.
    let report = run(1e-3, 0.5).report();
    let mass = report.errors.iter().find(|error| error.quantity == "mass").unwrap();
    assert!(mass.value < 1e-13, "{}", mass.value);
}

/// Triangles that came with points are those of the frames; a corner that was merged is the point that stands for it.
#[test]
fn triangles_of_a_file_stay_those_of_the_surface() {
    let mut cloud = bare(sphere(400, 1.0, [0.0; 3]));
    let first = finished(&body(&json!({})), &cloud).fields(Selection::All).triangles;
    assert_eq!(first.len(), 796);
    // The same triangles as a soup: each has corners of its own.
    let corners = first.as_flattened().iter().map(|corner| cloud.positions[*corner as usize]);
    let soup = Cloud {
        positions: corners.collect(),
        triangles: (0..first.len() as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect(),
        ..Cloud::default()
    };
    let simulation = finished(&body(&json!({})), &soup);
    assert_eq!(simulation.particle_count(), 400);
    assert_eq!(simulation.fields(Selection::All).triangles.len(), 796);
    // Half of them: nothing is added.
    cloud.triangles = first[..398].to_vec();
    assert_eq!(finished(&body(&json!({})), &cloud).fields(Selection::All).triangles.len(), 398);
    cloud.triangles = vec![[0, 1, 400]];
    assert!(refusal(&body(&json!({})), &cloud).contains("triangle 0 names a point"));
}

/// On a torus the larger curvature goes around the tube, 1/r, and the smaller one around the axis, cos θ/(R + r cos θ).
#[test]
fn principal_curvatures_of_a_torus_and_their_directions() {
    for normals in ["exact", "estimated"] {
        let method = json!({"type": "surface_dcpse", "order": 4});
        let given = json!({"kind": "surface_pde", "surface": "torus", "problem": "curvature", "count": 6000, "method": method, "normals": normals});
        let simulation = finished(&given, &Cloud::default());
        let fields = simulation.fields(Selection::All);
        let vectors = |name: &str| match &fields.columns.iter().find(|c| c.name == name).unwrap().values {
            FieldValues::Vector(values) => values.clone(),
            _ => panic!("{name} is no vector a point"),
        };
        let (larger, smaller) = (
            column(simulation.as_ref(), "principal_curvature_1"),
            column(simulation.as_ref(), "principal_curvature_2"),
        );
        let (along, row) = (vectors("principal_direction_2"), vectors("shape_tensor_x"));
        for (i, [x, y, _]) in fields.points.iter().enumerate() {
            let distance = x.hypot(*y);
            let cosine = (distance - 1.0) / 0.4;
            assert!((larger[i] - 2.5).abs() < 2e-2, "{normals} {i}: {}", larger[i]);
            assert!((smaller[i] - cosine / distance).abs() < 2e-2, "{normals} {i}: {}", smaller[i]);
            let around = (along[i][1] * x - along[i][0] * y) / distance;
            assert!(around.abs() > 0.999, "{normals} {i}: {around}");
            // e_x · S e_x = k₁ (v₁·e_x)² + k₂ (v₂·e_x)².
            let first = vectors_at(&fields, "principal_direction_1", i);
            let exact = larger[i] * first[0].powi(2) + smaller[i] * along[i][0].powi(2);
            assert!((row[i][0] - exact).abs() < 2e-2, "{normals} {i}: {} {exact}", row[i][0]);
        }
    }
}

fn vectors_at(fields: &Fields, name: &str, i: usize) -> [f64; 3] {
    match &fields.columns.iter().find(|c| c.name == name).unwrap().values {
        FieldValues::Vector(values) => values[i],
        _ => panic!("{name} is no vector a point"),
    }
}

#[test]
fn gradients_of_a_wave_are_tangential_and_known_on_own_surfaces() {
    let problem = json!({"type": "gradient", "field": {"type": "plane_wave", "k": [2, -1, 3]}});
    let own = json!({"kind": "surface_pde", "problem": problem, "count": 2000});
    let simulation = finished(&own, &Cloud::default());
    let errors = simulation.report().errors;
    // 3.4e-4 measured.
    assert!(errors[0].quantity == "gradient" && errors[0].value < 5e-4, "{errors:?}");
    // On points from outside nothing is exact, and the divergence is that of the wave's operator about.
    let cloud = bare(sphere(2000, 1.0, [0.0; 3]));
    let simulation = finished(&body(&json!({"problem": problem})), &cloud);
    assert!(simulation.report().errors.is_empty());
    let divergence = column(simulation.as_ref(), "divergence");
    let wave = Vector::<3>::new(2.0, -1.0, 3.0);
    let fields = simulation.fields(Selection::All);
    for (i, x) in fields.points.iter().enumerate() {
        let x = Vector::<3>::from(*x);
        let (along, gradient) = (wave.dot(&x), Vector::<3>::from(vectors_at(&fields, "gradient", i)));
        assert!(gradient.dot(&x).abs() < 2e-2 && (gradient - (wave - x * along) * along.cos()).norm() < 2e-2);
        let exact = -(wave.norm_squared() - along * along) * along.sin() - 2.0 * along * along.cos();
        assert!((divergence[i] - exact).abs() < 0.5, "{i}: {} {exact}", divergence[i]);
    }
}
