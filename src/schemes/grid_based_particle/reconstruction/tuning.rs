//! Tuning constants of reconstructions.

/// Lengths are in spacings, pairs are for a curve (M = 1) and for a surface (M = 2). The experiments are in
/// docs/results/front-notes.md, by the headings named here.
pub(super) struct ReconstructionTuning {
    /// Radius of the first search for particles beyond that of the tube.
    pub first_search: [f64; 2],
    /// Factor by which the radius of the search grows while particles are missing.
    pub search_growth: f64,
    /// Largest number of segments that are tried for one grid point.
    pub most_segments: usize,
    /// A further segment is tried only if its nearest particle is at most this much farther away than the best closest point
    /// so far.
    pub segment_margin: f64,
    /// Least cosine between the normal of the base and those of the other particles of a fit of the full degree. Where the
    /// front turns more, a quadratic about the mean normal replaces it.
    pub least_cosine_of_full_degree: f64,
    /// The same limit under a law with quadratics of its own in bends. Measured under "Mean curvature": of .9, .94 and .97 in
    /// space, .9 left 500 foot points of a dumbbell behind and with .97 spheres lost the gain of quartics.
    pub least_cosine_in_bends: [f64; 2],
    /// Largest extrapolation beyond the particles of a fit, where particles are not exact by themselves. The paper's zero
    /// loses the ends of thin filaments; in a flow any extrapolation makes spurs ("The vortex at T = 8").
    pub most_extrapolation: f64,
    /// Largest distance of a closest point beyond the last particle from its nearest particle.
    pub most_lonely: f64,
    /// Least cosine between the normal of the base and that at the closest point; below it the graph has folded.
    pub least_agreement: f64,
    /// Largest |κ| h of a front that its particles resolve.
    pub sharpest: f64,
    /// Largest root mean square difference between the directions of a graph and those of its particles, in a flow. Measured
    /// under "The vortex at T = 8" (.05 against .1 and against residuals of positions) and under "Space" (.2).
    pub most_misfit: [f64; 2],
    /// Least cosine between the normal of a particle and the upward direction of a graph for the normal to ask for a slope.
    pub steepest: f64,
    /// Tests for a place beyond a corner, measured under "Corners and edges in a flow".
    pub corner: CornerTest,
    /// Distance behind a segment up to which a place still counts as on it.
    pub on_segment: f64,
}

/// Constants of the test whether a place lies beyond a corner of its segment. Distances are in spacings, cosines are between
/// the normal of the last particle of the segment and another one.
pub(super) struct CornerTest {
    /// Radius within which a next particle shows that the segment goes on.
    pub ahead: f64,
    /// Radius within which the other side of a corner has particles.
    pub other_side: f64,
    /// 1/cos² of the angle to the direction of the place within which a particle counts as ahead: 32°. With 60° or 45° the
    /// particles along an edge stand for what lies beyond it.
    pub cone: f64,
    /// Least cosine of the other side of a corner; smaller ones are of the other side of a thin sheet.
    pub opposite: f64,
    /// Largest cosine of a particle between the two sides; larger ones are of a side that is straight there.
    pub straight: f64,
    /// Distance of a place from the last particle below which it has no direction.
    pub same_place: f64,
}

pub(super) const TUNING: ReconstructionTuning = ReconstructionTuning {
    first_search: [1.4, 1.0],
    search_growth: 1.4,
    most_segments: 3,
    segment_margin: 0.5,
    least_cosine_of_full_degree: 0.7,
    least_cosine_in_bends: [0.9, 0.94],
    most_extrapolation: 0.3,
    most_lonely: 1.0,
    least_agreement: 0.2,
    sharpest: 2.0,
    most_misfit: [0.05, 0.2],
    steepest: 0.2,
    corner: CornerTest { ahead: 1.5, other_side: 2.0, cone: 1.4, opposite: -0.5, straight: 0.8, same_place: 1e-3 },
    on_segment: 1e-6,
};
