//! Distances between spike trains and patterns.

use std::num::NonZero;

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use taxel_core::metrics::{Metric, NAMES, Patterns, Work, matching};

use taxel_border::convert::{self, array, slice};
use taxel_border::enter::{enter, enter_with_progress};
use taxel_border::errors::core;

/// `Patterns` of Python.
#[derive(FromPyObject)]
pub struct PatternsIn<'py> {
    name: String,
    patterns: usize,
    trains: usize,
    times: PyReadonlyArray1<'py, f64>,
    #[pyo3(from_py_with = to_offsets)]
    offsets: Vec<usize>,
    listed: bool,
}

fn to_offsets(offsets: &Bound<'_, PyAny>) -> PyResult<Vec<usize>> {
    convert::to_offsets(&offsets.extract()?)
}

impl PatternsIn<'_> {
    fn view(&self) -> PyResult<Patterns<'_>> {
        let Self { name, patterns: count, trains, times, offsets, listed } = self;
        Ok(Patterns { name, count: *count, trains: *trains, times: slice("times", times)?, offsets, listed: *listed })
    }
}

fn to_metric(json: &str) -> PyResult<Metric> {
    Metric::from_json(json).map_err(core)
}

/// Which spikes and targets (ms) belong together, pattern by pattern: a pair of indices each.
#[pyfunction]
pub fn match_spikes(
    py: Python<'_>,
    spikes: Vec<PyReadonlyArray1<'_, f64>>,
    targets: Vec<PyReadonlyArray1<'_, f64>>,
    window_ms: f64,
) -> PyResult<Vec<Vec<(usize, usize)>>> {
    let spikes = spikes.iter().map(|times| slice("spikes", times)).collect::<PyResult<Vec<_>>>()?;
    let targets = targets.iter().map(|times| slice("targets", times)).collect::<PyResult<Vec<_>>>()?;
    enter(py, |stop| {
        let each = spikes.iter().zip(&targets).enumerate();
        each.map(|(p, (spikes, targets))| {
            let (name, wanted) = (format!("spikes[{p}]"), format!("targets[{p}]"));
            matching::match_spikes((&name, spikes), (&wanted, targets), window_ms, stop)
        })
        .collect()
    })
}

/// The names of all metrics.
#[pyfunction]
pub fn metric_names() -> Vec<&'static str> {
    NAMES.to_vec()
}

/// The distance of two patterns.
#[pyfunction]
pub fn distance<'py>(py: Python<'py>, metric: &str, a: PatternsIn<'py>, b: PatternsIn<'py>) -> PyResult<f64> {
    let (metric, a, b) = (to_metric(metric)?, a.view()?, b.view()?);
    enter(py, |stop| metric.distance(&a, &b, stop))
}

/// The distances of all patterns from all others, row by row.
#[pyfunction]
pub fn pairwise<'py>(
    py: Python<'py>,
    metric: &str,
    a: PatternsIn<'py>,
    b: Option<PatternsIn<'py>>,
    threads: Option<NonZero<usize>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (metric, a, b) = (to_metric(metric)?, a.view()?, b.as_ref().map(PatternsIn::view).transpose()?);
    let distances = enter_with_progress(py, |stop, caller| {
        let mut report = |done: usize, all: usize| {
            caller.call(progress.as_ref(), |py, function| function.call1(py, (done, all)));
        };
        metric.pairwise(&a, b.as_ref(), &mut Work { threads, stop, progress: &mut report })
    })?;
    Ok(array(py, distances))
}
