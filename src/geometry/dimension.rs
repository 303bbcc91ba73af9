//! From a type of a fixed dimension to that of a generic one, which is the same type where the dimensions agree.

use std::any::Any;

/// The value as a `B`; None where `A` is another type.
pub fn in_dimension<A: Any, B: Any>(value: A) -> Option<B> {
    let value: Box<dyn Any> = Box::new(value);
    value.downcast::<B>().ok().map(|value| *value)
}
