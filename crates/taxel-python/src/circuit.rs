//! The array's circuit: voltages of networks, ticks of voltages.

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use taxel_core::Result;
use taxel_core::circuit::{Adaptive, Converter, ConverterScan, Divider, Fabric, VirtualGround};

use taxel_border::convert::{Column, array, column, slice};
use taxel_border::enter::enter;
use taxel_border::parameters::parsed;

type Values<'py> = Bound<'py, PyArray1<f64>>;

/// The signals of one comparator, by name.
#[derive(IntoPyObject)]
pub(crate) struct TraceOut<'py> {
    t_us: Values<'py>,
    line_v: Values<'py>,
    input_v: Values<'py>,
    ramp_v: Values<'py>,
    high: Bound<'py, PyArray1<bool>>,
}

/// Gives conductances in uS of forces in N; or, `back`, forces of conductances.
#[pyfunction]
pub fn fabric<'py>(
    py: Python<'py>,
    json: &str,
    values: PyReadonlyArray1<'py, f64>,
    back: bool,
) -> PyResult<Values<'py>> {
    let (fabric, values): (Fabric, _) = (parsed("Fabric", json)?, slice("values", &values)?);
    let convert = |&value: &f64| if back { fabric.force_n(value) } else { fabric.conductance_us(value) };
    Ok(array(py, values.iter().map(convert).collect()))
}

enum Lines {
    Held(VirtualGround),
    Divided(Divider),
}

impl Lines {
    fn parsed_as(kind: &str, json: &str) -> PyResult<Self> {
        Ok(if kind == "divider" {
            Self::Divided(parsed("Divider", json)?)
        } else {
            Self::Held(parsed("VirtualGround", json)?)
        })
    }

    fn volts_alone(&self, conductance_us: f64) -> f64 {
        match self {
            Self::Held(lines) => lines.volts_alone(conductance_us).clamp(0.0, lines.rail_v),
            Self::Divided(lines) => lines.volts_alone(conductance_us),
        }
    }

    fn volts(&self, rows: usize, columns: usize, conductance_us: &[f64]) -> Result<Vec<f64>> {
        match self {
            Self::Held(lines) => lines.volts(rows, columns, conductance_us),
            Self::Divided(lines) => lines.volts(rows, columns, conductance_us),
        }
    }
}

/// Gives the sense lines' voltages of frame after frame of conductances in uS.
#[pyfunction]
pub fn circuit_volts<'py>(
    py: Python<'py>,
    kind: &str,
    json: &str,
    shape: (usize, usize),
    conductance_us: PyReadonlyArray1<'py, f64>,
) -> PyResult<Values<'py>> {
    let (lines, (rows, columns)) = (Lines::parsed_as(kind, json)?, shape);
    let frames = slice("conductance", &conductance_us)?;
    let out = enter(py, |stop| -> Result<Vec<f64>> {
        let mut out = vec![];
        for frame in frames.chunks((rows * columns).max(1)) {
            stop.check()?;
            let volts = lines.volts(rows, columns, frame)?;
            if out.is_empty() {
                // One frame alone is handed on as it is.
                out = volts;
                out.reserve_exact(frames.len() - out.len());
            } else {
                out.extend(volts);
            }
        }
        Ok(out)
    })?;
    Ok(array(py, out))
}

/// Gives the voltage that each conductance would make by itself.
#[pyfunction]
pub fn circuit_volts_alone<'py>(
    py: Python<'py>,
    kind: &str,
    json: &str,
    conductance_us: PyReadonlyArray1<'py, f64>,
) -> PyResult<Values<'py>> {
    let (lines, values) = (Lines::parsed_as(kind, json)?, slice("conductance", &conductance_us)?);
    Ok(array(py, values.iter().map(|&g| lines.volts_alone(g)).collect()))
}

/// Gives ticks of frame after frame of voltages; not a number where a comparator had not returned.
#[pyfunction]
pub fn converter_ticks<'py>(
    py: Python<'py>,
    json: &str,
    shape: (usize, usize),
    volts: PyReadonlyArray1<'py, f64>,
) -> PyResult<Values<'py>> {
    let (converter, (rows, columns)): (Converter, _) = (parsed("Converter", json)?, shape);
    let frames = slice("volts", &volts)?;
    let out = enter(py, |stop| -> Result<Vec<f64>> {
        let mut scan = ConverterScan::new(converter, rows, columns)?;
        let mut out = vec![0.0; frames.len()];
        let taxels = (rows * columns).max(1);
        for (volts, ticks) in frames.chunks(taxels).zip(out.chunks_mut(taxels)) {
            stop.check()?;
            scan.frame(volts, ticks);
        }
        Ok(out)
    })?;
    Ok(array(py, out))
}

/// Gives where the ramp stands after ticks, V; or, `back`, when it passes voltages.
#[pyfunction]
pub fn converter_ramp<'py>(
    py: Python<'py>,
    json: &str,
    values: PyReadonlyArray1<'py, f64>,
    back: bool,
) -> PyResult<Values<'py>> {
    let (ramp, values) = (parsed::<Converter>("Converter", json)?.ramp(), slice("values", &values)?);
    let convert = |&value: &f64| if back { ramp.ticks(value) } else { ramp.volts(value) };
    Ok(array(py, values.iter().map(convert).collect()))
}

/// Gives the signals of one comparator, as an oscilloscope would show them.
#[pyfunction]
pub fn converter_trace<'py>(
    py: Python<'py>,
    json: &str,
    line_v: Vec<f64>,
    every_us: f64,
    stop_us: f64,
) -> PyResult<TraceOut<'py>> {
    let converter: Converter = parsed("Converter", json)?;
    let seen = enter(py, |_| converter.trace(&line_v, every_us, stop_us))?;
    let column = |value: fn(&taxel_core::circuit::Moment) -> f64| array(py, seen.iter().map(value).collect());
    let high = array(py, seen.iter().map(|m| m.high).collect());
    let (t_us, line_v, input_v, ramp_v) =
        (column(|m| m.t_us), column(|m| m.line_v), column(|m| m.input_v), column(|m| m.ramp_v));
    Ok(TraceOut { t_us, line_v, input_v, ramp_v, high })
}

/// us and ramp in ticks of each frame; ticks and V of all readings.
#[pyclass(frozen, get_all)]
pub struct Converted {
    t_us: Column<f64>,
    ramp: Column<u32>,
    ticks: Column<f64>,
    volts: Column<f64>,
}

/// Converts voltages that go on, frame after frame, by a ramp that adapts.
#[pyfunction]
pub fn adaptive_convert(
    py: Python<'_>,
    json: &str,
    shape: (usize, usize),
    volts: PyReadonlyArray1<'_, f64>,
    period_us: f64,
) -> PyResult<Converted> {
    let (adaptive, volts): (Adaptive, _) = (parsed("AdaptiveRamp", json)?, slice("volts", &volts)?);
    let out = enter(py, |stop| adaptive.convert(volts, period_us, shape.0, shape.1, stop))?;
    let (t_us, ramp) = (column(py, out.t_us), column(py, out.ramp));
    Ok(Converted { t_us, ramp, ticks: column(py, out.ticks), volts: column(py, out.volts) })
}
