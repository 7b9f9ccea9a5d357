//! Checks of the nouns that Python holds itself.

use pyo3::prelude::*;

use taxel_core::spikes;

use taxel_border::convert::{EventsIn, SpikesColumns, SpikesIn, SpikesOut, from_spikes};
use taxel_border::enter::enter;

/// Checks spike trains; raises where train or spike make no sense.
#[pyfunction]
pub fn check_spikes(py: Python<'_>, trains: SpikesColumns<'_>) -> PyResult<()> {
    trains.read(|times, offsets, values, (start, stop)| {
        enter(py, |_| spikes::check(times, &offsets, values, start, stop))
    })
}

/// Checks events; raises where a column is short or an event lies outside its array.
#[pyfunction]
pub fn check_events(py: Python<'_>, events: EventsIn<'_>) -> PyResult<()> {
    let events = events.view()?;
    enter(py, |_| events.check())
}

/// Splits signed trains into all ON trains, then all OFF trains.
#[pyfunction]
pub fn split_by_sign<'py>(py: Python<'py>, trains: SpikesIn) -> PyResult<SpikesOut<'py>> {
    let split = enter(py, |_| trains.0.split_by_sign())?;
    Ok(from_spikes(py, split))
}
