//! Reactions of substances at every point of a surface, and the forcing that makes a known solution exact.

use super::formula_terms::FormulaTerms;
use rayon::prelude::{IndexedParallelIterator, IntoParallelRefMutIterator, ParallelIterator};

/// Points that a task works on at least.
const POINTS: usize = 1024;

/// The reaction terms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Model {
    /// −u v² + F (1 − u) and u v² − (F + k) v (Gray and Scott).
    GrayScott {
        /// Feed rate F.
        feed: f64,
        /// Kill rate k.
        kill: f64,
    },
    /// a − (b + 1) u + u² v and b u − u² v (Prigogine and Lefever).
    Brusselator {
        /// Supply a.
        a: f64,
        /// Rate b.
        b: f64,
    },
    /// γ (a − u + u² v) and γ (b − u² v) (Schnakenberg 1979).
    Schnakenberg {
        /// Supply a.
        a: f64,
        /// Supply b.
        b: f64,
        /// Rate γ.
        gamma: f64,
    },
}

impl Model {
    /// The terms at (u, v).
    #[inline]
    #[must_use]
    pub fn rates(self, u: f64, v: f64) -> [f64; 2] {
        match self {
            Self::GrayScott { feed, kill } => {
                let eaten = u * v * v;
                [feed * (1.0 - u) - eaten, eaten - (feed + kill) * v]
            }
            Self::Brusselator { a, b } => {
                let made = u * u * v;
                [a - (b + 1.0) * u + made, b * u - made]
            }
            Self::Schnakenberg { a, b, gamma } => {
                let made = u * u * v;
                [gamma * (a - u + made), gamma * (b - made)]
            }
        }
    }

    /// The state without a pattern.
    #[must_use]
    pub fn rest(self) -> [f64; 2] {
        match self {
            Self::GrayScott { .. } => [1.0, 0.0],
            Self::Brusselator { a, b } => [a, b / a],
            Self::Schnakenberg { a, b, .. } => [a + b, b / (a + b).powi(2)],
        }
    }
}

/// The reaction terms of a model, or of formulas.
#[derive(Debug, Clone, PartialEq)]
pub enum Terms {
    /// Two substances.
    Model(Model),
    /// One to six.
    Formulas(Box<FormulaTerms>),
}

/// A reaction of substances that diffuse.
#[derive(Debug, Clone, PartialEq)]
pub struct Reaction {
    /// Values of the reaction terms.
    pub terms: Terms,
    /// Of each substance.
    pub diffusivity: Vec<f64>,
    /// f and Δ_S f at the points, where the forcing makes [`Reaction::manufactured`] exact.
    pub manufactured: Option<(Vec<f64>, Vec<f64>)>,
}

/// How far the manufactured solution swings.
const SWING: f64 = 0.25;

impl Reaction {
    /// The manufactured solution at time t for a field value f: rest (1 + f cos t/4) for u, and with − for v; 1 stands
    /// for what rests at nothing.
    #[must_use]
    pub fn exact(&self, f: f64, t: f64) -> [f64; 2] {
        let [u, v] = self.base();
        [u * (1.0 + SWING * f * t.cos()), v * (1.0 - SWING * f * t.cos())]
    }

    /// Of a manufactured solution, which models alone have.
    fn base(&self) -> [f64; 2] {
        let Terms::Model(model) = &self.terms else { return [1.0; 2] };
        model.rest().map(|rest| if rest > 0.0 { rest } else { 1.0 })
    }

    /// Number of substances.
    #[must_use]
    pub fn species(&self) -> usize {
        match &self.terms {
            Terms::Model(_) => 2,
            Terms::Formulas(terms) => terms.species(),
        }
    }

    /// out ← d out + terms, where `out` has Δ_S u and `u` the substances, one after another.
    pub fn add(&self, u: &[f64], time: f64, out: &mut [f64]) {
        let model = match &self.terms {
            Terms::Formulas(terms) => return terms.add(u, &self.diffusivity, time, out),
            Terms::Model(model) => *model,
        };
        let rows = u.len() / 2;
        let (u, v) = u.split_at(rows);
        let (u_out, v_out) = out.split_at_mut(rows);
        let both = u_out.par_iter_mut().zip(v_out.par_iter_mut()).with_min_len(POINTS).enumerate();
        both.for_each(|(i, (u_out, v_out))| {
            let rates = model.rates(u[i], v[i]);
            let forcing = match &self.manufactured {
                Some((field, laplacian)) => self.forcing(field[i], laplacian[i], time),
                None => [0.0; 2],
            };
            *u_out = self.diffusivity[0] * *u_out + rates[0] + forcing[0];
            *v_out = self.diffusivity[1] * *v_out + rates[1] + forcing[1];
        });
    }

    /// What must be added to the terms at a point for that solution.
    #[must_use]
    pub fn forcing(&self, f: f64, laplacian: f64, t: f64) -> [f64; 2] {
        let [u, v] = self.exact(f, t);
        let Terms::Model(model) = &self.terms else { return [f64::NAN; 2] };
        let (base, rates) = (self.base(), model.rates(u, v));
        let (turn, bend) = (SWING * f * t.sin(), SWING * laplacian * t.cos());
        [
            -base[0] * turn - self.diffusivity[0] * base[0] * bend - rates[0],
            base[1] * turn + self.diffusivity[1] * base[1] * bend - rates[1],
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::{Model, Reaction, Terms};

    #[test]
    fn rest_does_not_react() {
        let schnakenberg = Model::Schnakenberg { a: 0.1, b: 0.9, gamma: 2.0 };
        for model in [Model::GrayScott { feed: 0.04, kill: 0.06 }, Model::Brusselator { a: 3.0, b: 9.0 }, schnakenberg]
        {
            let [u, v] = model.rest();
            assert!(model.rates(u, v).iter().all(|rate| rate.abs() < 1e-14), "{model:?}");
        }
    }

    /// du/dt of the manufactured solution by differences equals diffusion, terms and forcing.
    #[test]
    fn forcing_makes_the_solution_exact() {
        for model in [Model::Brusselator { a: 1.0, b: 2.0 }, Model::Schnakenberg { a: 0.1, b: 0.9, gamma: 2.0 }] {
            check_forcing(model);
        }
    }

    fn check_forcing(model: Model) {
        let reaction = Reaction { terms: Terms::Model(model), diffusivity: vec![0.01, 0.1], manufactured: None };
        let (f, t, step) = (0.4, 0.7, 1e-5);
        let laplacian = -6.0 * f;
        let [u, v] = reaction.exact(f, t);
        let (rates, forcing) = (model.rates(u, v), reaction.forcing(f, laplacian, t));
        let (after, before) = (reaction.exact(f, t + step), reaction.exact(f, t - step));
        // The field enters linearly, so Δ_S of the solution is that with f replaced by its Laplacian, less the constant.
        let (bent, flat) = (reaction.exact(laplacian, t), reaction.exact(0.0, t));
        for k in 0..2 {
            let slope = (after[k] - before[k]) / (2.0 * step);
            let right = reaction.diffusivity[k] * (bent[k] - flat[k]) + rates[k] + forcing[k];
            assert!((slope - right).abs() < 1e-8, "{k}: {slope} {right}");
        }
    }
}
