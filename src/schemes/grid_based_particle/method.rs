//! Parameters of the method.

/// Parameters of the local reconstructions and of the tube (GBPM 3.2 to 3.5). Lengths are in spacings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrontMethod {
    /// Degree of the polynomials, 2 to 4.
    pub degree: usize,
    /// m, the number of particles of a reconstruction.
    pub neighbors: usize,
    /// k in the weights exp(−k t²), t the distance from the base particle along the front.
    pub weight: f64,
    /// λ, the weight of the slopes that the normals of the particles ask of the polynomial, relative to positions.
    pub normal_weight: f64,
    /// γ/h, the radius of the tube.
    pub tube_radius: f64,
    /// Least distance between the particles of one reconstruction.
    pub min_separation: f64,
    /// Least cosine between the normals of particles of one segment.
    pub cosine: f64,
    /// Criteria of refinement; None where the grid has one level.
    pub adaptivity: Option<Adaptivity>,
}

/// Levels of the grid and the criterion of refinement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Adaptivity {
    /// Number of levels.
    pub levels: u32,
    /// c: the grid is fine enough where |κ| h < c (GBPM eq. 16).
    pub curvature_constant: f64,
}

impl FrontMethod {
    /// Number of levels of the grid.
    #[must_use]
    pub fn levels(&self) -> u32 {
        self.adaptivity.map_or(1, |adaptivity| adaptivity.levels)
    }
}
