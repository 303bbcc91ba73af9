//! Outlines of solids in the plane: the parts of their shapes' outlines that lie on the solid, joined at the corners.

use super::super::sampled::trace::{bulges, polygon_area};
use super::{Composed, Surface, TUNING, Vector};

/// Spacing of the points by which an area is found, relative to the size.
const AREA_SPACING: f64 = 1e-3;

/// A part of the outline of one shape.
struct Run<const D: usize> {
    shape: usize,
    points: Vec<Vector<D>>,
}

/// The outline as closed chains; none in space.
pub(super) fn chains<const D: usize>(solid: &Composed<D>, spacing: f64) -> Vec<Vec<Vector<D>>> {
    joined(runs(solid, spacing).into_iter().map(|run| run.points).collect())
}

/// The area within the outline: chords, and what lies between them and the shapes' curves.
pub(super) fn area<const D: usize>(solid: &Composed<D>) -> f64 {
    let runs = runs(solid, AREA_SPACING * solid.size);
    let curved = |run: &Run<D>| {
        let member = &solid.members[run.shape];
        bulges(&run.points, |x| member.surface.nearest(x).normal.map(|normal| normal * member.sign))
    };
    let beyond: f64 = runs.iter().map(curved).sum();
    polygon_area(&joined(runs.into_iter().map(|run| run.points).collect())) + beyond
}

/// The parts of the outlines of all shapes that lie on the solid, with the inside of the solid on the left.
fn runs<const D: usize>(solid: &Composed<D>, spacing: f64) -> Vec<Run<D>> {
    if D != 2 {
        return Vec::new();
    }
    let touch = TUNING.on_surface * solid.size;
    let corners: Vec<Vector<D>> =
        solid.patches.patches().iter().filter(|patch| patch.count == D).map(|patch| patch.seed).collect();
    let mut runs = Vec::new();
    for (shape, member) in solid.members.iter().enumerate() {
        let of_shape: Vec<Vector<D>> =
            corners.iter().filter(|x| member.surface.signed_distance(x).abs() <= touch).copied().collect();
        let is_on_solid = |x: &Vector<D>| {
            let is_first = |k: usize| solid.members[k].surface.signed_distance(x).abs() > touch;
            let normal = member.surface.nearest(x).normal;
            // At a corner of the shape itself there is no side to look to.
            let is_on = normal
                .map_or_else(|| solid.nearest(x).distance.abs() <= touch, |normal| solid.is_on_surface(x, &[normal]));
            is_on && (0..shape).all(is_first)
        };
        for mut chain in member.surface.outline(spacing) {
            if member.sign < 0.0 {
                chain.reverse();
            }
            let parts = cut(&chain, &is_on_solid, &of_shape, 2.0 * spacing);
            runs.extend(parts.into_iter().map(|points| Run { shape, points }));
        }
    }
    runs
}

/// The parts of a closed chain that lie on the solid, each prolonged to the corners where it ends.
fn cut<const D: usize>(
    chain: &[Vector<D>],
    is_on_solid: &dyn Fn(&Vector<D>) -> bool,
    corners: &[Vector<D>],
    reach: f64,
) -> Vec<Vec<Vector<D>>> {
    let count = chain.len() - 1;
    let is_on: Vec<bool> = chain[..count].iter().map(is_on_solid).collect();
    let Some(start) = is_on.iter().position(|on| !on) else { return vec![chain.to_vec()] };
    let mut parts: Vec<Vec<Vector<D>>> = Vec::new();
    let mut part: Vec<Vector<D>> = Vec::new();
    for k in 1..=count {
        let place = (start + k) % count;
        if is_on[place] {
            part.push(chain[place]);
        } else if !part.is_empty() {
            parts.push(std::mem::take(&mut part));
        }
    }
    let nearest = |x: &Vector<D>| {
        let distance = |corner: &Vector<D>| (corner - x).norm();
        corners.iter().copied().min_by(|a, b| distance(a).total_cmp(&distance(b))).filter(|c| distance(c) <= reach)
    };
    for part in &mut parts {
        let (first, last) = (part[0], part[part.len() - 1]);
        if let Some(corner) = nearest(&first).filter(|corner| *corner != first) {
            part.insert(0, corner);
        }
        if let Some(corner) = nearest(&last).filter(|corner| *corner != last) {
            part.push(corner);
        }
    }
    parts
}

/// Closed chains of parts, each joined to the one that begins nearest to its end.
fn joined<const D: usize>(mut parts: Vec<Vec<Vector<D>>>) -> Vec<Vec<Vector<D>>> {
    let mut chains = Vec::new();
    while !parts.is_empty() {
        let mut chain = parts.remove(0);
        while chain.len() < 3 || chain[0] != chain[chain.len() - 1] {
            let (first, last) = (chain[0], chain[chain.len() - 1]);
            let distance = |part: &[Vector<D>]| (part[0] - last).norm();
            let next = (0..parts.len()).min_by(|a, b| distance(&parts[*a]).total_cmp(&distance(&parts[*b])));
            match next.filter(|k| distance(&parts[*k]) <= (first - last).norm()) {
                Some(k) => {
                    let part = parts.remove(k);
                    let skip = usize::from(part[0] == last);
                    chain.extend(part.into_iter().skip(skip));
                }
                None => chain.push(first),
            }
        }
        chains.push(chain);
    }
    chains
}
