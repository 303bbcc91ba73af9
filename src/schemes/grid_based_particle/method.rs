//! What a front is reconstructed by.

use super::refinement::Adaptivity;

/// Parameters of the local reconstructions and of the tube (GBPM 3.2 to 3.4), lengths in spacings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrontMethod {
    /// Degree of the polynomials, 2 to 4.
    pub degree: usize,
    /// Particles of a reconstruction, m.
    pub neighbors: usize,
    /// k in the weights exp(−k t²), t the distance from the base point along the front.
    pub weight: f64,
    /// λ, the weight of the particles' normals beside their positions: the slopes that they ask of the polynomial, times λ.
    pub normal_weight: f64,
    /// γ/h.
    pub tube_radius: f64,
    /// Distance that particles of one reconstruction keep from each other.
    pub min_separation: f64,
    /// Cosine of the normals up to which particles belong to one segment.
    pub cosine: f64,
    /// Where the grid is refined; None where it has one level.
    pub adaptivity: Option<Adaptivity>,
}

impl FrontMethod {
    /// How many levels the grid has.
    #[must_use]
    pub fn levels(&self) -> u32 {
        self.adaptivity.map_or(1, |adaptivity| adaptivity.levels)
    }
}
