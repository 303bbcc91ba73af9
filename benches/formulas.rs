//! Evaluation of formulas: time of a point, by the number and kind of operations.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use meniscus::formulas::{BLOCK, Bound, Context, Input, NamedNumbers};
use std::hint::black_box;

/// Names and formulas; each has about ten operations.
const FORMULAS: [(&str, &str); 4] = [
    ("ten operations, arithmetic", "(x*y + 3)*(x - y)/(x*x + 2) + x*y*y"),
    ("ten operations with a sine and a root", "sin(x*y + 3)*(x - y)/sqrt(x*x + 2) + x*y"),
    ("single vortex, one component", "-2*cos(pi*t/8)*sin(pi*x)^2*sin(pi*y)*cos(pi*y)"),
    ("ten operations with a power and an arc", "(x*x + 1)^y*(x - y)/(x + 4) + atan2(y, x)*x"),
];

fn formulas(criterion: &mut Criterion) {
    let (x, y): (Vec<f64>, Vec<f64>) = (0..BLOCK).map(|k| (0.01 * k as f64, 0.5 - 0.004 * k as f64)).unzip();
    let mut group = criterion.benchmark_group("formulas");
    group.throughput(Throughput::Elements(BLOCK as u64));
    for (name, text) in FORMULAS {
        let parameters = NamedNumbers::default();
        let context = Context { pointer: "", variables: &["x", "y", "t"], parameters: &parameters };
        let Ok(formula) = Bound::new(&[("formula".to_owned(), &text.into())], context) else { continue };
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                let inputs = [Input::Column(black_box(&x)), Input::Column(black_box(&y)), Input::Uniform(0.5)];
                let mut sum = 0.0;
                formula.block(&inputs, BLOCK, |_, _, value| sum += value);
                sum
            });
        });
    }
    group.finish();
}

criterion_group!(benches, formulas);
criterion_main!(benches);
