//! The particle that is fastest, as checks of the Mach number need it.

use super::system::SphSystem;

/// The particle that is fastest by the speed of sound in its fluid.
pub(super) struct Fastest {
    pub particle: usize,
    pub speed: f64,
    /// Speed of sound in its fluid.
    pub sound_speed: f64,
}

pub(super) fn fastest<const D: usize>(system: &SphSystem<D>) -> Fastest {
    let mut fastest = (0, 0.0);
    for (i, u) in system.flow.velocity.iter().enumerate() {
        let square = u.norm_squared() / system.flow.fluid(i).sound_speed.powi(2);
        if square > fastest.1 {
            fastest = (i, square);
        }
    }
    let particle = fastest.0;
    let speed = system.flow.velocity[particle].norm();
    Fastest { particle, speed, sound_speed: system.flow.fluid(particle).sound_speed }
}
