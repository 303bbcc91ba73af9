//! The particles of a static redistancing and what is asked of them.

use super::remeshing::{Remeshing, RemeshingKernel};
use crate::closest_point::{
    ClosestPoints, CloudMetric, LevelSurface, PcpMethod, Redistancing, StretchedSurface, SurfaceColumns,
};
use crate::geometry::lattice::Lattice;
use crate::geometry::{Domain, Surface, Vector};
use crate::parallel::Interrupt;
use crate::particles::{Particles, ScalarKey};

/// The level-set function that the particles start with; its zero is the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum InitialLevel<const D: usize> {
    /// √(Σ (x−c)²/A²) − 1 for the given center and semi-axes: no distance.
    Quadric {
        /// Center of the quadric.
        center: Vector<D>,
        /// Semi-axes of the quadric.
        semi_axes: Vector<D>,
    },
    /// The exact distance.
    Distance,
    /// The exact distance times 1 + 0.5 x + 0.3 y.
    Scaled,
}

/// Resting particles about a surface.
pub struct StaticSystem<const D: usize> {
    /// The surface, for errors; None where it is known by its particles alone.
    pub surface: Option<Box<dyn Surface<D>>>,
    /// Particle spacing h.
    pub spacing: f64,
    /// How often to redistance.
    pub repeats: u64,
    pub(super) half_band: f64,
    /// The particles, or the points that are asked about.
    pub(super) particles: Particles<D>,
    pub(super) level: ScalarKey,
    pub(super) columns: SurfaceColumns,
    /// Where the surface comes from, if not from the particles' own level.
    pub(super) source: Source<D>,
    pub(super) initial: InitialLevel<D>,
    pub(super) redistancing: LevelSurface<D>,
    pub(super) answers: ClosestPoints<D>,
    pub(super) interrupt: Interrupt,
}

/// Where the surface comes from.
pub enum Source<const D: usize> {
    /// The particles' own level.
    Particles,
    /// The nodes of a grid that their level is interpolated to.
    Grid(Remeshing<D>),
    /// Other points, which stay as they are.
    Others {
        /// Positions of the points.
        positions: Vec<Vector<D>>,
        /// Level of each point.
        level: Vec<f64>,
    },
}

/// What all static set-ups have in common.
#[derive(Debug, Clone)]
pub struct StaticParts {
    /// Particle spacing h.
    pub spacing: f64,
    /// Half width w/2 of the band.
    pub half_band: f64,
    /// How often to redistance.
    pub repeats: u64,
    /// Parameters of the closest-point method.
    pub method: PcpMethod,
    /// Interpolation to a grid first, if any.
    pub remeshing: Option<RemeshingKernel>,
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
    /// Makes the particles about a surface: those in the band, and beyond it those that fits or interpolation reach.
    #[must_use]
    pub fn about(
        surface: Box<dyn Surface<D>>,
        lattice: &Lattice,
        initial: InitialLevel<D>,
        parts: StaticParts,
        interrupt: Interrupt,
    ) -> Self {
        let StaticParts { spacing, half_band, ref method, remeshing, .. } = parts;
        let of_nodes = half_band.max(method.fit_band_h::<D>() * spacing);
        let reach = of_nodes + remeshing.map_or(0.0, |kernel| kernel.reach_h::<D>() * spacing);
        let (low, high) = surface.bounding_box();
        let margin = reach + spacing;
        let (low, high) = (low.add_scalar(-margin), high.add_scalar(margin));
        let positions = lattice.points_near(&low, &high, reach, |x| surface.signed_distance(x), &interrupt);
        let source = remeshing.map_or(Source::Particles, |kernel| {
            let distance = |x: &Vector<D>| surface.signed_distance(x);
            Source::Grid(Remeshing::new(kernel, spacing, (&low, &high), of_nodes, distance, &interrupt))
        });
        let distances: Vec<f64> = positions.iter().map(|x| surface.signed_distance(x)).collect();
        let levels: Vec<f64> =
            positions.iter().zip(&distances).map(|(x, distance)| initial.value(x, *distance)).collect();
        let in_band = distances.iter().map(|distance| distance.abs() <= half_band).collect();
        let mut system = Self::assemble(positions, &levels, in_band, source, parts, interrupt);
        system.surface = Some(surface);
        system.initial = initial;
        system
    }

    /// Particles with their level from elsewhere: all of them are the band. `metric` is that of a stretched cloud.
    #[must_use]
    pub fn of_points(
        positions: Vec<Vector<D>>,
        levels: &[f64],
        metric: Option<CloudMetric<D>>,
        parts: StaticParts,
        interrupt: Interrupt,
    ) -> Self {
        let in_band = vec![true; positions.len()];
        let stretched = metric.map(|metric| StretchedSurface::new(parts.method.clone(), parts.spacing, metric));
        let mut system = Self::assemble(positions, levels, in_band, Source::Particles, parts, interrupt);
        if let Some(surface) = stretched {
            system.redistancing = LevelSurface::Stretched(Box::new(surface));
        }
        system
    }

    /// Asks about other points instead; the particles become the source of the surface.
    #[must_use]
    pub fn asked_about(self, points: Vec<Vector<D>>) -> Self {
        let source = Source::Others {
            positions: self.particles.positions().to_vec(),
            level: self.particles.scalar(self.level).to_vec(),
        };
        let Self { surface, spacing, repeats, half_band, redistancing, interrupt, initial, .. } = self;
        let mut particles = Particles::new(points);
        let level = particles.add_scalar("level", 0.0);
        let columns = SurfaceColumns::add(&mut particles);
        let answers = ClosestPoints::default();
        Self {
            surface,
            spacing,
            repeats,
            half_band,
            particles,
            level,
            columns,
            source,
            initial,
            redistancing,
            answers,
            interrupt,
        }
    }

    fn assemble(
        positions: Vec<Vector<D>>,
        levels: &[f64],
        in_band: Vec<bool>,
        source: Source<D>,
        parts: StaticParts,
        interrupt: Interrupt,
    ) -> Self {
        let StaticParts { spacing, half_band, repeats, method, .. } = parts;
        let mut particles = Particles::new(positions);
        let level = particles.add_scalar("level", 0.0);
        let columns = SurfaceColumns::add(&mut particles);
        particles.scalar_mut(level).copy_from_slice(levels);
        // Before the first redistancing a frame shows what the particles came with.
        particles.scalar_mut(columns.phi).copy_from_slice(levels);
        for (flag, in_band) in particles.flag_mut(columns.in_band).iter_mut().zip(in_band) {
            *flag = u8::from(in_band);
        }
        let redistancing = LevelSurface::Spatial(Box::new(Redistancing::new(method, Domain::unbounded(), spacing)));
        Self {
            surface: None,
            spacing,
            repeats,
            half_band,
            particles,
            level,
            columns,
            source,
            initial: InitialLevel::Distance,
            redistancing,
            answers: ClosestPoints::default(),
            interrupt,
        }
    }
}
