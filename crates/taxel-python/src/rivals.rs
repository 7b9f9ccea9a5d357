//! The rules that others published.

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use serde_json::{Map, Value};
use taxel_core::learn::rivals::{Batch, Ended, Learnt, Rival, Skim, Tempotron, Trained};
use taxel_core::{Result as CoreResult, SpikeTrains, Stop, problem};

use crate::convert::{SpikesIn, array, slice, to_spikes};
use crate::enter::{enter, enter_keeping};
use crate::errors::core;
use crate::parameters::parsed;

/// Training as Python gets it: weights, right, best epoch, how it ended, a pending KeyboardInterrupt.
type TrainedOut<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, usize, &'static str, Option<Py<PyAny>>);

/// Trains, telling `progress` of each epoch; what it raises ends the training and is raised again.
fn train<'py>(
    py: Python<'py>,
    max_seconds: Option<f64>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(&mut dyn FnMut(usize, f64), Stop<'_>) -> CoreResult<Trained> + Send,
) -> PyResult<TrainedOut<'py>> {
    let (trained, interrupt) = enter_keeping(py, max_seconds, |stop, caller| {
        let mut report = |epoch: usize, right: f64| {
            caller.call(progress.as_ref(), |py, function| function.call1(py, (epoch, right)));
        };
        work(&mut report, stop)
    })?;
    let ended = match trained.ended {
        Ended::Right => "right",
        Ended::Epochs => "epochs",
        Ended::Stopped => "stopped",
    };
    Ok((array(py, trained.weights), array(py, trained.right), trained.best_epoch, ended, interrupt))
}

fn to_patterns(patterns: Vec<SpikesIn<'_>>) -> PyResult<Vec<SpikeTrains>> {
    patterns.into_iter().map(to_spikes).collect()
}

fn to_targets(targets: &[PyReadonlyArray1<'_, f64>]) -> PyResult<Vec<Vec<f64>>> {
    targets.iter().map(|t| slice("targets", t).map(<[f64]>::to_vec)).collect()
}

/// A rule with its neuron and its training, from its name and all parameters in one list.
pub(crate) fn to_rival(json: &str) -> PyResult<Rival> {
    let mut given: Map<String, Value> = parsed("rule", json)?;
    let name = match given.remove("name") {
        Some(Value::String(name)) => name,
        _ => return Err(core(problem!("rule without a name"))),
    };
    let parts = Rival::parts(&name, given).map_err(core)?;
    let rival: Rival = parsed(&name, &parts.to_string())?;
    rival.check().map_err(core)?;
    Ok(rival)
}

/// The names of all rules by epochs.
#[pyfunction]
fn rule_names() -> Vec<&'static str> {
    Rival::names().collect()
}

/// Trains a rule's neuron.
#[pyfunction]
#[pyo3(signature = (parameters, patterns, targets, start, progress))]
fn fit_rival<'py>(
    py: Python<'py>,
    parameters: &str,
    patterns: Vec<SpikesIn<'py>>,
    targets: Vec<PyReadonlyArray1<'py, f64>>,
    start: Option<PyReadonlyArray1<'py, f64>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<TrainedOut<'py>> {
    let rival = to_rival(parameters)?;
    let (patterns, targets) = (to_patterns(patterns)?, to_targets(&targets)?);
    let start = start.as_ref().map(|s| slice("start", s)).transpose()?;
    train(py, rival.training.max_seconds, progress, |report, stop| rival.fit(&patterns, &targets, start, report, stop))
}

/// What one presentation changes, over the learning rate; output spikes.
#[pyfunction]
fn change_rival<'py>(
    py: Python<'py>,
    parameters: &str,
    weights: PyReadonlyArray1<'py, f64>,
    pattern: SpikesIn<'py>,
    targets: PyReadonlyArray1<'py, f64>,
) -> PyResult<[Bound<'py, PyArray1<f64>>; 2]> {
    let rival = to_rival(parameters)?;
    let pattern = to_spikes(pattern)?;
    let (weights, targets) = (slice("weights", &weights)?, slice("targets", &targets)?);
    let (change, fired) = enter(py, |_| rival.change(weights, &pattern, targets))?;
    Ok([array(py, change), array(py, fired)])
}

/// Output spikes of a rule's neuron.
#[pyfunction]
fn run_rival<'py>(
    py: Python<'py>,
    parameters: &str,
    weights: PyReadonlyArray1<'py, f64>,
    pattern: SpikesIn<'py>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let rival = to_rival(parameters)?;
    let pattern = to_spikes(pattern)?;
    let weights = slice("weights", &weights)?;
    let fired = enter(py, |stop| rival.run(weights, &pattern, stop))?;
    Ok(array(py, fired))
}

/// Trains a Tempotron.
#[pyfunction]
#[pyo3(signature = (parameters, patterns, labels, start, progress))]
fn fit_tempotron<'py>(
    py: Python<'py>,
    parameters: &str,
    patterns: Vec<SpikesIn<'py>>,
    labels: Vec<bool>,
    start: Option<PyReadonlyArray1<'py, f64>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<TrainedOut<'py>> {
    let tempotron: Tempotron = parsed("Tempotron", parameters)?;
    let patterns = to_patterns(patterns)?;
    let start = start.as_ref().map(|s| slice("start", s)).transpose()?;
    train(py, tempotron.max_seconds, progress, |report, stop| tempotron.fit(&patterns, &labels, start, report, stop))
}

/// Highest potential, its time, time of the spike (infinite where there is none).
#[pyfunction]
fn peak_tempotron(
    py: Python<'_>,
    parameters: &str,
    weights: PyReadonlyArray1<'_, f64>,
    pattern: SpikesIn<'_>,
) -> PyResult<(f64, f64, f64)> {
    let tempotron: Tempotron = parsed("Tempotron", parameters)?;
    let pattern = to_spikes(pattern)?;
    let weights = slice("weights", &weights)?;
    let peak = enter(py, |_| tempotron.peak(weights, &pattern))?;
    Ok((peak.v_max, peak.t_max, peak.t_spike.unwrap_or(f64::INFINITY)))
}

/// What one presentation changes, over the learning rate.
#[pyfunction]
fn change_tempotron<'py>(
    py: Python<'py>,
    parameters: &str,
    weights: PyReadonlyArray1<'py, f64>,
    pattern: SpikesIn<'py>,
    label: bool,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let tempotron: Tempotron = parsed("Tempotron", parameters)?;
    let pattern = to_spikes(pattern)?;
    let weights = slice("weights", &weights)?;
    let change = enter(py, |_| tempotron.change(weights, &pattern, label))?;
    Ok(array(py, change))
}

/// The names of all learners that take all examples at once.
#[pyfunction]
fn batch_names() -> &'static [&'static str] {
    Batch::NAMES
}

/// Learns from all examples at once; returns weights, and further results as JSON.
#[pyfunction]
fn fit_batch<'py>(
    py: Python<'py>,
    name: &str,
    parameters: &str,
    patterns: Vec<SpikesIn<'py>>,
    targets: Vec<PyReadonlyArray1<'py, f64>>,
) -> PyResult<(Bound<'py, PyArray1<f64>>, String)> {
    let batch = Batch::from_json(name, parameters).map_err(core)?;
    let (patterns, targets) = (to_patterns(patterns)?, to_targets(&targets)?);
    let learnt = enter(py, |stop| batch.fit(&patterns, &targets, stop))?;
    Ok((array(py, learnt.weights), Value::Object(learnt.results).to_string()))
}

/// Output spikes of such a learner.
#[pyfunction]
fn run_batch<'py>(
    py: Python<'py>,
    name: &str,
    parameters: &str,
    weights: PyReadonlyArray1<'py, f64>,
    results: &str,
    pattern: SpikesIn<'py>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let batch = Batch::from_json(name, parameters).map_err(core)?;
    let learnt = Learnt { weights: slice("weights", &weights)?.to_vec(), results: parsed(name, results)? };
    let pattern = to_spikes(pattern)?;
    let fired = enter(py, |stop| batch.run(&learnt, &pattern, stop))?;
    Ok(array(py, fired))
}

/// The rows of one pattern, one after the other.
#[pyfunction]
fn rows_skim<'py>(py: Python<'py>, parameters: &str, pattern: SpikesIn<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let skim: Skim = parsed("SKIM", parameters)?;
    let pattern = to_spikes(pattern)?;
    let rows = enter(py, |stop| skim.rows(&pattern, stop))?;
    Ok(array(py, rows))
}

/// The output at each row's time.
#[pyfunction]
fn output_skim<'py>(
    py: Python<'py>,
    parameters: &str,
    weights: PyReadonlyArray1<'py, f64>,
    pattern: SpikesIn<'py>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let skim: Skim = parsed("SKIM", parameters)?;
    let pattern = to_spikes(pattern)?;
    let weights = slice("weights", &weights)?;
    let output = enter(py, |stop| skim.output(weights, &pattern, stop))?;
    Ok(array(py, output))
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(rule_names, module)?)?;
    module.add_function(wrap_pyfunction!(fit_rival, module)?)?;
    module.add_function(wrap_pyfunction!(change_rival, module)?)?;
    module.add_function(wrap_pyfunction!(run_rival, module)?)?;
    module.add_function(wrap_pyfunction!(fit_tempotron, module)?)?;
    module.add_function(wrap_pyfunction!(peak_tempotron, module)?)?;
    module.add_function(wrap_pyfunction!(change_tempotron, module)?)?;
    module.add_function(wrap_pyfunction!(batch_names, module)?)?;
    module.add_function(wrap_pyfunction!(fit_batch, module)?)?;
    module.add_function(wrap_pyfunction!(run_batch, module)?)?;
    module.add_function(wrap_pyfunction!(rows_skim, module)?)?;
    module.add_function(wrap_pyfunction!(output_skim, module)?)
}
