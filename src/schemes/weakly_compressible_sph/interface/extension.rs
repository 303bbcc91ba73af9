//! The level of an interface beyond the particles, for its fits.

use crate::geometry::Vector;

/// Points with a level and its direction, next to an interface.
#[derive(Debug)]
pub struct Extension<const D: usize> {
    pub positions: Vec<Vector<D>>,
    pub level: Vec<f64>,
    pub normals: Vec<Vector<D>>,
}

impl<const D: usize> Default for Extension<D> {
    fn default() -> Self {
        Self { positions: Vec::new(), level: Vec::new(), normals: Vec::new() }
    }
}
