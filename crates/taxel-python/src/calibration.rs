//! The law of fabric, amplifier and ramp, for calibrations: forces from ticks, and back.

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use taxel_core::circuit::Ramp;
use taxel_core::contact::Sensor;
use taxel_core::{Result, reading};

use taxel_border::convert::{array, slice};
use taxel_border::enter::enter;
use taxel_border::errors::core;
use taxel_border::parameters::Plain;

fn law(json: &str) -> Result<Sensor> {
    let sensor: Sensor = reading::from_text(json).map_err(|unfit| unfit.scene("law"))?;
    sensor.check()?;
    Ok(sensor)
}

/// Gives all parameters of a law, checked.
#[pyfunction]
pub fn check_law(json: &str) -> PyResult<Plain<Sensor>> {
    law(json).map(Plain).map_err(core)
}

/// Gives what a taxel without spread reads at rest, ticks.
#[pyfunction]
pub fn law_rest(json: &str, ramp: f64) -> PyResult<f64> {
    Ok(Ramp::rc(ramp).ticks(law(json).map_err(core)?.volts(0.0)))
}

/// Gives forces in N of readings in ticks, each with its rest; or, `back`, the readings of forces.
#[pyfunction]
pub fn law_of<'py>(
    py: Python<'py>,
    json: &str,
    ramp: f64,
    values: PyReadonlyArray1<'py, f64>,
    rest: PyReadonlyArray1<'py, f64>,
    back: bool,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (values, rest) = (slice("values", &values)?, slice("rest", &rest)?);
    let out = enter(py, |_| -> Result<Vec<f64>> {
        let sensor = law(json)?;
        let convert = |(&value, &rest): (&f64, &f64)| {
            if back { sensor.reading(value, rest, ramp) } else { sensor.force(value, rest, ramp) }
        };
        Ok(values.iter().zip(rest).map(convert).collect())
    })?;
    Ok(array(py, out))
}
