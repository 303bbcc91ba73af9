use super::{Refinement, Removals, Resampling};
use crate::schemes::grid_based_particle::config::FrontConfig;
use crate::schemes::grid_based_particle::fixtures::{Rest, SPACING, ball, config, feet};
use crate::schemes::grid_based_particle::foot_points::FootPoints;
use crate::schemes::grid_based_particle::laws::{NormalSpeed, PrescribedFlow};
use crate::schemes::grid_based_particle::reconstructor::Reconstructor;
use std::sync::Arc;

/// One resampling of particles on a grid of one level.
fn resampled<const D: usize, const M: usize>(
    mut feet: FootPoints<D>,
    config: &FrontConfig<D, M>,
) -> (FootPoints<D>, Removals) {
    let mut reconstructor = Reconstructor::new(config.method.degree);
    reconstructor.sort(&feet, &config.grid);
    let mut removals = Removals::default();
    let mut resampling = Resampling::default();
    resampling.resample(&mut feet, config, &reconstructor, &Refinement::default(), &mut removals).unwrap();
    (feet, removals)
}

/// A circle and a sphere at rest keep exactly the grid points of their tubes.
#[test]
fn a_front_at_rest_keeps_its_grid_points() {
    let plane = config::<2, 1>(NormalSpeed { speed: 0.0 });
    let (start, center) = (feet(ball::<2>(), &plane), ball::<2>().center);
    let (found, removals) = resampled(start.clone(), &plane);
    let mut nodes = start.nodes.clone();
    nodes.sort_unstable();
    assert_eq!((found.nodes, removals.kept, removals.swept), (nodes, 0, 0));
    assert!(found.positions.iter().all(|x| ((x - center).norm() - 0.4).abs() < 1e-4 * SPACING));
    let space = config::<3, 2>(NormalSpeed { speed: 0.0 });
    let start = feet(ball::<3>(), &space);
    let (found, _) = resampled(start.clone(), &space);
    // Grid points at the very rim of the tube may change sides.
    assert!(found.len().abs_diff(start.len()) < start.len() / 100);
}

#[test]
fn foot_points_lie_within_the_tube_of_their_grid_points() {
    let config = config::<2, 1>(NormalSpeed { speed: 1.0 });
    let mut moved = feet(ball::<2>(), &config);
    let n = moved.normals.clone();
    moved.positions.iter_mut().zip(&n).for_each(|(x, n)| *x += n * (0.7 * SPACING));
    let (found, removals) = resampled(moved, &config);
    for (node, x) in found.nodes.iter().zip(&found.positions) {
        assert!((x - config.grid.place::<2>(*node)).norm() <= 1.1 * SPACING);
        assert!(((x - ball::<2>().center).norm() - 0.4 - 0.7 * SPACING).abs() < 1e-3 * SPACING);
    }
    // A closed front without corners lacks nothing.
    assert_eq!((removals.starved, removals.extrapolated, removals.unresolved, removals.kept), (0, 0, 0, 0));
}

/// Two particles far from all others determine no fit. In a flow they are exact and stay; elsewhere they are what is left of a
/// segment that has collapsed, and go.
#[test]
fn in_a_flow_particles_stay_that_nothing_replaces() {
    let half_with_two = |config: &FrontConfig<2, 1>| {
        let mut front = feet(ball::<2>(), config);
        let mut heights: Vec<f64> = front.positions.iter().map(|x| x[1]).collect();
        heights.sort_by(f64::total_cmp);
        let second = heights[heights.len() - 2];
        let keep: Vec<bool> = front.positions.iter().map(|x| x[1] < 0.5 || x[1] >= second).collect();
        front.retain(&keep);
        front
    };
    let above = |feet: &FootPoints<2>| feet.positions.iter().filter(|x| x[1] > 0.8).copied().collect::<Vec<_>>();
    let flow = config::<2, 1>(PrescribedFlow::new(Arc::new(Rest)));
    let start = half_with_two(&flow);
    let (found, removals) = resampled(start.clone(), &flow);
    assert!(removals.kept >= 2, "{removals:?}");
    assert_eq!(above(&found), above(&start));
    let moving = config::<2, 1>(NormalSpeed { speed: 0.0 });
    let (found, removals) = resampled(half_with_two(&moving), &moving);
    assert!(above(&found).is_empty() && removals.kept == 0);
}

#[test]
fn particles_beyond_the_grid_are_counted() {
    let config = config::<2, 1>(NormalSpeed { speed: 1.0 });
    let mut lost = feet(ball::<2>(), &config);
    lost.positions[0] *= 1e12;
    let (_, removals) = resampled(lost, &config);
    assert_eq!(removals.outside, 1);
}
