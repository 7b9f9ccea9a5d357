//! The neuron in continuous time: the next crossing is known exactly from the state after the last input.

use super::crossing::next_crossing;
use super::kernel::{KernelSum, Shape};
use super::model::{AT_EDGE, AfterSpike, Neuron};
use super::threshold::{OutputSpike, Threshold};

/// A potential that was trained to reach the threshold may be below it by so many times `touch`.
const ROUNDED: f64 = 4.0;

/// The state of a neuron in continuous time.
#[derive(Debug, Clone)]
pub(super) struct ContinuousStream {
    neuron: Neuron,
    shape: Shape,
    pub(super) threshold: Threshold,
    /// The potential at `at`.
    state: KernelSum,
    at: f64,
    /// The end of the refractory time (or the start of the printed first rise), while it is still to come.
    edge: Option<f64>,
    next: Next,
}

/// The next crossing if no input comes.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Next {
    Unknown,
    Never,
    At(f64),
}

impl ContinuousStream {
    pub(super) fn new(neuron: &Neuron, factor: f64, start: f64) -> Self {
        let threshold = Threshold::new(neuron, factor, start);
        let edge = threshold.edge();
        let (shape, state) = (neuron.shape(), KernelSum::default());
        Self { neuron: neuron.clone(), shape, threshold, state, at: start, edge, next: Next::Never }
    }

    /// Continues from a state at `at`, which the caller computed, to an input or the end at `until`; returns the state there.
    pub(super) fn resume(
        &mut self,
        state: KernelSum,
        at: f64,
        until: f64,
        input: bool,
        out: &mut Vec<OutputSpike>,
    ) -> KernelSum {
        (self.state, self.at, self.next) = (state, at, Next::Unknown);
        if input {
            self.settle_at_input(until, until + AT_EDGE, out);
        } else {
            self.settle(until, until, out);
        }
        self.shape.after(self.state, until - self.at)
    }

    /// The potential at `t`, not before what came last, mV.
    pub(super) fn potential(&self, t: f64) -> f64 {
        self.shape.after(self.state, (t - self.at).max(0.0)).b
    }

    /// The end of the refractory time, or the start of the printed first rise, while it is still to come.
    pub(super) fn edge(&self) -> Option<f64> {
        self.edge
    }

    /// The rest of the threshold's rise at `t`, mV.
    pub(super) fn rise(&self, t: f64) -> f64 {
        self.threshold.rise(t)
    }

    pub(super) fn push(&mut self, t: f64, weight: f64, out: &mut Vec<OutputSpike>) {
        self.settle_at_input(t, f64::INFINITY, out);
        if self.neuron.loses(t, self.threshold.fired) {
            return;
        }
        self.move_to(t);
        self.shape.add(&mut self.state, weight, self.at - t);
    }

    /// Fires at every crossing up to an input at `t`, included.
    fn settle_at_input(&mut self, t: f64, horizon: f64, out: &mut Vec<OutputSpike>) {
        self.settle(t, horizon, out);
        // The potential of a trained neuron reaches the threshold to rounding. An input there comes too late to turn it down.
        if let Next::At(crossing) = self.next
            && crossing - t <= AT_EDGE
            && self.edge.is_none_or(|edge| crossing < edge)
            && self.below(t) <= ROUNDED * self.threshold.touch
        {
            self.fire(crossing, out);
        }
    }

    /// How far the potential is below the threshold at `t`, mV.
    fn below(&self, t: f64) -> f64 {
        // Before the printed first rise sets in there is none; it is an edge of its own.
        let rise = if self.edge.is_some() { 0.0 } else { self.threshold.rise(t) };
        self.threshold.base + rise - self.potential(t)
    }

    fn move_to(&mut self, t: f64) {
        if t > self.at {
            self.state = self.shape.after(self.state, t - self.at);
            self.at = t;
        }
        self.next = Next::Unknown;
    }

    /// Fires at every crossing up to `until`, included; crossings after `horizon` need not be found.
    pub(super) fn settle(&mut self, until: f64, horizon: f64, out: &mut Vec<OutputSpike>) {
        loop {
            let waiting = self.edge.is_some() && self.threshold.fired.is_some();
            // At the state's own time the potential has been compared already: an input adds 0 there.
            if !waiting && until > self.at && self.next == Next::Unknown {
                self.next = self.crossing(horizon);
            }
            match (self.next, self.edge) {
                (Next::At(t), edge) if !waiting && t <= until && edge.is_none_or(|e| t < e) => self.fire(t, out),
                (_, Some(edge)) if edge <= until => {
                    self.move_to(edge);
                    self.edge = None;
                    // After the refractory time the neuron fires at once where the potential is above the threshold already.
                    self.next = self.crossing(horizon);
                }
                _ => return,
            }
        }
    }

    fn crossing(&self, horizon: f64) -> Next {
        // Before the printed first rise sets in there is none; it is an edge of its own.
        let rise = if self.edge.is_some() { 0.0 } else { self.threshold.rise(self.at) };
        let Threshold { base, touch, tau_rec, .. } = self.threshold;
        let found = next_crossing(&self.shape, self.state, (base, touch), rise, tau_rec, horizon - self.at);
        found.map_or(Next::Never, |s| Next::At(self.at + s))
    }

    fn fire(&mut self, t: f64, out: &mut Vec<OutputSpike>) {
        let slope = self.shape.slope(self.shape.after(self.state, t - self.at));
        out.push(OutputSpike { t, slope });
        self.threshold.fire(t);
        self.edge = self.threshold.edge();
        if self.neuron.after_spike == AfterSpike::Reset {
            self.state = KernelSum::default();
        }
        self.move_to(t);
    }
}
