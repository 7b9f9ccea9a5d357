//! Levels that values reach and leave, with a minimum duration and tonic spikes.

use std::collections::VecDeque;
use std::ops::Range;

use crate::Spike;
use crate::spikes::ms;

/// A level of one value.
#[derive(Clone, Copy)]
pub(super) struct Level {
    /// From this value on, the value is above.
    rise: f64,
    /// Below this one, it is no longer above.
    fall: f64,
    /// The trains that spike when the level is reached and left; if both are one, that train is signed.
    trains: [usize; 2],
    /// The train that spikes periodically while the value is above, if there is one.
    tonic: Option<usize>,
    /// Whether the latest value is above.
    above: bool,
    /// When `above` last changed, us.
    changed: i64,
    /// The time of the latest spike, us, if it reported that the level is reached: it follows `above` after the minimum
    /// duration.
    reported: Option<i64>,
}

impl Level {
    pub(super) fn new(rise: f64, fall: f64, trains: [usize; 2], tonic: Option<usize>) -> Self {
        Self { rise, fall, trains, tonic, above: false, changed: i64::MIN, reported: None }
    }
}

/// Levels, all of which have the same minimum duration and period of tonic spikes.
#[derive(Clone, Default)]
pub(super) struct Levels {
    levels: Vec<Level>,
    /// The number of these that are above.
    above: usize,
    /// Minimum duration, us.
    hold: i64,
    /// Crossings that have not lasted for the minimum duration: the time when they will have, and the level. The
    /// duration is the same for all, so the queue is ordered by time.
    trials: VecDeque<(i64, usize)>,
    /// Period of the tonic spikes, us.
    interval: i64,
    /// The time of each level's next tonic spike, the level, and when it was reported; the period is the same for all, so
    /// the queue is ordered by time.
    tonic: VecDeque<(i64, usize, i64)>,
}

impl Levels {
    /// Levels that all values are below, with the minimum duration and the period of tonic spikes, us.
    pub(super) fn new(levels: Vec<Level>, hold: i64, interval: i64) -> Self {
        Self { levels, hold, interval, ..Self::default() }
    }

    /// Each value with all levels, ascending, which it leaves below a part of each: first a train per value and level
    /// that spikes when the level is reached, then one that spikes when it is left.
    pub(super) fn of_each(values: usize, levels: &[f64], release: f64) -> Self {
        let n = values * levels.len();
        let level = |k: usize| {
            let at = levels[k % levels.len()];
            Level::new(at, release * at, [k, n + k], None)
        };
        Self::new((0..n).map(level).collect(), 0, 0)
    }

    pub(super) fn len(&self) -> usize {
        self.levels.len()
    }

    /// The number of levels that are above.
    pub(super) fn above(&self) -> usize {
        self.above
    }

    pub(super) fn is_above(&self, level: usize) -> bool {
        self.levels[level].above
    }

    /// Moves a level.
    pub(super) fn place(&mut self, level: usize, rise: f64, fall: f64) {
        (self.levels[level].rise, self.levels[level].fall) = (rise, fall);
    }

    /// The values from the first (included) to the second (excluded) that cross none of some levels of one value.
    pub(super) fn bracket(&self, levels: Range<usize>) -> (f64, f64) {
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for level in &self.levels[levels] {
            if level.above {
                low = low.max(level.fall);
            } else {
                high = high.min(level.rise);
            }
        }
        (low, high)
    }

    /// Begins with the value of each level: no crossings, but tonic spikes where it is above.
    pub(super) fn settle(&mut self, t: i64, levels: Range<usize>, value: impl Fn(usize) -> f64, out: &mut Vec<Spike>) {
        for k in levels {
            self.set(k, value(k) >= self.levels[k].rise);
            self.levels[k].reported = None;
            if self.levels[k].above {
                self.begin_tonic(t, k, out);
            }
        }
    }

    /// Reads the value of each of some levels.
    #[inline(always)]
    pub(super) fn take(&mut self, t: i64, levels: Range<usize>, value: impl Fn(usize) -> f64, out: &mut Vec<Spike>) {
        for k in levels {
            let level = self.levels[k];
            let above = value(k) >= if level.above { level.fall } else { level.rise };
            if above != level.above {
                self.set(k, above);
                self.levels[k].changed = t;
                if self.hold == 0 {
                    self.report(t, k, out);
                } else if above != level.reported.is_some() {
                    self.trials.push_back((t + self.hold, k));
                }
            }
        }
    }

    /// Emits what is due before `t` (with `at_too` also at `t`): crossings whose minimum duration ends, and tonic spikes.
    pub(super) fn pass(&mut self, t: i64, at_too: bool, out: &mut Vec<Spike>) {
        self.report_trials(t, at_too, out);
        self.emit_tonic(t, at_too, out);
    }

    /// Emits the crossings whose minimum duration ends before `t` (with `at_too` also at `t`), and the tonic spikes
    /// before each.
    pub(super) fn report_trials(&mut self, t: i64, at_too: bool, out: &mut Vec<Spike>) {
        while let Some(&(due, k)) = self.trials.front()
            && (due < t || (at_too && due == t))
        {
            self.trials.pop_front();
            self.emit_tonic(due, false, out);
            let level = self.levels[k];
            if level.above != level.reported.is_some() && level.changed == due - self.hold {
                self.report(due, k, out);
            }
        }
    }

    /// Whether no spike is due while the values hold.
    pub(super) fn idle(&self) -> bool {
        self.trials.is_empty() && self.tonic.is_empty()
    }

    fn set(&mut self, k: usize, above: bool) {
        let was = std::mem::replace(&mut self.levels[k].above, above);
        self.above = self.above + usize::from(above) - usize::from(was);
    }

    fn report(&mut self, t: i64, k: usize, out: &mut Vec<Spike>) {
        let Level { trains: [reached, left], above, .. } = self.levels[k];
        if above {
            out.push(Spike { t: ms(t), train: reached as u32, value: 1.0 });
            self.begin_tonic(t, k, out);
        } else {
            out.push(Spike { t: ms(t), train: left as u32, value: if left == reached { -1.0 } else { 1.0 } });
            self.levels[k].reported = None;
        }
    }

    /// Notes that a level is reached: its tonic spikes begin.
    fn begin_tonic(&mut self, t: i64, k: usize, out: &mut Vec<Spike>) {
        self.levels[k].reported = Some(t);
        if let Some(train) = self.levels[k].tonic {
            out.push(Spike { t: ms(t), train: train as u32, value: 1.0 });
            self.tonic.push_back((t + self.interval, k, t));
        }
    }

    /// Emits the tonic spikes before `t` (with `at_too` also at `t`).
    fn emit_tonic(&mut self, t: i64, at_too: bool, out: &mut Vec<Spike>) {
        while let Some(&(due, k, since)) = self.tonic.front()
            && (due < t || (at_too && due == t))
        {
            self.tonic.pop_front();
            if let (Some(train), true) = (self.levels[k].tonic, self.levels[k].reported == Some(since)) {
                out.push(Spike { t: ms(due), train: train as u32, value: 1.0 });
                self.tonic.push_back((due + self.interval, k, since));
            }
        }
    }
}
