//! One Newton step of a round: the curvature comes from the rows on their smoothed kinks.

use faer::dyn_stack::MemStack;
use faer::linalg::cholesky::llt::factor::{LltRegularization, cholesky_in_place};
use faer::linalg::cholesky::llt::solve::solve_in_place;
use faer::linalg::matmul::triangular::{BlockStructure, matmul};
use faer::{Accum, MatMut, MatRef, Par};

use super::Lagrangian;
use crate::learn::statement::{Norm, Sides};
use crate::vectors::{add, dot};

impl Lagrangian<'_> {
    /// Takes one Newton step with an exact line search; returns false if rounding leaves no direction.
    pub(super) fn step(&mut self) -> bool {
        let (program, o) = (self.program, self.program.objective);
        let n = self.weights.len();
        let silent = program.limit.len();
        let kept = self.inside.partition_point(|&k| k < silent);
        let mut rows = program.silent.coefficients(&self.inside[..kept], n);
        let [of_silence, of_targets] = self.steep().map(f64::sqrt);
        rows.iter_mut().for_each(|v| *v *= of_silence);
        for &k in &self.inside[kept..] {
            rows.extend(program.targets.row(k - silent).at.iter().map(|v| of_targets * v));
        }
        let mut count = self.inside.len();
        if o.sides_b == Sides::Below {
            let root = (2.0 * o.b).sqrt();
            for (target, _) in program.targets.iter().zip(&self.behind).filter(|(_, behind)| **behind < 0.0) {
                rows.extend(target.behind.iter().map(|v| root * v));
                count += 1;
            }
        }
        let curved = if o.sides_b == Sides::Both { 2.0 * o.b } else { 0.0 };
        let length = self.length(dot(&self.weights, &self.weights));
        loop {
            self.hessian.iter_mut().zip(program.gram.iter()).for_each(|(h, g)| *h = curved * g);
            let ridge = match o.norm {
                Norm::Square => 2.0 * o.l2,
                Norm::Norm => {
                    let f = o.l2 / (length * length * length);
                    for (column, &w) in self.hessian.chunks_exact_mut(n).zip(&self.weights) {
                        add(column, -f * w, &self.weights);
                    }
                    o.l2 / length
                }
            };
            let mut steepest = 0.0_f64;
            for i in 0..n {
                let holding = if self.penalty(i, self.weights[i]).1 { self.sigma } else { 0.0 };
                self.hessian[i * n + i] += ridge + self.rho + holding;
                steepest = steepest.max(self.hessian[i * n + i]);
            }
            let mut h = MatMut::from_column_major_slice_mut(&mut self.hessian, n, n);
            if count > 0 {
                let r = MatRef::from_column_major_slice(&rows, n, count);
                let (lower, full) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
                matmul(h.as_mut(), lower, Accum::Add, r, full, r.transpose(), full, 1.0, Par::Seq);
            }
            let stack = MemStack::new(&mut self.memory);
            if cholesky_in_place(h.as_mut(), LltRegularization::default(), Par::Seq, stack, faer::Spec::default())
                .is_ok()
            {
                break;
            }
            self.rho = (self.rho * 100.0).max(f64::EPSILON * steepest);
            // A Hessian with entries that are not finite never factors.
            if !self.rho.is_normal() {
                return false;
            }
        }
        let mut direction: Vec<f64> = self.gradient.iter().map(|g| -g).collect();
        let h = MatRef::from_column_major_slice(&self.hessian, n, n);
        let stack = MemStack::new(&mut self.memory);
        solve_in_place(h, MatMut::from_column_major_slice_mut(&mut direction, n, 1), Par::Seq, stack);
        self.move_along(&direction)
    }
}
