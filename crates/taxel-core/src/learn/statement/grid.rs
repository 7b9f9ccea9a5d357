//! The rows of a learning problem: what the potential is made of at the targets and at every silent grid point.
//!
//! A *row* holds the coefficients of the weights in `U(w, t)` at one time of one pattern. After a spike some inputs are
//! lost (`after_spike`); as the spikes of a learning problem are its targets, the potential stays linear in the weights.
//! Silent rows are never stored: one sweep over the grid gives the potential on all of them (the kernel needs two numbers
//! a pattern), one sweep backwards gives a weighted sum of all of them.

use crate::neuron::{AfterSpike, FirstThreshold, Neuron, Shape, State, Step};
use crate::vectors::{add, dot};
use crate::{Result, SpikeTrains, Stop};

/// Rounding of a grid point on the very edge of a refractory time, ms.
const EDGE: f64 = 1e-9;

/// A row that is kept whole: a target's, or the one behind it that B lifts.
#[derive(Debug, Clone)]
pub(crate) struct TargetRow {
    pub(crate) pattern: usize,
    pub(crate) target: usize,
    /// When, ms.
    pub(crate) t: f64,
    /// The threshold at the target, mV.
    pub(crate) threshold: f64,
    /// Coefficients at the target, by train.
    pub(crate) at: Vec<f64>,
    /// Coefficients `delta_t` later, as though the neuron had not fired at the target.
    pub(crate) behind: Vec<f64>,
}

/// An input as the grid sees it: what it adds to the state at the first grid point not before it.
#[derive(Debug, Clone, Copy)]
struct GridInput {
    point: u32,
    train: u32,
    a: f64,
    b: f64,
}

/// A grid point at which the state of the kernels jumps, and what makes it jump.
#[derive(Debug, Clone, Copy)]
struct Station {
    point: u32,
    /// Everything before is lost here (`Reset`), ahead of the inputs.
    reset: bool,
    /// Where the inputs that come here end among all of the sheet; they begin where those of the station before end.
    inputs: u32,
}

/// The silent rows of one pattern.
#[derive(Debug, Clone)]
struct Sheet {
    inputs: Vec<GridInput>,
    /// Ascending by point.
    stations: Vec<Station>,
    /// The number of its first row among all.
    first: usize,
    points: usize,
    /// How many targets its pattern has.
    targets: usize,
}

/// All silent rows: one a grid point that lies neither at a target nor in the refractory time behind it.
#[derive(Debug, Clone)]
pub(crate) struct SilentRows {
    sheets: Vec<Sheet>,
    trains: usize,
    shape: Shape,
    step_ms: f64,
    /// What 0, 1, 2 ... grid steps do: so a run of points without an input needs no recursion.
    steps: Steps,
    /// Some rows of a grid written out, one after the other, in place of sheets.
    written: Option<Vec<f64>>,
    /// What the potential must not exceed, mV; infinite where nothing is asked.
    pub(crate) limit: Vec<f64>,
    /// The rows (by number) of each target's pattern that lie in the `near_ms` before it.
    pub(crate) before_targets: Vec<std::ops::Range<usize>>,
}

/// The entries of `Step` for so many grid steps.
#[derive(Debug, Clone)]
struct Steps {
    aa: [f64; RUN + 1],
    ba: [f64; RUN + 1],
    bb: [f64; RUN + 1],
}

/// The longest run of points that is done in one go.
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

    fn of(&self, k: usize) -> Step {
        Step { aa: self.aa[k], ba: self.ba[k], bb: self.bb[k] }
    }
}

/// What a pattern's silent rows are laid out with.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Layout<'a> {
    pub(crate) neuron: &'a Neuron,
    pub(crate) horizon: Option<f64>,
    pub(crate) margin: f64,
    pub(crate) near_ms: f64,
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

pub(crate) fn target_rows(
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
    pub(crate) fn new(
        layout: Layout<'_>,
        patterns: &[SpikeTrains],
        targets: &[Vec<f64>],
        stop: Stop<'_>,
    ) -> Result<Self> {
        let (shape, step_ms) = (layout.neuron.shape(), layout.neuron.step_ms);
        let mut rows = Self {
            sheets: vec![],
            trains: patterns[0].len(),
            shape,
            step_ms,
            steps: Steps::new(shape, step_ms),
            written: None,
            limit: vec![],
            before_targets: vec![],
        };
        for (pattern, targets) in patterns.iter().zip(targets) {
            stop.check()?;
            rows.push(layout, pattern, targets, stop)?;
        }
        Ok(rows)
    }

    /// Adds the rows of one more pattern; where the caller stops it, they are as before.
    pub(crate) fn push(
        &mut self,
        layout: Layout<'_>,
        pattern: &SpikeTrains,
        targets: &[f64],
        stop: Stop<'_>,
    ) -> Result<()> {
        let Layout { neuron, horizon, margin, near_ms } = layout;
        let step = self.step_ms;
        let time = |point: f64| pattern.start + point * step;
        let last = targets.last().map_or(pattern.stop, |t| pattern.stop.max(t + neuron.tau));
        let end = horizon.unwrap_or(last);
        let points = (((end - pattern.start) / step + EDGE).floor() + 1.0).max(0.0) as usize;
        let first = self.limit.len();
        let (mut next, mut limit) = (0, vec![]);
        for k in 0..points {
            if k % 4096 == 0 {
                stop.check()?;
            }
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
        let mut inputs = Vec::with_capacity(pattern.times.len());
        for (k, spike) in pattern.by_time().iter().enumerate() {
            if k % 4096 == 0 {
                stop.check()?;
            }
            let point = ((spike.t - pattern.start) / step).ceil();
            // An input on a point itself is felt behind it; where its kernel begins above 0, from the next point on.
            let late = time(point) - spike.t <= 0.0 && self.shape.input().b != 0.0;
            let felt = if late { point + 1.0 } else { point };
            if felt < points as f64 && !lost(neuron, targets, spike.t, time(felt)) {
                let State { a, b } = self.shape.after(self.shape.input(), (time(felt) - spike.t).max(0.0));
                inputs.push(GridInput { point: felt as u32, train: spike.train, a, b });
            }
        }
        inputs.sort_by_key(|i| i.point);
        let resets = match neuron.after_spike {
            AfterSpike::Reset => targets.iter().map(|&t| point_after(t)).filter(|&r| (r as usize) < points).collect(),
            AfterSpike::Keep | AfterSpike::Ignore => vec![],
        };
        let stations = stations(&inputs, &resets);
        for &t in targets {
            let after = (point_after(t) as usize).min(points);
            let near = (near_ms / step).ceil() as usize;
            self.before_targets.push(first + after.saturating_sub(near + 1)..first + after);
        }
        self.limit.append(&mut limit);
        self.sheets.push(Sheet { inputs, stations, first, points, targets: targets.len() });
        Ok(())
    }

    /// Takes the rows of the first pattern away; the others are numbered anew from 0.
    pub(crate) fn drop_first(&mut self) {
        let gone = self.sheets.remove(0);
        self.limit.drain(..gone.points);
        self.before_targets.drain(..gone.targets);
        self.sheets.iter_mut().for_each(|sheet| sheet.first -= gone.points);
        for rows in &mut self.before_targets {
            *rows = rows.start - gone.points..rows.end - gone.points;
        }
    }

    /// The named rows (ascending) alone, written out.
    pub(crate) fn written_out(&self, rows: &[usize]) -> Self {
        Self {
            sheets: vec![],
            steps: self.steps.clone(),
            written: Some(self.coefficients(rows)),
            limit: rows.iter().map(|&row| self.limit[row]).collect(),
            before_targets: vec![],
            ..*self
        }
    }

    /// How many rows, those at which nothing is asked included.
    pub(crate) fn len(&self) -> usize {
        self.limit.len()
    }

    /// What `points` grid steps do.
    fn step(&self, points: u32) -> Step {
        if points as usize <= RUN {
            self.steps.of(points as usize)
        } else {
            self.shape.step(f64::from(points) * self.step_ms)
        }
    }

    /// The potential on every row, mV.
    pub(crate) fn potential(&self, weights: &[f64], out: &mut Vec<f64>) {
        out.clear();
        out.resize(self.len(), 0.0);
        if weights.iter().all(|&w| w == 0.0) {
            return;
        }
        if let Some(written) = &self.written {
            let rows = out.iter_mut().zip(written.chunks_exact(self.trains));
            return rows.for_each(|(out, row)| *out = dot(row, weights));
        }
        for sheet in &self.sheets {
            let rows = &mut out[sheet.first..sheet.first + sheet.points];
            let mut state = State::default();
            let (mut input, mut at) = (0, 0);
            for (k, station) in sheet.stations.iter().enumerate() {
                state = if station.reset { State::default() } else { self.step(station.point - at).apply(state) };
                at = station.point;
                for i in &sheet.inputs[input..station.inputs as usize] {
                    let w = weights[i.train as usize];
                    state.a += w * i.a;
                    state.b += w * i.b;
                }
                input = station.inputs as usize;
                let end = sheet.stations.get(k + 1).map_or(sheet.points, |next| next.point as usize);
                self.run(state, &mut rows[at as usize..end]);
            }
        }
    }

    /// The potential on a run of rows without an input, from the state at the first of them.
    fn run(&self, mut state: State, rows: &mut [f64]) {
        for rows in rows.chunks_mut(RUN) {
            let steps = self.steps.ba.iter().zip(&self.steps.bb);
            rows.iter_mut().zip(steps).for_each(|(row, (ba, bb))| *row = state.a * ba + state.b * bb);
            state = self.steps.of(rows.len()).apply(state);
        }
    }

    /// Adds the sum of all rows, each times its factor, to `sum` (one entry a train): the adjoint of `potential`.
    pub(crate) fn add_sum(&self, factors: &[f64], sum: &mut [f64]) {
        if let Some(written) = &self.written {
            let rows = factors.iter().zip(written.chunks_exact(self.trains));
            return rows.for_each(|(&factor, row)| add(sum, factor, row));
        }
        for sheet in &self.sheets {
            let factors = &factors[sheet.first..sheet.first + sheet.points];
            // How much the rows from here on hear of the state here.
            let mut heard = State::default();
            let mut end = sheet.points;
            for (k, station) in sheet.stations.iter().enumerate().rev() {
                let at = station.point as usize;
                heard = self.run_back(heard, &factors[at..end]);
                let from = if k == 0 { 0 } else { sheet.stations[k - 1].inputs as usize };
                for i in &sheet.inputs[from..station.inputs as usize] {
                    sum[i.train as usize] += heard.a * i.a + heard.b * i.b;
                }
                if station.reset {
                    heard = State::default();
                }
                end = at;
            }
        }
    }

    /// How much a run of rows, and what comes behind it, hear of the state at the first of them.
    fn run_back(&self, mut heard: State, factors: &[f64]) -> State {
        for factors in factors.rchunks(RUN) {
            let step = self.steps.of(factors.len());
            let State { a, b } = heard;
            heard = State { a: a * step.aa + b * step.ba, b: b * step.bb };
            if factors.iter().any(|&f| f != 0.0) {
                heard.a += factors.iter().zip(&self.steps.ba).map(|(f, ba)| f * ba).sum::<f64>();
                heard.b += factors.iter().zip(&self.steps.bb).map(|(f, bb)| f * bb).sum::<f64>();
            }
        }
        heard
    }

    /// The coefficients of the named rows (ascending), row after row.
    pub(crate) fn coefficients(&self, rows: &[usize]) -> Vec<f64> {
        let n = self.trains;
        if let Some(written) = &self.written {
            return rows.iter().flat_map(|row| &written[row * n..(row + 1) * n]).copied().collect();
        }
        let mut out = vec![0.0; rows.len() * n];
        let mut place = 0;
        for sheet in &self.sheets {
            if place == rows.len() || rows[place] >= sheet.first + sheet.points {
                continue;
            }
            let (mut a, mut b) = (vec![0.0; n], vec![0.0; n]);
            let (mut station, mut input, mut at) = (0, 0, 0_u32);
            while place < rows.len() && rows[place] < sheet.first + sheet.points {
                let point = (rows[place] - sheet.first) as u32;
                let next = station + sheet.stations[station..].partition_point(|s| s.point <= point);
                let passed = &sheet.stations[station..next];
                if let Some(reset) = passed.iter().rposition(|s| s.reset) {
                    a.fill(0.0);
                    b.fill(0.0);
                    let before = station + reset;
                    input = if before == 0 { 0 } else { sheet.stations[before - 1].inputs as usize };
                } else if point > at {
                    let step = self.step(point - at);
                    for (a, b) in a.iter_mut().zip(&mut b) {
                        *b = *b * step.bb + *a * step.ba;
                        *a *= step.aa;
                    }
                }
                let end = passed.last().map_or(input, |s| s.inputs as usize);
                for i in &sheet.inputs[input..end] {
                    let now = self.step(point - i.point).apply(State { a: i.a, b: i.b });
                    a[i.train as usize] += now.a;
                    b[i.train as usize] += now.b;
                }
                (station, input, at) = (next, end, point);
                out[place * n..(place + 1) * n].copy_from_slice(&b);
                place += 1;
            }
        }
        out
    }
}

/// Where the state jumps, by inputs and resets, both ascending.
fn stations(inputs: &[GridInput], resets: &[u32]) -> Vec<Station> {
    let mut found = Vec::new();
    let (mut input, mut reset) = (0, 0);
    while input < inputs.len() || reset < resets.len() {
        let point = inputs.get(input).map(|i| i.point).into_iter().chain(resets.get(reset).copied()).min();
        let Some(point) = point else { break };
        let here = reset < resets.len() && resets[reset] == point;
        while reset < resets.len() && resets[reset] == point {
            reset += 1;
        }
        while input < inputs.len() && inputs[input].point == point {
            input += 1;
        }
        found.push(Station { point, reset: here, inputs: input as u32 });
    }
    found
}
