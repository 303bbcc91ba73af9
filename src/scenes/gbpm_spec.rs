//! The parameters of the grid-based particle method, shared by `front` and by `vortex` with `method: "gbpm"`.

use crate::schemes::grid_based_particle::curvature_stability::{fewest_particles, most_weight};
use crate::schemes::grid_based_particle::{self as gbpm, FrontMethod, MOST_LEVELS, Segments, Topology};
use crate::spec::{Interval, POSITIVE, Violation, whole};
use serde_json::json;

crate::choice! {
    /// How particles of different segments are told apart.
    pub enum SegmentTest {
        /// by the angle of their normals
        Normals = "normals" {
            /// normals of one segment have a larger scalar product; when not given, .2 in the plane and .5 in space, −.2 and
            /// −.05 under mean_curvature
            cosine: Option<f64>, in Interval::above(-1.0).and_below(1.0);
        }
        /// by the part of the front at the start that they belong to, and in the plane by how far along it they are, from 0 to 1
        /// round it, both carried along by the fits; and by the angle of their normals
        Parameter = "parameter" {
            /// normals of one segment have a larger scalar product; when not given, .2 in the plane and .5 in space, −.2 and
            /// −.05 under mean_curvature
            cosine: Option<f64>, in Interval::above(-1.0).and_below(1.0);
            /// parameters of one segment differ by less
            difference: f64 = 0.1, in Interval::above(0.0).and_at_most(0.5);
        }
    }
}

crate::words! {
    /// What happens where segments meet.
    pub enum TopologyWord {
        /// they merge (the viscosity solution)
        Merge = "merge",
        /// they cross: parts are told apart by their parameter
        Cross = "cross",
    }
}

crate::group! {
    /// Refinement of the grid.
    pub struct AdaptivitySpec {
        /// number of levels: the coarsest has the spacing, each other half of that before
        levels: u32 = 3, in whole(1, MOST_LEVELS as u64);
        /// c: cells are halved as long as |κ| times their size is not below it
        curvature_constant: f64 = 0.2, in POSITIVE;
    }
}

crate::group! {
    /// Reconstructions and steps of the grid-based particle method.
    pub struct GbpmSpec: Default {
        /// degree of the local reconstructions; when not given, 4 in the plane and under mean_curvature, 2 in space else
        degree: Option<usize>, in whole(2, 4);
        /// number of particles of a reconstruction; when not given, in the plane 6, 7, 8 of degree 2, 3, 4; in space as many as
        /// coefficients where normals weigh .1 or more, else 16, of degree 4 24; under mean_curvature of degree 4 10 in the plane,
        /// 36 in space, and in sharp bends the nearest 6 (16) of them and degree 2; fewer where fewer are within the search radius
        neighbors: Option<usize>, in whole(3, 60);
        /// k in the weights exp(−k t²), t the distance along the front in h; when not given, 1 for degree 4 in the plane, 0 else
        /// and under mean_curvature
        weight: Option<f64>, in Interval::at_least(0.0).and_at_most(10.0);
        /// λ in the rows λ ∂f = slope that the normals of the particles add to those of their positions in a reconstruction, in a
        /// flow; when not given, .1 in space, 0 in the plane
        normal_weight: Option<f64>, in Interval::at_least(0.0).and_at_most(10.0);
        /// grid points within so many h of the front have a foot point
        tube_radius_h: f64 = 1.1, in Interval::at_least(0.8).and_at_most(4.0);
        /// distance in h that the particles of a reconstruction keep from each other
        min_separation_h: f64 = 0.25, in Interval::at_least(0.0).and_at_most(1.0);
        /// how particles of different segments are told apart
        segment_test: SegmentTest = SegmentTest::Normals { cosine: None };
        /// refines the grid where the front is curved or close to another segment; when not given, the grid has one level
        adaptivity: Option<AdaptivitySpec>;
        /// dt · max speed/h, h that of the finest level; when neither it nor a step is given, 10 in a flow, 2 of rays, .75 with a
        /// given speed, and dt = .5 h² under mean_curvature, or the longest that is stable where that is less
        cfl: Option<f64>, in POSITIVE;
    }
}

/// The method as planned.
#[derive(Debug, Clone, Copy)]
pub struct GbpmPlan {
    /// How fronts are reconstructed.
    pub method: FrontMethod,
    /// What happens where segments meet.
    pub topology: Topology,
    /// How segments are told apart beside their normals.
    pub segments: Segments,
}

/// λ from which on the normals do what more particles would: with less, few particles are unstable.
const NORMALS_DETERMINE: f64 = 0.1;

/// What moves the front, as far as it matters to reconstructions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motion {
    /// A flow: particles and their normals are exact by themselves.
    Flow,
    /// Its mean curvature.
    Curvature,
    /// A given speed, or rays.
    Speed,
}

/// Where the parameters stand, and what the front is.
#[derive(Debug, Clone, Copy)]
pub struct GbpmContext {
    /// JSON pointer to the parameters.
    pub pointer: &'static str,
    /// Dimension of the scene.
    pub dimension: usize,
    /// What moves the front.
    pub motion: Motion,
    /// What happens where segments meet.
    pub topology: TopologyWord,
}

impl GbpmSpec {
    /// What the paper reconstructs by: quadratics of 6 particles, in space of 10, without weights and normals; where another
    /// degree is given, or left open by null, the number of particles is left to it.
    #[must_use]
    pub fn paper(is_in_space: bool, has_own_degree: bool) -> Self {
        let neighbors = if is_in_space { 10 } else { 6 };
        Self {
            degree: Some(2),
            neighbors: (!has_own_degree).then_some(neighbors),
            weight: Some(0.0),
            normal_weight: Some(0.0),
            ..Self::default()
        }
    }

    /// Number of levels of the grid.
    #[must_use]
    pub fn levels(&self) -> u32 {
        self.adaptivity.as_ref().map_or(1, |adaptivity| adaptivity.levels)
    }

    /// The degree, chosen where none is given.
    #[must_use]
    pub fn degree_for(&self, dimension: usize, motion: Motion) -> usize {
        self.degree.unwrap_or(if dimension == 2 || motion == Motion::Curvature { 4 } else { 2 })
    }

    /// The weight, chosen where none is given.
    #[must_use]
    pub fn weight_for(&self, dimension: usize, motion: Motion) -> f64 {
        let is_narrow = dimension == 2 && motion != Motion::Curvature && self.degree_for(dimension, motion) == 4;
        self.weight.unwrap_or(if is_narrow { 1.0 } else { 0.0 })
    }

    /// The number of particles of a reconstruction, chosen where none is given.
    fn neighbors_for(&self, context: GbpmContext, normal_weight: f64) -> usize {
        let GbpmContext { dimension, motion, .. } = context;
        let is_by_curvature = motion == Motion::Curvature;
        let degree = self.degree_for(dimension, motion);
        self.neighbors.unwrap_or(match (dimension, degree) {
            (2, 2) => 6,
            (2, 3) => 7,
            (2, 4) if is_by_curvature => 10,
            (2, _) => 8,
            (_, 4) if is_by_curvature => 36,
            _ if motion == Motion::Flow && normal_weight >= NORMALS_DETERMINE => coefficients(dimension, degree),
            (_, 2 | 3) => 16,
            _ => 24,
        })
    }

    /// What the parameters do not go together with.
    fn check(&self, context: GbpmContext, degree: usize, neighbors: usize, weight: f64) -> Vec<Violation> {
        let GbpmContext { pointer, dimension, motion, .. } = context;
        let is_by_curvature = motion == Motion::Curvature;
        let mut errors = Vec::new();
        if let Some(given) = self.normal_weight.filter(|given| *given > 0.0 && motion != Motion::Flow) {
            let detail =
                "normals of a surface take part in reconstructions in a flow, which carries them along exactly";
            errors.push(Violation::new(format!("{pointer}/normal_weight"), "conflict", detail, given, 0));
        }
        let (fewest, detail) = if is_by_curvature {
            let detail = format!("with fewer particles of degree {degree} motion by curvature is unstable");
            (fewest_particles(dimension, degree), detail)
        } else {
            let terms = coefficients(dimension, degree);
            (terms, format!("a reconstruction of degree {degree} has {terms} coefficients"))
        };
        if neighbors < fewest {
            let allowed = format!("a whole number ≥ {fewest}");
            errors.push(Violation::new(format!("{pointer}/neighbors"), "range", detail, neighbors, allowed));
        }
        let most_weight = most_weight(dimension);
        if is_by_curvature && weight > most_weight {
            let detail = "with larger weights motion by curvature is unstable";
            let allowed = json!(format!("a number ≤ {most_weight}"));
            errors.push(Violation::new(format!("{pointer}/weight"), "range", detail, weight, allowed));
        }
        errors
    }

    /// The method, and the parameters with everything filled in.
    ///
    /// # Errors
    /// Where there are fewer particles than coefficients, where normals cannot take part, and what is unstable under curvature.
    pub fn plan(mut self, context: GbpmContext) -> Result<(GbpmPlan, Self), Vec<Violation>> {
        let GbpmContext { dimension, motion, topology, .. } = context;
        let (degree, weight) = (self.degree_for(dimension, motion), self.weight_for(dimension, motion));
        let has_normals = dimension == 3 && motion == Motion::Flow;
        let normal_weight = self.normal_weight.unwrap_or(if has_normals { 0.1 } else { 0.0 });
        let neighbors = self.neighbors_for(context, normal_weight);
        let errors = self.check(context, degree, neighbors, weight);
        if !errors.is_empty() {
            return Err(errors);
        }
        let topology = match topology {
            TopologyWord::Merge => Topology::Merge,
            TopologyWord::Cross => Topology::Cross,
        };
        // By its curvature a corner becomes round at once, so its two sides must find each other.
        let default_cosine = match (dimension, motion == Motion::Curvature) {
            (2, false) => 0.2,
            (2, true) => -0.2,
            (_, false) => 0.5,
            (_, true) => -0.05,
        };
        let (segments, cosine) = match &mut self.segment_test {
            SegmentTest::Normals { cosine } => {
                (Segments { by_part: topology == Topology::Cross, parameter: None }, cosine)
            }
            SegmentTest::Parameter { cosine, difference } => {
                // Outlines are known in the plane alone.
                let parameter = (dimension == 2).then_some(*difference);
                (Segments { by_part: true, parameter }, cosine)
            }
        };
        let method = FrontMethod {
            degree,
            neighbors,
            weight,
            normal_weight,
            tube_radius: self.tube_radius_h,
            min_separation: self.min_separation_h,
            cosine: *cosine.get_or_insert(default_cosine),
            adaptivity: self
                .adaptivity
                .as_ref()
                .map(|given| gbpm::Adaptivity { levels: given.levels, curvature_constant: given.curvature_constant }),
        };
        self.degree = Some(degree);
        self.neighbors = Some(neighbors);
        self.weight = Some(weight);
        self.normal_weight = Some(normal_weight);
        // The step has it from now on.
        self.cfl = None;
        Ok((GbpmPlan { method, topology, segments }, self))
    }
}

/// Coefficients of a polynomial of the front: of one variable in the plane, of two in space.
fn coefficients(dimension: usize, degree: usize) -> usize {
    if dimension == 2 { degree + 1 } else { (degree + 1) * (degree + 2) / 2 }
}

#[cfg(test)]
mod tests {
    use super::{GbpmContext, GbpmSpec, Motion, TopologyWord};

    fn context(dimension: usize, motion: Motion) -> GbpmContext {
        GbpmContext { pointer: "", dimension, motion, topology: TopologyWord::Merge }
    }

    #[test]
    fn a_plan_fills_in_everything_and_plans_to_itself() {
        for dimension in [2, 3] {
            for motion in [Motion::Flow, Motion::Curvature, Motion::Speed] {
                let (plan, full) = GbpmSpec::default().plan(context(dimension, motion)).unwrap();
                assert!(full.degree.is_some() && full.neighbors.is_some() && full.weight.is_some());
                let (again, same) = full.clone().plan(context(dimension, motion)).unwrap();
                assert_eq!((again.method, same), (plan.method, full));
            }
        }
    }

    #[test]
    fn what_is_unstable_under_curvature_is_refused() {
        let few = GbpmSpec { degree: Some(2), neighbors: Some(10), ..GbpmSpec::default() };
        assert!(few.clone().plan(context(3, Motion::Flow)).is_ok());
        assert_eq!(few.plan(context(3, Motion::Curvature)).unwrap_err()[0].pointer, "/neighbors");
    }
}
