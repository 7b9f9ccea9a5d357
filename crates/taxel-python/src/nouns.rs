//! Checks of the nouns that Python holds itself.

use pyo3::prelude::*;

use taxel_core::{SpikeKind, spikes};

use crate::convert::{EventsIn, SpikesIn, SpikesOut, from_spikes, slice, to_events, to_offsets, to_spikes};
use crate::enter::enter;

/// Checks spike trains; raises where train or spike make no sense.
#[pyfunction]
fn check_spikes(py: Python<'_>, trains: SpikesIn<'_>) -> PyResult<()> {
    let (times, offsets, values, kind, start, stop) = trains;
    let (times, offsets) = (slice("times", &times)?, to_offsets(&offsets)?);
    let values = values.as_ref().map(|v| slice("values", v)).transpose()?;
    enter(py, |_| spikes::check(times, &offsets, (SpikeKind::named(&kind)?, values), start, stop))
}

/// Checks events; raises where a column is short or an event lies outside its array.
#[pyfunction]
fn check_events(py: Python<'_>, events: EventsIn<'_>) -> PyResult<()> {
    let events = to_events(events)?;
    let events = events.view()?;
    enter(py, |_| events.check())
}

/// Splits signed trains into all ON trains, then all OFF trains.
#[pyfunction]
fn split_by_sign<'py>(py: Python<'py>, trains: SpikesIn<'py>) -> PyResult<SpikesOut<'py>> {
    let trains = to_spikes(trains)?;
    let split = enter(py, |_| trains.split_by_sign())?;
    Ok(from_spikes(py, split))
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(check_spikes, module)?)?;
    module.add_function(wrap_pyfunction!(check_events, module)?)?;
    module.add_function(wrap_pyfunction!(split_by_sign, module)?)
}
