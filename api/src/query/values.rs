//! A serde data format for the text of a query.

use super::{Pair, Refusal};
use serde::de::value::StrDeserializer;
use serde::de::{
    DeserializeSeed, Deserializer, Error as _, IntoDeserializer, MapAccess, SeqAccess, Unexpected, Visitor,
};
use serde::forward_to_deserialize_any;
use serde_json::json;

/// One text of a query and where it stands.
#[derive(Clone, Copy)]
struct Entry<'a> {
    /// Index of the parameter.
    pair: usize,
    name: &'a str,
    /// Part of the name behind its first dot.
    key: &'a str,
    text: &'a str,
}

impl Entry<'_> {
    fn refuse(self, refusal: Refusal) -> Refusal {
        refusal.at(self.pair, self.name, self.text)
    }
}

/// All parameters of a query, as a struct.
pub(super) struct Parameters<'a> {
    /// Name of a field, and all that is given for it, in the order of the query.
    fields: Vec<(String, Vec<Entry<'a>>)>,
}

impl<'a> Parameters<'a> {
    pub(super) fn new(pairs: &'a [Pair]) -> Self {
        let mut fields: Vec<(String, Vec<Entry<'a>>)> = Vec::new();
        for (pair, Pair { name, text }) in pairs.iter().enumerate() {
            let (field, key) = match name.split_once('.') {
                Some((head, key)) => (format!("{head}.KEY"), key),
                None => (name.clone(), ""),
            };
            let entry = Entry { pair, name, key, text };
            match fields.iter_mut().find(|(known, _)| *known == field) {
                Some((_, entries)) => entries.push(entry),
                None => fields.push((field, vec![entry])),
            }
        }
        Self { fields }
    }
}

impl<'de> Deserializer<'de> for Parameters<'_> {
    type Error = Refusal;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        visitor.visit_map(Fields { left: self.fields.into_iter(), value: Vec::new() })
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit unit_struct
        newtype_struct seq tuple tuple_struct map struct enum identifier ignored_any
    }
}

struct Fields<'a> {
    left: std::vec::IntoIter<(String, Vec<Entry<'a>>)>,
    value: Vec<Entry<'a>>,
}

impl<'de> MapAccess<'de> for Fields<'_> {
    type Error = Refusal;

    fn next_key_seed<K: DeserializeSeed<'de>>(&mut self, seed: K) -> Result<Option<K::Value>, Refusal> {
        let Some((name, entries)) = self.left.next() else { return Ok(None) };
        let key: StrDeserializer<'_, Refusal> = name.as_str().into_deserializer();
        let key = seed.deserialize(key).map_err(|refusal| entries[0].refuse(refusal))?;
        self.value = entries;
        Ok(Some(key))
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, Refusal> {
        let texts = Texts(std::mem::take(&mut self.value));
        let last = texts.last();
        // A type may refuse a value after it has read the text.
        seed.deserialize(texts).map_err(|refusal| last.refuse(refusal))
    }
}

/// Everything that is given for one field; never empty.
struct Texts<'a>(Vec<Entry<'a>>);

impl<'a> Texts<'a> {
    fn last(&self) -> Entry<'a> {
        self.0[self.0.len() - 1]
    }

    fn whole_number<'de, V: Visitor<'de>>(&self, visitor: V) -> Result<V::Value, Refusal> {
        let entry = self.last();
        let number =
            entry.text.trim().parse::<u64>().map_err(|_| {
                entry.refuse(Refusal::new("type", "a whole number is needed", json!("a whole number ≥ 0")))
            })?;
        visitor.visit_u64(number).map_err(|refusal| entry.refuse(refusal))
    }
}

impl<'de> Deserializer<'de> for Texts<'_> {
    type Error = Refusal;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        let entry = self.last();
        visitor.visit_str(entry.text).map_err(|refusal| entry.refuse(refusal))
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(self, _: &'static str, visitor: V) -> Result<V::Value, Refusal> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        let entry = self.last();
        let value = match entry.text {
            "true" => true,
            "false" => false,
            _ => return Err(entry.refuse(Refusal::new("type", "true or false is needed", json!([true, false])))),
        };
        visitor.visit_bool(value)
    }

    fn deserialize_u64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        self.whole_number(visitor)
    }

    fn deserialize_u32<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        self.whole_number(visitor)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Refusal> {
        let entry = self.last();
        let word: StrDeserializer<'_, Refusal> = entry.text.into_deserializer();
        visitor.visit_enum(word).map_err(|refusal| entry.refuse(refusal))
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        let pieces: Vec<Entry> =
            self.0.iter().flat_map(|entry| entry.text.split(',').map(|text| Entry { text, ..*entry })).collect();
        visitor.visit_seq(Pieces(pieces.into_iter()))
    }

    fn deserialize_map<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        visitor.visit_map(Keys { left: self.0.into_iter(), value: None })
    }

    forward_to_deserialize_any! {
        i8 i16 i32 i64 i128 u8 u16 u128 f32 f64 char str string bytes byte_buf unit unit_struct tuple tuple_struct
        struct identifier ignored_any
    }
}

/// The values of a list.
struct Pieces<'a>(std::vec::IntoIter<Entry<'a>>);

impl<'de> SeqAccess<'de> for Pieces<'_> {
    type Error = Refusal;

    fn next_element_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<Option<T::Value>, Refusal> {
        let read = |entry: Entry| seed.deserialize(Texts(vec![entry])).map_err(|refusal| entry.refuse(refusal));
        self.0.next().map(read).transpose()
    }
}

/// The entries of a map.
struct Keys<'a> {
    left: std::vec::IntoIter<Entry<'a>>,
    value: Option<Entry<'a>>,
}

impl<'de> MapAccess<'de> for Keys<'_> {
    type Error = Refusal;

    fn next_key_seed<K: DeserializeSeed<'de>>(&mut self, seed: K) -> Result<Option<K::Value>, Refusal> {
        self.value = self.left.next();
        let Some(entry) = self.value else { return Ok(None) };
        let key: StrDeserializer<'_, Refusal> = entry.key.into_deserializer();
        seed.deserialize(key).map(Some)
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, Refusal> {
        let entry = self.value.take().ok_or_else(|| Refusal::invalid_type(Unexpected::Map, &"a value for each key"))?;
        seed.deserialize(Texts(vec![entry])).map_err(|refusal| entry.refuse(refusal))
    }
}
