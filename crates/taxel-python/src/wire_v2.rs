//! Streams of version 2 of the wire: datagrams, each behind its length.

use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use taxel_core::Error;
use taxel_core::wire::v2::{self, StreamReader};

use taxel_border::convert::{ArrayIn, Column, ColumnsIn, EventsIn, FilledOut, column, from_columns, slice, to_columns};
use taxel_border::enter::{Exclusive, enter};

/// Decodes a whole stream of datagrams, each behind its length, into columns.
#[pyfunction]
pub fn decode_datagrams<'py>(
    py: Python<'py>,
    data: PyReadonlyArray1<'_, u8>,
    sensor: ArrayIn,
    mut columns: ColumnsIn<'_>,
) -> PyResult<FilledOut<'py>> {
    let (bytes, mut columns) = (slice("data", &data)?, to_columns(&mut columns)?);
    enter(py, |stop| v2::decode(bytes, sensor.0, &mut columns, stop))?;
    Ok(from_columns(py, &columns))
}

/// Whether bytes begin with a datagram of version 2, with or without its length.
#[pyfunction]
pub fn is_version_2(data: PyReadonlyArray1<'_, u8>) -> PyResult<bool> {
    Ok(v2::begins(slice("data", &data)?))
}

/// Events as datagrams.
#[pyclass(frozen, get_all, module = "taxel._core")]
pub struct EncodedDatagrams {
    /// What is added to times.
    origin_us: i64,
    /// Where each datagram begins, and the last ends.
    offsets: Column<i64>,
    payload: Column<u8>,
    /// A time of each datagram, us.
    times: Column<i64>,
    /// The numbers of events whose mark as repaired could not be written.
    unmarked: Column<i64>,
}

/// Writes events as datagrams; `held` is what the taxels hold at first, by index.
#[pyfunction]
pub fn encode_datagrams<'py>(
    py: Python<'py>,
    events: EventsIn<'py>,
    held: Option<PyReadonlyArray1<'py, u16>>,
    promised: bool,
) -> PyResult<EncodedDatagrams> {
    let events = events.view()?;
    let held = held.as_ref().map(|held| slice("held", held)).transpose()?;
    let encoded = enter(py, |_| v2::encode(events, held, promised))?;
    Ok(EncodedDatagrams {
        origin_us: encoded.origin_us,
        offsets: column(py, encoded.offsets),
        payload: column(py, encoded.bytes),
        times: column(py, encoded.times),
        unmarked: column(py, encoded.unmarked),
    })
}

/// Cuts a stream into datagrams.
#[pyclass(frozen, module = "taxel._core")]
pub struct DatagramStream(Exclusive<StreamReader>);

#[pymethods]
impl DatagramStream {
    #[new]
    fn new() -> Self {
        Self(Exclusive::new(StreamReader::default()))
    }

    /// Takes bytes; returns the datagrams that they complete.
    fn push(&self, py: Python<'_>, data: PyReadonlyArray1<'_, u8>) -> PyResult<Vec<Vec<u8>>> {
        let (bytes, mut found) = (slice("data", &data)?, vec![]);
        self.0.enter(py, |reader, _| {
            reader.push(bytes, |datagram| found.push(datagram.to_vec()));
            Ok::<_, Error>(found)
        })
    }

    /// Ends the stream; returns the datagrams within what waited for more.
    fn finish(&self, py: Python<'_>) -> PyResult<Vec<Vec<u8>>> {
        let mut found = vec![];
        self.0.enter(py, |reader, _| {
            reader.finish(|datagram| found.push(datagram.to_vec()));
            Ok::<_, Error>(found)
        })
    }

    /// Bytes that belonged to no datagram.
    fn skipped(&self, py: Python<'_>) -> u64 {
        self.0.with(py, |reader| reader.skipped())
    }
}
