//! Columns of numbers by place. Loops over pairs read and write the same place of up to a dozen columns. Large vectors all
//! begin at the same offset of a page, so that their lines would compete for the few entries of one cache set. Each column
//! therefore begins at an offset of its own.

use std::ops::{Deref, DerefMut};

/// Distance between the offsets of two columns, in numbers: four cache lines, so that sixteen columns share a page.
const STAGGER: usize = 32;

/// A column with some unused numbers in front.
#[derive(Debug)]
pub(super) struct Column {
    numbers: Vec<f64>,
    lead: usize,
}

impl Column {
    /// An empty column; `number` counts the columns and decides the offset.
    pub fn new(number: usize) -> Self {
        let lead = number * STAGGER;
        Self { numbers: vec![0.0; lead], lead }
    }

    /// Replaces the values.
    pub fn refill(&mut self, values: impl Iterator<Item = f64>) {
        self.numbers.truncate(self.lead);
        self.numbers.extend(values);
    }

    /// Changes the length; new values are 0.
    pub fn resize(&mut self, length: usize) {
        self.numbers.resize(self.lead + length, 0.0);
    }
}

impl Deref for Column {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        &self.numbers[self.lead..]
    }
}

impl DerefMut for Column {
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.numbers[self.lead..]
    }
}
