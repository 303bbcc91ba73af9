//! The parameters of a `front` scene.

use crate::formulas::{FormulaText, NamedNumbers, constants};
use crate::geometry::flows::FlowChoice;
use crate::scenes::gbpm_spec::{GbpmSpec, TopologyWord};
use crate::scenes::integrators::IntegratorChoice;
use crate::scenes::shapes::{PlainShape, Shape};
use crate::spec::choice::with_defaults;
use crate::spec::{Given, POSITIVE, Preset, whole};

crate::choice! {
    /// What moves the front.
    pub enum Law {
        /// a constant speed along the outward normal
        Normal = "normal" {
            /// speed, positive outward
            speed: f64 = 1.0;
        }
        /// velocity −κ n
        MeanCurvature = "mean_curvature",
        /// a speed of one's own along the outward normal
        Formula = "formula" {
            /// the speed: a formula of x, y, z, the normal nx, ny, nz, the curvature k (∇·n) and t
            speed: FormulaText;
            /// numbers that the formula calls by name
            parameters: NamedNumbers = constants();
        }
        /// a prescribed velocity field
        Flow = "flow" {
            /// the velocity field
            flow: FlowChoice = with_defaults("single_vortex");
        }
        /// rays that start along the inner normals of a circle or an ellipse, as a curve in (x, y, θ)
        GeometricalOptics = "geometrical_optics" {
            /// speed c, everywhere the same
            speed: f64 = 1.0;
        }
    }
}

crate::group! {
    /// A front moved by a flow, along its normal or by its curvature.
    pub struct Front {
        /// 2 or 3; when not given, that of the shape, else 2
        dimension: Option<usize>, in whole(2, 3);
        /// what moves the front
        law: Law = with_defaults("normal");
        /// the front at the start
        shape: Shape = Shape::plain(PlainShape::Circle { center: Some([0.5, 0.5].into()), radius: 0.25 });
        /// spacing h of the underlying grid
        spacing: f64 = 0.007_812_5, in POSITIVE;
        /// scene time at the end
        end_time: f64 = 0.1, in POSITIVE => restart_safe;
        /// time step Δt, instead of cfl
        time_step: Option<f64>, in POSITIVE;
        /// integrator of a flow's paths and of motion by curvature; a given speed has straight paths
        integrator: IntegratorChoice = IntegratorChoice::Rk4;
        /// reconstructions and steps
        method: GbpmSpec => flatten;
        /// what happens where segments meet: they merge (the viscosity solution) or cross (parts are told apart by their parameter)
        topology: TopologyWord = TopologyWord::Merge;
    }
}

/// What section 4 of the GBPM paper states.
pub(super) fn paper(given: Given) -> Preset {
    let implied = given.read(Front::shape()).and_then(|shape| shape.dimension());
    let is_in_space = given.read(Front::dimension()).flatten().or(implied) == Some(3);
    let is_by_curvature = given.names(Front::law(), "mean_curvature");
    let has_own_degree = given.has(GbpmSpec::degree()) && given.read(GbpmSpec::degree()) != Some(Some(2));
    let mut method = GbpmSpec::paper(is_in_space, has_own_degree);
    if is_by_curvature && is_in_space {
        // The paper's ten particles of a surface blow up with its own step.
        method.neighbors = None;
    }
    let has_step = given.has(Front::time_step());
    method.cfl = (!has_step && !is_by_curvature).then_some(0.75);
    Preset::default().set_all(&method).set(Front::integrator(), IntegratorChoice::TvdRk2)
}
