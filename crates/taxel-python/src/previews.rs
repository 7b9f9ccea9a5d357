//! The low-rate previews of a recording.

use numpy::PyArray1;
use pyo3::prelude::*;
use taxel_core::Error;
use taxel_live::recording::EventPreviews;

use taxel_border::convert::{EventsIn, array};
use taxel_border::enter::{Exclusive, enter};

/// The previews that a recording of events gets, in order of time.
#[pyclass(frozen, module = "taxel._core")]
pub struct RecordingPreviews(Exclusive<EventPreviews>);

/// Time, us, and ticks by taxel index.
type PreviewOut<'py> = (i64, Bound<'py, PyArray1<u16>>);

#[pymethods]
impl RecordingPreviews {
    #[new]
    fn new(py: Python<'_>, events: EventsIn<'_>) -> PyResult<Self> {
        let events = events.view()?;
        Ok(Self(Exclusive::new(enter(py, |_| EventPreviews::new(events))?)))
    }

    fn __iter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __next__<'py>(&self, py: Python<'py>) -> PyResult<Option<PreviewOut<'py>>> {
        let next = |previews: &mut EventPreviews| previews.next_preview().map(|(t, held)| (t, held.to_vec()));
        let found = self.0.enter(py, |previews, _| Ok::<_, Error>(next(previews)))?;
        Ok(found.map(|(t, held)| (t, array(py, held))))
    }
}
