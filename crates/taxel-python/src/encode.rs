//! Encoders and the tare for Python; parameters cross as JSON.

use numpy::PyArray1;
use pyo3::prelude::*;
use taxel_core::encode::{Encoder, LocalLoad, Pieces, Tare};

use taxel_core::problem;

use taxel_border::convert::{ArrayIn, SensedIn, SensedView, SpikesOut, from_spikes};
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

/// The quantities of a local load of a whole recording, sample by sample of events, frame by frame of frames.
#[pyfunction]
pub fn local_load_values<'py>(
    py: Python<'py>,
    encoder: &str,
    sensed: SensedIn<'py>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (load, sensed) = (local_load(encoder)?, sensed.view()?);
    let values = enter(py, |stop| match sensed {
        SensedView::Events(events) => load.values_of_events(events, stop),
        SensedView::Frames(frames) => load.values_of_frames(frames, stop),
    })?;
    Ok(PyArray1::from_vec(py, values))
}

/// Encodes a whole recording.
#[pyfunction]
pub fn encode<'py>(py: Python<'py>, encoder: &str, sensed: SensedIn<'py>) -> PyResult<SpikesOut<'py>> {
    let (encoder, sensed) = (Encoder::from_json(encoder).map_err(core)?, sensed.view()?);
    let trains = enter(py, |stop| match sensed {
        SensedView::Events(events) => encoder.encode_events(events, stop),
        SensedView::Frames(frames) => encoder.encode_frames(frames, stop),
    })?;
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

    fn push<'py>(&self, py: Python<'py>, sensed: SensedIn<'py>) -> PyResult<SpikesOut<'py>> {
        let sensed = sensed.view()?;
        let trains = self.0.enter(py, |pieces, _| match sensed {
            SensedView::Events(events) => pieces.push_events(events),
            SensedView::Frames(frames) => pieces.push_frames(frames),
        })?;
        Ok(from_spikes(py, trains))
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

/// Takes a tare, as JSON; times in us.
#[pyfunction]
pub fn take_tare(
    py: Python<'_>,
    sensed: SensedIn<'_>,
    start: Option<i64>,
    stop: Option<i64>,
    note: &str,
) -> PyResult<String> {
    let sensed = sensed.view()?;
    let tare = enter(py, |_| match sensed {
        SensedView::Events(events) => Tare::of_events(events, start, stop, note),
        SensedView::Frames(frames) => Tare::of_frames(frames, start, stop, note),
    })?;
    Ok(tare.to_json())
}

/// Checks a tare; gives it back as the compiled part writes it.
#[pyfunction]
pub fn check_tare(tare: &str) -> PyResult<String> {
    Ok(Tare::from_json(tare).map_err(core)?.to_json())
}
