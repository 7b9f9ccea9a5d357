//! The clock of a stream of numbers: its stamps as times, and what arrival shows to be wrong with them.

use std::collections::BTreeMap;

use super::super::verdict::{ANEW, BACK, Found, JUMPS};

/// Range of a counter: whole numbers are assumed to have 32 bits.
const TURN: f64 = 4_294_967_296.0;

/// A clock that steps back by more than this against arrival has restarted, one that steps ahead by more has jumped, us.
const STEP_US: f64 = 1e6;

/// Times are held in 64 bits: a stamp beyond this is no time, us.
const FARTHEST_US: f64 = 4.6e18;

/// Turns stamps into times, us, unwrapped over turns of a 32-bit counter and continued over restarts.
#[derive(Debug, Clone)]
pub struct StreamClock {
    unit_us: f64,
    state: State,
    /// The state before a restart or a jump that the next stamp may show to have been one damaged stamp, and whether it
    /// was a restart.
    before: Option<(State, bool)>,
    resets: u64,
    back: u64,
    jumps: u64,
    /// The time after which times are doubtful, us.
    after: Option<i64>,
}

#[derive(Debug, Clone, Copy)]
struct State {
    /// Whether all stamps so far are whole numbers, so that they may be those of a counter.
    whole: bool,
    /// Added to stamps, us.
    added: f64,
    /// The last time, with this addition, us, and its arrival time, ns.
    last: Option<(f64, i64)>,
}

/// How a stamp follows the one before.
enum Step {
    /// As arrival has it, after so many us of turns of the counter.
    Fits(f64),
    /// Behind it, by less than a restart.
    Back,
    /// So far behind that the clock has begun anew: what it lacks, us.
    Anew(f64),
    /// Farther ahead than the time that has passed.
    Ahead,
}

impl State {
    /// How a stamp, us, follows.
    #[allow(clippy::cast_precision_loss)]
    fn step(&self, own: f64, at_ns: i64, unit_us: f64) -> Step {
        let Some((last, last_ns)) = self.last else { return Step::Fits(0.0) };
        let passed = at_ns.saturating_sub(last_ns) as f64 * 1e-3;
        let t = own + self.added;
        let lacks = passed - (t - last);
        let turn = TURN * unit_us;
        let turns = (lacks / turn).round();
        // Arrival times determine the elapsed time within a second, or within a hundredth of a pause if that is longer.
        let near = STEP_US.max(passed.abs() * 1e-2);
        if self.whole && turns >= 1.0 && (lacks - turns * turn).abs() <= near {
            Step::Fits(turns * turn)
        } else if t < last - STEP_US && lacks > near {
            Step::Anew(lacks)
        } else if lacks < -near && passed >= 0.0 {
            Step::Ahead
        } else if t < last {
            Step::Back
        } else {
            Step::Fits(0.0)
        }
    }

    /// Whether a stamp follows as if the one between were damaged.
    fn fits(&self, own: f64, at_ns: i64, unit_us: f64) -> bool {
        self.last.is_some() && matches!(self.step(own, at_ns, unit_us), Step::Fits(_))
    }
}

impl StreamClock {
    /// The clock of stamps in this unit, us.
    pub fn new(unit_us: f64) -> Self {
        let state = State { whole: true, added: 0.0, last: None };
        Self { unit_us, state, before: None, resets: 0, back: 0, jumps: 0, after: None }
    }

    /// Converts a stamp to a time, us; none if it is no time.
    #[allow(clippy::cast_possible_truncation)]
    pub fn time(&mut self, stamp: f64, at_ns: i64) -> Option<i64> {
        let own = stamp * self.unit_us;
        if own.is_nan() || own.abs() > FARTHEST_US {
            return None;
        }
        let mut step = self.state.step(own, at_ns, self.unit_us);
        let unlike = !matches!(step, Step::Fits(turns) if turns == 0.0);
        if let Some((state, anew)) = self.before.take()
            && unlike
            && state.fits(own, at_ns, self.unit_us)
        {
            // The stamp between was damaged, whatever it looked like.
            if anew {
                self.resets -= 1;
                self.jumped(state.last);
            }
            step = state.step(own, at_ns, self.unit_us);
            self.state = state;
        }
        let state = self.state;
        match step {
            Step::Fits(turns) => self.state.added += turns,
            Step::Back => {
                self.back += 1;
                self.doubt(own + state.added - 1.0);
            }
            Step::Anew(lacks) => {
                self.before = Some((state, true));
                self.state.added += lacks;
                self.resets += 1;
            }
            Step::Ahead => {
                self.before = Some((state, false));
                self.jumped(state.last);
            }
        }
        self.state.whole &= stamp.fract() == 0.0 && (0.0..TURN).contains(&stamp);
        let t = own + self.state.added;
        self.state.last = Some((t, at_ns));
        Some(t.round() as i64)
    }

    fn jumped(&mut self, last: Option<(f64, i64)>) {
        self.jumps += 1;
        self.doubt(last.map_or(0.0, |(last, _)| last));
    }

    /// Times after this one are doubtful.
    #[allow(clippy::cast_possible_truncation)]
    fn doubt(&mut self, after: f64) {
        self.after = self.after.into_iter().chain([after.round() as i64]).min();
    }

    /// What is wrong with the stamps so far.
    pub fn found(&self) -> Found {
        let damage = [(ANEW, self.resets), (BACK, self.back), (JUMPS, self.jumps)];
        let damage: BTreeMap<String, u64> = damage.into_iter().map(|(cause, n)| (cause.to_owned(), n)).collect();
        Found { damage, doubtful_after_us: self.after, ..Found::default() }
    }
}
