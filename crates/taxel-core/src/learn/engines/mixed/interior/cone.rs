//! The second-order cone of the norm: its scaling after Nesterov and Todd, and the longest step within it.

use crate::vectors::dot;

/// The Nesterov-Todd scaling of the norm's cone.
pub(super) struct Scaling {
    pub(super) eta: f64,
    pub(super) w0: f64,
    pub(super) w1: Vec<f64>,
    /// The scaled point, `W^-1 s = W y`.
    pub(super) point: (f64, Vec<f64>),
}

impl Scaling {
    pub(super) fn new(s: (f64, &[f64]), y: (f64, &[f64])) -> Self {
        let gap = |(t, v): (f64, &[f64])| {
            let length = dot(v, v).sqrt();
            ((t - length) * (t + length)).max(1e-300).sqrt()
        };
        let (sr, yr) = (gap(s), gap(y));
        let inner = (s.0 * y.0 + dot(s.1, y.1)) / (sr * yr);
        let gamma = (0.5 * (1.0 + inner)).max(1e-300).sqrt();
        let w1: Vec<f64> = s.1.iter().zip(y.1).map(|(s, y)| (s / sr - y / yr) / (2.0 * gamma)).collect();
        let w0 = (1.0 + dot(&w1, &w1)).sqrt();
        let mut out = Self { eta: (sr / yr).sqrt(), w0, w1, point: (0.0, vec![]) };
        out.point = out.scale(y);
        out
    }

    /// `W v`.
    pub(super) fn scale(&self, v: (f64, &[f64])) -> (f64, Vec<f64>) {
        let along = dot(&self.w1, v.1);
        let factor = v.0 + along / (1.0 + self.w0);
        let rest = v.1.iter().zip(&self.w1).map(|(v, w)| self.eta * (v + factor * w)).collect();
        (self.eta * (self.w0 * v.0 + along), rest)
    }

    /// `W^-1 v`.
    pub(super) fn unscale(&self, v: (f64, &[f64])) -> (f64, Vec<f64>) {
        let along = dot(&self.w1, v.1);
        let factor = along / (1.0 + self.w0) - v.0;
        let rest = v.1.iter().zip(&self.w1).map(|(v, w)| (v + factor * w) / self.eta).collect();
        ((self.w0 * v.0 - along) / self.eta, rest)
    }
}

/// The longest step (up to 1) that keeps `v + step d` in the second-order cone.
pub(super) fn cone_step(v: (f64, &[f64]), d: (f64, &[f64])) -> f64 {
    let (vl, dl) = (dot(v.1, v.1).sqrt(), dot(d.1, d.1));
    let a = d.0 * d.0 - dl;
    let b = v.0 * d.0 - dot(v.1, d.1);
    let c = ((v.0 - vl) * (v.0 + vl)).max(0.0);
    let mut most: f64 = if d.0 < 0.0 { v.0 / -d.0 } else { f64::INFINITY };
    let disc = b * b - a * c;
    if disc >= 0.0 {
        let root = disc.sqrt();
        // The smallest positive root of a s^2 + 2 b s + c.
        let q = -(b + if b >= 0.0 { root } else { -root });
        for s in [q / a, c / q] {
            if s > 0.0 && s.is_finite() {
                most = most.min(s);
            }
        }
    }
    most
}
