//! Control of topology (GBPM 3.6): which particles another segment has swept. They are removed where segments merge.
//!
//! The paper removes every particle that has one of another segment within 2 γ; that takes whole fronts away where segments
//! are merely close. Here a particle is removed when it has just passed another segment: it was in front of it and is behind
//! it. Being behind alone would not do: the two sides of a convex corner or of a thin body lie behind each other, but move
//! apart.

use super::config::FrontConfig;
use super::foot_points::FootPoints;
use crate::geometry::Vector;
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::{BLOCK, Interrupted, one_by_one};
use rayon::prelude::{IndexedParallelIterator, ParallelIterator, ParallelSliceMut};

/// Tuning constants of the test whether one segment has passed another. Lengths are in spacings. With these a growing ring
/// is exact to .18 h, three spheres to .28 h, two circles to .09 h (docs/results/front-notes.md, Corners and meetings).
struct SweepTuning {
    /// Radius within which particles of the other segment are searched.
    search: f64,
    /// Distance along a segment up to which the tangent and the curvature of a particle describe the segment; where segments
    /// have met, the nearest particle may be that far.
    local: f64,
    /// Largest |κ| h used; at a cusp fits make up more.
    most_bend: f64,
    /// Distance behind a segment from which a particle counts as behind it.
    behind: f64,
    /// Distance behind the other segment at the start of the step up to which a particle counts as having been in front:
    /// in spacings, and relative to its displacement against the other segment. Tangents and curvatures are not the front.
    was_behind: [f64; 2],
    /// Largest cosine of normals that point at each other.
    face_to_face: f64,
    /// Largest cosine of the normals of two segments that can pass each other, whatever tells segments apart elsewhere.
    passing: f64,
}

const TUNING: SweepTuning = SweepTuning {
    search: 3.0,
    local: 2.5,
    most_bend: 0.2,
    behind: 1e-9,
    was_behind: [0.1, 0.5],
    face_to_face: -0.9,
    passing: 0.5,
};

/// Signed distance of a place from the front at particle j, positive outside, by its tangent and its mean curvature; None
/// where the place is too far along the front.
pub(super) fn height_over<const D: usize>(
    feet: &FootPoints<D>,
    j: usize,
    place: &Vector<D>,
    spacing: f64,
) -> Option<f64> {
    let d = place - feet.positions[j];
    let height = d.dot(&feet.normals[j]);
    let along = d.norm_squared() - height * height;
    (along <= (TUNING.local * spacing).powi(2)).then(|| {
        let most = TUNING.most_bend / spacing;
        let bend = (feet.curvatures[j] / (D as f64 - 1.0)).clamp(-most, most);
        height + 0.5 * bend * along
    })
}

/// Whether particles belong to segments that may have passed each other. `cosine` is the least cosine of normals within one
/// segment.
pub(super) fn may_pass<const D: usize>(feet: &FootPoints<D>, i: usize, j: usize, cosine: f64) -> bool {
    feet.normals[i].dot(&feet.normals[j]) <= cosine.min(TUNING.passing)
}

/// Particles after a step, sorted into cells, and the displacement of each along its normal in that step.
pub(super) struct SweepTest<'a, const D: usize, const M: usize, W> {
    pub feet: &'a FootPoints<D>,
    pub cells: &'a CellList<D>,
    pub config: &'a FrontConfig<D, M>,
    pub displacement: W,
}

impl<const D: usize, const M: usize, W: Fn(usize) -> f64 + Sync> SweepTest<'_, D, M, W> {
    /// Marks the particles that no other segment has swept.
    ///
    /// # Errors
    /// [`Interrupted`] when the run is asked to stop.
    pub fn mark_unswept(&self, keep: &mut Vec<bool>) -> Result<(), Interrupted> {
        let interrupt = &self.config.interrupt;
        keep.clear();
        keep.resize(self.feet.len(), true);
        one_by_one(keep.par_chunks_mut(BLOCK).enumerate()).for_each(|(block, keep)| {
            for (k, keep) in keep.iter_mut().enumerate() {
                if interrupt.is_raised() {
                    return;
                }
                *keep = !self.is_swept(block * BLOCK + k);
            }
        });
        interrupt.check()
    }

    /// Whether another segment has swept particle i.
    fn is_swept(&self, i: usize) -> bool {
        let Self { feet, cells, config, .. } = self;
        let spacing = config.grid.spacing_of(feet.nodes[i]);
        let mut is_swept = false;
        cells.for_each_within(&feet.positions[i], TUNING.search * spacing, |j, _, _| {
            is_swept = is_swept || self.has_passed(i, j, spacing);
        });
        is_swept
    }

    /// Whether particle i has just passed the segment of particle j: both approached each other, i is behind j, and was not
    /// behind it at the start of the step.
    fn has_passed(&self, i: usize, j: usize, spacing: f64) -> bool {
        let Self { feet, config, displacement, .. } = self;
        if !may_pass(feet, i, j, config.method.cosine) {
            return false;
        }
        let (x, n) = (&feet.positions[i], &feet.normals[i]);
        let Some(height) = height_over(feet, j, x, spacing) else { return false };
        let (own, other) = (displacement(i), displacement(j));
        let (m, facing) = (&feet.normals[j], other.signum());
        let ahead = height * facing;
        let moved = (other - own * n.dot(m)) * facing;
        let slack = (TUNING.was_behind[0] * spacing).min(TUNING.was_behind[1] * moved);
        let apart = (x - n * own) - (feet.positions[j] - m * other);
        let approach = -apart.dot(&(n * own - m * other));
        // The particles of a fan start at one position; so do those of two segments that touch, face to face.
        let has_touched = n.dot(m) < TUNING.face_to_face && apart.norm() < TUNING.behind * spacing;
        let was_approaching = has_touched || approach > TUNING.behind * spacing * spacing;
        was_approaching && ahead < -TUNING.behind * spacing && ahead + moved >= -slack
    }
}

#[cfg(test)]
mod tests {
    use super::{SweepTest, height_over};
    use crate::geometry::{Domain, Vector};
    use crate::neighbors::CellList;
    use crate::schemes::grid_based_particle::fixtures::{SPACING, ball, config, feet};
    use crate::schemes::grid_based_particle::foot_points::{FootPoint, FootPoints};
    use crate::schemes::grid_based_particle::laws::NormalSpeed;

    /// Two lines at heights in spacings, the first with upward normals and the second with downward ones.
    fn lines(heights: [f64; 2]) -> FootPoints<2> {
        let mut feet = FootPoints::default();
        for (height, up) in heights.into_iter().zip([1.0, -1.0]) {
            for k in 0..10 {
                let position = Vector::<2>::new(f64::from(k), height) * SPACING;
                let normal = Vector::<2>::new(0.0, up);
                let (curvature, gauss_curvature, part, parameter) = (0.0, 0.0, 0, 0.0);
                feet.push(0, &FootPoint { position, normal, curvature, gauss_curvature, part, parameter });
            }
        }
        feet
    }

    /// Which particles stay after all have moved by a displacement in spacings along their normals.
    fn unswept(feet: &FootPoints<2>, displacement: f64) -> Vec<bool> {
        let config = config::<2, 1>(NormalSpeed { speed: 1.0 });
        let mut cells = CellList::new(Domain::unbounded());
        cells.rebuild(feet.positions.iter().copied(), SPACING);
        let mut keep = Vec::new();
        let displacement = |_: usize| displacement * SPACING;
        SweepTest { feet, cells: &cells, config: &config, displacement }.mark_unswept(&mut keep).unwrap();
        keep
    }

    #[test]
    fn lines_that_have_passed_each_other_are_swept() {
        assert!(unswept(&lines([0.1, -0.1]), 0.2).iter().all(|keep| !keep));
    }

    #[test]
    fn lines_that_have_not_met_yet_stay() {
        assert!(unswept(&lines([-0.3, 0.3]), 0.2).iter().all(|keep| *keep));
    }

    /// The two sides of a thin body lie behind each other, but move apart.
    #[test]
    fn a_thin_body_that_grows_stays() {
        assert!(unswept(&lines([0.3, -0.3]), 0.2).iter().all(|keep| *keep));
    }

    #[test]
    fn lines_that_passed_each_other_long_ago_stay() {
        assert!(unswept(&lines([1.0, -1.0]), 0.2).iter().all(|keep| *keep));
    }

    /// By its tangent and its curvature a circle is known to fourth order.
    #[test]
    fn heights_follow_the_bend_of_the_front() {
        let circle = feet(ball::<2>(), &config::<2, 1>(NormalSpeed { speed: 1.0 }));
        let (x, n) = (circle.positions[0], circle.normals[0]);
        let center = x - n * 0.4;
        let turned = |angle: f64| {
            Vector::<2>::new(n[0] * angle.cos() - n[1] * angle.sin(), n[0] * angle.sin() + n[1] * angle.cos())
        };
        for angle in [-0.1, 0.05, 0.12] {
            let height = height_over(&circle, 0, &(center + turned(angle) * 0.41), SPACING).unwrap();
            assert!((height - 0.01).abs() < 5e-4, "{angle}: {height}");
        }
        assert!(height_over(&circle, 0, &(center + turned(0.2) * 0.4), SPACING).is_none());
    }
}
