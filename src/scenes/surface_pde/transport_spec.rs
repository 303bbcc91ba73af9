//! What carries a field along a surface, and what moves a surface, as a scene names it.

use crate::geometry::flows::FlowChoice;
use crate::spec::Coordinates;

crate::choice! {
    /// A tangential velocity: the tangential part of what is given.
    pub enum VelocityChoice {
        /// ω e × (x − c)
        Rotation = "rotation" {
            /// direction e of the axis; z when not given
            axis: Option<Coordinates>;
            /// a place c on the axis; the origin when not given
            center: Option<Coordinates>;
            /// angular speed ω
            rate: f64 = 1.0;
        }
        /// a constant velocity
        Uniform = "uniform" {
            /// the velocity; 1 along x when not given
            velocity: Option<Coordinates>;
        }
        /// n × ∇ₛψ with ψ = a sin(k·x): without divergence on any surface
        Stream = "stream" {
            /// wave vector k; when not given, (2, −1, 3) by the extent of the surface
            k: Option<Coordinates>;
            /// amplitude a
            amplitude: f64 = 1.0;
        }
    }
}

crate::choice! {
    /// The motion of a surface, whose points go along.
    pub enum MotionChoice {
        ..Flow(FlowChoice)
        /// v = a (x − c)
        Expansion = "expansion" {
            /// rate a
            rate: f64 = 0.5;
            /// place c that stays; the origin when not given
            center: Option<Coordinates>;
        }
        /// along the normals of the surface
        Normal = "normal" {
            /// speed, outward
            speed: f64 = 0.1;
        }
    }
}
