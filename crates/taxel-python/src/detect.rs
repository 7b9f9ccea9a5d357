//! Scoring and readouts for Python.

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use taxel_core::Stop;
use taxel_core::detect::{
    Decision, Detection, Detector, EdgeNumbers, FrameClock, FrameTime, LoadCurve as CoreCurve, PlainRule, Readout,
    ReadoutStream as CoreStream, Reference, Spread, score as score_core,
};
use taxel_core::encode::{Measure, Quantity, Tare, Zeroing};
use taxel_core::metrics::matching::in_order;
use taxel_core::rest::{Following, LeftFloor};
use taxel_core::spikes::us;

use taxel_border::convert::{ArrayIn, Column, EventsIn, FramesIn, array, column, slice};
use taxel_border::enter::{Exclusive, enter};
use taxel_border::errors::{ProblemError, core};
use taxel_border::parameters::{Plain, parsed};

/// Detections as Python hands them over: labels, t and known in us, slope in mV/ms, repaired.
pub(crate) type DetectionsIn<'py> = (
    Vec<String>,
    PyReadonlyArray1<'py, i64>,
    PyReadonlyArray1<'py, i64>,
    PyReadonlyArray1<'py, f64>,
    PyReadonlyArray1<'py, bool>,
);

pub(crate) fn to_detections((labels, t, known, slope, repaired): DetectionsIn<'_>) -> PyResult<Vec<Detection>> {
    let (t, known, slope) = (slice("t", &t)?, slice("known", &known)?, slice("slope", &slope)?);
    let repaired = slice("repaired", &repaired)?;
    for (name, len) in [("t", t.len()), ("known", known.len()), ("slope", slope.len()), ("repaired", repaired.len())] {
        if len != labels.len() {
            let text =
                format!("detections: {name} has {len} entries, label has {}: the numbers must be equal", labels.len());
            return Err(ProblemError::new_err(text));
        }
    }
    let columns = labels.into_iter().zip(t).zip(known).zip(slope).zip(repaired);
    Ok(columns
        .map(|((((label, &t), &known), &slope), &repaired)| Detection { label, t, known, slope, repaired })
        .collect())
}

/// Detections as Python gets them: the same parts.
type DetectionsOut<'py> = (
    Vec<String>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<bool>>,
);

fn from_detections(py: Python<'_>, found: Vec<Detection>) -> DetectionsOut<'_> {
    let t = found.iter().map(|d| d.t).collect();
    let known = found.iter().map(|d| d.known).collect();
    let slope = found.iter().map(|d| d.slope).collect();
    let repaired = found.iter().map(|d| d.repaired).collect();
    let labels = found.into_iter().map(|d| d.label).collect();
    (labels, array(py, t), array(py, known), array(py, slope), array(py, repaired))
}

/// One label's detections beside its reference events.
#[pyclass(frozen, get_all)]
pub struct Tally {
    label: String,
    /// The pairs: indices of detections, and of events.
    detected: Column<i64>,
    events: Column<i64>,
    missed_events: Column<i64>,
    /// Places of false detections, and how many of them lie within a window.
    false_detections: Column<i64>,
    false_near: usize,
    errors_ms: Column<f64>,
    delays_ms: Column<f64>,
}

/// Checks detections; raises where columns differ in length.
#[pyfunction]
pub fn check_detections(detections: DetectionsIn<'_>) -> PyResult<()> {
    to_detections(detections).map(drop)
}

/// Matches detections with reference events, label by label, in order of time.
#[pyfunction]
pub fn score(
    py: Python<'_>,
    found: DetectionsIn<'_>,
    labels: Vec<String>,
    t: PyReadonlyArray1<'_, i64>,
    windows: PyReadonlyArray1<'_, i64>,
) -> PyResult<Vec<Tally>> {
    let found = to_detections(found)?;
    let t = slice("t", &t)?;
    if t.len() != labels.len() {
        return Err(ProblemError::new_err(format!(
            "truth: {} labels for {} times: the numbers must be equal",
            labels.len(),
            t.len()
        )));
    }
    let truth: Vec<Reference> = labels.into_iter().zip(t).map(|(label, &t)| Reference { label, t }).collect();
    let windows = slice("windows", &windows)?.to_vec();
    let tallies = enter(py, |stop| score_core(&found, &truth, &windows, stop))?;
    let column_of = |indices: Vec<usize>| column(py, indices.into_iter().map(|k| k as i64).collect());
    Ok(tallies
        .into_iter()
        .map(|tally| {
            let (detected, events) = tally.pairs.into_iter().unzip();
            Tally {
                label: tally.label,
                detected: column_of(detected),
                events: column_of(events),
                missed_events: column_of(tally.missed),
                false_detections: column_of(tally.false_),
                false_near: tally.false_near,
                errors_ms: column(py, tally.errors_ms),
                delays_ms: column(py, tally.delays_ms),
            }
        })
        .collect())
}

/// The places of detections and of events.
type PairsOut<'py> = (Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<i64>>);

/// The places of detections and of the reference events of one label that are paired, each time ascending, us.
#[pyfunction]
pub fn pairs<'py>(
    py: Python<'py>,
    t: PyReadonlyArray1<'py, i64>,
    events: PyReadonlyArray1<'py, i64>,
    window_us: i64,
) -> PyResult<PairsOut<'py>> {
    let (t, events) = (slice("t", &t)?, slice("events", &events)?);
    let found = enter(py, |stop| in_order(t, events, &vec![window_us; events.len()], stop))?;
    let column = |of: fn(&(usize, usize)) -> usize| array(py, found.iter().map(|pair| of(pair) as i64).collect());
    Ok((column(|pair| pair.0), column(|pair| pair.1)))
}

/// Mean, standard deviation, median, 2.5th and 97.5th percentile.
#[pyfunction]
pub fn spread(values: PyReadonlyArray1<'_, f64>) -> PyResult<Plain<Spread>> {
    Ok(Plain(Spread::new(slice("values", &values)?)))
}

/// Checks a readout's parts; gives the text of its file.
#[pyfunction]
pub fn make_readout(parts: &str) -> PyResult<String> {
    let readout: Readout = parsed("readout", parts)?;
    readout.check().map_err(core)?;
    Ok(readout.to_json())
}

/// Checks the text of a readout's file; gives it with every default filled in.
#[pyfunction]
pub fn check_readout(text: &str) -> PyResult<String> {
    Ok(Readout::from_json(text).map_err(core)?.to_json())
}

/// Checks a plain rule's parts; gives the text of its file.
#[pyfunction]
pub fn make_plain_rule(parts: &str) -> PyResult<String> {
    let rule: PlainRule = parsed("plain rule", parts)?;
    rule.check().map_err(core)?;
    Ok(rule.to_json())
}

/// Checks the text of a plain rule's file; gives it with every default filled in.
#[pyfunction]
pub fn check_plain_rule(text: &str) -> PyResult<String> {
    Ok(PlainRule::from_json(text).map_err(core)?.to_json())
}

/// Whether the text of a file, of a readout or a plain rule, is a plain rule's; checks it.
#[pyfunction]
pub fn is_plain_rule(text: &str) -> PyResult<bool> {
    Ok(matches!(Detector::from_json(text).map_err(core)?, Detector::PlainRule(_)))
}

fn parse(readout: &str, tare: Option<&str>) -> PyResult<(Detector, Option<Tare>)> {
    Ok((Detector::from_json(readout).map_err(core)?, parse_tare(tare)?))
}

fn parse_tare(tare: Option<&str>) -> PyResult<Option<Tare>> {
    tare.map(Tare::from_json).transpose().map_err(core)
}

/// Zeroings: t in us, column, row, rest.
type ZeroingsIn = Vec<(i64, u16, u16, f64)>;

fn to_zeroings(zeroings: ZeroingsIn) -> Vec<Zeroing> {
    zeroings.into_iter().map(|(t, x, y, rest)| Zeroing { t, x, y, rest, before: None }).collect()
}

/// The detections of a readout or a plain rule in a whole recording of events, with its zeroings: t in us, column, row,
/// rest.
#[pyfunction]
pub fn readout_run_events<'py>(
    py: Python<'py>,
    readout: &str,
    events: EventsIn<'py>,
    frame_us: f64,
    wire_version: u8,
    tare: Option<&str>,
    zeroings: ZeroingsIn,
    begin: Option<i64>,
) -> PyResult<DetectionsOut<'py>> {
    let (readout, tare) = parse(readout, tare)?;
    let zeroings = to_zeroings(zeroings);
    let events = events.view()?;
    let frames = FrameTime::on_wire(frame_us, wire_version);
    let found = enter(py, |stop| readout.run_events(events, frames, tare.as_ref(), &zeroings, begin, stop))?;
    Ok(from_detections(py, found))
}

/// Since when what is at rest is outside its noise floor, us, and how many taxels are at most.
type LeftFloorOut = Option<(i64, usize)>;

fn left_floor(left: Option<LeftFloor>) -> LeftFloorOut {
    left.map(|LeftFloor { since_us, taxels }| (since_us, taxels))
}

/// Frames less what the rest of each taxel moved since the tare: the values of all, frame by frame.
#[pyfunction]
pub fn follow_rest<'py>(
    py: Python<'py>,
    frames: FramesIn<'py>,
    tare: &str,
    noise_floor: f64,
    absorb_s: f64,
) -> PyResult<Bound<'py, PyArray1<f32>>> {
    let (frames, tare) = (frames.view()?, Tare::from_json(tare).map_err(core)?);
    let followed = |stop: Stop<'_>| {
        let mut rest = tare.followed(frames.array, Following { noise_floor, absorb_s })?;
        let mut values = Vec::with_capacity(frames.values.len());
        for (t, frame) in frames.iter() {
            stop.check()?;
            values.extend_from_slice(rest.take(t, frame));
        }
        Ok::<_, taxel_core::Error>(values)
    };
    Ok(array(py, enter(py, followed)?))
}

/// The detections of a readout or a plain rule in a whole recording of frames, with its zeroings, and since when what is at
/// rest is outside its noise floor.
#[pyfunction]
pub fn readout_run_frames<'py>(
    py: Python<'py>,
    readout: &str,
    frames: FramesIn<'py>,
    frame_us: Option<f64>,
    tare: Option<&str>,
    zeroings: ZeroingsIn,
    begin: Option<i64>,
) -> PyResult<(DetectionsOut<'py>, LeftFloorOut)> {
    let (readout, tare) = parse(readout, tare)?;
    let (frames, zeroings) = (frames.view()?, to_zeroings(zeroings));
    let run = |stop: Stop<'_>| readout.run_frames(frames, frame_us, tare.as_ref(), &zeroings, begin, stop);
    let (found, left) = enter(py, run)?;
    Ok((from_detections(py, found), left_floor(left)))
}

/// The ends of the frames in which times (ms, ascending) lie, us: of those of an input of frames, or of the board's.
#[pyfunction]
pub fn frame_ends<'py>(
    py: Python<'py>,
    times: PyReadonlyArray1<'py, f64>,
    frame_us: f64,
    wire_version: u8,
    frames: PyReadonlyArray1<'py, i64>,
) -> PyResult<Bound<'py, PyArray1<i64>>> {
    let clock = FrameClock::new(FrameTime::on_wire(frame_us, wire_version)).map_err(core)?;
    Ok(array(py, clock.ends_of(slice("times", &times)?, slice("frames", &frames)?)))
}

/// A readout or a plain rule at work.
#[pyclass(frozen)]
pub struct ReadoutStream(Exclusive<CoreStream>);

#[pymethods]
impl ReadoutStream {
    #[new]
    fn new(readout: &str, array: ArrayIn, frame_us: f64, wire_version: u8, tare: Option<&str>) -> PyResult<Self> {
        let ((readout, tare), array) = (parse(readout, tare)?, array.0);
        let frames = FrameTime::on_wire(frame_us, wire_version);
        Ok(Self(Exclusive::new(readout.stream(&array, frames, tare.as_ref()).map_err(core)?)))
    }

    fn push_events<'py>(&self, py: Python<'py>, events: EventsIn<'py>) -> PyResult<DetectionsOut<'py>> {
        let (events, mut found) = (events.view()?, vec![]);
        self.0.enter(py, |readout, _| readout.push_events(events, &mut found))?;
        Ok(from_detections(py, found))
    }

    fn push_frames<'py>(&self, py: Python<'py>, frames: FramesIn<'py>) -> PyResult<DetectionsOut<'py>> {
        let frames = frames.view()?;
        let found = self.0.enter(py, |readout, stop| readout.push_frames(frames, stop))?;
        Ok(from_detections(py, found))
    }

    fn advance<'py>(&self, py: Python<'py>, t: i64) -> PyResult<DetectionsOut<'py>> {
        let mut found = vec![];
        self.0.enter(py, |readout, _| readout.advance(t, &mut found))?;
        Ok(from_detections(py, found))
    }

    /// How many events came late.
    #[getter]
    fn late(&self, py: Python<'_>) -> u64 {
        self.0.with(py, |readout| readout.late())
    }

    /// Each neuron's potential now, mV.
    #[getter]
    fn potentials(&self, py: Python<'_>) -> Vec<(String, f64)> {
        self.0.with(py, |readout| readout.potentials().map(|(label, mv)| (label.to_owned(), mv)).collect())
    }
}

/// Times (us), times when they were known (us), and quantities.
type DecisionsOut<'py> = (Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<f64>>);

fn from_decisions<'py>(py: Python<'py>, found: &[Decision]) -> DecisionsOut<'py> {
    let column = |value: fn(&Decision) -> i64| array(py, found.iter().map(value).collect());
    (column(|d| d.t), column(|d| d.known), array(py, found.iter().map(|d| d.value).collect()))
}

/// A quantity over a recording, on which plain rules are tried; several are measured at once.
#[pyclass(frozen)]
pub struct LoadCurve(CoreCurve);

#[pymethods]
impl LoadCurve {
    #[staticmethod]
    #[pyo3(signature = (quantities, levels, noise_floor, events, frame_us, wire_version, tare, touched_ms=None))]
    fn of_events(
        py: Python<'_>,
        quantities: Vec<String>,
        levels: Vec<f64>,
        noise_floor: f64,
        events: EventsIn<'_>,
        frame_us: f64,
        wire_version: u8,
        tare: Option<&str>,
        touched_ms: Option<f64>,
    ) -> PyResult<Vec<Self>> {
        let (quantities, tare) = (to_quantities(&quantities)?, parse_tare(tare)?);
        let events = events.view()?;
        let frames = FrameTime::on_wire(frame_us, wire_version);
        let measure = Measure { levels: &levels, noise_floor, touched_ms };
        let made = |stop: Stop<'_>| CoreCurve::of_events(&quantities, measure, events, frames, tare.as_ref(), stop);
        Ok(enter(py, made)?.into_iter().map(Self).collect())
    }

    #[staticmethod]
    #[pyo3(signature = (quantities, levels, noise_floor, frames, frame_us, tare, touched_ms=None))]
    fn of_frames(
        py: Python<'_>,
        quantities: Vec<String>,
        levels: Vec<f64>,
        noise_floor: f64,
        frames: FramesIn<'_>,
        frame_us: Option<f64>,
        tare: Option<&str>,
        touched_ms: Option<f64>,
    ) -> PyResult<Vec<Self>> {
        let (quantities, tare) = (to_quantities(&quantities)?, parse_tare(tare)?);
        let frames = frames.view()?;
        let measure = Measure { levels: &levels, noise_floor, touched_ms };
        let made = |stop: Stop<'_>| CoreCurve::of_frames(&quantities, measure, frames, frame_us, tare.as_ref(), stop);
        Ok(enter(py, made)?.into_iter().map(Self).collect())
    }

    /// The times of its changes, us, and the quantity after each.
    fn changes<'py>(&self, py: Python<'py>) -> (Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<f64>>) {
        let changes = self.0.changes();
        let times = changes.iter().map(|change| us(change.t).round() as i64).collect();
        (array(py, times), array(py, changes.iter().map(|change| f64::from(change.value)).collect()))
    }

    /// The begins of loads, then their ends.
    fn edges<'py>(
        &self,
        py: Python<'py>,
        level: f64,
        release: f64,
        quiet_ms: f64,
        date: Option<f64>,
    ) -> PyResult<(DecisionsOut<'py>, DecisionsOut<'py>)> {
        let edges = EdgeNumbers { level, release, quiet_ms, date };
        let found = enter(py, |_| Ok::<_, taxel_core::Error>(self.0.edges(&edges)))?;
        let (begins, ends): (Vec<_>, Vec<_>) = found.into_iter().partition(|decision| decision.label == 0);
        Ok((from_decisions(py, &begins), from_decisions(py, &ends)))
    }

    /// The area at an age of every touch.
    fn at_age<'py>(&self, py: Python<'py>, age_ms: f64) -> PyResult<DecisionsOut<'py>> {
        Ok(from_decisions(py, &enter(py, |_| self.0.at_age(age_ms))?))
    }

    /// Every touch as it ends, with its duration, ms.
    fn at_end<'py>(&self, py: Python<'py>) -> PyResult<DecisionsOut<'py>> {
        Ok(from_decisions(py, &enter(py, |_| self.0.at_end())?))
    }
}

fn to_quantities(names: &[String]) -> PyResult<Vec<Quantity>> {
    names.iter().map(|name| parsed("quantity", &serde_json::Value::from(name.as_str()).to_string())).collect()
}
