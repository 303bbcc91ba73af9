//! Walls as layers of points that continue the lattice of the particles, with what the fluid in front of them has, extrapolated:
//! pressure and velocity (after Adami, Hu, Adams 2012).
//!
//! A point x_w behind the wall has a foot x₀ on it. With the weights w_f of the particles around the foot and their distances s_f
//! from the wall:
//!
//! - pressure: Σ w (p_f + ρ_f g_f·(x_w − x_f))/Σ w, so that a fluid at rest under gravity stays at rest;
//! - velocity at a wall that holds the fluid: u_wall + a s + b s², fitted to the particles, at s = −|x_w − x₀|. Velocities that vanish
//!   at the wall and are quadratic, as in Poiseuille flow, are continued exactly;
//! - velocity at a wall that lets the fluid slip: the mirror image, c + b s² along the wall, and −(a s + b s²) across it;
//! - viscosity: the mean Σ w η_f/Σ w.
//!
//! Where no particle is near the foot, as inside of a body that stands on a wall, the particles around the point itself count.

pub mod container;
pub(super) mod level;
pub mod obstacle;
pub mod wall;

pub use container::Container;
pub use obstacle::Obstacle;
pub use wall::{Beside, ContactAngle, Wall};

use super::flow_state::FlowState;
use super::interactions::BodyForce;
use super::interface::extension::Extension;
use crate::geometry::{Domain, Vector};
use crate::neighbors::{CellList, NeighborSearch};
use rayon::prelude::{IndexedParallelIterator, IntoParallelRefIterator, IntoParallelRefMutIterator, ParallelIterator};

/// A point of the layers.
#[derive(Debug, Clone)]
struct Point<const D: usize> {
    position: Vector<D>,
    /// The nearest place of the fluids' space.
    foot: Vector<D>,
    /// Direction from the foot to the point.
    normal: Vector<D>,
    depth: f64,
    wall: usize,
}

impl<const D: usize> Point<D> {
    /// The way to the point from the place around which particles count for it: its foot, or itself.
    fn way_from(&self, origin: &Vector<D>) -> Vector<D> {
        if *origin == self.foot { self.normal * self.depth } else { Vector::<D>::zeros() }
    }
}

/// What a point has of the fluid in front of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Continued<const D: usize> {
    pub velocity: Vector<D>,
    /// The pressure with which it acts on particles.
    pressure: f64,
    viscosity: f64,
}

/// The layers of points.
#[derive(Debug)]
pub(super) struct Walls<const D: usize> {
    domain: Domain<D>,
    pub container: Container<D>,
    points: Vec<Point<D>>,
    /// Radius of the weights.
    radius: f64,
    skin: f64,
    /// Particles next to walls.
    near: Vec<usize>,
    /// The place of each point around which particles count: its foot, or itself where none is near that.
    origins: Vec<Vector<D>>,
    /// Those around the origins, as places in `near`, behind each other, and where those of each point begin.
    neighbors: Vec<u32>,
    begins: Vec<usize>,
    /// What the particles next to walls have, in the order of `near`.
    front: Vec<InFront<D>>,
    /// Volumes, by summation.
    pub volume: Vec<f64>,
    continued: Vec<Continued<D>>,
    /// Forces of the particles on the points.
    pub force: Vec<Vector<D>>,
    /// The level of an interface behind the walls.
    pub extension: Extension<D>,
}

/// What comes through the walls.
#[derive(Debug, Clone, Copy)]
pub(super) struct WallSupply<const D: usize> {
    /// Power of moving walls.
    pub power: f64,
    /// Force of the walls on the fluids.
    pub force: Vector<D>,
}

impl<const D: usize> Walls<D> {
    /// Walls with points at these positions. `radius` is that of the kernel, `skin` that of the neighbor lists, `cell` the volume of
    /// a particle.
    pub fn new(
        container: Container<D>,
        positions: &[Vector<D>],
        domain: &Domain<D>,
        (radius, skin): (f64, f64),
        cell: f64,
    ) -> Self {
        let point = |x: &Vector<D>| {
            let foot = container.foot(x);
            let way = x - foot;
            let depth = way.norm();
            let wall = container.beside(x).map_or(0, |beside| beside.wall);
            Point { position: *x, foot, normal: way / depth.max(f64::MIN_POSITIVE), depth, wall }
        };
        let points: Vec<Point<D>> = positions.iter().map(point).collect();
        let at_rest = Continued { velocity: Vector::<D>::zeros(), pressure: 0.0, viscosity: 0.0 };
        Self {
            near: Vec::new(),
            front: Vec::new(),
            origins: Vec::new(),
            neighbors: Vec::new(),
            begins: Vec::new(),
            volume: vec![cell; points.len()],
            continued: vec![at_rest; points.len()],
            force: vec![Vector::<D>::zeros(); points.len()],
            extension: Extension::default(),
            domain: domain.clone(),
            container,
            points,
            radius,
            skin,
        }
    }

    /// Positions of the points.
    pub fn positions(&self) -> impl Iterator<Item = Vector<D>> + '_ {
        self.points.iter().map(|point| point.position)
    }

    /// Lists the particles around the feet; it holds as long as the neighbor lists do.
    pub fn list(&mut self, positions: &[Vector<D>]) {
        let reach = self.radius + self.skin;
        let is_near = |i: &usize| self.container.beside(&positions[*i]).is_some_and(|beside| beside.distance < reach);
        self.near = (0..positions.len()).filter(is_near).collect();
        let mut cells = CellList::new(self.domain.clone());
        cells.rebuild(self.near.iter().map(|i| positions[*i]), reach);
        let around = |point: &Point<D>| {
            let mut found = Vec::new();
            let mut origin = point.foot;
            // A point that is too deep for any particle has none.
            if point.depth < reach {
                cells.for_each_within(&origin, reach, |k, _, _| found.push(k as u32));
            }
            if found.is_empty() {
                origin = point.position;
                cells.for_each_within(&origin, reach, |k, _, _| found.push(k as u32));
            }
            found.sort_unstable();
            (origin, found)
        };
        let lists: Vec<(Vector<D>, Vec<u32>)> = self.points.par_iter().map(around).collect();
        self.origins.clear();
        self.neighbors.clear();
        self.begins.clear();
        for (origin, list) in &lists {
            self.origins.push(*origin);
            self.begins.push(self.neighbors.len());
            self.neighbors.extend_from_slice(list);
        }
        self.begins.push(self.neighbors.len());
    }

    /// Continues the fluid behind the walls.
    pub fn continue_flow(
        &mut self,
        positions: &[Vector<D>],
        flow: &FlowState<D>,
        force: Option<&BodyForce<D>>,
        time: f64,
    ) {
        let Self { domain, container, points, radius, near, front, origins, neighbors, begins, continued, .. } = self;
        let around = Around { domain, radius: *radius, positions, near };
        front.clear();
        front.extend(near.iter().map(|i| {
            let (x, species) = (&positions[*i], flow.species[*i]);
            InFront {
                distance: container.beside(x).map_or(0.0, |beside| beside.distance) / *radius,
                velocity: flow.predicted[*i],
                pressure: flow.pair_pressure(*i),
                weight: force.map_or_else(Vector::<D>::zeros, |force| force.acceleration(x, time, species))
                    * flow.density[*i],
                viscosity: flow.fluid(*i).viscosity,
            }
        }));
        let least_viscosity = flow.fluids.least_viscosity();
        let fluid = Fluid { around, container, front, background: flow.background, least_viscosity };
        continued.par_iter_mut().zip(points.par_iter()).enumerate().with_min_len(64).for_each(
            |(k, (continued, point))| {
                *continued = fluid.continued(point, &origins[k], &neighbors[begins[k]..begins[k + 1]]);
            },
        );
    }

    /// Power and force of the walls at the last evaluation.
    pub fn supply(&self) -> WallSupply<D> {
        let mut supply = WallSupply { power: 0.0, force: Vector::<D>::zeros() };
        for (point, force) in self.points.iter().zip(&self.force) {
            supply.force -= force;
            supply.power -= force.dot(&self.container.wall(point.wall).velocity);
        }
        supply
    }

    /// How deep in a wall the deepest particle is.
    pub fn depth(&self, positions: &[Vector<D>]) -> f64 {
        let depth = |x: &Vector<D>| self.container.beside(x).map_or(0.0, |beside| -beside.distance);
        positions.iter().map(depth).fold(f64::NEG_INFINITY, f64::max)
    }
}

/// Particles, and behind them the points of walls.
pub(super) struct FlowAndWalls<'a, const D: usize> {
    pub flow: &'a FlowState<D>,
    pub walls: Option<&'a Walls<D>>,
}

impl<const D: usize> FlowAndWalls<'_, D> {
    /// A value of a particle, or of a point of a wall.
    #[inline]
    fn of<T>(&self, i: usize, particle: impl FnOnce(usize) -> T, point: impl FnOnce(&Walls<D>, usize) -> T) -> T {
        match self.walls {
            Some(walls) if i >= self.flow.count() => point(walls, i - self.flow.count()),
            _ => particle(i),
        }
    }

    pub fn volume(&self, i: usize) -> f64 {
        self.of(i, |i| self.flow.volume[i], |walls, k| walls.volume[k])
    }

    /// The pressure with which it acts on others.
    pub fn pressure(&self, i: usize) -> f64 {
        self.of(i, |i| self.flow.pair_pressure(i), |walls, k| walls.continued[k].pressure)
    }

    pub fn viscosity(&self, i: usize) -> f64 {
        self.of(i, |i| self.flow.fluid(i).viscosity, |walls, k| walls.continued[k].viscosity)
    }

    pub fn velocity(&self, i: usize) -> Vector<D> {
        self.of(i, |i| self.flow.predicted[i], |walls, k| walls.continued[k].velocity)
    }
}

/// A particle in front of a wall.
#[derive(Debug, Clone, Copy)]
struct InFront<const D: usize> {
    /// Distance from the wall by the radius of the weights.
    distance: f64,
    velocity: Vector<D>,
    pressure: f64,
    /// ρ g of the body force.
    weight: Vector<D>,
    viscosity: f64,
}

/// The particles around origins.
#[derive(Clone, Copy)]
struct Around<'a, const D: usize> {
    domain: &'a Domain<D>,
    radius: f64,
    positions: &'a [Vector<D>],
    near: &'a [usize],
}

impl<const D: usize> Around<'_, D> {
    /// The way from a place to a particle next to walls.
    fn way(&self, origin: &Vector<D>, k: usize) -> Vector<D> {
        self.domain.displacement(origin, &self.positions[self.near[k]])
    }

    /// The length of a way by the radius, and the weight (1 − q)⁴ (1 + 4q) of a particle there.
    fn weight(&self, way: &Vector<D>) -> (f64, f64) {
        let q = way.norm() / self.radius;
        let rest = (1.0 - q).max(0.0) * (1.0 - q).max(0.0);
        (q, rest * rest * (1.0 + 4.0 * q))
    }
}

/// The fluid that walls continue.
struct Fluid<'a, const D: usize> {
    around: Around<'a, D>,
    container: &'a Container<D>,
    front: &'a [InFront<D>],
    /// The pressure and the viscosity where there are no particles.
    background: f64,
    least_viscosity: f64,
}

/// Weighted sums over the particles around an origin, distances in units of the radius.
#[derive(Debug, Clone, Copy)]
struct Sums<const D: usize> {
    /// Σ w s^k for k = 0 to 4.
    moments: [f64; 5],
    /// Σ w s^k v for k = 0 to 2, with the velocity v about that of the wall.
    velocity: [Vector<D>; 3],
    pressure: f64,
    viscosity: f64,
}

impl<const D: usize> Fluid<'_, D> {
    fn sums(&self, to_point: &Vector<D>, origin: &Vector<D>, wall: &Wall<D>, neighbors: &[u32]) -> Sums<D> {
        let mut sums = Sums { moments: [0.0; 5], velocity: [Vector::<D>::zeros(); 3], pressure: 0.0, viscosity: 0.0 };
        for k in neighbors.iter().map(|k| *k as usize) {
            let way = self.around.way(origin, k);
            let (_, weight) = self.around.weight(&way);
            if weight <= 0.0 {
                continue;
            }
            let particle = &self.front[k];
            let velocity = particle.velocity - wall.velocity;
            let mut share = weight;
            for power in 0..5 {
                sums.moments[power] += share;
                if power < 3 {
                    sums.velocity[power] += velocity * share;
                }
                share *= particle.distance;
            }
            sums.pressure += weight * (particle.pressure + particle.weight.dot(&(to_point - way)));
            sums.viscosity += weight * particle.viscosity;
        }
        sums
    }

    fn continued(&self, point: &Point<D>, origin: &Vector<D>, neighbors: &[u32]) -> Continued<D> {
        let wall = self.container.wall(point.wall);
        let sums = self.sums(&point.way_from(origin), origin, wall, neighbors);
        let all = sums.moments[0];
        if all <= 0.0 {
            let (pressure, viscosity) = (self.background, self.least_viscosity);
            return Continued { velocity: wall.velocity, pressure, viscosity };
        }
        // Without particles at its foot a point is the mirror image of those around it.
        let s = if *origin == point.foot { -point.depth / self.around.radius } else { -sums.moments[1] / all };
        let about_wall = if wall.holds_fluid {
            sums.vanishing(s)
        } else {
            let across = sums.vanishing(-s) * -1.0;
            let along = sums.even(s);
            along + point.normal * (across - along).dot(&point.normal)
        };
        Continued {
            velocity: wall.velocity + about_wall,
            pressure: sums.pressure / all,
            viscosity: sums.viscosity / all,
        }
    }
}

/// Share of the product of the diagonal below which a determinant tells nothing: the particles have one distance from the wall.
const LEAST_DETERMINANT: f64 = 1e-6;

impl<const D: usize> Sums<D> {
    /// a s + b s² as it fits the velocities best.
    fn vanishing(&self, s: f64) -> Vector<D> {
        let [_, _, m2, m3, m4] = self.moments;
        let determinant = m2 * m4 - m3 * m3;
        if determinant <= LEAST_DETERMINANT * m2 * m4 {
            return self.velocity[1] * (s / m2);
        }
        let a = (self.velocity[1] * m4 - self.velocity[2] * m3) / determinant;
        let b = (self.velocity[2] * m2 - self.velocity[1] * m3) / determinant;
        a * s + b * (s * s)
    }

    /// c + b s² as it fits the velocities best.
    fn even(&self, s: f64) -> Vector<D> {
        let [m0, _, m2, _, m4] = self.moments;
        let determinant = m0 * m4 - m2 * m2;
        if determinant <= LEAST_DETERMINANT * m0 * m4 {
            return self.velocity[0] / m0;
        }
        let c = (self.velocity[0] * m4 - self.velocity[2] * m2) / determinant;
        let b = (self.velocity[2] * m0 - self.velocity[0] * m2) / determinant;
        c + b * (s * s)
    }
}

#[cfg(test)]
mod tests {
    use super::level::Levels;
    use super::{ContactAngle, Container, Wall};
    use super::{FlowState, Walls};
    use crate::geometry::domain::Axis;
    use crate::geometry::{Domain, Vector};
    use crate::schemes::weakly_compressible_sph::{BodyForce, Fluid, Fluids};

    /// Fluid above a wall at y = 0, with points below it; the upper wall is far away.
    fn setting(holds_fluid: bool, velocity: f64) -> (Walls<2>, Vec<Vector<2>>) {
        let wall = Wall { velocity: Vector::<2>::new(velocity, 0.0), holds_fluid, contact: ContactAngle::of(1.5) };
        let (low, high) = (Vector::<2>::zeros(), Vector::<2>::new(12.0, 40.0));
        let container = Container::new(low, high, [None, Some([wall.clone(), wall])]);
        let axis = |start, length| Axis::Periodic { start, length };
        let domain = Domain::new([axis(0.0, 12.0), axis(-5.0, 50.0)]);
        let row = |y: f64| (0..12).map(move |k| Vector::<2>::new(f64::from(k) + 0.5, y + 0.5));
        let positions: Vec<Vector<2>> = (0..10).flat_map(|k| row(f64::from(k))).collect();
        let behind: Vec<Vector<2>> = (1..5).flat_map(|k| row(f64::from(-k))).collect();
        let mut walls = Walls::new(container, &behind, &domain, (3.5, 0.3), 1.0);
        walls.list(&positions);
        (walls, positions)
    }

    fn flow(positions: &[Vector<2>], velocity: impl Fn(&Vector<2>) -> Vector<2>) -> FlowState<2> {
        let fluid = Fluid { density: 2.0, viscosity: 0.5, sound_speed: 20.0, polytropic: 7.0 };
        let level = vec![1.0; positions.len()];
        let velocities = positions.iter().map(velocity).collect();
        FlowState::in_motion(Fluids { inside: fluid, outside: fluid }, 1.0, &level, velocities)
    }

    #[test]
    fn velocities_that_are_quadratic_in_the_distance_are_continued_exactly() {
        let (mut walls, positions) = setting(true, 0.7);
        let profile = |y: f64| 0.7 + 0.3 * y - 0.02 * y * y;
        walls.continue_flow(&positions, &flow(&positions, |x| Vector::<2>::new(profile(x[1]), 0.0)), None, 0.0);
        for (point, continued) in walls.points.iter().zip(&walls.continued).filter(|(point, _)| point.depth < 3.0) {
            assert!((continued.velocity[0] - profile(-point.depth)).abs() < 1e-10);
            assert!((continued.viscosity - 0.5).abs() < 1e-14);
        }
        // A wall that lets the fluid slip has its mirror image.
        let (mut walls, positions) = setting(false, 0.7);
        let mirrored = |x: &Vector<2>| Vector::<2>::new(1.0 + 0.1 * x[1] * x[1], 0.2 * x[1]);
        walls.continue_flow(&positions, &flow(&positions, mirrored), None, 0.0);
        for (point, continued) in walls.points.iter().zip(&walls.continued).filter(|(point, _)| point.depth < 3.0) {
            let image = mirrored(&Vector::<2>::new(0.0, point.depth));
            assert!((continued.velocity - Vector::<2>::new(image[0], -image[1])).norm() < 1e-10);
        }
    }

    #[test]
    fn the_pressure_of_a_fluid_at_rest_under_gravity_is_continued_exactly() {
        let (mut walls, positions) = setting(true, 0.0);
        let mut flow = flow(&positions, |_| Vector::<2>::zeros());
        flow.pressure = positions.iter().map(|x| 100.0 - 2.0 * 9.0 * x[1]).collect();
        let gravity = BodyForce::Constant(Vector::<2>::new(0.0, -9.0));
        walls.continue_flow(&positions, &flow, Some(&gravity), 0.0);
        for (point, continued) in walls.points.iter().zip(&walls.continued).filter(|(point, _)| point.depth < 3.0) {
            assert!((continued.pressure - (100.0 + 18.0 * point.depth)).abs() < 1e-10);
        }
    }

    #[test]
    fn circles_and_lines_are_continued_exactly() {
        let (mut walls, positions) = setting(true, 0.0);
        let circle = |x: &Vector<2>| (x - Vector::<2>::new(6.0, -3.0)).norm() - 5.0;
        let line = |x: &Vector<2>| (x[0] - 6.0) * 0.6 - 0.8 * x[1];
        for exact in [&circle as &dyn Fn(&Vector<2>) -> f64, &line] {
            let level: Vec<f64> = positions.iter().map(exact).collect();
            walls.extend_level(Levels { positions: &positions, level: &level, reach: 4.0 });
            assert!(walls.extension.level.len() > 10);
            for (x, level) in walls.extension.positions.iter().zip(&walls.extension.level) {
                // Fits do not reach across the sides of the box, where the level jumps.
                if (x[0] - 6.0).abs() < 2.5 {
                    assert!((level - exact(x)).abs() < 1e-9, "{level} at {x}");
                }
            }
        }
    }
}
