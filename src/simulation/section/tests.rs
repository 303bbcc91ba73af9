use super::{Component, LoadError, Section, known};

#[derive(Debug, PartialEq)]
struct Peak {
    value: f64,
    time: Option<f64>,
}

impl Component for Peak {
    fn save(&self, section: &mut Section) {
        section.put_real("value", self.value);
        section.put_optional("time", self.time);
    }

    fn load(section: &Section) -> Result<Self, LoadError> {
        Ok(Self { value: section.real("value")?, time: section.optional("time")? })
    }
}

#[test]
fn components_come_back_and_what_is_unknown_stays_unknown() {
    let peaks = [Peak { value: 1.5, time: Some(0.25) }, Peak { value: -2.0, time: None }];
    let mut section = Section::default();
    section.put_list("peaks", &peaks);
    section.put_component("last", &peaks[1]);
    assert_eq!(section.list::<Peak>("peaks").unwrap(), peaks);
    assert_eq!(section.component::<Peak>("last").unwrap(), peaks[1]);
    assert_eq!((known(f64::NAN), known(2.0)), (None, Some(2.0)));
}

#[test]
fn errors_name_the_whole_path() {
    let mut section = Section::default();
    section.put_section("outer", |outer| {
        outer.put_section("inner", |inner| inner.put_reals("phi", &[1.0, f64::NAN]));
    });
    let length =
        section.section("outer", |outer| outer.section("inner", |inner| inner.reals_of("phi", 3).map(<[f64]>::len)));
    assert_eq!(length.unwrap_err().to_string(), "outer/inner/phi of the state has 2 numbers, this scene needs 3");
    let missing = section.section("outer", |outer| outer.component::<Peak>("inner"));
    assert_eq!(missing.unwrap_err(), LoadError::Missing { name: "outer/inner/value".to_owned() });
    let kind = section.section("outer", |outer| outer.count("inner"));
    assert_eq!(kind.unwrap_err().to_string(), "outer/inner of the state is not a whole number");
    assert_eq!(section.find_non_finite(), Some(("outer/inner/phi".to_owned(), 1)));
    assert_eq!(section.numbers(), 2);
}
