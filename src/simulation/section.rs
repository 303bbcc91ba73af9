//! The state of a simulation as a tree of named sections: what a checkpoint holds.
//!
//! A component saves itself into a section of its own, field by field under their names, and comes back from it. An
//! optional number is stored as such: nothing stands for "not known" but its absence.

use crate::geometry::Vector;
use std::collections::BTreeMap;

/// A named part of a state: numbers, arrays and further sections, each under its name.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Section {
    entries: BTreeMap<String, Entry>,
}

/// What stands under a name in a section.
#[derive(Debug, Clone, PartialEq)]
pub enum Entry {
    /// Numbers, `components` of them an item (the D of vectors).
    Reals {
        /// Numbers of each item.
        components: usize,
        /// The numbers, item by item.
        values: Vec<f64>,
    },
    /// A list of whole numbers.
    Counts(Vec<u64>),
    /// One number, or none where it is not known.
    Real(Option<f64>),
    /// One whole number, or none where it is not known.
    Count(Option<u64>),
    /// The section of a component.
    Section(Section),
}

/// Why a state cannot be loaded into a simulation.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LoadError {
    /// An entry is missing.
    #[error("the state has no {name}")]
    Missing {
        /// Path of the entry.
        name: String,
    },
    /// An entry is of another kind: an array for a number, say.
    #[error("{name} of the state is not {expected}")]
    Kind {
        /// Path of the entry.
        name: String,
        /// The kind that is needed.
        expected: &'static str,
    },
    /// An array has another length.
    #[error("{name} of the state has {got} numbers, this scene needs {expected}")]
    Length {
        /// Path of the array.
        name: String,
        /// Length of the entry.
        got: usize,
        /// Length that the scene needs.
        expected: usize,
    },
    /// The step of the state lies beyond the end of the run.
    #[error("the state is at step {step}, the run ends at step {last}")]
    Beyond {
        /// Step of the state.
        step: u64,
        /// Last step of the run.
        last: u64,
    },
    /// The scheme has no reader for states of format 1.
    #[error("states of format 1 are not read by this scheme")]
    Format1,
}

impl LoadError {
    /// The same error inside a section of this name.
    #[must_use]
    fn within(self, section: &str) -> Self {
        let path = |name: String| format!("{section}/{name}");
        match self {
            Self::Missing { name } => Self::Missing { name: path(name) },
            Self::Kind { name, expected } => Self::Kind { name: path(name), expected },
            Self::Length { name, got, expected } => Self::Length { name: path(name), got, expected },
            other => other,
        }
    }
}

/// A part of a simulation that saves itself into a section and comes back from it.
pub trait Component: Sized {
    /// Saves every field that the future depends on.
    fn save(&self, section: &mut Section);

    /// The component as it was saved.
    ///
    /// # Errors
    /// [`LoadError`] where a field is missing or of another shape.
    fn load(section: &Section) -> Result<Self, LoadError>;
}

impl Section {
    /// Names and entries in the order of names.
    pub fn entries(&self) -> impl Iterator<Item = (&str, &Entry)> {
        self.entries.iter().map(|(name, entry)| (name.as_str(), entry))
    }

    /// Adds an entry, or replaces the one of that name.
    pub fn put(&mut self, name: &str, entry: Entry) {
        self.entries.insert(name.to_owned(), entry);
    }

    /// Adds a list of numbers under a name.
    pub fn put_reals(&mut self, name: &str, values: &[f64]) {
        self.put(name, Entry::Reals { components: 1, values: values.to_vec() });
    }

    /// Adds a list of vectors under a name.
    pub fn put_vectors<const D: usize>(&mut self, name: &str, values: &[Vector<D>]) {
        let values = values.iter().flat_map(|v| v.iter().copied()).collect();
        self.put(name, Entry::Reals { components: D, values });
    }

    /// Adds a list of whole numbers under a name.
    pub fn put_counts(&mut self, name: &str, values: impl IntoIterator<Item = u64>) {
        self.put(name, Entry::Counts(values.into_iter().collect()));
    }

    /// Adds flags or small whole numbers.
    pub fn put_flags(&mut self, name: &str, values: &[u8]) {
        self.put_counts(name, values.iter().map(|value| u64::from(*value)));
    }

    /// Adds one number under a name.
    pub fn put_real(&mut self, name: &str, value: f64) {
        self.put(name, Entry::Real(Some(value)));
    }

    /// Adds a number that may be unknown.
    pub fn put_optional(&mut self, name: &str, value: Option<f64>) {
        self.put(name, Entry::Real(value));
    }

    /// Adds a whole number.
    pub fn put_count(&mut self, name: &str, value: u64) {
        self.put(name, Entry::Count(Some(value)));
    }

    /// Adds a whole number that may be unknown.
    pub fn put_optional_count(&mut self, name: &str, value: Option<u64>) {
        self.put(name, Entry::Count(value));
    }

    /// Adds a component in a section of its own.
    pub fn put_component(&mut self, name: &str, component: &impl Component) {
        self.put_section(name, |section| component.save(section));
    }

    /// Adds components of one type in numbered sections.
    pub fn put_list<C: Component>(&mut self, name: &str, components: &[C]) {
        self.put_section(name, |section| {
            section.put_count("length", components.len() as u64);
            for (k, component) in components.iter().enumerate() {
                section.put_component(&k.to_string(), component);
            }
        });
    }

    /// Adds a section and fills it.
    pub fn put_section(&mut self, name: &str, fill: impl FnOnce(&mut Section)) {
        let mut section = Section::default();
        fill(&mut section);
        self.put(name, Entry::Section(section));
    }

    /// Adds to a section that is there.
    ///
    /// # Errors
    /// [`LoadError`], also that of `add`.
    pub fn extend(
        &mut self,
        name: &str,
        add: impl FnOnce(&mut Section) -> Result<(), LoadError>,
    ) -> Result<(), LoadError> {
        add(self.section_mut(name).ok_or_else(|| kind(name, "a section"))?)
    }

    /// The section of a name, to write; none where there is no section.
    pub fn section_mut(&mut self, name: &str) -> Option<&mut Section> {
        match self.entries.get_mut(name) {
            Some(Entry::Section(section)) => Some(section),
            _ => None,
        }
    }

    /// Whether there is an entry of a name. States of earlier versions lack what came later.
    #[must_use]
    pub fn has(&self, name: &str) -> bool {
        self.entry(name).is_ok()
    }

    /// The entry of a name.
    ///
    /// # Errors
    /// [`LoadError::Missing`].
    pub fn entry(&self, name: &str) -> Result<&Entry, LoadError> {
        self.entries.get(name).ok_or_else(|| LoadError::Missing { name: name.to_owned() })
    }

    /// The numbers of an array.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn reals(&self, name: &str) -> Result<&[f64], LoadError> {
        match self.entry(name)? {
            Entry::Reals { values, .. } => Ok(values),
            _ => Err(kind(name, "an array of numbers")),
        }
    }

    /// The numbers of an array of a known length.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn reals_of(&self, name: &str, length: usize) -> Result<&[f64], LoadError> {
        let values = self.reals(name)?;
        check_length(name, values.len(), length)?;
        Ok(values)
    }

    /// The vectors of an array.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn vectors<const D: usize>(&self, name: &str) -> Result<Vec<Vector<D>>, LoadError> {
        let values = self.reals(name)?;
        check_length(name, values.len(), values.len() / D * D)?;
        Ok(values.chunks_exact(D).map(Vector::<D>::from_column_slice).collect())
    }

    /// The whole numbers of an array.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn counts(&self, name: &str) -> Result<&[u64], LoadError> {
        match self.entry(name)? {
            Entry::Counts(values) => Ok(values),
            _ => Err(kind(name, "an array of whole numbers")),
        }
    }

    /// The whole numbers of an array of a known length.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn counts_of(&self, name: &str, length: usize) -> Result<&[u64], LoadError> {
        let values = self.counts(name)?;
        check_length(name, values.len(), length)?;
        Ok(values)
    }

    /// The number of this name.
    ///
    /// # Errors
    /// [`LoadError`], also where it is not known.
    pub fn real(&self, name: &str) -> Result<f64, LoadError> {
        self.optional(name)?.ok_or_else(|| kind(name, "a known number"))
    }

    /// A number, where it is known.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn optional(&self, name: &str) -> Result<Option<f64>, LoadError> {
        match self.entry(name)? {
            Entry::Real(value) => Ok(*value),
            _ => Err(kind(name, "a number")),
        }
    }

    /// The whole number of this name.
    ///
    /// # Errors
    /// [`LoadError`], also where it is not known.
    pub fn count(&self, name: &str) -> Result<u64, LoadError> {
        self.optional_count(name)?.ok_or_else(|| kind(name, "a known whole number"))
    }

    /// A whole number, where it is known.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn optional_count(&self, name: &str) -> Result<Option<u64>, LoadError> {
        match self.entry(name)? {
            Entry::Count(value) => Ok(*value),
            _ => Err(kind(name, "a whole number")),
        }
    }

    /// Reads the section of a name; errors inside name their whole path.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn section<'a, T>(
        &'a self,
        name: &str,
        read: impl FnOnce(&'a Section) -> Result<T, LoadError>,
    ) -> Result<T, LoadError> {
        match self.entry(name)? {
            Entry::Section(section) => read(section).map_err(|error| error.within(name)),
            _ => Err(kind(name, "a section")),
        }
    }

    /// A component from its section.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn component<C: Component>(&self, name: &str) -> Result<C, LoadError> {
        self.section(name, C::load)
    }

    /// Components of one type from their numbered sections.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn list<C: Component>(&self, name: &str) -> Result<Vec<C>, LoadError> {
        self.section(name, |section| {
            let length = section.count("length")?;
            (0..length).map(|k| section.component(&k.to_string())).collect()
        })
    }

    /// The path of the first number that is not finite, and its item.
    #[must_use]
    pub fn find_non_finite(&self) -> Option<(String, usize)> {
        self.entries.iter().find_map(|(name, entry)| match entry {
            Entry::Reals { components, values } => {
                let place = values.iter().position(|value| !value.is_finite())?;
                Some((name.clone(), place / (*components).max(1)))
            }
            Entry::Real(Some(value)) if !value.is_finite() => Some((name.clone(), 0)),
            Entry::Section(section) => section.find_non_finite().map(|(path, item)| (format!("{name}/{path}"), item)),
            _ => None,
        })
    }

    /// How many numbers there are, in all sections.
    #[must_use]
    pub fn numbers(&self) -> usize {
        let of = |entry: &Entry| match entry {
            Entry::Reals { values, .. } => values.len(),
            Entry::Counts(values) => values.len(),
            Entry::Real(_) | Entry::Count(_) => 1,
            Entry::Section(section) => section.numbers(),
        };
        self.entries.values().map(of).sum()
    }
}

/// A number that is only known where it is one; the state says so by its absence.
#[must_use]
pub fn known(value: f64) -> Option<f64> {
    Some(value).filter(|value| value.is_finite())
}

fn kind(name: &str, expected: &'static str) -> LoadError {
    LoadError::Kind { name: name.to_owned(), expected }
}

/// An error unless the lengths agree.
///
/// # Errors
/// [`LoadError::Length`].
pub fn check_length(name: &str, got: usize, expected: usize) -> Result<(), LoadError> {
    if got == expected { Ok(()) } else { Err(LoadError::Length { name: name.to_owned(), got, expected }) }
}

/// Copies the numbers of an array of vectors; both have the same length.
pub fn copy_vectors<const D: usize>(from: &[f64], to: &mut [Vector<D>]) {
    for (vector, numbers) in to.iter_mut().zip(from.chunks_exact(D)) {
        vector.as_mut_slice().copy_from_slice(numbers);
    }
}

#[cfg(test)]
mod tests;
