//! The optimality conditions: their residuals, and the targets of the complementarity products.

use super::super::dense::{add_sum, times};
use super::Interior;
use super::newton::Newton;
use super::variables::{Complement, Direction, PrimalDual, Residual};
use crate::vectors::dot;

impl Interior<'_> {
    pub(super) fn residual(&self, state: &PrimalDual) -> Residual {
        let program = self.program;
        let w = self.weights(&state.x);
        let mut gradient = program.slope(&w);
        add_sum(&program.equal, &state.equality, &mut gradient);
        add_sum(&program.below, &state.inequality, &mut gradient);
        if self.normed {
            gradient.iter_mut().zip(&state.dual.1).for_each(|(g, y)| *g -= y);
        }
        let dual = self
            .parts
            .iter()
            .zip(state.low.iter().zip(&state.high))
            .map(|(p, (low, high))| p.sign * gradient[p.synapse] + p.cost - low + high)
            .collect();
        let equality = times(&program.equal, &w).iter().zip(&program.equal_to).map(|(u, e)| u - e).collect();
        let rows = times(&program.below, &w);
        let rows = rows.iter().zip(&program.limit).zip(&state.slack);
        let inequality = rows.map(|((u, limit), s)| u - limit + s).collect();
        Residual { w, gradient, dual, equality, inequality, length: program.l2 - state.dual.0 }
    }

    pub(super) fn complementarity(&self, state: &PrimalDual, w: &[f64]) -> f64 {
        let high: f64 =
            self.parts.iter().zip(state.x.iter().zip(&state.high)).map(|(p, (x, high))| (p.range - x) * high).sum();
        let mut sum = dot(&state.x, &state.low) + high + dot(&state.slack, &state.inequality);
        let mut count = 2 * self.parts.len() + state.slack.len();
        if self.normed {
            sum += state.length * state.dual.0 + dot(w, &state.dual.1);
            count += 1;
        }
        sum / count as f64
    }

    pub(super) fn complement(
        &self,
        state: &PrimalDual,
        newton: &Newton<'_>,
        mu: f64,
        affine: Option<&Direction>,
    ) -> Complement {
        let mut out = Complement {
            low: state.x.iter().zip(&state.low).map(|(x, l)| mu - x * l).collect(),
            high: self
                .parts
                .iter()
                .zip(state.x.iter().zip(&state.high))
                .map(|(p, (x, h))| mu - (p.range - x) * h)
                .collect(),
            rows: state.slack.iter().zip(&state.inequality).map(|(s, z)| mu - s * z).collect(),
            cone: None,
        };
        if let Some(step) = affine {
            for (j, dx) in step.x.iter().enumerate() {
                out.low[j] -= dx * step.low[j];
                out.high[j] += dx * step.high[j];
            }
            for (o, (ds, dz)) in out.rows.iter_mut().zip(step.slack.iter().zip(&step.inequality)) {
                *o -= ds * dz;
            }
        }
        if let Some(scaling) = &newton.scaling {
            let (p0, p1) = (scaling.point.0, &scaling.point.1);
            let mut r0 = mu - (p0 * p0 + dot(p1, p1));
            let mut r1: Vec<f64> = p1.iter().map(|p| -2.0 * p0 * p).collect();
            if let Some(step) = affine {
                let a = scaling.unscale((step.length, &step.w));
                let b = scaling.scale((step.dual.0, &step.dual.1));
                r0 -= a.0 * b.0 + dot(&a.1, &b.1);
                r1.iter_mut().zip(a.1.iter().zip(&b.1)).for_each(|(r, (x, y))| *r -= a.0 * y + b.0 * x);
            }
            let length = dot(p1, p1).sqrt();
            let det = ((p0 - length) * (p0 + length)).max(1e-300);
            let x0 = (p0 * r0 - dot(p1, &r1)) / det;
            let x1 = r1.iter().zip(p1).map(|(r, p)| (r - x0 * p) / p0).collect();
            out.cone = Some((x0, x1));
        }
        out
    }

    /// Gondzio's corrector: products that a longer step would move far from `mu` are pulled back.
    pub(super) fn correct(
        &self,
        state: &PrimalDual,
        step: &Direction,
        reach: f64,
        mu: f64,
        aim: &Complement,
    ) -> Complement {
        let pull = |product: f64| {
            if product < 0.1 * mu {
                0.1 * mu - product
            } else if product > 10.0 * mu {
                (10.0 * mu - product).max(-10.0 * mu)
            } else {
                0.0
            }
        };
        let pair = |a: f64, da: f64, b: f64, db: f64| pull((a + reach * da) * (b + reach * db));
        let mut out =
            Complement { low: aim.low.clone(), high: aim.high.clone(), rows: aim.rows.clone(), cone: aim.cone.clone() };
        for (j, p) in self.parts.iter().enumerate() {
            out.low[j] += pair(state.x[j], step.x[j], state.low[j], step.low[j]);
            out.high[j] += pair(p.range - state.x[j], -step.x[j], state.high[j], step.high[j]);
        }
        for i in 0..state.slack.len() {
            out.rows[i] += pair(state.slack[i], step.slack[i], state.inequality[i], step.inequality[i]);
        }
        out
    }
}
