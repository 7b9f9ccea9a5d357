//! Learning rules of the literature, each with its own neuron, as its paper has it.
//!
//! `rules` computes and knows nothing of Python; `bindings` is what Python calls.

mod bindings;
mod checks;
mod rules;

/// The compiled part of taxel_rules; import `taxel_rules` instead.
#[pyo3::pymodule]
mod _rules {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::bindings::{
        Plastic, TrainedOut, change_epochs, change_tempotron, check_parameters, fit_epochs, fit_tempotron, parameters,
        peak_tempotron, rows_skim, rule_names, run_epochs,
    };

    #[pymodule_init]
    fn begin(_module: &Bound<'_, PyModule>) -> PyResult<()> {
        taxel_border::instructions::cap()
    }
}
