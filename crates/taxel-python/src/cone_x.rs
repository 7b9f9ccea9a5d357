//! CONE-X.

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use taxel_core::learn::{
    self as core_learn, ConeX, ConeXFit, Fit, GapMultipliers, Left, Margin, Round, Row, StatedRow,
};
use taxel_core::problem;

use taxel_border::convert::{Column, SpikesIn, array, column, slice, to_patterns, to_targets};
use taxel_border::enter::{enter, enter_keeping};
use taxel_border::errors::core;
use taxel_border::parameters::valid;

/// A row by name: kind, pattern, and target or time (ms).
type Name = (String, usize, f64);

fn to_row((kind, pattern, at): &Name) -> PyResult<Row> {
    let (pattern, t) = (*pattern, *at);
    match kind.as_str() {
        "silence" => Ok(Row::Silence { pattern, t }),
        "target" => Ok(Row::Target { pattern, target: target_index(t)? }),
        "slope" => Ok(Row::Slope { pattern, target: target_index(t)? }),
        _ => Err(core(problem!("row of kind {kind:?}: must be \"target\", \"silence\" or \"slope\""))),
    }
}

fn target_index(target: f64) -> PyResult<usize> {
    if target >= 0.0 && target.fract() == 0.0 && target < 2f64.powi(53) {
        Ok(target as usize)
    } else {
        Err(core(problem!("target {target}: must be a whole number, 0 or more")))
    }
}

fn from_row(row: Row) -> Name {
    match row {
        Row::Silence { pattern, t } => ("silence".into(), pattern, t),
        Row::Target { pattern, target } => ("target".into(), pattern, target as f64),
        Row::Slope { pattern, target } => ("slope".into(), pattern, target as f64),
    }
}

/// Rows and their multipliers.
pub(crate) type Weighed = (Vec<Name>, Column<f64>);

pub(crate) fn weighed(py: Python<'_>, rows: &[(Row, f64)]) -> Weighed {
    (rows.iter().map(|r| from_row(r.0)).collect(), column(py, rows.iter().map(|r| r.1).collect()))
}

/// The proof of a gap: multipliers of rows, of B by target, of the l2 term by synapse.
pub(crate) type ProofOut = (Weighed, (Vec<(usize, usize)>, Column<f64>), Column<f64>);

pub(crate) fn proof_out(py: Python<'_>, proof: GapMultipliers) -> ProofOut {
    let (behind, slopes): (Vec<_>, Vec<_>) = proof.behind.into_iter().unzip();
    (weighed(py, &proof.rows), (behind, column(py, slopes)), column(py, proof.pull))
}

/// Why no weights solve a problem.
#[pyclass(frozen, get_all)]
pub struct ConeXCertificate {
    rows: Weighed,
    gap: f64,
    /// Whether it needs no margin.
    at_all: bool,
    text: String,
}

/// A fit.
#[pyclass(frozen, get_all, name = "ConeXFit")]
pub struct ConeXFitOut {
    status: &'static str,
    weights: Column<f64>,
    objective: f64,
    /// The parts of l1, l2 and B.
    parts: [f64; 3],
    gap: f64,
    violation: f64,
    /// The margin that holds, and the one that was asked for.
    margin: (f64, f64),
    asked: (f64, f64),
    rounds: usize,
    held: Weighed,
    certificate: Option<Py<ConeXCertificate>>,
    /// Why it is stopped.
    reason: Option<String>,
    /// The multipliers that prove its gap.
    proof: Option<ProofOut>,
    /// The exception of a signal that came meanwhile.
    raised: Option<Py<PyAny>>,
}

/// Coefficients and limit of a row.
type RowOut<'py> = (Bound<'py, PyArray1<f64>>, f64);

/// A stated problem.
#[pyclass(frozen)]
pub struct ConeXProblem {
    problem: core_learn::ConeXProblem,
    max_seconds: Option<f64>,
}

#[pymethods]
impl ConeXProblem {
    #[new]
    fn new(
        py: Python<'_>,
        parameters: &str,
        patterns: Vec<SpikesIn>,
        targets: Vec<PyReadonlyArray1<'_, f64>>,
    ) -> PyResult<Self> {
        let parameters = valid("ConeX", parameters, ConeX::check)?;
        let (patterns, targets) = (to_patterns(patterns), to_targets(&targets)?);
        let problem = enter(py, |stop| core_learn::ConeXProblem::new(&parameters, &patterns, &targets, stop))?;
        Ok(Self { problem, max_seconds: parameters.max_seconds })
    }

    /// The margin of its rows, mV and mV/ms.
    fn margin(&self) -> (f64, f64) {
        let Margin { height, slope } = self.problem.margin();
        (height, slope)
    }

    fn with_margin(&self, py: Python<'_>, height: f64, slope: f64) -> PyResult<Self> {
        let margin = Margin { height, slope };
        let problem = enter(py, |stop| self.problem.with_margin(margin, stop))?;
        Ok(Self { problem, max_seconds: self.max_seconds })
    }

    /// Least and largest weights.
    fn bounds<'py>(&self, py: Python<'py>) -> (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>) {
        let bounds = self.problem.bounds();
        (array(py, bounds.lower), array(py, bounds.upper))
    }

    /// A row, with or without its margin.
    fn row<'py>(&self, py: Python<'py>, name: Name, margin: bool) -> PyResult<RowOut<'py>> {
        let StatedRow { coefficients, limit } = self.problem.row(to_row(&name)?, margin).map_err(core)?;
        Ok((array(py, coefficients), limit))
    }

    /// The row of B behind a target, and the value that it aims at.
    fn behind<'py>(&self, py: Python<'py>, pattern: usize, target: usize) -> PyResult<RowOut<'py>> {
        let StatedRow { coefficients, limit } = self.problem.behind(pattern, target).map_err(core)?;
        Ok((array(py, coefficients), limit))
    }

    #[pyo3(signature = (start, multipliers, progress))]
    fn fit(
        &self,
        py: Python<'_>,
        start: Vec<Name>,
        multipliers: PyReadonlyArray1<'_, f64>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<ConeXFitOut> {
        let multipliers = slice("multipliers", &multipliers)?;
        let rows = start.iter().map(to_row).collect::<PyResult<Vec<_>>>()?;
        let start: Vec<(Row, f64)> = rows.into_iter().zip(multipliers.iter().copied()).collect();
        let (found, raised) = enter_keeping(py, self.max_seconds, |stop, caller| {
            let mut report = |round: Round| {
                let Round { round, rows, objective, left: Left::Broken(broken) } = round else { return };
                caller.call(progress.as_ref(), |py, function| function.call1(py, (round, rows, broken, objective)));
            };
            self.problem.fit(&start, &mut report, stop)
        })?;
        let ConeXFit { fit, violation, margin, asked, reason, held, certificate, proof } = found;
        let Fit { status, weights, objective, parts, gap, rounds } = fit;
        let certificate = certificate.map(|c| {
            let rows = weighed(py, &c.rows);
            Py::new(py, ConeXCertificate { rows, gap: c.gap, at_all: c.at_all, text: c.text })
        });
        let [margin, asked] = [margin, asked].map(|m| (m.height, m.slope));
        Ok(ConeXFitOut {
            status: status.name(),
            weights: column(py, weights),
            objective,
            parts: [parts.l1, parts.l2, parts.B],
            gap,
            violation,
            margin,
            asked,
            rounds,
            held: weighed(py, &held),
            certificate: certificate.transpose()?,
            reason,
            proof: proof.map(|proof| proof_out(py, proof)),
            raised,
        })
    }
}
