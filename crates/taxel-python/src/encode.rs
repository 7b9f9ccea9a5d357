//! Encoders and the tare for Python; parameters cross as JSON.

use numpy::PyArray1;
use pyo3::prelude::*;
use taxel_core::encode::{Encoder, LocalLoad, Pieces, Tare};

use taxel_core::problem;

use taxel_border::convert::{ArrayIn, EventsIn, FramesIn, SpikesOut, from_spikes};
use taxel_border::enter::{Exclusive, enter};
use taxel_border::errors::core;

/// Checks an encoder; gives it back with every default filled in.
#[pyfunction]
pub fn check_encoder(encoder: &str) -> PyResult<String> {
    Ok(Encoder::from_json(encoder).map_err(core)?.to_json())
}

/// The names of all encoders.
#[pyfunction]
pub fn encoder_names() -> Vec<&'static str> {
    taxel_core::encode::NAMES.to_vec()
}

/// Trains for an array, their kind, and the latency in ms.
#[pyfunction]
pub fn encoder_about(encoder: &str, array: ArrayIn) -> PyResult<(usize, &'static str, f64)> {
    let encoder = Encoder::from_json(encoder).map_err(core)?;
    Ok((encoder.trains(&array.0), encoder.kind().name(), encoder.latency_ms()))
}

/// The parameters of a local load.
fn local_load(encoder: &str) -> PyResult<LocalLoad> {
    match Encoder::from_json(encoder).map_err(core)? {
        Encoder::LocalLoad(load) => Ok(load),
        _ => Err(core(problem!("local load: must be one"))),
    }
}

/// The names of a local load's quantities.
#[pyfunction]
pub fn local_load_quantities(encoder: &str) -> PyResult<Vec<String>> {
    Ok(local_load(encoder)?.quantities())
}

/// The quantities of a local load of a whole recording of events, sample by sample.
#[pyfunction]
pub fn local_load_of_events<'py>(
    py: Python<'py>,
    encoder: &str,
    events: EventsIn<'py>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let load = local_load(encoder)?;
    let events = events.view()?;
    Ok(PyArray1::from_vec(py, enter(py, |stop| load.values_of_events(events, stop))?))
}

/// The quantities of a local load of a whole recording of frames, frame by frame.
#[pyfunction]
pub fn local_load_of_frames<'py>(
    py: Python<'py>,
    encoder: &str,
    frames: FramesIn<'py>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let load = local_load(encoder)?;
    let frames = frames.view()?;
    Ok(PyArray1::from_vec(py, enter(py, |stop| load.values_of_frames(frames, stop))?))
}

/// Encodes a whole recording of events.
#[pyfunction]
pub fn encode_events<'py>(py: Python<'py>, encoder: &str, events: EventsIn<'py>) -> PyResult<SpikesOut<'py>> {
    let encoder = Encoder::from_json(encoder).map_err(core)?;
    let events = events.view()?;
    let trains = enter(py, |stop| encoder.encode_events(events, stop))?;
    Ok(from_spikes(py, trains))
}

/// Encodes a whole recording of frames.
#[pyfunction]
pub fn encode_frames<'py>(py: Python<'py>, encoder: &str, frames: FramesIn<'py>) -> PyResult<SpikesOut<'py>> {
    let encoder = Encoder::from_json(encoder).map_err(core)?;
    let frames = frames.view()?;
    let trains = enter(py, |stop| encoder.encode_frames(frames, stop))?;
    Ok(from_spikes(py, trains))
}

/// An encoder at work.
#[pyclass(frozen)]
pub struct EncoderStream(Exclusive<Pieces>);

#[pymethods]
impl EncoderStream {
    #[new]
    fn new(encoder: &str, array: ArrayIn) -> PyResult<Self> {
        let encoder = Encoder::from_json(encoder).map_err(core)?;
        Ok(Self(Exclusive::new(Pieces::new(&encoder, array.0).map_err(core)?)))
    }

    fn push_events<'py>(&self, py: Python<'py>, events: EventsIn<'py>) -> PyResult<SpikesOut<'py>> {
        let events = events.view()?;
        Ok(from_spikes(py, self.0.enter(py, |pieces, _| pieces.push_events(events))?))
    }

    fn push_frames<'py>(&self, py: Python<'py>, frames: FramesIn<'py>) -> PyResult<SpikesOut<'py>> {
        let frames = frames.view()?;
        Ok(from_spikes(py, self.0.enter(py, |pieces, _| pieces.push_frames(frames))?))
    }

    /// How many events came too far behind the time come to.
    #[getter]
    fn late(&self, py: Python<'_>) -> u64 {
        self.0.with(py, |pieces| pieces.late())
    }

    fn advance<'py>(&self, py: Python<'py>, t: i64) -> PyResult<SpikesOut<'py>> {
        Ok(from_spikes(py, self.0.enter(py, |pieces, _| pieces.advance(t))?))
    }

    fn finish<'py>(&self, py: Python<'py>) -> PyResult<SpikesOut<'py>> {
        Ok(from_spikes(py, self.0.enter(py, |pieces, _| pieces.finish())?))
    }
}

/// Takes a tare from events, as JSON; times in us.
#[pyfunction]
pub fn tare_of_events(
    py: Python<'_>,
    events: EventsIn<'_>,
    start: Option<i64>,
    stop: Option<i64>,
    note: &str,
) -> PyResult<String> {
    let events = events.view()?;
    Ok(enter(py, |_| Tare::of_events(events, start, stop, note))?.to_json())
}

/// Takes a tare from frames, as JSON; times in us.
#[pyfunction]
pub fn tare_of_frames(
    py: Python<'_>,
    frames: FramesIn<'_>,
    start: Option<i64>,
    stop: Option<i64>,
    note: &str,
) -> PyResult<String> {
    let frames = frames.view()?;
    Ok(enter(py, |_| Tare::of_frames(frames, start, stop, note))?.to_json())
}

/// Checks a tare; gives it back as the compiled part writes it.
#[pyfunction]
pub fn check_tare(tare: &str) -> PyResult<String> {
    Ok(Tare::from_json(tare).map_err(core)?.to_json())
}
