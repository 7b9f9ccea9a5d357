//! Parameter objects from the JSON in which Python hands them over, and results as dictionaries.

use pyo3::prelude::*;
use pythonize::pythonize;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use taxel_core::{Result as CoreResult, problem, reading};

use crate::errors::core;

/// Reads the value called `name` from its JSON, or reports which of its parameters makes no sense.
///
/// # Errors
///
/// A `ProblemError` that names the parameter.
pub fn parsed<T: DeserializeOwned>(name: &str, json: &str) -> PyResult<T> {
    // Groups of parameters are ours; whoever wrote the parameter knows its name alone.
    reading::from_text(json).map_err(|unfit| core(unfit.by_name().problem(name)))
}

/// As [`parsed`], of a value that `check` finds no fault with.
///
/// # Errors
///
/// A `ProblemError` that names the parameter.
pub fn valid<T: DeserializeOwned>(name: &str, json: &str, check: impl Fn(&T) -> CoreResult<()>) -> PyResult<T> {
    let value = parsed(name, json)?;
    check(&value).map_err(core)?;
    Ok(value)
}

/// As [`valid`]; returns the value with every default filled in.
///
/// # Errors
///
/// A `ProblemError` that names the parameter.
pub fn checked<T: DeserializeOwned + Serialize>(
    name: &str,
    json: &str,
    check: impl Fn(&T) -> CoreResult<()>,
) -> PyResult<Value> {
    valid(name, json, check).map(|value| json!(value))
}

/// The error of what has no parameters.
#[must_use]
pub fn unknown(name: &str) -> PyErr {
    core(problem!("{name}: nothing with this name has parameters"))
}

/// A value that Python gets as dictionaries, lists, numbers and strings: a file's document, or numbers by cause.
#[derive(Clone)]
pub struct Plain<T>(pub T);

impl<'py, T: Serialize> IntoPyObject<'py> for Plain<T> {
    type Target = PyAny;
    type Output = Bound<'py, PyAny>;
    type Error = PyErr;

    fn into_pyobject(self, py: Python<'py>) -> PyResult<Self::Output> {
        Ok(pythonize(py, &self.0)?)
    }
}
