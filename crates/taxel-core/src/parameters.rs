//! The parameters of a noun as other languages read them: names, defaults, ranges.

use serde::Serialize;
use serde_json::{Map, Value};

use crate::allowed::Parameter;

/// The parameters of a noun: their defaults, those without a default, and their ranges.
#[derive(Debug, Clone, PartialEq)]
pub struct Described {
    /// The defaults by name.
    pub defaults: Map<String, Value>,
    /// Names without a default.
    pub required: Vec<&'static str>,
    /// The ranges, of numbers alone.
    pub ranges: Vec<Parameter>,
}

impl Described {
    /// Describes a noun by one that has all its defaults; names in `required` have no default, whatever the noun holds there.
    #[must_use]
    pub fn by(defaults: &impl Serialize, required: &[&'static str], ranges: &[Parameter]) -> Self {
        // Parameters are plain structs of numbers, words and lists: nothing in them can fail to be written.
        let mut defaults = match serde_json::to_value(defaults) {
            Ok(Value::Object(defaults)) => defaults,
            _ => Map::new(),
        };
        for name in required {
            defaults.remove(*name);
        }
        Self { defaults, required: required.to_vec(), ranges: ranges.to_vec() }
    }

    /// The same with one more parameter, which is null where it is left out.
    #[must_use]
    pub fn or_nothing(mut self, name: &'static str) -> Self {
        self.defaults.insert(name.to_owned(), Value::Null);
        self
    }

    /// The same with one more parameter.
    #[must_use]
    pub fn with(mut self, parameter: Parameter, default: impl Into<Value>) -> Self {
        self.defaults.insert(parameter.name.to_owned(), default.into());
        self.ranges.push(parameter);
        self
    }

    /// The description as JSON: `{"defaults": {…}, "required": […], "ranges": {name: {"unit", "must_be", "least", …}}}`;
    /// `least` and `most` are left out where there is none, `infinite` stands where infinity will do.
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
