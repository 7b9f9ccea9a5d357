//! Parses JSON into parameters; an error is one line: the path in the text, what is there, and what must be.

use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::{Error, Place};

/// The part of a JSON text that is not valid.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unfit {
    /// Path from the outermost name to the innermost, as `neuron.lambdas[2]`; empty for the whole text.
    path: String,
    /// Why it is not valid, as it follows the path: ` is 7: must be text`.
    message: String,
    /// The line, counted from 1, of a text that is not JSON.
    line: Option<u64>,
}

impl Unfit {
    /// The error of a text that describes `subject`, as one of bytes or a file.
    #[must_use]
    pub fn format(&self, subject: &str) -> Error {
        self.placed(Error::format(self.text(subject)))
    }

    /// The error of a text that describes `subject`, as one of a scene.
    #[must_use]
    pub fn scene(&self, subject: &str) -> Error {
        self.placed(Error::scene(self.text(subject)))
    }

    fn text(&self, subject: &str) -> String {
        let colon = if self.path.is_empty() { "" } else { ": " };
        format!("{subject}{colon}{}{}", self.path, self.message)
    }

    fn placed(&self, error: Error) -> Error {
        match self.line {
            Some(line) => error.at(Place::line(line)),
            None => error,
        }
    }

    /// The error of the parameter, for a caller who passed `subject` its parameters.
    #[must_use]
    pub fn problem(self, subject: &str) -> Error {
        match self.path.find(['.', '[']).map_or((self.path.as_str(), ""), |end| self.path.split_at(end)) {
            ("", _) => self.placed(Error::Problem(self.text(subject).into())),
            (argument, rest) => Error::argument(argument, &format!("{rest}{}", self.message)),
        }
    }

    /// The error for a caller who passed the parameter by its own name and does not know the groups that contain it.
    #[must_use]
    pub fn by_name(mut self) -> Self {
        self.path = self.path.rsplit('.').next().unwrap_or_default().to_owned();
        self
    }
}

/// Parses a text.
///
/// # Errors
///
/// [`Unfit`] if the text is not JSON, or not a valid `T`.
pub fn from_text<T: DeserializeOwned>(text: &str) -> Result<T, Unfit> {
    let value = serde_json::from_str(text).map_err(|error| {
        let (line, column, message) = (error.line(), error.column(), error.to_string());
        let why = message.strip_suffix(&format!(" at line {line} column {column}")).unwrap_or(&message);
        let message = format!(": not JSON: {why} (column {column})");
        Unfit { path: String::new(), message, line: Some(line as u64) }
    })?;
    from_value(value)
}

/// Converts a JSON value.
///
/// # Errors
///
/// [`Unfit`] if the value is not a valid `T`.
pub fn from_value<T: DeserializeOwned>(value: Value) -> Result<T, Unfit> {
    serde_path_to_error::deserialize(value).map_err(|error| {
        let (mut path, message) = (error.path().to_string(), error.inner().to_string());
        if path == "." {
            path.clear();
        }
        // The path of a key that is missing ends before it, and that of an unknown one before it or with it.
        if let Some(key) = key_of(&message).filter(|&key| path.rsplit('.').next() != Some(key)) {
            let dot = if path.is_empty() { "" } else { "." };
            path = format!("{path}{dot}{key}");
        }
        Unfit { path, message: in_our_words(&message), line: None }
    })
}

/// The key that a message of serde says is missing or unknown.
fn key_of(message: &str) -> Option<&str> {
    let rest = message.strip_prefix("missing field `").or_else(|| message.strip_prefix("unknown field `"))?;
    rest.split('`').next()
}

/// What serde says of a value, as it follows the path.
fn in_our_words(message: &str) -> String {
    if message.starts_with("missing field ") {
        return " is missing".to_owned();
    }
    let Some((found, expected)) = message.rsplit_once(", expected ") else { return format!(": {message}") };
    let must = match expected.split([' ', '<']).next().unwrap_or_default() {
        "f64" => "a number".to_owned(),
        "u8" | "u16" | "u32" => format!("a whole number from 0 to 2^{} - 1", &expected[1..]),
        "u64" | "usize" | "i32" | "i64" => "a whole number".to_owned(),
        "struct" | "map" => "a table".to_owned(),
        _ => match expected {
            "a boolean" => "true or false".to_owned(),
            "a string" => "text".to_owned(),
            "a sequence" => "a list".to_owned(),
            "a map" => "a table".to_owned(),
            "string or map" => "a name, or a table with a name and its values".to_owned(),
            other => other.replace("an array of length", "a list of").replace('`', ""),
        },
    };
    if found.starts_with("unknown field ") {
        return format!(" is not known: must be {must}");
    }
    if let Some(length) = found.strip_prefix("invalid length ") {
        return format!(" has {length} entries: must be {must}");
    }
    let value = found.trim_start_matches("invalid type: ").trim_start_matches("invalid value: ");
    let value = match value {
        "sequence" => "a list",
        "map" => "a table",
        _ => ["unknown variant ", "string ", "integer ", "floating point ", "boolean "]
            .iter()
            .find_map(|kind| value.strip_prefix(kind))
            .unwrap_or(value),
    };
    format!(" is {}: must be {must}", value.trim_matches('`'))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use serde::Deserialize;

    use super::*;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Whole {
        tau: f64,
        three: Option<[f64; 3]>,
        inner: Option<Box<Whole>>,
        each: Option<BTreeMap<String, Whole>>,
    }

    #[test]
    fn an_error_names_the_path_and_its_first_name_is_the_argument() {
        for (parameters, path) in [
            (r#""tau": "3""#, "tau"),
            (r#""tau": 1, "three": [1, 2, "3"]"#, "three[2]"),
            (r#""tau": 1, "inner": {"tau": {}}"#, "inner.tau"),
            (r#""tau": 1, "each": {"a b": {}}"#, "each.a b.tau"),
            (r#""three": null"#, "tau"),
            (r#""tau": 1, "wings": 2"#, "wings"),
            (r#""tau": 1, "inner": {"tau": 1, "wings": 2}"#, "inner.wings"),
        ] {
            let unfit = from_text::<Whole>(&format!("{{{parameters}}}")).unwrap_err();
            assert_eq!(unfit.path, path);
            assert!(unfit.text("whole").starts_with(&format!("whole: {path}")), "{}", unfit.text("whole"));
            let name = path.split(['.', '[']).next();
            assert_eq!(unfit.clone().problem("whole").reason().unwrap().argument.as_deref(), name);
            let by_name = unfit.by_name().problem("whole");
            assert!(by_name.to_string().starts_with(path.rsplit('.').next().unwrap()), "{by_name}");
        }
    }

    #[test]
    fn a_text_that_is_no_json_has_a_line_and_no_argument() {
        for (text, line) in [("{\n\"tau\": x", Some(2)), ("{\"tau\": 1", Some(1)), ("7", None), ("", Some(1))] {
            let unfit = from_text::<Whole>(text).unwrap_err();
            assert_eq!(unfit.path, "");
            let error = unfit.problem("whole");
            assert_eq!(error.reason().unwrap().argument, None);
            assert_eq!(error.reason().unwrap().place, line.map(Place::line));
        }
    }
}
