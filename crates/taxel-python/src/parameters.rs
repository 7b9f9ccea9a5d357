//! Parameter objects from the JSON in which Python hands them over, and results as dictionaries.

use pyo3::prelude::*;
use pythonize::pythonize;
use serde::Serialize;
use serde::de::DeserializeOwned;
use taxel_core::reading;

use crate::errors::core;

/// Reads `what` from its JSON, or reports which of its parameters makes no sense.
pub(crate) fn parsed<T: DeserializeOwned>(what: &str, json: &str) -> PyResult<T> {
    // Groups of parameters are ours; whoever wrote the parameter knows its name alone.
    reading::from_text(json).map_err(|unfit| core(unfit.by_name().problem(what)))
}

/// A value that Python gets as dictionaries, lists, numbers and strings: a file's document, or numbers by cause.
#[derive(Clone)]
pub(crate) struct Plain<T>(pub(crate) T);

impl<'py, T: Serialize> IntoPyObject<'py> for Plain<T> {
    type Target = PyAny;
    type Output = Bound<'py, PyAny>;
    type Error = PyErr;

    fn into_pyobject(self, py: Python<'py>) -> PyResult<Self::Output> {
        Ok(pythonize(py, &self.0)?)
    }
}
