//! The Newton matrix of an iteration, its factors, and the directions that follow from them.

use faer::Mat;

use super::super::dense::{Cholesky, add_gram, add_sum, outer, times};
use super::Interior;
use super::cone::Scaling;
use super::variables::{Complement, Direction, PrimalDual, Residual, Workspace};
use crate::learn::statement::Norm;
use crate::vectors::dot;

/// The relative accuracy of a linear system, and the largest number of refinements to reach it.
const REFINED: f64 = 1e-10;
const MOST_REFINEMENTS: usize = 3;
/// The curvature of a weight that cannot move.
const FIXED: f64 = 1e30;

/// A factored Newton matrix with everything needed to solve for a direction.
pub(super) struct Newton<'a> {
    pub(super) inner: &'a Interior<'a>,
    pub(super) state: &'a PrimalDual,
    pub(super) diagonal: Vec<f64>,
    pub(super) of_part: Vec<f64>,
    pub(super) ratio: Vec<f64>,
    pub(super) scaling: Option<Scaling>,
    /// The factor with which the equality rows are added to the matrix.
    pub(super) weight: f64,
    pub(super) factor: Cholesky,
    pub(super) schur: Option<Cholesky>,
}

impl Interior<'_> {
    pub(super) fn newton<'b>(&'b self, state: &'b PrimalDual, w: &[f64], room: &mut Workspace) -> Option<Newton<'b>> {
        let n = self.program.width();
        let of_part: Vec<f64> = self
            .parts
            .iter()
            .zip(&state.x)
            .zip(state.low.iter().zip(&state.high))
            .map(|((p, x), (low, high))| low / x + high / (p.range - x))
            .collect();
        let mut softness = vec![0.0; n];
        self.parts.iter().zip(&of_part).for_each(|(p, d)| softness[p.synapse] += 1.0 / d);
        let diagonal: Vec<f64> = softness.iter().map(|s| if *s > 0.0 { 1.0 / s } else { FIXED }).collect();
        let ratio: Vec<f64> = state.inequality.iter().zip(&state.slack).map(|(z, s)| z / s).collect();
        let mut matrix = std::mem::replace(&mut room.matrix, Mat::new());
        matrix.copy_from(&self.curvature);
        let scaled = &mut room.scaled;
        scaled.clear();
        scaled.extend_from_slice(&self.program.below);
        for (row, ratio) in scaled.chunks_exact_mut(n.max(1)).zip(&ratio) {
            let root = ratio.sqrt();
            row.iter_mut().for_each(|v| *v *= root);
        }
        // Equality rows do not change the direction, but near a vertex the matrix without them is
        // singular up to rounding.
        let weight = ratio.iter().fold(1.0_f64, |m, r| m.max(*r)).min(1e12);
        scaled.extend(self.program.equal.iter().map(|v| v * weight.sqrt()));
        add_gram(scaled, n, 1.0, &mut matrix);
        let scaling = self.normed.then(|| Scaling::new((state.length, w), (state.dual.0, &state.dual.1)));
        let mut ridge = 0.0;
        if let Some(scaling) = &scaling {
            ridge = scaling.eta.powi(-2);
            let factor = -2.0 * ridge / (2.0 * scaling.w0 * scaling.w0 - 1.0);
            add_gram(&scaling.w1, n, factor, &mut matrix);
        }
        (0..n).for_each(|j| matrix[(j, j)] += diagonal[j] + ridge);
        let factor = Cholesky::new(matrix)?;
        let half = factor.multiply_by_inverse(&self.program.equal);
        let schur = if self.program.equal_to.is_empty() {
            None
        } else {
            let mut schur = outer(&half, n);
            let most = (0..schur.nrows()).map(|i| schur[(i, i)]).fold(0.0, f64::max);
            (0..schur.nrows()).for_each(|i| schur[(i, i)] += 1e-14 * most);
            Some(Cholesky::new(schur)?)
        };
        Some(Newton { inner: self, state, diagonal, of_part, ratio, scaling, weight, factor, schur })
    }
}

impl Newton<'_> {
    /// The product of the reduced system's matrix and a vector.
    fn times(&self, v: &[f64]) -> Vec<f64> {
        let program = self.inner.program;
        let mut out: Vec<f64> = v.iter().zip(&self.diagonal).map(|(v, d)| v * d).collect();
        if program.lift > 0.0 {
            let mut b = times(&program.behind, v);
            b.iter_mut().for_each(|b| *b *= 2.0 * program.lift);
            add_sum(&program.behind, &b, &mut out);
        }
        if program.norm == Norm::Square {
            out.iter_mut().zip(v).for_each(|(o, v)| *o += 2.0 * program.l2 * v);
        }
        let mut a = times(&program.below, v);
        a.iter_mut().zip(&self.ratio).for_each(|(a, r)| *a *= r);
        add_sum(&program.below, &a, &mut out);
        if let Some(s) = &self.scaling {
            let ridge = s.eta.powi(-2);
            let along = 2.0 * dot(&s.w1, v) / (2.0 * s.w0 * s.w0 - 1.0);
            out.iter_mut().zip(v.iter().zip(&s.w1)).for_each(|(o, (v, w))| *o += ridge * (v - along * w));
        }
        out
    }

    fn solve_once(&self, w: &[f64], equality: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut right = w.to_vec();
        let weighted: Vec<f64> = equality.iter().map(|e| self.weight * e).collect();
        add_sum(&self.inner.program.equal, &weighted, &mut right);
        let mut dw = right.clone();
        self.factor.solve(&mut dw);
        let Some(schur) = &self.schur else { return (dw, vec![]) };
        let mut du = times(&self.inner.program.equal, &dw);
        du.iter_mut().zip(equality).for_each(|(u, e)| *u -= e);
        schur.solve(&mut du);
        let minus: Vec<f64> = du.iter().map(|u| -u).collect();
        add_sum(&self.inner.program.equal, &minus, &mut right);
        self.factor.solve(&mut right);
        (right, du)
    }

    pub(super) fn direction(&self, r: &Residual, aim: &Complement) -> Direction {
        let (inner, state, program) = (self.inner, self.state, self.inner.program);
        let n = program.width();
        let of_x: Vec<f64> = (0..inner.parts.len())
            .map(|j| -r.dual[j] + aim.low[j] / state.x[j] - aim.high[j] / (inner.parts[j].range - state.x[j]))
            .collect();
        let mut right = vec![0.0; n];
        for (j, p) in inner.parts.iter().enumerate() {
            right[p.synapse] += p.sign * of_x[j] / self.of_part[j];
        }
        right.iter_mut().zip(&self.diagonal).for_each(|(r, d)| *r *= d);
        let rows: Vec<f64> =
            (0..self.ratio.len()).map(|i| self.ratio[i] * r.inequality[i] + aim.rows[i] / state.slack[i]).collect();
        let minus: Vec<f64> = rows.iter().map(|v| -v).collect();
        add_sum(&program.below, &minus, &mut right);
        // The cone: dual step = h - M (length, w); its first row determines the step of the length.
        let mut cone = None;
        if let (Some(s), Some(c)) = (&self.scaling, &aim.cone) {
            let h = s.unscale((c.0, &c.1));
            let ridge = s.eta.powi(-2);
            let m00 = ridge * (2.0 * s.w0 * s.w0 - 1.0);
            let m01: Vec<f64> = s.w1.iter().map(|w| -2.0 * ridge * s.w0 * w).collect();
            let free = (h.0 - r.length) / m00;
            for j in 0..n {
                right[j] += h.1[j] - m01[j] * free;
            }
            cone = Some((h, m00, m01));
        }
        let equality: Vec<f64> = r.equality.iter().map(|e| -e).collect();
        let (mut w, mut du) = self.solve_once(&right, &equality);
        let size = right.iter().chain(&equality).fold(0.0_f64, |m, x| m.max(x.abs()));
        for _ in 0..MOST_REFINEMENTS {
            let mut left = self.times(&w);
            add_sum(&program.equal, &du, &mut left);
            let rw: Vec<f64> = right.iter().zip(&left).map(|(a, b)| a - b).collect();
            let re: Vec<f64> = equality.iter().zip(times(&program.equal, &w)).map(|(a, b)| a - b).collect();
            let off = rw.iter().chain(&re).fold(0.0_f64, |m, x| m.max(x.abs()));
            if off <= REFINED * size {
                break;
            }
            let (cw, cu) = self.solve_once(&rw, &re);
            w.iter_mut().zip(&cw).for_each(|(a, b)| *a += b);
            du.iter_mut().zip(&cu).for_each(|(a, b)| *a += b);
        }
        // The contributions of the parts to each weight's step.
        let mut of_w = vec![0.0; n];
        for (j, p) in inner.parts.iter().enumerate() {
            of_w[p.synapse] += p.sign * of_x[j] / self.of_part[j];
        }
        let force: Vec<f64> = (0..n).map(|k| self.diagonal[k] * (of_w[k] - w[k])).collect();
        let x: Vec<f64> = (0..inner.parts.len())
            .map(|j| (of_x[j] - inner.parts[j].sign * force[inner.parts[j].synapse]) / self.of_part[j])
            .collect();
        let low = (0..x.len()).map(|j| (aim.low[j] - state.low[j] * x[j]) / state.x[j]).collect();
        let high =
            (0..x.len()).map(|j| (aim.high[j] + state.high[j] * x[j]) / (inner.parts[j].range - state.x[j])).collect();
        let a = times(&program.below, &w);
        let inequality = (0..a.len()).map(|i| self.ratio[i] * a[i] + rows[i]).collect();
        let slack = a.iter().zip(&r.inequality).map(|(a, r)| -a - r).collect();
        let (mut length, mut dual) = (0.0, (0.0, vec![0.0; n]));
        if let (Some(s), Some((h, m00, m01))) = (&self.scaling, cone) {
            length = (h.0 - r.length - dot(&m01, &w)) / m00;
            let ridge = s.eta.powi(-2);
            let along = 2.0 * dot(&s.w1, &w);
            dual.0 = r.length;
            for j in 0..n {
                dual.1[j] = h.1[j] - m01[j] * length - ridge * (w[j] + along * s.w1[j]);
            }
        }
        Direction { x, w, low, high, equality: du, slack, inequality, length, dual }
    }
}
