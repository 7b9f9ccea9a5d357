//! A quantity over a whole recording, on which many plain rules are tried without encoding it again.

use crate::detect::detector::{SILENCE_US, usual_distance};
use crate::detect::running_rule::{Decision, EdgeNumbers, Limits, RunningRule};
use crate::detect::{FrameClock, FrameTime};
use crate::encode::{Measure, Quantity, Tare};
use crate::spikes::us;
use crate::{EventsView, FramesView, Result, Spike, Stop, problem};

/// The number of events, or of frames, between two checks of [`Stop`].
const PIECE: usize = 16_384;

/// How long after the silence that follows a recording a quantity is computed, us: so far its quiet time or age may reach.
const LONGEST_REACH_US: i64 = 10_000_000;

/// The changes of a quantity in a recording.
#[derive(Clone)]
pub struct LoadCurve {
    quantity: Quantity,
    changes: Vec<Spike>,
    /// The time of each frame, us; none for events.
    frame_times: Vec<i64>,
    clock: FrameClock,
    period_us: f64,
    /// The time of the last input, us.
    last: i64,
}

impl LoadCurve {
    /// Each of several quantities in a recording of events.
    ///
    /// # Errors
    ///
    /// Those of [`Quantity::stream`], [`FrameClock::new`] and [`EventsView::check_order`]; `Interrupted` if asked to
    /// stop.
    pub fn of_events(
        quantities: &[Quantity],
        measure: Measure<'_>,
        events: EventsView<'_>,
        frames: FrameTime,
        tare: Option<&Tare>,
        stop: Stop<'_>,
    ) -> Result<Vec<Self>> {
        let mut stream = Quantity::stream(quantities, measure, events.array, tare)?;
        let clock = FrameClock::new(frames)?;
        events.check()?;
        events.check_order()?;
        let mut changes = vec![];
        for piece in events.pieces(PIECE) {
            stop.check()?;
            stream.push_events(piece, &mut changes)?;
        }
        let last = events.t.iter().copied().chain(events.markers.iter().map(|marker| marker.t)).max().unwrap_or(0);
        stream.advance(last + SILENCE_US + LONGEST_REACH_US, &mut changes);
        Ok(Self::of_each(quantities, &changes, &[], clock, frames.period_us, last))
    }

    /// Each of several quantities in a recording of frames, which last `frame_us`, or by default their median distance.
    ///
    /// # Errors
    ///
    /// Those of [`Quantity::stream`], [`FrameClock::new`] and [`FramesView::check`]; `Interrupted` if asked to stop.
    pub fn of_frames(
        quantities: &[Quantity],
        measure: Measure<'_>,
        frames: FramesView<'_>,
        frame_us: Option<f64>,
        tare: Option<&Tare>,
        stop: Stop<'_>,
    ) -> Result<Vec<Self>> {
        let mut stream = Quantity::stream(quantities, measure, frames.array, tare)?;
        let period_us = frame_us.map_or_else(|| usual_distance(frames.t), Ok)?;
        let clock = FrameClock::new(period_us)?;
        frames.check()?;
        let mut changes = vec![];
        for (k, (t, frame)) in frames.iter().enumerate() {
            if k % PIECE == 0 {
                stop.check()?;
            }
            stream.push_frame(t, frame, &mut changes)?;
        }
        let last = frames.t.last().copied().unwrap_or(0);
        Ok(Self::of_each(quantities, &changes, frames.t, clock, period_us, last))
    }

    /// A curve for each quantity, whose changes are a train.
    fn of_each(
        quantities: &[Quantity],
        changes: &[Spike],
        frame_times: &[i64],
        clock: FrameClock,
        period_us: f64,
        last: i64,
    ) -> Vec<Self> {
        let of = |(train, &quantity): (u32, &Quantity)| {
            let changes = changes.iter().filter(|change| change.train == train);
            let changes = changes.map(|&change| Spike { train: 0, ..change }).collect();
            Self { quantity, changes, frame_times: frame_times.to_vec(), clock, period_us, last }
        };
        (0..).zip(quantities).map(of).collect()
    }

    /// The quantity's changes: their times, ms, and what it is after each.
    #[must_use]
    pub fn changes(&self) -> &[Spike] {
        &self.changes
    }

    /// The begins and ends of loads, as of a [`PlainRule`](crate::detect::PlainRule) with these numbers.
    #[must_use]
    pub fn edges(&self, edges: &EdgeNumbers) -> Vec<Decision> {
        let limits = Limits::at_edges(edges);
        // Begins and ends depend only on which limits the quantity has passed, and it changes far more often than that.
        let mut last = None;
        let passing = self.changes.iter().filter(|change| {
            let passed = Some(limits.passed_limits(f64::from(change.value)));
            std::mem::replace(&mut last, passed) != passed
        });
        self.run(limits, passing)
    }

    /// The area at an age of every touch, as it is compared with a [`PlainRule`](crate::detect::PlainRule)'s level.
    ///
    /// # Errors
    ///
    /// `Problem` for another quantity.
    pub fn at_age(&self, age_ms: f64) -> Result<Vec<Decision>> {
        self.of_touches("ages", Limits::at_age(0, f64::INFINITY, age_ms))
    }

    /// Every touch as it ends, with its duration, ms, as it is compared with a
    /// [`PlainRule`](crate::detect::PlainRule)'s level.
    ///
    /// # Errors
    ///
    /// `Problem` for another quantity than the area.
    pub fn at_end(&self) -> Result<Vec<Decision>> {
        self.of_touches("ends", Limits::at_end(f64::INFINITY))
    }

    fn of_touches(&self, what: &str, limits: Limits) -> Result<Vec<Decision>> {
        if self.quantity != Quantity::Area {
            return Err(problem!(
                what; " need a curve of the quantity area, because touches begin and end by area: this curve has \
                       another quantity"
            ));
        }
        Ok(self.run(limits, self.changes.iter()))
    }

    fn run<'a>(&self, limits: Limits, changes: impl Iterator<Item = &'a Spike>) -> Vec<Decision> {
        let (mut rule, mut clock, mut out) = (RunningRule::new(limits), self.clock, vec![]);
        let end = self.last + SILENCE_US + self.period_us.ceil() as i64 + limits.reach();
        let mut changes = changes.take_while(|change| us(change.t) < end as f64).peekable();
        for &t in &self.frame_times {
            rule.advance(t, &clock, &mut out);
            clock.start_frame(t);
            while let Some(&change) = changes.next_if(|change| us(change.t).round() as i64 == t) {
                rule.change(change, false, &clock, &mut out);
            }
        }
        for &change in changes {
            rule.change(change, false, &clock, &mut out);
        }
        rule.advance(end, &clock, &mut out);
        out
    }
}
