//! Partial derivatives of formulas, as further terms of their graph.
//!
//! At a kink (of `abs`, `min`, `max`, `if`) the derivative is that of one side; steps have the derivative 0.

use super::expression::{Graph, Node, NodeId};
use super::functions::{BinaryOp, UnaryOp};

/// The derivative of a term by a variable.
pub(super) fn derivative(graph: &mut Graph, term: NodeId, variable: usize) -> NodeId {
    let mut rule = Rule { graph, slopes: Vec::new() };
    for id in 0..=term {
        let slope = rule.slope(id, variable);
        rule.slopes.push(slope);
    }
    rule.slopes[term]
}

struct Rule<'a> {
    graph: &'a mut Graph,
    /// Derivatives of the nodes so far.
    slopes: Vec<NodeId>,
}

impl Rule<'_> {
    fn number(&mut self, value: f64) -> NodeId {
        self.graph.constant(value)
    }

    fn add(&mut self, a: NodeId, b: NodeId) -> NodeId {
        self.graph.binary(BinaryOp::Add, a, b)
    }

    fn subtract(&mut self, a: NodeId, b: NodeId) -> NodeId {
        self.graph.binary(BinaryOp::Sub, a, b)
    }

    fn times(&mut self, a: NodeId, b: NodeId) -> NodeId {
        self.graph.binary(BinaryOp::Mul, a, b)
    }

    fn over(&mut self, a: NodeId, b: NodeId) -> NodeId {
        self.graph.binary(BinaryOp::Div, a, b)
    }

    fn unary(&mut self, op: UnaryOp, a: NodeId) -> NodeId {
        self.graph.unary(op, a)
    }

    fn is_zero(&self, a: NodeId) -> bool {
        self.graph.constant_at(a) == Some(0.0)
    }

    fn slope(&mut self, id: NodeId, variable: usize) -> NodeId {
        match self.graph.nodes()[id] {
            Node::Constant(_) => self.number(0.0),
            Node::Variable(index) => self.number(if index == variable { 1.0 } else { 0.0 }),
            Node::Unary(op, a) => {
                let da = self.slopes[a];
                if self.is_zero(da) {
                    return da;
                }
                let outer = self.outer(op, a, id);
                self.times(outer, da)
            }
            Node::Binary(op, a, b) => {
                let (da, db) = (self.slopes[a], self.slopes[b]);
                if self.is_zero(da) && self.is_zero(db) {
                    return da;
                }
                self.of_two(op, [a, b], [da, db], id)
            }
            Node::Choose(condition, yes, no) => {
                let (yes, no) = (self.slopes[yes], self.slopes[no]);
                self.graph.choose(condition, yes, no)
            }
        }
    }

    /// f′(a) of f(a), which is the node `value`.
    fn outer(&mut self, op: UnaryOp, a: NodeId, value: NodeId) -> NodeId {
        let one = self.number(1.0);
        match op {
            UnaryOp::Neg => self.number(-1.0),
            UnaryOp::Not | UnaryOp::Sign | UnaryOp::Step | UnaryOp::Floor | UnaryOp::Ceil | UnaryOp::Round => {
                self.number(0.0)
            }
            UnaryOp::Abs => self.unary(UnaryOp::Sign, a),
            UnaryOp::Sqrt => {
                let half = self.number(0.5);
                self.over(half, value)
            }
            UnaryOp::Cbrt => {
                let (three, square) = (self.number(3.0), self.times(value, value));
                let bottom = self.times(three, square);
                self.over(one, bottom)
            }
            UnaryOp::Exp => value,
            UnaryOp::Ln => self.over(one, a),
            UnaryOp::Log10 | UnaryOp::Log2 => {
                let base: f64 = if op == UnaryOp::Log10 { 10.0 } else { 2.0 };
                let scale = self.number(1.0 / base.ln());
                self.over(scale, a)
            }
            UnaryOp::Sin => self.unary(UnaryOp::Cos, a),
            UnaryOp::Cos => {
                let sine = self.unary(UnaryOp::Sin, a);
                self.unary(UnaryOp::Neg, sine)
            }
            UnaryOp::Sinh => self.unary(UnaryOp::Cosh, a),
            UnaryOp::Cosh => self.unary(UnaryOp::Sinh, a),
            UnaryOp::Tan | UnaryOp::Tanh => {
                let square = self.times(value, value);
                if op == UnaryOp::Tan { self.add(one, square) } else { self.subtract(one, square) }
            }
            UnaryOp::Asin | UnaryOp::Acos => {
                let square = self.times(a, a);
                let under = self.subtract(one, square);
                let (root, sign) =
                    (self.unary(UnaryOp::Sqrt, under), self.number(if op == UnaryOp::Asin { 1.0 } else { -1.0 }));
                self.over(sign, root)
            }
            UnaryOp::Atan => {
                let square = self.times(a, a);
                let bottom = self.add(one, square);
                self.over(one, bottom)
            }
        }
    }

    fn of_two(&mut self, op: BinaryOp, [a, b]: [NodeId; 2], [da, db]: [NodeId; 2], value: NodeId) -> NodeId {
        match op {
            BinaryOp::Add => self.add(da, db),
            BinaryOp::Sub => self.subtract(da, db),
            BinaryOp::Mul => {
                let (left, right) = (self.times(da, b), self.times(a, db));
                self.add(left, right)
            }
            // (a/b)′ = (a′ − (a/b) b′)/b
            BinaryOp::Div => {
                let part = self.times(value, db);
                let top = self.subtract(da, part);
                self.over(top, b)
            }
            BinaryOp::Pow => self.of_power([a, b], [da, db], value),
            BinaryOp::Min | BinaryOp::Max => {
                let is_first = if op == BinaryOp::Min { [a, b] } else { [b, a] };
                let condition = self.graph.binary(BinaryOp::LessEqual, is_first[0], is_first[1]);
                self.graph.choose(condition, da, db)
            }
            BinaryOp::Atan2 => {
                let (left, right) = (self.times(b, da), self.times(a, db));
                let (aa, bb) = (self.times(a, a), self.times(b, b));
                let (top, bottom) = (self.subtract(left, right), self.add(aa, bb));
                self.over(top, bottom)
            }
            BinaryOp::Hypot => {
                let (left, right) = (self.times(a, da), self.times(b, db));
                let top = self.add(left, right);
                self.over(top, value)
            }
            BinaryOp::Mod => {
                let share = self.over(a, b);
                let whole = self.unary(UnaryOp::Floor, share);
                let part = self.times(whole, db);
                self.subtract(da, part)
            }
            BinaryOp::Less | BinaryOp::LessEqual | BinaryOp::And | BinaryOp::Or => self.number(0.0),
        }
    }

    /// b aᵇ⁻¹ a′ + aᵇ ln a b′
    fn of_power(&mut self, [a, b]: [NodeId; 2], [da, db]: [NodeId; 2], value: NodeId) -> NodeId {
        let one = self.number(1.0);
        let less = self.subtract(b, one);
        let power = self.graph.binary(BinaryOp::Pow, a, less);
        let factor = self.times(b, power);
        let by_base = self.times(factor, da);
        if self.is_zero(db) {
            return by_base;
        }
        let logarithm = self.unary(UnaryOp::Ln, a);
        let rate = self.times(value, logarithm);
        let by_exponent = self.times(rate, db);
        self.add(by_base, by_exponent)
    }
}
