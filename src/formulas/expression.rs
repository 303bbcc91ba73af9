//! The terms of formulas as a graph in which equal terms are one node.

use super::functions::{BinaryOp, UnaryOp};
use std::collections::HashMap;

/// Index of a node; arguments of a node have smaller indices.
pub type NodeId = usize;

/// A term.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Node {
    /// A number.
    Constant(f64),
    /// A variable, by its index.
    Variable(usize),
    /// A function of one term.
    Unary(UnaryOp, NodeId),
    /// A function of two terms.
    Binary(BinaryOp, NodeId, NodeId),
    /// The second term where the first is not 0, else the third.
    Choose(NodeId, NodeId, NodeId),
}

/// Terms of some formulas over the same variables. Terms of numbers alone are numbers.
#[derive(Debug, Clone, Default)]
pub struct Graph {
    nodes: Vec<Node>,
    known: HashMap<(u8, u64, u64, u64), NodeId>,
}

impl Graph {
    /// The nodes; arguments stand before what uses them.
    #[must_use]
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The number that a node is, if it is one.
    #[must_use]
    pub fn constant_at(&self, id: NodeId) -> Option<f64> {
        match self.nodes[id] {
            Node::Constant(value) => Some(value),
            _ => None,
        }
    }

    /// A number.
    pub fn constant(&mut self, value: f64) -> NodeId {
        self.intern(Node::Constant(value))
    }

    /// A variable.
    pub fn variable(&mut self, index: usize) -> NodeId {
        self.intern(Node::Variable(index))
    }

    /// A function of one term.
    pub fn unary(&mut self, op: UnaryOp, a: NodeId) -> NodeId {
        match (op, self.nodes[a]) {
            (_, Node::Constant(value)) => self.constant(op.apply(value)),
            (UnaryOp::Neg, Node::Unary(UnaryOp::Neg, inner)) => inner,
            _ => self.intern(Node::Unary(op, a)),
        }
    }

    /// A function of two terms. Sums with 0, products with 0 and 1, and powers with whole exponents are simplified; so 0
    /// times a term is 0, also where the term has no value.
    pub fn binary(&mut self, op: BinaryOp, a: NodeId, b: NodeId) -> NodeId {
        match (op, self.constant_at(a), self.constant_at(b)) {
            (_, Some(x), Some(y)) => self.constant(op.apply(x, y)),
            (BinaryOp::Add, Some(0.0), _) | (BinaryOp::Mul, Some(1.0), _) => b,
            (BinaryOp::Add | BinaryOp::Sub, _, Some(0.0)) | (BinaryOp::Mul | BinaryOp::Div, _, Some(1.0)) => a,
            (BinaryOp::Mul, Some(0.0), _) | (BinaryOp::Mul, _, Some(0.0)) => self.constant(0.0),
            (BinaryOp::Sub, Some(0.0), _) | (BinaryOp::Mul, Some(-1.0), _) => self.unary(UnaryOp::Neg, b),
            (BinaryOp::Mul, _, Some(-1.0)) => self.unary(UnaryOp::Neg, a),
            (BinaryOp::Pow, _, Some(exponent)) => self.power(a, exponent),
            // One order of the arguments, so that x·y and y·x are one node.
            (BinaryOp::Add | BinaryOp::Mul, _, _) => self.intern(Node::Binary(op, a.min(b), a.max(b))),
            _ => self.intern(Node::Binary(op, a, b)),
        }
    }

    /// `yes` where the condition is not 0, else `no`.
    pub fn choose(&mut self, condition: NodeId, yes: NodeId, no: NodeId) -> NodeId {
        match self.constant_at(condition) {
            Some(value) => {
                if value != 0.0 {
                    yes
                } else {
                    no
                }
            }
            None if yes == no => yes,
            None => self.intern(Node::Choose(condition, yes, no)),
        }
    }

    /// A power with a constant exponent: whole ones up to 16 by products, halves by the square root.
    fn power(&mut self, base: NodeId, exponent: f64) -> NodeId {
        const MOST: f64 = 16.0;
        if exponent == 0.0 {
            return self.constant(1.0);
        }
        if exponent == 0.5 {
            return self.unary(UnaryOp::Sqrt, base);
        }
        if exponent.fract() != 0.0 || exponent.abs() > MOST {
            let exponent = self.constant(exponent);
            return self.intern(Node::Binary(BinaryOp::Pow, base, exponent));
        }
        let product = self.whole_power(base, exponent.abs() as u32);
        if exponent > 0.0 {
            return product;
        }
        let one = self.constant(1.0);
        self.binary(BinaryOp::Div, one, product)
    }

    /// A power by repeated squares.
    fn whole_power(&mut self, base: NodeId, exponent: u32) -> NodeId {
        if exponent == 1 {
            return base;
        }
        let half = self.whole_power(base, exponent / 2);
        let square = self.binary(BinaryOp::Mul, half, half);
        if exponent.is_multiple_of(2) { square } else { self.binary(BinaryOp::Mul, square, base) }
    }

    fn intern(&mut self, node: Node) -> NodeId {
        let key = match node {
            Node::Constant(value) => (0, value.to_bits(), 0, 0),
            Node::Variable(index) => (1, index as u64, 0, 0),
            Node::Unary(op, a) => (2, op as u64, a as u64, 0),
            Node::Binary(op, a, b) => (3, op as u64, a as u64, b as u64),
            Node::Choose(a, b, c) => (4, a as u64, b as u64, c as u64),
        };
        let nodes = &mut self.nodes;
        *self.known.entry(key).or_insert_with(|| {
            nodes.push(node);
            nodes.len() - 1
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{BinaryOp, Graph, Node};

    #[test]
    fn equal_terms_are_one_node_and_numbers_are_computed() {
        let mut graph = Graph::default();
        let (x, y) = (graph.variable(0), graph.variable(1));
        assert_eq!(graph.binary(BinaryOp::Mul, x, y), graph.binary(BinaryOp::Mul, y, x));
        let (two, three) = (graph.constant(2.0), graph.constant(3.0));
        let eight = graph.binary(BinaryOp::Pow, two, three);
        assert_eq!(graph.constant_at(eight), Some(8.0));
        let zero = graph.constant(0.0);
        assert_eq!(graph.binary(BinaryOp::Add, x, zero), x);
    }

    #[test]
    fn whole_powers_are_products() {
        let mut graph = Graph::default();
        let x = graph.variable(0);
        let five = graph.constant(5.0);
        graph.binary(BinaryOp::Pow, x, five);
        let powers = graph.nodes().iter().filter(|node| matches!(node, Node::Binary(BinaryOp::Pow, ..))).count();
        assert_eq!((powers, graph.nodes().len()), (0, 5), "x, 5, x², x⁴, x⁵");
    }
}
