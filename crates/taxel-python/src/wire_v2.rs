//! Streams of version 2 of the wire: datagrams, each behind its length.

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use taxel_core::Error;
use taxel_core::wire::v2::{self, Decoded, StreamReader};

use crate::convert::{
    ArrayParts, ColumnsIn, EventsIn, FilledOut, array, from_filled, slice, to_array, to_events, to_room,
};
use crate::enter::{Shared, enter};
use crate::parameters::to_json;

/// What was filled; counts as JSON, and how many bytes belonged to no datagram.
type DecodedOut<'py> = (FilledOut<'py>, String, u64);

/// Decodes a whole stream of datagrams, each behind its length, into columns.
#[pyfunction]
fn decode_datagrams<'py>(
    py: Python<'py>,
    data: PyReadonlyArray1<'_, u8>,
    sensor: ArrayParts,
    mut columns: ColumnsIn<'_>,
) -> PyResult<DecodedOut<'py>> {
    let (bytes, sensor, room) = (slice("data", &data)?, to_array(sensor)?, to_room(&mut columns)?);
    let decoded = enter(py, |stop| v2::decode(bytes, sensor, room, stop))?;
    let Decoded { columns, counts, skipped } = decoded;
    Ok((from_filled(py, columns), to_json(&counts)?, skipped))
}

/// What is added to times, where each datagram begins (and the last ends), bytes, a time of each; the numbers of events whose
/// mark as repaired could not be written.
type EncodedOut<'py> =
    (i64, Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<u8>>, Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<i64>>);

/// Writes events as datagrams; `held` is what the taxels hold at first, by index.
#[pyfunction]
fn encode_datagrams<'py>(
    py: Python<'py>,
    events: EventsIn<'py>,
    held: Option<PyReadonlyArray1<'py, u16>>,
    promised: bool,
) -> PyResult<EncodedOut<'py>> {
    let events = to_events(events)?;
    let events = events.view()?;
    let held = held.as_ref().map(|held| slice("held", held)).transpose()?;
    let encoded = enter(py, |_| v2::encode(events, held, promised))?;
    let (offsets, bytes, times) = (encoded.offsets, encoded.bytes, encoded.times);
    Ok((encoded.origin_us, array(py, offsets), array(py, bytes), array(py, times), array(py, encoded.unmarked)))
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
            reader.push(bytes, |datagram| found.push(datagram.to_vec()));
            Ok::<_, Error>(found)
        })?;
        Ok(found.iter().map(|datagram| PyBytes::new(py, datagram)).collect())
    }

    /// Ends the stream; returns the datagrams within what waited for more.
    fn finish<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyBytes>>> {
        let mut found = vec![];
        let found = self.0.enter(py, |reader, _| {
            reader.finish(|datagram| found.push(datagram.to_vec()));
            Ok::<_, Error>(found)
        })?;
        Ok(found.iter().map(|datagram| PyBytes::new(py, datagram)).collect())
    }

    /// Bytes that belonged to no datagram.
    fn skipped(&self, py: Python<'_>) -> u64 {
        self.0.with(py, |reader| reader.skipped())
    }
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<DatagramStream>()?;
    module.add_function(wrap_pyfunction!(encode_datagrams, module)?)?;
    module.add_function(wrap_pyfunction!(decode_datagrams, module)?)
}
