//! What an application of a surface operator takes, beside what the memory gives to a plain sum over as many bytes:
//! `RAYON_NUM_THREADS=1 taskset -c 1 cargo bench --bench surface_operators`. Figures are reported, never asserted.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use meniscus::geometry::{Vector, fibonacci};
use meniscus::operators::charts::tangent::Metric;
use meniscus::operators::{Functional, Support, TangentChart, construct};
use meniscus::parallel::Interrupt;
use std::f64::consts::PI;
use std::hint::black_box;

/// Δ_S on Fibonacci points of the unit sphere, the supports those of spec/scenes.md.
fn applications(c: &mut Criterion) {
    for (count, degree, cutoff) in [(16_000, 3, 2.6), (64_000, 5, 3.3)] {
        let points: Vec<Vector<3>> = fibonacci::sphere(count);
        let radius = cutoff * (4.0 * PI / count as f64).sqrt();
        let chart = TangentChart::new(&points, &points, Metric::FromNormals, radius);
        let support = Support { degree, radius };
        let Ok(built) = construct::<2>(&chart, support, &[Functional::LaplaceBeltrami], &Interrupt::default()) else {
            continue;
        };
        let operator = &built.operators[0];
        let field: Vec<f64> = points.iter().map(|x| x[2]).collect();
        let mut out = vec![0.0; count];
        // A weight and a column an entry; of a point its value, its sum and the start of its row.
        let bytes = 12 * operator.entries() + 24 * count;
        let memory = vec![1.0_f64; bytes / 8];
        let mut group = c.benchmark_group(format!("{count} points, degree {degree}"));
        group.throughput(Throughput::Bytes(bytes as u64));
        group.bench_function("application", |b| b.iter(|| operator.apply(black_box(&field), black_box(&mut out))));
        group.bench_function("sum over as many bytes", |b| {
            b.iter(|| {
                let mut sums = [0.0; 16];
                for chunk in black_box(&memory).chunks_exact(16) {
                    sums.iter_mut().zip(chunk).for_each(|(sum, value)| *sum += value);
                }
                sums
            });
        });
        group.finish();
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20).warm_up_time(std::time::Duration::from_millis(500));
    targets = applications
}
criterion_main!(benches);
