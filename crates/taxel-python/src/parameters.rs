//! Parameter objects from the JSON in which Python hands them over.

use pyo3::prelude::*;
use serde::de::DeserializeOwned;
use taxel_core::problem;

use crate::errors::core;

/// Reads `what` from its JSON, or says which of its parameters makes no sense.
pub(crate) fn parsed<T: DeserializeOwned>(what: &str, json: &str) -> PyResult<T> {
    read(json).map_err(|said| core(problem!("{what}: {said}")))
}

/// The same, with the error in words.
pub(crate) fn read<T: DeserializeOwned>(json: &str) -> Result<T, String> {
    let value: serde_json::Value = serde_json::from_str(json).map_err(|error| error.to_string())?;
    serde_path_to_error::deserialize(value).map_err(|error| {
        let path = error.path().to_string();
        // Groups of parameters are ours; whoever wrote the parameter knows its name alone.
        let name = path.rsplit('.').next().unwrap_or_default();
        let said = error.inner().to_string();
        // Serde names Rust's types.
        const PLAIN: [(&str, &str); 5] = [
            ("expected f64", "expected a number"),
            ("expected u64", "expected a whole number"),
            ("expected u32", "expected a whole number"),
            ("expected usize", "expected a whole number"),
            ("expected string or map", "expected a name"),
        ];
        let said = PLAIN.iter().fold(said, |said, (rust, plain)| said.replace(rust, plain));
        if name.is_empty() || said.starts_with("unknown field") { said } else { format!("{name}: {said}") }
    })
}
