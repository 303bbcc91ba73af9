//! Prescribed velocity fields u(x, t), one file per flow, and the parameter that chooses one.

pub mod formula_flow;
pub mod grid_flow;
pub mod rays;
pub mod rotation;
pub mod single_vortex;
pub mod translation;
pub mod vortex_3d;

pub use formula_flow::FormulaFlow;
pub use grid_flow::{GridFlow, GridNodes};
pub use rays::Rays;
pub use rotation::Rotation;
pub use single_vortex::SingleVortex;
pub use translation::Translation;
pub use vortex_3d::Vortex3d;

use super::Vector;
use super::dimension::in_dimension;
use crate::formulas::{FormulaList, NamedNumbers, constants};
use crate::spec::{Choice, Coordinates, Items, POSITIVE, Parameter, Violation};
use grid_flow::UnreadFlow;
use serde_json::{Value, json};

/// How many times longer (or larger) a flow makes a front, relative to the front at time 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stretch {
    /// Mean over the time of the run.
    pub mean: f64,
    /// Maximum over the time of the run.
    pub most: f64,
}

impl Stretch {
    /// The stretch of a front that keeps its size.
    pub const NONE: Self = Self { mean: 1.0, most: 1.0 };
}

/// A velocity field known everywhere at every time.
///
/// A flow answers all questions about itself, so no other code needs to know which flow it is. Methods with a default
/// state what holds for most flows.
pub trait Flow<const D: usize>: Send + Sync {
    /// Velocity u(x, t).
    fn velocity(&self, x: &Vector<D>, time: f64) -> Vector<D>;

    /// Velocities at several points, each at its own time. A flow that computes many at once faster than one by one does so;
    /// every velocity is that of [`Self::velocity`] to the last bit.
    fn velocities(&self, points: &[Vector<D>], times: &[f64], velocities: &mut [Vector<D>]) {
        for ((velocity, x), time) in velocities.iter_mut().zip(points).zip(times) {
            *velocity = self.velocity(x, *time);
        }
    }

    /// Why there is no velocity at a place and time, in words with numbers; None where there is one.
    fn fault(&self, _x: &Vector<D>, _time: f64) -> Option<String> {
        None
    }

    /// ∇·u at several points, where it is not known to be 0 beforehand; None for built-in flows, which have none.
    fn divergences(&self, _points: &[Vector<D>], _time: f64) -> Option<Vec<f64>> {
        None
    }

    /// What the flow costs beside a built-in one, for estimates.
    fn relative_cost(&self) -> f64 {
        1.0
    }

    /// An upper bound of |u| at all times over the points that start in the box from `low` to `high`. It limits time
    /// steps.
    fn top_speed(&self, low: &Vector<D>, high: &Vector<D>) -> f64;

    /// Whether the flow has no divergence where points from the box from `low` to `high` come, so that it keeps the area or volume
    /// inside a surface there.
    fn keeps_volume(&self, _low: &Vector<D>, _high: &Vector<D>) -> bool {
        false
    }

    /// Position that a rigid motion gives `x` after `duration`, by its formula; None where the motion is not rigid.
    fn rigid_path(&self, _x: &Vector<D>, _duration: f64) -> Option<Vector<D>> {
        None
    }

    /// Whether the motion keeps all distances.
    fn is_rigid(&self) -> bool {
        self.rigid_path(&Vector::<D>::zeros(), 0.0).is_some()
    }

    /// The period after which the flow has brought every point back to its start; None for a flow that never does.
    fn return_time(&self) -> Option<f64> {
        None
    }

    /// Whether the flow has brought every point back to its start at `time`.
    fn is_back(&self, time: f64) -> bool {
        self.return_time().is_some_and(|period| {
            let turns = time / period;
            (turns - turns.round()).abs() < 1e-9
        })
    }

    /// The stretch of a typical front, for estimates of cost where carrying an outline along cannot measure it.
    fn typical_stretch(&self) -> Option<Stretch> {
        None
    }
}

crate::choice! {
    /// A velocity field.
    pub enum FlowChoice {
        /// the spiraling vortex in the unit square (2D)
        SingleVortex = "single_vortex" {
            /// time T after which everything is back; null: the flow never turns
            period: Option<f64> = Some(8.0), in POSITIVE;
        }
        /// the deforming flow in the unit cube (3D)
        Vortex3d = "vortex_3d" {
            /// time T after which everything is back; null: the flow never turns
            period: Option<f64> = Some(2.0), in POSITIVE;
        }
        /// rigid rotation about a point in the x–y plane
        Rotation = "rotation" {
            /// fixed point
            center: Coordinates;
            /// angular velocity, counter-clockwise
            angular_velocity: f64;
        }
        /// uniform motion
        Translation = "translation" {
            /// velocity
            velocity: Coordinates;
        }
        /// a flow of one's own: formulas of x, y, z and t
        Formula = "formula" {
            /// the components of the velocity
            velocity: FormulaList, in Items(2, 3, ());
            /// numbers that the formulas call by name
            parameters: NamedNumbers = constants();
            /// time after which every point is back at its start; null where none is
            period: Option<f64>, in POSITIVE;
        }
        /// a flow from data: velocities on a regular grid, cubic in space and linear in time
        Grid = "grid" {
            /// id of an upload `as=flow` that is ready
            upload: Option<String>;
            /// path of a file (valid for `meniscus run` alone)
            file: Option<String>;
            /// time after which every point is back at its start; null where none is
            period: Option<f64>, in POSITIVE;
        }
    }
}

/// Names of the flows that exist in the plane, and in space.
const EXISTING: [&[&str]; 2] = [
    &["single_vortex", "rotation", "translation", "formula", "grid"],
    &["vortex_3d", "rotation", "translation", "formula", "grid"],
];

/// Velocities on a grid: its nodes, and the components at all of them, time after time.
#[derive(Debug, Clone, Copy)]
pub struct GridData<'a> {
    /// Where and when.
    pub nodes: &'a GridNodes,
    /// x, y and z of the velocity.
    pub components: [&'a [f64]; 3],
}

impl FlowChoice {
    /// Whether the flow comes from data that are read when a run begins.
    #[must_use]
    pub fn is_from_outside(&self) -> bool {
        matches!(self, Self::Grid { .. })
    }

    /// The velocity field in `D` dimensions, for a run until `end_time`. Pointers of errors begin with `pointer`. A flow from data
    /// rests where these are not read yet.
    ///
    /// # Errors
    /// Where it does not exist in this dimension, and all that is wrong with formulas.
    pub fn flow<const D: usize>(
        &self,
        end_time: f64,
        pointer: &str,
        data: Option<GridData<'_>>,
    ) -> Result<Box<dyn Flow<D>>, Vec<Violation>> {
        let choice = Chosen { choice: self, pointer };
        match self {
            Self::SingleVortex { period } => choice.in_plane(SingleVortex { period: *period }),
            Self::Vortex3d { period } => choice.in_space(Vortex3d { period: *period }),
            Self::Rotation { center, angular_velocity } => {
                let center = choice.vector("center", center)?;
                Ok(Box::new(Rotation { center, angular_velocity: *angular_velocity }))
            }
            Self::Translation { velocity } => {
                Ok(Box::new(Translation { velocity: choice.vector("velocity", velocity)? }))
            }
            Self::Formula { velocity, parameters, period } => {
                Ok(Box::new(FormulaFlow::<D>::new(velocity, parameters, *period, end_time, pointer)?))
            }
            Self::Grid { period, .. } => {
                let Some(GridData { nodes, components }) = data else {
                    return Ok(Box::new(UnreadFlow { period: *period }));
                };
                let components = std::array::from_fn(|d| components[d]);
                let flow = GridFlow::<D>::new(nodes, components, *period, end_time);
                flow.map(|flow| -> Box<dyn Flow<D>> { Box::new(flow) })
                    .map_err(|why| vec![Violation::new(pointer, "data", why.to_string(), self.to_json(), Value::Null)])
            }
        }
    }
}

/// A choice and where it stands.
struct Chosen<'a> {
    choice: &'a FlowChoice,
    pointer: &'a str,
}

impl Chosen<'_> {
    /// A flow of the plane, where the scene has two dimensions.
    fn in_plane<const D: usize>(&self, flow: impl Flow<2> + 'static) -> Result<Box<dyn Flow<D>>, Vec<Violation>> {
        let flow: Box<dyn Flow<2>> = Box::new(flow);
        in_dimension(flow).ok_or_else(|| self.exists_elsewhere::<D>("the plane"))
    }

    /// A flow of space, where the scene has three dimensions.
    fn in_space<const D: usize>(&self, flow: impl Flow<3> + 'static) -> Result<Box<dyn Flow<D>>, Vec<Violation>> {
        let flow: Box<dyn Flow<3>> = Box::new(flow);
        in_dimension(flow).ok_or_else(|| self.exists_elsewhere::<D>("space"))
    }

    fn exists_elsewhere<const D: usize>(&self, place: &str) -> Vec<Violation> {
        let name = self.choice.name();
        let detail = format!("{name} is a flow of {place}, the scene has {D} dimensions");
        vec![Violation::new(format!("{}/type", self.pointer), "conflict", detail, name, json!(EXISTING[D - 2]))]
    }

    /// A vector parameter, where it has the dimension of the scene.
    fn vector<const D: usize>(&self, name: &str, numbers: &Coordinates) -> Result<Vector<D>, Vec<Violation>> {
        if numbers.len() == D {
            return Ok(Vector::<D>::from_column_slice(numbers));
        }
        let (at, detail) = (format!("{}/{name}", self.pointer), format!("the scene has {D} dimensions"));
        Err(vec![Violation::new(at, "conflict", detail, numbers.to_json(), json!(format!("{D} numbers")))])
    }
}

/// Support for the tests of flows.
#[cfg(test)]
mod sampling {
    use super::Flow;
    use crate::geometry::Vector;
    use crate::geometry::random::CounterRandom;

    /// Particles that start in the box and the instants at which the speed of each is looked at.
    const PATHS: i64 = 400;
    const INSTANTS: i64 = 40;

    /// The largest speed along the paths of random particles that start in a box, until `end_time`.
    pub fn top_speed<const D: usize>(flow: &dyn Flow<D>, low: &Vector<D>, high: &Vector<D>, end_time: f64) -> f64 {
        let random = CounterRandom::new(7);
        let step = end_time / INSTANTS as f64;
        let mut largest = 0.0_f64;
        for path in 0..PATHS {
            let mut x = Vector::<D>::from_fn(|d, _| {
                let share = 0.5 + 0.5 * random.symmetric(&[path, d as i64]);
                low[d] + share * (high[d] - low[d])
            });
            for instant in 0..INSTANTS {
                let time = instant as f64 * step;
                largest = largest.max(flow.velocity(&x, time).norm());
                let middle = x + flow.velocity(&x, time) * (0.5 * step);
                x += flow.velocity(&middle, time + 0.5 * step) * step;
            }
        }
        largest
    }
}

#[cfg(test)]
mod tests {
    use super::{FlowChoice, Rotation};
    use crate::geometry::{Flow, Vector};

    #[test]
    fn a_flow_exists_in_its_dimension_alone() {
        let vortex = FlowChoice::SingleVortex { period: None };
        assert!(vortex.flow::<2>(1.0, "/flow", None).is_ok());
        let found = vortex.flow::<3>(1.0, "/law/flow", None).err().unwrap().remove(0);
        assert_eq!((found.pointer.as_str(), found.got.as_str()), ("/law/flow/type", Some("single_vortex")));
        let rotation = FlowChoice::Rotation { center: [0.5, 0.5].into(), angular_velocity: 2.0 };
        assert!(rotation.flow::<2>(1.0, "/flow", None).is_ok() && rotation.flow::<3>(1.0, "/flow", None).is_err());
    }

    #[test]
    fn a_flow_that_says_nothing_has_the_neutral_answers() {
        struct Shear;
        impl Flow<2> for Shear {
            fn velocity(&self, x: &Vector<2>, _time: f64) -> Vector<2> {
                Vector::<2>::new(x[1], 0.0)
            }

            fn top_speed(&self, low: &Vector<2>, high: &Vector<2>) -> f64 {
                low[1].abs().max(high[1].abs())
            }
        }
        assert!(!Shear.is_rigid() && !Shear.is_back(0.0));
        assert!(Shear.return_time().is_none() && Shear.typical_stretch().is_none());
        let rotation = Rotation { center: Vector::<2>::zeros(), angular_velocity: 0.0 };
        assert!(rotation.is_rigid() && rotation.return_time().is_none());
    }
}
