//! The clock of a stream of numbers: its stamps as times, and what arrival shows to be wrong with them.

use super::super::causes::Cause;
use super::super::verdict::Found;

/// Range of a counter: whole numbers are assumed to have 32 bits.
const TURN: f64 = 4_294_967_296.0;

/// A clock that steps back by more than this against arrival has restarted, one that steps ahead by more has jumped, us.
const STEP_US: f64 = 1e6;

/// The part of what has passed by which the clock may be off, as no oscillator is.
const DRIFT: f64 = 1e-2;

/// A stamp beyond this is no time, us: 142 years, as in all files, so that times also fit in 64 bits as ns.
const FARTHEST_US: f64 = 4_503_599_627_370_496.0;

/// Turns stamps into times, us, unwrapped over turns of a 32-bit counter and continued over restarts.
#[derive(Debug, Clone)]
pub struct StreamClock {
    unit_us: f64,
    /// Whether lines waited in a file until they were read, so that their arrival is no clock to compare with.
    waited: bool,
    state: State,
    /// The state before a restart or a jump that the next stamp may show to have been one damaged stamp, and whether it
    /// was a restart.
    before: Option<(State, bool)>,
}

#[derive(Debug, Clone, Copy)]
struct State {
    /// Whether all stamps so far are whole numbers, so that they may be those of a counter.
    integers: bool,
    /// Added to stamps, us.
    added: f64,
    /// The last time, with this addition, us, and its arrival time, ns.
    last: Option<(f64, i64)>,
    anchor: Option<Anchor>,
}

/// With what later times are compared: the line that was the least late of the first second, as a source that has waited
/// sends what it has at once.
#[derive(Debug, Clone, Copy)]
struct Anchor {
    /// Its time, us, and its arrival time, ns.
    at: (f64, i64),
    /// The arrival time of the first line, ns.
    first_ns: i64,
    /// The largest time by which arrival went ahead from one line to the next, us: lines that come in packets are late
    /// by up to this.
    late: f64,
    /// The last time that agreed with arrival, us.
    sound: f64,
    /// Whether it was told that a later one does not.
    told: bool,
}

impl Anchor {
    fn new(at: (f64, i64)) -> Self {
        Self { at, first_ns: at.1, late: 0.0, sound: at.0, told: false }
    }

    /// Compares the next time, which `late` us more than by the clock have passed before; whether the clock is now off for
    /// the first time.
    #[allow(clippy::cast_precision_loss)]
    fn is_left(&mut self, (t, at_ns): (f64, i64), late: f64) -> bool {
        let passed = at_ns.saturating_sub(self.at.1) as f64 * 1e-3;
        let off = passed - (t - self.at.0);
        if (at_ns.saturating_sub(self.first_ns) as f64) < STEP_US * 1e3 {
            if off < 0.0 {
                self.at = (t, at_ns);
            }
            return false;
        }
        self.late = self.late.max(late);
        let allowed = self.late + STEP_US.max(passed * DRIFT);
        if off.abs() <= allowed * 0.1 {
            self.sound = t;
        }
        let left = off.abs() > allowed && !self.told;
        self.told |= left;
        left
    }
}

/// How a stamp follows the one before.
enum StampStep {
    /// As arrival has it, after so many us of turns of the counter.
    Fits(f64),
    /// Behind it, by less than a restart.
    Back,
    /// Farther behind, so the clock has begun anew: what it lacks, us.
    Anew(f64),
    /// Farther ahead than the time that has passed.
    Ahead,
}

impl State {
    /// How a stamp, us, follows.
    #[allow(clippy::cast_precision_loss)]
    fn step(&self, stamp_us: f64, at_ns: i64, unit_us: f64) -> StampStep {
        let Some((last, last_ns)) = self.last else { return StampStep::Fits(0.0) };
        let passed = at_ns.saturating_sub(last_ns) as f64 * 1e-3;
        let t = stamp_us + self.added;
        let lacks = passed - (t - last);
        let turn = TURN * unit_us;
        let turns = (lacks / turn).round();
        // Arrival times determine the elapsed time within a second, or within a hundredth of a pause if that is longer.
        let near = STEP_US.max(passed.abs() * DRIFT);
        if self.integers && turns >= 1.0 && (lacks - turns * turn).abs() <= near {
            StampStep::Fits(turns * turn)
        } else if t < last - STEP_US && lacks > near {
            StampStep::Anew(lacks)
        } else if lacks < -near && passed >= 0.0 {
            StampStep::Ahead
        } else if t < last {
            StampStep::Back
        } else {
            StampStep::Fits(0.0)
        }
    }

    /// Whether a stamp follows as if the one between were damaged.
    fn fits(&self, stamp_us: f64, at_ns: i64, unit_us: f64) -> bool {
        self.last.is_some() && matches!(self.step(stamp_us, at_ns, unit_us), StampStep::Fits(_))
    }
}

impl StreamClock {
    /// The clock of stamps in this unit, us, of lines that may have `waited` in a file.
    pub fn new(unit_us: f64, waited: bool) -> Self {
        let state = State { integers: true, added: 0.0, last: None, anchor: None };
        Self { unit_us, waited, state, before: None }
    }

    /// Converts a stamp to a time, us; none if it is no time. What is wrong with it is added to `found`.
    #[allow(clippy::cast_possible_truncation, clippy::cast_precision_loss)]
    pub fn time(&mut self, stamp: f64, at_ns: i64, found: &mut Found) -> Option<i64> {
        let stamp_us = stamp * self.unit_us;
        if stamp_us.is_nan() || stamp_us.abs() > FARTHEST_US {
            return None;
        }
        // What waited is as if it had arrived at once.
        let at_ns = if self.waited { 0 } else { at_ns };
        let mut step = self.state.step(stamp_us, at_ns, self.unit_us);
        if self.waited && matches!(step, StampStep::Ahead) {
            step = StampStep::Fits(0.0);
        }
        let unlike = !matches!(step, StampStep::Fits(turns) if turns == 0.0);
        if let Some((state, anew)) = self.before.take()
            && unlike
            && state.fits(stamp_us, at_ns, self.unit_us)
        {
            // The stamp between was damaged, whatever it looked like.
            if anew {
                found.counts[Cause::ClockAnew] -= 1;
                jumped(found, state.last);
            }
            step = state.step(stamp_us, at_ns, self.unit_us);
            self.state = state;
        }
        let state = self.state;
        let anew = matches!(step, StampStep::Anew(_) | StampStep::Ahead);
        match step {
            StampStep::Fits(turns) => self.state.added += turns,
            StampStep::Back => {
                found.counts[Cause::StampsBack] += 1;
                doubt(found, stamp_us + state.added - 1.0);
            }
            StampStep::Anew(lacks) => {
                self.before = Some((state, true));
                self.state.added += lacks;
                found.counts[Cause::ClockAnew] += 1;
            }
            StampStep::Ahead => {
                self.before = Some((state, false));
                jumped(found, state.last);
            }
        }
        self.state.integers &= stamp.fract() == 0.0 && (0.0..TURN).contains(&stamp);
        let t = stamp_us + self.state.added;
        self.compare(state.last, (t, at_ns), anew, found);
        self.state.last = Some((t, at_ns));
        // Until the next stamp shows that the clock has jumped, one that is ahead of arrival may be damaged.
        let by_arrival = state.last.filter(|_| matches!(step, StampStep::Ahead));
        let t = by_arrival.map_or(t, |(last, last_ns)| last + at_ns.saturating_sub(last_ns) as f64 * 1e-3);
        Some(t.round() as i64)
    }

    /// Compares a time with arrival since the clock began, or began `anew`.
    #[allow(clippy::cast_precision_loss)]
    fn compare(&mut self, last: Option<(f64, i64)>, now: (f64, i64), anew: bool, found: &mut Found) {
        let (before, at_ns) = last.unwrap_or(now);
        let passed = now.1.saturating_sub(at_ns) as f64 * 1e-3;
        let anchor = self.state.anchor.get_or_insert(Anchor::new(now));
        if anew || passed < -STEP_US {
            // The host's clock was set back where a line arrives before the one before it.
            *anchor = Anchor::new(now);
        } else if anchor.is_left(now, passed - (now.0 - before)) {
            found.counts[Cause::Drifts] += 1;
            doubt(found, anchor.sound);
        }
    }
}

fn jumped(found: &mut Found, last: Option<(f64, i64)>) {
    found.counts[Cause::Jumps] += 1;
    doubt(found, last.map_or(0.0, |(last, _)| last));
}

/// Times after this one are doubtful.
#[allow(clippy::cast_possible_truncation)]
fn doubt(found: &mut Found, after: f64) {
    found.doubtful_after_us = found.doubtful_after_us.into_iter().chain([after.round() as i64]).min();
}
