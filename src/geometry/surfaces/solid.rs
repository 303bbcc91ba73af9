//! Solids: shapes put together by union, intersection and complement.

use super::{Placed, Placement, Surface};
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

    /// The shapes of a union of nothing but shapes.
    pub(super) fn separate_shapes(&self) -> Option<Vec<Arc<dyn Surface<D>>>> {
        let Self::Union(of) = self else { return None };
        let shape = |member: &Self| match member {
            Self::Shape(surface) => Some(Arc::clone(surface)),
            _ => None,
        };
        of.iter().map(shape).collect()
    }
}
