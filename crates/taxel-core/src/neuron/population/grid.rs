//! A block of neurons on a grid: advances from point to point.

use super::lanes::{FADED, LANES, LOOK, NeuronLanes, Weight, slack};
use crate::neuron::kernel::{KernelSum, Step};
use crate::neuron::model::{AfterSpike, Neuron};
use crate::neuron::points::{Grid, GridTime};
use crate::neuron::rounding_ms;
use crate::neuron::threshold::Threshold;
use crate::vectors::wide;
use crate::{Result, SpikeTrains, Stop};

/// The grid and the inputs at its points, shared by all neurons.
pub(super) struct Script {
    threshold: Threshold,
    grid: Grid,
    /// The base of the threshold minus the rounding error of the bound, mV.
    floor: f64,
    points: Vec<GridInputs>,
    inputs: Vec<Input>,
    step: Step,
    /// The share of a threshold rise that remains after one step.
    fade: f64,
    loses_none: bool,
}

struct GridInputs {
    t: f64,
    /// The inputs after the preceding point and before this one end before this index.
    aged_end: usize,
    /// The inputs exactly at the point end before this index; they change the potential only after it.
    arriving_end: usize,
}

struct Input {
    train: u32,
    t: f64,
    /// The state that the input, with a weight of 1, has reached at the point.
    unit_state: KernelSum,
}

impl NeuronLanes {
    /// Starts the decay of the threshold rise if the refractory time has ended by `t`.
    fn recover(&mut self, lane: usize, threshold: &Threshold, t: f64) {
        if self.edge[lane] <= t + rounding_ms(t) {
            self.edge[lane] = f64::INFINITY;
            self.rise[lane] = threshold.rise(t);
        }
    }

    /// Adds inputs one after the other; if `now` is given, all of them arrive at that time.
    #[inline(always)]
    fn add_inputs<W: Weight>(&mut self, block: &[[W; LANES]], inputs: &[Input], now: Option<f64>, loses_none: bool) {
        // Local copies, so that the compiler keeps the sums in registers.
        let (mut a, mut b) = (self.a, self.b);
        let receives = now.map(|now| self.receives(now));
        for input in inputs {
            let weights = &block[input.train as usize];
            let unit_state = input.unit_state;
            match (loses_none, &receives) {
                (true, _) if unit_state.b == 0.0 => {
                    for l in 0..LANES {
                        a[l] += weights[l].into() * unit_state.a;
                    }
                }
                (true, _) => {
                    for l in 0..LANES {
                        let w: f64 = weights[l].into();
                        a[l] += w * unit_state.a;
                        b[l] += w * unit_state.b;
                    }
                }
                (false, Some(receives)) if unit_state.b == 0.0 => {
                    for l in 0..LANES {
                        a[l] += weights[l].into() * unit_state.a * receives[l];
                    }
                }
                (false, receives) => {
                    let receives = receives.unwrap_or_else(|| self.receives(input.t));
                    for l in 0..LANES {
                        let w = weights[l].into() * receives[l];
                        a[l] += w * unit_state.a;
                        b[l] += w * unit_state.b;
                    }
                }
            }
        }
        (self.a, self.b) = (a, b);
    }
}

impl Script {
    pub(super) fn new(neuron: &Neuron, trains: &SpikeTrains, threshold: f64, stop: Stop<'_>) -> Result<Self> {
        let (shape, step_ms, start) = (neuron.shape(), neuron.step_ms, trains.start);
        let (grid, spikes) = (Grid::new(start, step_ms), trains.by_time(stop)?);
        let last = grid.locate(trains.stop).until();
        let mut inputs: Vec<Input> = Vec::with_capacity(spikes.len());
        let (mut points, mut rest) = (vec![], spikes.iter().peekable());
        let mut point = 0.0;
        while point <= last {
            if points.len() % LOOK == 0 {
                stop.check()?;
            }
            let t = grid.time(point);
            let mut arriving = vec![];
            while let Some(spike) = rest.next_if(|s| grid.locate(s.t).from() <= point) {
                let age = grid.between(grid.locate(spike.t), GridTime::at(point));
                let mut unit_state = KernelSum::default();
                shape.add(&mut unit_state, 1.0, f64::from(spike.value), age.max(0.0));
                let to = if age > 0.0 { &mut inputs } else { &mut arriving };
                to.push(Input { train: spike.train, t: spike.t, unit_state });
            }
            let aged_end = inputs.len();
            inputs.append(&mut arriving);
            points.push(GridInputs { t, aged_end, arriving_end: inputs.len() });
            point += 1.0;
        }
        let far = grid.rounding_ms(trains.stop);
        let threshold = Threshold::new(neuron, threshold, start);
        Ok(Self {
            floor: threshold.base - threshold.slack(far) - slack(neuron, &spikes),
            threshold,
            grid,
            step: shape.step(step_ms),
            fade: (-step_ms / neuron.tau_rec()).exp(),
            loses_none: neuron.after_spike == AfterSpike::Keep,
            points,
            inputs,
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
    let mut thresholds: Vec<Threshold> = vec![script.threshold.clone(); LANES];
    let mut lanes = NeuronLanes::new(script.threshold.edge());
    let shape = neuron.shape();
    let mut perhaps = [false; LANES];
    let mut from = None;
    while let Some(at) = quiet(&mut lanes, script, block, from, &mut perhaps) {
        if at % LOOK == LOOK - 1 {
            stop.check()?;
        }
        let t = script.points[at].t;
        for lane in (0..LANES).filter(|&l| perhaps[l]) {
            let threshold = &mut thresholds[lane];
            lanes.recover(lane, threshold, t);
            let slope = shape.slope(KernelSum { a: lanes.a[lane], b: lanes.b[lane] });
            if threshold.compare(t, lanes.b[lane], slope, script.grid.rounding_ms(t)) {
                fired[lane].push(t);
                threshold.fire(t);
                lanes.fire(lane, t, t + neuron.refractory, neuron.after_spike);
                if neuron.after_spike == AfterSpike::Reset {
                    (lanes.a[lane], lanes.b[lane]) = (0.0, 0.0);
                }
                lanes.recover(lane, threshold, t);
            }
            if neuron.rearm.is_some() {
                // No rise can exclude a neuron that is unarmed: each point may arm it.
                lanes.rise[lane] = match (threshold.is_unarmed(), lanes.edge[lane].is_finite()) {
                    (true, _) => f64::NEG_INFINITY,
                    (false, true) => f64::INFINITY,
                    (false, false) => threshold.rise(t),
                };
            }
        }
        from = Some(at);
    }
    Ok(())
}

#[inline(always)]
fn may_matter(lanes: &NeuronLanes, l: usize, t: f64, floor: f64) -> bool {
    (lanes.b[l] >= floor + lanes.rise[l] * FADED) | (lanes.edge[l] <= t + rounding_ms(t))
}

wide! {
    /// Advances a block from point `from` (whose own inputs are added on leaving it), or from before the first point,
    /// to the next point at which a neuron may fire or leave its refractory time, or Ctrl-C is checked. Returns that
    /// point, and marks in `perhaps` the neurons that may fire there.
    fn quiet<W: Weight>(
        lanes: &mut NeuronLanes,
        script: &Script,
        block: &[[W; LANES]],
        from: Option<usize>,
        perhaps: &mut [bool; LANES],
    ) -> Option<usize> {
        let floor = script.floor;
        let Step { aa, ba, bb } = script.step;
        let mut next = 0;
        if let Some(from) = from {
            let point = &script.points[from];
            next = point.arriving_end;
            lanes.add_inputs(block, &script.inputs[point.aged_end..next], Some(point.t), script.loses_none);
        }
        for (k, point) in script.points.iter().enumerate().skip(from.map_or(0, |from| from + 1)) {
            for l in 0..LANES {
                let (a, b) = (lanes.a[l], lanes.b[l]);
                lanes.a[l] = a * aa;
                lanes.b[l] = b * bb + a * ba;
                lanes.rise[l] *= script.fade;
            }
            lanes.add_inputs(block, &script.inputs[next..point.aged_end], None, script.loses_none);
            let mut any = false;
            for l in 0..LANES {
                any |= may_matter(lanes, l, point.t, floor);
            }
            if any || k % LOOK == LOOK - 1 {
                for (l, perhaps) in perhaps.iter_mut().enumerate() {
                    *perhaps = may_matter(lanes, l, point.t, floor);
                }
                return Some(k);
            }
            lanes.add_inputs(block, &script.inputs[point.aged_end..point.arriving_end], Some(point.t), script.loses_none);
            next = point.arriving_end;
        }
        None
    }
}
