//! The particles of a static redistancing and what is asked of them.

use crate::closest_point::{Answers, LevelSurface, PcpMethod, Redistancing, SurfaceColumns};
use crate::geometry::lattice::Lattice;
use crate::geometry::{Domain, Surface, Vector};
use crate::parallel::Interrupt;
use crate::particles::{Particles, ScalarKey};

/// The level-set function that the particles start with; its zero is the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum InitialLevel<const D: usize> {
    /// √(Σ (x−c)²/A²) − 1 for the given centre and semi-axes: no distance.
    Quadric {
        /// c.
        center: Vector<D>,
        /// A.
        semi_axes: Vector<D>,
    },
    /// The exact distance.
    Distance,
    /// The exact distance times 1 + 0.5 x + 0.3 y.
    Scaled,
}

/// Resting particles about a surface.
pub struct StaticSystem<const D: usize> {
    /// The surface, for errors.
    pub surface: Box<dyn Surface<D>>,
    /// h.
    pub spacing: f64,
    /// How often to redistance.
    pub repeats: u64,
    pub(super) particles: Particles<D>,
    pub(super) level: ScalarKey,
    pub(super) columns: SurfaceColumns,
    pub(super) redistancing: LevelSurface<D>,
    pub(super) answers: Answers<D>,
    pub(super) interrupt: Interrupt,
}

impl<const D: usize> StaticSystem<D> {
    /// Makes the particles: those in the band, and beyond it those that fits reach.
    #[must_use]
    pub fn new(
        surface: Box<dyn Surface<D>>,
        lattice: &Lattice,
        method: PcpMethod,
        initial: InitialLevel<D>,
        half_band: f64,
        repeats: u64,
        interrupt: Interrupt,
    ) -> Self {
        let spacing = lattice.spacing;
        let reach = half_band.max(method.reach_h::<D>() * spacing);
        let (low, high) = surface.bounding_box();
        let margin = reach + spacing;
        let (low, high) = (low.add_scalar(-margin), high.add_scalar(margin));
        let positions = lattice.points_near(&low, &high, reach, |x| surface.signed_distance(x), &interrupt);
        let mut particles = Particles::new(positions);
        let level = particles.add_scalar("level", 0.0);
        let columns = SurfaceColumns::add(&mut particles);
        for i in 0..particles.len() {
            let x = particles.positions()[i];
            let distance = surface.signed_distance(&x);
            particles.scalar_mut(level)[i] = match initial {
                InitialLevel::Quadric { center, semi_axes } => (x - center).component_div(&semi_axes).norm() - 1.0,
                InitialLevel::Distance => distance,
                InitialLevel::Scaled => distance * (1.0 + 0.5 * x[0] + 0.3 * x[1]),
            };
            // Before the first redistancing a frame shows what the particles came with.
            particles.scalar_mut(columns.phi)[i] = particles.scalar(level)[i];
            particles.flag_mut(columns.in_band)[i] = u8::from(distance.abs() <= half_band);
        }
        let answers = Answers::default();
        let redistancing = LevelSurface::Spatial(Box::new(Redistancing::new(method, Domain::unbounded(), spacing)));
        Self { surface, spacing, repeats, particles, level, columns, redistancing, answers, interrupt }
    }
}
