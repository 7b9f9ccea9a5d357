//! The neuron.

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use taxel_core::neuron::Neuron;

use taxel_border::convert::{SpikesIn, array, slice};
use taxel_border::enter::enter;
use taxel_border::parameters::valid;

/// Times (ms) and slopes (mV/ms) of output spikes.
type OutputSpikes<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

/// Times and slopes of the output spikes.
#[pyfunction]
pub fn neuron_run<'py>(
    py: Python<'py>,
    parameters: &str,
    weights: PyReadonlyArray1<'py, f64>,
    trains: SpikesIn,
    threshold: f64,
) -> PyResult<OutputSpikes<'py>> {
    let (neuron, SpikesIn(trains)) = (valid("neuron", parameters, Neuron::check)?, trains);
    let weights = slice("weights", &weights)?;
    let spikes = enter(py, |stop| neuron.run(weights, &trains, threshold, stop))?;
    let (times, slopes) = spikes.iter().map(|s| (s.t, s.slope)).unzip();
    Ok((array(py, times), array(py, slopes)))
}

/// The potential at these times.
#[pyfunction]
pub fn neuron_potential<'py>(
    py: Python<'py>,
    parameters: &str,
    weights: PyReadonlyArray1<'py, f64>,
    trains: SpikesIn,
    times: PyReadonlyArray1<'py, f64>,
    spikes: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (neuron, SpikesIn(trains)) = (valid("neuron", parameters, Neuron::check)?, trains);
    let (weights, times, spikes) = (slice("weights", &weights)?, slice("times", &times)?, slice("spikes", &spikes)?);
    let potential = enter(py, |stop| neuron.potential(weights, &trains, times, spikes, stop))?;
    Ok(array(py, potential))
}
