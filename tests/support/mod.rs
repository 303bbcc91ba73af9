//! What the tests of the engine share: a scene from JSON, run to its end in a pool of its own.

use meniscus::parallel::Interrupt;
use meniscus::scene::{BuildContext, Clouds, Scene, parse};
use meniscus::scenes::SCENES;
use meniscus::simulation::{CpuClock, FieldValues, OutputPlan, Report, Selection, Simulation};
use meniscus::spec::Violation;
use serde_json::Value;

pub const PLAN: OutputPlan = OutputPlan { every_time: None, series_every_steps: 10 };

pub fn scene(value: &Value) -> Box<dyn Scene> {
    parse(value, SCENES).unwrap_or_else(|violations| panic!("{violations:#?}"))
}

pub fn build(value: &Value, plan: OutputPlan) -> Box<dyn Simulation> {
    build_with(value, plan, &Clouds::new()).unwrap()
}

/// The simulation of a scene that takes points or values from outside.
pub fn build_with(value: &Value, plan: OutputPlan, clouds: &Clouds) -> Result<Box<dyn Simulation>, Vec<Violation>> {
    let (interrupt, cpu_clock) = (Interrupt::default(), CpuClock::still());
    scene(value).build(BuildContext { plan, interrupt, cpu_clock, clouds: clouds.clone() })
}

pub fn pool(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap()
}

pub fn run(value: &Value) -> Report {
    pool(2).install(|| {
        let mut simulation = build(value, PLAN);
        while !simulation.is_finished() {
            simulation.step().unwrap();
        }
        simulation.report()
    })
}

/// The numbers of a field of a frame.
pub fn column(simulation: &dyn Simulation, name: &str) -> Vec<f64> {
    let fields = simulation.fields(Selection::All);
    let FieldValues::Scalar(values) = &fields.columns.iter().find(|c| c.name == name).unwrap().values else {
        panic!("{name} is no number a point")
    };
    values.clone()
}

/// The error of a quantity in a norm at the latest time, or at the given one.
pub fn error(report: &Report, quantity: &str, norm: &str, time: Option<f64>) -> f64 {
    report
        .errors
        .iter()
        .rev()
        .find(|e| e.quantity == quantity && e.norm == norm && time.is_none_or(|t| (e.time - t).abs() < 1e-6))
        .unwrap_or_else(|| panic!("no error of {quantity} in {norm}"))
        .value
}

/// Slope of log(error) over log(h) by least squares.
pub fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let logs: Vec<(f64, f64)> = points.iter().map(|(h, e)| (h.ln(), e.ln())).collect();
    let (mx, my) = (logs.iter().map(|p| p.0).sum::<f64>() / n, logs.iter().map(|p| p.1).sum::<f64>() / n);
    let top: f64 = logs.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum();
    top / logs.iter().map(|p| (p.0 - mx).powi(2)).sum::<f64>()
}
