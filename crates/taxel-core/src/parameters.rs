//! The parameters of a type, as other languages read them: names, defaults, ranges.

use serde::Serialize;
use serde_json::{Map, Value};

use crate::allowed::Parameter;

/// The parameters of a type: the defaults, the names without a default, and the ranges.
#[derive(Debug, Clone, PartialEq)]
pub struct Described {
    /// The defaults by name.
    pub defaults: Map<String, Value>,
    /// Names without a default.
    pub required: Vec<&'static str>,
    /// The ranges of numeric parameters.
    pub ranges: Vec<Parameter>,
}

impl Described {
    /// Describes a type by a value with all its defaults; names in `required` have no default, whatever the value
    /// contains.
    #[must_use]
    pub fn by(defaults: &impl Serialize, required: &[&'static str], ranges: &[Parameter]) -> Self {
        // Parameters are plain structs of numbers, strings and lists, which cannot fail to serialise.
        let mut defaults = match serde_json::to_value(defaults) {
            Ok(Value::Object(defaults)) => defaults,
            _ => Map::new(),
        };
        for name in required {
            defaults.remove(*name);
        }
        Self { defaults, required: required.to_vec(), ranges: ranges.to_vec() }
    }

    /// The same description with one more parameter, which has no range.
    #[must_use]
    pub fn or(mut self, name: &'static str, default: Value) -> Self {
        self.defaults.insert(name.to_owned(), default);
        self
    }

    /// The same description with one more parameter and its default.
    #[must_use]
    pub fn with(mut self, parameter: Parameter, default: impl Into<Value>) -> Self {
        self.defaults.insert(parameter.name.to_owned(), default.into());
        self.ranges.push(parameter);
        self
    }

    /// The description as JSON: `{"defaults": {…}, "required": […], "ranges": {name: {"unit", "must_be", "least",
    /// …}}}`; `least` and `most` are omitted if there is no limit, and `infinite` is present if infinity is valid.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let ranges: Map<String, Value> = self
            .ranges
            .iter()
            .map(|Parameter { name, unit, range }| {
                let mut entry = serde_json::json!({ "unit": unit, "must_be": range.to_string() });
                if range.most_in && range.most.is_infinite() {
                    entry["infinite"] = true.into();
                }
                for (end, value, is_in) in [("least", range.least, range.least_in), ("most", range.most, range.most_in)]
                {
                    if value.is_finite() {
                        entry[end] = value.into();
                        entry[format!("{end}_in")] = is_in.into();
                    }
                }
                ((*name).to_owned(), entry)
            })
            .collect();
        serde_json::json!({ "defaults": self.defaults, "required": self.required, "ranges": ranges })
    }
}

/// Declares a struct of parameters: a line for each, with its default and, if it is a number, its unit and its valid
/// values; `or method` names the method that returns the value of one that is left out.
///
/// The struct gets `Default`, the table `RANGES`, `check_ranges`, which reads it, and `described`.
#[doc(hidden)]
#[macro_export]
macro_rules! parameters {
    (
        $(#[$about:meta])*
        pub struct $Kind:ident {
            $(
                $(#[$meaning:meta])*
                pub $name:ident: $type:ty = $default:expr $(, $unit:literal, $range:expr $(, or $method:ident)?)?;
            )*
        }
    ) => {
        $(#[$about])*
        pub struct $Kind {
            $($(#[$meaning])* pub $name: $type,)*
        }

        impl Default for $Kind {
            fn default() -> Self {
                Self { $($name: $default,)* }
            }
        }

        impl $Kind {
            $crate::allowed::ranges! {
                $($($name $(($method))?: $unit, $range;)?)*
            }

            /// The parameters with their defaults and ranges.
            #[must_use]
            pub fn described() -> $crate::parameters::Described {
                let defaults = Self::default();
                $crate::parameters::Described {
                    defaults: [$((stringify!($name).to_owned(), serde_json::json!(defaults.$name)),)*].into_iter().collect(),
                    required: vec![],
                    ranges: Self::RANGES.to_vec(),
                }
            }
        }
    };
}
pub use parameters;
