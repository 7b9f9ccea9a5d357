//! The neuron on a grid: potential and threshold are compared at the points `start + k step` only.

use super::streaming::{OutputSpike, Threshold};
use super::{AfterSpike, Neuron, State};

/// The grid neuron at work.
#[derive(Debug, Clone)]
pub(super) struct GridStream {
    neuron: Neuron,
    pub(super) threshold: Threshold,
    start: f64,
    /// The potential at grid point `point`; inputs of the interval before it are in already.
    state: State,
    /// The weights of inputs at that point itself: they move neither potential nor slope before it is left.
    arriving: f64,
    point: f64,
    /// Whether that point has been compared with the threshold.
    compared: bool,
    /// One step, as `x = step/tau` and `e^{-x}`.
    x: f64,
    decay: f64,
}

impl GridStream {
    pub(super) fn new(neuron: &Neuron, factor: f64, start: f64) -> Self {
        let x = neuron.step_ms / neuron.tau;
        Self {
            neuron: neuron.clone(),
            threshold: Threshold::new(neuron, factor, start),
            start,
            state: State::default(),
            arriving: 0.0,
            point: 0.0,
            compared: false,
            x,
            decay: (-x).exp(),
        }
    }

    /// An input adds to the state at the first point not before it, so it needs one exponential and no queue.
    pub(super) fn push(&mut self, t: f64, weight: f64, out: &mut Vec<OutputSpike>) {
        let point = ((t - self.start) / self.neuron.step_ms).ceil();
        if point > self.point {
            self.compare(out);
            self.step_through(point - 1.0, out);
            self.jump(point);
        }
        if !self.neuron.loses(t, self.threshold.fired) {
            let age = self.time(self.point) - t;
            if age > 0.0 {
                self.state.add(weight, age, self.neuron.tau);
            } else {
                self.arriving += weight;
            }
        }
    }

    /// Fires at whatever point up to `until`, included, finds the potential at or above the threshold.
    pub(super) fn settle(&mut self, until: f64, out: &mut Vec<OutputSpike>) {
        if self.time(self.point) <= until {
            self.compare(out);
            let last = ((until - self.start) / self.neuron.step_ms).floor();
            self.step_through(last, out);
        }
    }

    pub(super) fn potential(&self, t: f64) -> f64 {
        self.leaving().after((t - self.time(self.point)).max(0.0), self.neuron.tau).b
    }

    fn time(&self, point: f64) -> f64 {
        self.start + point * self.neuron.step_ms
    }

    /// Goes on point by point as long as the potential could reach the threshold without a further input.
    ///
    /// Where it could not, the state stays behind and catches up in one jump at the next input. What is done depends on
    /// the state alone, so that a stream cut elsewhere gives the same bits.
    fn step_through(&mut self, last: f64, out: &mut Vec<OutputSpike>) {
        while self.point < last && self.leaving().bound() >= self.threshold.base {
            self.jump(self.point + 1.0);
            self.compare(out);
        }
    }

    fn leaving(&self) -> State {
        State { a: self.state.a + self.arriving, b: self.state.b }
    }

    fn jump(&mut self, point: f64) {
        let steps = point - self.point;
        self.state = if steps > 1.0 {
            self.leaving().after(steps * self.neuron.step_ms, self.neuron.tau)
        } else {
            self.leaving().decayed(self.x, self.decay)
        };
        self.arriving = 0.0;
        self.point = point;
        self.compared = false;
    }

    fn compare(&mut self, out: &mut Vec<OutputSpike>) {
        if std::mem::replace(&mut self.compared, true) || self.state.b < self.threshold.base {
            return;
        }
        let t = self.time(self.point);
        if self.threshold.silent_at(t) || self.state.b < self.threshold.base + self.threshold.rise(t) {
            return;
        }
        out.push(OutputSpike { t, slope: self.state.slope(self.neuron.tau) });
        self.threshold.fire(t);
        if self.neuron.after_spike == AfterSpike::Reset {
            self.state = State::default();
            self.arriving = 0.0;
        }
    }
}
