//! The quantities of the substances of a reaction.

use super::formula_terms::MOST_SPECIES;
use super::quantities::VALUE;
use crate::simulation::Quantity;

/// A computed substance.
macro_rules! substance {
    ($name:literal, $which:literal) => {
        Quantity { name: $name, unit: "of the field", doc: concat!("Computed value of the ", $which, " substance.") }
    };
}

/// The substances beyond the first.
static MORE_VALUES: [Quantity; MOST_SPECIES - 1] = [
    substance!("second_value", "second"),
    substance!("third_value", "third"),
    substance!("fourth_value", "fourth"),
    substance!("fifth_value", "fifth"),
    substance!("sixth_value", "sixth"),
];

/// The quantity of a substance.
pub(super) fn substance(k: usize) -> &'static Quantity {
    if k == 0 { &VALUE } else { &MORE_VALUES[(k - 1).min(MOST_SPECIES - 2)] }
}
