//! A plain rule at work: from changes of quantities to decisions.

use std::collections::VecDeque;

use crate::Spike;
use crate::detect::FrameClock;
use crate::spikes::{ms, us};

/// How a rule decides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Limits {
    /// A load begins in frames in which its quantity is at least this, above the rest if that follows.
    pub begin: f64,
    /// It ends in frames in which the quantity is below this; if the rest follows, below this part of the largest value
    /// since the begin, both above the rest.
    pub end: f64,
    /// The time of a begin is when the quantity last came to the first of these, as it comes to `begin`; that of an end
    /// when it last came to the second one, likewise.
    pub dated: [f64; 2],
    /// Whether the rest of the quantity, which is 0 at first, follows it: down while the sensor is not loaded, and to where
    /// it is as a load ends.
    pub follows: bool,
    /// The number of such frames in a row.
    pub frames: i64,
    /// The train with the quantity of which a load is made.
    pub touch_train: u32,
    /// Train 0 is compared with this threshold, where the rule decides at an age.
    pub threshold: f64,
    /// When the rule decides.
    pub when: When,
}

/// When a rule decides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum When {
    /// At the begin and at the end of a load, which it reports.
    Edges,
    /// At this age of a load, us.
    AtAge(i64),
    /// When a load ends, by how long it lasted, ms.
    AtEnd,
}

impl Limits {
    /// The area from which on a sensor is touched, where a rule decides at an age: the smallest that there is, of channels,
    /// which count alone. A loaded taxel of a grid counts only beside another one.
    const TOUCHED: f64 = 1.0;

    /// Decides at an age of each touch, which the area on `touch_train` begins in one frame.
    pub(super) fn at_age(touch_train: u32, threshold: f64, age_ms: f64) -> Self {
        let when = When::AtAge(us(age_ms).round() as i64);
        let edge = Self::TOUCHED;
        let (dated, follows) = ([edge; 2], false);
        Self { begin: edge, end: edge, dated, follows, frames: 1, touch_train, threshold, when }
    }

    /// Reports the begin and the end of each load.
    pub(super) fn at_edges(edges: &EdgeNumbers) -> Self {
        let EdgeNumbers { threshold, release, frames, dated_at, of_largest } = *edges;
        let end = if of_largest { release } else { release * threshold };
        Self {
            begin: threshold,
            end,
            dated: dated_at.map_or([threshold, end], |at| [at; 2]),
            follows: of_largest,
            frames: i64::from(frames),
            touch_train: 0,
            threshold,
            when: When::Edges,
        }
    }

    /// Decides when each touch ends, which the area on train 0 begins, by its duration, ms.
    pub(super) fn at_end(threshold: f64) -> Self {
        Self { when: When::AtEnd, ..Self::at_age(0, threshold, 0.0) }
    }

    /// Which limits a quantity of this value has passed, of a rest that does not follow.
    pub(super) fn passed_limits(&self, load: f64) -> [bool; 4] {
        let [dated_begin, dated_end] = self.dated;
        [load >= self.begin, load < self.end, load >= dated_begin, load < dated_end]
    }
}

/// The numbers of a rule that reports the begin and the end of each load, as of [`PlainRule`](crate::detect::PlainRule).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeNumbers {
    /// The threshold at which a load begins.
    pub threshold: f64,
    /// The part below which it ends, of the threshold or of the largest value.
    pub release: f64,
    /// The number of frames in a row.
    pub frames: u32,
    /// The value at which begins and ends are dated.
    pub dated_at: Option<f64>,
    /// Whether a load ends below a part of its largest value, and the rest follows.
    pub of_largest: bool,
}

/// What a rule found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Decision {
    /// Which of the rule's two labels: 0 for the begin, or below the threshold; 1 for the end, or above.
    pub label: usize,
    /// The begin or end of the load, us.
    pub t: i64,
    /// The end of the last frame on which the decision rests, us.
    pub known: i64,
    /// Whether a quantity changed in these frames together with a repair.
    pub repaired: bool,
    /// The quantity of train 0 when the rule decided; the duration, ms, where it decided at the end.
    pub value: f64,
}

/// Frames in a row, all so far, in which the load begins or ends.
#[derive(Debug, Clone, Copy)]
struct LoadRun {
    /// The number of the first of these frames.
    first: i64,
    /// The time at which the quantity passed the limit in it, us.
    t: i64,
    repaired: bool,
}

/// A load that waits for the age at which it is decided.
#[derive(Debug, Clone, Copy)]
struct WaitingLoad {
    t: i64,
    at: i64,
    repaired: bool,
}

/// The state of a rule.
#[derive(Clone)]
pub(super) struct RunningRule {
    limits: Limits,
    /// Whether the sensor is loaded.
    loaded: bool,
    /// The quantity of which a load is made, after its last change.
    load: f64,
    /// The number of the frame of that change.
    changed: i64,
    /// The time at which the quantity last passed the limit by which the next change of the state is dated, us.
    passed: i64,
    /// The rest that the quantity has, if it follows; else 0.
    rest: f64,
    /// The largest value of the quantity since the load began.
    largest: f64,
    /// Whether a quantity changed together with a repair in a frame that is not complete.
    repaired: bool,
    run: Option<LoadRun>,
    /// The quantity that is compared with the threshold.
    quantity: f64,
    waiting: VecDeque<WaitingLoad>,
    /// When the load began that lasts, us, and whether that may rest on a repair.
    begun: (i64, bool),
}

impl RunningRule {
    /// A rule before any input: not loaded, all quantities 0.
    pub(super) fn new(limits: Limits) -> Self {
        Self {
            limits,
            loaded: false,
            load: 0.0,
            changed: i64::MIN,
            passed: 0,
            rest: 0.0,
            largest: 0.0,
            repaired: false,
            run: None,
            quantity: 0.0,
            waiting: VecDeque::new(),
            begun: (0, false),
        }
    }

    /// Processes a change of a quantity; changes come in order of time.
    pub(super) fn change(&mut self, change: Spike, repaired: bool, clock: &FrameClock, out: &mut Vec<Decision>) {
        let t = us(change.t).round() as i64;
        self.advance(t, clock, out);
        if change.train == self.limits.touch_train {
            let before = self.passes(self.limits.dated);
            (self.load, self.changed) = (f64::from(change.value), clock.number_of(t));
            self.largest = self.largest.max(self.load);
            if self.limits.follows && !self.loaded {
                self.rest = self.rest.min(self.load);
            }
            if self.passes(self.limits.dated) && !before {
                self.passed = t;
            }
        }
        if change.train == 0 {
            self.quantity = f64::from(change.value);
        }
        if repaired {
            self.repaired = true;
            self.waiting.iter_mut().for_each(|due| due.repaired = true);
        }
    }

    /// Decides on all frames that are complete, because no change before `t` us follows.
    pub(super) fn advance(&mut self, t: i64, clock: &FrameClock, out: &mut Vec<Decision>) {
        self.close_before(clock.open_at(t), clock, out);
        while let Some(due) = self.waiting.front().filter(|due| clock.is_over(due.at, t)) {
            out.push(Decision {
                label: usize::from(self.quantity >= self.limits.threshold),
                t: due.t,
                known: clock.end_of(ms(due.at)),
                repaired: due.repaired,
                value: self.quantity,
            });
            self.waiting.pop_front();
        }
    }

    /// Counts the frames before number `open`, which are complete.
    fn close_before(&mut self, open: i64, clock: &FrameClock, out: &mut Vec<Decision>) {
        if self.changed >= open {
            return;
        }
        let repaired = std::mem::take(&mut self.repaired);
        if !self.passes([self.limits.begin, self.limits.end]) {
            self.run = None;
            return;
        }
        // Frames before that of the last change were counted when it came.
        let run = self.run.get_or_insert(LoadRun { first: self.changed, t: self.passed, repaired: false });
        run.repaired |= repaired;
        let LoadRun { first, t, repaired } = *run;
        if open - first < self.limits.frames {
            return;
        }
        self.run = None;
        self.loaded = !self.loaded;
        self.largest = self.load;
        if self.limits.follows && !self.loaded {
            self.rest = self.load;
        }
        let known = clock.end_of_number(first + self.limits.frames - 1);
        let (begun, repaired_begin) = self.begun;
        if self.loaded {
            self.begun = (t, repaired);
        }
        match self.limits.when {
            When::Edges => {
                out.push(Decision { label: usize::from(!self.loaded), t, known, repaired, value: self.quantity })
            }
            When::AtAge(age) if self.loaded => self.waiting.push_back(WaitingLoad { t, at: t + age, repaired }),
            When::AtEnd if !self.loaded => {
                let value = ms(t - begun);
                let label = usize::from(value >= self.limits.threshold);
                out.push(Decision { label, t: begun, known, repaired: repaired || repaired_begin, value });
            }
            When::AtAge(_) | When::AtEnd => {}
        }
    }

    /// Whether the quantity has come to the begin of the next load, or to the end of the present one.
    fn passes(&self, [begin, end]: [f64; 2]) -> bool {
        match (self.loaded, self.limits.follows) {
            (false, _) => self.load >= self.rest + begin,
            (true, false) => self.load < end,
            (true, true) => self.load < self.rest + end * (self.largest - self.rest),
        }
    }
}
