//! NumPy in and out: type, shape and order checked once.
//!
//! Contiguous arrays of the right type are read in place, under a borrow that is held for the whole call; the Python
//! side makes them so (`numpy.ascontiguousarray`) before it calls.

use numpy::{Element, IntoPyArray, PyArray1, PyReadonlyArray1, PyReadwriteArray1};
use pyo3::Borrowed;
use pyo3::prelude::*;
use taxel_core::array::{Pitch, PlaceUnit, Places};
use taxel_core::wire::Columns;
use taxel_core::{Array, Events, EventsView, FramesView, IntensitiesView, Marker, SpikeKind, SpikeTrains};

use crate::errors::{ProblemError, core};

/// The entries of a one-dimensional array, in place.
pub fn slice<'a, T: Element>(name: &str, array: &'a PyReadonlyArray1<'_, T>) -> PyResult<&'a [T]> {
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

/// An array's geometry as Python hands it over: rows, columns, pitch in mm (rows, columns), name, which exist, places,
/// names of the taxels.
pub type ArrayParts =
    (u16, u16, Option<(f64, f64)>, String, Option<Vec<bool>>, Option<PlacesParts>, Option<Vec<String>>);

/// Places by taxel: x, y, areas, whether they are in mm.
type PlacesParts = (Vec<f64>, Vec<f64>, Option<Vec<f64>>, bool);

/// An array's geometry, checked.
///
/// # Errors
///
/// A `ProblemError` for a geometry that makes no sense.
pub fn to_array((rows, columns, pitch_mm, name, exists, places, names): ArrayParts) -> PyResult<Array> {
    let pitch_mm = pitch_mm.map(|(rows, columns)| Pitch { rows, columns });
    let places = places.map(|(x, y, area, mm)| Places { x, y, area, unit: mm.then_some(PlaceUnit::Mm) });
    let array = Array { rows, columns, pitch_mm, name, exists, places, names };
    array.check().map_err(core)?;
    Ok(array)
}

/// The geometry as Python gets it.
#[must_use]
pub fn from_array(array: &Array) -> ArrayParts {
    let Array { rows, columns, pitch_mm, name, exists, places, names } = array.clone();
    let places = places.map(|Places { x, y, area, unit }| (x, y, area, unit.is_some()));
    (rows, columns, pitch_mm.map(|pitch| (pitch.rows, pitch.columns)), name, exists, places, names)
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

/// Events whose columns stay where Python has them, as (array, t, x, y, p, intensity with present, repaired, markers).
pub struct EventsIn<'py> {
    array: Array,
    t: PyReadonlyArray1<'py, i64>,
    x: PyReadonlyArray1<'py, u16>,
    y: PyReadonlyArray1<'py, u16>,
    p: PyReadonlyArray1<'py, bool>,
    intensity: Option<(PyReadonlyArray1<'py, u16>, PyReadonlyArray1<'py, bool>)>,
    repaired: Option<PyReadonlyArray1<'py, bool>>,
    markers: Vec<Marker>,
}

impl<'py> FromPyObject<'_, 'py> for EventsIn<'py> {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let (parts, t, x, y, p, intensity, repaired, markers) = object.extract()?;
        let marker = |(t, start): (i64, bool)| Marker { t, start };
        let markers = Vec::into_iter(markers).map(marker).collect();
        Ok(Self { array: to_array(parts)?, t, x, y, p, intensity, repaired, markers })
    }
}

impl EventsIn<'_> {
    /// The columns in place, to be read without the GIL; who reads them checks them.
    pub fn view(&self) -> PyResult<EventsView<'_>> {
        Ok(EventsView {
            array: &self.array,
            t: slice("t", &self.t)?,
            x: slice("x", &self.x)?,
            y: slice("y", &self.y)?,
            p: slice("p", &self.p)?,
            intensity: match &self.intensity {
                None => None,
                Some((ticks, present)) => {
                    Some(IntensitiesView { ticks: slice("intensity", ticks)?, present: slice("present", present)? })
                }
            },
            repaired: self.repaired.as_ref().map(|column| slice("repaired", column)).transpose()?,
            markers: &self.markers,
        })
    }
}

/// Columns for a decoder to fill, as Python lays them out: t, x, y, ticks, and p, present as bytes.
pub type ColumnsIn<'py> = (
    PyReadwriteArray1<'py, i64>,
    PyReadwriteArray1<'py, u16>,
    PyReadwriteArray1<'py, u16>,
    PyReadwriteArray1<'py, u16>,
    PyReadwriteArray1<'py, u8>,
    PyReadwriteArray1<'py, u8>,
);

/// The columns in place, to be filled without the GIL.
pub fn to_columns<'a>((t, x, y, ticks, p, present): &'a mut ColumnsIn<'_>) -> PyResult<Columns<'a>> {
    fn open<'a, T: Element>(column: &'a mut PyReadwriteArray1<'_, T>) -> PyResult<&'a mut [T]> {
        column.as_slice_mut().map_err(|_| ProblemError::new_err("columns must be contiguous"))
    }
    Columns::new(open(t)?, [open(x)?, open(y)?, open(ticks)?], [open(p)?, open(present)?]).map_err(core)
}

/// Frames whose values stay where Python has them, as (array, t, values one frame after the other).
pub struct FramesIn<'py> {
    array: Array,
    t: PyReadonlyArray1<'py, i64>,
    values: PyReadonlyArray1<'py, f32>,
}

impl<'py> FromPyObject<'_, 'py> for FramesIn<'py> {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let (parts, t, values) = object.extract()?;
        Ok(Self { array: to_array(parts)?, t, values })
    }
}

impl FramesIn<'_> {
    /// As [`EventsIn::view`].
    pub fn view(&self) -> PyResult<FramesView<'_>> {
        Ok(FramesView { array: &self.array, t: slice("t", &self.t)?, values: slice("values", &self.values)? })
    }
}

/// Events as Python gets them: the same parts, as new arrays.
pub type EventsOut<'py> = (
    ArrayParts,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<u16>>,
    Bound<'py, PyArray1<u16>>,
    Bound<'py, PyArray1<bool>>,
    Option<(Bound<'py, PyArray1<u16>>, Bound<'py, PyArray1<bool>>)>,
    Option<Bound<'py, PyArray1<bool>>>,
    Vec<(i64, bool)>,
);

/// Events as Python gets them.
#[must_use]
pub fn from_events(py: Python<'_>, events: Events) -> EventsOut<'_> {
    (
        from_array(&events.array),
        array(py, events.t),
        array(py, events.x),
        array(py, events.y),
        array(py, events.p),
        events.intensity.map(|i| (array(py, i.ticks), array(py, i.present))),
        events.repaired.map(|column| array(py, column)),
        events.markers.iter().map(|m| (m.t, m.start)).collect(),
    )
}

/// Spike trains as Python passes them: times, offsets, values, kind, start, stop; ms.
pub type SpikesParts<'py> =
    (PyReadonlyArray1<'py, f64>, PyReadonlyArray1<'py, i64>, Option<PyReadonlyArray1<'py, f32>>, String, f64, f64);

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
        let (times, offsets, values, kind, start, stop): SpikesParts<'_> = object.extract()?;
        let offsets = to_offsets(&offsets)?;
        let times = slice("times", &times)?;
        let values = (SpikeKind::named(&kind).map_err(core)?, values.as_ref().map(|v| slice("values", v)).transpose()?);
        SpikeTrains::copy_of(times, offsets, values, (start, stop)).map_err(core).map(Self)
    }
}

/// The trains of patterns.
pub fn to_patterns(patterns: Vec<SpikesIn>) -> Vec<SpikeTrains> {
    patterns.into_iter().map(|SpikesIn(pattern)| pattern).collect()
}

/// Spike trains as Python gets them: the same parts, as new arrays.
pub type SpikesOut<'py> =
    (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<i64>>, Option<Bound<'py, PyArray1<f32>>>, &'static str, f64, f64);

/// Spike trains as Python gets them.
#[must_use]
pub fn from_spikes(py: Python<'_>, trains: SpikeTrains) -> SpikesOut<'_> {
    let offsets = trains.offsets.iter().map(|&o| i64::try_from(o).unwrap_or(i64::MAX)).collect();
    let SpikeTrains { times, kind, values, start, stop, .. } = trains;
    (array(py, times), array(py, offsets), values.map(|v| array(py, v)), kind.name(), start, stop)
}
