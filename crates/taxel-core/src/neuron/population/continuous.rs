//! A block of neurons in continuous time: advances exactly from one input time to the next.

use super::lanes::{FADED, LANES, LOOK, NeuronLanes, Weight, slack};
use crate::neuron::continuous::ContinuousStream;
use crate::neuron::kernel::{KernelSum, Step};
use crate::neuron::model::{AT_EDGE, AfterSpike, Neuron};
use crate::neuron::threshold::OutputSpike;
use crate::vectors::wide;
use crate::{Result, SpikeKind, SpikeTrains, Stop};

/// In intervals longer than this share of tau, the kernel's largest value is a tighter bound than the tangent.
const LONG: f64 = 0.3;

/// The inputs in order of time and the intervals between them, shared by all neurons.
pub(super) struct Script {
    begin: ContinuousStream,
    intervals: Vec<Interval>,
    /// The train and the value of each input, in order of time.
    inputs: Vec<(u32, f32)>,
    /// Whether every input adds its whole weight: none is lost, and none has a value.
    plain: bool,
    /// The contributions of `a` and of `b` to the slope of the potential, per mV, 1/ms.
    slope: KernelSum,
    /// The base of the threshold minus the rounding error of the bound, mV.
    floor: f64,
}

/// The time from one input time to the next.
struct Interval {
    from: f64,
    until: f64,
    /// The inputs at `from` end before this index.
    inputs_end: usize,
    step: Step,
    /// The share of a threshold rise at `from` that remains at `until`.
    fade: f64,
    /// The time after `from` up to which crossings are searched, ms: `AT_EDGE` beyond `until`, because an input so
    /// shortly before a crossing counts as simultaneous with it.
    ahead: f64,
    /// A lower bound of the share of the rise that remains after `ahead`.
    faded: f64,
    /// The largest kernel value within the interval; only for long intervals, whose potential is bounded by it.
    reach: Option<f64>,
}

impl Script {
    pub(super) fn new(neuron: &Neuron, trains: &SpikeTrains, threshold: f64, stop: Stop<'_>) -> Result<Self> {
        let (shape, spikes) = (neuron.shape(), trains.by_time(stop)?);
        let mut intervals: Vec<Interval> = vec![];
        let mut from = trains.start;
        let mut push = |from: f64, until: f64, inputs_end: usize| {
            let length = until - from;
            let ahead = length + AT_EDGE;
            intervals.push(Interval {
                from,
                until,
                inputs_end,
                step: shape.step(length),
                fade: (-length / neuron.tau_rec()).exp(),
                ahead,
                faded: (-ahead / neuron.tau_rec()).exp() * FADED,
                reach: (length > LONG * neuron.tau).then(|| shape.largest_within(ahead)),
            });
        };
        for (k, spike) in spikes.iter().enumerate() {
            if k % LOOK == 0 {
                stop.check()?;
            }
            if spike.t > from {
                push(from, spike.t, k);
                from = spike.t;
            }
        }
        push(from, trains.stop, spikes.len());
        Ok(Self {
            begin: ContinuousStream::new(neuron, threshold, trains.start),
            inputs: spikes.iter().map(|s| (s.train, s.value)).collect(),
            plain: neuron.after_spike == AfterSpike::Keep && trains.kind != SpikeKind::Graded,
            slope: KernelSum {
                a: shape.slope(KernelSum { a: 1.0, b: 0.0 }),
                b: shape.slope(KernelSum { a: 0.0, b: 1.0 }),
            },
            floor: neuron.theta_0 * threshold - slack(neuron, &spikes),
            intervals,
        })
    }
}

/// Runs a block of neurons from start to stop and appends each neuron's spikes to `fired`.
pub(super) fn run<W: Weight>(
    neuron: &Neuron,
    script: &Script,
    block: &[[W; LANES]],
    fired: &mut [Vec<f64>; LANES],
    stop: Stop<'_>,
) -> Result<()> {
    let mut streams: Vec<ContinuousStream> = vec![script.begin.clone(); LANES];
    let mut lanes = NeuronLanes::new(script.begin.edge());
    let mut perhaps = [false; LANES];
    let mut found: Vec<OutputSpike> = vec![];
    let mut k = 0;
    while let Some(at) = quiet(&mut lanes, script, block, k, &mut perhaps) {
        if at % LOOK == LOOK - 1 {
            stop.check()?;
        }
        let interval = &script.intervals[at];
        let before = (lanes.a, lanes.b);
        pass(&mut lanes, interval);
        for lane in (0..LANES).filter(|&l| perhaps[l]) {
            let stream = &mut streams[lane];
            found.clear();
            let state = KernelSum { a: before.0[lane], b: before.1[lane] };
            let after =
                stream.resume(state, interval.from, interval.until, at + 1 < script.intervals.len(), &mut found);
            if let Some(last) = found.last() {
                fired[lane].extend(found.iter().map(|spike| spike.t));
                lanes.fire(lane, last.t, last.t + neuron.refractory, neuron.after_spike);
                if neuron.after_spike == AfterSpike::Reset {
                    (lanes.a[lane], lanes.b[lane]) = (after.a, after.b);
                }
            }
            if stream.edge().is_none() && lanes.edge[lane] <= interval.until {
                lanes.edge[lane] = f64::INFINITY;
                lanes.rise[lane] = stream.rise(interval.until);
            }
        }
        k = at + 1;
    }
    Ok(())
}

/// Whether a neuron may cross its threshold within an interval, or its refractory time may end.
///
/// While the potential is positive and rising, its curve is concave and stays below its tangent; while it falls, its
/// largest value is the present one.
#[inline(always)]
fn may_matter(a: f64, b: f64, rise: f64, edge: f64, script: &Script, interval: &Interval) -> bool {
    let top = match interval.reach {
        None => {
            let slope = a * script.slope.a + b * script.slope.b;
            b + (if slope > 0.0 { slope } else { 0.0 }) * interval.ahead
        }
        Some(reach) => (if b > 0.0 { b } else { 0.0 }) + (if a > 0.0 { a } else { 0.0 }) * reach,
    };
    // The rise only decays, so the threshold is lowest at the end.
    (top >= script.floor + rise * interval.faded) | (edge <= interval.until)
}

/// Decays the states through the preceding interval, adds an input, and returns whether any neuron may fire.
#[inline(always)]
fn one_input<W: Weight>(
    lanes: &mut NeuronLanes,
    script: &Script,
    interval: &Interval,
    (step, fade): (Step, f64),
    weights: &[W; LANES],
    receives: Option<&[f64; LANES]>,
) -> bool {
    let mut any = false;
    for l in 0..LANES {
        let (a, b, w) = (lanes.a[l], lanes.b[l], weights[l].into());
        let w: f64 = receives.map_or(w, |receives| w * receives[l]);
        let (a, b, rise) = (a * step.aa + w, b * step.bb + a * step.ba, lanes.rise[l] * fade);
        (lanes.a[l], lanes.b[l], lanes.rise[l]) = (a, b, rise);
        any |= may_matter(a, b, rise, lanes.edge[l], script, interval);
    }
    any
}

wide! {
    /// Decays the states of a block through an interval without spikes.
    fn pass(lanes: &mut NeuronLanes, interval: &Interval) {
        let Step { aa, ba, bb } = interval.step;
        for l in 0..LANES {
            let (a, b) = (lanes.a[l], lanes.b[l]);
            lanes.a[l] = a * aa;
            lanes.b[l] = b * bb + a * ba;
            lanes.rise[l] *= interval.fade;
        }
    }
}

wide! {
    /// Advances a block from the beginning of interval `from`, before its inputs, to the next interval in which a
    /// neuron may fire or leave its refractory time, or at which Ctrl-C is checked. Returns that interval's index with
    /// its inputs added, and marks in `perhaps` the neurons that may fire in it.
    fn quiet<W: Weight>(
        lanes: &mut NeuronLanes,
        script: &Script,
        block: &[[W; LANES]],
        from: usize,
        perhaps: &mut [bool; LANES],
    ) -> Option<usize> {
        let mut next = if from == 0 { 0 } else { script.intervals[from - 1].inputs_end };
        let mut step = Step { aa: 1.0, ba: 0.0, bb: 1.0 };
        let mut fade = 1.0;
        for (k, interval) in script.intervals.iter().enumerate().skip(from) {
            let inputs = &script.inputs[next..interval.inputs_end];
            next = interval.inputs_end;
            let mut any = false;
            if let &[(train, value)] = inputs {
                // Most intervals begin with a single input: decay and input in one pass.
                let weights = &block[train as usize];
                any = if script.plain {
                    one_input(lanes, script, interval, (step, fade), weights, None)
                } else {
                    let receives = lanes.receives(interval.from).map(|gain| gain * f64::from(value));
                    one_input(lanes, script, interval, (step, fade), weights, Some(&receives))
                };
            } else {
                for l in 0..LANES {
                    let (a, b) = (lanes.a[l], lanes.b[l]);
                    lanes.a[l] = a * step.aa;
                    lanes.b[l] = b * step.bb + a * step.ba;
                    lanes.rise[l] *= fade;
                }
                let receives = if script.plain { [1.0; LANES] } else { lanes.receives(interval.from) };
                for &(train, value) in inputs {
                    let (weights, value) = (&block[train as usize], f64::from(value));
                    for l in 0..LANES {
                        lanes.a[l] += weights[l].into() * (receives[l] * value);
                    }
                }
                for l in 0..LANES {
                    any |= may_matter(lanes.a[l], lanes.b[l], lanes.rise[l], lanes.edge[l], script, interval);
                }
            }
            if any || k % LOOK == LOOK - 1 {
                for (l, perhaps) in perhaps.iter_mut().enumerate() {
                    *perhaps = may_matter(lanes.a[l], lanes.b[l], lanes.rise[l], lanes.edge[l], script, interval);
                }
                return Some(k);
            }
            (step, fade) = (interval.step, interval.fade);
        }
        None
    }
}
