//! Reaction terms that a user writes as formulas of the concentrations, the place and time.

use super::formula_field::{Sites, VARIABLES};
use crate::formulas::{BLOCK, Bound, Context, FormulaList, Input, NamedNumbers};
use crate::spec::Violation;
use rayon::prelude::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};
use serde_json::json;

/// Largest number of substances.
pub const MOST_SPECIES: usize = 6;

/// The terms of up to six substances.
#[derive(Debug, Clone, PartialEq)]
pub struct FormulaTerms {
    rates: Bound,
    species: usize,
    /// Where the points are; empty before the terms are used.
    sites: Sites,
}

impl FormulaTerms {
    /// The terms `rates[k]` of substances with names. Pointers of errors begin with `pointer`.
    ///
    /// # Errors
    /// Names that mean something else or come twice, another number of rates than of substances, and all that is wrong with
    /// the formulas.
    pub fn new(
        species: &[String],
        rates: &FormulaList,
        parameters: &NamedNumbers,
        pointer: &str,
    ) -> Result<Self, Vec<Violation>> {
        let mut errors = Vec::new();
        for (k, name) in species.iter().enumerate() {
            let is_twice = species[..k].contains(name) || parameters.0.iter().any(|(known, _)| known == name);
            let reason =
                crate::formulas::why_not_a_name(name, &VARIABLES).or(is_twice.then_some("the name is given twice"));
            if let Some(reason) = reason {
                let at = format!("{pointer}/species/{k}");
                errors.push(Violation::new(at, "name", reason, json!(name), json!("another name")));
            }
        }
        if rates.0.len() != species.len() {
            let detail = format!("there are {} substances and {} rates", species.len(), rates.0.len());
            let at = format!("{pointer}/rates");
            errors.push(Violation::new(at, "conflict", detail, rates.0.len(), json!({"rates": species.len()})));
        }
        let variables: Vec<&str> = VARIABLES.into_iter().chain(species.iter().map(String::as_str)).collect();
        let rates = Bound::new(&rates.at("rates"), Context { pointer, variables: &variables, parameters });
        match rates {
            Ok(rates) if errors.is_empty() => Ok(Self { rates, species: species.len(), sites: Sites::default() }),
            Ok(_) => Err(errors),
            Err(found) => {
                errors.extend(found);
                Err(errors)
            }
        }
    }

    /// The terms at the points of a surface.
    #[must_use]
    pub fn with_sites(&self, sites: Sites) -> Self {
        Self { sites, ..self.clone() }
    }

    /// Number of substances.
    #[must_use]
    pub fn species(&self) -> usize {
        self.species
    }

    /// Operations of the terms at a point, for estimates.
    #[must_use]
    pub fn operations(&self) -> usize {
        self.rates.operations()
    }

    /// out ← d out + rates; `u` and `out` have one substance after another.
    pub fn add(&self, u: &[f64], diffusivity: &[f64], time: f64, out: &mut [f64]) {
        let rows = self.sites.len();
        if rows == 0 {
            return;
        }
        let mut blocks: Vec<Vec<&mut [f64]>> = (0..rows.div_ceil(BLOCK)).map(|_| Vec::new()).collect();
        for column in out.chunks_mut(rows) {
            blocks.iter_mut().zip(column.chunks_mut(BLOCK)).for_each(|(block, part)| block.push(part));
        }
        blocks.into_par_iter().enumerate().for_each(|(block, mut out)| {
            let (from, count) = (block * BLOCK, out[0].len());
            let place = self.sites.part(from, count, time);
            let mut inputs = [Input::Uniform(0.0); VARIABLES.len() + MOST_SPECIES];
            inputs[..place.len()].copy_from_slice(&place);
            for k in 0..self.species {
                inputs[place.len() + k] = Input::Column(&u[k * rows + from..k * rows + from + count]);
            }
            self.rates.block(&inputs[..place.len() + self.species], count, |k, i, rate| {
                out[k][i] = diffusivity[k] * out[k][i] + rate;
            });
        });
    }

    /// Why the terms have no value, where the substances have the values `u`: the first point without one.
    #[must_use]
    pub fn fault(&self, u: &[f64], time: f64) -> Option<String> {
        let rows = self.sites.len();
        (0..rows).find_map(|i| {
            let more: Vec<f64> = (0..self.species).map(|k| u[k * rows + i]).collect();
            let place = self.sites.part(i, 1, time).map(|input| match input {
                Input::Column(column) => column[0],
                Input::Uniform(value) => value,
            });
            let at: Vec<f64> = place.into_iter().chain(more).collect();
            self.rates.fault(&at).map(|fault| format!("{fault}, point {i}"))
        })
    }
}
