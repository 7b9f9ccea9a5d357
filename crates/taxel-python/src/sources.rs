//! What the extension was made of: so that a kept result can be held against the sources that it is of.

use std::collections::BTreeMap;

use pyo3::prelude::*;

include!(concat!(env!("OUT_DIR"), "/digests.rs"));

/// The digest of the sources of each name of the extension: of the room that binds it, and the rooms below.
#[pyfunction]
fn source_digests() -> BTreeMap<&'static str, &'static str> {
    DIGESTS.iter().copied().collect()
}

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(source_digests, module)?)
}
