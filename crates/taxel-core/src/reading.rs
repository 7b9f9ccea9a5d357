//! Parses JSON into parameters; errors are one line in taxel's own terms, not in the parser's.

use serde::de::DeserializeOwned;
use serde_json::Value;
use serde_json::error::Category;

use crate::Error;

/// The part of a JSON text that is not valid: its path, its value, and what is valid.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unfit {
    /// Path from the outermost name to the innermost, as `neuron.lambdas[2]`; empty for the whole text.
    path: String,
    /// The message, which continues after the path.
    message: String,
}

impl Unfit {
    /// The whole error for a text that describes `subject`.
    #[must_use]
    pub fn text(&self, subject: &str) -> String {
        let colon = if self.message.starts_with(" is ") && self.path.is_empty() { "" } else { ": " };
        format!("{subject}{colon}{}{}", self.path, self.message)
    }

    /// The error of the parameter, for a caller who passed `subject` its parameters.
    #[must_use]
    pub fn problem(self, subject: &str) -> Error {
        match self.path.find(['.', '[']).map_or((self.path.as_str(), ""), |end| self.path.split_at(end)) {
            ("", _) => Error::Problem(self.text(subject).into()),
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
        let message = match error.classify() {
            Category::Eof => "not JSON: it ends too early".to_owned(),
            // Serde names the token that it expected, which is seldom the wrong one.
            _ => format!("not JSON: see line {}, column {}", error.line(), error.column()),
        };
        Unfit { path: String::new(), message }
    })?;
    from_value(value)
}

/// Converts a JSON value.
///
/// # Errors
///
/// [`Unfit`] if the value is not a valid `T`.
pub fn from_value<T: DeserializeOwned>(value: Value) -> Result<T, Unfit> {
    serde_path_to_error::deserialize(&value).map_err(|error| {
        let path = error.path().to_string();
        let mut pointer = String::new();
        for segment in error.path() {
            let (step, stays) = match segment {
                serde_path_to_error::Segment::Seq { index } => (index.to_string(), false),
                serde_path_to_error::Segment::Map { key } => (key.clone(), false),
                serde_path_to_error::Segment::Enum { variant } => (variant.clone(), true),
                serde_path_to_error::Segment::Unknown => continue,
            };
            let deeper = format!("{pointer}/{}", step.replace('~', "~0").replace('/', "~1"));
            if !stays || value.pointer(&deeper).is_some() {
                pointer = deeper;
            }
        }
        let message = error.inner().to_string();
        let message = names::<T>(&value, &pointer, &message).unwrap_or(message);
        in_words(if path == "." { String::new() } else { path }, value.pointer(&pointer), &message)
    })
}

/// The error that lists the names of an enum, for one that says only that a value is none of its kind: serde_json lists
/// them only where it reads a text.
fn names<T: DeserializeOwned>(value: &Value, pointer: &str, message: &str) -> Option<String> {
    if !message.ends_with(", expected string or map") {
        return None;
    }
    let mut value = value.clone();
    *value.pointer_mut(pointer)? = Value::String(String::new());
    let error = serde_path_to_error::deserialize::<_, T>(&value).err()?.into_inner().to_string();
    error.starts_with("unknown variant ").then_some(error)
}

/// Rewrites an error of serde_json in plain terms; its text is the only information that serde_json gives.
fn in_words(path: String, value: Option<&Value>, message: &str) -> Unfit {
    let quoted = |start: &str| message.strip_prefix(start).and_then(|rest| rest.split('`').nth(1));
    let wanted = message.split_once(", expected ").map_or("", |(_, wanted)| wanted);
    let must = |right: &str| value.map_or(format!(": {right}"), |value| format!(" is {}: {right}", value_text(value)));
    if let Some(name) = quoted("unknown field ") {
        let meant = nearest(name, wanted).map_or(String::new(), |near| format!(" (did you mean {near}?)"));
        return Unfit {
            path: beside(&path, name),
            message: format!(" is not known{meant}: must be {}", choice(wanted)),
        };
    }
    if let Some(name) = quoted("missing field ") {
        let dot = if path.is_empty() { "" } else { "." };
        return Unfit { path: format!("{path}{dot}{name}"), message: " is missing".to_owned() };
    }
    let message = if message.starts_with("unknown variant ") {
        must(&format!("must be {}", choice(wanted)))
    } else if message.starts_with("invalid ") {
        must(&format!("must be {}", kind(wanted, value)))
    } else if message.starts_with("must be ") {
        must(message)
    } else {
        format!(": {message}")
    };
    Unfit { path, message }
}

/// The path of a name that its group does not contain; for some types the path ends with the name, for others before
/// it.
fn beside(path: &str, name: &str) -> String {
    match path.strip_suffix(name).unwrap_or(path).trim_end_matches('.') {
        "" => name.to_owned(),
        group => format!("{group}.{name}"),
    }
}

/// The closest of several names in backticks, if one is similar enough.
fn nearest<'a>(name: &str, wanted: &'a str) -> Option<&'a str> {
    let most = 1 + name.chars().count() / 4;
    let near = wanted.split('`').skip(1).step_by(2).map(|known| (strsim::levenshtein(name, known), known));
    near.filter(|(edits, _)| *edits <= most).min_by_key(|(edits, _)| *edits).map(|(_, known)| known)
}

/// A value as an error shows it: as JSON, shortened, with None for null.
fn value_text(value: &Value) -> String {
    let message = match value {
        Value::Null => "None".to_owned(),
        other => other.to_string(),
    };
    if message.chars().count() <= 60 { message } else { message.chars().take(57).chain("...".chars()).collect() }
}

/// Formats a choice of names: `"a"`, `"b"` or `"c"`.
fn choice(wanted: &str) -> String {
    let names: Vec<String> = wanted.split('`').skip(1).step_by(2).map(|name| format!("\"{name}\"")).collect();
    match names.split_last() {
        None => "nothing".to_owned(),
        Some((only, [])) => only.clone(),
        Some((last, others)) => format!("{} or {last}", others.join(", ")),
    }
}

/// The expected type, without the names of Rust's types.
fn kind(wanted: &str, value: Option<&Value>) -> String {
    let most = match wanted {
        "u8" => Some(u64::from(u8::MAX)),
        "u16" => Some(u64::from(u16::MAX)),
        "u32" => Some(u64::from(u32::MAX)),
        "u64" | "usize" => Some(u64::MAX),
        _ => None,
    };
    let too_many = value.and_then(Value::as_u64);
    match (wanted, most, too_many) {
        (_, Some(most), Some(_)) => format!("a whole number, at most {most}"),
        (_, Some(_), None) => "a whole number, 0 or more".to_owned(),
        ("f64" | "f32", ..) => "a number".to_owned(),
        ("i8" | "i16" | "i32" | "i64" | "isize", ..) => "a whole number".to_owned(),
        ("a boolean", ..) => "true or false".to_owned(),
        ("a string" | "a borrowed string", ..) => "a name".to_owned(),
        ("a sequence", ..) => "a list".to_owned(),
        ("a map", ..) => "an object (names and values)".to_owned(),
        _ if wanted.starts_with("struct ") => "an object (names and values)".to_owned(),
        _ if wanted.contains("array of length") || wanted.contains("tuple") => {
            format!("a list of {}", wanted.chars().filter(char::is_ascii_digit).collect::<String>())
        }
        _ => wanted.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Whole {
        tau: f64,
        small: Option<u8>,
        many: Option<usize>,
        word: Option<Word>,
        three: Option<[f64; 3]>,
        pair: Option<(f64, String)>,
        list: Option<Vec<f64>>,
        yes: Option<bool>,
        text: Option<String>,
        inner: Option<Box<Whole>>,
        each: Option<std::collections::BTreeMap<String, Whole>>,
    }

    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "snake_case")]
    #[allow(dead_code)]
    enum Word {
        Keep,
        Reset,
        Later(Box<Whole>),
    }

    fn message(text: &str) -> String {
        from_text::<Whole>(text).unwrap_err().text("whole")
    }

    #[test]
    fn what_does_not_fit_is_said_by_place_value_and_remedy() {
        for (parameter, words) in [
            (r#""tau": "3""#, "tau is \"3\": must be a number"),
            (r#""tau": null"#, "tau is None: must be a number"),
            (r#""tau": {"ms": 3}"#, "tau is {\"ms\":3}: must be a number"),
            (r#""tau": 1, "small": 300"#, "small is 300: must be a whole number, at most 255"),
            (r#""tau": 1, "many": -1"#, "many is -1: must be a whole number, 0 or more"),
            (r#""tau": 1, "many": 0.5"#, "many is 0.5: must be a whole number, 0 or more"),
            (r#""tau": 1, "word": "x""#, "word is \"x\": must be \"keep\", \"reset\" or \"later\""),
            (r#""tau": 1, "word": 2"#, "word is 2: must be \"keep\", \"reset\" or \"later\""),
            (r#""tau": 1, "word": []"#, "word is []: must be \"keep\", \"reset\" or \"later\""),
            (r#""tau": 1, "word": {"later": {"tau": "x"}}"#, "word.later.tau is \"x\": must be a number"),
            (r#""tau": 1, "three": [1, 2]"#, "three is [1,2]: must be a list of 3"),
            (r#""tau": 1, "three": [1, 2, "3"]"#, "three[2] is \"3\": must be a number"),
            (r#""tau": 1, "three": 3"#, "three is 3: must be a list of 3"),
            (r#""tau": 1, "small": -1"#, "small is -1: must be a whole number, 0 or more"),
            (r#""tau": 1, "pair": [1]"#, "pair is [1]: must be a list of 2"),
            (r#""tau": 1, "list": 5"#, "list is 5: must be a list"),
            (r#""tau": 1, "yes": 1"#, "yes is 1: must be true or false"),
            (r#""tau": 1, "text": 1"#, "text is 1: must be a name"),
            (r#""tau": 1, "inner": []"#, "inner is []: must be an object (names and values)"),
            (r#""tau": 1, "inner": 7"#, "inner is 7: must be an object (names and values)"),
            (r#""tau": 1, "each": {"a b": {}}"#, "each.a b.tau is missing"),
            (r#""small": 1"#, "tau is missing"),
            (r#""tau": 1, "inner": {"tau": 1, "wings": 2}"#, "inner.wings is not known: must be \"tau\""),
            (r#""tau": 1, "wings": 2"#, "wings is not known: must be \"tau\""),
        ] {
            let text = format!("{{{parameter}}}");
            assert!(message(&text).starts_with(&format!("whole: {words}")), "{}", message(&text));
        }
        assert_eq!(message("7"), "whole is 7: must be an object (names and values)");
    }

    #[test]
    fn the_name_that_was_meant_is_said() {
        assert!(message(r#"{"tau": 1, "smal": 2}"#).contains("smal is not known (did you mean small?): must be"));
        assert!(!message(r#"{"tau": 1, "wings": 2}"#).contains("mean"));
    }

    #[test]
    fn a_text_that_is_no_json_is_said_by_its_place() {
        assert_eq!(message("{\n\"tau\": x"), "whole: not JSON: see line 2, column 8");
        assert_eq!(message("{\"tau\": 1"), "whole: not JSON: it ends too early");
        assert_eq!(message(&"[".repeat(200)), "whole: not JSON: see line 1, column 128");
    }

    #[test]
    fn a_long_value_is_cut_and_a_name_can_stand_alone() {
        let text = format!("{{\"tau\": 1, \"inner\": {{\"tau\": \"{}\"}}}}", "é".repeat(100));
        let unfit = from_text::<Whole>(&text).unwrap_err().by_name();
        assert_eq!(unfit.text("whole"), format!("whole: tau is \"{}...: must be a number", "é".repeat(56)));
    }
}
