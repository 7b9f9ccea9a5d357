//! The panel's files, for whoever shows a page without a server.

use pyo3::prelude::*;
use taxel_live::panel::assets::asset;

use crate::errors::core;

/// Gives a file of the panel's page by its name below `web/`, as bytes.
#[pyfunction]
fn page_file(name: &str) -> PyResult<&'static [u8]> {
    Ok(asset(name).map_err(core)?.bytes)
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(page_file, module)?)
}
