//! A plain rule at work: from changes of quantities to decisions.

use std::collections::VecDeque;

use crate::Spike;
use crate::detect::FrameClock;
use crate::spikes::{ms, us};

/// The numbers of a rule that reports the begin and the end of each load, as of [`PlainRule`](crate::detect::PlainRule).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeNumbers {
    /// The level at which a load begins.
    pub level: f64,
    /// The part of the level below which it ends.
    pub release: f64,
    /// For how long it is below that until it has ended, ms.
    pub quiet_ms: f64,
    /// The part of the level at which begins and ends are dated.
    pub date: Option<f64>,
}

/// How a rule decides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Limits {
    /// A load begins in frames in which its quantity is at least this.
    begin: f64,
    /// It ends in frames in which the quantity is below this.
    end: f64,
    /// The time of a begin is when the quantity last came to the first of these, as it comes to `begin`; that of an end
    /// when it last came to the second one, likewise.
    dated: [f64; 2],
    /// For how long it must be below `end`, us.
    quiet: i64,
    /// The train with the quantity of which a load is made.
    touch_train: u32,
    /// Train 0 is compared with this, where the rule decides at an age.
    level: f64,
    /// When the rule decides.
    when: When,
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
    const TOUCHED: EdgeNumbers = EdgeNumbers { level: 1.0, release: 1.0, quiet_ms: 0.0, date: None };

    /// Reports the begin and the end of each load.
    pub(super) fn at_edges(edges: &EdgeNumbers) -> Self {
        let EdgeNumbers { level, release, quiet_ms, date } = *edges;
        let end = release * level;
        Self {
            begin: level,
            end,
            dated: date.map_or([level, end], |date| [date * level; 2]),
            quiet: us(quiet_ms).round() as i64,
            touch_train: 0,
            level,
            when: When::Edges,
        }
    }

    /// Decides at an age of each touch, which the area on `touch_train` begins in one frame.
    pub(super) fn at_age(touch_train: u32, level: f64, age_ms: f64) -> Self {
        let when = When::AtAge(us(age_ms).round() as i64);
        Self { touch_train, level, when, ..Self::at_edges(&Self::TOUCHED) }
    }

    /// Decides when each touch ends, which the area on train 0 begins, by its duration, ms.
    pub(super) fn at_end(level: f64) -> Self {
        Self { level, when: When::AtEnd, ..Self::at_edges(&Self::TOUCHED) }
    }

    /// The longest time after an input within which a decision on it is due, us.
    pub(super) fn reach(&self) -> i64 {
        self.quiet + if let When::AtAge(age) = self.when { age } else { 0 }
    }

    /// Which limits a quantity of this value has passed.
    pub(super) fn passed_limits(&self, load: f64) -> [bool; 4] {
        let [dated_begin, dated_end] = self.dated;
        [load >= self.begin, load < self.end, load >= dated_begin, load < dated_end]
    }
}

/// What a rule found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Decision {
    /// Which of the rule's two labels: 0 for the begin, or below the level; 1 for the end, or above.
    pub label: usize,
    /// The begin or end of the load, us.
    pub t: i64,
    /// The end of the last frame on which the decision rests, us.
    pub known: i64,
    /// Whether a quantity changed together with a repair in the frames on which it rests.
    pub repaired: bool,
    /// The quantity of train 0 when the rule decided; the duration, ms, where it decided at the end.
    pub value: f64,
}

/// What is decided once the frame that holds at a time is complete.
#[derive(Debug, Clone, Copy)]
struct Waiting {
    /// When the load began, or ended, us.
    t: i64,
    /// The time at which it is decided, us.
    at: i64,
    repaired: bool,
}

/// The state of a rule.
#[derive(Clone)]
pub(super) struct RunningRule {
    limits: Limits,
    /// Whether the sensor is loaded; `None` before the first value, which shows it.
    loaded: Option<bool>,
    /// The quantity of which a load is made, after its last change.
    load: f64,
    /// When the quantity last passed the limit by which the next change of the state is dated, us.
    passed: i64,
    /// The change of the state that has come, as long as the quantity stays there.
    changing: Option<Waiting>,
    /// The quantity that is compared with the level.
    quantity: f64,
    /// Loads that wait for the age at which they are decided.
    waiting: VecDeque<Waiting>,
    /// When the load began that lasts, us, and whether that may rest on a repair.
    begun: (i64, bool),
}

impl RunningRule {
    /// A rule before any input.
    pub(super) fn new(limits: Limits) -> Self {
        Self {
            limits,
            loaded: None,
            load: 0.0,
            passed: 0,
            changing: None,
            quantity: 0.0,
            waiting: VecDeque::new(),
            begun: (0, false),
        }
    }

    /// Processes a change of a quantity; changes come in order of time.
    pub(super) fn change(&mut self, change: Spike, repaired: bool, clock: &FrameClock, out: &mut Vec<Decision>) {
        let t = us(change.t).round() as i64;
        self.advance(t, clock, out);
        let value = f64::from(change.value);
        if change.train == 0 {
            self.quantity = value;
        }
        if change.train == self.limits.touch_train {
            let before = self.passes(self.limits.dated);
            self.load = value;
            let loaded = *self.loaded.get_or_insert(value >= self.limits.begin);
            if self.passes(self.limits.dated) && !before {
                self.passed = t;
            }
            if !self.passes([self.limits.begin, self.limits.end]) {
                self.changing = None;
            } else if self.changing.is_none() {
                let at = t + if loaded { self.limits.quiet } else { 0 };
                self.changing = Some(Waiting { t: self.passed, at, repaired: false });
            }
        }
        if repaired {
            self.changing.iter_mut().chain(&mut self.waiting).for_each(|due| due.repaired = true);
        }
    }

    /// Decides on all frames that are complete, because no change before `t` us follows.
    pub(super) fn advance(&mut self, t: i64, clock: &FrameClock, out: &mut Vec<Decision>) {
        if let Some(due) = self.changing.take_if(|due| clock.is_over(due.at, t)) {
            self.change_state(due, clock, out);
        }
        while let Some(due) = self.waiting.front().copied().filter(|due| clock.is_over(due.at, t)) {
            self.waiting.pop_front();
            let label = usize::from(self.quantity >= self.limits.level);
            out.push(self.decision(label, due, clock));
        }
    }

    /// Begins or ends a load.
    fn change_state(&mut self, due: Waiting, clock: &FrameClock, out: &mut Vec<Decision>) {
        let ends = self.loaded == Some(true);
        self.loaded = Some(!ends);
        let (begun, repaired) = self.begun;
        if !ends {
            self.begun = (due.t, due.repaired);
        }
        match self.limits.when {
            When::Edges => out.push(self.decision(usize::from(ends), due, clock)),
            When::AtAge(age) if !ends => self.waiting.push_back(Waiting { at: due.t + age, ..due }),
            When::AtEnd if ends => {
                let value = ms(due.t - begun);
                let label = usize::from(value >= self.limits.level);
                let due = Waiting { t: begun, repaired: due.repaired || repaired, ..due };
                out.push(Decision { value, ..self.decision(label, due, clock) });
            }
            When::AtAge(_) | When::AtEnd => {}
        }
    }

    fn decision(&self, label: usize, due: Waiting, clock: &FrameClock) -> Decision {
        let Waiting { t, at, repaired } = due;
        Decision { label, t, known: clock.end_of(ms(at)), repaired, value: self.quantity }
    }

    /// Whether the quantity has come to the begin of the next load, or to the end of the present one.
    fn passes(&self, [begin, end]: [f64; 2]) -> bool {
        match self.loaded {
            Some(true) => self.load < end,
            Some(false) => self.load >= begin,
            None => false,
        }
    }
}
