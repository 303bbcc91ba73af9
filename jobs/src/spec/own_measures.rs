//! Measures of a user's own in the series: how they are declared, and what they mean for a scene.

use meniscus::formulas::FormulaText;
use meniscus::scene::Scene;
use meniscus::simulation::measures::{check_region, variables};
use meniscus::simulation::{Measure, Measures, Probe, Reduction, Region, Simulation};
use meniscus::spec::{Coordinates, Json, Listed, Parameter, Violation, suggest, whole};
use meniscus::{group, words};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::json;
use std::collections::BTreeSet;

/// Probes and measures of a run at most.
pub const MOST_MEASURES: usize = 64;
/// Letters of a name at most.
const LONGEST_NAME: usize = 64;
/// Columns of probes at most.
const MOST_PLACES: usize = 1000;

words! {
    /// What a measure is taken over.
    pub enum RegionWord {
        /// everything
        All = "all",
        /// the fluid inside
        Inside = "inside",
        /// the fluid outside
        Outside = "outside",
        /// the interface of two fluids
        Interface = "interface",
        /// the surface
        Surface = "surface",
    }
}

group! {
    /// Places along a line.
    pub struct AlongSpec {
        /// the first place
        from: Coordinates;
        /// the last place
        to: Coordinates;
        /// number of places
        count: u64 = 11, in whole(2, 200);
    }
}

group! {
    /// A field at places, as columns `probe.NAME` of the series.
    pub struct ProbeSpec {
        /// name of the column; places along a line are numbered, `probe.NAME.0` and so on
        name: String;
        /// the place
        at: Option<Coordinates>;
        /// places along a line, instead of `at`
        along: Option<AlongSpec>;
        /// a field of frames; of vectors a component, as `velocity_x`
        field: String;
    }
}

group! {
    /// An integral, a mean or an extreme of a formula of fields, as the column `measure.NAME` of the series.
    pub struct MeasureSpec {
        /// name of the column
        name: String;
        /// the formula of an integral: of x, y, z, t and the fields of frames, vectors by components (`velocity_x`)
        integral: Option<FormulaText>;
        /// the formula of a mean
        mean: Option<FormulaText>;
        /// the formula of the largest value
        max: Option<FormulaText>;
        /// the formula of the least value
        min: Option<FormulaText>;
        /// what it is taken over
        over: RegionWord = RegionWord::All;
    }
}

/// Probes and measures of a run.
#[derive(Debug, Clone, Copy)]
pub struct OwnMeasures<'a> {
    /// Fields at places.
    pub probes: &'a [ProbeSpec],
    /// Reductions of formulas.
    pub measures: &'a [MeasureSpec],
}

impl OwnMeasures<'_> {
    /// What they mean for a scene. Pointers of errors begin at the job's body.
    ///
    /// # Errors
    /// All that is wrong with them.
    pub fn plan(&self, scene: &dyn Scene) -> Result<Measures, Vec<Violation>> {
        let names: Vec<&str> = scene.fields().iter().map(|field| field.name).collect();
        // Which fields are vectors is known when there are some.
        let both = [false, true].map(|is_vector| names.iter().map(move |name| (*name, is_vector)).collect::<Vec<_>>());
        let mut known = variables(&both[0]);
        known.extend(variables(&both[1]).into_iter().skip(4));
        let mut errors = Vec::new();
        self.check_names(&mut errors);
        let probes: Vec<Probe> =
            self.probes.iter().enumerate().filter_map(|(k, probe)| probe.plan(k, scene, &known, &mut errors)).collect();
        let places: usize = probes.iter().map(|probe| probe.places.len()).sum();
        if places > MOST_PLACES {
            let detail = format!("the probes have {places} places together");
            errors.push(Violation::new("/output/probes", "range", detail, places, json!({"most": MOST_PLACES})));
        }
        let reductions = self
            .measures
            .iter()
            .enumerate()
            .filter_map(|(k, measure)| measure.plan(k, scene, &known, &mut errors))
            .collect();
        if errors.is_empty() { Ok(Measures { probes, reductions, variables: known }) } else { Err(errors) }
    }

    fn check_names(&self, errors: &mut Vec<Violation>) {
        let lists = [
            ("probes", self.probes.iter().map(|probe| &probe.name).collect::<Vec<_>>()),
            ("measures", self.measures.iter().map(|measure| &measure.name).collect()),
        ];
        for (list, names) in lists {
            let mut seen = BTreeSet::new();
            for (k, name) in names.into_iter().enumerate() {
                let is_plain = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
                    && (1..=LONGEST_NAME).contains(&name.len());
                let reason = match (is_plain, seen.insert(name.clone())) {
                    (false, _) => "a name has letters, digits and _, at least one and 64 at most",
                    (true, false) => "the name is given twice",
                    (true, true) => continue,
                };
                let at = format!("/output/{list}/{k}/name");
                errors.push(Violation::new(at, "name", reason, json!(name), json!("another name")));
            }
        }
    }
}

/// A place in the dimension of a scene; z = 0 in the plane.
fn place(given: &Coordinates, scene: &dyn Scene, at: &str, errors: &mut Vec<Violation>) -> [f64; 3] {
    let dimension = scene.dimension();
    if given.len() != dimension {
        let detail = format!("the scene has {dimension} dimensions");
        errors.push(Violation::new(at, "conflict", detail, given.to_json(), json!(format!("{dimension} numbers"))));
    }
    std::array::from_fn(|d| given.get(d).copied().filter(|_| d < dimension).unwrap_or(0.0))
}

impl ProbeSpec {
    fn plan(&self, k: usize, scene: &dyn Scene, known: &[String], errors: &mut Vec<Violation>) -> Option<Probe> {
        let pointer = format!("/output/probes/{k}");
        if !known.contains(&self.field) {
            let names: Vec<&str> = scene.fields().iter().map(|field| field.name).collect();
            let mut error = Violation::new(
                format!("{pointer}/field"),
                "unknown",
                "the scene has no such field",
                json!(self.field),
                json!(names),
            );
            error.did_you_mean = suggest(&self.field, &names);
            errors.push(error);
        }
        let (columns, places) = match (&self.at, &self.along) {
            (Some(at), None) => {
                let at = place(at, scene, &format!("{pointer}/at"), errors);
                (vec![format!("probe.{}", self.name)], vec![at])
            }
            (None, Some(along)) => {
                let from = place(&along.from, scene, &format!("{pointer}/along/from"), errors);
                let to = place(&along.to, scene, &format!("{pointer}/along/to"), errors);
                let share = |n: u64| n as f64 / (along.count - 1) as f64;
                let at = |n: u64| std::array::from_fn(|d| from[d] + share(n) * (to[d] - from[d]));
                (
                    (0..along.count).map(|n| format!("probe.{}.{n}", self.name)).collect(),
                    (0..along.count).map(at).collect(),
                )
            }
            _ => {
                let detail = "a probe is at one place, or along a line; give one of `at` and `along`";
                errors.push(Violation::new(pointer, "conflict", detail, self.to_json(), json!(["at", "along"])));
                return None;
            }
        };
        Some(Probe { columns, places, field: self.field.clone() })
    }
}

impl MeasureSpec {
    fn plan(&self, k: usize, scene: &dyn Scene, known: &[String], errors: &mut Vec<Violation>) -> Option<Measure> {
        let pointer = format!("/output/measures/{k}");
        let given = [
            ("integral", Reduction::Integral, &self.integral),
            ("mean", Reduction::Mean, &self.mean),
            ("max", Reduction::Max, &self.max),
            ("min", Reduction::Min, &self.min),
        ];
        let mut given = given.into_iter().filter_map(|(name, reduction, text)| Some((name, reduction, text.as_ref()?)));
        let (Some((name, reduction, formula)), None) = (given.next(), given.next()) else {
            let detail = "a measure is one of an integral, a mean, and the largest or least value";
            let allowed = json!(["integral", "mean", "max", "min"]);
            errors.push(Violation::new(pointer, "conflict", detail, self.to_json(), allowed));
            return None;
        };
        let region = match self.over {
            RegionWord::All => Region::All,
            RegionWord::Inside => Region::Inside,
            RegionWord::Outside => Region::Outside,
            RegionWord::Interface => Region::Interface,
            RegionWord::Surface => Region::Surface,
        };
        errors.extend(check_region(region, reduction, &scene.regions(), &format!("{pointer}/over")));
        let column = format!("measure.{}", self.name);
        Measure::new(column, (reduction, region), formula, known, (&pointer, name))
            .map_err(|found| errors.extend(found))
            .ok()
    }
}

/// What is wrong with the fields that measures name, which is known when there is a simulation: vectors without a component, and
/// numbers with one.
#[must_use]
pub fn check_fields(measures: &Measures, simulation: &dyn Simulation) -> Option<String> {
    let missing = measures.missing_fields(simulation);
    (!missing.is_empty()).then(|| {
        format!(
            "frames have no numbers named {}: of vectors name a component, as velocity_x, and of numbers none",
            missing.join(", ")
        )
    })
}

/// A list of declared parameters as it is kept with a run: by the same JSON.
#[derive(Debug, Clone, PartialEq)]
pub struct Kept<T>(pub Listed<T>);

impl<T> Default for Kept<T> {
    fn default() -> Self {
        Self(Listed::default())
    }
}

impl<T> Kept<T> {
    /// Whether it has nothing.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.0.is_empty()
    }
}

impl<T: Parameter> Serialize for Kept<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.to_json().serialize(serializer)
    }
}

impl<'de, T: Parameter> Deserialize<'de> for Kept<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let given = Json::deserialize(deserializer)?;
        let mut errors = Vec::new();
        let list = Listed::parse(&given, Listed::<T>::any(), "", &mut errors);
        list.map(Self).ok_or_else(|| D::Error::custom(format!("not a list of such parameters: {given}")))
    }
}
