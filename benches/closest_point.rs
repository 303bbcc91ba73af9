//! Costs of closest-point redistancing and its parts: `cargo bench`. Figures are reported, never asserted.
//!
//! Set-ups are those of spec/scenes.md: the ellipse (.75, .5) at h = 1/128 with w = 13 h and r_c = 2.8 h, the ellipsoid
//! (.75, .5, .5) at h = 1/64 with w = 12 h and r_c = 2.4 h. Run on one pinned core with one thread:
//! `RAYON_NUM_THREADS=1 taskset -c 1 cargo bench`.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use meniscus::closest_point::method::NeighborhoodChoice;
use meniscus::closest_point::{ClosestPoints, PcpMethod, Redistancing};
use meniscus::geometry::lattice::Lattice;
use meniscus::geometry::surfaces::Ellipsoid;
use meniscus::geometry::{Domain, Surface, Vector};
use meniscus::neighbors::CellList;
use meniscus::parallel::Interrupt;
use meniscus::polynomials::{BasisKind, Solver};
use std::hint::black_box;

/// Particles in the band with the quadric √(Σ x²/A²) − 1 as level.
struct Setup<const D: usize> {
    positions: Vec<Vector<D>>,
    level: Vec<f64>,
    spacing: f64,
    method: PcpMethod,
}

fn setup<const D: usize>(cells: f64, band_h: f64, cutoff_h: f64, solver: Solver) -> Setup<D> {
    let spacing = 1.0 / cells;
    let semi_axes = Vector::<D>::from_fn(|d, _| if d == 0 { 0.75 } else { 0.5 });
    let surface = Ellipsoid { center: Vector::<D>::zeros(), semi_axes };
    let lattice = Lattice { spacing, offset: 0.0, jitter: 0.3, seed: 1 };
    let half_band = 0.5 * band_h * spacing;
    let corner = Vector::<D>::repeat(0.75 + half_band + spacing);
    let never = Interrupt::default();
    let positions = lattice.points_near(&-corner, &corner, half_band, |x| surface.signed_distance(x), &never);
    let level = positions.iter().map(|x| x.component_div(&semi_axes).norm() - 1.0).collect();
    let method = PcpMethod {
        degree: 4,
        basis: BasisKind::Minter,
        neighborhood: NeighborhoodChoice::Radius { cutoff_h },
        solver,
        same_branch: false,
        weight: 2.0,
        minimum_ratio: 1.5,
        sample_threshold_h: 1.5,
        tolerance: 1e-14,
        max_iterations: 1000,
    };
    Setup { positions, level, spacing, method }
}

fn redistancing<const D: usize>(c: &mut Criterion, name: &str, setup: &Setup<D>) {
    let Setup { positions, level, spacing, method } = setup;
    let never = Interrupt::default();
    let mut surface = Redistancing::<D>::new(method.clone(), Domain::unbounded(), *spacing);
    let mut answers = ClosestPoints::default();
    // Every part finds what the parts before it leave, also when it is run alone.
    assert!(surface.detect(positions, level, &never).is_ok());
    assert!(surface.fit_samples(positions, level, None, &never).is_ok());
    let mut group = c.benchmark_group(name);
    group.throughput(Throughput::Elements(positions.len() as u64));
    group.bench_function("cell list", |b| {
        let mut cells = CellList::new(Domain::unbounded());
        b.iter(|| cells.rebuild(black_box(positions).iter().copied(), 1.5 * spacing));
    });
    group.bench_function("detection", |b| b.iter(|| surface.detect(black_box(positions), level, &never)));
    group.bench_function("regression", |b| b.iter(|| surface.fit_samples(black_box(positions), level, None, &never)));
    group.bench_function("query", |b| {
        b.iter(|| surface.closest_points(black_box(positions), f64::INFINITY, &mut answers, &never));
    });
    group.bench_function("whole", |b| {
        b.iter(|| -> Result<(), meniscus::parallel::Interrupted> {
            surface.detect(black_box(positions), level, &never)?;
            surface.fit_samples(positions, level, None, &never)?;
            surface.closest_points(positions, f64::INFINITY, &mut answers, &never)
        });
    });
    group.finish();
}

fn plane(c: &mut Criterion) {
    redistancing(c, "2d", &setup::<2>(128.0, 13.0, 2.8, Solver::Moments));
    redistancing(c, "2d orthogonal", &setup::<2>(128.0, 13.0, 2.8, Solver::Orthogonal));
}

fn space(c: &mut Criterion) {
    redistancing(c, "3d", &setup::<3>(64.0, 12.0, 2.4, Solver::Moments));
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10).warm_up_time(std::time::Duration::from_millis(500));
    targets = plane, space
}
criterion_main!(benches);
