//! The low-rate pictures of a recording.

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use taxel_core::Error;
use taxel_live::recording::EventPreviews;

use taxel_border::convert::{EventsIn, array, slice};
use taxel_border::enter::{Exclusive, enter};

/// The pictures that a recording of events gets, one by one.
#[pyclass(frozen, module = "taxel._core")]
pub struct RecordingPictures(Exclusive<EventPreviews>);

/// Time, us, and ticks by taxel index.
type PictureOut<'py> = (i64, Bound<'py, PyArray1<u16>>);

#[pymethods]
impl RecordingPictures {
    /// `around` are times of interest, us.
    #[new]
    fn new(py: Python<'_>, events: EventsIn<'_>, around: PyReadonlyArray1<'_, i64>) -> PyResult<Self> {
        let around = slice("around", &around)?;
        let events = events.view()?;
        Ok(Self(Exclusive::new(enter(py, |_| EventPreviews::new(events, around))?)))
    }

    fn __iter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __next__<'py>(&self, py: Python<'py>) -> PyResult<Option<PictureOut<'py>>> {
        let picture = |pictures: &mut EventPreviews| pictures.next_preview().map(|(t, held)| (t, held.to_vec()));
        let found = self.0.enter(py, |pictures, _| Ok::<_, Error>(picture(pictures)))?;
        Ok(found.map(|(t, held)| (t, array(py, held))))
    }
}
