//! Numbers by place. Loops over pairs read and write the same place of up to a dozen columns; large vectors all begin at
//! the same offset of a page, so that these would compete for the few cache lines of one set. Each column begins at an
//! offset of its own.

use std::ops::{Deref, DerefMut};

/// From one column's offset to the next, in numbers: four cache lines, so that sixteen columns share a page.
const STAGGER: usize = 32;

/// A column with some unused numbers before it.
#[derive(Debug)]
pub(super) struct Column {
    numbers: Vec<f64>,
    lead: usize,
}

impl Column {
    /// The column of a number, with nothing in it.
    pub fn new(number: usize) -> Self {
        let lead = number * STAGGER;
        Self { numbers: vec![0.0; lead], lead }
    }

    /// Puts other values in.
    pub fn refill(&mut self, values: impl Iterator<Item = f64>) {
        self.numbers.truncate(self.lead);
        self.numbers.extend(values);
    }

    /// Makes it so long.
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
