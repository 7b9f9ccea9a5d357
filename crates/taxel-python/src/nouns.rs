//! Checks of the nouns that Python holds itself.

use pyo3::prelude::*;

use crate::convert::{EventsIn, SpikesIn, SpikesOut, from_spikes, to_events, to_spikes};
use crate::enter::enter;

/// Checks spike trains; raises where train or spike make no sense.
#[pyfunction]
fn check_spikes(trains: SpikesIn<'_>) -> PyResult<()> {
    to_spikes(trains).map(drop)
}

/// Checks events; raises where a column is short or an event lies outside its array.
#[pyfunction]
fn check_events(events: EventsIn<'_>) -> PyResult<()> {
    to_events(events).map(drop)
}

/// Splits signed trains into all ON trains, then all OFF trains.
#[pyfunction]
fn split_by_sign<'py>(py: Python<'py>, trains: SpikesIn<'py>) -> PyResult<SpikesOut<'py>> {
    let trains = to_spikes(trains)?;
    let split = enter(py, |_| Ok::<_, taxel_core::Error>(trains.split_by_sign()))?;
    Ok(from_spikes(py, split))
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(check_spikes, module)?)?;
    module.add_function(wrap_pyfunction!(check_events, module)?)?;
    module.add_function(wrap_pyfunction!(split_by_sign, module)?)
}
