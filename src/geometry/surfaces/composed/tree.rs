//! The tree of a solid, with complements moved down to its shapes.

use super::{Member, Solid, Vector};
use std::sync::Arc;

/// A node of the tree.
pub(super) enum Node {
    /// A shape, by its place in the list.
    Shape(usize),
    /// What lies in all: the largest level.
    All(Vec<Node>),
    /// What lies in any: the smallest level.
    Any(Vec<Node>),
}

impl Node {
    /// The tree of a solid, or of its complement; its shapes are added to `members`.
    pub fn new<const D: usize>(solid: &Solid<D>, is_outside: bool, members: &mut Vec<Member<D>>) -> Self {
        let mut nodes = |of: &[Solid<D>]| of.iter().map(|member| Self::new(member, is_outside, members)).collect();
        match solid {
            Solid::Shape(surface) => {
                let sign = if is_outside { -1.0 } else { 1.0 };
                members.push(Member { surface: Arc::clone(surface), sign });
                Self::Shape(members.len() - 1)
            }
            Solid::Complement(of) => Self::new(of, !is_outside, members),
            // De Morgan.
            Solid::Intersection(of) if !is_outside => Self::All(nodes(of)),
            Solid::Union(of) if is_outside => Self::All(nodes(of)),
            Solid::Intersection(of) | Solid::Union(of) => Self::Any(nodes(of)),
        }
    }

    /// The level at a place, and the shape that gives it.
    pub fn level<const D: usize>(&self, x: &Vector<D>, members: &[Member<D>]) -> (f64, usize) {
        match self {
            Self::Shape(place) => {
                let member = &members[*place];
                (member.sign * member.surface.signed_distance(x), *place)
            }
            Self::All(of) => of
                .iter()
                .map(|node| node.level(x, members))
                .fold((f64::NEG_INFINITY, 0), |best, next| if next.0 > best.0 { next } else { best }),
            Self::Any(of) => of
                .iter()
                .map(|node| node.level(x, members))
                .fold((f64::INFINITY, 0), |best, next| if next.0 < best.0 { next } else { best }),
        }
    }

    /// A box that contains the surface.
    pub fn bounding_box<const D: usize>(&self, members: &[Member<D>]) -> (Vector<D>, Vector<D>) {
        self.inner_box(members).unwrap_or_else(|| {
            let boxes = members.iter().map(|member| member.surface.bounding_box());
            boxes.fold(nowhere(), |whole, next| (whole.0.inf(&next.0), whole.1.sup(&next.1)))
        })
    }

    /// A box that contains the inside; None where that has no bounds.
    fn inner_box<const D: usize>(&self, members: &[Member<D>]) -> Option<(Vector<D>, Vector<D>)> {
        match self {
            Self::Shape(place) => {
                let member = &members[*place];
                (member.sign > 0.0).then(|| member.surface.bounding_box())
            }
            Self::All(of) => {
                let boxes = of.iter().filter_map(|node| node.inner_box(members));
                boxes.reduce(|a, b| (a.0.sup(&b.0), a.1.inf(&b.1)))
            }
            Self::Any(of) => {
                let boxes: Option<Vec<_>> = of.iter().map(|node| node.inner_box(members)).collect();
                Some(boxes?.into_iter().fold(nowhere(), |a, b| (a.0.inf(&b.0), a.1.sup(&b.1))))
            }
        }
    }
}

fn nowhere<const D: usize>() -> (Vector<D>, Vector<D>) {
    (Vector::<D>::repeat(f64::INFINITY), Vector::<D>::repeat(f64::NEG_INFINITY))
}
