//! Evaluation of formulas over blocks of points.

use super::expression::{Graph, Node, NodeId};
use super::functions::{BinaryOp, UnaryOp};
use super::lanes::{self, LANES, Lanes};

/// Points of a block: the values of a term over them stay in the nearest cache.
pub const BLOCK: usize = 64;
/// Vector registers of a block.
const VECTORS: usize = BLOCK / LANES;

type Column = [Lanes; VECTORS];

#[derive(Debug, Clone, Copy)]
enum Step {
    Constant(f64),
    Variable(usize),
    Unary(UnaryOp, usize),
    Binary(BinaryOp, usize, usize),
    Choose(usize, usize, usize),
    /// The sine of a column and, in the column that follows, its cosine: both come from one reduction of the angle.
    SineAndCosine(usize),
    /// The column that the step before has written, too.
    Written,
}

/// Formulas that are evaluated together, as steps in order. Step k writes column k.
#[derive(Debug, Clone)]
pub struct Program {
    steps: Vec<Step>,
    /// Variables that a step depends on, one bit each.
    needs: Vec<u64>,
    outputs: Vec<usize>,
}

/// Columns that an evaluation writes, kept from one to the next.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    columns: Vec<Column>,
}

/// Values of a variable over a block.
#[derive(Debug, Clone, Copy)]
pub enum Input<'a> {
    /// One number for all points.
    Uniform(f64),
    /// One number a point.
    Column(&'a [f64]),
}

impl Program {
    /// The terms `outputs` of a graph, and what they are made of.
    #[must_use]
    pub fn new(graph: &Graph, outputs: &[NodeId]) -> Self {
        let nodes = graph.nodes();
        let mut is_needed = vec![false; nodes.len()];
        for output in outputs {
            is_needed[*output] = true;
        }
        for id in (0..nodes.len()).rev() {
            if is_needed[id] {
                for argument in arguments(nodes[id]).into_iter().flatten() {
                    is_needed[argument] = true;
                }
            }
        }
        let partners = partners(nodes, &is_needed);
        let mut place = vec![usize::MAX; nodes.len()];
        let (mut steps, mut needs) = (Vec::new(), Vec::<u64>::new());
        for (id, node) in nodes.iter().enumerate().filter(|(id, _)| is_needed[*id]) {
            if place[id] != usize::MAX {
                continue;
            }
            place[id] = steps.len();
            if let (Some(partner), Node::Unary(op, a)) = (partners[id], *node) {
                let (sine, cosine) = if op == UnaryOp::Sin { (id, partner) } else { (partner, id) };
                (place[sine], place[cosine]) = (steps.len(), steps.len() + 1);
                steps.extend([Step::SineAndCosine(place[a]), Step::Written]);
                needs.extend([needs[place[a]]; 2]);
                continue;
            }
            let (step, need) = match *node {
                Node::Constant(value) => (Step::Constant(value), 0),
                Node::Variable(index) => (Step::Variable(index), 1 << (index % 64)),
                Node::Unary(op, a) => (Step::Unary(op, place[a]), needs[place[a]]),
                Node::Binary(op, a, b) => (Step::Binary(op, place[a], place[b]), needs[place[a]] | needs[place[b]]),
                Node::Choose(a, b, c) => {
                    let [a, b, c] = [place[a], place[b], place[c]];
                    (Step::Choose(a, b, c), needs[a] | needs[b] | needs[c])
                }
            };
            steps.push(step);
            needs.push(need);
        }
        let outputs = outputs.iter().map(|output| place[*output]).collect();
        Self { steps, needs, outputs }
    }

    /// Number of outputs.
    #[must_use]
    pub fn outputs(&self) -> usize {
        self.outputs.len()
    }

    /// Number of operations of one evaluation at a point, for estimates.
    #[must_use]
    pub fn operations(&self) -> usize {
        self.steps.iter().filter(|step| !matches!(step, Step::Constant(_) | Step::Variable(_) | Step::Written)).count()
    }

    /// Whether a variable is read.
    #[must_use]
    pub fn reads(&self, variable: usize) -> bool {
        self.steps.iter().any(|step| matches!(step, Step::Variable(index) if *index == variable))
    }

    /// Whether an output depends on a variable, of the first 64.
    #[must_use]
    pub fn depends_on(&self, variable: usize) -> bool {
        self.outputs.iter().any(|output| self.needs[*output] >> (variable % 64) & 1 == 1)
    }

    /// Evaluates the formulas at up to [`BLOCK`] points and hands over the value of output `k` at point `i` by `write(k, i, value)`.
    /// The value at a point depends on its own inputs alone, to the last bit.
    pub fn evaluate(
        &self,
        inputs: &[Input<'_>],
        count: usize,
        workspace: &mut Workspace,
        mut write: impl FnMut(usize, usize, f64),
    ) {
        let columns = &mut workspace.columns;
        columns.resize(self.steps.len().max(columns.len()), [Lanes::splat(0.0); VECTORS]);
        let vectors = count.min(BLOCK).div_ceil(LANES);
        let varying = (0_u64..).zip(inputs).filter(|(_, input)| matches!(input, Input::Column(_)));
        let varying = varying.fold(0_u64, |mask, (index, _)| mask | 1 << (index % 64));
        for (k, step) in self.steps.iter().enumerate() {
            let (before, rest) = columns.split_at_mut(k);
            let [to, after @ ..] = rest else { return };
            // What is the same at all points is computed once.
            let is_uniform = self.needs[k] & varying == 0;
            let length = if is_uniform { 1 } else { vectors };
            match *step {
                Step::Constant(value) => to[0] = Lanes::splat(value),
                Step::Variable(index) => load(to, inputs.get(index), count),
                Step::Unary(op, a) => lanes::unary(op, &mut to[..length], &before[a]),
                Step::Binary(op, a, b) => lanes::binary(op, &mut to[..length], &before[a], &before[b]),
                Step::Choose(a, b, c) => lanes::choose(&mut to[..length], &before[a], &before[b], &before[c]),
                Step::SineAndCosine(a) => {
                    let [cosines, ..] = after else { return };
                    lanes::sine_and_cosine(&mut to[..length], &mut cosines[..length], &before[a]);
                }
                Step::Written => {}
            }
            if is_uniform {
                let first = to[0];
                to[1..vectors.max(1)].fill(first);
            }
        }
        for (k, output) in self.outputs.iter().enumerate() {
            for (v, lanes) in columns[*output][..vectors].iter().enumerate() {
                for (lane, value) in
                    lanes.to_array().into_iter().enumerate().take_while(|(lane, _)| v * LANES + lane < count)
                {
                    write(k, v * LANES + lane, value);
                }
            }
        }
    }
}

/// Of every sine that is needed beside the cosine of the same term the node of that, and the other way around.
fn partners(nodes: &[Node], is_needed: &[bool]) -> Vec<Option<NodeId>> {
    let mut partners = vec![None; nodes.len()];
    let mut sines = vec![None; nodes.len()];
    let mut cosines = vec![None; nodes.len()];
    for (id, node) in nodes.iter().enumerate().filter(|(id, _)| is_needed[*id]) {
        match *node {
            Node::Unary(UnaryOp::Sin, a) => sines[a] = Some(id),
            Node::Unary(UnaryOp::Cos, a) => cosines[a] = Some(id),
            _ => {}
        }
    }
    for (sine, cosine) in sines.into_iter().zip(cosines).filter_map(|(sine, cosine)| sine.zip(cosine)) {
        (partners[sine], partners[cosine]) = (Some(cosine), Some(sine));
    }
    partners
}

fn arguments(node: Node) -> [Option<NodeId>; 3] {
    match node {
        Node::Constant(_) | Node::Variable(_) => [None; 3],
        Node::Unary(_, a) => [Some(a), None, None],
        Node::Binary(_, a, b) => [Some(a), Some(b), None],
        Node::Choose(a, b, c) => [Some(a), Some(b), Some(c)],
    }
}

/// Fills a column with the values of a variable; points beyond the last repeat it.
fn load(to: &mut Column, input: Option<&Input<'_>>, count: usize) {
    match input {
        Some(Input::Column(values)) => {
            for (v, to) in to.iter_mut().enumerate().take(count.div_ceil(LANES)) {
                *to = Lanes::from(std::array::from_fn(|lane| {
                    let at = (v * LANES + lane).min(count - 1);
                    values.get(at).copied().unwrap_or(f64::NAN)
                }));
            }
        }
        Some(Input::Uniform(value)) => to.fill(Lanes::splat(*value)),
        None => to.fill(Lanes::splat(f64::NAN)),
    }
}

#[cfg(test)]
mod tests {
    use super::super::expression::Graph;
    use super::super::functions::UnaryOp;
    use super::{BLOCK, Input, Program, Workspace};

    fn values(program: &Program, inputs: &[Input<'_>], count: usize) -> Vec<Vec<f64>> {
        let mut found = vec![vec![0.0; count]; program.outputs()];
        program.evaluate(inputs, count, &mut Workspace::default(), |k, i, value| found[k][i] = value);
        found
    }

    #[test]
    fn sines_and_cosines_of_one_term_are_those_that_stand_alone() {
        let mut graph = Graph::default();
        let (x, t) = (graph.variable(0), graph.variable(1));
        let mut trigonometric = |a| [graph.unary(UnaryOp::Cos, a), graph.unary(UnaryOp::Sin, a)];
        let [cos_x, sin_x] = trigonometric(x);
        let [cos_t, sin_t] = trigonometric(t);
        let nested = graph.unary(UnaryOp::Cos, sin_x);
        let outputs = [nested, cos_x, sin_x, sin_t, cos_t];
        let together = Program::new(&graph, &outputs);
        assert_eq!(together.operations(), 3, "two pairs, and the cosine of a sine");
        let numbers: Vec<f64> = (0..BLOCK - 3).map(|k| 0.37 * k as f64 * if k == 7 { 1e9 } else { 1.0 }).collect();
        let inputs = [Input::Column(&numbers), Input::Uniform(2.5)];
        let all = values(&together, &inputs, numbers.len());
        for (k, output) in outputs.into_iter().enumerate() {
            let alone = values(&Program::new(&graph, &[output]), &inputs, numbers.len());
            assert_eq!(alone[0], all[k], "output {k}");
        }
        assert!(together.reads(1) && together.depends_on(0));
    }
}
