//! The variables of the interior-point method, directions in them, and the residuals of the optimality conditions.

use faer::Mat;

use super::super::program::retain;

/// The part of a weight above or below its base.
pub(super) struct WeightPart {
    pub(super) synapse: usize,
    pub(super) sign: f64,
    pub(super) range: f64,
    pub(super) cost: f64,
}

/// The variables: parts `x` with the multipliers of their two bounds, the rows' slacks and multipliers, the norm's
/// cone.
#[derive(Debug, Clone)]
pub struct PrimalDual {
    pub(super) x: Vec<f64>,
    pub(super) low: Vec<f64>,
    pub(super) high: Vec<f64>,
    pub(super) equality: Vec<f64>,
    pub(super) slack: Vec<f64>,
    pub(super) inequality: Vec<f64>,
    pub(super) length: f64,
    /// The cone's multiplier: its first entry, then the others (minus the pull).
    pub(super) dual: (f64, Vec<f64>),
}

/// A direction in the same variables.
pub(super) struct Direction {
    pub(super) x: Vec<f64>,
    pub(super) w: Vec<f64>,
    pub(super) low: Vec<f64>,
    pub(super) high: Vec<f64>,
    pub(super) equality: Vec<f64>,
    pub(super) slack: Vec<f64>,
    pub(super) inequality: Vec<f64>,
    pub(super) length: f64,
    pub(super) dual: (f64, Vec<f64>),
}

impl PrimalDual {
    /// Removes the rows that `keep` does not mark.
    pub fn retain(&mut self, keep: &[bool]) {
        retain(&mut self.slack, keep);
        retain(&mut self.inequality, keep);
    }

    pub(super) fn go(&mut self, reach: f64, step: &Direction) {
        let go = |v: &mut [f64], d: &[f64]| v.iter_mut().zip(d).for_each(|(v, d)| *v += reach * d);
        go(&mut self.x, &step.x);
        go(&mut self.low, &step.low);
        go(&mut self.high, &step.high);
        go(&mut self.equality, &step.equality);
        go(&mut self.slack, &step.slack);
        go(&mut self.inequality, &step.inequality);
        self.length += reach * step.length;
        self.dual.0 += reach * step.dual.0;
        go(&mut self.dual.1, &step.dual.1);
    }
}

/// Residuals of the optimality conditions.
pub(super) struct Residual {
    pub(super) w: Vec<f64>,
    pub(super) gradient: Vec<f64>,
    pub(super) dual: Vec<f64>,
    pub(super) equality: Vec<f64>,
    pub(super) inequality: Vec<f64>,
    pub(super) length: f64,
}

/// The targets of the complementarity products minus the products.
pub(super) struct Complement {
    pub(super) low: Vec<f64>,
    pub(super) high: Vec<f64>,
    pub(super) rows: Vec<f64>,
    /// The entry of the cone, already divided by the scaled point.
    pub(super) cone: Option<(f64, Vec<f64>)>,
}

/// Memory that iterations reuse.
pub(super) struct Workspace {
    pub(super) matrix: Mat<f64>,
    pub(super) scaled: Vec<f64>,
}
