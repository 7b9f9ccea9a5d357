//! Distances between spike trains and patterns.

use std::num::NonZero;

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use taxel_core::metrics::{Metric, NAMES, Patterns, Work, matching};

use taxel_border::convert::{array, slice};
use taxel_border::enter::{enter, enter_with_progress};
use taxel_border::errors::core;

/// Patterns as Python hands them over: name, count, trains, times, offsets, listed.
type PatternsIn<'py> = (String, usize, usize, PyReadonlyArray1<'py, f64>, PyReadonlyArray1<'py, i64>, bool);

/// Patterns with their offsets as the core wants them.
struct OffsetPatterns<'py> {
    parts: PatternsIn<'py>,
    offsets: Vec<usize>,
}

impl<'py> OffsetPatterns<'py> {
    fn new(parts: PatternsIn<'py>) -> PyResult<Self> {
        let offsets = slice("offsets", &parts.4)?.iter().map(|&o| usize::try_from(o).unwrap_or(usize::MAX)).collect();
        Ok(Self { parts, offsets })
    }

    fn patterns(&self) -> PyResult<Patterns<'_>> {
        let (name, count, trains, times, _, listed) = &self.parts;
        Ok(Patterns {
            name,
            count: *count,
            trains: *trains,
            times: slice("times", times)?,
            offsets: &self.offsets,
            listed: *listed,
        })
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
    let (metric, a, b) = (to_metric(metric)?, OffsetPatterns::new(a)?, OffsetPatterns::new(b)?);
    let (a, b) = (a.patterns()?, b.patterns()?);
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
    let (metric, a, b) = (to_metric(metric)?, OffsetPatterns::new(a)?, b.map(OffsetPatterns::new).transpose()?);
    let (a, b) = (a.patterns()?, b.as_ref().map(OffsetPatterns::patterns).transpose()?);
    let distances = enter_with_progress(py, |stop, caller| {
        let mut report = |done: usize, all: usize| {
            caller.call(progress.as_ref(), |py, function| function.call1(py, (done, all)));
        };
        metric.pairwise(&a, b.as_ref(), &mut Work { threads, stop, progress: &mut report })
    })?;
    Ok(array(py, distances))
}
