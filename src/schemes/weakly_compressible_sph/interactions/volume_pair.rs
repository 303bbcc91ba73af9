//! A pair of particles as the volume form of the momentum equation sees it: which columns are gathered.

/// Vector column: velocities in ε, times the viscosity where all pairs have one.
pub const VELOCITY: usize = 1;
/// Scalar column: volumes V in units of the cell.
pub const VOLUME: usize = 0;
/// Scalar column: V P in units of the cell, or P V²/a in units of the cell's square for the Hamiltonian form.
pub const STRESS: usize = 1;
/// Scalar column: dynamic viscosities η, where they differ.
pub const VISCOSITY: usize = 2;
/// Scalar column, where there are walls: 1 for points of walls, 0 for particles.
pub const WALL: usize = 3;
