//! A surfactant on the interface, carried by the particles next to it.
//!
//! Each particle i has a share A = V δ_{ε/2}(φ) of the interface, whose sum is the area, and an amount M = ∫ x dA of the surfactant, x its
//! coverage. Amounts move with the particles and pass between them in pairs, so that none is lost:
//!
//! F_ij = w_ij (A_j M_i − A_i M_j)/s̄, w_ij = w(|y_i − y_j|/R), s_i = Σ_j w_ij A_j
//!
//! with the foot points y, w of the surface filter, and the mean s̄ of s_i and s_j. L M = Σ_j F_ij vanishes for an even coverage,
//! whatever the arrangement, and is near M across the interface, near −(q/2d) A Δ(M/A) along it, where q is the second moment of
//! w and d = D − 1.
//!
//! - **Mixing**: M ← M − α L³ M in a repair time. Particles at other distances from the interface move otherwise than it; mixing makes
//!   them share what they carry. Along the interface it is of sixth order in R.
//! - **Diffusion**: M ← M − Δt D_s (2d/q) L M, each pair with its mean of q s.
//!
//! The coverage at a foot point is (2S − S²)[x] of S[x] = Σ w M/Σ w A; its gradient along the interface is that of a linear fit with
//! the weights w A.
//!
//! Adami, Hu and Adams (Adami 2010, surfactants) carry a surfactant by particles of a smoothed interface likewise;
//! feet, mixing and moments are beyond that.

use super::flow_state::FlowState;
use super::smoothed_delta::smoothed_delta;
use super::tension_law::SurfactantConfig;
use crate::closest_point::SurfaceColumns;
use crate::geometry::{Domain, Vector};
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::{BLOCK, Interrupt, Interrupted};
use crate::particles::{Particles, ScalarKey};
use rayon::prelude::{
    IndexedParallelIterator, IntoParallelRefMutIterator, ParallelIterator, ParallelSlice, ParallelSliceMut,
};

/// Radius R of the weights, in h. With 2.25 a drop of 8 particles a radius at a Laplace number of 8e5 gains energy (measured).
pub const RADIUS_H: f64 = 3.0;

/// Constants of the transport.
struct Tuning {
    /// Width of the δ that gives particles their shares, by ε. Particles farther out move less like the interface: with 1 the decay of
    /// oscillations at 8 particles a radius is 5 % worse (measured; less than a half makes shares uneven).
    width: f64,
    /// Share of a difference across the interface that is mixed in a repair time. Less lets elastic waves of five spacings grow at
    /// low viscosities. Frequencies and decays do not depend on it (measured; docs/results/droplet-notes.md).
    mixing: f64,
    /// The longest step of diffusion, in R²/D_s. In the plane .0675 holds and .075 does not (measured). q/d is about .07 R²: there
    /// waves of the eigenvalue 1 of L become unstable.
    step: f64,
}

const TUNING: Tuning = Tuning { width: 0.5, mixing: 0.9, step: 0.025 };

/// The longest stable step of a diffusivity along the interface.
pub(super) fn longest_step(diffusivity: f64, spacing: f64) -> f64 {
    let radius = RADIUS_H * spacing;
    TUNING.step * radius * radius / diffusivity
}

/// A particle that has a share of the interface or carries surfactant next to it.
#[derive(Debug, Clone, Copy)]
struct Member<const D: usize> {
    particle: usize,
    foot: Vector<D>,
    normal: Vector<D>,
    /// Share A of the interface in the transport.
    area: f64,
    /// Share of the interface in sums over it, V δ_ε.
    wide_area: f64,
    /// Amount M.
    amount: f64,
}

/// A neighbor of a member.
#[derive(Debug, Clone, Copy)]
struct Neighbor {
    member: u32,
    weight: f64,
}

/// Members whose neighbors are found by one task.
const MEMBERS: usize = 8 * BLOCK;

/// Neighbors of some members, each itself among them, from its start on.
#[derive(Debug, Default)]
struct NeighborBlock {
    neighbors: Vec<Neighbor>,
    starts: Vec<usize>,
}

/// What a run has of the surfactant.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Amounts {
    /// Σ M of all particles.
    pub total: f64,
    /// Part of it on particles that are far from the interface.
    pub off_interface: f64,
}

/// The surfactant, with its storage.
#[derive(Debug)]
pub(super) struct Surfactant<const D: usize> {
    pub config: SurfactantConfig<D>,
    /// The amounts.
    amount: ScalarKey,
    domain: Domain<D>,
    /// Middle of the box, about which the coverage at the start is given.
    middle: Vector<D>,
    spacing: f64,
    smoothing_length: f64,
    repair_time: f64,
    cells: CellList<D>,
    members: Vec<Member<D>>,
    /// Neighbors of the members, [`MEMBERS`] after [`MEMBERS`].
    blocks: Vec<NeighborBlock>,
    /// s of each member, and s times the second moment q of its weights.
    sums: Vec<[f64; 2]>,
    first: Vec<f64>,
    second: Vec<f64>,
    coverage: Vec<f64>,
    gradients: Vec<Vector<D>>,
}

/// Scales of a [`Surfactant`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Scales {
    pub spacing: f64,
    pub smoothing_length: f64,
    pub repair_time: f64,
}

impl<const D: usize> Surfactant<D> {
    /// Adds the column of amounts to the particles.
    pub fn new(
        config: SurfactantConfig<D>,
        (domain, middle): (Domain<D>, Vector<D>),
        Scales { spacing, smoothing_length, repair_time }: Scales,
        particles: &mut Particles<D>,
    ) -> Self {
        Self {
            config,
            amount: particles.add_scalar("surfactant", 0.0),
            cells: CellList::new(domain.clone()),
            domain,
            middle,
            spacing,
            smoothing_length,
            repair_time,
            members: Vec::new(),
            blocks: Vec::new(),
            sums: Vec::new(),
            first: Vec::new(),
            second: Vec::new(),
            coverage: Vec::new(),
            gradients: Vec::new(),
        }
    }

    /// Finds the members and their neighbors, from the closest points of the candidates.
    pub fn find_members(
        &mut self,
        particles: &Particles<D>,
        columns: &SurfaceColumns,
        flow: &FlowState<D>,
        candidates: &[usize],
    ) {
        let (phi, amounts) = (particles.scalar(columns.phi), particles.scalar(self.amount));
        let (foot, normal) = (particles.vector(columns.closest_point), particles.vector(columns.normal));
        let member = |i: usize| Member {
            particle: i,
            foot: foot[i],
            normal: normal[i],
            area: flow.volume[i] * smoothed_delta(phi[i], TUNING.width * self.smoothing_length),
            wide_area: flow.volume[i] * smoothed_delta(phi[i], self.smoothing_length),
            amount: amounts[i],
        };
        self.members.clear();
        let all = candidates.iter().map(|i| member(*i));
        self.members.extend(all.filter(|member| member.wide_area > 0.0 || member.amount != 0.0));
        self.find_neighbors();
    }

    fn find_neighbors(&mut self) {
        let radius = RADIUS_H * self.spacing;
        self.cells.rebuild(self.members.iter().map(|member| member.foot), 0.5 * radius);
        let Self { cells, members, sums, blocks, .. } = self;
        sums.clear();
        sums.resize(members.len(), [0.0; 2]);
        blocks.resize_with(members.len().div_ceil(MEMBERS).max(blocks.len()), NeighborBlock::default);
        let (cells, all) = (&*cells, members.as_slice());
        let tasks = blocks.par_iter_mut().zip(sums.par_chunks_mut(MEMBERS)).zip(all.par_chunks(MEMBERS));
        tasks.for_each(|((block, sums), members)| {
            block.neighbors.clear();
            block.starts.clear();
            block.starts.push(0);
            for (member, [sum, moment]) in members.iter().zip(sums) {
                cells.for_each_within(&member.foot, radius, |j, _, r2| {
                    let other = &all[j];
                    if member.normal.dot(&other.normal) > 0.0 {
                        let weight = weight(r2.sqrt() / radius);
                        *sum += weight * other.area;
                        *moment += weight * other.area * r2;
                        block.neighbors.push(Neighbor { member: j as u32, weight });
                    }
                });
                block.starts.push(block.neighbors.len());
            }
        });
    }

    /// Sets the amounts to those of the start.
    pub fn start(&mut self, particles: &mut Particles<D>) {
        for member in &mut self.members {
            let way = self.domain.displacement(&self.middle, &member.foot);
            member.amount = member.area * (self.config.coverage + self.config.slope.dot(&way));
        }
        self.store(particles);
    }

    /// Mixes and diffuses the amounts for a time.
    pub fn exchange(
        &mut self,
        particles: &mut Particles<D>,
        elapsed: f64,
        interrupt: &Interrupt,
    ) -> Result<(), Interrupted> {
        self.first.clear();
        self.first.extend(self.members.iter().map(|member| member.amount));
        let (mut first, mut second) = (std::mem::take(&mut self.first), std::mem::take(&mut self.second));
        let of_sums = |a: &[f64; 2], b: &[f64; 2]| 2.0 / (a[0] + b[0]);
        self.flow_out(&first, &mut second, of_sums);
        self.flow_out(&second, &mut first, of_sums);
        self.flow_out(&first, &mut second, of_sums);
        let share = 1.0 - (1.0 - TUNING.mixing).powf(elapsed / self.repair_time);
        for (member, change) in self.members.iter_mut().zip(&second) {
            member.amount -= share * change;
        }
        if self.config.diffusivity > 0.0 {
            first.clear();
            first.extend(self.members.iter().map(|member| member.amount));
            self.flow_out(&first, &mut second, |a, b| 2.0 / (a[1] + b[1]));
            let factor = elapsed * self.config.diffusivity * 2.0 * (D - 1) as f64;
            for (member, change) in self.members.iter_mut().zip(&second) {
                member.amount -= factor * change;
            }
        }
        (self.first, self.second) = (first, second);
        self.store(particles);
        interrupt.check()
    }

    /// Sets `out` to Σ_j w_ij (A_j M_i − A_i M_j) c_ij, where `c` follows from the sums of both.
    fn flow_out(&self, amounts: &[f64], out: &mut Vec<f64>, c: impl Fn(&[f64; 2], &[f64; 2]) -> f64 + Sync) {
        let value = |i: usize| {
            let (area, sums) = (self.members[i].area, &self.sums[i]);
            let pairs = self.of(i).iter().map(|Neighbor { member, weight }| (*member as usize, weight));
            let flux = |(j, weight): (usize, &f64)| {
                let difference = self.members[j].area * amounts[i] - area * amounts[j];
                // Two members without any area next to them keep what they have.
                if difference == 0.0 { 0.0 } else { weight * difference * c(sums, &self.sums[j]) }
            };
            pairs.map(flux).sum()
        };
        for_each_member(self.members.len(), 0.0, out, value);
    }

    /// The neighbors of a member.
    fn of(&self, i: usize) -> &[Neighbor] {
        let (block, k) = (&self.blocks[i / MEMBERS], i % MEMBERS);
        &block.neighbors[block.starts[k]..block.starts[k + 1]]
    }

    /// Finds the coverage, and hands particle, share of the interface, coverage and gradient of the coverage of each member that
    /// has a share.
    pub fn find_coverage(&mut self, mut take: impl FnMut(usize, f64, f64, Vector<D>)) {
        let (mut first, mut second) = (std::mem::take(&mut self.first), std::mem::take(&mut self.second));
        for_each_member(self.members.len(), 0.0, &mut first, |i| {
            let amounts = self.of(i).iter().map(|n| n.weight * self.members[n.member as usize].amount);
            amounts.sum::<f64>() / self.sums[i][0]
        });
        for_each_member(self.members.len(), 0.0, &mut second, |i| {
            // A member without any area next to it has no mean, and no weight in that of others.
            let shares =
                self.of(i).iter().map(|n| (n.weight * self.members[n.member as usize].area, n.member as usize));
            let smoothed = shares.filter(|(share, _)| *share > 0.0).map(|(share, j)| share * first[j]).sum::<f64>();
            2.0 * first[i] - smoothed / self.sums[i][0]
        });
        std::mem::swap(&mut self.coverage, &mut second);
        (self.first, self.second) = (first, second);
        let mut gradients = std::mem::take(&mut self.gradients);
        for_each_member(self.members.len(), Vector::<D>::zeros(), &mut gradients, |i| self.gradient(i));
        let values = self.members.iter().zip(&self.coverage).zip(&gradients);
        for ((member, coverage), gradient) in values.filter(|((member, _), _)| member.wide_area > 0.0) {
            take(member.particle, member.wide_area, *coverage, *gradient);
        }
        self.gradients = gradients;
    }

    /// The gradient of the coverage along the interface at a member, by a linear fit.
    fn gradient(&self, i: usize) -> Vector<D> {
        let Member { foot, normal, .. } = self.members[i];
        let mut moments = normal * normal.transpose();
        let mut sums = Vector::<D>::zeros();
        moments *= self.sums[i][1];
        for Neighbor { member, weight } in self.of(i) {
            let other = &self.members[*member as usize];
            if other.area > 0.0 {
                let way = self.domain.displacement(&foot, &other.foot);
                let way = way - normal * normal.dot(&way);
                let share = weight * other.area;
                moments += way * way.transpose() * share;
                sums += way * (share * (self.coverage[*member as usize] - self.coverage[i]));
            }
        }
        // Too few members next to each other have no gradient.
        moments.try_inverse().map_or_else(Vector::<D>::zeros, |inverse| inverse * sums)
    }

    /// The amounts of all particles.
    pub fn all_amounts<'a>(&self, particles: &'a Particles<D>) -> &'a [f64] {
        particles.scalar(self.amount)
    }

    /// What there is of the surfactant.
    pub fn amounts(&self, particles: &Particles<D>) -> Amounts {
        let near: f64 = self.members.iter().map(|member| member.amount).sum();
        let total: f64 = particles.scalar(self.amount).iter().sum();
        Amounts { total, off_interface: total - near }
    }

    fn store(&self, particles: &mut Particles<D>) {
        let amounts = particles.scalar_mut(self.amount);
        for member in &self.members {
            amounts[member.particle] = member.amount;
        }
    }
}

/// Wendland's C² function of one variable.
fn weight(r: f64) -> f64 {
    let rest = (1.0 - r).max(0.0);
    let square = rest * rest;
    square * square * 4.0_f64.mul_add(r, 1.0)
}

/// Sets `values` to a function of the members.
fn for_each_member<T: Copy + Send>(count: usize, none: T, values: &mut Vec<T>, value: impl Fn(usize) -> T + Sync) {
    values.clear();
    values.resize(count, none);
    values.par_chunks_mut(BLOCK).enumerate().for_each(|(block, values)| {
        for (k, slot) in values.iter_mut().enumerate() {
            *slot = value(block * BLOCK + k);
        }
    });
}
