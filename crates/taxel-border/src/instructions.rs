//! The vector instructions that this process may use: the widest of the machine, or at most TAXEL_INSTRUCTIONS.

use pyo3::prelude::*;
use taxel_core::problem;
use taxel_core::vectors::Instructions;

use crate::errors::core;

/// The set of vector instructions in use: plain, avx2 or avx512.
#[pyfunction]
pub fn instructions() -> &'static str {
    Instructions::best().name()
}

/// Takes at most the set that the environment names.
pub fn cap() -> PyResult<()> {
    match std::env::var("TAXEL_INSTRUCTIONS") {
        Ok(name) => Instructions::cap(&name).map_err(core),
        Err(std::env::VarError::NotPresent) => Ok(()),
        Err(std::env::VarError::NotUnicode(_)) => Err(core(problem!("TAXEL_INSTRUCTIONS is not text"))),
    }
}
