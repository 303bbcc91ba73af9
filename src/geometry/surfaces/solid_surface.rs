//! From a solid to its surface.

use super::union::Overlap;
use super::{Complement, Composed, EmptySolid, Solid, Surface, Union};
use std::sync::Arc;

/// Why a solid has no surface.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SolidError {
    /// Parts of a union overlap.
    #[error(transparent)]
    Overlap(#[from] Overlap),
    /// Nothing is left of it, or everything.
    #[error(transparent)]
    Empty(#[from] EmptySolid),
}

impl<const D: usize> Solid<D> {
    /// The parts of the solid that do not touch: those of a union of shapes, else the solid itself.
    ///
    /// # Errors
    /// As [`Self::surface`].
    pub fn parts(&self) -> Result<Vec<Arc<dyn Surface<D>>>, SolidError> {
        match self.separate_shapes() {
            Some(shapes) => Ok(shapes),
            None => Ok(vec![self.surface()?]),
        }
    }

    /// The surface of the solid.
    ///
    /// # Errors
    /// Parts of a union of shapes that overlap; a solid without points or without a surface.
    pub fn surface(&self) -> Result<Arc<dyn Surface<D>>, SolidError> {
        if let Some(shapes) = self.separate_shapes() {
            let parts = shapes.into_iter().map(|shape| -> Box<dyn Surface<D>> { Box::new(shape) }).collect();
            return Ok(Arc::new(Union::new(parts)?));
        }
        Ok(match self {
            Self::Shape(surface) => Arc::clone(surface),
            Self::Complement(of) => Arc::new(Complement { of: of.surface()? }),
            Self::Intersection(of) | Self::Union(of) if of.len() == 1 => of[0].surface()?,
            Self::Intersection(_) | Self::Union(_) => Arc::new(Composed::new(self)?),
        })
    }
}
