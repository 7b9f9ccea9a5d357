//! Checks of the nouns that Python holds itself.

use pyo3::prelude::*;

use taxel_core::{SpikeKind, spikes};

use taxel_border::convert::{EventsIn, SpikesIn, SpikesOut, SpikesParts, from_spikes, slice, to_offsets};
use taxel_border::enter::enter;

/// Checks spike trains; raises where train or spike make no sense.
#[pyfunction]
pub fn check_spikes(py: Python<'_>, trains: SpikesParts<'_>) -> PyResult<()> {
    let (times, offsets, values, kind, start, stop) = trains;
    let (times, offsets) = (slice("times", &times)?, to_offsets(&offsets)?);
    let values = values.as_ref().map(|v| slice("values", v)).transpose()?;
    enter(py, |_| spikes::check(times, &offsets, (SpikeKind::named(&kind)?, values), start, stop))
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
