//! Learners.

use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use serde_json::{Map, Value};
use taxel_core::learn as core_learn;
use taxel_core::learn::{ConeR, ConeRFit, Fit, Left, Round, Shares};
use taxel_core::problem;

use crate::cone_x::{ProofOut, proof_out};
use taxel_border::convert::{Column, SpikesIn, column, slice, to_patterns, to_targets};
use taxel_border::enter::{Exclusive, enter, enter_keeping};
use taxel_border::errors::core;
use taxel_border::parameters::{parsed, valid};

/// The parameters of [`ConeR`], and how many patterns the window holds.
pub(crate) fn to_online(json: &str) -> PyResult<(ConeR, usize)> {
    let mut parameters: Map<String, Value> = parsed("OnlineConeR", json)?;
    let window = parameters.remove("window").unwrap_or(Value::Null);
    let window = window.as_u64().and_then(|window| usize::try_from(window).ok());
    let window = window.ok_or_else(|| core(problem!("window"; ": must be a whole number, 1 or more")))?;
    Ok((valid("ConeR", &Value::Object(parameters).to_string(), ConeR::check)?, window))
}

/// Multipliers of a start as Python holds them: rows, and a share each.
type MultipliersIn<'py> = (PyReadonlyArray1<'py, i64>, PyReadonlyArray1<'py, f64>);

/// A fit.
#[pyclass(frozen, get_all, name = "ConeRFit")]
pub struct ConeRFitOut {
    weights: Column<f64>,
    objective: f64,
    /// The parts of l1, l2, B, C and D.
    parts: [f64; 5],
    gap: f64,
    status: &'static str,
    rounds: usize,
    rows: usize,
    unreachable: Vec<(usize, usize)>,
    refires: usize,
    fired: (usize, usize),
    /// For a start: rows, and a share each.
    multipliers: (Column<i64>, Column<f64>),
    /// The multipliers that prove the gap.
    proof: ProofOut,
    /// The exception of a signal that ended it early.
    raised: Option<Py<PyAny>>,
}

/// The rows of one set of examples.
#[pyclass(frozen)]
pub struct ConeRProblem(core_learn::ConeRProblem);

#[pymethods]
impl ConeRProblem {
    #[new]
    fn new(
        py: Python<'_>,
        parameters: &str,
        patterns: Vec<SpikesIn>,
        targets: Vec<PyReadonlyArray1<'_, f64>>,
        silence: Vec<Option<PyReadonlyArray1<'_, f64>>>,
    ) -> PyResult<Self> {
        let parameters = valid("ConeR", parameters, ConeR::check)?;
        let (patterns, targets) = (to_patterns(patterns), to_targets(&targets)?);
        let silence = silence.iter().map(to_windows).collect::<PyResult<Vec<_>>>()?;
        enter(py, |stop| core_learn::ConeRProblem::new(&parameters, &patterns, &targets, &silence, stop)).map(Self)
    }

    /// How many rows demand silence.
    #[getter]
    fn silent_rows(&self) -> usize {
        self.0.silent_rows()
    }

    /// All rows, grid points without a requirement included.
    #[getter]
    fn rows(&self) -> usize {
        self.0.rows()
    }

    #[pyo3(signature = (parameters, silent, start, progress))]
    fn fit(
        &self,
        py: Python<'_>,
        parameters: &str,
        silent: PyReadonlyArray1<'_, f64>,
        start: Option<StartIn<'_>>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<ConeRFitOut> {
        let parameters = valid("ConeR", parameters, ConeR::check)?;
        let silent = slice("silent", &silent)?;
        let start = start.as_ref().map(to_start).transpose()?;
        let start = start.as_ref().map(|(weights, multipliers)| (*weights, multipliers.as_ref()));
        let (fit, raised) = enter_keeping(py, parameters.max_seconds, |stop, caller| {
            let mut report = |round: Round| {
                let Round { round, rows, objective, left: Left::Gap(gap) } = round else { return };
                caller.call(progress.as_ref(), |py, function| function.call1(py, (round, rows, objective, gap)));
            };
            self.0.fit(&parameters, silent, start, None, &mut report, stop)
        })?;
        Ok(fit_out(py, fit, raised))
    }
}

/// A sliding window of patterns and its last fit.
#[pyclass(frozen)]
pub struct OnlineConeR {
    window: Exclusive<core_learn::OnlineConeR>,
    max_seconds: Option<f64>,
}

#[pymethods]
impl OnlineConeR {
    #[new]
    fn new(parameters: &str) -> PyResult<Self> {
        let (parameters, window) = to_online(parameters)?;
        let window = core_learn::OnlineConeR::new(&parameters, window).map_err(core)?;
        Ok(Self { window: Exclusive::new(window), max_seconds: parameters.max_seconds })
    }

    #[getter]
    fn patterns(&self, py: Python<'_>) -> usize {
        self.window.with(py, |window| window.patterns())
    }

    #[getter]
    fn silent_rows(&self, py: Python<'_>) -> usize {
        self.window.with(py, |window| window.silent_rows())
    }

    #[pyo3(signature = (pattern, targets, silence = None))]
    fn add(
        &self,
        py: Python<'_>,
        pattern: SpikesIn,
        targets: PyReadonlyArray1<'_, f64>,
        silence: Option<PyReadonlyArray1<'_, f64>>,
    ) -> PyResult<()> {
        let targets = slice("targets", &targets)?;
        let silence = to_windows(&silence)?;
        self.window.enter(py, |window, stop| window.add(&pattern.0, targets, silence.as_deref(), stop))
    }

    fn fit(&self, py: Python<'_>) -> PyResult<ConeRFitOut> {
        let (fit, raised) = enter_keeping(py, self.max_seconds, |stop, _| self.window.lock().fit(&mut |_| {}, stop))?;
        Ok(fit_out(py, fit, raised))
    }
}

/// Windows of silence, given as start, stop, start, stop ...
fn to_windows(silence: &Option<PyReadonlyArray1<'_, f64>>) -> PyResult<Option<Vec<[f64; 2]>>> {
    let windows = silence.as_ref().map(|ends| slice("silence", ends)).transpose()?;
    Ok(windows.map(|ends| ends.chunks_exact(2).map(|window| [window[0], window[1]]).collect()))
}

/// Weights of an earlier fit, and its multipliers where it was of the same rows.
type StartIn<'py> = (PyReadonlyArray1<'py, f64>, Option<MultipliersIn<'py>>);

fn to_start<'a>((weights, multipliers): &'a StartIn<'_>) -> PyResult<(&'a [f64], Option<Shares>)> {
    let multipliers = multipliers.as_ref().map(|(rows, shares)| -> PyResult<Shares> {
        let rows = slice("start", rows)?.iter().map(|&row| usize::try_from(row).unwrap_or(usize::MAX));
        Ok(rows.zip(slice("start", shares)?.iter().copied()).collect())
    });
    let multipliers = multipliers.transpose()?;
    Ok((slice("start", weights)?, multipliers))
}

fn fit_out(py: Python<'_>, found: ConeRFit, raised: Option<Py<PyAny>>) -> ConeRFitOut {
    let ConeRFit { fit, rows, multipliers, proof, unreachable, refires, fired } = found;
    let Fit { status, weights, objective, parts, gap, rounds } = fit;
    let (numbers, shares) = multipliers.into_iter().map(|(row, share)| (row as i64, share)).unzip();
    ConeRFitOut {
        weights: column(py, weights),
        objective,
        parts: [parts.l1, parts.l2, parts.B, parts.C, parts.D],
        gap,
        status: status.name(),
        rounds,
        rows,
        unreachable,
        refires,
        fired,
        multipliers: (column(py, numbers), column(py, shares)),
        proof: proof_out(py, proof),
        raised,
    }
}
