//! What evolves on a surface: how it is planned, and how it begins.

use super::data_fields;
use super::field_choices::{Course, Site, raised};
use super::field_values::{operated, sites, values};
use super::spec::{ModelChoice, ProblemSpec};
use super::spread::{Spread, diffusivity, spread};
use super::surfaces::Shape;
use crate::geometry::random::CounterRandom;
use crate::schemes::surface_equation::{
    Diffusivity, ExactCourse, ExactField, FormulaTerms, Model, Reaction, SurfaceCloud, Terms,
};
use crate::spec::{Parameter, Violation};
use serde_json::{Value, json};

/// What evolves from where.
#[derive(Debug, Clone)]
pub(super) enum Start {
    Field {
        initial: ExactField,
        diffusivity: Spread,
        source: Option<ExactField>,
    },
    Reaction {
        terms: Terms,
        initial: Vec<ExactField>,
        diffusivity: Vec<Spread>,
        noise: f64,
        manufactured: Option<ExactField>,
    },
}

impl Start {
    /// Number of fields that evolve, those weighed more whose terms are long formulas.
    pub fn fields(&self) -> f64 {
        match self {
            Self::Field { .. } => 1.0,
            // Twenty operations cost about as much as a row of the operator.
            Self::Reaction { terms: Terms::Formulas(terms), diffusivity, .. } => {
                diffusivity.len() as f64 + terms.operations() as f64 / 20.0
            }
            Self::Reaction { diffusivity, .. } => diffusivity.len() as f64,
        }
    }
}

/// Diffusivities of the substances of a model that are not given.
const DIFFUSIVITY: [f64; 2] = [0.005, 0.05];

/// Plans a reaction.
pub(super) fn reaction(site: Site, problem: &mut ProblemSpec, errors: &mut Vec<Violation>) -> Option<Start> {
    let ProblemSpec::ReactionDiffusion { model, diffusivity, second_diffusivity, noise, manufactured, .. } = problem
    else {
        return None;
    };
    let exact = manufactured.as_mut().map(|field| site.field(field, errors));
    if let (Shape::Points(_), Some(_)) = (site.shape, &exact) {
        let detail = "forcing takes the exact operator, which is not known on points from outside";
        errors.push(Violation::new(site.pointer, "conflict", detail, manufactured.to_json(), Value::Null));
    }
    if let Some(ExactField::Data(_)) = &exact {
        let detail = "forcing takes the exact operator, which data do not have";
        errors.push(Violation::new(site.pointer, "conflict", detail, manufactured.to_json(), Value::Null));
    }
    if let ModelChoice::Formula { .. } = model {
        for (name, given) in [("diffusivity", &*diffusivity), ("second_diffusivity", &*second_diffusivity)] {
            errors.extend(given.map(|given| {
                let detail = "substances by formulas have their diffusivities in the model";
                Violation::new(
                    format!("/problem/{name}"),
                    "conflict",
                    detail,
                    given,
                    json!("/problem/model/diffusivities"),
                )
            }));
        }
    } else {
        (*diffusivity, *second_diffusivity) =
            (diffusivity.or(Some(DIFFUSIVITY[0])), second_diffusivity.or(Some(DIFFUSIVITY[1])));
    }
    let both = [diffusivity.unwrap_or(DIFFUSIVITY[0]), second_diffusivity.unwrap_or(DIFFUSIVITY[1])];
    let both = both.map(Spread::Uniform).to_vec();
    let (terms, initial, diffusivity) = match model {
        ModelChoice::Formula { .. } => {
            if exact.is_some() {
                let detail = "forcing belongs to the models; formulas can have their own";
                errors.push(Violation::new(site.pointer, "conflict", detail, manufactured.to_json(), Value::Null));
            }
            formula_reaction(site, model, errors)?
        }
        ModelChoice::GrayScott { feed, kill } => {
            (Terms::Model(Model::GrayScott { feed: *feed, kill: *kill }), Vec::new(), both)
        }
        ModelChoice::Brusselator { a, b } => (Terms::Model(Model::Brusselator { a: *a, b: *b }), Vec::new(), both),
        ModelChoice::Schnakenberg { a, b, gamma } => {
            (Terms::Model(Model::Schnakenberg { a: *a, b: *b, gamma: *gamma }), Vec::new(), both)
        }
    };
    Some(Start::Reaction { terms, initial, diffusivity, noise: *noise, manufactured: exact })
}

/// Terms, fields at the start and diffusivities of a reaction.
type ReactionParts = (Terms, Vec<ExactField>, Vec<Spread>);

/// Where the formulas of a reaction stand.
const MODEL: &str = "/problem/model";

/// A reaction by formulas; None, with errors, where something is wrong with it.
fn formula_reaction(site: Site, model: &ModelChoice, errors: &mut Vec<Violation>) -> Option<ReactionParts> {
    let ModelChoice::Formula { species, rates, diffusivities, initial, parameters } = model else { return None };
    let before = errors.len();
    for (name, found) in [("diffusivities", diffusivities.0.len()), ("initial", initial.0.len())] {
        if found != species.0.len() {
            let detail = format!("there are {} substances, and {found} of these", species.0.len());
            errors.push(Violation::new(format!("{MODEL}/{name}"), "conflict", detail, found, json!(species.0.len())));
        }
    }
    let terms = FormulaTerms::new(&species.0, rates, parameters, MODEL);
    let terms = terms.map_err(|found| errors.extend(found)).ok();
    let at = |pointer| Site { pointer, ..site };
    let starts = initial.0.iter().zip(data_fields::STARTS);
    let starts = starts.map(|(value, pointer)| at(pointer).value(value, (MODEL, parameters), Course::AtRest, errors));
    let starts: Vec<ExactField> = starts.collect();
    let spreads = diffusivities.0.iter().zip(data_fields::DIFFUSIVITIES);
    let spreads = spreads.map(|(value, pointer)| spread(at(pointer), value, (MODEL, parameters), errors)).collect();
    (errors.len() == before).then_some((Terms::Formulas(Box::new(terms?)), starts, spreads))
}

/// Fields at the start, the reaction, diffusivities, and what is known of the course.
pub(super) type Beginning = (Vec<f64>, Option<Reaction>, Vec<Diffusivity>, ExactCourse);

/// How an evolution begins.
pub(super) fn begin<const D: usize>(
    start: &Start,
    shape: &Shape,
    cloud: &SurfaceCloud<D>,
    seed: u64,
) -> Result<Beginning, Vec<Violation>> {
    match start {
        Start::Field { initial, diffusivity: spread, source } => {
            let found = diffusivity(spread, cloud, data_fields::DIFFUSIVITY)?;
            let decay = match (&found, source) {
                (Diffusivity::Uniform(factor), None) => initial.decay(shape.reach()).map(|rate| factor * rate),
                _ => None,
            };
            let exact = decay.map_or(ExactCourse::Unknown, ExactCourse::Decay);
            Ok((values(initial, cloud, "/problem/initial")?, None, vec![found], exact))
        }
        Start::Reaction { terms, initial, diffusivity: spreads, noise, manufactured } => {
            let known = match manufactured {
                Some(field) => {
                    let values = values(field, cloud, "/problem/manufactured")?;
                    operated(field, shape, cloud).map(|operated| (values, operated))
                }
                None => None,
            };
            let exact = if known.is_some() { ExactCourse::Manufactured } else { ExactCourse::Unknown };
            let random = CounterRandom::new(seed ^ 0x7265_6163);
            let (terms, values) = match terms {
                Terms::Formulas(terms) => {
                    let values =
                        starts_of_formulas(initial, cloud, |i, k| noise * random.symmetric(&[i as i64, k as i64]))?;
                    (Terms::Formulas(Box::new(terms.with_sites(sites(cloud)))), values)
                }
                Terms::Model(model) => {
                    let disturbed = Disturbed { model: *model, noise: *noise, random };
                    (Terms::Model(*model), disturbed.values(known.as_ref().map(|(field, _)| &field[..]), shape, cloud))
                }
            };
            let places = data_fields::DIFFUSIVITIES;
            let found = spreads.iter().zip(places).map(|(spread, place)| diffusivity(spread, cloud, place));
            let found = found.collect::<Result<Vec<_>, _>>()?;
            let factors = found.iter().map(Diffusivity::factor).collect();
            let reaction = Reaction { terms, diffusivity: factors, manufactured: known };
            Ok((values, Some(reaction), found, exact))
        }
    }
}

/// Substances at the start, with a random disturbance by their values.
fn starts_of_formulas<const D: usize>(
    initial: &[ExactField],
    cloud: &SurfaceCloud<D>,
    noise: impl Fn(usize, usize) -> f64,
) -> Result<Vec<f64>, Vec<Violation>> {
    let mut all = Vec::with_capacity(initial.len() * cloud.rows);
    let mut errors = Vec::new();
    for (k, (field, place)) in initial.iter().zip(data_fields::STARTS).enumerate() {
        match values(field, cloud, place) {
            Ok(found) => all.extend(found.iter().enumerate().map(|(i, value)| value * (1.0 + noise(i, k)))),
            Err(found) => errors.extend(found),
        }
    }
    if errors.is_empty() { Ok(all) } else { Err(errors) }
}

/// The state of a model without a pattern, disturbed.
struct Disturbed {
    model: Model,
    noise: f64,
    random: CounterRandom,
}

impl Disturbed {
    /// Both substances at the points; `field` is that of a manufactured solution.
    fn values<const D: usize>(&self, field: Option<&[f64]>, shape: &Shape, cloud: &SurfaceCloud<D>) -> Vec<f64> {
        let Self { model, noise, random } = self;
        let rest = model.rest();
        let exact = Reaction { terms: Terms::Model(*model), diffusivity: Vec::new(), manufactured: None };
        let at = |i: usize| match (field, model) {
            (Some(field), _) => exact.exact(field[i], 0.0),
            (None, Model::GrayScott { .. }) => {
                // The second substance is sown on a cap.
                let [u, v] = if shape.is_on_cap(&raised(&cloud.points[i])) { [0.5, 0.25] } else { rest };
                let off = noise * random.symmetric(&[i as i64]);
                [u, v * (1.0 + off)]
            }
            (None, Model::Brusselator { .. } | Model::Schnakenberg { .. }) => {
                [0, 1].map(|k| rest[k] * (1.0 + noise * random.symmetric(&[i as i64, k as i64])))
            }
        };
        let both: Vec<[f64; 2]> = (0..cloud.rows).map(at).collect();
        both.iter().map(|b| b[0]).chain(both.iter().map(|b| b[1])).collect()
    }
}
