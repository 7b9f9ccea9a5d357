//! One Newton step of a round: the curvature comes from the rows on their smoothed kinks.

use faer::dyn_stack::MemStack;
use faer::linalg::cholesky::llt::factor::{LltRegularization, cholesky_in_place};
use faer::linalg::cholesky::llt::solve::solve_in_place;
use faer::linalg::matmul::triangular::{BlockStructure, matmul};
use faer::{Accum, MatMut, MatRef, Par};

use super::Lagrangian;
use crate::learn::statement::{FormB, Norm, Sides};
use crate::vectors::{add, dot};

/// The curvature of the Lagrangian at its weights `w`: `diagonal + rows rows' - concave w w'`, and `both_sides` times
/// `B'B` where that is not among the rows.
struct Curvature {
    /// One row after the other, of one entry per weight.
    rows: Vec<f64>,
    count: usize,
    both_sides: f64,
    diagonal: Vec<f64>,
    concave: f64,
}

/// At most so many coefficients of silent rows are written out for a curvature by `samples`: of more rows, some at even
/// distances stand for all, as neighbouring points of a grid have nearly the same row. Slopes remain those of all rows.
const WRITTEN: usize = 2_000_000;
/// How often a direction over rows is refined: the system loses the digits by which steep rows exceed the diagonal.
const REFINED: usize = 1;

impl Lagrangian<'_> {
    /// Takes one Newton step with an exact line search; returns false if rounding leaves no direction.
    pub(super) fn step(&mut self) -> bool {
        let n = self.at.weights.len();
        let mut curvature = self.curvature();
        // A system over rows loses digits where these are hard, hence steep, and where no l2 term holds the weights.
        let exact = !self.program.is_hard() && self.program.objective.l2 > 0.0;
        let rows = curvature.count + if curvature.both_sides > 0.0 { self.at.behind.len() } else { 0 };
        let few = exact && 2 * rows < n;
        if few && curvature.both_sides > 0.0 {
            let root = curvature.both_sides.sqrt();
            curvature.rows.extend(self.program.targets.iter().flat_map(|row| row.behind.iter().map(|v| root * v)));
            curvature.count += self.at.behind.len();
        }
        let direction = loop {
            let found = if few { self.over_rows(&curvature) } else { self.over_weights(&curvature) };
            if let Some(direction) = found {
                break direction;
            }
            let squares = self.program.gram.iter().step_by(n + 1).map(|g| curvature.both_sides * g);
            let steepest =
                curvature.diagonal.iter().zip(squares).fold(0.0_f64, |most, (d, square)| most.max(d + square));
            let more = (self.rho * 100.0).max(f64::EPSILON * steepest) - self.rho;
            self.rho += more;
            // A curvature with entries that are not finite never factors.
            if !self.rho.is_normal() {
                return false;
            }
            curvature.diagonal.iter_mut().for_each(|d| *d += more);
        };
        self.move_along(&direction)
    }

    fn curvature(&self) -> Curvature {
        let (program, o) = (self.program, self.program.objective);
        let n = self.at.weights.len();
        let silent = program.limit.len();
        let kept = self.inside.partition_point(|&k| k < silent);
        let apart = if self.samples { (kept * n).div_ceil(WRITTEN).max(1) } else { 1 };
        let written: Vec<usize> = self.inside[..kept].iter().copied().step_by(apart).collect();
        let mut rows = program.silent.coefficients(&written, n);
        let roots = self.steep().map(f64::sqrt);
        rows.iter_mut().for_each(|v| *v *= roots[0] * (apart as f64).sqrt());
        for &k in &self.inside[kept..] {
            let root = roots[program.kind(k)];
            rows.extend(program.stored_row(k - silent).iter().map(|v| root * v));
        }
        let mut count = written.len() + self.inside.len() - kept;
        if o.choice.sides_b == Sides::Below {
            let root = (2.0 * o.b).sqrt();
            for (target, _) in program.targets.iter().zip(&self.at.behind).filter(|(_, behind)| **behind < 0.0) {
                rows.extend(target.behind.iter().map(|v| root * v));
                count += 1;
            }
        }
        let length = self.length(dot(&self.at.weights, &self.at.weights));
        let (ridge, concave) = match o.choice.norm {
            Norm::Square => (2.0 * o.l2, 0.0),
            Norm::Norm => (o.l2 / length, o.l2 / (length * length * length)),
        };
        let held = |i: usize| if self.penalty(i, self.at.weights[i]).1 { self.sigma } else { 0.0 };
        let diagonal = (0..n).map(|i| ridge + self.rho + held(i)).collect();
        let both_sides =
            if (o.choice.form_b, o.choice.sides_b) == (FormB::Square, Sides::Both) { 2.0 * o.b } else { 0.0 };
        Curvature { rows, count, both_sides, diagonal, concave }
    }

    /// The Newton direction by a system as large as the weights; none if it is not positive definite.
    fn over_weights(&mut self, curvature: &Curvature) -> Option<Vec<f64>> {
        let n = self.at.weights.len();
        self.hessian.iter_mut().zip(self.program.gram).for_each(|(h, g)| *h = curvature.both_sides * g);
        if curvature.concave != 0.0 {
            for (column, &w) in self.hessian.chunks_exact_mut(n).zip(&self.at.weights) {
                add(column, -curvature.concave * w, &self.at.weights);
            }
        }
        self.hessian.iter_mut().step_by(n + 1).zip(&curvature.diagonal).for_each(|(h, d)| *h += d);
        let mut h = MatMut::from_column_major_slice_mut(&mut self.hessian, n, n);
        if curvature.count > 0 {
            let rows = MatRef::from_column_major_slice(&curvature.rows, n, curvature.count);
            let (lower, full) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
            matmul(h.as_mut(), lower, Accum::Add, rows, full, rows.transpose(), full, 1.0, Par::Seq);
        }
        let stack = MemStack::new(&mut self.memory);
        cholesky_in_place(h.as_mut(), LltRegularization::default(), Par::Seq, stack, faer::Spec::default()).ok()?;
        let mut direction: Vec<f64> = self.gradient.iter().map(|g| -g).collect();
        let stack = MemStack::new(&mut self.memory);
        solve_in_place(h.as_ref(), MatMut::from_column_major_slice_mut(&mut direction, n, 1), Par::Seq, stack);
        Some(direction)
    }

    /// The Newton direction by a system as large as the rows (Woodbury), and a concave term of rank one (Sherman,
    /// Morrison); none if they are not positive definite.
    fn over_rows(&mut self, curvature: &Curvature) -> Option<Vec<f64>> {
        let (n, count) = (self.at.weights.len(), curvature.count);
        let roots: Vec<f64> = curvature.diagonal.iter().map(|d| d.sqrt()).collect();
        let scaled = |v: &[f64]| -> Vec<f64> { v.iter().zip(&roots).map(|(v, root)| v / root).collect() };
        let rows: Vec<f64> = curvature.rows.chunks_exact(n).flat_map(scaled).collect();
        let mut system = vec![0.0; count * count];
        system.iter_mut().step_by(count + 1).for_each(|m| *m = 1.0);
        let mut system = MatMut::from_column_major_slice_mut(&mut system, count, count);
        if count > 0 {
            let columns = MatRef::from_column_major_slice(&rows, n, count);
            let (lower, full) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
            matmul(system.as_mut(), lower, Accum::Add, columns.transpose(), full, columns, full, 1.0, Par::Seq);
            let stack = MemStack::new(&mut self.memory);
            cholesky_in_place(system.as_mut(), LltRegularization::default(), Par::Seq, stack, faer::Spec::default())
                .ok()?;
        }
        let mut solved = |v: &[f64]| {
            let mut out = scaled(v);
            let mut along: Vec<f64> = rows.chunks_exact(n).map(|row| dot(row, &out)).collect();
            let stack = MemStack::new(&mut self.memory);
            let right = MatMut::from_column_major_slice_mut(&mut along, count, 1);
            solve_in_place(system.as_ref(), right, Par::Seq, stack);
            along.iter().zip(rows.chunks_exact(n)).for_each(|(&factor, row)| add(&mut out, -factor, row));
            scaled(&out)
        };
        let weights = &self.at.weights;
        let (pulled, left) = if curvature.concave == 0.0 {
            (vec![], 1.0)
        } else {
            let pulled = solved(weights);
            let left = 1.0 - curvature.concave * dot(weights, &pulled);
            if left.is_nan() || left <= 0.0 {
                return None;
            }
            (pulled, left)
        };
        let mut direction = vec![0.0; n];
        let mut residual: Vec<f64> = self.gradient.iter().map(|g| -g).collect();
        for _ in 0..=REFINED {
            let mut more = solved(&residual);
            if curvature.concave != 0.0 {
                let along = curvature.concave * dot(weights, &more) / left;
                add(&mut more, along, &pulled);
            }
            residual.iter_mut().zip(&more).zip(&curvature.diagonal).for_each(|((r, m), d)| *r -= d * m);
            curvature.rows.chunks_exact(n).for_each(|row| add(&mut residual, -dot(row, &more), row));
            add(&mut residual, curvature.concave * dot(weights, &more), weights);
            add(&mut direction, 1.0, &more);
        }
        Some(direction)
    }
}
