//! Pricing: where do these weights break silence? One sweep over all patterns, two numbers a pattern, no row written out.
//!
//! Between two input spikes potential and tapered margin are one state of the kernel's family, so their maximum above the
//! recovering threshold is found exactly; intervals are split at inputs, targets, edges of refractory times and where a taper
//! begins. A bound that costs no exponential passes over nearly all of them. On the grid it is a comparison a point.

use super::rows::{AT_TARGET, Row, Sheet, Statement};
use crate::neuron::{AfterSpike, FirstThreshold, Neuron, Shape, State, Step, Time, peak};

/// How long before a rise of the threshold silence is asked for at the lower one, ms: the simulator's edge has some width.
const BEFORE_RISE: f64 = 2e-9;

/// The worst instant of a stretch in which silence is broken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Peak {
    pub(crate) pattern: usize,
    /// ms.
    pub(crate) t: f64,
    /// Potential less threshold plus the share of the margin, mV.
    pub(crate) excess: f64,
}

impl Peak {
    pub(crate) fn row(&self) -> Row {
        Row::Silence { pattern: self.pattern, t: self.t }
    }
}

/// A time at which something happens, with what the sweep needs at each.
#[derive(Debug, Clone, Copy)]
struct Node {
    /// From the node before to here.
    step: Step,
    /// The largest that an input of weight 1 at this node comes to before the next one.
    reach: f64,
    /// The least limit up to the next node (on the grid: at this one), mV; infinite where nothing is asked.
    least: f64,
    /// Where the inputs at this node end.
    inputs: u32,
    /// Everything before is lost from here on.
    reset: bool,
}

/// What silence asks from a node to the next (on the grid: at it).
#[derive(Debug, Clone, Copy)]
struct Asked {
    t: f64,
    /// The next node.
    to: f64,
    theta: f64,
    /// What is left of the threshold's rise at the node, mV.
    rise: f64,
    /// The margin at the node: in a taper as a state of the kernel's family, else constant.
    taper: State,
    height: f64,
}

#[derive(Debug, Clone)]
struct Strip {
    nodes: Vec<Node>,
    asked: Vec<Asked>,
    /// Trains of the inputs that count, by time.
    trains: Vec<u32>,
}

/// All silent times of a problem, laid out for sweeping.
#[derive(Debug, Clone)]
pub(crate) struct Silence {
    shape: Shape,
    tau_rec: f64,
    grid: bool,
    strips: Vec<Strip>,
}

impl Silence {
    pub(crate) fn new(statement: &Statement) -> Self {
        let grid = statement.neuron.time == Time::Grid;
        let strips = statement.sheets.iter().map(|sheet| strip(statement, sheet)).collect();
        Self { shape: statement.shape, tau_rec: statement.neuron.tau_rec(), grid, strips }
    }

    /// Finds the worst instant of each stretch in which potential, with this share of the margin, exceeds the threshold by
    /// more than `tolerance`.
    pub(crate) fn broken(&self, weights: &[f64], share: f64, tolerance: f64) -> Vec<Peak> {
        let mut found = Vec::new();
        let one = self.shape.input();
        for (pattern, strip) in self.strips.iter().enumerate() {
            let (mut state, mut next) = (State::default(), 0);
            let mut worst: Option<Peak> = None;
            for (node, asked) in strip.nodes.iter().zip(&strip.asked) {
                state = node.step.apply(state);
                let before = state.b;
                if node.reset {
                    state = State::default();
                }
                let inputs = &strip.trains[next..node.inputs as usize];
                next = node.inputs as usize;
                if !inputs.is_empty() {
                    let sum: f64 = inputs.iter().map(|&train| weights[train as usize]).sum();
                    state.a += sum * one.a;
                    state.b += sum * one.b;
                }
                let bound = if self.grid { before } else { positive(state.b) + positive(state.a) * node.reach };
                if bound - node.least <= tolerance {
                    found.extend(worst.take());
                    continue;
                }
                let (t, excess, last) = if self.grid {
                    let excess = before - asked.theta - asked.rise + share * asked.height;
                    (asked.t, excess, excess)
                } else {
                    self.largest(asked, state, share)
                };
                if exceeds(excess, tolerance) && worst.is_none_or(|w| exceeds(excess, w.excess)) {
                    worst = Some(Peak { pattern, t, excess });
                }
                if last <= tolerance {
                    found.extend(worst.take());
                }
            }
            found.extend(worst);
        }
        found
    }

    /// The largest excess from a node to the next, when it is, and the excess at the end.
    fn largest(&self, asked: &Asked, state: State, share: f64) -> (f64, f64, f64) {
        let State { a, b } = asked.taper;
        let state = State { a: state.a + share * a, b: state.b + share * b };
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

/// Whether `x` lies above, or is no number: that is never fine.
fn exceeds(x: f64, limit: f64) -> bool {
    x > limit || x.is_nan()
}

/// What lies above 0, and what is no number.
fn positive(x: f64) -> f64 {
    if x <= 0.0 { 0.0 } else { x }
}

/// Whether an input at `t` never counts behind it, the neuron firing at the targets.
fn lost(neuron: &Neuron, sheet: &Sheet, t: f64) -> bool {
    let fired = sheet.targets.partition_point(|&target| target <= t).checked_sub(1).map(|k| sheet.targets[k]);
    neuron.loses(t, fired)
}

fn strip(statement: &Statement, sheet: &Sheet) -> Strip {
    let Statement { neuron, shape, taper, .. } = statement;
    let grid = neuron.time == Time::Grid;
    let heard: Vec<(f64, u32)> =
        sheet.inputs.iter().copied().filter(|&(t, _)| t <= sheet.end && !lost(neuron, sheet, t)).collect();

    let mut times = vec![sheet.start, sheet.end];
    times.extend(heard.iter().map(|i| i.0));
    times.extend(&sheet.targets);
    if grid {
        let points = ((sheet.end - sheet.start) / neuron.step_ms + 1e-9).floor() as usize + 1;
        times.extend((0..points).map(|k| sheet.start + k as f64 * neuron.step_ms));
    } else {
        for &target in &sheet.targets {
            times.extend([target - taper.length, target - AT_TARGET, target + neuron.refractory]);
        }
        if neuron.first_threshold == FirstThreshold::Printed {
            let rise = sheet.start + neuron.refractory;
            times.extend([rise - BEFORE_RISE, rise]);
        }
    }
    times.retain(|&t| sheet.start <= t && t <= sheet.end);
    times.sort_unstable_by(f64::total_cmp);
    times.dedup();

    let (mut nodes, mut asked) = (Vec::with_capacity(times.len()), Vec::with_capacity(times.len()));
    let (mut next, mut step, mut length) = (0, shape.step(0.0), 0.0);
    for (k, &t) in times.iter().enumerate() {
        if k > 0 && t - times[k - 1] != length {
            length = t - times[k - 1];
            step = shape.step(length);
        }
        next += heard[next..].iter().take_while(|i| i.0 <= t).count();
        let to = if grid { Some(t) } else { times.get(k + 1).copied() };
        let reset = neuron.after_spike == AfterSpike::Reset && sheet.next(t) == Some(t);
        let mut here = Asked { t, to: t, theta: neuron.theta_0, rise: 0.0, taper: State::default(), height: 0.0 };
        let (mut reach, mut least) = (0.0, f64::INFINITY);
        if let Some(to) = to.filter(|&to| asks(statement, sheet, t, to)) {
            here.to = to;
            // Just behind the node: a target at the node itself has fired.
            here.rise = statement.rise(sheet, t, to);
            reach = shape.value((to - t).min(shape.peak()));
            match sheet.next(to).filter(|target| target - f64::midpoint(t, to) < taper.length) {
                Some(target) => here.taper = taper.before(target - t),
                None => here.height = statement.margin.height,
            }
            least = here.theta + here.rise * (-(to - t) / neuron.tau_rec()).exp() - here.height - here.taper.b;
        }
        nodes.push(Node { step, reach, least, inputs: next as u32, reset });
        asked.push(here);
    }
    Strip { nodes, asked, trains: heard.iter().map(|i| i.1).collect() }
}

/// Whether silence is asked for from `t` to `to`, neighbouring nodes (on the grid: at `t`).
fn asks(statement: &Statement, sheet: &Sheet, t: f64, to: f64) -> bool {
    let neuron = &statement.neuron;
    if neuron.time == Time::Grid {
        return statement.is_point(sheet, t) && statement.is_silent(sheet, t);
    }
    let fired = sheet.fired(to);
    let rises =
        neuron.first_threshold == FirstThreshold::Printed && fired.is_none() && to == sheet.start + neuron.refractory;
    !rises
        && fired.is_none_or(|target| target + neuron.refractory <= t)
        && sheet.next(to).is_none_or(|target| to <= target - AT_TARGET)
}
