//! Version 2 of the wire.

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use taxel_core::wire::v2::{Decoder, Heard, StreamReader};
use taxel_core::{Error, Events};

use crate::convert::{ArrayParts, EventsOut, array, from_events, slice, to_array};
use crate::enter::{Shared, enter};
use crate::parameters::to_json;

/// Events, and of the last datagram: until when nothing comes any more, and whether it was decoded.
type HeardOut<'py> = (EventsOut<'py>, Option<i64>, bool);

/// Turns one board's datagrams into events.
#[pyclass(frozen, module = "taxel._core")]
struct DatagramDecoder(Shared<Decoder>);

#[pymethods]
impl DatagramDecoder {
    #[new]
    fn new(array: ArrayParts) -> PyResult<Self> {
        Ok(Self(Shared::new(Decoder::new(to_array(array)?))))
    }

    /// Takes a datagram.
    fn push<'py>(
        &self,
        py: Python<'py>,
        datagram: PyReadonlyArray1<'_, u8>,
        arrived: Option<i64>,
    ) -> PyResult<HeardOut<'py>> {
        let bytes = slice("datagram", &datagram)?;
        let (events, heard) = self.0.enter(py, |decoder, _| {
            let mut events = Events::empty(decoder.array().clone());
            let heard = decoder.push(bytes, arrived, &mut events);
            Ok::<_, Error>((events, heard))
        })?;
        let (until, intact) = match heard {
            Heard::Intact { until, .. } => (until, true),
            Heard::Repeated | Heard::Refused(_) => (None, false),
        };
        Ok((from_events(py, events), until, intact))
    }

    /// The counts as JSON.
    fn counts(&self, py: Python<'_>) -> PyResult<String> {
        to_json(&self.0.look(py, |decoder| decoder.counts()))
    }

    /// What the board last said of itself, as JSON.
    fn status(&self, py: Python<'_>) -> PyResult<Option<String>> {
        self.0.look(py, |decoder| decoder.status().copied()).map(|status| to_json(&status)).transpose()
    }

    /// What each taxel holds, -1 where nothing was heard of it.
    fn held<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i32>> {
        let held = |decoder: &mut Decoder| decoder.held().iter().map(|held| held.map_or(-1, i32::from)).collect();
        array(py, self.0.look(py, held))
    }
}

/// Decodes a whole stream of datagrams, each behind its length; events, counts as JSON, bytes that belonged to none.
#[pyfunction]
fn decode_datagrams<'py>(
    py: Python<'py>,
    data: PyReadonlyArray1<'_, u8>,
    sensor: ArrayParts,
) -> PyResult<(EventsOut<'py>, String, u64)> {
    /// Bytes between two looks at Ctrl-C: some milliseconds of work.
    const PIECE: usize = 1 << 20;
    let (bytes, sensor) = (slice("data", &data)?, to_array(sensor)?);
    let (events, counts, skipped) = enter(py, |stop| {
        let (mut reader, mut decoder) = (StreamReader::default(), Decoder::new(sensor.clone()));
        let mut events = Events::empty(sensor);
        for piece in bytes.chunks(PIECE) {
            stop.check()?;
            reader.push(piece, |_, header, body| {
                decoder.push_read(header, body, None, &mut events);
            });
        }
        reader.finish();
        Ok::<_, Error>((events, decoder.counts(), reader.skipped()))
    })?;
    Ok((from_events(py, events), to_json(&counts)?, skipped))
}

/// Cuts a stream into datagrams.
#[pyclass(frozen, module = "taxel._core")]
struct DatagramStream(Shared<StreamReader>);

#[pymethods]
impl DatagramStream {
    #[new]
    fn new() -> Self {
        Self(Shared::new(StreamReader::default()))
    }

    /// Takes bytes; returns the datagrams that they complete.
    fn push<'py>(&self, py: Python<'py>, data: PyReadonlyArray1<'_, u8>) -> PyResult<Vec<Bound<'py, PyBytes>>> {
        let (bytes, mut found) = (slice("data", &data)?, vec![]);
        let found = self.0.enter(py, |reader, _| {
            reader.push(bytes, |datagram, _, _| found.push(datagram.to_vec()));
            Ok::<_, Error>(found)
        })?;
        Ok(found.iter().map(|datagram| PyBytes::new(py, datagram)).collect())
    }

    /// Bytes that belonged to no datagram.
    fn skipped(&self, py: Python<'_>) -> u64 {
        self.0.look(py, |reader| reader.skipped())
    }
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<DatagramDecoder>()?;
    module.add_class::<DatagramStream>()?;
    module.add_function(wrap_pyfunction!(decode_datagrams, module)?)
}
