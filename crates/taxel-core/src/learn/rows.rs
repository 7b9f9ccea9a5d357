//! The rows of a learning problem: what the potential is made of at the targets and at every silent grid point.
//!
//! A *row* holds the coefficients of the weights in `U(w, t)` at one time of one pattern. After a spike some inputs are
//! lost (`after_spike`); as the spikes of a learning problem are its targets, the potential stays linear in the weights.
//! Silent rows are never stored: one sweep over the grid gives the potential on all of them (the kernel needs two numbers
//! a pattern), one sweep backwards gives a weighted sum of all of them.

use crate::neuron::{AfterSpike, FirstThreshold, Neuron, Shape, State, Step};
use crate::{Result, SpikeTrains, Stop};

/// Rounding of a grid point on the very edge of a refractory time, ms.
const EDGE: f64 = 1e-9;

/// A row that is kept whole: a target's, or the one behind it that B lifts.
#[derive(Debug, Clone)]
pub(super) struct TargetRow {
    pub(super) pattern: usize,
    pub(super) target: usize,
    /// When, ms.
    pub(super) t: f64,
    /// The threshold at the target, mV.
    pub(super) threshold: f64,
    /// Coefficients at the target, by train.
    pub(super) at: Vec<f64>,
    /// Coefficients `delta_t` later, as though the neuron had not fired at the target.
    pub(super) behind: Vec<f64>,
}

/// An input as the grid sees it: what it adds to the state at the first grid point not before it.
#[derive(Debug, Clone, Copy)]
struct GridInput {
    point: u32,
    train: u32,
    a: f64,
    b: f64,
}

/// The silent rows of one pattern.
#[derive(Debug, Clone)]
struct Sheet {
    inputs: Vec<GridInput>,
    /// Grid points at which everything before is lost (`Reset`), ascending.
    resets: Vec<u32>,
    /// The number of its first row among all.
    first: usize,
    points: usize,
}

/// All silent rows: one a grid point that lies neither at a target nor in the refractory time behind it.
#[derive(Debug, Clone)]
pub(super) struct SilentRows {
    sheets: Vec<Sheet>,
    trains: usize,
    shape: Shape,
    step_ms: f64,
    /// One grid step.
    step: Step,
    /// What the potential must not exceed, mV; infinite where nothing is asked.
    pub(super) limit: Vec<f64>,
    /// The rows (by number) of each target's pattern that lie in the `near_ms` before it.
    pub(super) before_targets: Vec<std::ops::Range<usize>>,
}

/// The last target before `t`, or none.
fn last_before(targets: &[f64], t: f64) -> Option<f64> {
    let n = targets.partition_point(|&target| target < t);
    n.checked_sub(1).map(|k| targets[k])
}

/// The threshold at `t` when the neuron has fired at the targets before.
fn threshold(neuron: &Neuron, start: f64, targets: &[f64], t: f64) -> f64 {
    let printed = (neuron.first_threshold == FirstThreshold::Printed).then_some(start);
    neuron.threshold(last_before(targets, t).or(printed).map(|spike| t - spike))
}

pub(super) fn target_rows(
    neuron: &Neuron,
    delta_t: f64,
    patterns: &[SpikeTrains],
    targets: &[Vec<f64>],
) -> Vec<TargetRow> {
    let mut rows = Vec::new();
    for (p, (pattern, targets)) in patterns.iter().zip(targets).enumerate() {
        for (k, &t) in targets.iter().enumerate() {
            let earlier = &targets[..k];
            rows.push(TargetRow {
                pattern: p,
                target: k,
                t,
                threshold: threshold(neuron, pattern.start, targets, t),
                at: coefficients(neuron, pattern, earlier, t),
                behind: coefficients(neuron, pattern, earlier, t + delta_t),
            });
        }
    }
    rows
}

/// The coefficients of the weights at `t`, the neuron having fired at `earlier` targets only.
fn coefficients(neuron: &Neuron, pattern: &SpikeTrains, earlier: &[f64], t: f64) -> Vec<f64> {
    let shape = neuron.shape();
    let oldest = t - shape.forgotten();
    (0..pattern.len())
        .map(|n| {
            let train = pattern.train(n);
            let from = train.partition_point(|&s| s < oldest);
            let heard = train[from..].iter().take_while(|&&s| s < t);
            let kept = heard.filter(|&&s| !lost(neuron, earlier, s, t));
            kept.map(|&s| shape.value(t - s)).sum()
        })
        .collect()
}

/// Whether an input at `s` no longer counts at `t`, the neuron having fired at these targets.
fn lost(neuron: &Neuron, targets: &[f64], s: f64, t: f64) -> bool {
    match neuron.after_spike {
        AfterSpike::Keep => false,
        AfterSpike::Ignore => neuron.loses(s, last_before(targets, s)),
        AfterSpike::Reset => neuron.loses(s, last_before(targets, t)),
    }
}

impl SilentRows {
    /// Lays the grid over each pattern, from its start to its stop, or one `tau` past its last target, or `horizon`.
    pub(super) fn new(
        neuron: &Neuron,
        horizon: Option<f64>,
        margin: f64,
        near_ms: f64,
        patterns: &[SpikeTrains],
        targets: &[Vec<f64>],
        stop: Stop<'_>,
    ) -> Result<Self> {
        let step = neuron.step_ms;
        let shape = neuron.shape();
        let (mut sheets, mut limit, mut before_targets) = (Vec::new(), Vec::new(), Vec::new());
        for (pattern, targets) in patterns.iter().zip(targets) {
            stop.check()?;
            let time = |point: f64| pattern.start + point * step;
            let last = targets.last().map_or(pattern.stop, |t| pattern.stop.max(t + neuron.tau));
            let end = horizon.unwrap_or(last);
            let points = (((end - pattern.start) / step + EDGE).floor() + 1.0).max(0.0) as usize;
            let first = limit.len();
            let mut next = 0;
            for k in 0..points {
                let t = time(k as f64);
                while next < targets.len() && targets[next] + neuron.refractory + EDGE < t {
                    next += 1;
                }
                let free = next < targets.len() && targets[next] - EDGE <= t;
                limit.push(if free { f64::INFINITY } else { threshold(neuron, pattern.start, targets, t) - margin });
            }
            let point_after = |t: f64| {
                let k = ((t - pattern.start) / step).floor() as u32;
                if time(f64::from(k)) > t { k } else { k + 1 }
            };
            for &t in targets {
                let after = (point_after(t) as usize).min(points);
                let near = (near_ms / step).ceil() as usize;
                before_targets.push(first + after.saturating_sub(near + 1)..first + after);
            }
            let mut inputs = Vec::with_capacity(pattern.times.len());
            for spike in pattern.by_time() {
                let point = ((spike.t - pattern.start) / step).ceil();
                // An input on a point itself is felt behind it; where its kernel begins above 0, from the next point on.
                let late = time(point) - spike.t <= 0.0 && shape.input().b != 0.0;
                let felt = if late { point + 1.0 } else { point };
                if felt < points as f64 && !lost(neuron, targets, spike.t, time(felt)) {
                    let State { a, b } = shape.after(shape.input(), (time(felt) - spike.t).max(0.0));
                    inputs.push(GridInput { point: felt as u32, train: spike.train, a, b });
                }
            }
            let resets = match neuron.after_spike {
                AfterSpike::Reset => targets.iter().map(|&t| point_after(t)).collect(),
                AfterSpike::Keep | AfterSpike::Ignore => vec![],
            };
            sheets.push(Sheet { inputs, resets, first, points });
        }
        let trains = patterns[0].len();
        Ok(Self { sheets, trains, shape, step_ms: step, step: shape.step(step), limit, before_targets })
    }

    /// How many rows, those at which nothing is asked included.
    pub(super) fn len(&self) -> usize {
        self.limit.len()
    }

    /// The potential on every row, mV.
    pub(super) fn potential(&self, weights: &[f64], out: &mut Vec<f64>) {
        out.clear();
        out.reserve(self.len());
        for sheet in &self.sheets {
            let (mut a, mut b) = (0.0, 0.0);
            let (mut input, mut reset) = (sheet.inputs.iter().peekable(), sheet.resets.iter().peekable());
            for point in 0..sheet.points as u32 {
                (a, b) = (a * self.step.aa, b * self.step.bb + a * self.step.ba);
                while reset.next_if(|&&r| r == point).is_some() {
                    (a, b) = (0.0, 0.0);
                }
                while let Some(i) = input.next_if(|i| i.point == point) {
                    let w = weights[i.train as usize];
                    a += w * i.a;
                    b += w * i.b;
                }
                out.push(b);
            }
        }
    }

    /// Adds the sum of all rows, each times its factor, to `sum` (one entry a train): the adjoint of `potential`.
    pub(super) fn add_sum(&self, factors: &[f64], sum: &mut [f64]) {
        for sheet in &self.sheets {
            let (mut a, mut b) = (0.0, 0.0);
            let (mut input, mut reset) = (sheet.inputs.iter().rev().peekable(), sheet.resets.iter().rev().peekable());
            for point in (0..sheet.points as u32).rev() {
                b += factors[sheet.first + point as usize];
                while let Some(i) = input.next_if(|i| i.point == point) {
                    sum[i.train as usize] += a * i.a + b * i.b;
                }
                while reset.next_if(|&&r| r >= point).is_some() {
                    (a, b) = (0.0, 0.0);
                }
                (a, b) = (a * self.step.aa + b * self.step.ba, b * self.step.bb);
            }
        }
    }

    /// The coefficients of the named rows (ascending), row after row.
    pub(super) fn coefficients(&self, rows: &[usize]) -> Vec<f64> {
        let n = self.trains;
        let mut out = vec![0.0; rows.len() * n];
        let mut place = 0;
        for sheet in &self.sheets {
            let (mut a, mut b) = (vec![0.0; n], vec![0.0; n]);
            let (mut input, mut reset, mut at) = (0, 0, 0_u32);
            while place < rows.len() && rows[place] < sheet.first + sheet.points {
                let point = (rows[place] - sheet.first) as u32;
                let reset_from = reset;
                while reset < sheet.resets.len() && sheet.resets[reset] <= point {
                    reset += 1;
                }
                if reset > reset_from {
                    a.fill(0.0);
                    b.fill(0.0);
                    while input < sheet.inputs.len() && sheet.inputs[input].point < sheet.resets[reset - 1] {
                        input += 1;
                    }
                } else {
                    let step = self.shape.step(f64::from(point - at) * self.step_ms);
                    for (a, b) in a.iter_mut().zip(&mut b) {
                        *b = *b * step.bb + *a * step.ba;
                        *a *= step.aa;
                    }
                }
                while input < sheet.inputs.len() && sheet.inputs[input].point <= point {
                    let i = sheet.inputs[input];
                    let now = self.shape.after(State { a: i.a, b: i.b }, f64::from(point - i.point) * self.step_ms);
                    a[i.train as usize] += now.a;
                    b[i.train as usize] += now.b;
                    input += 1;
                }
                out[place * n..(place + 1) * n].copy_from_slice(&b);
                at = point;
                place += 1;
            }
        }
        out
    }
}
