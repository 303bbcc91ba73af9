use super::{Cleaning, NormalSource, PreparedCloud, Unusable};
use crate::geometry::random::CounterRandom;
use crate::geometry::{Vector, fibonacci};

fn random_sphere(count: i64) -> Vec<Vector<3>> {
    let random = CounterRandom::new(9);
    let draw = |i: i64| Vector::<3>::from_fn(|d, _| random.symmetric(&[i, d as i64]));
    (0..).map(draw).filter(|x| (0.1..1.0).contains(&x.norm())).map(|x| x.normalize()).take(count as usize).collect()
}

#[test]
fn independent_random_points_get_normals_and_areas() {
    let points = random_sphere(2000);
    let found = PreparedCloud::new(&points, None, Cleaning::Drop).unwrap();
    assert!(found.points.iter().zip(&found.normals).all(|(x, n)| x.dot(n) > 0.8));
    let area: f64 = found.graph.areas.iter().sum();
    assert!((area / (4.0 * std::f64::consts::PI) - 1.0).abs() < 5e-3, "{area}");
    assert_eq!((found.graph.part_count, found.joined_sheets), (1, None));
}

#[test]
fn wrong_normals_are_replaced_and_good_ones_stay() {
    let points: Vec<Vector<3>> = fibonacci::sphere(2000);
    let swapped: Vec<_> = points.iter().map(|x| Vector::<3>::new(x[0], x[2], x[1])).collect();
    let constant = vec![Vector::<3>::z(); 2000];
    let colors: Vec<_> = (0..2000)
        .map(|i| Vector::<3>::new(f64::from(i % 7) + 1.0, f64::from(i % 11), f64::from(i % 5)).normalize())
        .collect();
    for wrong in [swapped, constant, colors] {
        let found = PreparedCloud::new(&points, Some(&wrong), Cleaning::Drop).unwrap();
        let verdict = found.verdict.unwrap();
        assert!(verdict.is_wrong_together && verdict.wrong_share > 0.3, "{}", verdict.wrong_share);
        assert_eq!(found.source, NormalSource::Estimated);
        assert!(points.iter().zip(&found.normals).all(|(x, n)| x.dot(n) > 0.999));
    }
    let random = CounterRandom::new(4);
    let noise = |i: usize| Vector::<3>::from_fn(|d, _| 0.15 * random.symmetric(&[i as i64, d as i64]));
    let noisy: Vec<_> = points.iter().enumerate().map(|(i, n)| (n + noise(i)).normalize()).collect();
    let found = PreparedCloud::new(&points, Some(&noisy), Cleaning::Drop).unwrap();
    assert_eq!((found.normals == noisy, found.verdict.unwrap().replaced), (true, None));
    // Inward ones stay inward.
    let inward: Vec<_> = points.iter().map(|n| -n).collect();
    let found = PreparedCloud::new(&points, Some(&inward), Cleaning::Drop).unwrap();
    assert_eq!(found.normals, inward);
}

#[test]
fn single_wrong_normals_are_replaced_and_turned_ones_turned() {
    let points: Vec<Vector<3>> = fibonacci::sphere(2000);
    let mut given = points.clone();
    (given[70], given[71]) = (-given[70], Vector::<3>::new(-points[71][1], points[71][0], 0.0).normalize());
    let found = PreparedCloud::new(&points, Some(&given), Cleaning::Drop).unwrap();
    assert!(points.iter().zip(&found.normals).all(|(x, n)| x.dot(n) > 0.999));
    assert_eq!(found.verdict.unwrap().replaced.map(|list| list.first), Some(vec![70, 71]));
    // Signs at random, as of a file whose normals are lines only.
    let random = CounterRandom::new(4);
    let signs: Vec<_> = points.iter().enumerate().map(|(i, n)| n * random.symmetric(&[i as i64]).signum()).collect();
    let found = PreparedCloud::new(&points, Some(&signs), Cleaning::Drop).unwrap();
    assert!(found.verdict.unwrap().is_turned_anew);
    assert!(points.iter().zip(&found.normals).all(|(x, n)| x.dot(n) > 0.999));
}

#[test]
fn halves_of_a_thin_body_face_away_from_each_other() {
    let points: Vec<Vector<3>> =
        fibonacci::sphere(4000).iter().map(|x| Vector::<3>::new(x[0], x[1], 0.07 * x[2])).collect();
    let found = PreparedCloud::new(&points, None, Cleaning::Drop).unwrap();
    let outward = |x: &Vector<3>| Vector::<3>::new(x[0], x[1], x[2] / 0.0049);
    let wrong = found.points.iter().zip(&found.normals).filter(|(x, n)| outward(x).dot(n) < 0.0).count();
    assert!(wrong < 40, "{wrong}");
}

#[test]
fn what_is_no_surface_is_refused() {
    let line: Vec<_> = (0..300).map(|i| Vector::<3>::new(f64::from(i), 0.5 * f64::from(i), 0.0)).collect();
    assert!(matches!(PreparedCloud::new(&line, None, Cleaning::Drop), Err(Unusable::Line { .. })));
    let far: Vec<_> = fibonacci::sphere(500).iter().map(|x: &Vector<3>| x + Vector::<3>::x() * 1e14).collect();
    assert!(PreparedCloud::new(&far, None, Cleaning::Drop).is_err());
    let one = vec![Vector::<3>::x(); 500];
    assert!(matches!(PreparedCloud::new(&one, None, Cleaning::Drop), Err(Unusable::TooFew { count: 1, .. })));
}

#[test]
fn a_place_with_many_points_is_refused_where_they_are_kept() {
    let mut points: Vec<Vector<3>> = fibonacci::sphere(300);
    points.extend(vec![points[0]; 20]);
    let refused = PreparedCloud::new(&points, None, Cleaning::Off).err().unwrap();
    assert!(
        matches!(&refused, Unusable::Stacked(list) if list.count == 21 && list.first[..2] == [0, 300]),
        "{refused}"
    );
    assert!(refused.to_string().contains("\"drop\""));
    assert_eq!(PreparedCloud::new(&points, None, Cleaning::Drop).unwrap().points.len(), 300);
}

/// Two coarse spheres that touch: near the contact no point can be trusted, so that neither piece is closed.
#[test]
fn coarse_bodies_that_touch_face_outward() {
    for (count, radius, gap) in [(200, 1.0, 0.0), (150, 1.0, 0.02), (200, 0.6, 0.0), (250, 0.8, -0.02)] {
        let ball = fibonacci::sphere(count);
        let center = Vector::<3>::new(1.0 + radius + gap, 0.0, 0.0);
        let points: Vec<Vector<3>> = ball.iter().copied().chain(ball.iter().map(|x| x * radius + center)).collect();
        let found = PreparedCloud::new(&points, None, Cleaning::Drop).unwrap();
        let contact = Vector::<3>::x();
        for (i, n) in found.normals.iter().enumerate() {
            let outward = ball[found.kept[i] % count];
            let is_apart = (found.points[i] - contact).norm() > 0.7;
            assert!(!is_apart || n.dot(&outward) > 0.8, "{count} {radius} {gap}: point {i} {}", n.dot(&outward));
        }
    }
}

/// A row of three balls that touch: every body by itself.
#[test]
fn a_row_of_bodies_faces_outward() {
    let ball = fibonacci::sphere(220);
    let centers = [0.0, 2.0, 4.0].map(|x| Vector::<3>::new(x, 0.0, 0.0));
    let points: Vec<Vector<3>> = centers.iter().flat_map(|c| ball.iter().map(move |x| x + c)).collect();
    let found = PreparedCloud::new(&points, None, Cleaning::Drop).unwrap();
    let wrong = (0..points.len()).filter(|i| {
        let is_apart = [1.0, 3.0].iter().all(|x| (found.points[*i] - Vector::<3>::x() * *x).norm() > 0.7);
        is_apart && found.normals[*i].dot(&ball[*i % 220]) < 0.8
    });
    assert_eq!(wrong.count(), 0);
}
