//! Silence in continuous time: finds where given weights violate it, in one sweep over all patterns with a state of two
//! numbers, without computing rows.
//!
//! Between two input spikes the potential and the tapered margin are one state of the kernel's family, so their maximum
//! above the recovering threshold is computed exactly; intervals are split at inputs, targets, ends of refractory times
//! and starts of tapers. An upper bound that needs no exponential excludes nearly all of them.

use super::peak::{SilencePeak, exceeds};
use super::rows::{Example, Statement, is_lost, until};
use crate::Spike;
use crate::neuron::{AfterSpike, FirstThreshold, KernelSum, Shape, Step, Time, peak, rounding_ms};

/// A time at which the state or the limit changes.
#[derive(Debug, Clone, Copy)]
struct Node {
    /// The decay from the previous node to this one.
    step: Step,
    /// The largest effect of an input of weight 1 at this node before the next node.
    reach: f64,
    /// The lowest limit up to the next node, mV; infinite if no silence is required.
    least: f64,
    /// The inputs at this node end before this index.
    inputs: u32,
    /// Whether all earlier inputs are lost at this node.
    reset: bool,
}

/// The limit of silence between two nodes.
#[derive(Debug, Clone, Copy)]
struct SilenceLimit {
    t: f64,
    /// The time of the next node.
    to: f64,
    theta: f64,
    /// The remaining threshold rise at the node, mV.
    rise: f64,
    /// The margin at the node: within a taper a state of the kernel's family, otherwise the constant `height`.
    taper: KernelSum,
    height: f64,
}

#[derive(Debug, Clone)]
struct Strip {
    nodes: Vec<Node>,
    asked: Vec<SilenceLimit>,
    /// The inputs that have an effect, in order of time.
    inputs: Vec<Spike>,
}

/// All silent times of a problem, prepared for sweeps.
#[derive(Debug, Clone)]
pub(crate) struct SilentTimes {
    shape: Shape,
    tau_rec: f64,
    strips: Vec<Strip>,
}

impl SilentTimes {
    pub(crate) fn new(statement: &Statement) -> Self {
        let strips = statement.examples.iter().map(|example| strip(statement, example)).collect();
        Self { shape: statement.shape, tau_rec: statement.neuron.tau_rec(), strips }
    }

    /// Finds the worst instant of each interval in which the potential plus `share` of the margin exceeds the threshold
    /// by more than `tolerance`.
    pub(crate) fn broken(&self, weights: &[f64], share: f64, tolerance: f64) -> Vec<SilencePeak> {
        let mut found = Vec::new();
        let unit = self.shape.input();
        for (pattern, strip) in self.strips.iter().enumerate() {
            let (mut state, mut next) = (KernelSum::default(), 0);
            let mut worst: Option<SilencePeak> = None;
            for (node, asked) in strip.nodes.iter().zip(&strip.asked) {
                state = if node.reset { KernelSum::default() } else { node.step.apply(state) };
                let inputs = &strip.inputs[next..node.inputs as usize];
                next = node.inputs as usize;
                if !inputs.is_empty() {
                    let sum: f64 = inputs.iter().map(|i| weights[i.train as usize] * f64::from(i.value)).sum();
                    state.a += sum * unit.a;
                    state.b += sum * unit.b;
                }
                let bound = positive(state.b) + positive(state.a) * node.reach;
                if bound - node.least <= tolerance {
                    found.extend(worst.take());
                    continue;
                }
                let (t, excess, last) = self.largest_excess(asked, state, share);
                if exceeds(excess, tolerance) && worst.is_none_or(|w| exceeds(excess, w.excess)) {
                    worst = Some(SilencePeak { pattern, t, excess });
                }
                if last <= tolerance {
                    found.extend(worst.take());
                }
            }
            found.extend(worst);
        }
        found
    }

    /// The time and value of the largest excess between a node and the next, and the excess at the next node.
    fn largest_excess(&self, asked: &SilenceLimit, state: KernelSum, share: f64) -> (f64, f64, f64) {
        let KernelSum { a, b } = asked.taper;
        let state = KernelSum { a: state.a + share * a, b: state.b + share * b };
        let limit = asked.theta - share * asked.height;
        let excess = |s: f64| self.shape.after(state, s).b - limit - asked.rise * (-s / self.tau_rec).exp();
        let length = asked.to - asked.t;
        let last = excess(length);
        let mut worst = (asked.t, state.b - limit - asked.rise);
        if exceeds(last, worst.1) {
            worst = (asked.to, last);
        }
        if let Some(top) = peak(&self.shape, state, asked.rise, self.tau_rec).filter(|p| p.at < length) {
            let excess = excess(top.at);
            if exceeds(excess, worst.1) {
                worst = (asked.t + top.at, excess);
            }
        }
        (worst.0, worst.1, last)
    }
}

/// Returns 0 for values below 0, and other values and NaN unchanged.
fn positive(x: f64) -> f64 {
    if x <= 0.0 { 0.0 } else { x }
}

fn strip(statement: &Statement, example: &Example) -> Strip {
    let Statement { neuron, shape, taper, .. } = statement;
    // An input that is lost just after its own time has no effect at all, because spikes occur only at targets.
    let counts = |i: &Spike| i.t <= example.end && !is_lost(neuron, &example.targets, i.t, i.t.next_up());
    let counted: Vec<Spike> = example.inputs.iter().copied().filter(counts).collect();

    let mut times = vec![example.start, example.end];
    times.extend(counted.iter().map(|i| i.t));
    for &target in &example.targets {
        times.extend([target, target - taper.length, until(target, Time::Continuous), target + neuron.refractory]);
    }
    if neuron.first_threshold == FirstThreshold::Printed {
        let rise = example.start + neuron.refractory;
        // Silence below the lower threshold is required up to slightly before the printed rise, because the neuron
        // rounds the time at which this rise starts.
        times.extend([rise - 2.0 * rounding_ms(rise), rise]);
    }
    times.retain(|&t| example.start <= t && t <= example.end);
    times.sort_unstable_by(f64::total_cmp);
    times.dedup();

    let (mut nodes, mut asked) = (Vec::with_capacity(times.len()), Vec::with_capacity(times.len()));
    let (mut next, mut step, mut length) = (0, shape.step(0.0), 0.0);
    for (k, &t) in times.iter().enumerate() {
        if k > 0 && t - times[k - 1] != length {
            length = t - times[k - 1];
            step = shape.step(length);
        }
        next += counted[next..].iter().take_while(|i| i.t <= t).count();
        let reset = neuron.after_spike == AfterSpike::Reset && example.next(t) == Some(t);
        let mut silence =
            SilenceLimit { t, to: t, theta: neuron.theta_0, rise: 0.0, taper: KernelSum::default(), height: 0.0 };
        let (mut reach, mut least) = (0.0, f64::INFINITY);
        // The last node is an instant by itself: a refractory time may end there.
        let to = times.get(k + 1).copied().unwrap_or(t);
        if asks(statement, example, t, to) {
            silence.to = to;
            // The rise just after the node: a target at the node itself has fired.
            silence.rise = statement.rise(example, example.last_target_before(to), t);
            reach = shape.value((to - t).min(shape.peak()));
            match example.next(to).filter(|target| target - f64::midpoint(t, to) < taper.length) {
                Some(target) => silence.taper = taper.before(target - t),
                None => silence.height = statement.margin.height,
            }
            least =
                silence.theta + silence.rise * (-(to - t) / neuron.tau_rec()).exp() - silence.height - silence.taper.b;
        }
        nodes.push(Node { step, reach, least, inputs: next as u32, reset });
        asked.push(silence);
    }
    Strip { nodes, asked, inputs: counted }
}

/// Whether silence is required between the neighbouring nodes `t` and `to`.
fn asks(statement: &Statement, example: &Example, t: f64, to: f64) -> bool {
    let neuron = &statement.neuron;
    let fired = example.last_target_before(to);
    let rises =
        neuron.first_threshold == FirstThreshold::Printed && fired.is_none() && to == example.start + neuron.refractory;
    !rises
        && fired.is_none_or(|target| target + neuron.refractory <= t)
        && example.next(to).is_none_or(|target| to <= until(target, Time::Continuous))
}
