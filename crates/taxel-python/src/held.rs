//! What taxels hold, and what of it stands above rest, for Python.

use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;
use taxel_core::health::{BIN_US, TouchCounts};
use taxel_core::held::{HeldOverTime, UNKNOWN, as_events};
use taxel_core::rest::{Rest, TrackedRest, Value, preload as preload_of, preload_text, touched_from};
use taxel_core::{Error, problem};

use taxel_border::convert::{ArrayIn, EventsIn, EventsOut, FramesIn, array, from_events, slice};
use taxel_border::enter::{Exclusive, enter};
use taxel_border::errors::core;

/// What chosen taxels of a recording hold at any time; without values, each event is a step of 1 up or down.
#[pyclass(frozen, module = "taxel._core")]
pub struct HeldValues(Exclusive<HeldOverTime<f32>>);

#[pymethods]
impl HeldValues {
    /// `taxels` are indices, all where it is None; `begins` is what they hold before their first event, 0 where it is None.
    #[new]
    fn new(
        py: Python<'_>,
        events: EventsIn<'_>,
        taxels: Option<PyReadonlyArray1<'_, u32>>,
        begins: Option<PyReadonlyArray1<'_, f32>>,
    ) -> PyResult<Self> {
        let events = events.view()?;
        let taxels = taxels.as_ref().map(|taxels| slice("taxels", taxels)).transpose()?;
        let begins = begins.as_ref().map(|begins| slice("begins", begins)).transpose()?;
        let held = enter(py, |_| {
            if events.intensity.is_none() {
                return HeldOverTime::by_steps(events, taxels);
            }
            let n = taxels.map_or(events.array.len(), <[u32]>::len);
            HeldOverTime::new(events, taxels, begins.map_or_else(|| vec![0.0; n], <[f32]>::to_vec))
        })?;
        Ok(Self(Exclusive::new(held)))
    }

    /// The values at times, us, best ascending: one row a time.
    fn at<'py>(&self, py: Python<'py>, times: PyReadonlyArray1<'py, i64>) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let times = slice("times", &times)?;
        let n = self.0.with(py, |held| held.taxels());
        let all = times.len().saturating_mul(n);
        if Vec::<f32>::new().try_reserve_exact(all).is_err() {
            return Err(core(problem!("{} frames of {n} taxels need more memory than is available", times.len())));
        }
        // Memory of NumPy, which asks for large pages.
        let values = PyArray1::zeros(py, all, false);
        let mut filled = values.readwrite();
        let rows = filled.as_slice_mut()?;
        self.0.enter(py, |held, stop| {
            for (k, &t) in times.iter().enumerate() {
                stop.check()?;
                rows[k * n..(k + 1) * n].copy_from_slice(held.at(t));
            }
            Ok::<_, Error>(())
        })?;
        drop(filled);
        Ok(values)
    }
}

/// Events at `t` us that report what the taxels hold (ticks by index, 65 535 where that is unknown).
#[pyfunction]
pub fn held_as_events<'py>(
    py: Python<'py>,
    held: PyReadonlyArray1<'py, u16>,
    t: i64,
    sensor: ArrayIn,
) -> PyResult<EventsOut<'py>> {
    Ok(from_events(py, as_events(slice("held", &held)?, t, &sensor.0)))
}

/// What frames, one after the other in `values`, read above the rest of each taxel, infinite where that is unknown.
#[pyfunction]
pub fn above_rest<'py>(
    py: Python<'py>,
    values: PyReadonlyArray1<'py, f32>,
    rest: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f32>>> {
    let (values, rest) = (slice("values", &values)?, slice("rest", &rest)?);
    let found = enter(py, |_| {
        if rest.is_empty() || !values.len().is_multiple_of(rest.len()) {
            return Err(problem!("{} values for {} taxels: must be whole frames", values.len(), rest.len()));
        }
        let (rest, mut above) = (Rest::measured(rest.to_vec()), vec![]);
        above.reserve(values.len());
        for frame in values.chunks_exact(rest.values().len()) {
            let above_rest = |(taxel, &value): (usize, &f32)| rest.above(taxel, value.into()) as f32;
            above.extend(frame.iter().enumerate().map(above_rest));
        }
        Ok(above)
    })?;
    Ok(array(py, found))
}

/// The rest of frames without a tare: `columns` of the array, its noise floor, the rest of each taxel to begin
/// with (NaN where unknown).
#[pyclass(frozen, name = "TrackedRest", module = "taxel._core")]
pub struct PyTrackedRest(Exclusive<TrackedRest>);

#[pymethods]
impl PyTrackedRest {
    #[new]
    fn new(columns: usize, noise_floor: f64, begins: PyReadonlyArray1<'_, f64>) -> PyResult<Self> {
        let begins = slice("begins", &begins)?.iter().map(|&rest| if rest.is_nan() { f64::NO_REST } else { rest });
        Ok(Self(Exclusive::new(TrackedRest::new(columns, noise_floor, begins.collect()))))
    }

    /// Reads frames at `t` us, one after the other in `values` (NaN where a taxel has none); returns them above the
    /// rest, 0 below it.
    fn above<'py>(
        &self,
        py: Python<'py>,
        t: PyReadonlyArray1<'py, i64>,
        values: PyReadonlyArray1<'py, f32>,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let (t, values) = (slice("t", &t)?, slice("values", &values)?);
        let above = self.0.enter(py, |rest, stop| {
            let taxels = rest.begins().len();
            if taxels == 0 || values.len() != t.len() * taxels {
                let (n, frames) = (values.len(), t.len());
                return Err(problem!("{n} values for {frames} frames of {taxels} taxels"));
            }
            let mut above = Vec::with_capacity(values.len());
            for (&t, frame) in t.iter().zip(values.chunks_exact(taxels)) {
                stop.check()?;
                above.extend(rest.take(t, frame.iter().copied()).iter().map(|above| above.max(0.0)));
            }
            Ok(above)
        })?;
        Ok(array(py, above))
    }

    /// The first quiet stretch, us.
    #[getter]
    fn quiet(&self, py: Python<'_>) -> Option<(i64, i64)> {
        self.0.with(py, |rest| rest.quiet())
    }

    /// The rest of each taxel in its first quiet stretch, or in a later one in which it was released; NaN for one without any.
    #[getter]
    fn begins<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let known = |&rest: &f64| if rest == f64::NO_REST { f64::NAN } else { rest };
        array(py, self.0.with(py, |rest| rest.begins().iter().map(known).collect()))
    }
}

/// The taxels' counts of touches in rows of five: touches, missed, pressed, changed, by itself.
pub(crate) type TouchesOut<'py> = Bound<'py, PyArray1<u32>>;

/// Counts of touches for Python.
pub(crate) fn from_touches<'py>(py: Python<'py>, touches: &TouchCounts) -> TouchesOut<'py> {
    let counts = touches.counts().iter().flat_map(|c| [c.touches, c.missed, c.pressed, c.changed, c.by_itself]);
    array(py, counts.collect())
}

/// The counts of touches of events.
#[pyfunction]
pub fn touches_of_events<'py>(py: Python<'py>, events: EventsIn<'py>) -> PyResult<TouchesOut<'py>> {
    let events = events.view()?;
    let counts = enter(py, |stop| {
        events.check()?;
        let mut counts = TouchCounts::new(events.array, f64::NO_REST);
        for k in 0..events.len() {
            if k % 4096 == 0 {
                stop.check()?;
            }
            let ticks = events.intensity.map_or(UNKNOWN, |sent| if sent.present[k] { sent.ticks[k] } else { UNKNOWN });
            let is_change = events.repaired.is_none_or(|repaired| !repaired[k]);
            counts.event(events.t[k], events.array.index(events.x[k], events.y[k]), ticks, events.p[k], is_change);
        }
        if let Some(&last) = events.t.last() {
            counts.advance(last.saturating_add(2 * BIN_US));
        }
        Ok::<_, Error>(counts)
    })?;
    Ok(from_touches(py, &counts))
}

/// The change of a value between frames that counts, ticks: above the noise floor of the board's fast presets.
const NOISE_FLOOR: f32 = 3.0;

/// The counts of touches of frames in ticks; `rest` of all of them, NaN where it is to be tracked.
#[pyfunction]
pub fn touches_of_frames<'py>(py: Python<'py>, frames: FramesIn<'py>, rest: f64) -> PyResult<TouchesOut<'py>> {
    let frames = frames.view()?;
    let counts = enter(py, |stop| {
        let taxels = frames.array.len();
        let mut counts = TouchCounts::new(frames.array, if rest.is_nan() { f64::NO_REST } else { rest });
        let mut before = vec![f32::NAN; taxels];
        for (&t, frame) in frames.t.iter().zip(frames.values.chunks_exact(taxels)) {
            stop.check()?;
            for (taxel, (&value, before)) in frame.iter().zip(&mut before).enumerate() {
                // As a board reads it; the first value is no change.
                if before.is_nan() && !value.is_nan() || (value - *before).abs() > NOISE_FLOOR {
                    counts.value(t, taxel, value, !before.is_nan());
                    *before = value;
                }
            }
            counts.advance(t);
        }
        if let Some(&last) = frames.t.last() {
            counts.advance(last.saturating_add(2 * BIN_US));
        }
        Ok::<_, Error>(counts)
    })?;
    Ok(from_touches(py, &counts))
}

/// Number of changes of each taxel of frames, and of those in the direction of the one before.
type ChangesOut<'py> = (Bound<'py, PyArray1<u32>>, Bound<'py, PyArray1<u32>>);

#[pyfunction]
pub fn changes_of_frames<'py>(py: Python<'py>, frames: FramesIn<'py>) -> PyResult<ChangesOut<'py>> {
    let frames = frames.view()?;
    let changes = enter(py, |stop| frames.changes(stop))?;
    Ok((array(py, changes.number), array(py, changes.same_direction)))
}

/// What a touched taxel reads above rest at least, for a board's noise floor.
#[pyfunction]
pub fn touched_above(noise_floor: f64) -> f64 {
    touched_from(0.0, noise_floor)
}

/// The preload of each taxel, and its place as text.
#[pyfunction]
pub fn preload<'py>(
    py: Python<'py>,
    less: PyReadonlyArray1<'py, f64>,
    columns: usize,
    above: f64,
    corner: (usize, usize),
) -> PyResult<(Bound<'py, PyArray1<f64>>, String)> {
    let loads = preload_of(slice("less", &less)?, columns, above);
    let at = preload_text(&loads, columns, corner);
    Ok((array(py, loads), at))
}
