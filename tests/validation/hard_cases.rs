//! Particles that the scenes do not make: whatever comes, nothing panics or hangs, and a distance that is wrong has a
//! count in the report.

use meniscus::closest_point::method::NeighborhoodChoice;
use meniscus::closest_point::{ClosestPoint, ClosestPoints, PcpMethod, Redistancing};
use meniscus::geometry::domain::Axis;
use meniscus::geometry::lattice::Lattice;
use meniscus::geometry::{Domain, Vector};
use meniscus::parallel::Interrupt;
use meniscus::polynomials::{BasisKind, Solver};

fn method() -> PcpMethod {
    PcpMethod {
        degree: 4,
        basis: BasisKind::Minter,
        neighborhood: NeighborhoodChoice::Radius { cutoff_h: 2.5 },
        solver: Solver::Moments,
        same_branch: true,
        weight: 2.0,
        minimum_ratio: 1.5,
        sample_threshold_h: 1.5,
        tolerance: 1e-14,
        max_iterations: 1000,
    }
}

fn lattice<const D: usize>(
    spacing: f64,
    jitter: f64,
    half: f64,
    reach: f64,
    distance: impl Fn(&Vector<D>) -> f64,
) -> Vec<Vector<D>> {
    let corner = Vector::<D>::repeat(half);
    Lattice { spacing, offset: 0.5, jitter, seed: 5 }.points_near(
        &-corner,
        &corner,
        reach,
        distance,
        &Interrupt::default(),
    )
}

struct Case<const D: usize> {
    domain: Domain<D>,
    points: Vec<Vector<D>>,
    level: Vec<f64>,
    spacing: f64,
}

impl<const D: usize> Case<D> {
    fn surface(&self) -> Redistancing<D> {
        let never = Interrupt::default();
        let mut surface = Redistancing::new(method(), self.domain.clone(), self.spacing);
        surface.detect(&self.points, &self.level, &never).unwrap();
        surface.fit_samples(&self.points, &self.level, None, &never).unwrap();
        surface
    }

    /// The answers for all particles, and how many the report counts as rescued.
    fn solve(&self) -> (Vec<(usize, ClosestPoint<D>)>, u64) {
        let surface = self.surface();
        let mut answers = ClosestPoints::default();
        surface.closest_points(&self.points, f64::INFINITY, &mut answers, &Interrupt::default()).unwrap();
        let rescued = ["fits.lower_degree", "fits.none", "samples.not_projected", "queries.sample_distance"];
        let entries = surface.fit_diagnostics().counts.entries();
        let count = entries.iter().filter(|(name, _)| rescued.contains(name)).map(|(_, count)| count).sum();
        let answers: Vec<_> = answers.iter().map(|(i, answer)| (i, *answer)).collect();
        // Every sample that stands in for a closest point is counted, and counted once.
        let samples = answers.iter().filter(|(_, answer)| answer.is_sample).count() as u64;
        assert!(entries.contains(&("queries.sample_distance", samples)), "{samples} samples, {entries:?}");
        assert!(entries.contains(&("newton.solves", answers.len() as u64)));
        // A query that is solved beside others gets the bits of being solved alone.
        for (i, answer) in answers.iter().step_by(answers.len() / 1000 + 1) {
            assert_eq!(surface.query(&self.points[*i], f64::INFINITY), Some(*answer));
        }
        (answers, count)
    }

    /// The largest error of the distance, over particles that the exact distance is known for.
    fn worst(&self, exact: impl Fn(&Vector<D>) -> f64) -> (f64, u64) {
        let (answers, rescued) = self.solve();
        assert_eq!(answers.len(), self.points.len());
        let error = |(i, a): &(usize, ClosestPoint<D>)| {
            assert!(a.distance.is_finite() && a.normal.iter().all(|c| c.is_finite()));
            (a.distance - exact(&self.points[*i]).abs()).abs()
        };
        (answers.iter().map(error).fold(0.0, f64::max), rescued)
    }
}

fn circle(center: [f64; 2], radius: f64) -> impl Fn(&Vector<2>) -> f64 {
    move |x| (x - Vector::<2>::from(center)).norm() - radius
}

#[test]
fn a_level_of_exactly_zero_on_particles() {
    // The lattice is turned so that particles lie on the line exactly.
    let points = lattice::<2>(0.1, 0.0, 1.0, 1.0, |_| 0.0);
    let level: Vec<f64> = points.iter().map(|x| x[0] - points[5][0]).collect();
    assert!(level.iter().filter(|l| **l == 0.0).count() > 5);
    let at = points[5][0];
    let case = Case { domain: Domain::unbounded(), points, level, spacing: 0.1 };
    let (worst, rescued) = case.worst(|x| x[0] - at);
    assert!(worst < 1e-13 && rescued == 0, "{worst}, {rescued}");
}

#[test]
fn duplicate_particles() {
    let distance = circle([0.01, -0.02], 0.5);
    let mut points = lattice(0.05, 0.3, 1.0, 0.4, &distance);
    let twice: Vec<_> = points.iter().step_by(3).copied().collect();
    points.extend(twice);
    let level = points.iter().map(&distance).collect();
    let case = Case { domain: Domain::unbounded(), points, level, spacing: 0.05 };
    let (worst, _) = case.worst(&distance);
    assert!(worst < 2e-4, "{worst}");
    // Every particle at one place: no fit, no panic.
    let heap = Case {
        domain: Domain::unbounded(),
        points: vec![Vector::<2>::new(0.3, 0.3); 50],
        level: (0..50).map(|k| f64::from(k) - 24.5).collect(),
        spacing: 0.05,
    };
    assert!(heap.surface().is_lost());
    assert!(heap.solve().0.is_empty());
}

#[test]
fn one_particle_and_none() {
    for points in [vec![], vec![Vector::<3>::new(1.0, 2.0, 3.0)]] {
        let level = vec![-1.0; points.len()];
        let case = Case { domain: Domain::unbounded(), points, level, spacing: 0.1 };
        assert!(case.surface().is_lost());
        assert!(case.surface().query(&Vector::<3>::zeros(), f64::INFINITY).is_none());
    }
}

#[test]
fn queries_at_the_medial_axis() {
    let distance = circle([0.0, 0.0], 0.5);
    let points = lattice(0.05, 0.3, 1.0, 0.3, &distance);
    let level = points.iter().map(&distance).collect();
    let case = Case { domain: Domain::unbounded(), points, level, spacing: 0.05 };
    let surface = case.surface();
    // The centre of the circle and points about it: every point of the circle is nearly as close.
    for offset in [0.0, 1e-12, 1e-6, 1e-3] {
        let x = Vector::<2>::new(offset, -0.5 * offset);
        let found = surface.query(&x, f64::INFINITY).unwrap();
        assert!((found.distance - 0.5 + x.norm()).abs() < 1e-3, "{} at {offset}", found.distance);
        assert!(!found.is_outside);
    }
}

#[test]
fn a_band_across_a_periodic_edge() {
    let axis = Axis::Periodic { start: -1.0, length: 2.0 };
    let domain = Domain::new([axis; 2]);
    // A circle about a corner of the box: its parts lie at all four.
    let distance = |x: &Vector<2>| domain.displacement(&Vector::<2>::new(1.0, 1.0), x).norm() - 0.4;
    let points = lattice(0.05, 0.3, 1.0, 0.3, distance);
    let level: Vec<f64> = points.iter().map(distance).collect();
    let case = Case { domain: domain.clone(), points, level, spacing: 0.05 };
    let (worst, rescued) = case.worst(distance);
    assert!(worst < 2e-4 && rescued == 0, "{worst}, {rescued}");
    let (answers, _) = case.solve();
    for (_, answer) in answers {
        assert!(answer.point.iter().all(|c| (-1.0..1.0).contains(c)), "{:?}", answer.point);
        let normal = domain.displacement(&Vector::<2>::new(1.0, 1.0), &answer.point).normalize();
        assert!((answer.normal - normal).norm() < 1e-2);
    }
}

#[test]
fn a_band_that_ends_at_the_edge_of_the_particles() {
    // Only the part of the circle with x < 0.2 has particles: its end is a one-sided cloud.
    let distance = circle([0.0, 0.0], 0.5);
    let mut points = lattice(0.05, 0.3, 1.0, 0.3, &distance);
    points.retain(|x| x[0] < 0.2);
    let level = points.iter().map(&distance).collect();
    let case = Case { domain: Domain::unbounded(), points, level, spacing: 0.05 };
    let (answers, _) = case.solve();
    for (i, answer) in answers {
        // Distances to the part that is there are never too short, and right where the foot is well inside.
        let (exact, foot) = (distance(&case.points[i]).abs(), case.points[i].normalize() * 0.5);
        assert!(answer.distance > exact - 5e-3, "{} for {exact}", answer.distance);
        assert!(foot[0] > 0.1 || (answer.distance - exact).abs() < 1e-3, "{} for {exact}", answer.distance);
    }
}

#[test]
fn the_most_distorted_lattice() {
    let distance = circle([0.013, 0.007], 0.5);
    let points = lattice(0.025, 0.49, 1.0, 0.2, &distance);
    let level = points.iter().map(&distance).collect();
    let case = Case { domain: Domain::unbounded(), points, level, spacing: 0.025 };
    let (worst, rescued) = case.worst(&distance);
    assert!(worst < 3e-6 && rescued == 0, "{worst}, {rescued}");
}

#[test]
fn values_that_are_no_numbers_lose_their_fits_and_nothing_else() {
    let distance = circle([0.0, 0.0], 0.5);
    let points = lattice(0.05, 0.3, 1.0, 0.3, &distance);
    let mut level: Vec<f64> = points.iter().map(&distance).collect();
    let broken = points.iter().position(|x| x[0] > 0.45 && distance(x).abs() < 0.02).unwrap();
    level[broken] = f64::NAN;
    let case = Case { domain: Domain::unbounded(), points, level, spacing: 0.05 };
    let (answers, rescued) = case.solve();
    assert!(rescued > 0);
    let wrong = |(i, a): &&(usize, ClosestPoint<2>)| {
        let x = case.points[*i];
        x[0] < 0.0 && (a.distance - distance(&x).abs()).abs() > 2e-4
    };
    assert_eq!(answers.iter().filter(wrong).count(), 0);
}

#[test]
fn a_million_particles_in_space() {
    let distance = |x: &Vector<3>| x.norm() - 0.61;
    let points = lattice(0.0095, 0.3, 1.0, 0.095, distance);
    assert!(points.len() > 1_000_000, "{}", points.len());
    let level = points.iter().map(distance).collect();
    let case = Case { domain: Domain::unbounded(), points, level, spacing: 0.0095 };
    let (worst, rescued) = case.worst(distance);
    assert!(worst < 1e-7 && rescued == 0, "{worst}, {rescued}");
}
