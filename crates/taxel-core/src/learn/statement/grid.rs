//! Silence on the grid (6.9b): the potential at every grid point, and its limit there.
//!
//! Silent rows are never stored: one sweep over the grid computes the potential at all points (the kernel needs two
//! numbers per pattern), and one backward sweep computes a weighted sum of all rows. CONE-X searches for points at
//! which silence is violated, CONE-R sums the violations.

use std::iter;
use std::ops::Range;

use super::peak::{SilencePeak, exceeds};
use super::rows::{Example, Statement, is_lost};
use crate::neuron::{AfterSpike, Grid, GridTime, KernelSum, Shape, Step};
use crate::{Result, Spike, Stop};

/// The contribution of an input to the state at the first grid point at or after it.
#[derive(Debug, Clone, Copy)]
struct GridInput {
    point: u32,
    train: u32,
    a: f64,
    b: f64,
}

/// A grid point at which the state of the kernels jumps: inputs, or a reset.
#[derive(Debug, Clone, Copy)]
struct Jump {
    point: u32,
    /// Whether all earlier inputs are lost here (`Reset`), before the inputs of this point are added.
    reset: bool,
    /// The inputs of this jump end before this index; they begin where those of the previous jump end.
    inputs: u32,
}

/// Consecutive grid points of one pattern, from an input on until all have decayed.
#[derive(Debug, Clone)]
struct Lane {
    pattern: usize,
    /// Their points count from the lane's first.
    inputs: Vec<GridInput>,
    /// The jumps, ascending by point.
    jumps: Vec<Jump>,
    /// The number of the lane's first row among all rows.
    first: usize,
    points: usize,
    /// The number of the lane's first point on the pattern's grid.
    begin: usize,
    grid: Grid,
}

impl Lane {
    /// The time of a point of the lane, ms.
    fn time(&self, point: usize) -> f64 {
        self.grid.time((self.begin + point) as f64)
    }
}

/// The time constants after which an input is far below the rounding of any potential.
const DECAYED: f64 = 64.0;

/// All silent rows: one for each grid point that is neither a target nor in the refractory time after one, and at which
/// some input has not decayed.
#[derive(Debug, Clone)]
pub(crate) struct SilentRows {
    lanes: Vec<Lane>,
    trains: usize,
    shape: Shape,
    step_ms: f64,
    /// The decay over 0, 1, 2 ... grid steps, so that points between inputs are computed without a recursion.
    steps: Steps,
    /// The limit of the potential, mV; infinite where no silence is required.
    pub(crate) limit: Vec<f64>,
}

/// The entries of `Step` for each number of grid steps from 0 to `RUN`.
#[derive(Debug, Clone)]
struct Steps {
    aa: [f64; RUN + 1],
    ba: [f64; RUN + 1],
    bb: [f64; RUN + 1],
}

/// The largest number of points that are computed without a recursion.
const RUN: usize = 128;

impl Steps {
    fn new(shape: Shape, step_ms: f64) -> Self {
        let step = |k: usize| shape.step(k as f64 * step_ms);
        Self {
            aa: std::array::from_fn(|k| step(k).aa),
            ba: std::array::from_fn(|k| step(k).ba),
            bb: std::array::from_fn(|k| step(k).bb),
        }
    }

    fn step(&self, k: usize) -> Step {
        Step { aa: self.aa[k], ba: self.ba[k], bb: self.bb[k] }
    }
}

impl SilentRows {
    /// No rows yet.
    pub(crate) fn none(statement: &Statement) -> Self {
        let (shape, step_ms) = (statement.shape, statement.neuron.step_ms);
        let steps = Steps::new(shape, step_ms);
        Self { lanes: vec![], trains: statement.trains, shape, step_ms, steps, limit: vec![] }
    }

    /// Computes the grid rows of each pattern of a statement, from its start to the end of its silence.
    pub(crate) fn new(statement: &Statement, stop: Stop<'_>) -> Result<Self> {
        let mut rows = Self::none(statement);
        for pattern in 0..statement.examples.len() {
            stop.check()?;
            rows.push(statement, pattern, stop)?;
        }
        Ok(rows)
    }

    /// Adds the rows of one pattern; if the caller stops it, the rows stay unchanged.
    pub(crate) fn push(&mut self, statement: &Statement, pattern: usize, stop: Stop<'_>) -> Result<()> {
        let (neuron, example) = (&statement.neuron, &statement.examples[pattern]);
        let Example { start, end, targets, .. } = example;
        let grid = Grid::new(*start, self.step_ms);
        let points = neuron.points(*start, *end) as usize;
        let mut inputs = Vec::with_capacity(example.inputs.len());
        for (k, &Spike { t, train, value }) in example.inputs.iter().enumerate() {
            if k % 4096 == 0 {
                stop.check()?;
            }
            let time = grid.locate(t);
            // An input exactly at a point acts after it; with a kernel that jumps at 0, from the next point on.
            let acts_at = if self.shape.input().b == 0.0 { time.from() } else { time.behind() };
            if acts_at < points as f64 && !is_lost(neuron, targets, t, grid.time(acts_at)) {
                let age = grid.between(time, GridTime::at(acts_at)).max(0.0);
                let mut unit = KernelSum::default();
                self.shape.add(&mut unit, 1.0, f64::from(value), age);
                inputs.push((acts_at as usize, GridInput { point: 0, train, a: unit.a, b: unit.b }));
            }
        }
        inputs.sort_by_key(|&(point, _)| point);
        // Where the threshold is not above 0, each point is a row.
        let spans = if neuron.theta_0 <= statement.margin.height {
            iter::once(0..points).collect()
        } else {
            undecayed(&inputs, (DECAYED * neuron.tau / self.step_ms).ceil() as usize, points)
        };
        neuron.check_rows((self.limit.len() + spans.iter().map(Range::len).sum::<usize>()) as f64)?;
        let resets: Vec<usize> = match neuron.after_spike {
            AfterSpike::Reset => {
                let behind = targets.iter().map(|&t| grid.locate(t).behind());
                behind.filter(|&point| point < points as f64).map(|point| point as usize).collect()
            }
            AfterSpike::Keep | AfterSpike::Ignore => vec![],
        };
        let (mut lanes, mut limit, mut next) = (vec![], vec![], 0);
        for Range { start: begin, end } in spans {
            let first = self.limit.len() + limit.len();
            for k in begin..end {
                if k % 4096 == 0 {
                    stop.check()?;
                }
                let t = grid.time(k as f64);
                while targets.get(next).is_some_and(|&target| target < t) {
                    next += 1;
                }
                let fired = next.checked_sub(1).map(|k| targets[k]);
                limit.push(
                    if example.in_window(t) && statement.is_silent_between(fired, t, targets.get(next).copied()) {
                        neuron.theta_0 + statement.rise(example, fired, t) - statement.margin.height
                    } else {
                        f64::INFINITY
                    },
                );
            }
            let of_lane = {
                let before = |end: usize| inputs.partition_point(|&(point, _)| point < end);
                &inputs[before(begin)..before(end)]
            };
            let number = |point: usize| (point - begin) as u32;
            let inputs: Vec<_> =
                of_lane.iter().map(|&(point, input)| GridInput { point: number(point), ..input }).collect();
            let resets = resets.iter().filter(|&point| (begin..end).contains(point));
            let resets: Vec<u32> = resets.map(|&point| number(point)).collect();
            let jumps = jumps(&inputs, &resets);
            lanes.push(Lane { pattern, inputs, jumps, first, points: end - begin, begin, grid });
        }
        self.lanes.append(&mut lanes);
        self.limit.append(&mut limit);
        Ok(())
    }

    /// The pattern of a row, and its time, ms.
    pub(crate) fn name(&self, row: usize) -> (usize, f64) {
        let lane = &self.lanes[self.lanes.partition_point(|lane| lane.first <= row) - 1];
        (lane.pattern, lane.time(row - lane.first))
    }

    /// The number of rows of the first pattern, including points without a requirement.
    pub(crate) fn rows_of_first(&self) -> usize {
        self.lanes.iter().take_while(|lane| lane.pattern == 0).map(|lane| lane.points).sum()
    }

    /// Removes the rows of the first pattern; the others are renumbered from 0.
    pub(crate) fn drop_first(&mut self) {
        let gone = self.rows_of_first();
        self.limit.drain(..gone);
        self.lanes.retain(|lane| lane.pattern > 0);
        for lane in &mut self.lanes {
            lane.first -= gone;
            lane.pattern -= 1;
        }
    }

    /// These rows for inputs whose values have no sign.
    pub(crate) fn unsigned_rows(&self) -> Self {
        let mut rows = self.clone();
        for input in rows.lanes.iter_mut().flat_map(|lane| &mut lane.inputs) {
            (input.a, input.b) = (input.a.abs(), input.b.abs());
        }
        rows
    }

    /// The number of rows, including points without a requirement.
    pub(crate) fn len(&self) -> usize {
        self.limit.len()
    }

    /// The decay over `points` grid steps.
    fn step(&self, points: u32) -> Step {
        if points as usize <= RUN {
            self.steps.step(points as usize)
        } else {
            self.shape.step(f64::from(points) * self.step_ms)
        }
    }

    /// Computes the potential at every row, mV; `out` has one entry per row.
    pub(crate) fn potential(&self, weights: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        if weights.iter().all(|&w| w == 0.0) {
            return;
        }
        for lane in &self.lanes {
            self.potential_of(lane, weights, &mut out[lane.first..lane.first + lane.points]);
        }
    }

    /// Computes the potential at the rows of one pattern.
    fn potential_of(&self, lane: &Lane, weights: &[f64], rows: &mut [f64]) {
        let mut state = KernelSum::default();
        let (mut input, mut at) = (0, 0);
        for (k, jump) in lane.jumps.iter().enumerate() {
            state = if jump.reset { KernelSum::default() } else { self.step(jump.point - at).apply(state) };
            at = jump.point;
            for i in &lane.inputs[input..jump.inputs as usize] {
                let w = weights[i.train as usize];
                state.a += w * i.a;
                state.b += w * i.b;
            }
            input = jump.inputs as usize;
            let end = lane.jumps.get(k + 1).map_or(lane.points, |next| next.point as usize);
            match &mut rows[at as usize..end] {
                [row] => *row = state.b,
                rows => self.run(state, rows),
            }
        }
    }

    /// Finds the worst point of each interval in which the potential exceeds its limit by more than `tolerance`.
    pub(crate) fn broken(&self, weights: &[f64], tolerance: f64) -> Vec<SilencePeak> {
        let (mut found, mut potential) = (vec![], vec![]);
        for lane in &self.lanes {
            potential.clear();
            potential.resize(lane.points, 0.0);
            self.potential_of(lane, weights, &mut potential);
            let limits = &self.limit[lane.first..lane.first + lane.points];
            let mut worst: Option<SilencePeak> = None;
            for (k, (u, limit)) in potential.iter().zip(limits).enumerate() {
                let excess = u - limit;
                if excess <= tolerance {
                    found.extend(worst.take());
                } else if worst.is_none_or(|w| exceeds(excess, w.excess)) {
                    worst = Some(SilencePeak { pattern: lane.pattern, t: lane.time(k), excess });
                }
            }
            found.extend(worst);
        }
        found
    }

    /// Computes the potential at consecutive rows without inputs, from the state at the first of them.
    fn run(&self, mut state: KernelSum, rows: &mut [f64]) {
        for rows in rows.chunks_mut(RUN) {
            let steps = self.steps.ba.iter().zip(&self.steps.bb);
            rows.iter_mut().zip(steps).for_each(|(row, (ba, bb))| *row = state.a * ba + state.b * bb);
            state = self.steps.step(rows.len()).apply(state);
        }
    }

    /// Adds the sum of all rows, each times its factor, to `sum` (one entry per train); the adjoint of `potential`.
    pub(crate) fn add_sum(&self, factors: &[f64], sum: &mut [f64]) {
        for lane in &self.lanes {
            let factors = &factors[lane.first..lane.first + lane.points];
            // The derivative of the factors' sum over all rows from here on with respect to the state here.
            let mut derivative = KernelSum::default();
            let mut end = lane.points;
            for (k, jump) in lane.jumps.iter().enumerate().rev() {
                let at = jump.point as usize;
                derivative = self.run_back(derivative, &factors[at..end]);
                let from = if k == 0 { 0 } else { lane.jumps[k - 1].inputs as usize };
                for i in &lane.inputs[from..jump.inputs as usize] {
                    sum[i.train as usize] += derivative.a * i.a + derivative.b * i.b;
                }
                if jump.reset {
                    derivative = KernelSum::default();
                }
                end = at;
            }
        }
    }

    /// That derivative at the first of consecutive rows without inputs, given the derivative after the last of them.
    fn run_back(&self, mut derivative: KernelSum, factors: &[f64]) -> KernelSum {
        for factors in factors.rchunks(RUN) {
            let step = self.steps.step(factors.len());
            let KernelSum { a, b } = derivative;
            derivative = KernelSum { a: a * step.aa + b * step.ba, b: b * step.bb };
            if factors.iter().any(|&f| f != 0.0) {
                derivative.a += factors.iter().zip(&self.steps.ba).map(|(f, ba)| f * ba).sum::<f64>();
                derivative.b += factors.iter().zip(&self.steps.bb).map(|(f, bb)| f * bb).sum::<f64>();
            }
        }
        derivative
    }

    /// The coefficients of the given rows (ascending), row after row.
    pub(crate) fn coefficients(&self, rows: &[usize]) -> Vec<f64> {
        let n = self.trains;
        let mut out = vec![0.0; rows.len() * n];
        let mut index = 0;
        for lane in &self.lanes {
            if index == rows.len() || rows[index] >= lane.first + lane.points {
                continue;
            }
            let (mut a, mut b) = (vec![0.0; n], vec![0.0; n]);
            let (mut jump, mut input, mut at) = (0, 0, 0_u32);
            while index < rows.len() && rows[index] < lane.first + lane.points {
                let point = (rows[index] - lane.first) as u32;
                let next = jump + lane.jumps[jump..].partition_point(|s| s.point <= point);
                let passed = &lane.jumps[jump..next];
                if let Some(reset) = passed.iter().rposition(|s| s.reset) {
                    a.fill(0.0);
                    b.fill(0.0);
                    let before = jump + reset;
                    input = if before == 0 { 0 } else { lane.jumps[before - 1].inputs as usize };
                } else if point > at {
                    let step = self.step(point - at);
                    for (a, b) in a.iter_mut().zip(&mut b) {
                        *b = *b * step.bb + *a * step.ba;
                        *a *= step.aa;
                    }
                }
                let end = passed.last().map_or(input, |s| s.inputs as usize);
                for i in &lane.inputs[input..end] {
                    let now = self.step(point - i.point).apply(KernelSum { a: i.a, b: i.b });
                    a[i.train as usize] += now.a;
                    b[i.train as usize] += now.b;
                }
                (jump, input, at) = (next, end, point);
                out[index * n..(index + 1) * n].copy_from_slice(&b);
                index += 1;
            }
        }
        out
    }
}

/// The points, of `points`, that are less than `reach` points after some input; the inputs ascend.
fn undecayed(inputs: &[(usize, GridInput)], reach: usize, points: usize) -> Vec<Range<usize>> {
    let mut spans: Vec<Range<usize>> = vec![];
    for &(point, _) in inputs {
        let end = points.min(point.saturating_add(reach));
        match spans.last_mut() {
            Some(last) if point <= last.end => last.end = end,
            _ => spans.push(point..end),
        }
    }
    spans
}

/// The points at which the state jumps, from inputs and resets, both ascending.
fn jumps(inputs: &[GridInput], resets: &[u32]) -> Vec<Jump> {
    let mut found = Vec::new();
    let (mut input, mut reset) = (0, 0);
    while input < inputs.len() || reset < resets.len() {
        let point = inputs.get(input).map(|i| i.point).into_iter().chain(resets.get(reset).copied()).min();
        let Some(point) = point else { break };
        let resets_here = reset < resets.len() && resets[reset] == point;
        while reset < resets.len() && resets[reset] == point {
            reset += 1;
        }
        while input < inputs.len() && inputs[input].point == point {
            input += 1;
        }
        found.push(Jump { point, reset: resets_here, inputs: input as u32 });
    }
    found
}
