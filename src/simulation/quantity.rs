//! Declared quantities: what frames, series and reports of a scheme show, each with its unit and a sentence.

use serde::Serialize;

/// A quantity under its one name. A scheme declares each of its quantities once.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Quantity {
    /// Name in frames, series and reports.
    pub name: &'static str,
    /// Unit in terms of the scene's own (`length`, `time`, `mass`); empty where there is none.
    pub unit: &'static str,
    /// What it is, in a sentence.
    pub doc: &'static str,
}

/// Scalars of one state, in a fixed order: a row of the series.
pub type Observables = Vec<(&'static Quantity, f64)>;

/// Declares quantities, each as a constant of its own, and the list of all:
/// `quantities! { /// Fields of frames. pub FIELDS { PHI = "phi", "length", "Signed distance."; } }`.
macro_rules! quantities {
    ($(#[$list_doc:meta])* $visibility:vis $list:ident {
        $($name:ident = $word:literal, $unit:literal, $doc:literal;)*
    }) => {
        $(
            #[doc = $doc]
            $visibility static $name: $crate::simulation::Quantity =
                $crate::simulation::Quantity { name: $word, unit: $unit, doc: $doc };
        )*
        $(#[$list_doc])*
        $visibility static $list: &[&$crate::simulation::Quantity] = &[$(&$name,)*];
    };
}
pub(crate) use quantities;

/// The quantities of several lists in the order of their first mention; a name stands once.
#[must_use]
pub fn without_repetition(lists: &[&[&'static Quantity]]) -> Vec<&'static Quantity> {
    let mut all: Vec<&'static Quantity> = Vec::new();
    for quantity in lists.iter().copied().flatten() {
        if all.iter().all(|known| known.name != quantity.name) {
            all.push(quantity);
        }
    }
    all
}
