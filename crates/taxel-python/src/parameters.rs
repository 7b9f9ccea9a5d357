//! Parameter objects from the JSON in which Python hands them over.

use pyo3::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;
use taxel_core::{Error, reading};

use crate::errors::core;

/// Reads `what` from its JSON, or reports which of its parameters makes no sense.
pub(crate) fn parsed<T: DeserializeOwned>(what: &str, json: &str) -> PyResult<T> {
    // Groups of parameters are ours; whoever wrote the parameter knows its name alone.
    reading::from_text(json).map_err(|unfit| core(unfit.by_name().problem(what)))
}

/// What is handed to Python, as JSON.
pub(crate) fn to_json<T: Serialize>(value: &T) -> PyResult<String> {
    serde_json::to_string(value).map_err(|error| core(Error::Problem(error.to_string().into())))
}
