//! Copies for other computers out of a pipeline, and their parcels into one.

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use taxel_core::problem;
use taxel_live::capture::{self, Receiver, ReceiverOptions};
use taxel_live::host_clock::RoundTrip;
use taxel_live::pipeline::{Copied, Copies as PipelineCopies};

use taxel_border::enter::{Exclusive, enter};
use taxel_border::errors::ProblemError;

/// The entrance for parcels of another computer.
#[pyclass(frozen)]
pub struct ParcelFeed {
    feed: capture::ParcelFeed,
    /// `None` once a pipeline has it.
    receiver: Mutex<Option<Receiver>>,
}

impl ParcelFeed {
    /// The pipeline's end; it can be had once.
    pub(crate) fn receiver(&self) -> taxel_live::Result<Receiver> {
        let taken = self.receiver.lock().unwrap_or_else(PoisonError::into_inner).take();
        taken.ok_or_else(|| problem!("feed: a pipeline already receives from this feed").into())
    }
}

#[pymethods]
impl ParcelFeed {
    /// A feed from `place`; so many bytes may wait for the decoder.
    #[new]
    fn new(place: &str, queue_bytes: usize) -> Self {
        let (receiver, feed) = Receiver::fed(place, ReceiverOptions { queue_bytes, ..ReceiverOptions::default() });
        Self { feed, receiver: Mutex::new(Some(receiver)) }
    }

    /// Takes a parcel; False where it begins a session and `begin_session` has to come first.
    fn take(&self, py: Python<'_>, parcel: Vec<u8>) -> bool {
        py.detach(|| self.feed.push(&parcel))
    }

    /// A session begins.
    fn begin_session(&self) {
        self.feed.begin_session();
    }

    /// Adds a round trip to the other computer's clock: four times, ns since 1970.
    fn compare(&self, asked: i64, came: i64, answered: i64, back: i64) {
        self.feed.compare(RoundTrip { asked, came, answered, back });
    }

    /// Ends the pipeline because of an error.
    fn fail(&self, reason: &str) {
        self.feed.fail(reason);
    }

    /// Whether the pipeline has ended.
    fn is_over(&self) -> bool {
        self.feed.is_over()
    }
}

/// The receiving end of a pipeline's copies.
#[pyclass(frozen)]
pub struct Copies(Exclusive<PipelineCopies>);

impl Copies {
    pub(crate) fn new(copies: PipelineCopies) -> Self {
        Self(Exclusive::new(copies))
    }
}

#[pymethods]
impl Copies {
    /// The next: "parcel", "frame" or "detection", and its bytes; None after `timeout` s without one.
    fn next<'py>(&self, py: Python<'py>, timeout: f64) -> PyResult<Option<(&'static str, Bound<'py, PyBytes>)>> {
        let timeout = Duration::try_from_secs_f64(timeout)
            .map_err(|_| ProblemError::new_err(format!("timeout is {timeout} s: must be 0 or more")))?;
        let copied = enter(py, |_| Ok::<_, taxel_live::Error>(self.0.lock().next(timeout)))?;
        Ok(copied.map(|copied| match copied {
            Copied::Parcel(bytes) => ("parcel", PyBytes::new(py, &bytes)),
            Copied::Frame(bytes) => ("frame", PyBytes::new(py, &bytes)),
            Copied::Detection(bytes) => ("detection", PyBytes::new(py, &bytes)),
        }))
    }

    /// Whether the pipeline has ended and every copy was taken.
    fn is_over(&self, py: Python<'_>) -> bool {
        self.0.with(py, |copies| copies.is_over())
    }
}
