//! Learners.

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use taxel_core::learn::{ConeR, Fit, Problem, Round, Status};
use taxel_core::problem;

use crate::convert::{SpikesIn, array, slice, to_spikes};
use crate::enter::enter;
use crate::errors::core;

fn to_cone_r(json: &str) -> PyResult<ConeR> {
    let parameters: ConeR = serde_json::from_str(json).map_err(|e| core(problem!("ConeR: {e}")))?;
    parameters.check().map_err(core)?;
    Ok(parameters)
}

/// Checks parameters; gives them back with every default filled in.
#[pyfunction]
fn check_cone_r(parameters: &str) -> PyResult<String> {
    serde_json::to_string(&to_cone_r(parameters)?).map_err(|e| core(problem!("ConeR: {e}")))
}

/// A fit as Python gets it: weights, objective, parts, gap, rounds, rows, solved, unreachable, refires.
type FitOut<'py> = (Bound<'py, PyArray1<f64>>, f64, [f64; 5], f64, usize, usize, bool, Vec<(usize, usize)>, usize);

/// The rows of one set of examples.
#[pyclass(frozen)]
struct ConeRProblem(Problem);

#[pymethods]
impl ConeRProblem {
    #[new]
    fn new(
        py: Python<'_>,
        parameters: &str,
        patterns: Vec<SpikesIn<'_>>,
        targets: Vec<PyReadonlyArray1<'_, f64>>,
    ) -> PyResult<Self> {
        let parameters = to_cone_r(parameters)?;
        let patterns = patterns.into_iter().map(to_spikes).collect::<PyResult<Vec<_>>>()?;
        let targets = targets.iter().map(|t| slice("targets", t).map(<[f64]>::to_vec)).collect::<PyResult<Vec<_>>>()?;
        enter(py, |stop| Problem::new(&parameters, &patterns, &targets, stop)).map(Self)
    }

    /// How many rows demand silence.
    #[getter]
    fn silent_rows(&self) -> usize {
        self.0.silent_rows()
    }

    #[pyo3(signature = (parameters, start, progress))]
    fn fit<'py>(
        &self,
        py: Python<'py>,
        parameters: &str,
        start: Option<PyReadonlyArray1<'py, f64>>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<FitOut<'py>> {
        let parameters = to_cone_r(parameters)?;
        let start = start.as_ref().map(|s| slice("start", s)).transpose()?;
        let mut raised = None;
        let mut report = |r: Round| {
            if let (Some(progress), None) = (&progress, &raised) {
                let called = Python::attach(|py| progress.call1(py, (r.round, r.rows, r.objective, r.gap)).map(drop));
                raised = called.err();
            }
        };
        let fit = enter(py, |stop| self.0.fit(&parameters, start, &mut report, stop))?;
        if let Some(error) = raised {
            return Err(error);
        }
        let Fit { weights, objective, parts, gap, rounds, rows, status, unreachable, refires } = fit;
        let parts = [parts.l1, parts.l2, parts.B, parts.C, parts.D];
        let solved = status == Status::Solved;
        Ok((array(py, weights), objective, parts, gap, rounds, rows, solved, unreachable, refires))
    }
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(check_cone_r, module)?)?;
    module.add_class::<ConeRProblem>()
}
