//! Grid points within a distance of a known surface.

use super::grid::Grid;
use crate::geometry::{Surface, Vector};

/// One level of a grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct GridLevel {
    pub grid: Grid,
    pub level: u32,
}

impl GridLevel {
    /// A grid with one level of the given spacing.
    pub fn with_spacing(spacing: f64) -> Self {
        Self { grid: Grid { spacing }, level: 0 }
    }

    /// h of the level.
    pub fn spacing(&self) -> f64 {
        self.grid.spacing_at(self.level)
    }
}

/// Calls `visit` for the grid points of a level within `radius` of a surface, with their coordinates and positions.
///
/// Boxes of grid points are halved as long as the surface may pass through them.
pub(super) fn for_each_near<const D: usize>(
    surface: &dyn Surface<D>,
    radius: f64,
    GridLevel { grid, level }: GridLevel,
    mut visit: impl FnMut(&[i64; D], Vector<D>),
) {
    let (low, high) = surface.bounding_box();
    let spacing = grid.spacing_at(level);
    let margin = radius + spacing;
    let corner = |x: &Vector<D>, side: f64| grid.nearest(&x.add_scalar(side), level);
    let (Some(low), Some(high)) = (corner(&low, -margin), corner(&high, margin)) else { return };
    let mut boxes = vec![(low, high)];
    while let Some((low, high)) = boxes.pop() {
        let (first, last) = (grid.center(&low, level), grid.center(&high, level));
        let center = (first + last) * 0.5;
        let half = 0.5 * (last - first).norm();
        if surface.signed_distance(&center).abs() > half * (1.0 + 1e-12) + radius {
            continue;
        }
        let longest = (0..D).fold(0, |best, d| if high[d] - low[d] > high[best] - low[best] { d } else { best });
        if high[longest] == low[longest] {
            visit(&low, center);
            continue;
        }
        let middle = low[longest] + (high[longest] - low[longest]) / 2;
        let (mut below, mut above) = (high, low);
        below[longest] = middle;
        above[longest] = middle + 1;
        boxes.push((low, below));
        boxes.push((above, high));
    }
}

#[cfg(test)]
mod tests {
    use super::{GridLevel, for_each_near};
    use crate::geometry::surfaces::Ball;
    use crate::geometry::{Surface, Vector};
    use crate::schemes::grid_based_particle::Grid;

    #[test]
    fn the_grid_points_are_those_of_a_scan_of_the_whole_box() {
        let ball = Ball { center: Vector::<2>::new(0.1, -0.2), radius: 0.4 };
        for level in [0, 2] {
            let place = GridLevel { grid: Grid { spacing: 0.13 }, level };
            let radius = 1.1 * place.spacing();
            let mut found = Vec::new();
            for_each_near(&ball, radius, place, |at, _| found.push(*at));
            found.sort_unstable();
            let mut expected = Vec::new();
            Grid::for_each_in(&[-60, -60], &[60, 60], |at| {
                if ball.signed_distance(&place.grid.center(at, level)).abs() <= radius {
                    expected.push(*at);
                }
            });
            expected.sort_unstable();
            assert_eq!(found, expected);
        }
    }
}
