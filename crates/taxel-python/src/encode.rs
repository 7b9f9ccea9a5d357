//! Encoders and the tare for Python; parameters cross as JSON.

use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use taxel_core::encode::{Encoder, Stream, Tare, TareBuilder};
use taxel_core::{Array, Error, Spike, SpikeTrains, problem};

use crate::convert::{ArrayParts, EventsIn, SpikesOut, from_spikes, slice, to_array, to_events};
use crate::enter::{Shared, enter};
use crate::errors::core;

/// Checks an encoder; gives it back with every default filled in.
#[pyfunction]
fn check_encoder(encoder: &str) -> PyResult<String> {
    Ok(Encoder::from_json(encoder).map_err(core)?.to_json())
}

/// The names of all encoders.
#[pyfunction]
fn encoder_names() -> Vec<&'static str> {
    taxel_core::encode::NAMES.to_vec()
}

/// Trains for an array, whether they are signed, and the latency in ms.
#[pyfunction]
fn encoder_about(encoder: &str, array: ArrayParts) -> PyResult<(usize, bool, f64)> {
    let (encoder, array) = (Encoder::from_json(encoder).map_err(core)?, to_array(array)?);
    Ok((encoder.trains(&array), encoder.signed(), encoder.latency_ms()))
}

/// Encodes a whole recording of events.
#[pyfunction]
fn encode_events<'py>(py: Python<'py>, encoder: &str, events: EventsIn<'py>) -> PyResult<SpikesOut<'py>> {
    let (encoder, events) = (Encoder::from_json(encoder).map_err(core)?, to_events(events)?);
    let trains = enter(py, |stop| encoder.encode_events(&events, stop))?;
    Ok(from_spikes(py, trains))
}

/// Encodes pictures, one after the other in `values`, at `t` us.
#[pyfunction]
fn encode_frames<'py>(
    py: Python<'py>,
    encoder: &str,
    array: ArrayParts,
    t: PyReadonlyArray1<'py, i64>,
    values: PyReadonlyArray1<'py, f32>,
) -> PyResult<SpikesOut<'py>> {
    let (encoder, array) = (Encoder::from_json(encoder).map_err(core)?, to_array(array)?);
    let (t, values) = pictures(&array, &t, &values)?;
    let trains = enter(py, |stop| encoder.encode_pictures(&array, t, values, stop))?;
    Ok(from_spikes(py, trains))
}

fn pictures<'a>(
    array: &Array,
    t: &'a PyReadonlyArray1<'_, i64>,
    values: &'a PyReadonlyArray1<'_, f32>,
) -> PyResult<(&'a [i64], &'a [f32])> {
    let (t, values) = (slice("t", t)?, slice("values", values)?);
    if values.len() != t.len() * array.len() {
        let (n, taxels) = (t.len(), array.len());
        return Err(core(problem!("frames: {} values for {n} pictures of {taxels} taxels", values.len())));
    }
    Ok((t, values))
}

/// An encoder at work.
#[pyclass(frozen)]
struct EncoderStream {
    array: Array,
    at_work: Shared<AtWork>,
}

struct AtWork {
    stream: Box<dyn Stream>,
    /// Up to where spikes were handed on, ms.
    known: Option<f64>,
}

impl AtWork {
    /// What came out, with the window from where the last piece ended to `until` us.
    fn piece(&mut self, out: &[Spike], first: Option<i64>, until: Option<f64>) -> Result<SpikeTrains, Error> {
        let start = self.known.or(first.map(|t| t as f64 / 1000.0)).unwrap_or(0.0);
        let stop = until.map_or(start, |until| until.max(start));
        if first.is_some() || self.known.is_some() {
            self.known = Some(stop);
        }
        let earliest = out.first().map_or(start, |s| s.t.min(start));
        SpikeTrains::from_spikes(out, self.stream.trains(), self.stream.signed(), earliest, stop)
    }
}

#[pymethods]
impl EncoderStream {
    #[new]
    fn new(encoder: &str, array: ArrayParts) -> PyResult<Self> {
        let (encoder, array) = (Encoder::from_json(encoder).map_err(core)?, to_array(array)?);
        let stream = encoder.stream(&array).map_err(core)?;
        Ok(Self { array, at_work: Shared::new(AtWork { stream, known: None }) })
    }

    fn push_events<'py>(&self, py: Python<'py>, events: EventsIn<'py>) -> PyResult<SpikesOut<'py>> {
        let events = to_events(events)?;
        let trains = self.at_work.enter(py, |at_work, _| {
            let mut out = vec![];
            at_work.stream.push_events(&events, &mut out)?;
            let latest = events.t.iter().max().map(|&t| t as f64 / 1000.0);
            at_work.piece(&out, events.t.first().copied(), latest)
        })?;
        Ok(from_spikes(py, trains))
    }

    fn push_frames<'py>(
        &self,
        py: Python<'py>,
        array: ArrayParts,
        t: PyReadonlyArray1<'py, i64>,
        values: PyReadonlyArray1<'py, f32>,
    ) -> PyResult<SpikesOut<'py>> {
        let given = to_array(array)?;
        if (given.rows, given.columns) != (self.array.rows, self.array.columns) {
            let (rows, columns) = (self.array.rows, self.array.columns);
            return Err(core(problem!(
                "frames of {} x {} taxels: the encoder was begun for {rows} x {columns}",
                given.rows,
                given.columns
            )));
        }
        let (t, values) = pictures(&given, &t, &values)?;
        let trains = self.at_work.enter(py, |at_work, _| {
            let mut out = vec![];
            for (&t, picture) in t.iter().zip(values.chunks_exact(given.len())) {
                at_work.stream.push_frame(t, picture, &mut out)?;
            }
            at_work.piece(&out, t.first().copied(), t.last().map(|&t| t as f64 / 1000.0))
        })?;
        Ok(from_spikes(py, trains))
    }

    /// How many events came too far behind the time come to.
    #[getter]
    fn late(&self, py: Python<'_>) -> u64 {
        self.at_work.look(py, |at_work| at_work.stream.late())
    }

    fn advance<'py>(&self, py: Python<'py>, t: i64) -> PyResult<SpikesOut<'py>> {
        let trains = self.at_work.enter(py, |at_work, _| {
            let mut out = vec![];
            at_work.stream.advance(t, &mut out);
            at_work.piece(&out, None, Some(t as f64 / 1000.0))
        })?;
        Ok(from_spikes(py, trains))
    }

    fn finish<'py>(&self, py: Python<'py>) -> PyResult<SpikesOut<'py>> {
        let trains = self.at_work.enter(py, |at_work, _| {
            let mut out = vec![];
            let end = at_work.stream.finish(&mut out);
            at_work.piece(&out, None, end)
        })?;
        Ok(from_spikes(py, trains))
    }
}

/// Takes a tare from events, as JSON; times in us.
#[pyfunction]
fn tare_of_events(
    py: Python<'_>,
    events: EventsIn<'_>,
    start: Option<i64>,
    stop: Option<i64>,
    note: &str,
) -> PyResult<String> {
    let events = to_events(events)?;
    enter(py, |_| {
        events.check_order()?;
        let stop = stop.or(events.t.iter().max().copied());
        let kept = events.t.iter().position(|&t| stop.is_some_and(|stop| t >= stop)).unwrap_or(events.len());
        let mut tare = TareBuilder::new(&events.array, start);
        tare.push_events(&events.piece(0..kept))?;
        Ok::<_, Error>(tare.finish(stop.unwrap_or_default(), note)?.to_json())
    })
}

/// Takes a tare from pictures, one after the other in `values`, as JSON; times in us.
#[pyfunction]
fn tare_of_frames(
    py: Python<'_>,
    array: ArrayParts,
    t: PyReadonlyArray1<'_, i64>,
    values: PyReadonlyArray1<'_, f32>,
    start: Option<i64>,
    stop: Option<i64>,
    note: &str,
) -> PyResult<String> {
    let array = to_array(array)?;
    let (t, values) = pictures(&array, &t, &values)?;
    enter(py, |_| {
        let stop = stop.or(t.last().copied());
        let mut tare = TareBuilder::new(&array, start);
        for (&t, picture) in t.iter().zip(values.chunks_exact(array.len())) {
            if stop.is_some_and(|stop| t < stop) {
                tare.push_frame(t, picture)?;
            }
        }
        Ok::<_, Error>(tare.finish(stop.unwrap_or_default(), note)?.to_json())
    })
}

/// Checks a tare; gives it back as the compiled part writes it.
#[pyfunction]
fn check_tare(tare: &str) -> PyResult<String> {
    Ok(Tare::from_json(tare).map_err(core)?.to_json())
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<EncoderStream>()?;
    module.add_function(wrap_pyfunction!(check_encoder, module)?)?;
    module.add_function(wrap_pyfunction!(encoder_names, module)?)?;
    module.add_function(wrap_pyfunction!(encoder_about, module)?)?;
    module.add_function(wrap_pyfunction!(encode_events, module)?)?;
    module.add_function(wrap_pyfunction!(encode_frames, module)?)?;
    module.add_function(wrap_pyfunction!(tare_of_events, module)?)?;
    module.add_function(wrap_pyfunction!(tare_of_frames, module)?)?;
    module.add_function(wrap_pyfunction!(check_tare, module)?)
}
