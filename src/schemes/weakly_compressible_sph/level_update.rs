//! What becomes of the level that particles carry.

/// What becomes of the level that particles carry when closest points are found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LevelUpdate {
    /// It is replaced by the signed distance (PCP section 4.3).
    Overwrite,
    /// Long waves of the interface stay with the particles; short waves are repaired (see `interface::level_set`).
    Transparent {
        /// Share of a deviation that is repaired in the time ½ √(ρh³/(2πτ)).
        relaxation: f64,
        /// Radius of the surface filter.
        radius: f64,
    },
}
