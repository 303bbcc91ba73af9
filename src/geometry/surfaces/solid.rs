//! Solids: shapes put together by union, intersection and complement.

use super::{Complement, Composed, EmptySolid, Placed, Placement, Surface, Union};
use crate::geometry::surfaces::union::Overlap;
use std::sync::Arc;

/// A solid, made of shapes.
#[derive(Clone)]
pub enum Solid<const D: usize> {
    /// What lies within one surface.
    Shape(Arc<dyn Surface<D>>),
    /// Everything outside a solid.
    Complement(Box<Solid<D>>),
    /// What lies in all of at least one solid.
    Intersection(Vec<Solid<D>>),
    /// What lies in any of at least one solid.
    Union(Vec<Solid<D>>),
}

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
    /// The solid rotated, scaled and moved.
    #[must_use]
    pub fn placed(self, placement: &Placement<D>) -> Self {
        let all = |of: Vec<Self>| of.into_iter().map(|member| member.placed(placement)).collect();
        match self {
            Self::Shape(surface) => Self::Shape(Arc::new(Placed { surface, placement: *placement })),
            Self::Complement(of) => Self::Complement(Box::new(of.placed(placement))),
            Self::Intersection(of) => Self::Intersection(all(of)),
            Self::Union(of) => Self::Union(all(of)),
        }
    }

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

    /// The shapes of a union of nothing but shapes.
    fn separate_shapes(&self) -> Option<Vec<Arc<dyn Surface<D>>>> {
        let Self::Union(of) = self else { return None };
        let shape = |member: &Self| match member {
            Self::Shape(surface) => Some(Arc::clone(surface)),
            _ => None,
        };
        of.iter().map(shape).collect()
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
