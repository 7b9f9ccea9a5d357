//! Version 2 of the wire.

use std::sync::Mutex;

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use taxel_core::wire::v2::{Decoder, Heard, StreamReader};
use taxel_core::{Error, Events};

use crate::convert::{ArrayParts, EventsOut, array, from_events, slice, to_array};
use crate::enter::enter;
use crate::errors::ProblemError;

/// Events, whether each was repaired, and of the last datagram: until when nothing comes any more, and whether it was decoded.
type HeardOut<'py> = (EventsOut<'py>, Bound<'py, PyArray1<bool>>, Option<i64>, bool);

/// Turns one board's datagrams into events.
#[pyclass(frozen, module = "taxel._core")]
struct DatagramDecoder(Mutex<Decoder>);

impl DatagramDecoder {
    fn with<T>(&self, work: impl FnOnce(&mut Decoder) -> T) -> PyResult<T> {
        let mut decoder =
            self.0.lock().map_err(|_| ProblemError::new_err("this decoder failed before: make a new one"))?;
        Ok(work(&mut decoder))
    }
}

#[pymethods]
impl DatagramDecoder {
    #[new]
    fn new(array: ArrayParts) -> PyResult<Self> {
        Ok(Self(Mutex::new(Decoder::new(to_array(array)?))))
    }

    /// Takes a datagram.
    fn push<'py>(
        &self,
        py: Python<'py>,
        datagram: PyReadonlyArray1<'_, u8>,
        arrived: Option<i64>,
    ) -> PyResult<HeardOut<'py>> {
        let bytes = slice("datagram", &datagram)?;
        let (events, repaired, heard) = enter(py, |_| {
            let mut decoder = self.0.lock().map_err(|_| Error::Problem("this decoder failed before".to_owned()))?;
            let (mut events, mut repaired) = (Events::empty(decoder.array().clone()), vec![]);
            let heard = decoder.push(bytes, arrived, &mut events, &mut repaired);
            Ok::<_, Error>((events, repaired, heard))
        })?;
        let (until, intact) = match heard {
            Heard::Intact { until, .. } => (until, true),
            Heard::Repeated | Heard::Refused(_) => (None, false),
        };
        Ok((from_events(py, events), array(py, repaired), until, intact))
    }

    /// The counts as JSON.
    fn counts(&self) -> PyResult<String> {
        let counts = self.with(|decoder| decoder.counts())?;
        serde_json::to_string(&counts).map_err(|error| ProblemError::new_err(error.to_string()))
    }

    /// What the board last said of itself, as JSON.
    fn status(&self) -> PyResult<Option<String>> {
        let status = self.with(|decoder| decoder.status().copied())?;
        let said = status.map(|status| serde_json::to_string(&status)).transpose();
        said.map_err(|error| ProblemError::new_err(error.to_string()))
    }

    /// What each taxel holds, -1 where nothing was heard of it.
    fn held<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<i32>>> {
        let held = self.with(|decoder| decoder.held().iter().map(|held| held.map_or(-1, i32::from)).collect())?;
        Ok(array(py, held))
    }
}

/// Cuts a stream into datagrams.
#[pyclass(frozen, module = "taxel._core")]
struct DatagramStream(Mutex<StreamReader>);

#[pymethods]
impl DatagramStream {
    #[new]
    fn new() -> Self {
        Self(Mutex::new(StreamReader::default()))
    }

    /// Takes bytes; returns the datagrams that they complete.
    fn push<'py>(&self, py: Python<'py>, data: PyReadonlyArray1<'_, u8>) -> PyResult<Vec<Bound<'py, PyBytes>>> {
        let bytes = slice("data", &data)?;
        let found = enter(py, |_| {
            let mut reader = self.0.lock().map_err(|_| Error::Problem("this stream failed before".to_owned()))?;
            let mut found = vec![];
            reader.push(bytes, |datagram| found.push(datagram.to_vec()));
            Ok::<_, Error>(found)
        })?;
        Ok(found.iter().map(|datagram| PyBytes::new(py, datagram)).collect())
    }

    /// Bytes that belonged to no datagram.
    fn skipped(&self) -> PyResult<u64> {
        Ok(self.0.lock().map_err(|_| ProblemError::new_err("this stream failed before"))?.skipped())
    }
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<DatagramDecoder>()?;
    module.add_class::<DatagramStream>()
}
