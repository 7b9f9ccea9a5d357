//! What Python calls.

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use serde_json::{Value, json};
use taxel_border::convert::{Column, SpikesIn, array, column, slice, to_patterns, to_targets};
use taxel_border::enter::{Exclusive, enter, enter_keeping};
use taxel_border::errors::core;
use taxel_border::parameters::{Plain, checked, parsed, unknown};
use taxel_core::{Result as CoreResult, Stop};

use crate::rules::{Ended, EpochLearner, Skim, Stdp, StdpNeuron, Tempotron, Trained};

/// What training found.
#[pyclass(frozen, get_all, name = "Trained")]
pub struct TrainedOut {
    weights: Column<f64>,
    /// The share of patterns that were right, by epoch.
    right: Column<f64>,
    best_epoch: usize,
    ended: &'static str,
    /// A pending exception, such as KeyboardInterrupt.
    raised: Option<Py<PyAny>>,
}

/// Trains, telling `progress` of each epoch; what it raises ends the training and is raised again.
fn train(
    py: Python<'_>,
    max_seconds: Option<f64>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(&mut dyn FnMut(usize, f64), Stop<'_>) -> CoreResult<Trained> + Send,
) -> PyResult<TrainedOut> {
    let (trained, raised) = enter_keeping(py, max_seconds, |stop, caller| {
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
    let (weights, right) = (column(py, trained.weights), column(py, trained.right));
    Ok(TrainedOut { weights, right, best_epoch: trained.best_epoch, ended, raised })
}

/// A rule with its neuron and its training, checked, from its name and all parameters in one list.
fn to_epoch_learner(json: &str) -> PyResult<EpochLearner> {
    let learner = parsed::<EpochLearner>("rule", json)?.filled();
    learner.check().map_err(core)?;
    Ok(learner)
}

/// The names of all rules by epochs.
#[pyfunction]
pub fn rule_names() -> [&'static str; 8] {
    EpochLearner::NAMES
}

/// Trains a rule's neuron.
#[pyfunction]
#[pyo3(signature = (parameters, patterns, targets, start, progress))]
pub fn fit_epochs<'py>(
    py: Python<'py>,
    parameters: &str,
    patterns: Vec<SpikesIn>,
    targets: Vec<PyReadonlyArray1<'py, f64>>,
    start: Option<PyReadonlyArray1<'py, f64>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<TrainedOut> {
    let learner = to_epoch_learner(parameters)?;
    let (patterns, targets) = (to_patterns(patterns), to_targets(&targets)?);
    let start = start.as_ref().map(|s| slice("start", s)).transpose()?;
    train(py, learner.max_seconds, progress, |report, stop| learner.fit(&patterns, &targets, start, report, stop))
}

/// What one presentation changes, over the learning rate; output spikes.
#[pyfunction]
pub fn change_epochs<'py>(
    py: Python<'py>,
    parameters: &str,
    weights: PyReadonlyArray1<'py, f64>,
    pattern: SpikesIn,
    targets: PyReadonlyArray1<'py, f64>,
) -> PyResult<[Bound<'py, PyArray1<f64>>; 2]> {
    let learner = to_epoch_learner(parameters)?;
    let (weights, targets) = (slice("weights", &weights)?, slice("targets", &targets)?);
    let (change, fired) = enter(py, |_| learner.change(weights, &pattern.0, targets))?;
    Ok([array(py, change), array(py, fired)])
}

/// Output spikes of a rule's neuron.
#[pyfunction]
pub fn run_epochs<'py>(
    py: Python<'py>,
    parameters: &str,
    weights: PyReadonlyArray1<'py, f64>,
    pattern: SpikesIn,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let learner = to_epoch_learner(parameters)?;
    let weights = slice("weights", &weights)?;
    let fired = enter(py, |stop| learner.run(weights, &pattern.0, stop))?;
    Ok(array(py, fired))
}

/// Trains a Tempotron.
#[pyfunction]
#[pyo3(signature = (parameters, patterns, labels, start, progress))]
pub fn fit_tempotron<'py>(
    py: Python<'py>,
    parameters: &str,
    patterns: Vec<SpikesIn>,
    labels: Vec<bool>,
    start: Option<PyReadonlyArray1<'py, f64>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<TrainedOut> {
    let tempotron: Tempotron = parsed("Tempotron", parameters)?;
    let patterns = to_patterns(patterns);
    let start = start.as_ref().map(|s| slice("start", s)).transpose()?;
    train(py, tempotron.max_seconds, progress, |report, stop| tempotron.fit(&patterns, &labels, start, report, stop))
}

/// Highest potential, its time, time of the spike (infinite where there is none).
#[pyfunction]
pub fn peak_tempotron(
    py: Python<'_>,
    parameters: &str,
    weights: PyReadonlyArray1<'_, f64>,
    pattern: SpikesIn,
) -> PyResult<(f64, f64, f64)> {
    let tempotron: Tempotron = parsed("Tempotron", parameters)?;
    let weights = slice("weights", &weights)?;
    let peak = enter(py, |_| tempotron.peak(weights, &pattern.0))?;
    Ok((peak.v_max, peak.t_max, peak.t_spike.unwrap_or(f64::INFINITY)))
}

/// What one presentation changes, over the learning rate.
#[pyfunction]
pub fn change_tempotron<'py>(
    py: Python<'py>,
    parameters: &str,
    weights: PyReadonlyArray1<'py, f64>,
    pattern: SpikesIn,
    label: bool,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let tempotron: Tempotron = parsed("Tempotron", parameters)?;
    let weights = slice("weights", &weights)?;
    let change = enter(py, |_| tempotron.change(weights, &pattern.0, label))?;
    Ok(array(py, change))
}

/// Checks patterns for SKIM, with their targets where they are to be learnt; how many rows each has.
#[pyfunction]
pub fn rows_skim(
    py: Python<'_>,
    parameters: &str,
    patterns: Vec<SpikesIn>,
    targets: Option<Vec<PyReadonlyArray1<'_, f64>>>,
) -> PyResult<Vec<usize>> {
    let skim: Skim = parsed("SKIM", parameters)?;
    let (patterns, targets) = (to_patterns(patterns), targets.as_deref().map(to_targets).transpose()?);
    enter(py, |_| skim.rows(&patterns, targets.as_deref()))
}

/// A neuron with spike-timing-dependent plasticity, in one stream of time.
#[pyclass(frozen, name = "STDP")]
pub struct Plastic(Exclusive<StdpNeuron>);

#[pymethods]
impl Plastic {
    #[new]
    fn new(parameters: &str, trains: usize) -> PyResult<Self> {
        let parameters: Stdp = parsed("STDP", parameters)?;
        Ok(Self(Exclusive::new(StdpNeuron::new(&parameters, trains).map_err(core)?)))
    }

    #[getter]
    fn weights<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        array(py, self.0.with(py, |neuron| neuron.weights().to_vec()))
    }

    fn set_weights(&self, py: Python<'_>, weights: PyReadonlyArray1<'_, f64>) -> PyResult<()> {
        let weights = slice("weights", &weights)?;
        self.0.enter(py, |neuron, _| neuron.set_weights(weights))
    }

    fn rest(&self, py: Python<'_>) {
        self.0.with(py, StdpNeuron::rest);
    }

    fn push<'py>(&self, py: Python<'py>, piece: SpikesIn, learn: bool) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(array(py, self.0.enter(py, |neuron, stop| neuron.push(&piece.0, learn, stop))?))
    }
}

/// What is known of the parameters of a learner: defaults, what must be given, ranges.
#[pyfunction]
pub fn parameters(name: &str) -> PyResult<Plain<Value>> {
    let described = match name {
        "stdp" => Stdp::described(),
        "tempotron" => Tempotron::described(),
        "skim" => Skim::described(),
        _ if EpochLearner::NAMES.contains(&name) => EpochLearner::described(name),
        _ => return Err(unknown(name)),
    };
    Ok(Plain(described.to_json()))
}

/// Checks the parameters of a learner, which are JSON; gives them back with every default filled in.
#[pyfunction]
pub fn check_parameters(name: &str, parameters: &str) -> PyResult<Plain<Value>> {
    match name {
        "stdp" => checked("STDP", parameters, Stdp::check),
        "tempotron" => checked("Tempotron", parameters, Tempotron::check),
        "skim" => checked("skim", parameters, Skim::check),
        _ if EpochLearner::NAMES.contains(&name) => Ok(json!(to_epoch_learner(parameters)?)),
        _ => Err(unknown(name)),
    }
    .map(Plain)
}
