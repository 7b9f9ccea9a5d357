//! Values of requests with their limits.

use serde::de::Error;
use serde::{Deserialize, Deserializer};
use serde_json::Value;

/// A whole number from `LEAST` to `MOST`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Whole<const LEAST: i64, const MOST: i64>(pub(crate) i64);

/// A time of the board's clock, us.
pub(crate) type BoardTime = Whole<{ -(1 << 52) }, { 1 << 52 }>;

/// A number; limits are in thousandths.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Number<const LEAST: i64, const MOST: i64>(pub(crate) f64);

/// A text of 1 to `MOST` characters, none of them a control character, and not all of them white space.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Text<const MOST: usize>(pub(crate) String);

/// One value or more.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct OneOrMore<T>(pub(crate) Vec<T>);

impl<'de, const LEAST: i64, const MOST: i64> Deserialize<'de> for Whole<LEAST, MOST> {
    fn deserialize<D: Deserializer<'de>>(value: D) -> Result<Self, D::Error> {
        let number = Value::deserialize(value)?.as_i64().filter(|number| (LEAST..=MOST).contains(number));
        number.map(Self).ok_or_else(|| D::Error::custom(format!("must be a whole number from {LEAST} to {MOST}")))
    }
}

impl<const LEAST: i64, const MOST: i64> Number<LEAST, MOST> {
    #[allow(clippy::cast_precision_loss)]
    const LIMITS: (f64, f64) = (LEAST as f64 / 1e3, MOST as f64 / 1e3);
}

impl<'de, const LEAST: i64, const MOST: i64> Deserialize<'de> for Number<LEAST, MOST> {
    fn deserialize<D: Deserializer<'de>>(value: D) -> Result<Self, D::Error> {
        let (least, most) = Self::LIMITS;
        let number = Value::deserialize(value)?.as_f64().filter(|number| (least..=most).contains(number));
        number.map(Self).ok_or_else(|| D::Error::custom(format!("must be a number from {least} to {most}")))
    }
}

impl<'de, const MOST: usize> Deserialize<'de> for Text<MOST> {
    fn deserialize<D: Deserializer<'de>>(value: D) -> Result<Self, D::Error> {
        match Value::deserialize(value)? {
            Value::String(text)
                if !text.trim().is_empty() && text.chars().count() <= MOST && !text.chars().any(char::is_control) =>
            {
                Ok(Self(text))
            }
            _ => Err(D::Error::custom(format!("must be a text of 1 to {MOST} characters"))),
        }
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for OneOrMore<T> {
    fn deserialize<D: Deserializer<'de>>(values: D) -> Result<Self, D::Error> {
        let values = Vec::deserialize(values)?;
        if values.is_empty() { Err(D::Error::custom("must contain one or more")) } else { Ok(Self(values)) }
    }
}

/// A register's value as JSON: true or false where it has one bit.
#[cfg(feature = "development")]
#[derive(schemars::JsonSchema)]
#[schemars(untagged, inline)]
#[allow(dead_code)]
pub(crate) enum RegisterValue {
    Flag(bool),
    Number(i64),
}

#[cfg(feature = "development")]
mod schema {
    use std::borrow::Cow;

    use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};

    use super::{Number, OneOrMore, Text, Whole};

    /// The schema of a type, written where the type is used.
    macro_rules! inline_schema {
        ([$($parameters:tt)*] $type:ty, $generator:ident => $schema:expr) => {
            impl<$($parameters)*> JsonSchema for $type {
                fn inline_schema() -> bool {
                    true
                }

                fn schema_name() -> Cow<'static, str> {
                    std::any::type_name::<Self>().into()
                }

                fn json_schema($generator: &mut SchemaGenerator) -> Schema {
                    $schema
                }
            }
        };
    }

    inline_schema!([const LEAST: i64, const MOST: i64] Whole<LEAST, MOST>, _generator =>
        json_schema!({ "type": "integer", "minimum": LEAST, "maximum": MOST }));
    inline_schema!([const LEAST: i64, const MOST: i64] Number<LEAST, MOST>, _generator =>
        json_schema!({ "type": "number", "minimum": Self::LIMITS.0, "maximum": Self::LIMITS.1 }));
    inline_schema!([const MOST: usize] Text<MOST>, _generator => json_schema!({ "type": "string", "maxLength": MOST }));
    inline_schema!([T: JsonSchema] OneOrMore<T>, generator =>
        json_schema!({ "type": "array", "minItems": 1, "items": generator.subschema_for::<T>() }));
}
