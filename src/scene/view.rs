//! What a picture of a frame shows. Pictures are drawn from frames alone, so a scene names the fields to look at.

/// What a picture of a scene shows, with the names of the fields that it needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum View {
    /// There is no picture.
    Nothing,
    /// Particles around a surface, colored by their signed distance, and the surface itself as short tangents.
    Distance {
        /// Signed distance.
        distance: &'static str,
        /// Closest point of the surface.
        closest_point: &'static str,
        /// Normal of the surface.
        normal: &'static str,
    },
    /// Points of a surface, seen from one side and colored by a field; of a curve in the plane all points.
    SurfaceField {
        /// Field.
        field: &'static str,
        /// Normal of the surface.
        normal: &'static str,
        /// Whether the surface is a curve in the plane.
        is_plane: bool,
    },
    /// Points of a front: a curve in the plane as short tangents, a surface seen from one side and shaded by its slope.
    Front {
        /// Normal of the front.
        normal: &'static str,
        /// Whether the front is a curve in the plane.
        is_plane: bool,
    },
}

impl View {
    /// Particles around a surface, by the usual names of the fields.
    pub const DISTANCE: Self = Self::Distance { distance: "phi", closest_point: "closest_point", normal: "normal" };
}
