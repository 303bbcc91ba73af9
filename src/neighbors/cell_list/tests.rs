use super::{Axis, CellList, Domain, NeighborSearch, Vector};
use crate::geometry::random::CounterRandom;
use crate::neighbors::BruteForce;

fn domains<const D: usize>() -> Vec<Domain<D>> {
    let periodic = Axis::Periodic { start: -1.0, length: 2.0 };
    let mut mixed = [Axis::Unbounded; D];
    mixed[0] = periodic;
    vec![Domain::unbounded(), Domain::new([periodic; D]), Domain::new(mixed)]
}

fn cloud<const D: usize>(n: i64, seed: u64) -> Vec<Vector<D>> {
    let random = CounterRandom::new(seed);
    (0..n).map(|i| Vector::<D>::from_fn(|d, _| random.symmetric(&[i, d as i64]))).collect()
}

fn within<const D: usize>(search: &impl NeighborSearch<D>, x: &Vector<D>, radius: f64) -> Vec<(usize, u64)> {
    let mut found = Vec::new();
    search.for_each_within(x, radius, |j, _, r2| found.push((j, r2.to_bits())));
    found.sort_unstable();
    found
}

fn compare<const D: usize>(points: &[Vector<D>], queries: &[Vector<D>], radius: f64) {
    for domain in domains::<D>() {
        let wrapped: Vec<Vector<D>> = points.iter().map(|x| domain.wrap(*x)).collect();
        let oracle = BruteForce { domain: &domain, points: &wrapped };
        for edge in [0.05, radius * 0.9999, radius, radius * 1.0001, 0.9, 7.0] {
            let mut cells = CellList::new(domain.clone());
            cells.rebuild(points.iter().copied(), edge);
            for x in queries {
                let x = domain.wrap(*x);
                for r in [radius * 0.9999, radius, radius * 1.0001] {
                    assert_eq!(within(&cells, &x, r), within(&oracle, &x, r), "edge {edge}, radius {r}");
                }
                let (a, b) = (cells.nearest(&x, 0.3), oracle.nearest(&x, 0.3));
                assert_eq!(a, b, "edge {edge} at {x:?}");
                let nearest = oracle.nearest(&x, 1e9);
                assert_eq!(cells.nearest(&x, 1e9), nearest);
                for seed in [0, points.len() / 2] {
                    let known = (seed, domain.displacement(&x, &wrapped[seed]).norm_squared());
                    let (index, r2) = cells.nearest_from(&x, known);
                    assert_eq!(Some((index, r2.sqrt())), nearest, "from {seed}, edge {edge} at {x:?}");
                }
                let mut found = Vec::new();
                cells.gather(&x, radius, &mut found);
                let mut gathered: Vec<_> = found.iter().map(|n| (n.index, n.r2.to_bits())).collect();
                gathered.sort_unstable();
                assert_eq!(gathered, within(&oracle, &x, radius));
            }
        }
    }
}

#[test]
fn agrees_with_brute_force_in_2d_and_3d() {
    compare::<2>(&cloud(400, 1), &cloud(60, 2), 0.31);
    compare::<3>(&cloud(400, 3), &cloud(40, 4), 0.31);
}

#[test]
fn agrees_for_lattices_whose_neighbors_lie_exactly_on_the_radius() {
    let points: Vec<Vector<2>> =
        (0..256).map(|k| Vector::<2>::new(f64::from(k % 16) / 8.0 - 1.0, f64::from(k / 16) / 8.0 - 1.0)).collect();
    compare::<2>(&points, &points[..64], 0.25);
}

#[test]
fn box_edges_one_ulp_apart_and_far_outliers() {
    let mut points = cloud::<2>(50, 5);
    for edge in [-1.0_f64, 1.0] {
        points.push(Vector::<2>::new(edge, edge));
        points.push(Vector::<2>::new(edge.next_up(), edge.next_down()));
    }
    points.push(Vector::<2>::new(1e6, -1e6));
    compare::<2>(&points, &points.clone(), 0.31);
}

#[test]
fn empty_and_single() {
    let mut cells = CellList::<3>::new(Domain::unbounded());
    cells.rebuild(std::iter::empty(), 0.1);
    assert_eq!(cells.nearest(&Vector::<3>::zeros(), 1e9), None);
    cells.rebuild([Vector::<3>::new(5.0, 5.0, 5.0)].into_iter(), 0.1);
    assert_eq!(cells.nearest(&Vector::<3>::new(5.0, 5.0, 1.0), 1e9), Some((0, 4.0)));
}

/// Of a box in shear, cells find what all points of the box and their images tell.
fn compare_tilted<const D: usize>(offset: f64) {
    let axes = std::array::from_fn(|d| Axis::Periodic { start: -1.0, length: 2.0 + 0.5 * d as f64 });
    for axis in 1..D {
        let domain = Domain::new(axes).tilted(axis, offset);
        let points: Vec<Vector<D>> = cloud::<D>(300, 5).iter().map(|x| domain.wrap(x * 1.2)).collect();
        let oracle = BruteForce { domain: &domain, points: &points };
        for edge in [0.1, 0.31, 0.9] {
            let mut cells = CellList::new(Domain::new(axes));
            cells.set_domain(&domain);
            cells.rebuild(points.iter().copied(), edge);
            for x in cloud::<D>(60, 6) {
                let indices = |search: Vec<(usize, u64)>| search.into_iter().map(|(j, _)| j).collect::<Vec<_>>();
                assert_eq!(indices(within(&cells, &x, 0.37)), indices(within(&oracle, &x, 0.37)), "{offset}: {x}");
                let (index, nearest) = oracle.nearest(&x, 0.9).unwrap();
                let found = cells.nearest(&x, 0.9).unwrap();
                assert!(found.0 == index && (found.1 - nearest).abs() < 1e-14);
                let known = (7, domain.displacement(&x, &points[7]).norm_squared());
                assert_eq!(cells.nearest_from(&x, known).0, index);
                assert!(
                    cells.any_within(&x, nearest * 1.001, |_| true) && !cells.any_within(&x, nearest * 0.999, |_| true)
                );
            }
        }
    }
}

#[test]
fn in_a_sheared_box_images_are_found_where_they_have_slid_to() {
    for offset in [0.0, 0.3, -0.97, 1.0] {
        compare_tilted::<2>(offset);
        compare_tilted::<3>(offset);
    }
}
