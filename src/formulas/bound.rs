//! Formulas whose names are known: what flows, fields, forces and laws evaluate.

use super::derivative::derivative;
use super::expression::{Graph, NodeId};
use super::grammar::{Names, parse};
use super::program::{BLOCK, Input, Program, Workspace};
use super::spec::{FormulaText, NamedNumbers, shortened};
use crate::spec::{Parameter, Violation};
use serde_json::json;
use std::cell::RefCell;

/// What formulas may use at the place where they stand.
#[derive(Debug, Clone, Copy)]
pub struct Context<'a> {
    /// Pointer of the object that has the formulas.
    pub pointer: &'a str,
    /// Variables, in the order of the inputs of an evaluation.
    pub variables: &'a [&'a str],
    /// Numbers with names.
    pub parameters: &'a NamedNumbers,
}

/// Formulas of the same variables, evaluated together.
#[derive(Debug, Clone)]
pub struct Bound {
    graph: Graph,
    /// The node of each formula.
    terms: Vec<NodeId>,
    texts: Vec<String>,
    variables: Vec<String>,
    program: Program,
}

/// A formula without a finite value at a point.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("the formula \"{formula}\" is {value} at {at}")]
pub struct Fault {
    /// The formula.
    pub formula: String,
    /// Its value.
    pub value: f64,
    /// The variables there.
    pub at: String,
}

thread_local! {
    // Columns are scratch of one evaluation; nothing is read from them that it has not written.
    static WORKSPACE: RefCell<Workspace> = RefCell::default();
}

impl Bound {
    /// Formulas with their places below the pointer of the context, and their names looked up.
    ///
    /// # Errors
    /// All that is wrong with all of them.
    pub fn new(formulas: &[(String, &FormulaText)], context: Context<'_>) -> Result<Self, Vec<Violation>> {
        let mut graph = Graph::default();
        let names = Names { variables: context.variables, parameters: &context.parameters.0 };
        let mut errors = Vec::new();
        for (name, _) in &context.parameters.0 {
            if context.variables.contains(&name.as_str()) {
                let at = format!("{}/parameters/{name}", context.pointer);
                let detail = format!("{name} is a variable of the formulas here");
                errors.push(Violation::new(at, "name", detail, json!(name), json!("another name")));
            }
        }
        let mut terms = Vec::new();
        for (place, text) in formulas {
            match parse(&text.0, names, &mut graph) {
                Ok(term) => terms.push(term),
                Err(found) => errors.extend(found.into_iter().map(|error| {
                    let at = format!("{}/{place}", context.pointer);
                    let allowed =
                        if error.allowed.is_empty() { FormulaText::allowed(()) } else { json!(error.allowed) };
                    let mut violation = Violation::new(at, "formula", error.to_string(), shortened(&text.0), allowed);
                    violation.did_you_mean = error.did_you_mean;
                    violation
                })),
            }
        }
        if !errors.is_empty() {
            return Err(errors);
        }
        let program = Program::new(&graph, &terms);
        Ok(Self {
            program,
            graph,
            terms,
            texts: formulas.iter().map(|(_, text)| text.0.clone()).collect(),
            variables: context.variables.iter().map(|name| (*name).to_owned()).collect(),
        })
    }

    /// Number of formulas.
    #[must_use]
    pub fn len(&self) -> usize {
        self.terms.len()
    }

    /// Whether there is no formula.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.terms.is_empty()
    }

    /// The formulas as they were given.
    #[must_use]
    pub fn texts(&self) -> &[String] {
        &self.texts
    }

    /// Operations of one evaluation at a point, for estimates.
    #[must_use]
    pub fn operations(&self) -> usize {
        self.program.operations()
    }

    /// Whether a formula depends on a variable.
    #[must_use]
    pub fn depends_on(&self, variable: usize) -> bool {
        self.program.depends_on(variable)
    }

    /// Whether a formula names a variable.
    #[must_use]
    pub fn names(&self, variable: usize) -> bool {
        self.program.reads(variable)
    }

    /// The partial derivatives of formula k by the variables `by[k]`, as formulas of the same variables: the first formula's
    /// derivatives come first.
    #[must_use]
    pub fn derivatives(&self, by: &[Vec<usize>]) -> Self {
        let mut graph = self.graph.clone();
        let (mut terms, mut texts) = (Vec::new(), Vec::new());
        for ((term, text), by) in self.terms.iter().zip(&self.texts).zip(by) {
            for variable in by {
                terms.push(derivative(&mut graph, *term, *variable));
                texts.push(format!("∂({text})/∂{}", self.variables.get(*variable).map_or("?", String::as_str)));
            }
        }
        let program = Program::new(&graph, &terms);
        Self { graph, terms, texts, variables: self.variables.clone(), program }
    }

    /// The first formula f with its first and second derivatives by some variables: f, then ∂f/∂v, then ∂²f/∂v∂w row by row.
    #[must_use]
    pub fn jet(&self, by: &[usize]) -> Self {
        let mut graph = self.graph.clone();
        let Some(value) = self.terms.first().copied() else { return self.clone() };
        let first: Vec<NodeId> = by.iter().map(|variable| derivative(&mut graph, value, *variable)).collect();
        let mut terms = vec![value];
        terms.extend(&first);
        for slope in first {
            terms.extend(by.iter().map(|variable| derivative(&mut graph, slope, *variable)).collect::<Vec<_>>());
        }
        let program = Program::new(&graph, &terms);
        let texts = vec![self.texts.first().cloned().unwrap_or_default(); terms.len()];
        Self { graph, terms, texts, variables: self.variables.clone(), program }
    }

    /// The values at one point, where the variables have the values `at`.
    #[must_use]
    pub fn at(&self, at: &[f64]) -> Vec<f64> {
        let inputs: Vec<Input<'_>> = at.iter().map(|value| Input::Uniform(*value)).collect();
        let mut values = vec![f64::NAN; self.len()];
        self.block(&inputs, 1, |k, _, value| values[k] = value);
        values
    }

    /// Evaluates at up to [`BLOCK`] points: `write(k, i, value)` takes the value of formula `k` at point `i`.
    pub fn block(&self, inputs: &[Input<'_>], count: usize, write: impl FnMut(usize, usize, f64)) {
        WORKSPACE.with_borrow_mut(|workspace| self.program.evaluate(inputs, count, workspace, write));
    }

    /// Evaluates formula by formula at any number of points; `columns` has one column a variable.
    #[must_use]
    pub fn everywhere(&self, columns: &[Input<'_>], count: usize) -> Vec<Vec<f64>> {
        let mut values = vec![vec![0.0; count]; self.len()];
        for from in (0..count).step_by(BLOCK) {
            let size = BLOCK.min(count - from);
            let part: Vec<Input<'_>> = columns
                .iter()
                .map(|input| match input {
                    Input::Uniform(value) => Input::Uniform(*value),
                    Input::Column(column) => Input::Column(&column[from..from + size]),
                })
                .collect();
            self.block(&part, size, |k, i, value| values[k][from + i] = value);
        }
        values
    }

    /// The first formula without a finite value where the variables have the values `at`, if there is one.
    #[must_use]
    pub fn fault(&self, at: &[f64]) -> Option<Fault> {
        let values = self.at(at);
        let k = values.iter().position(|value| !value.is_finite())?;
        let places: Vec<String> =
            self.variables.iter().zip(at).map(|(name, value)| format!("{name} = {value}")).collect();
        Some(Fault { formula: self.texts[k].clone(), value: values[k], at: places.join(", ") })
    }
}

/// Two lots of formulas are the same where their texts are.
impl PartialEq for Bound {
    fn eq(&self, other: &Self) -> bool {
        self.texts == other.texts && self.variables == other.variables
    }
}
