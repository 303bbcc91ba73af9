//! Counts of what resampling removed and kept.

/// Counts of grid points without a foot point and of particles that were removed or kept, by reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Removals {
    /// Grid points without enough particles of one segment near them.
    pub starved: u64,
    /// Grid points whose foot point would lie beyond all particles, or past a corner.
    pub extrapolated: u64,
    /// Grid points where the front turns too sharply for the spacing, or where a fit in a flow does not have the directions of
    /// its particles.
    pub unresolved: u64,
    /// Particles that another segment has passed.
    pub swept: u64,
    /// Moved particles that stayed because no new foot point replaced them.
    pub kept: u64,
    /// Particles beyond the end of the grid, which has half a billion cells from the origin in the plane and half a million in
    /// space.
    pub outside: u64,
}

impl Removals {
    /// Names and counts.
    #[must_use]
    pub fn entries(&self) -> [(&'static str, u64); 6] {
        [
            ("foot_points.starved", self.starved),
            ("foot_points.extrapolated", self.extrapolated),
            ("foot_points.unresolved", self.unresolved),
            ("foot_points.swept", self.swept),
            ("particles.kept", self.kept),
            ("particles.outside", self.outside),
        ]
    }

    /// From the numbers of [`Self::entries`].
    #[must_use]
    pub fn from_numbers(n: [u64; 6]) -> Self {
        let [starved, extrapolated, unresolved, swept, kept, outside] = n;
        Self { starved, extrapolated, unresolved, swept, kept, outside }
    }
}
