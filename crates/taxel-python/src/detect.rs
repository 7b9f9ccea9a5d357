//! Scoring and readouts for Python.

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use taxel_core::detect::{Detection, Reference, Spread, score as score_core};

use crate::convert::{array, slice};
use crate::enter::enter;
use crate::errors::ProblemError;

/// Detections as Python hands them over: labels, t and known in us, slope in mV/ms.
pub(crate) type DetectionsIn<'py> =
    (Vec<String>, PyReadonlyArray1<'py, i64>, PyReadonlyArray1<'py, i64>, PyReadonlyArray1<'py, f64>);

pub(crate) fn to_detections((labels, t, known, slope): DetectionsIn<'_>) -> PyResult<Vec<Detection>> {
    let (t, known, slope) = (slice("t", &t)?, slice("known", &known)?, slice("slope", &slope)?);
    for (name, len) in [("t", t.len()), ("known", known.len()), ("slope", slope.len())] {
        if len != labels.len() {
            let text = format!("detections: {name} has {len} entries, label has {}: they must be equal", labels.len());
            return Err(ProblemError::new_err(text));
        }
    }
    let columns = labels.into_iter().zip(t).zip(known).zip(slope);
    Ok(columns.map(|(((label, &t), &known), &slope)| Detection { label, t, known, slope }).collect())
}

/// One label's tally: label, pairs as two columns, missed, false, false within a window, errors and delays in ms.
type TallyOut<'py> = (
    String,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i64>>,
    usize,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
);

/// Checks detections; raises where columns differ in length.
#[pyfunction]
fn check_detections(detections: DetectionsIn<'_>) -> PyResult<()> {
    to_detections(detections).map(drop)
}

/// Matches detections with reference events, label by label, in order of time.
#[pyfunction]
fn score<'py>(
    py: Python<'py>,
    found: DetectionsIn<'py>,
    labels: Vec<String>,
    t: PyReadonlyArray1<'py, i64>,
    windows: PyReadonlyArray1<'py, i64>,
) -> PyResult<Vec<TallyOut<'py>>> {
    let found = to_detections(found)?;
    let t = slice("t", &t)?;
    if t.len() != labels.len() {
        return Err(ProblemError::new_err(format!(
            "truth: {} labels for {} times: must be equal",
            labels.len(),
            t.len()
        )));
    }
    let truth: Vec<Reference> = labels.into_iter().zip(t).map(|(label, &t)| Reference { label, t }).collect();
    let windows = slice("windows", &windows)?.to_vec();
    let tallies = enter(py, |stop| score_core(&found, &truth, &windows, stop))?;
    let places = |indices: Vec<usize>| array(py, indices.into_iter().map(|k| k as i64).collect());
    Ok(tallies
        .into_iter()
        .map(|tally| {
            let (said, events) = tally.pairs.into_iter().unzip();
            (
                tally.label,
                places(said),
                places(events),
                places(tally.missed),
                places(tally.false_),
                tally.false_near,
                array(py, tally.errors_ms),
                array(py, tally.delays_ms),
            )
        })
        .collect())
}

/// Mean, standard deviation, median, 2.5th and 97.5th percentile.
#[pyfunction]
fn spread(values: PyReadonlyArray1<'_, f64>) -> PyResult<(f64, f64, f64, f64, f64)> {
    let Spread { mean, sd, median, low, high } = Spread::of(slice("values", &values)?);
    Ok((mean, sd, median, low, high))
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(check_detections, module)?)?;
    module.add_function(wrap_pyfunction!(score, module)?)?;
    module.add_function(wrap_pyfunction!(spread, module)?)
}
