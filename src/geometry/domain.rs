//! The space in which particles move: unbounded, or periodic along chosen axes. The images of a sheared box slide past each other
//! (Lees and Edwards 1972).

use super::Vector;

/// One axis of a domain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Axis {
    /// Coordinates run from −∞ to ∞.
    Unbounded,
    /// Positions `x` and `x + length` are the same point. Wrapped coordinates lie in `[start, start + length)`.
    Periodic {
        /// Lower end of the period.
        start: f64,
        /// Length of the period, positive.
        length: f64,
    },
}

/// Where the images of a box in shear lie: the one a period up along an axis is displaced along x.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tilt {
    /// The axis, not x. Both are periodic.
    pub axis: usize,
    /// The displacement, at most half a period of x.
    pub offset: f64,
}

/// A box of `D` axes, each unbounded or periodic.
///
/// ```
/// use meniscus::geometry::{Domain, Vector, domain::Axis};
///
/// let domain = Domain::new([Axis::Periodic { start: 0.0, length: 1.0 }, Axis::Unbounded]);
/// let dx = domain.displacement(&Vector::<2>::new(0.9, 0.0), &Vector::<2>::new(0.1, 0.0));
/// assert!((dx[0] - 0.2).abs() < 1e-15);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Domain<const D: usize> {
    axes: [Axis; D],
    tilt: Option<Tilt>,
}

impl<const D: usize> Domain<D> {
    /// A domain without bounds along any axis.
    #[must_use]
    pub fn unbounded() -> Self {
        Self { axes: [Axis::Unbounded; D], tilt: None }
    }

    /// A domain with the given axes, in the order x, y, z.
    #[must_use]
    pub fn new(axes: [Axis; D]) -> Self {
        Self { axes, tilt: None }
    }

    /// The same box with its images along an axis displaced along x, which a whole period of x does not change.
    #[must_use]
    pub fn tilted(&self, axis: usize, offset: f64) -> Self {
        let Axis::Periodic { length, .. } = self.axes[0] else { return self.clone() };
        let offset = offset - (offset / length).round() * length;
        Self { axes: self.axes, tilt: Some(Tilt { axis, offset }) }
    }

    /// How images along an axis are displaced; None in a box that is not sheared.
    #[must_use]
    pub fn tilt(&self) -> Option<Tilt> {
        self.tilt
    }

    /// The length of an axis; infinite where it is not periodic.
    #[must_use]
    pub fn length(&self, axis: usize) -> f64 {
        match self.axes[axis] {
            Axis::Unbounded => f64::INFINITY,
            Axis::Periodic { length, .. } => length,
        }
    }

    /// The displacement along x of the image `turns` periods up along an axis.
    #[inline]
    fn slide(&self, axis: usize, turns: f64) -> f64 {
        match self.tilt {
            Some(tilt) if tilt.axis == axis => turns * tilt.offset,
            _ => 0.0,
        }
    }

    /// The axes in the order x, y, z.
    #[must_use]
    pub fn axes(&self) -> &[Axis; D] {
        &self.axes
    }

    /// The point `x` with its periodic coordinates moved into `[start, start + length)`.
    #[must_use]
    pub fn wrap(&self, mut x: Vector<D>) -> Vector<D> {
        // x comes last: turns along the others may move a point along it.
        for d in (0..D).rev() {
            if let Axis::Periodic { start, length } = self.axes[d] {
                let turns = ((x[d] - start) / length).floor();
                x[d] -= turns * length;
                if self.tilt.is_some() {
                    x[0] -= self.slide(d, turns);
                }
                // Rounding may give the upper end itself, which is the same point as the lower end.
                if x[d] >= start + length || x[d] < start {
                    x[d] = start;
                }
            }
        }
        x
    }

    /// The shortest displacement `to − from` (minimum image along periodic axes; in a sheared box where it is shorter than half of
    /// every period).
    #[inline]
    #[must_use]
    pub fn displacement(&self, from: &Vector<D>, to: &Vector<D>) -> Vector<D> {
        let mut dx = to - from;
        for d in (0..D).rev() {
            if let Axis::Periodic { length, .. } = self.axes[d] {
                let turns = (dx[d] / length).round();
                dx[d] -= turns * length;
                if self.tilt.is_some() {
                    dx[0] -= self.slide(d, turns);
                }
            }
        }
        dx
    }
}

#[cfg(test)]
mod tests {
    use super::{Axis, Domain, Vector};

    #[test]
    fn wrapping_keeps_points_inside_half_open_box() {
        let domain = Domain::new([Axis::Periodic { start: -1.0, length: 2.0 }, Axis::Unbounded]);
        for x in [-7.3, -1.0, -1.0 - 1e-16, 0.999_999, 1.0, 1.0 + 1e-15, 5.0] {
            let y = domain.wrap(Vector::<2>::new(x, x));
            assert!((-1.0..1.0).contains(&y[0]), "{x} became {}", y[0]);
            assert_eq!(y[1].to_bits(), x.to_bits());
        }
    }

    /// In a sheared box a point and its images are one: what lies a period up, displaced by the tilt, is the same.
    #[test]
    fn images_of_a_sheared_box_slide_along_x() {
        let axes = [Axis::Periodic { start: -0.5, length: 3.0 }, Axis::Periodic { start: 1.0, length: 2.0 }];
        for offset in [0.4, -1.3, 2.9, 7.0] {
            let domain = Domain::new(axes).tilted(1, offset);
            assert!(domain.tilt().unwrap().offset.abs() <= 1.5);
            let (x, other) = (Vector::<2>::new(0.3, 1.1), Vector::<2>::new(0.4, 1.6));
            for turns in [[1.0, 0.0], [0.0, 1.0], [-2.0, 1.0], [1.0, -3.0]] {
                let image = x + Vector::<2>::new(3.0 * turns[0] + offset * turns[1], 2.0 * turns[1]);
                assert!((domain.wrap(image) - x).norm() < 1e-14, "{offset}: {}", domain.wrap(image));
                assert!((domain.displacement(&image, &other) - (other - x)).norm() < 1e-14);
            }
        }
    }

    #[test]
    fn displacement_takes_the_short_way_round() {
        let domain = Domain::new([Axis::Periodic { start: 0.0, length: 1.0 }; 2]);
        let dx = domain.displacement(&Vector::<2>::new(0.95, 0.5), &Vector::<2>::new(0.05, 0.4));
        assert!((dx - Vector::<2>::new(0.1, -0.1)).norm() < 1e-15);
    }
}
