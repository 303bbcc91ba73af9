//! The grammar of formulas, from weak to strong: `or`, `and`, `not`, comparison, `+ −`, `* /`, sign, `^` (right first).

use super::error::FormulaError;
use super::expression::{Graph, NodeId};
use super::functions::{BinaryOp, FUNCTIONS, Function, Meaning, UnaryOp};
use super::scanner::{Placed, Token, scan};
use crate::spec::suggest;

/// Longest formula in bytes.
pub const MOST_BYTES: usize = 4096;
/// Most terms inside one another.
const MOST_DEPTH: usize = 100;
/// Constants that every formula knows.
const CONSTANTS: [(&str, f64); 2] = [("pi", std::f64::consts::PI), ("e", std::f64::consts::E)];
/// Names that are words of the grammar.
const WORDS: [&str; 3] = ["and", "or", "not"];

/// The names that a formula may use, beside functions and constants.
#[derive(Debug, Clone, Copy)]
pub struct Names<'a> {
    /// Variables, in the order of their indices.
    pub variables: &'a [&'a str],
    /// Numbers with names.
    pub parameters: &'a [(String, f64)],
}

/// Whether a text is a well-formed formula, whatever its names mean.
///
/// # Errors
/// The first place where it is not.
pub fn check_syntax(text: &str) -> Result<(), FormulaError> {
    let mut graph = Graph::default();
    let mut reader = Reader::new(text, None, &mut graph)?;
    reader.whole()?;
    Ok(())
}

/// Adds a formula to a graph; the node of its value.
///
/// # Errors
/// A place where it is malformed, or all unknown names and numbers that are not finite.
pub(super) fn parse(text: &str, names: Names<'_>, graph: &mut Graph) -> Result<NodeId, Vec<FormulaError>> {
    let mut reader = Reader::new(text, Some(names), graph).map_err(|error| vec![error])?;
    let node = reader.whole();
    let mut errors = reader.errors;
    match node {
        Ok(node) if errors.is_empty() => Ok(node),
        Ok(_) => Err(errors),
        Err(error) => {
            errors.push(error);
            Err(errors)
        }
    }
}

struct Reader<'a> {
    tokens: Vec<Placed>,
    at: usize,
    depth: usize,
    /// None where names are not looked up.
    names: Option<Names<'a>>,
    graph: &'a mut Graph,
    /// Unknown names and values that are not finite: reading goes on after them.
    errors: Vec<FormulaError>,
}

impl<'a> Reader<'a> {
    fn new(text: &str, names: Option<Names<'a>>, graph: &'a mut Graph) -> Result<Self, FormulaError> {
        if text.len() > MOST_BYTES {
            let detail = format!("the formula has {} bytes", text.len());
            return Err(FormulaError::new(1, detail).allowing(format!("at most {MOST_BYTES} bytes")));
        }
        Ok(Self { tokens: scan(text)?, at: 0, depth: 0, names, graph, errors: Vec::new() })
    }

    fn token(&self) -> &Token {
        &self.tokens[self.at].token
    }

    fn column(&self) -> usize {
        self.tokens[self.at].column
    }

    fn sign(&self) -> Option<&'static str> {
        if let Token::Sign(sign) = self.token() { Some(sign) } else { None }
    }

    fn accept_sign(&mut self, sign: &str) -> bool {
        let found = self.sign() == Some(sign);
        self.at += usize::from(found);
        found
    }

    fn accept_word(&mut self, word: &str) -> bool {
        let found = matches!(self.token(), Token::Name(name) if name == word);
        self.at += usize::from(found);
        found
    }

    /// What stands here instead of what should.
    fn unexpected(&self, wanted: &str) -> FormulaError {
        let found = match self.token() {
            Token::End => "the formula ends".to_owned(),
            Token::Number(value) => format!("the number {value} stands"),
            Token::Name(name) => format!("\"{name}\" stands"),
            Token::Sign(sign) => format!("\"{sign}\" stands"),
        };
        FormulaError::new(self.column(), format!("{found} where {wanted} is needed"))
    }

    fn whole(&mut self) -> Result<NodeId, FormulaError> {
        let node = self.disjunction()?;
        match self.token() {
            Token::End => Ok(node),
            Token::Number(_) | Token::Name(_) => {
                Err(self.unexpected("an operator").allowing("an operator; a product is written with *, as in 2*x"))
            }
            Token::Sign(_) => Err(self.unexpected("an operator or the end").allowing("an operator or the end")),
        }
    }

    /// Reads what is inside other terms, to a bounded depth.
    fn nested(&mut self, read: impl FnOnce(&mut Self) -> Result<NodeId, FormulaError>) -> Result<NodeId, FormulaError> {
        self.depth += 1;
        if self.depth > MOST_DEPTH {
            let detail = format!("more than {MOST_DEPTH} terms inside one another");
            return Err(FormulaError::new(self.column(), detail).allowing("a formula with fewer brackets"));
        }
        let node = read(self);
        self.depth -= 1;
        node
    }

    /// A node, which must not be a number that is not finite.
    fn checked(&mut self, node: NodeId, column: usize) -> NodeId {
        if let Some(value) = self.graph.constant_at(node).filter(|value| !value.is_finite()) {
            self.errors.push(
                FormulaError::new(column, format!("this is {value}, whatever the point")).allowing("a finite number"),
            );
            return self.graph.constant(1.0);
        }
        node
    }

    fn binary(&mut self, op: BinaryOp, a: NodeId, b: NodeId, column: usize) -> NodeId {
        if op == BinaryOp::Div && self.graph.constant_at(b) == Some(0.0) && self.names.is_some() {
            let error = FormulaError::new(column, "this divides by 0, whatever the point");
            self.errors.push(error.allowing("a divisor that is not 0"));
            return a;
        }
        let node = self.graph.binary(op, a, b);
        // Without names every name stands for the same number: values mean nothing then.
        if self.names.is_some() { self.checked(node, column) } else { node }
    }

    fn unary(&mut self, op: UnaryOp, a: NodeId, column: usize) -> NodeId {
        let node = self.graph.unary(op, a);
        if self.names.is_some() { self.checked(node, column) } else { node }
    }

    fn disjunction(&mut self) -> Result<NodeId, FormulaError> {
        let mut left = self.conjunction()?;
        while self.accept_word("or") {
            let right = self.conjunction()?;
            left = self.graph.binary(BinaryOp::Or, left, right);
        }
        Ok(left)
    }

    fn conjunction(&mut self) -> Result<NodeId, FormulaError> {
        let mut left = self.negation()?;
        while self.accept_word("and") {
            let right = self.negation()?;
            left = self.graph.binary(BinaryOp::And, left, right);
        }
        Ok(left)
    }

    fn negation(&mut self) -> Result<NodeId, FormulaError> {
        if self.accept_word("not") {
            let inner = self.nested(Self::negation)?;
            return Ok(self.graph.unary(UnaryOp::Not, inner));
        }
        self.comparison()
    }

    fn comparison(&mut self) -> Result<NodeId, FormulaError> {
        const SIGNS: [&str; 4] = ["<", "<=", ">", ">="];
        let left = self.sum()?;
        let Some(sign) = self.sign().filter(|sign| SIGNS.contains(sign)) else { return Ok(left) };
        self.at += 1;
        let right = self.sum()?;
        if self.sign().is_some_and(|sign| SIGNS.contains(&sign)) {
            let detail = "a comparison has two sides";
            return Err(FormulaError::new(self.column(), detail).allowing("(a < b) and (b < c)"));
        }
        Ok(match sign {
            "<" => self.graph.binary(BinaryOp::Less, left, right),
            "<=" => self.graph.binary(BinaryOp::LessEqual, left, right),
            ">" => self.graph.binary(BinaryOp::Less, right, left),
            _ => self.graph.binary(BinaryOp::LessEqual, right, left),
        })
    }

    fn sum(&mut self) -> Result<NodeId, FormulaError> {
        let mut left = self.product()?;
        loop {
            let column = self.column();
            let op = match self.sign() {
                Some("+") => BinaryOp::Add,
                Some("-") => BinaryOp::Sub,
                _ => return Ok(left),
            };
            self.at += 1;
            let right = self.product()?;
            left = self.binary(op, left, right, column);
        }
    }

    fn product(&mut self) -> Result<NodeId, FormulaError> {
        let mut left = self.signed()?;
        loop {
            let column = self.column();
            let op = match self.sign() {
                Some("*") => BinaryOp::Mul,
                Some("/") => BinaryOp::Div,
                _ => return Ok(left),
            };
            self.at += 1;
            let right = self.signed()?;
            left = self.binary(op, left, right, column);
        }
    }

    fn signed(&mut self) -> Result<NodeId, FormulaError> {
        let column = self.column();
        if self.accept_sign("-") {
            let inner = self.nested(Self::signed)?;
            return Ok(self.unary(UnaryOp::Neg, inner, column));
        }
        if self.accept_sign("+") {
            return self.nested(Self::signed);
        }
        self.power()
    }

    fn power(&mut self) -> Result<NodeId, FormulaError> {
        let base = self.operand()?;
        let column = self.column();
        if !self.accept_sign("^") {
            return Ok(base);
        }
        let exponent = self.nested(Self::signed)?;
        Ok(self.binary(BinaryOp::Pow, base, exponent, column))
    }

    fn operand(&mut self) -> Result<NodeId, FormulaError> {
        let column = self.column();
        match self.token().clone() {
            Token::Number(value) => {
                self.at += 1;
                Ok(self.graph.constant(value))
            }
            Token::Name(name) if !WORDS.contains(&name.as_str()) => {
                self.at += 1;
                if self.accept_sign("(") { self.call(&name, column) } else { self.name(&name, column) }
            }
            Token::Sign("(") => {
                self.at += 1;
                let node = self.nested(Self::disjunction)?;
                self.close()?;
                Ok(node)
            }
            _ => Err(self.unexpected("a number, a name or \"(\"")),
        }
    }

    fn close(&mut self) -> Result<(), FormulaError> {
        if self.accept_sign(")") { Ok(()) } else { Err(self.unexpected("\")\"")) }
    }

    /// A variable, a parameter or a constant.
    fn name(&mut self, name: &str, column: usize) -> Result<NodeId, FormulaError> {
        let Some(names) = self.names else { return Ok(self.graph.constant(1.0)) };
        if let Some(index) = names.variables.iter().position(|known| *known == name) {
            return Ok(self.graph.variable(index));
        }
        let parameter = names.parameters.iter().find(|(known, _)| known == name).map(|(_, value)| *value);
        let constant = CONSTANTS.iter().find(|(known, _)| *known == name).map(|(_, value)| *value);
        if let Some(value) = parameter.or(constant) {
            return Ok(self.graph.constant(value));
        }
        let known = known_names(names);
        let function = FUNCTIONS.iter().find(|function| function.name == name);
        let detail = match function {
            Some(function) => format!("{name} is a function; write {}", function.call),
            None => format!("there is no \"{name}\" here"),
        };
        let mut error = FormulaError::new(column, detail).allowing(known.join(", "));
        // Of one or two letters every name is a neighbor.
        error.did_you_mean = suggest(name, &known).filter(|_| function.is_none() && name.len() > 2);
        self.errors.push(error);
        Ok(self.graph.constant(1.0))
    }

    /// A function, whose opening bracket has been read.
    fn call(&mut self, name: &str, column: usize) -> Result<NodeId, FormulaError> {
        let mut arguments = Vec::new();
        loop {
            arguments.push(self.nested(Self::disjunction)?);
            if !self.accept_sign(",") {
                break;
            }
        }
        self.close()?;
        let Some(function) = FUNCTIONS.iter().find(|function| function.name == name) else {
            let known: Vec<&str> = FUNCTIONS.iter().map(|function| function.name).collect();
            let is_name = self.names.is_some_and(|names| known_names(names).contains(&name));
            let detail = if is_name {
                format!("{name} is not a function; a product is written with *")
            } else {
                format!("there is no function \"{name}\"")
            };
            let mut error = FormulaError::new(column, detail).allowing(known.join(", "));
            error.did_you_mean = suggest(name, &known);
            self.errors.push(error);
            return Ok(self.graph.constant(1.0));
        };
        let (least, most) = function.arguments();
        if arguments.len() < least || arguments.len() > most {
            let detail = format!("{name} has {} arguments here", arguments.len());
            self.errors.push(FormulaError::new(column, detail).allowing(function.call));
            return Ok(self.graph.constant(1.0));
        }
        let node = self.apply(function, &arguments);
        Ok(if self.names.is_some() { self.checked(node, column) } else { node })
    }

    fn apply(&mut self, function: &Function, arguments: &[NodeId]) -> NodeId {
        let graph = &mut *self.graph;
        match (function.meaning, arguments) {
            (Meaning::Unary(op), [a, ..]) => graph.unary(op, *a),
            (Meaning::Binary(op), [a, b, ..]) => graph.binary(op, *a, *b),
            (Meaning::If, [c, a, b, ..]) => graph.choose(*c, *a, *b),
            (Meaning::Clamp, [x, low, high, ..]) => {
                let above = graph.binary(BinaryOp::Max, *x, *low);
                graph.binary(BinaryOp::Min, above, *high)
            }
            (Meaning::Smoothstep, [low, high, x, ..]) => smoothstep(graph, *low, *high, *x),
            (Meaning::Fold(op), [first, rest @ ..]) => {
                rest.iter().fold(*first, |all, next| graph.binary(op, all, *next))
            }
            // The number of arguments has been checked.
            (_, _) => graph.constant(f64::NAN),
        }
    }
}

/// s²(3 − 2s) with s = (x − low)/(high − low), kept between 0 and 1.
fn smoothstep(graph: &mut Graph, low: NodeId, high: NodeId, x: NodeId) -> NodeId {
    let (zero, one, two, three) = (graph.constant(0.0), graph.constant(1.0), graph.constant(2.0), graph.constant(3.0));
    let (above, width) = (graph.binary(BinaryOp::Sub, x, low), graph.binary(BinaryOp::Sub, high, low));
    let share = graph.binary(BinaryOp::Div, above, width);
    let positive = graph.binary(BinaryOp::Max, share, zero);
    let s = graph.binary(BinaryOp::Min, positive, one);
    let (square, double) = (graph.binary(BinaryOp::Mul, s, s), graph.binary(BinaryOp::Mul, two, s));
    let rest = graph.binary(BinaryOp::Sub, three, double);
    graph.binary(BinaryOp::Mul, square, rest)
}

fn known_names(names: Names<'_>) -> Vec<&str> {
    let parameters = names.parameters.iter().map(|(name, _)| name.as_str());
    names.variables.iter().copied().chain(parameters).chain(CONSTANTS.iter().map(|(name, _)| *name)).collect()
}

/// Why a name cannot be given to something of a user's own, where formulas have these variables; None where it can.
#[must_use]
pub fn why_not_a_name(name: &str, variables: &[&str]) -> Option<&'static str> {
    why_not_a_parameter(name).or(variables.contains(&name).then_some("the name is a variable of the formulas here"))
}

/// Why a name cannot be given to a parameter; None where it can.
pub(super) fn why_not_a_parameter(name: &str) -> Option<&'static str> {
    let mut letters = name.chars();
    let is_name = letters.next().is_some_and(|c| c.is_ascii_alphabetic() || c == '_')
        && letters.all(|c| c.is_ascii_alphanumeric() || c == '_');
    if !is_name {
        return Some("a name has letters, digits and _, and begins with a letter");
    }
    let is_taken = WORDS.contains(&name)
        || CONSTANTS.iter().any(|(known, _)| *known == name)
        || FUNCTIONS.iter().any(|function| function.name == name);
    is_taken.then_some("the name means something else in formulas")
}

#[cfg(test)]
mod tests;
