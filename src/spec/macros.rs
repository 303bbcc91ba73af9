//! The macros that declare parameters. Each writes a type, and everything that is derived from its declaration.

/// Declares an object with fields:
///
/// ```
/// use meniscus::group;
/// use meniscus::spec::{Interval, POSITIVE, Parameter};
/// use serde_json::json;
///
/// group! {
///     /// A fluid.
///     pub struct Fluid {
///         /// density ρ at rest
///         density: f64 = 1.0, in POSITIVE;
///         /// exponent γ of the equation of state
///         polytropic: f64 = 7.0, in Interval::at_least(1.0).and_at_most(20.0);
///         /// time at which the run ends
///         end_time: f64, in POSITIVE => restart_safe;
///     }
/// }
///
/// let mut errors = Vec::new();
/// let fluid = Fluid::parse(&json!({"end_time": 2}), (), "", &mut errors).unwrap();
/// assert_eq!((fluid.density, fluid.end_time), (1.0, 2.0));
/// assert_eq!(Fluid::parse(&json!({"density": -1}), (), "", &mut errors), None);
/// assert_eq!(errors.len(), 2, "the density is out of range and the end time is missing");
/// ```
///
/// A field is `name: Type = default, in domain => flag;`. Default, domain and flag may be left out; a field that is neither
/// optional nor has a default must be given. `name as "NAME"` has another name in JSON. The flag is `restart_safe`, or
/// `flatten` for a group whose fields stand among those of this one. `struct Name: Default` has a `Default` too.
#[macro_export]
macro_rules! group {
    (
        $(#[doc = $about:literal])*
        $vis:vis struct $Name:ident $(: $Default:ident)? {
            $(
                $(#[doc = $doc:literal])*
                $field:ident $(as $json:literal)? : $type:ty $(= $default:expr)? $(, in $domain:expr)? $(=> $flag:ident)? ;
            )*
        }
    ) => {
        $(#[doc = $about])*
        #[derive(Debug, Clone, PartialEq)]
        $vis struct $Name {
            $( $(#[doc = $doc])* pub $field: $type, )*
        }

        impl $crate::spec::Group for $Name {
            fn names() -> Vec<&'static str> {
                [ $( $crate::group_field!(@names $type, ($field $($json)?) $($flag)?) ),* ].concat()
            }

            fn declarations() -> Vec<$crate::spec::Declaration> {
                [ $( $crate::group_field!(
                    @declare $type, ($field $($json)?), concat!($($doc),*), [$($default)?], [$($domain)?] $($flag)?
                ) ),* ].concat()
            }

            fn parse_fields(
                given: &$crate::spec::Object,
                place: &str,
                errors: &mut Vec<$crate::spec::Violation>,
            ) -> Option<Self> {
                $( let $field: Option<$type> = $crate::group_field!(
                    @parse given, place, errors, $type, ($field $($json)?), concat!($($doc),*), [$($default)?], [$($domain)?] $($flag)?
                ); )*
                Some(Self { $( $field: $field?, )* })
            }

            fn write_fields(&self, object: &mut $crate::spec::Object) {
                $( $crate::group_field!(@write object, &self.$field, ($field $($json)?) $($flag)?); )*
            }
        }

        impl $Name {
            $(
                /// The key of the field in JSON, for presets.
                #[must_use]
                pub fn $field() -> $crate::spec::Key<$type> {
                    let domain = $crate::group_field!(@domain $type, [$($domain)?]);
                    $crate::spec::Key::new($crate::group_field!(@name $field $($json)?), domain)
                }
            )*
        }

        $crate::group_field!(@default $Name { $( $field: $type [$($default)?] $($flag)?; )* } $($Default)?);
        $crate::parameter_of_group!($Name);
    };
}

/// The parts that [`group!`] and [`choice!`] are made of.
#[doc(hidden)]
#[macro_export]
macro_rules! group_field {
    (@name $field:ident) => { stringify!($field) };
    (@name $field:ident $json:literal) => { $json };

    (@domain $type:ty, []) => { <$type as $crate::spec::Parameter>::any() };
    (@domain $type:ty, [$domain:expr]) => { $domain };
    (@value []) => { None };
    (@value [$default:expr]) => { Some(|| $default) };

    (@names $type:ty, ($($name:tt)*) flatten) => { <$type as $crate::spec::Group>::names() };
    (@names $type:ty, ($($name:tt)*) $($flag:ident)?) => { vec![$crate::group_field!(@name $($name)*)] };

    (@declare $type:ty, ($($name:tt)*), $doc:expr, $default:tt, $domain:tt flatten) => {
        <$type as $crate::spec::Group>::declarations()
    };
    (@declare $type:ty, ($($name:tt)*), $doc:expr, $default:tt, $domain:tt restart_safe) => {
        vec![$crate::group_field!(@declaration $type, ($($name)*), $doc, $default, $domain).restart_safe()]
    };
    (@declare $type:ty, ($($name:tt)*), $doc:expr, $default:tt, $domain:tt) => {
        vec![$crate::group_field!(@declaration $type, ($($name)*), $doc, $default, $domain)]
    };
    (@declaration $type:ty, ($($name:tt)*), $doc:expr, $default:tt, $domain:tt) => {
        $crate::spec::Declaration::new::<$type>(
            $crate::group_field!(@name $($name)*),
            $doc,
            $crate::group_field!(@domain $type, $domain),
            $crate::group_field!(@value $default),
        )
    };

    (@parse $given:ident, $place:ident, $errors:ident, $type:ty, ($($name:tt)*), $doc:expr, $default:tt, $domain:tt flatten) => {
        <$type as $crate::spec::Group>::parse_fields($given, $place, $errors)
    };
    (@parse $given:ident, $place:ident, $errors:ident, $type:ty, ($($name:tt)*), $doc:expr, $default:tt, $domain:tt $($flag:ident)?) => {
        $crate::spec::Field { name: $crate::group_field!(@name $($name)*), doc: $doc, place: $place }.parse::<$type>(
            $given,
            $crate::group_field!(@domain $type, $domain),
            $crate::group_field!(@value $default),
            $errors,
        )
    };

    (@other $name:ident, $given:ident, $place:ident, $errors:ident) => { None };
    (@other $name:ident, $given:ident, $place:ident, $errors:ident, $Other:expr, $type:ty) => {
        <$type as $crate::spec::Choice>::parse_variant($name, $given, $place, $errors).map(|found| found.map($Other))
    };

    (@write $object:ident, $value:expr, ($($name:tt)*) flatten) => {
        $crate::spec::Group::write_fields($value, $object);
    };
    (@write $object:ident, $value:expr, ($($name:tt)*) $($flag:ident)?) => {
        $object.insert($crate::group_field!(@name $($name)*).to_owned(), $crate::spec::Parameter::to_json($value));
    };

    (@default $Name:ident { $($fields:tt)* }) => {};
    (@default $Name:ident { $( $field:ident : $type:ty [$($default:expr)?] $($flag:ident)?; )* } Default) => {
        impl Default for $Name {
            fn default() -> Self {
                Self { $( $field: $crate::group_field!(@or_default [$($default)?]), )* }
            }
        }
    };
    // A field without a default of its own is optional, or a flattened group with defaults.
    (@or_default []) => { Default::default() };
    (@or_default [$default:expr]) => { $default };
}

/// Makes a group a parameter.
#[doc(hidden)]
#[macro_export]
macro_rules! parameter_of_group {
    ($Name:ident) => {
        impl $crate::spec::Parameter for $Name {
            type Domain = ();

            fn any() {}

            fn parse(
                given: &$crate::spec::Json,
                (): (),
                place: &str,
                errors: &mut Vec<$crate::spec::Violation>,
            ) -> Option<Self> {
                $crate::spec::group::parse(given, place, errors)
            }

            fn allowed((): ()) -> $crate::spec::Json {
                $crate::spec::group::allowed::<Self>()
            }

            fn schema((): ()) -> $crate::spec::Object {
                $crate::spec::group::schema(&<Self as $crate::spec::Group>::declarations())
            }

            fn to_json(&self) -> $crate::spec::Json {
                $crate::spec::group::to_json(self)
            }
        }
    };
}

/// Declares a choice between variants with fields of their own:
///
/// ```
/// use meniscus::choice;
/// use meniscus::spec::{Parameter, POSITIVE};
/// use serde_json::json;
///
/// choice! {
///     /// How time is integrated.
///     pub enum Integrator {
///         /// the classical Runge–Kutta method of order 4
///         Rk4 = "rk4",
///         /// Dormand–Prince 5(4) with error control
///         Dopri5 = "dopri5" {
///             /// error of a step
///             tolerance: f64 = 1e-9, in POSITIVE;
///         }
///     }
/// }
///
/// let mut errors = Vec::new();
/// let parse = |given, errors: &mut _| Integrator::parse(&given, (), "/integrator", errors);
/// assert_eq!(parse(json!("dopri5"), &mut errors), Some(Integrator::Dopri5 { tolerance: 1e-9 }));
/// assert_eq!(parse(json!({"type": "rk5"}), &mut errors), None);
/// assert_eq!(errors[0].did_you_mean.as_deref(), Some("rk4"));
/// ```
///
/// Fields are declared as in [`group!`]. `..Name(Type)` before the variants takes in those of another choice; `enum Name by "tag"`
/// names the variant in another field than `type`; `enum Name untagged "name"` takes an object without that field for the variant.
#[macro_export]
macro_rules! choice {
    (
        $(#[doc = $about:literal])*
        $vis:vis enum $Name:ident $(by $tag:literal)? $(untagged $untagged:literal)? {
            $( .. $Other:ident($OtherType:ty) )?
            $(
                $(#[doc = $variant_doc:literal])*
                $Variant:ident = $name:literal $({
                    $(
                        $(#[doc = $doc:literal])*
                        $field:ident $(as $json:literal)? : $type:ty $(= $default:expr)? $(, in $domain:expr)? $(=> $flag:ident)? ;
                    )*
                })? $(,)?
            )*
        }
    ) => {
        $(#[doc = $about])*
        #[derive(Debug, Clone, PartialEq)]
        $vis enum $Name {
            $( #[doc = "One of the variants of another choice."] $Other($OtherType), )?
            $(
                $(#[doc = $variant_doc])*
                $Variant $({ $( $(#[doc = $doc])* $field: $type, )* })?,
            )*
        }

        impl $crate::spec::Choice for $Name {
            $( const TAG: &'static str = $tag; )?
            $( const UNTAGGED: Option<&'static str> = Some($untagged); )?

            fn names() -> Vec<&'static str> {
                let others: &[Vec<&'static str>] = &[$( <$OtherType as $crate::spec::Choice>::names() )?];
                [others.concat(), vec![$($name),*]].concat()
            }

            fn variants() -> Vec<$crate::spec::Variant> {
                let others: &[Vec<$crate::spec::Variant>] = &[$( <$OtherType as $crate::spec::Choice>::variants() )?];
                let own = vec![ $( $crate::spec::Variant {
                    name: $name,
                    doc: concat!($($variant_doc),*).trim().to_owned(),
                    fields: {
                        let fields: &[Vec<$crate::spec::Declaration>] = &[ $($( $crate::group_field!(
                            @declare $type, ($field $($json)?), concat!($($doc),*), [$($default)?], [$($domain)?] $($flag)?
                        ) ),*)? ];
                        fields.concat()
                    },
                } ),* ];
                [others.concat(), own].concat()
            }

            fn parse_variant(
                name: &str,
                given: &$crate::spec::Object,
                place: &str,
                errors: &mut Vec<$crate::spec::Violation>,
            ) -> Option<Option<Self>> {
                match name {
                    $(
                        $name => {
                            let names: &[Vec<&'static str>] =
                                &[ $($( $crate::group_field!(@names $type, ($field $($json)?) $($flag)?) ),*)? ];
                            $crate::spec::group::check_names(given, &names.concat(), place, errors);
                            $($( let $field: Option<$type> = $crate::group_field!(
                                @parse given, place, errors, $type, ($field $($json)?), concat!($($doc),*), [$($default)?], [$($domain)?] $($flag)?
                            ); )*)?
                            Some($crate::spec::choice::when_complete(|| Some(Self::$Variant { $($( $field: $field?, )*)? })))
                        }
                    )*
                    _ => $crate::group_field!(@other name, given, place, errors $(, Self::$Other, $OtherType)?),
                }
            }

            fn name(&self) -> &'static str {
                match self {
                    $( Self::$Other(other) => <$OtherType as $crate::spec::Choice>::name(other), )?
                    $( Self::$Variant { .. } => $name, )*
                }
            }

            fn write_fields(&self, object: &mut $crate::spec::Object) {
                let _ = &object;
                match self {
                    $( Self::$Other(other) => <$OtherType as $crate::spec::Choice>::write_fields(other, object), )?
                    $(
                        Self::$Variant { $($( $field, )*)? } => {
                            $($( $crate::group_field!(@write object, $field, ($field $($json)?) $($flag)?); )*)?
                        }
                    )*
                }
            }
        }

        impl $crate::spec::Parameter for $Name {
            type Domain = ();

            fn any() {}

            fn parse(
                given: &$crate::spec::Json,
                (): (),
                place: &str,
                errors: &mut Vec<$crate::spec::Violation>,
            ) -> Option<Self> {
                $crate::spec::choice::parse(given, place, errors)
            }

            fn allowed((): ()) -> $crate::spec::Json {
                <Self as $crate::spec::Choice>::names().into()
            }

            fn schema((): ()) -> $crate::spec::Object {
                $crate::spec::choice::schema::<Self>()
            }

            fn to_json(&self) -> $crate::spec::Json {
                $crate::spec::choice::to_json(self)
            }
        }
    };
}

/// Declares a choice between plain words:
///
/// ```
/// use meniscus::spec::Word;
/// use meniscus::words;
///
/// words! {
///     /// What happens where fronts meet.
///     pub enum Topology {
///         /// They become one.
///         Merge = "merge",
///         /// They pass through each other.
///         Cross = "cross",
///     }
/// }
///
/// assert_eq!(Topology::from_word("cross"), Some(Topology::Cross));
/// assert_eq!(Topology::Merge.word(), "merge");
/// ```
#[macro_export]
macro_rules! words {
    (
        $(#[doc = $about:literal])*
        $vis:vis enum $Name:ident { $( $(#[doc = $doc:literal])* $Variant:ident = $word:literal ),* $(,)? }
    ) => {
        $(#[doc = $about])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        $vis enum $Name { $( $(#[doc = $doc])* $Variant, )* }

        impl $crate::spec::Word for $Name {
            const WORDS: &'static [(&'static str, Self)] = &[$( ($word, Self::$Variant) ),*];
        }

        impl $crate::spec::Parameter for $Name {
            type Domain = ();

            fn any() {}

            fn parse(
                given: &$crate::spec::Json,
                (): (),
                place: &str,
                errors: &mut Vec<$crate::spec::Violation>,
            ) -> Option<Self> {
                $crate::spec::choice::parse_word(given, place, errors)
            }

            fn allowed((): ()) -> $crate::spec::Json {
                $crate::spec::choice::words::<Self>().into()
            }

            fn schema((): ()) -> $crate::spec::Object {
                $crate::spec::Object::from_iter([("enum".to_owned(), Self::allowed(()))])
            }

            fn to_json(&self) -> $crate::spec::Json {
                $crate::spec::Word::word(*self).into()
            }
        }
    };
}
