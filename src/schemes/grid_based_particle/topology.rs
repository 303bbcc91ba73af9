//! What happens where segments of a front meet (GBPM 3.6).

/// What happens where two segments of a front meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Topology {
    /// They merge: the viscosity solution.
    Merge,
    /// They pass through each other.
    Cross,
}
