//! The particles of a static redistancing and what is asked of them.

use super::remeshing::{Remeshing, RemeshingKernel};
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
    pub(super) half_band: f64,
    pub(super) particles: Particles<D>,
    pub(super) level: ScalarKey,
    pub(super) columns: SurfaceColumns,
    /// Where the surface comes from, if not from the particles' own level.
    pub(super) remeshing: Option<Remeshing<D>>,
    pub(super) initial: InitialLevel<D>,
    pub(super) redistancing: LevelSurface<D>,
    pub(super) answers: Answers<D>,
    pub(super) interrupt: Interrupt,
}

impl<const D: usize> InitialLevel<D> {
    /// The level at a point at the given distance from the surface.
    #[must_use]
    pub fn value(&self, x: &Vector<D>, distance: f64) -> f64 {
        match self {
            Self::Quadric { center, semi_axes } => (x - center).component_div(semi_axes).norm() - 1.0,
            Self::Distance => distance,
            Self::Scaled => distance * (1.0 + 0.5 * x[0] + 0.3 * x[1]),
        }
    }
}

impl<const D: usize> StaticSystem<D> {
    /// Makes the particles: those in the band, and beyond it those that fits or interpolation reach.
    #[must_use]
    #[expect(clippy::too_many_arguments, reason = "the parts of a scene, named one by one")]
    pub fn new(
        surface: Box<dyn Surface<D>>,
        lattice: &Lattice,
        method: PcpMethod,
        remeshing: Option<RemeshingKernel>,
        initial: InitialLevel<D>,
        half_band: f64,
        repeats: u64,
        interrupt: Interrupt,
    ) -> Self {
        let spacing = lattice.spacing;
        let of_nodes = half_band.max(method.reach_h::<D>() * spacing);
        let reach = of_nodes + remeshing.map_or(0.0, |kernel| kernel.reach_h::<D>() * spacing);
        let (low, high) = surface.bounding_box();
        let margin = reach + spacing;
        let (low, high) = (low.add_scalar(-margin), high.add_scalar(margin));
        let positions = lattice.points_near(&low, &high, reach, |x| surface.signed_distance(x), &interrupt);
        let remeshing = remeshing.map(|kernel| {
            Remeshing::new(kernel, spacing, (&low, &high), of_nodes, |x| surface.signed_distance(x), &interrupt)
        });
        let mut particles = Particles::new(positions);
        let level = particles.add_scalar("level", 0.0);
        let columns = SurfaceColumns::add(&mut particles);
        for i in 0..particles.len() {
            let x = particles.positions()[i];
            let distance = surface.signed_distance(&x);
            particles.scalar_mut(level)[i] = initial.value(&x, distance);
            // Before the first redistancing a frame shows what the particles came with.
            particles.scalar_mut(columns.phi)[i] = particles.scalar(level)[i];
            particles.flag_mut(columns.in_band)[i] = u8::from(distance.abs() <= half_band);
        }
        let answers = Answers::default();
        let redistancing = LevelSurface::Spatial(Box::new(Redistancing::new(method, Domain::unbounded(), spacing)));
        Self {
            surface,
            spacing,
            repeats,
            half_band,
            particles,
            level,
            columns,
            remeshing,
            initial,
            redistancing,
            answers,
            interrupt,
        }
    }
}
