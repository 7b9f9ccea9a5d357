//! NumPy in and out: type, shape and order checked once.
//!
//! Contiguous arrays of the right type are read in place, under a borrow that is held for the whole call; the Python
//! side makes them so (`numpy.ascontiguousarray`) before it calls.

use numpy::ndarray::Dimension;
use numpy::{Element, IntoPyArray, PyArray1, PyReadonlyArray, PyReadonlyArray1, PyReadonlyArrayDyn, PyReadwriteArray1};
use pyo3::Borrowed;
use pyo3::prelude::*;
use pythonize::depythonize;
use taxel_core::wire::Columns;
use taxel_core::{Array, Events, EventsView, FramesView, IntensitiesView, Marker, SpikeKind, SpikeTrains};

use crate::errors::{ProblemError, core};

/// The entries of an array, in place.
pub fn slice<'a, T: Element, D: Dimension>(name: &str, array: &'a PyReadonlyArray<'_, T, D>) -> PyResult<&'a [T]> {
    array.as_slice().map_err(|_| ProblemError::new_err(format!("{name}: must be contiguous")))
}

/// A new array of the entries, without a copy.
pub fn array<T: Element>(py: Python<'_>, values: Vec<T>) -> Bound<'_, PyArray1<T>> {
    values.into_pyarray(py)
}

/// An array that is an attribute of a result.
pub type Column<T> = Py<PyArray1<T>>;

/// As [`array()`], for an attribute of a result.
pub fn column<T: Element>(py: Python<'_>, values: Vec<T>) -> Column<T> {
    array(py, values).unbind()
}

/// The geometry of an `Array` of Python, which has checked it.
pub struct ArrayIn(pub Array);

impl FromPyObject<'_, '_> for ArrayIn {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, '_, PyAny>) -> PyResult<Self> {
        Ok(Self(depythonize(&object.call_method0("_geometry")?)?))
    }
}

/// What was filled of columns, by name.
#[derive(IntoPyObject)]
pub struct FilledOut<'py> {
    rows: usize,
    /// Whether ticks were filled.
    paired: bool,
    /// Which rows states gave; none where no row is of that kind.
    repaired: Option<Bound<'py, PyArray1<bool>>>,
    markers: Vec<(i64, bool)>,
}

/// What was filled, as Python gets it.
#[must_use]
pub fn from_columns<'py>(py: Python<'py>, columns: &Columns<'_>) -> FilledOut<'py> {
    let markers = columns.markers.iter().map(|m| (m.t, m.start)).collect();
    let repaired = columns.repaired().map(|column| array(py, column));
    FilledOut { rows: columns.rows, paired: columns.paired, repaired, markers }
}

/// `Events` of Python, whose columns stay where Python has them.
#[derive(FromPyObject)]
pub struct EventsIn<'py> {
    array: ArrayIn,
    t: PyReadonlyArray1<'py, i64>,
    x: PyReadonlyArray1<'py, u16>,
    y: PyReadonlyArray1<'py, u16>,
    p: PyReadonlyArray1<'py, bool>,
    intensity: Option<PyReadonlyArray1<'py, u16>>,
    present: Option<PyReadonlyArray1<'py, bool>>,
    repaired: Option<PyReadonlyArray1<'py, bool>>,
    #[pyo3(from_py_with = to_markers)]
    markers: Vec<Marker>,
}

fn to_markers(markers: &Bound<'_, PyAny>) -> PyResult<Vec<Marker>> {
    Ok(markers.extract::<Vec<_>>()?.into_iter().map(|(t, start)| Marker { t, start }).collect())
}

impl EventsIn<'_> {
    /// The columns in place, to be read without the GIL; who reads them checks them.
    pub fn view(&self) -> PyResult<EventsView<'_>> {
        let both = self.intensity.as_ref().zip(self.present.as_ref());
        let both = both.map(|(ticks, present)| -> PyResult<_> {
            Ok(IntensitiesView { ticks: slice("intensity", ticks)?, present: slice("present", present)? })
        });
        Ok(EventsView {
            array: &self.array.0,
            t: slice("t", &self.t)?,
            x: slice("x", &self.x)?,
            y: slice("y", &self.y)?,
            p: slice("p", &self.p)?,
            intensity: both.transpose()?,
            repaired: self.repaired.as_ref().map(|column| slice("repaired", column)).transpose()?,
            markers: &self.markers,
        })
    }
}

/// `Columns` of Python for a decoder to fill, p and present as bytes.
#[derive(FromPyObject)]
pub struct ColumnsIn<'py> {
    t: PyReadwriteArray1<'py, i64>,
    x: PyReadwriteArray1<'py, u16>,
    y: PyReadwriteArray1<'py, u16>,
    ticks: PyReadwriteArray1<'py, u16>,
    p: PyReadwriteArray1<'py, u8>,
    present: PyReadwriteArray1<'py, u8>,
}

/// The columns in place, to be filled without the GIL.
pub fn to_columns<'a>(columns: &'a mut ColumnsIn<'_>) -> PyResult<Columns<'a>> {
    fn open<'a, T: Element>(column: &'a mut PyReadwriteArray1<'_, T>) -> PyResult<&'a mut [T]> {
        column.as_slice_mut().map_err(|_| ProblemError::new_err("columns must be contiguous"))
    }
    let ColumnsIn { t, x, y, ticks, p, present } = columns;
    Columns::new(open(t)?, [open(x)?, open(y)?, open(ticks)?], [open(p)?, open(present)?]).map_err(core)
}

/// `Frames` of Python, whose values stay where Python has them.
#[derive(FromPyObject)]
pub struct FramesIn<'py> {
    array: ArrayIn,
    t: PyReadonlyArray1<'py, i64>,
    values: PyReadonlyArrayDyn<'py, f32>,
}

impl FramesIn<'_> {
    /// As [`EventsIn::view`].
    pub fn view(&self) -> PyResult<FramesView<'_>> {
        Ok(FramesView { array: &self.array.0, t: slice("t", &self.t)?, values: slice("values", &self.values)? })
    }
}

/// Events or frames of Python.
#[derive(FromPyObject)]
pub enum SensedIn<'py> {
    /// Events.
    Events(EventsIn<'py>),
    /// Frames.
    Frames(FramesIn<'py>),
}

/// Events or frames in place.
#[derive(Clone, Copy)]
pub enum SensedView<'a> {
    /// Events.
    Events(EventsView<'a>),
    /// Frames.
    Frames(FramesView<'a>),
}

impl SensedIn<'_> {
    /// As [`EventsIn::view`].
    pub fn view(&self) -> PyResult<SensedView<'_>> {
        Ok(match self {
            Self::Events(events) => SensedView::Events(events.view()?),
            Self::Frames(frames) => SensedView::Frames(frames.view()?),
        })
    }
}

/// Events as Python gets them, by name, on an array that it knows.
#[derive(IntoPyObject)]
pub struct EventsOut<'py> {
    t: Bound<'py, PyArray1<i64>>,
    x: Bound<'py, PyArray1<u16>>,
    y: Bound<'py, PyArray1<u16>>,
    p: Bound<'py, PyArray1<bool>>,
    intensity: Option<Bound<'py, PyArray1<u16>>>,
    present: Option<Bound<'py, PyArray1<bool>>>,
    repaired: Option<Bound<'py, PyArray1<bool>>>,
    markers: Vec<(i64, bool)>,
}

/// Events as Python gets them.
#[must_use]
pub fn from_events(py: Python<'_>, events: Events) -> EventsOut<'_> {
    let (intensity, present) = events.intensity.map(|i| (array(py, i.ticks), array(py, i.present))).unzip();
    EventsOut {
        t: array(py, events.t),
        x: array(py, events.x),
        y: array(py, events.y),
        p: array(py, events.p),
        intensity,
        present,
        repaired: events.repaired.map(|column| array(py, column)),
        markers: events.markers.iter().map(|m| (m.t, m.start)).collect(),
    }
}

/// The columns of `SpikeTrains` of Python; ms.
#[derive(FromPyObject)]
pub struct SpikesColumns<'py> {
    times: PyReadonlyArray1<'py, f64>,
    offsets: PyReadonlyArray1<'py, i64>,
    values: Option<PyReadonlyArray1<'py, f32>>,
    kind: String,
    start: f64,
    stop: f64,
}

impl SpikesColumns<'_> {
    /// Reads the columns in place: times, offsets, kind with values, start and stop.
    pub fn read<T>(
        &self,
        work: impl FnOnce(&[f64], Vec<usize>, (SpikeKind, Option<&[f32]>), (f64, f64)) -> PyResult<T>,
    ) -> PyResult<T> {
        let values = self.values.as_ref().map(|values| slice("values", values)).transpose()?;
        let kind = SpikeKind::named(&self.kind).map_err(core)?;
        work(slice("times", &self.times)?, to_offsets(&self.offsets)?, (kind, values), (self.start, self.stop))
    }
}

/// Where trains begin and end.
pub fn to_offsets(offsets: &PyReadonlyArray1<'_, i64>) -> PyResult<Vec<usize>> {
    let below = |o| ProblemError::new_err(format!("offsets: {o} is below 0"));
    slice("offsets", offsets)?.iter().map(|&o| usize::try_from(o).map_err(|_| below(o))).collect()
}

/// Spike trains, copied.
pub struct SpikesIn(pub SpikeTrains);

impl FromPyObject<'_, '_> for SpikesIn {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, '_, PyAny>) -> PyResult<Self> {
        object.extract::<SpikesColumns<'_>>()?.read(|times, offsets, values, window| {
            SpikeTrains::copy_of(times, offsets, values, window).map_err(core).map(Self)
        })
    }
}

/// The trains of patterns.
pub fn to_patterns(patterns: Vec<SpikesIn>) -> Vec<SpikeTrains> {
    patterns.into_iter().map(|SpikesIn(pattern)| pattern).collect()
}

/// The targets of each pattern, ms.
pub fn to_targets(targets: &[PyReadonlyArray1<'_, f64>]) -> PyResult<Vec<Vec<f64>>> {
    targets.iter().map(|t| slice("targets", t).map(<[f64]>::to_vec)).collect()
}

/// Spike trains as Python gets them, by name.
#[derive(IntoPyObject)]
pub struct SpikesOut<'py> {
    times: Bound<'py, PyArray1<f64>>,
    offsets: Bound<'py, PyArray1<i64>>,
    values: Option<Bound<'py, PyArray1<f32>>>,
    kind: &'static str,
    start: f64,
    stop: f64,
}

/// Spike trains as Python gets them.
#[must_use]
pub fn from_spikes(py: Python<'_>, trains: SpikeTrains) -> SpikesOut<'_> {
    let offsets = trains.offsets.iter().map(|&o| i64::try_from(o).unwrap_or(i64::MAX)).collect();
    let SpikeTrains { times, kind, values, start, stop, .. } = trains;
    SpikesOut {
        times: array(py, times),
        offsets: array(py, offsets),
        values: values.map(|v| array(py, v)),
        kind: kind.name(),
        start,
        stop,
    }
}
