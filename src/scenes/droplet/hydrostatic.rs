//! A start at rest under gravity: the lattice between walls is compressed as the pressure ρgh asks for.
//!
//! Along an axis with walls and a gravity g the pressure follows from dp/dy = ρ̄ g with the mean density ρ̄ of the fluids at a height.
//! A volume V at the pressure p is V₀ ρ₀/ρ(p), so that places move to y(y₀) = ∫ ρ₀/ρ(p) dy₀; the pressure at one end is such that the
//! walls stay where they are. The layers behind the walls are compressed on as the fluid next to them.

use super::numbers::SceneNumbers;
use super::room::Room;
use super::spec::Droplet;
use crate::geometry::Vector;
use crate::schemes::weakly_compressible_sph::{BodyForce, Fluids, Species, SphConfig};

/// Nodes of the integrals for each spacing.
const NODES: f64 = 8.0;
/// Halvings of the interval in which the pressure at the lower end lies.
const HALVINGS: usize = 200;

/// Fluids at rest between walls.
pub(super) struct Hydrostatic<'a, const D: usize> {
    pub room: &'a Room<D>,
    pub fluids: &'a Fluids,
    pub gravity: Vector<D>,
    pub spacing: f64,
}

impl<const D: usize> Hydrostatic<'_, D> {
    /// Moves places to where they are at rest. `level` tells the fluids of the first of them.
    pub fn settle(&self, positions: &mut [Vector<D>], level: &[f64], behind_walls: &mut [Vector<D>]) {
        for d in (0..D).filter(|d| self.room.is_bounded(*d) && self.gravity[*d] != 0.0) {
            let column = Column::new(self, d, positions, level);
            for x in positions.iter_mut().chain(behind_walls.iter_mut()) {
                x[d] = self.room.low[d] + column.settled(x[d] - self.room.low[d]);
            }
        }
    }

    /// Half of the largest difference of the pressure: what keeps all pressures positive.
    pub fn half_pressure(&self) -> f64 {
        let density = self.fluids.inside.density.max(self.fluids.outside.density);
        let lengths = self.room.lengths();
        let bounded = (0..D).filter(|d| self.room.is_bounded(*d));
        0.5 * density * bounded.map(|d| self.gravity[d].abs() * lengths[d]).sum::<f64>()
    }
}

/// Pressure by Δρ g D that keeps the pressures of fluids positive while a drop of a diameter D rises. The drop of Hysing et al. comes to the
/// same height with .1 to 2; with less than .5 it becomes too flat (measured; docs/results/wall-notes.md).
const RISE_PRESSURE: f64 = 0.5;

/// The pressure that keeps the pressures of fluids between walls positive under gravity.
pub(super) fn pressure_of_height<const D: usize>(
    spec: &Droplet,
    config: &SphConfig<D>,
    room: &Room<D>,
    numbers: &SceneNumbers,
) -> f64 {
    match &config.body_force {
        Some(BodyForce::Constant(gravity)) => {
            let fluids = &config.fluids;
            Hydrostatic { room, fluids, gravity: *gravity, spacing: config.spacing }.half_pressure()
        }
        Some(_) => {
            let difference = (spec.fluids.inside.density - spec.fluids.outside.density).abs();
            RISE_PRESSURE * difference * numbers.gravity * 2.0 * numbers.radius.unwrap_or(0.0)
        }
        None => 0.0,
    }
}

/// Heights at rest along one axis.
struct Column {
    /// Distance of two nodes.
    width: f64,
    /// Height at rest of each node, from the lower wall; the first node lies there.
    settled: Vec<f64>,
    /// Stretch at both ends, for what lies beyond.
    ends: [f64; 2],
}

impl Column {
    fn new<const D: usize>(this: &Hydrostatic<'_, D>, d: usize, positions: &[Vector<D>], level: &[f64]) -> Self {
        let length = this.room.lengths()[d];
        let nodes = (NODES * (length / this.spacing).ceil().max(1.0)) as usize;
        let width = length / nodes as f64;
        // Particles count for the heights within half of a spacing, with the weight of a hat: an interface between two rows is sharp.
        let reach = 0.5 * this.spacing;
        let mut counts = vec![[0.0; 2]; nodes];
        for (x, level) in positions.iter().zip(level) {
            let height = x[d] - this.room.low[d];
            let first = ((height - reach) / width).floor().max(0.0) as usize;
            for (k, count) in counts.iter_mut().enumerate().skip(first) {
                let away = ((k as f64 + 0.5) * width - height).abs() / reach;
                if away >= 1.0 && (k as f64) * width > height {
                    break;
                }
                count[usize::from(Species::from_level(*level) == Species::Inside)] += (1.0 - away).max(0.0);
            }
        }
        let inside: Vec<f64> =
            counts.iter().map(|[outside, inside]| inside / f64::max(outside + inside, f64::MIN_POSITIVE)).collect();
        let fluids = this.fluids;
        let density = |k: usize| inside[k] * fluids.inside.density + (1.0 - inside[k]) * fluids.outside.density;
        let stretch = |k: usize, p: f64| {
            let of = |species: Species| fluids[species].density / fluids[species].density_at(p);
            inside[k] * of(Species::Inside) + (1.0 - inside[k]) * of(Species::Outside)
        };
        // Pressures at the middles of the intervals, from that at the lower wall.
        let pressures = |lowest: f64| {
            let mut p = lowest;
            (0..nodes).map(move |k| {
                let step = density(k) * this.gravity[d] * width;
                p += step;
                p - 0.5 * step
            })
        };
        let height = |lowest: f64| -> f64 { pressures(lowest).enumerate().map(|(k, p)| stretch(k, p) * width).sum() };
        let whole: f64 = (0..nodes).map(|k| (density(k) * this.gravity[d] * width).abs()).sum();
        // A higher pressure makes the column shorter.
        let (mut low, mut high) = (-whole, whole);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if height(middle) > length { low = middle } else { high = middle }
        }
        let lowest = 0.5 * (low + high);
        let stretches: Vec<f64> = pressures(lowest).enumerate().map(|(k, p)| stretch(k, p)).collect();
        let mut settled = vec![0.0];
        let mut y = 0.0;
        for stretch in &stretches {
            y += stretch * width;
            settled.push(y);
        }
        let ends = [stretches.first(), stretches.last()].map(|stretch| stretch.copied().unwrap_or(1.0));
        Self { width, settled, ends }
    }

    /// The height at rest of a height in the lattice.
    fn settled(&self, y: f64) -> f64 {
        let nodes = self.settled.len() - 1;
        let at = y / self.width;
        if at <= 0.0 {
            return y * self.ends[0];
        }
        if at >= nodes as f64 {
            return self.settled[nodes] + (y - nodes as f64 * self.width) * self.ends[1];
        }
        let k = at as usize;
        self.settled[k] + (at - k as f64) * (self.settled[k + 1] - self.settled[k])
    }
}
