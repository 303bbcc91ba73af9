//! Counts of what resampling removed and kept.

use crate::simulation::{Component, Diagnostic, LoadError, Section};

/// Counts of grid points without a foot point and of particles that were removed or kept, by reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Removals {
    /// Grid points without enough particles of one segment near them.
    pub starved: u64,
    /// Grid points whose foot point would lie beyond all particles, or past a corner.
    pub extrapolated: u64,
    /// Grid points where the front turns too sharply for the spacing, or where a fit in a flow does not have the directions of
    /// its particles.
    pub unresolved: u64,
    /// Particles that another segment has passed.
    pub swept: u64,
    /// Moved particles that stayed because no new foot point replaced them.
    pub kept: u64,
    /// Particles beyond the end of the grid, which has half a billion cells from the origin in the plane and half a million in
    /// space.
    pub outside: u64,
}

impl Removals {
    /// Names and counts.
    #[must_use]
    pub fn entries(&self) -> [(&'static str, u64); 6] {
        [
            ("foot_points.starved", self.starved),
            ("foot_points.extrapolated", self.extrapolated),
            ("foot_points.unresolved", self.unresolved),
            ("foot_points.swept", self.swept),
            ("particles.kept", self.kept),
            ("particles.outside", self.outside),
        ]
    }

    /// The counts with their meaning, for a report.
    #[must_use]
    pub fn diagnostics(&self) -> Vec<Diagnostic> {
        let docs = [
            "Grid points without enough particles of one segment near them.",
            "Grid points whose foot point would lie beyond all particles, or past a corner.",
            "Grid points where the front turns too sharply for the spacing.",
            "Particles that another segment has passed.",
            "Moved particles that stayed because no new foot point replaced them.",
            "Particles beyond the end of the grid.",
        ];
        self.entries().into_iter().zip(docs).map(|((name, count), doc)| Diagnostic::count(name, count, doc)).collect()
    }
}

impl Component for Removals {
    fn save(&self, section: &mut Section) {
        section.put_count("starved", self.starved);
        section.put_count("extrapolated", self.extrapolated);
        section.put_count("unresolved", self.unresolved);
        section.put_count("swept", self.swept);
        section.put_count("kept", self.kept);
        section.put_count("outside", self.outside);
    }

    fn load(section: &Section) -> Result<Self, LoadError> {
        Ok(Self {
            starved: section.count("starved")?,
            extrapolated: section.count("extrapolated")?,
            unresolved: section.count("unresolved")?,
            swept: section.count("swept")?,
            kept: section.count("kept")?,
            outside: section.count("outside")?,
        })
    }
}
