//! The report of a study that refines: order, extrapolated value, uncertainty, and what is left to do; as JSON and as a picture.

use super::{by_setup, plan_of};
use crate::convergence::{Assessment, Order};
use crate::formats::speed_error::{self, Lines, Point, Slope};
use crate::refinement::Plan;
use crate::refinement::decision::{Setup, judge, predicted_cpu_s, prediction};
use crate::service::store::{LevelRow, Store, StoreError, StudyRow};
use crate::spec::study::{MeasuredLevel, RefinementOutcome};
use meniscus::spec::Word;
use serde::Serialize;
use serde_json::{Map, Value};

/// What a study that refines has found, as clients see it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RefinementReport {
    /// Id of the study.
    pub study: String,
    /// The quantity that is judged.
    pub quantity: String,
    /// Levels of the set-up that goes on, the coarsest first.
    pub levels: Vec<LevelReport>,
    /// Observed order of convergence with its 95 % interval; null where levels do not tell it.
    pub order: Option<OrderReport>,
    /// Extrapolated value; null of errors and where nothing can be told.
    pub extrapolated: Option<f64>,
    /// Grid convergence index of the finest level, in the measure of the tolerance: a share where that is relative.
    pub gci: Option<f64>,
    /// Whether the three finest levels are in the asymptotic range.
    pub asymptotic: bool,
    /// `monotone`, `oscillatory` or `divergent`; null for too few levels.
    pub convergence: Option<&'static str>,
    /// Whether the tolerance is met.
    pub tolerance_met: bool,
    /// The value of the axis that would meet the tolerance, with its predicted cost; null where it is met or cannot be told.
    pub next: Option<NextLevel>,
    /// The set-ups that were compared; empty where there are no alternatives.
    pub alternatives: Vec<AlternativeReport>,
    /// Earlier jobs from which levels were taken.
    pub reused: Vec<String>,
    /// Why no further level is made; null while the study goes on.
    pub outcome: Option<&'static str>,
    /// The same in a sentence.
    pub message: Option<String>,
    /// CPU seconds of all jobs of the study.
    pub spent_cpu_s: f64,
}

/// A level of the report.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LevelReport {
    /// Number of the level, the coarsest is 0.
    pub index: u64,
    /// The quantity.
    pub value: f64,
    /// Resolved spacing.
    pub spacing: f64,
    /// Error, known or estimated, in the unit of the quantity.
    pub error_estimate: Option<f64>,
    /// CPU seconds of the run.
    pub cpu_s: f64,
    /// Job of the level.
    pub job: Option<String>,
}

/// An order with the ends of its interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OrderReport {
    /// The order.
    pub value: f64,
    /// Lower end; null for too few levels.
    pub low: Option<f64>,
    /// Upper end; null for too few levels.
    pub high: Option<f64>,
}

impl From<Order> for OrderReport {
    fn from(order: Order) -> Self {
        Self { value: order.value, low: order.low, high: order.high }
    }
}

/// The level that would meet the tolerance.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NextLevel {
    /// Value of the axis.
    pub value: Value,
    /// Predicted CPU seconds.
    pub cpu_s: f64,
}

/// One of the set-ups that were compared.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AlternativeReport {
    /// Its values, by pointer.
    pub point: Map<String, Value>,
    /// Observed order.
    pub order: Option<f64>,
    /// Predicted CPU seconds of the level that meets the tolerance; null where none can be told.
    pub predicted_cpu_s: Option<f64>,
    /// Whether it goes on; the others are stopped once one was chosen.
    pub chosen: bool,
    /// Why it cannot go on: a level has failed or does not fit.
    pub obstacle: Option<String>,
}

/// Everything that a report is made of.
struct Found {
    plan: Plan,
    rows: Vec<LevelRow>,
    setups: Vec<Setup>,
    /// Number of the set-up that is shown.
    shown: usize,
}

impl Found {
    fn new(store: &Store, study: &StudyRow) -> Result<Option<Self>, StoreError> {
        let Some((plan, refinement)) = plan_of(study).zip(study.refinement.as_ref()) else { return Ok(None) };
        let rows = store.levels(&study.id)?;
        let setups = by_setup(&plan, &rows, refinement.job.is_some());
        // A set-up that short runs of other scenes told has no levels of its own.
        let has_levels = |number: &usize| setups.get(*number).is_some_and(|setup| !setup.levels.is_empty());
        let chosen = refinement.chosen.map(|chosen| chosen as usize).filter(has_levels);
        let shown = chosen.or_else(|| (0..setups.len()).find(has_levels)).unwrap_or(0);
        Ok(Some(Self { plan, rows, setups, shown }))
    }

    fn levels(&self) -> &[MeasuredLevel] {
        &self.setups[self.shown].levels
    }

    fn judge(&self, levels: &[MeasuredLevel]) -> Assessment {
        judge(&self.plan.spec, &self.plan.quantity, levels)
    }

    fn level_reports(&self, judged: &Assessment) -> Vec<LevelReport> {
        let passed = self.setups[self.shown].passed as u64;
        let rows = self.rows.iter().filter(|row| row.setup as usize == self.shown && row.level >= passed);
        rows.filter_map(|row| Some((row, row.measured.as_ref()?)))
            .zip(&judged.errors)
            .map(|((row, measured), error)| LevelReport {
                index: row.level,
                value: measured.value,
                spacing: measured.spacing,
                error_estimate: *error,
                cpu_s: measured.cpu_s,
                job: row.job.clone(),
            })
            .collect()
    }

    fn alternatives(&self, chosen: Option<u64>) -> Vec<AlternativeReport> {
        if self.plan.spec.alternatives.is_none() {
            return Vec::new();
        }
        let report = |(number, (point, setup)): (usize, (&crate::spec::study::SweepPoint, &Setup))| AlternativeReport {
            point: point.values.iter().cloned().collect(),
            order: self.judge(&setup.levels).order.map(|order| order.value),
            predicted_cpu_s: predicted_cpu_s(&self.plan.spec, &self.plan.quantity, &setup.levels),
            chosen: chosen == Some(number as u64),
            obstacle: setup.obstacle.as_ref().map(|(_, message)| message.clone()),
        };
        self.plan.setups.iter().zip(&self.setups).enumerate().map(report).collect()
    }
}

/// The report of a study that refines; None of other studies.
///
/// # Errors
/// When the store fails.
pub fn compose(store: &Store, study: &StudyRow) -> Result<Option<RefinementReport>, StoreError> {
    let Some(found) = Found::new(store, study)? else { return Ok(None) };
    let Some(refinement) = &study.refinement else { return Ok(None) };
    let judged = found.judge(found.levels());
    let setup = &found.setups[found.shown];
    let first = found.levels().first().map_or(f64::NAN, |first| first.spacing);
    let share = |spacing: f64| spacing / first * setup.first_share(found.plan.spec.ratio);
    let next = prediction(&judged, found.levels())
        .map(|(spacing, cpu_s)| NextLevel { value: found.plan.spec.axis_at(share(spacing)), cpu_s });
    Ok(Some(RefinementReport {
        study: study.id.clone(),
        quantity: found.plan.quantity.label(),
        levels: found.level_reports(&judged),
        alternatives: found.alternatives(refinement.chosen),
        reused: found.rows.iter().filter(|row| row.is_reused).filter_map(|row| row.job.clone()).collect(),
        order: judged.order.map(OrderReport::from),
        extrapolated: judged.extrapolated.filter(|value| value.is_finite()),
        gci: judged.gci,
        asymptotic: judged.is_asymptotic,
        convergence: judged.convergence.map(crate::convergence::Convergence::word),
        tolerance_met: judged.is_met,
        next,
        outcome: refinement.outcome.map(RefinementOutcome::word),
        message: refinement.message.clone(),
        spent_cpu_s: store.spent_cpu_s(&study.id)?,
    }))
}

/// Errors over spacing, with the slope of theory, or else the observed one, and over CPU time; one line a set-up. None where no
/// error can be told.
///
/// # Errors
/// When the store fails; inside, a message when it cannot be drawn.
pub fn draw(store: &Store, study: &StudyRow) -> Result<Option<Result<String, String>>, StoreError> {
    let Some(found) = Found::new(store, study)? else { return Ok(None) };
    let lines: Lines = found
        .plan
        .setups
        .iter()
        .zip(&found.setups)
        .map(|(point, setup)| {
            let judged = found.judge(&setup.levels);
            let values: Vec<String> =
                point.values.iter().map(|(pointer, value)| format!("{pointer} = {value}")).collect();
            let label = if values.is_empty() { "levels".to_owned() } else { values.join(", ") };
            let order = judged.order.map_or(String::new(), |order| format!(": order {:.2}", order.value));
            let points = setup.levels.iter().zip(&judged.errors).filter_map(|(level, error)| {
                let error = error.filter(|error| *error > 0.0 && error.is_finite())?;
                Some(Point { spacing: level.spacing, seconds: level.cpu_s, error })
            });
            (label + &order, points.collect())
        })
        .collect();
    if lines.iter().all(|(_, points): &(String, Vec<Point>)| points.is_empty()) {
        return Ok(None);
    }
    let judged = found.judge(found.levels());
    let theory = found.levels().last().and_then(|finest| finest.theory);
    let slope = theory.or(judged.order.map(|order| order.value)).map(|order| Slope { line: found.shown, order });
    let basis = if theory.is_some() { "theory" } else { "observed" };
    let shown = slope.map_or(String::new(), |slope| format!("; thin: order {:.2} ({basis})", slope.order));
    let title =
        format!("{}: error of {}{shown}", study.name.as_deref().unwrap_or(&study.id), found.plan.quantity.label());
    Ok(Some(speed_error::draw_with_slope(&title, "CPU seconds", &lines, slope)))
}
