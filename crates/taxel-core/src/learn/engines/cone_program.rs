//! The convex program over a few rows, as a cone program for Clarabel.
//!
//! Minimise `linear.w + l1 |w|_1 + l2 |w|_2 (or |w|_2^2) + quadratic |B w|^2 + sum_i weight_i max(r_i.w - limit_i, 0)` over
//! a box, equality rows and hard inequality rows. With `kinks`, `|max(kinks - B w, 0)|^2` is in place of `|B w|^2`. Each
//! hinge gets one slack variable, so its dense row is stored once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultInfo, DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SecondOrderConeT, SupportedConeT,
    ZeroConeT,
};

use crate::learn::statement::Norm;
use crate::vectors::dot;
use crate::{Result, Stop, problem};

/// A sum of hinges, `weight_i max(r_i.w - limit_i, 0)`; the rows are stored one after the other.
#[derive(Debug, Default)]
pub(crate) struct Hinges {
    pub(crate) rows: Vec<f64>,
    pub(crate) limit: Vec<f64>,
    pub(crate) weight: Vec<f64>,
}

/// Rows that must be satisfied, stored one after the other: `equal.w = equal_to`, `below.w <= limit`.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct HardRows<'a> {
    pub(crate) equal: &'a [f64],
    pub(crate) equal_to: &'a [f64],
    pub(crate) below: &'a [f64],
    pub(crate) limit: &'a [f64],
}

/// The whole program.
#[derive(Debug)]
pub(crate) struct ConeProgram<'a> {
    pub(crate) linear: &'a [f64],
    pub(crate) l1: f64,
    pub(crate) l2: f64,
    pub(crate) norm: Norm,
    /// Half the curvature of `B`, and its rows, stored one after the other.
    pub(crate) quadratic: f64,
    pub(crate) behind: &'a [f64],
    /// The value of each row of `B` from which on it contributes nothing; empty if none does.
    pub(crate) kinks: Vec<f64>,
    /// `B'B`, by columns.
    pub(crate) gram: &'a [f64],
    /// Least and largest value of each weight.
    pub(crate) bounds: Vec<[f64; 2]>,
    pub(crate) hinges: &'a Hinges,
    pub(crate) hard: HardRows<'a>,
}

/// The solver's result; the caller checks whether it is optimal.
#[derive(Debug)]
pub(crate) struct Answer {
    pub(crate) weights: Vec<f64>,
    /// The multiplier of each hinge, between 0 and its weight.
    pub(crate) multipliers: Vec<f64>,
    /// The multiplier of each hard row; those of inequalities are at least 0.
    pub(crate) equality: Vec<f64>,
    pub(crate) inequality: Vec<f64>,
    /// The vector that represents `l2 |w|_2` in the dual, no longer than `l2`; zeros without that term.
    pub(crate) pull: Vec<f64>,
}

/// Coefficients below this change a potential by less than its rounding error.
const NOTHING: f64 = 1e-14;

/// A sparse matrix, filled column after column.
struct SparseMatrix {
    pointers: Vec<usize>,
    rows: Vec<usize>,
    values: Vec<f64>,
}

impl SparseMatrix {
    fn new() -> Self {
        Self { pointers: vec![0], rows: vec![], values: vec![] }
    }

    fn put(&mut self, row: usize, value: f64) {
        if value.abs() > NOTHING {
            self.rows.push(row);
            self.values.push(value);
        }
    }

    fn end(&mut self) {
        self.pointers.push(self.rows.len());
    }

    fn matrix(self, rows: usize) -> CscMatrix<f64> {
        CscMatrix::new(rows, self.pointers.len() - 1, self.pointers, self.rows, self.values)
    }
}

impl ConeProgram<'_> {
    /// Solves the program to a relative gap of about `tolerance`, with all costs multiplied by `scale` (so that they
    /// are about 1).
    pub(crate) fn solve(&self, scale: f64, tolerance: f64, stop: Stop<'_>) -> Result<Answer> {
        let n = self.linear.len();
        let (m, k) = (self.hinges.limit.len(), self.behind.len() / n.max(1));
        let quadratic = self.quadratic * scale;
        // B as a dense n x n block costs nothing extra if the hinges fill that block anyway; otherwise its few rows are
        // cheaper.
        let short = if quadratic > 0.0 { self.kinks.len() } else { 0 };
        let factored = quadratic > 0.0 && short == 0 && m + k < n;
        let dense = quadratic > 0.0 && short == 0 && !factored;
        // The absolute value of a weight whose bounds have the same sign is linear.
        let astride = |[lower, upper]: [f64; 2]| self.l1 > 0.0 && lower < 0.0 && upper > 0.0;
        let absolute: Vec<usize> = (0..n).filter(|&j| astride(self.bounds[j])).collect();
        let normed = self.l2 > 0.0 && self.norm == Norm::Norm;

        // Variables, in this order: w, the hinges' slacks, |w| by synapse, |w|_2, B w or what it lacks.
        let slack = n;
        let size = slack + m;
        let length = size + absolute.len();
        let image = length + usize::from(normed);
        let variables = image + if factored { k } else { short };
        // Rows, in this order: B w - y = 0; equalities; r w - slack <= limit; slack >= 0; hard r w <= limit; -B w - y <=
        // -kinks; w <= upper; -w <= -lower; w - |w| <= 0; -w - |w| <= 0; the cone of |w|_2.
        let equal = if factored { k } else { 0 };
        let hinge = equal + self.hard.equal_to.len();
        let positive = hinge + m;
        let hard = positive + m;
        let lacking = hard + self.hard.limit.len();
        let above = lacking + short;
        let below = above + n;
        let plus = below + n;
        let minus = plus + absolute.len();
        let cone = minus + absolute.len();
        let rows = cone + if normed { n + 1 } else { 0 };

        let mut q = vec![0.0; variables];
        for ((q, &c), &bounds) in q.iter_mut().zip(self.linear).zip(&self.bounds) {
            let sign = if bounds[0] >= 0.0 { 1.0 } else { -1.0 };
            *q = scale * (c + if astride(bounds) { 0.0 } else { sign * self.l1 });
        }
        for (q, &c) in q[slack..size].iter_mut().zip(&self.hinges.weight) {
            *q = scale * c;
        }
        q[size..length].fill(scale * self.l1);
        if normed {
            q[length] = scale * self.l2;
        }

        let ridge = if self.norm == Norm::Square { 2.0 * scale * self.l2 } else { 0.0 };
        let mut p = SparseMatrix::new();
        for j in 0..n {
            if dense {
                for i in 0..=j {
                    p.put(i, 2.0 * quadratic * self.gram[j * n + i] + if i == j { ridge } else { 0.0 });
                }
            } else {
                p.put(j, ridge);
            }
            p.end();
        }
        for _ in n..image {
            p.end();
        }
        for j in image..variables {
            p.put(j, 2.0 * quadratic);
            p.end();
        }

        let mut a = SparseMatrix::new();
        let mut next = 0;
        for j in 0..n {
            if factored {
                for i in 0..k {
                    a.put(i, self.behind[i * n + j]);
                }
            }
            for i in 0..self.hard.equal_to.len() {
                a.put(equal + i, self.hard.equal[i * n + j]);
            }
            for i in 0..m {
                a.put(hinge + i, self.hinges.rows[i * n + j]);
            }
            for i in 0..self.hard.limit.len() {
                a.put(hard + i, self.hard.below[i * n + j]);
            }
            for i in 0..short {
                a.put(lacking + i, -self.behind[i * n + j]);
            }
            a.put(above + j, 1.0);
            a.put(below + j, -1.0);
            if absolute.get(next) == Some(&j) {
                a.put(plus + next, 1.0);
                a.put(minus + next, -1.0);
                next += 1;
            }
            if normed {
                a.put(cone + 1 + j, -1.0);
            }
            a.end();
        }
        for i in 0..m {
            a.put(hinge + i, -1.0);
            a.put(positive + i, -1.0);
            a.end();
        }
        for j in 0..absolute.len() {
            a.put(plus + j, -1.0);
            a.put(minus + j, -1.0);
            a.end();
        }
        if normed {
            a.put(cone, -1.0);
            a.end();
        }
        for i in 0..variables - image {
            a.put(if factored { i } else { lacking + i }, -1.0);
            a.end();
        }

        let mut b = vec![0.0; rows];
        b[equal..hinge].copy_from_slice(self.hard.equal_to);
        b[hinge..positive].copy_from_slice(&self.hinges.limit);
        b[hard..lacking].copy_from_slice(self.hard.limit);
        b[lacking..above].iter_mut().zip(&self.kinks).for_each(|(b, kink)| *b = -kink);
        for (j, [lower, upper]) in self.bounds.iter().enumerate() {
            b[above + j] = *upper;
            b[below + j] = -lower;
        }

        let mut cones: Vec<SupportedConeT<f64>> = Vec::new();
        if hinge > 0 {
            cones.push(ZeroConeT(hinge));
        }
        cones.push(NonnegativeConeT(cone - hinge));
        if normed {
            cones.push(SecondOrderConeT(n + 1));
        }

        let settings = DefaultSettings {
            verbose: false,
            // The tolerance is relative to the objective; the absolute one applies if the optimum is 0.
            tol_gap_abs: 1e-13,
            tol_gap_rel: tolerance,
            tol_feas: tolerance,
            // There are few rows and all matter; one thread, so that a fit is reproducible to the bit.
            presolve_enable: false,
            max_threads: 1,
            ..DefaultSettings::default()
        };
        let (p, a) = (p.matrix(variables), a.matrix(rows));
        let (x, z) = solve_stoppable(&p, &q, &a, &b, &cones, settings, stop)?;
        let weights = x[..n].iter().zip(&self.bounds).map(|(w, [lower, upper])| w.clamp(*lower, *upper)).collect();
        let hinged = z[hinge..positive].iter().zip(&self.hinges.weight);
        let multipliers = hinged.map(|(z, &most)| (z / scale).clamp(0.0, most)).collect();
        let mut pull = vec![0.0; n];
        if normed {
            let dual = &z[cone + 1..];
            let length = dot(dual, dual).sqrt();
            let shrink = (self.l2 / length.max(f64::MIN_POSITIVE)).min(1.0 / scale);
            pull.iter_mut().zip(dual).for_each(|(p, z)| *p = -z * shrink);
        }
        let equality = z[equal..hinge].iter().map(|z| z / scale).collect();
        let inequality = z[hard..lacking].iter().map(|z| (z / scale).max(0.0)).collect();
        Ok(Answer { weights, multipliers, equality, inequality, pull })
    }
}

/// Runs Clarabel in a second thread, while this one waits for a request to stop.
fn solve_stoppable(
    p: &CscMatrix<f64>,
    q: &[f64],
    a: &CscMatrix<f64>,
    b: &[f64],
    cones: &[SupportedConeT<f64>],
    settings: DefaultSettings<f64>,
    stop: Stop<'_>,
) -> Result<(Vec<f64>, Vec<f64>)> {
    let stopped = Arc::new(AtomicBool::new(false));
    let asked = Arc::clone(&stopped);
    let (done, wait) = std::sync::mpsc::channel::<()>();
    let solved = std::thread::scope(|scope| {
        let solving = scope.spawn(move || {
            let _done = done; // dropped when this thread ends, even by a panic
            let mut solver = DefaultSolver::new(p, q, a, b, cones, settings).map_err(|e| e.to_string())?;
            solver.set_termination_callback(move |_: &DefaultInfo<f64>| asked.load(Ordering::Relaxed));
            solver.solve();
            Ok::<_, String>((solver.solution.x, solver.solution.z))
        });
        while let Err(std::sync::mpsc::RecvTimeoutError::Timeout) = wait.recv_timeout(Duration::from_millis(10)) {
            if stop.asked() {
                stopped.store(true, Ordering::Relaxed);
            }
        }
        solving.join()
    });
    stop.check()?;
    match solved {
        Ok(Ok((x, z))) if x.iter().chain(&z).all(|v| v.is_finite()) => Ok((x, z)),
        Ok(Ok(_)) => Err(problem!(
            "the cone solver found no finite solution: check that no parameter is extremely large or small"
        )),
        Ok(Err(text)) => Err(problem!("the cone solver refuses the problem: {text}")),
        Err(panic) => std::panic::resume_unwind(panic),
    }
}
