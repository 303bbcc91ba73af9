//! The space in which particles move: unbounded, or periodic along chosen axes.

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
}

impl<const D: usize> Domain<D> {
    /// A domain without bounds along any axis.
    #[must_use]
    pub fn unbounded() -> Self {
        Self { axes: [Axis::Unbounded; D] }
    }

    /// A domain with the given axes, in the order x, y, z.
    #[must_use]
    pub fn new(axes: [Axis; D]) -> Self {
        Self { axes }
    }

    /// The axes in the order x, y, z.
    #[must_use]
    pub fn axes(&self) -> &[Axis; D] {
        &self.axes
    }

    /// The point `x` with its periodic coordinates moved into `[start, start + length)`.
    #[must_use]
    pub fn wrap(&self, mut x: Vector<D>) -> Vector<D> {
        for d in 0..D {
            if let Axis::Periodic { start, length } = self.axes[d] {
                let turns = ((x[d] - start) / length).floor();
                x[d] -= turns * length;
                // Rounding may give the upper end itself, which is the same point as the lower end.
                if x[d] >= start + length || x[d] < start {
                    x[d] = start;
                }
            }
        }
        x
    }

    /// The shortest displacement `to − from` (minimum image along periodic axes).
    #[inline]
    #[must_use]
    pub fn displacement(&self, from: &Vector<D>, to: &Vector<D>) -> Vector<D> {
        let mut dx = to - from;
        for d in 0..D {
            if let Axis::Periodic { length, .. } = self.axes[d] {
                dx[d] -= (dx[d] / length).round() * length;
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

    #[test]
    fn displacement_takes_the_short_way_round() {
        let domain = Domain::new([Axis::Periodic { start: 0.0, length: 1.0 }; 2]);
        let dx = domain.displacement(&Vector::<2>::new(0.95, 0.5), &Vector::<2>::new(0.05, 0.4));
        assert!((dx - Vector::<2>::new(0.1, -0.1)).norm() < 1e-15);
    }
}
