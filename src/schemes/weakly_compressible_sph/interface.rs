//! The interface between the species, by one of two methods: a level set with closest points, or a color field.

pub mod color_field;
pub mod extension;
pub mod level_set;
mod surface_filter;

pub use color_field::ColorField;
pub use level_set::LevelSet;

use crate::parallel::Interrupted;

/// The interface, and the method for its normals and curvatures.
#[derive(Debug)]
pub(super) enum Interface<const D: usize> {
    /// No interface is computed.
    Absent,
    /// A level set that particles carry, with closest points.
    LevelSet(Box<LevelSet<D>>),
    /// The smoothed color of the species.
    ColorField(ColorField<D>),
}

/// The reason why an interface was not found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum InterfaceError {
    Interrupted,
    /// The level has no zero any more.
    Lost,
}

impl From<Interrupted> for InterfaceError {
    fn from(_: Interrupted) -> Self {
        Self::Interrupted
    }
}

impl<const D: usize> Interface<D> {
    /// The level set, where this is the method.
    pub fn level_set(&self) -> Option<&LevelSet<D>> {
        match self {
            Self::LevelSet(level_set) => Some(level_set),
            Self::Absent | Self::ColorField(_) => None,
        }
    }

    /// The level set, where this is the method.
    pub fn level_set_mut(&mut self) -> Option<&mut LevelSet<D>> {
        match self {
            Self::LevelSet(level_set) => Some(level_set),
            Self::Absent | Self::ColorField(_) => None,
        }
    }

    /// Particles near the level set; none where there is no level set.
    pub fn candidates(&self) -> &[usize] {
        self.level_set().map_or(&[], LevelSet::candidates)
    }
}
