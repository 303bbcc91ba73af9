use super::{Examined, Flaw, NormalSource, Unusable, unit_normals};
use crate::geometry::random::CounterRandom;
use crate::geometry::{Vector, fibonacci};
use crate::point_clouds::normals;
use std::f64::consts::{PI, TAU};

fn spacing(count: usize) -> f64 {
    (4.0 * PI / count as f64).sqrt()
}

/// Flaws of points with given or estimated normals, for supports of a number of spacings.
fn flaws<const D: usize>(points: &[Vector<D>], given: Option<&[Vector<D>]>, cutoff: f64) -> Vec<Flaw> {
    let examined = Examined::new(points).unwrap();
    let radius = cutoff * examined.spacing;
    match given {
        Some(given) => examined.flaws(&mut unit_normals(given).unwrap(), NormalSource::Given, radius),
        None => {
            let mut estimated = normals::estimate(points, examined.radius_of_normals()).unwrap();
            let before = estimated.clone();
            let found = examined.flaws(&mut estimated, NormalSource::Estimated, radius);
            assert_eq!(estimated, before);
            found
        }
    }
}

/// A square lattice of spacing 1 with 40 points per side and a small jitter.
fn sheet(height: f64, seed: u64) -> Vec<Vector<3>> {
    let random = CounterRandom::new(seed);
    let off = |i: i64, d: i64| 0.1 * random.symmetric(&[i, d]);
    let at = |i: i64| Vector::<3>::new((i % 40) as f64 + off(i, 0), (i / 40) as f64 + off(i, 1), height);
    (0..1600).map(at).collect()
}

#[test]
fn clean_spheres_and_circles_have_no_flaws_and_their_spacing_is_known() {
    for count in [300, 2000, 9000] {
        let points = fibonacci::sphere(count);
        let found = Examined::new(&points).unwrap().spacing / spacing(count);
        assert!((found - 1.0).abs() < 0.03, "{count}: {found}");
        for cutoff in [2.4, 4.2] {
            assert_eq!(flaws(&points, Some(&points), cutoff), [], "{count}");
            assert_eq!(flaws(&points, None, cutoff), [], "{count}");
        }
    }
    let angle = |i: i32| TAU * f64::from(i) / 200.0;
    let circle: Vec<_> = (0..200).map(angle).map(|a| Vector::<2>::new(a.cos(), a.sin())).collect();
    assert!((Examined::new(&circle).unwrap().spacing / (TAU / 200.0) - 1.0).abs() < 0.03);
    assert_eq!(flaws(&circle, Some(&circle), 5.4), []);
    assert_eq!(flaws(&circle, None, 5.4), []);
}

#[test]
fn holes_are_where_they_were_cut() {
    let points: Vec<_> = fibonacci::sphere(4000).into_iter().filter(|x| x[2] < 0.95).collect();
    let found = flaws(&points, None, 2.4);
    let [Flaw::Holes(named)] = found.as_slice() else { panic!("{found:?}") };
    // The rim has the length 2π·0.31, and each of its points takes about 0.056 of it.
    assert!((20..60).contains(&named.count), "{named:?}");
    assert!(named.first.iter().all(|i| points[*i][2] > 0.9), "{named}");
    let arc: Vec<_> = (0..100).map(|i| 0.03 * f64::from(i)).map(|a| Vector::<2>::new(a.cos(), a.sin())).collect();
    let ends = flaws(&arc, Some(&arc), 3.4);
    assert_eq!(ends[0].to_string().split(':').next(), Some("points 0, 99"), "{ends:?}");
}

#[test]
fn sheets_closer_than_the_support_are_found_whichever_way_they_face() {
    let mut points = sheet(0.0, 1);
    points.extend(sheet(1.5, 2));
    for upper in [1.0, -1.0] {
        let up = |z: f64| Vector::<3>::new(0.0, 0.0, z);
        let given: Vec<_> = (0..3200).map(|i| up(if i < 1600 { -1.0 } else { upper })).collect();
        let found = flaws(&points, Some(&given), 2.4);
        let sheets = found.iter().find(|flaw| flaw.name() == "close_sheets");
        let Some(Flaw::CloseSheets { points: named, .. }) = sheets else { panic!("{found:?}") };
        assert!(named.count > 3100, "{named}");
        assert!(found.iter().all(|flaw| flaw.name() != "inconsistent_normals"), "{found:?}");
    }
    assert!(flaws(&points, None, 2.4).iter().any(|flaw| flaw.name() == "close_sheets"));
    // Sheets that are far enough apart have flaws at their edges only.
    let mut points = sheet(0.0, 1);
    points.extend(sheet(4.5, 2));
    let names: Vec<_> = flaws(&points, None, 2.4).iter().map(Flaw::name).collect();
    assert_eq!(names, ["holes"]);
}

#[test]
fn normals_that_contradict_the_points_are_named() {
    let points = fibonacci::sphere(2000);
    let mut given = points.clone();
    for i in [7, 500, 1999] {
        given[i] = -3.0 * given[i];
    }
    given[1200] = given[1200].cross(&Vector::<3>::x());
    let found = flaws(&points, Some(&given), 3.3);
    let [Flaw::InconsistentNormals(named)] = found.as_slice() else { panic!("{found:?}") };
    assert_eq!((named.to_string().as_str(), named.count), ("points 7, 500, 1200, 1999", 4));
    // Inconsistent normals are replaced.
    let examined = Examined::new(&points).unwrap();
    let mut mended = unit_normals(&given).unwrap();
    examined.flaws(&mut mended, NormalSource::Given, 3.3 * examined.spacing);
    assert!(points.iter().zip(&mended).all(|(x, n)| x.dot(n) > 0.999));
    assert_eq!(examined.flaws(&mut mended, NormalSource::Given, 3.3 * examined.spacing), []);
    // Normals that all point inward are consistent.
    let inward: Vec<_> = points.iter().map(|x| -x).collect();
    assert_eq!(flaws(&points, Some(&inward), 3.3), []);
    given[3] = Vector::<3>::zeros();
    given[4] = Vector::<3>::new(f64::NAN, 0.0, 1.0);
    let refused = unit_normals(&given).unwrap_err();
    assert!(refused.to_string().starts_with("points 3, 4:"), "{refused}");
    given[3] = Vector::<3>::new(1e-200, 0.0, 0.0);
    given[4] = Vector::<3>::new(0.0, f64::MAX, f64::MAX);
    assert!(unit_normals(&given).unwrap().iter().all(|n| (n.norm() - 1.0).abs() < 1e-14));
}

#[test]
fn points_in_one_place_are_refused_by_their_numbers() {
    let mut points = fibonacci::sphere(1000);
    points.push(points[17]);
    let refused = Examined::new(&points).unwrap_err();
    let Unusable::Duplicates { points: named, pair, distance } = &refused else { panic!("{refused}") };
    assert_eq!((named.first.as_slice(), *pair, *distance), ([17, 1000].as_slice(), [17, 1000], 0.0));
    points[1000] += Vector::<3>::repeat(1e-6);
    let refused = Examined::new(&points).unwrap_err();
    assert!(refused.to_string().starts_with("points 17, 1000:"), "{refused}");
    // A close point that is distinct.
    points[1000] += Vector::<3>::repeat(1e-2);
    assert!(Examined::new(&points).is_ok());
    let all_alike = Examined::new(&[Vector::<3>::repeat(2.0); 9000]).unwrap_err().to_string();
    assert!(all_alike.starts_with("points 0, 1, 2, 3, 4 and 8995 more"), "{all_alike}");
}

#[test]
fn unusable_clouds_are_refused_with_their_reason() {
    let one = Examined::new(&[Vector::<3>::zeros()]).unwrap_err();
    assert_eq!(one, Unusable::TooFew { count: 1, least: 13 });
    let line: Vec<_> = (0..100).map(|i| Vector::<3>::new(f64::from(i), 0.0, 0.0)).collect();
    let found = flaws(&line, None, 2.4);
    assert!(matches!(&found[0], Flaw::Holes(named) if named.count == 100), "{found:?}");
    let scaled = |factor: f64, shift: f64| -> Vec<_> {
        fibonacci::sphere(100).iter().map(|x| (x * factor).add_scalar(shift)).collect()
    };
    for (factor, shift) in [(1e200, 0.0), (1e-160, 0.0), (1e308, 0.0), (1.0, 1e12)] {
        let refused = Examined::new(&scaled(factor, shift)).unwrap_err();
        assert!(matches!(refused, Unusable::OutOfScale { .. } | Unusable::Duplicates { .. }), "{refused}");
    }
    for factor in [1e30, 1e-30] {
        assert!(flaws(&scaled(factor, 0.0), None, 2.4).is_empty());
    }
    let mut far = fibonacci::sphere(6000);
    far.insert(77, Vector::<3>::repeat(1e6));
    let refused = Examined::new(&far).unwrap_err().to_string();
    assert!(refused.contains("point 77 at"), "{refused}");
}
