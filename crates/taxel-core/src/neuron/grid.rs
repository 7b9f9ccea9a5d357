//! The neuron on a grid: potential and threshold are compared at the points `start + k step` only.

use super::kernel::{KernelSum, Shape, Step};
use super::model::{AfterSpike, Neuron};
use super::points::{Grid, GridTime};
use super::threshold::{OutputSpike, Threshold};

/// The state of a neuron on a grid.
#[derive(Debug, Clone)]
pub(super) struct GridStream {
    neuron: Neuron,
    shape: Shape,
    pub(super) threshold: Threshold,
    grid: Grid,
    /// The state at grid point `point`, including the inputs of the interval before it.
    state: KernelSum,
    /// The sum of the weights times values of inputs exactly at `point`: they change potential and slope only after it.
    arriving: f64,
    point: f64,
    /// Whether `point` has been compared with the threshold.
    compared: bool,
    /// The decay over one step of the grid.
    step: Step,
    /// Where the state last was: the potential there, what left from there, and how many steps of the grid ago.
    left: (f64, KernelSum, f64),
}

impl GridStream {
    pub(super) fn new(neuron: &Neuron, factor: f64, start: f64) -> Self {
        let shape = neuron.shape();
        Self {
            neuron: neuron.clone(),
            shape,
            threshold: Threshold::new(neuron, factor, start),
            grid: Grid::new(start, neuron.step_ms),
            state: KernelSum::default(),
            arriving: 0.0,
            point: 0.0,
            compared: false,
            step: shape.step(neuron.step_ms),
            left: (0.0, KernelSum::default(), 1.0),
        }
    }

    /// Adds an input to the state at the first grid point at or after it, at the cost of one exponential and without a
    /// queue.
    pub(super) fn push(&mut self, t: f64, weight: f64, value: f64, out: &mut Vec<OutputSpike>) {
        let time = self.grid.locate(t);
        let point = time.from();
        if point > self.point {
            self.compare(out);
            self.step_through(point - 1.0, out);
            self.jump(point);
        }
        if !self.neuron.loses(t, self.threshold.fired) {
            let age = self.grid.between(time, GridTime::at(self.point));
            if age > 0.0 {
                self.shape.add(&mut self.state, weight, value, age);
            } else {
                self.arriving += weight * value;
            }
        }
    }

    /// Fires at every point up to `until`, included, at which the potential has reached the threshold.
    pub(super) fn settle(&mut self, until: f64, out: &mut Vec<OutputSpike>) {
        if self.grid.time(self.point) <= until {
            self.compare(out);
            self.step_through(self.grid.locate(until).until(), out);
        }
    }

    pub(super) fn potential(&self, t: f64) -> f64 {
        let since = self.grid.between(GridTime::at(self.point), self.grid.locate(t));
        // An input exactly at the point contributes nothing at the point itself.
        if since > 0.0 { self.shape.after(self.leaving(), since).b } else { self.state.b }
    }

    /// Steps point by point while the potential could still reach the threshold without a further input, or has yet to
    /// fall below `rearm`.
    ///
    /// Once it cannot, the state stays where it is and the next input advances it in one jump. The number of steps
    /// depends only on the state, so a stream that is cut elsewhere gives the same bits.
    fn step_through(&mut self, last: f64, out: &mut Vec<OutputSpike>) {
        while self.point < last
            && (self.threshold.is_unarmed() || self.shape.bound(self.leaving()) >= self.threshold.base - self.slack())
        {
            self.jump(self.point + 1.0);
            self.compare(out);
        }
    }

    /// A potential at most this far below the threshold must be compared with it exactly, mV.
    fn slack(&self) -> f64 {
        self.threshold.slack(self.grid.rounding_ms(self.grid.time(self.point)))
    }

    fn leaving(&self) -> KernelSum {
        let mut state = self.state;
        self.shape.add(&mut state, self.arriving, 1.0, 0.0);
        state
    }

    fn jump(&mut self, point: f64) {
        let steps = point - self.point;
        self.left = (self.state.b, self.leaving(), steps);
        self.state = if steps > 1.0 {
            self.shape.after(self.left.1, steps * self.neuron.step_ms)
        } else {
            self.step.apply(self.left.1)
        };
        self.arriving = 0.0;
        self.point = point;
        self.compared = false;
    }

    fn compare(&mut self, out: &mut Vec<OutputSpike>) {
        if std::mem::replace(&mut self.compared, true) {
            return;
        }
        let (t, slope) = (self.grid.time(self.point), self.shape.slope(self.state));
        if !self.threshold.compare(t, self.state.b, slope, self.grid.rounding_ms(t)) {
            return;
        }
        out.push(OutputSpike { t, slope: (self.state.b - self.potential_before()) / self.neuron.step_ms });
        self.threshold.fire(t);
        if self.neuron.after_spike == AfterSpike::Reset {
            self.state = KernelSum::default();
            self.arriving = 0.0;
        }
    }

    /// The potential at the grid point before this one.
    fn potential_before(&self) -> f64 {
        let (potential, left, steps) = self.left;
        if steps > 1.0 { self.shape.after(left, (steps - 1.0) * self.neuron.step_ms).b } else { potential }
    }
}
