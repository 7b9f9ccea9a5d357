//! The neuron at work: input spikes in, output spikes out, the same wherever the stream is cut.

use super::grid::GridStream;
use super::srm0::next_crossing;
use super::{AT_EDGE, AfterSpike, FirstThreshold, Neuron, Shape, State, Time};
use crate::allowed::{above_0, one_weight_a_train};
use crate::{Result, problem};

/// A spike of the neuron.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutputSpike {
    /// When the potential crossed the threshold (on a grid: the first point at or above it), ms.
    pub t: f64,
    /// How steeply it crossed, mV/ms.
    pub slope: f64,
}

/// A neuron that runs while its inputs arrive.
///
/// Output depends on the inputs alone, not on when [`NeuronStream::advance`] is called: what a crossing needs is reckoned
/// from the last input, never from the last call.
#[derive(Debug, Clone)]
pub struct NeuronStream {
    weights: Vec<f64>,
    now: f64,
    clock: Clock,
}

#[derive(Debug, Clone)]
enum Clock {
    Continuous(ContinuousStream),
    Grid(GridStream),
}

impl NeuronStream {
    pub(super) fn new(neuron: &Neuron, weights: &[f64], threshold: f64, start: f64) -> Result<Self> {
        neuron.check()?;
        one_weight_a_train(weights, weights.len())?;
        above_0("threshold factor", threshold, "")?;
        if !start.is_finite() {
            return Err(problem!("start is {start} ms: must be finite"));
        }
        let clock = match neuron.time {
            Time::Continuous => Clock::Continuous(ContinuousStream::new(neuron, threshold, start)),
            Time::Grid => Clock::Grid(GridStream::new(neuron, threshold, start)),
        };
        Ok(Self { weights: weights.to_vec(), now: start, clock })
    }

    /// Takes the next input spike, at `t` ms on train `train`; gives what the neuron fired up to there.
    ///
    /// # Errors
    ///
    /// `Problem` where the spike comes before an earlier one, or names a train without a weight.
    pub fn push(&mut self, t: f64, train: u32, out: &mut Vec<OutputSpike>) -> Result<()> {
        if t.is_nan() || t < self.now {
            return Err(problem!("input spike at {t} ms: time has come to {} ms already", self.now));
        }
        let Some(&weight) = self.weights.get(train as usize) else {
            return Err(problem!("input spike at {t} ms: train {train} of {}", self.weights.len()));
        };
        self.now = t;
        match &mut self.clock {
            Clock::Continuous(stream) => stream.push(t, weight, out),
            Clock::Grid(stream) => stream.push(t, weight, out),
        }
        Ok(())
    }

    /// Moves time on to `t` ms: no input will come before it any more. An earlier time changes nothing.
    pub fn advance(&mut self, t: f64, out: &mut Vec<OutputSpike>) {
        if t >= self.now {
            self.now = t;
            match &mut self.clock {
                Clock::Continuous(stream) => stream.settle(t, f64::INFINITY, out),
                Clock::Grid(stream) => stream.settle(t, out),
            }
        }
    }

    /// What time has come to, ms.
    pub(super) fn now(&self) -> f64 {
        self.now
    }

    /// The potential now, as 6.7 has it (0 in the refractory time), mV.
    #[must_use]
    pub fn potential(&self) -> f64 {
        let (refractory, value) = match &self.clock {
            Clock::Continuous(s) => (&s.threshold, s.shape.after(s.state, (self.now - s.at).max(0.0)).b),
            Clock::Grid(s) => (&s.threshold, s.potential(self.now)),
        };
        if refractory.silent_at(self.now) { 0.0 } else { value }
    }
}

/// The threshold with its memory of the last spike.
#[derive(Debug, Clone)]
pub(super) struct Threshold {
    /// `theta_0` times the factor, mV.
    pub(super) base: f64,
    /// How far below it counts as reaching it, mV.
    pub(super) touch: f64,
    plus: f64,
    tau_rec: f64,
    refractory: f64,
    /// The last spike, or where the printed reading puts spike number 0.
    since: Option<f64>,
    /// The last spike proper.
    pub(super) fired: Option<f64>,
}

/// Rounding of a grid point or an input on the very edge of the refractory time, ms.
pub(super) const EDGE: f64 = 1e-9;

impl Threshold {
    pub(super) fn new(neuron: &Neuron, factor: f64, start: f64) -> Self {
        Self {
            base: neuron.theta_0 * factor,
            touch: neuron.touch(),
            plus: neuron.theta_plus * factor,
            tau_rec: neuron.tau_rec(),
            refractory: neuron.refractory,
            since: (neuron.first_threshold == FirstThreshold::Printed).then_some(start),
            fired: None,
        }
    }

    pub(super) fn fire(&mut self, t: f64) {
        self.since = Some(t);
        self.fired = Some(t);
    }

    /// What is left of the rise at `t`, mV.
    pub(super) fn rise(&self, t: f64) -> f64 {
        if self.plus == 0.0 {
            return 0.0;
        }
        self.since.map_or(0.0, |since| {
            let recovering = t - since - self.refractory;
            if recovering < -EDGE { 0.0 } else { self.plus * (-recovering / self.tau_rec).exp() }
        })
    }

    /// Whether the neuron cannot fire at `t`: `0 < t - spike <= refractory` (6.6).
    pub(super) fn silent_at(&self, t: f64) -> bool {
        self.fired.is_some_and(|spike| spike < t && t <= spike + self.refractory + EDGE)
    }

    /// Whether a potential on a grid has reached the threshold at `t`, and the neuron may fire.
    pub(super) fn reached(&self, t: f64, potential: f64) -> bool {
        let potential = potential + self.touch;
        potential >= self.base && !self.silent_at(t) && potential >= self.base + self.rise(t)
    }

    /// When the rise sets in and the refractory time ends.
    pub(super) fn edge(&self) -> Option<f64> {
        self.since.map(|since| since + self.refractory)
    }
}

/// Continuous time: the next crossing is known exactly from the state after the last input.
#[derive(Debug, Clone)]
pub(super) struct ContinuousStream {
    neuron: Neuron,
    shape: Shape,
    threshold: Threshold,
    /// The potential at `at`.
    state: State,
    at: f64,
    /// The end of the refractory time (or the start of the printed first rise), while it lies ahead.
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
        let (shape, state) = (neuron.shape(), State::default());
        Self { neuron: neuron.clone(), shape, threshold, state, at: start, edge, next: Next::Never }
    }

    /// Goes from a state that somebody else kept at `at` to `until`, where an input comes or the end; gives the state there.
    pub(super) fn resume(
        &mut self,
        state: State,
        at: f64,
        until: f64,
        input: bool,
        out: &mut Vec<OutputSpike>,
    ) -> State {
        (self.state, self.at, self.next) = (state, at, Next::Unknown);
        if input {
            self.settle_at_input(until, until + AT_EDGE, out);
        } else {
            self.settle(until, until, out);
        }
        self.shape.after(self.state, until - self.at)
    }

    /// The end of the refractory time, or where the printed first rise sets in, while it lies ahead.
    pub(super) fn edge(&self) -> Option<f64> {
        self.edge
    }

    /// What is left of the threshold's rise at `t`, mV.
    pub(super) fn rise(&self, t: f64) -> f64 {
        self.threshold.rise(t)
    }

    fn push(&mut self, t: f64, weight: f64, out: &mut Vec<OutputSpike>) {
        self.settle_at_input(t, f64::INFINITY, out);
        if self.neuron.loses(t, self.threshold.fired) {
            return;
        }
        self.move_to(t);
        self.shape.add(&mut self.state, weight, self.at - t);
    }

    /// Fires whatever crosses up to an input at `t`, included.
    fn settle_at_input(&mut self, t: f64, horizon: f64, out: &mut Vec<OutputSpike>) {
        self.settle(t, horizon, out);
        // An input a hair before a crossing is at it and comes too late: it could turn the potential down there.
        if let Next::At(crossing) = self.next
            && crossing - t <= AT_EDGE
            && self.edge.is_none_or(|edge| crossing < edge)
        {
            self.fire(crossing, out);
        }
    }

    fn move_to(&mut self, t: f64) {
        if t > self.at {
            self.state = self.shape.after(self.state, t - self.at);
            self.at = t;
        }
        self.next = Next::Unknown;
    }

    /// Fires whatever crosses up to `until`, included; what crosses after `horizon` is not asked for.
    fn settle(&mut self, until: f64, horizon: f64, out: &mut Vec<OutputSpike>) {
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
                    // The neuron is free again: it fires at once where the potential is above the threshold already.
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
            self.state = State::default();
        }
        self.move_to(t);
    }
}
