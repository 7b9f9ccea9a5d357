//! The neuron in continuous time: the next crossing is known exactly from the state after the last input.

use super::crossing::next_crossing;
use super::kernel::{KernelSum, Shape};
use super::model::{AT_EDGE, AfterSpike, Neuron};
use super::threshold::{OutputSpike, Threshold};

/// A trained potential counts as reaching the threshold at an input if it is at most `ROUNDED * touch` mV below it.
const ROUNDED: f64 = 4.0;

/// The state of a neuron in continuous time.
#[derive(Debug, Clone)]
pub(super) struct ContinuousStream {
    neuron: Neuron,
    shape: Shape,
    pub(super) threshold: Threshold,
    /// The state at time `at`.
    state: KernelSum,
    at: f64,
    /// The end of the refractory time (or the start of the printed first rise), until it has passed.
    edge: Option<f64>,
    next: NextCrossing,
}

/// The next crossing if no input comes.
#[derive(Debug, Clone, Copy, PartialEq)]
enum NextCrossing {
    Unknown,
    Never,
    At(f64),
}

impl ContinuousStream {
    pub(super) fn new(neuron: &Neuron, factor: f64, start: f64) -> Self {
        let threshold = Threshold::new(neuron, factor, start);
        let edge = threshold.edge();
        let (shape, state) = (neuron.shape(), KernelSum::default());
        Self { neuron: neuron.clone(), shape, threshold, state, at: start, edge, next: NextCrossing::Never }
    }

    /// The potential at `t`, which must not be before the state's time, mV.
    pub(super) fn potential(&self, t: f64) -> f64 {
        self.shape.after(self.state, (t - self.at).max(0.0)).b
    }

    pub(super) fn push(&mut self, t: f64, weight: f64, value: f64, out: &mut Vec<OutputSpike>) {
        self.settle_at_input(t, out);
        if self.neuron.loses(t, self.threshold.fired) {
            return;
        }
        self.move_to(t);
        self.shape.add(&mut self.state, weight, value, self.at - t);
    }

    /// Fires at every crossing up to and including `t`, the time of an input.
    fn settle_at_input(&mut self, t: f64, out: &mut Vec<OutputSpike>) {
        self.settle(t, out);
        // A trained potential touches the threshold only to within rounding, so its computed crossing may be shortly
        // after an input that is simultaneous with it. Such an input comes too late to suppress the spike.
        if let NextCrossing::At(crossing) = self.next
            && crossing - t <= AT_EDGE
            && self.edge.is_none_or(|edge| crossing < edge)
            && self.below(t) <= ROUNDED * self.threshold.touch
        {
            self.fire(crossing, out);
        }
    }

    /// How far the potential is below the threshold at `t`, mV.
    fn below(&self, t: f64) -> f64 {
        // The printed first rise is 0 until it starts; its start is an edge, which `settle` handles by itself.
        let rise = if self.edge.is_some() { 0.0 } else { self.threshold.rise(t) };
        self.threshold.base + rise - self.potential(t)
    }

    fn move_to(&mut self, t: f64) {
        if t > self.at {
            self.state = self.shape.after(self.state, t - self.at);
            self.at = t;
        }
        self.next = NextCrossing::Unknown;
    }

    /// Fires at every crossing up to and including `until`.
    pub(super) fn settle(&mut self, until: f64, out: &mut Vec<OutputSpike>) {
        loop {
            let waiting = self.edge.is_some() && self.threshold.fired.is_some();
            // The potential at the state's own time has been compared before: an input contributes 0 at its own time.
            if !waiting && until > self.at && self.next == NextCrossing::Unknown {
                self.next = self.crossing();
            }
            match (self.next, self.edge) {
                (NextCrossing::At(t), edge) if !waiting && t <= until && edge.is_none_or(|e| t < e) => {
                    self.fire(t, out)
                }
                (_, Some(edge)) if edge <= until => {
                    self.move_to(edge);
                    self.edge = None;
                    // If the potential is above the threshold when the refractory time ends, the neuron fires at once.
                    self.next = self.crossing();
                }
                _ => return,
            }
        }
    }

    fn crossing(&self) -> NextCrossing {
        // The printed first rise is 0 until it starts; its start is an edge, which `settle` handles by itself.
        let rise = if self.edge.is_some() { 0.0 } else { self.threshold.rise(self.at) };
        let Threshold { base, touch, tau_rec, .. } = self.threshold;
        let found = next_crossing(&self.shape, self.state, (base, touch), rise, tau_rec);
        found.map_or(NextCrossing::Never, |s| NextCrossing::At(self.at + s))
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
