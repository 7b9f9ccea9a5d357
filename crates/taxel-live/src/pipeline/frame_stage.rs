//! The second stage of a source of frames: reads messages, tracks the values and the source's clock, and makes changes of
//! whole steps, which viewers show.

use std::time::Duration;

use taxel_core::held::{Held, UNKNOWN};
use taxel_core::rest::ValueSteps;
use taxel_core::{Events, Intensities};

use super::counters::Counters;
use super::frame_block::{FrameBlock, read_message};
use super::readout_queue::QuietUntil;
use super::recent_frames::RecentFrames;
use super::source::FrameLayout;
use crate::capture::Batch;
use crate::clock::{BoardClock, Pace};

/// Shortest interval at which the readout's time is advanced while no frames arrive.
const TICK: Duration = Duration::from_micros(500);

/// How far the readout stays behind the host's clock in a silence, unless that is stated, frames: some serial adapters hold
/// bytes back for 16 ms.
const GUARD_FRAMES: f64 = 5.0;

/// Number of differences between frames from which the noise is measured.
const NOISE_FRAMES: usize = 32;

pub(super) struct FrameStage {
    frame_us: Option<f64>,
    /// Whether the lines waited in a file, so that their arrival shows no pace of a clock.
    waited: bool,
    guard_frames: f64,
    taxels: usize,
    columns: usize,
    frames: FrameBlock,
    /// The values of the last frame, and of the one before it.
    pub(super) last: Vec<f32>,
    before: Vec<f32>,
    steps: Option<ValueSteps>,
    noise: FirstNoise,
    pub(super) recent: RecentFrames,
    pub(super) held: Held,
    /// The changes of `held` with these frames.
    changes: Events,
    clock: BoardClock,
    pace: Option<Pace>,
    /// Time of the first frame, us.
    first: Option<i64>,
    /// Time of the last frame, us, and its arrival, ns since 1970.
    latest: Option<(i64, i64)>,
    pub(super) count: u64,
}

impl FrameStage {
    pub(super) fn new(layout: &FrameLayout, guard_frames: Option<f64>) -> Self {
        let array = &layout.array;
        Self {
            frame_us: layout.frame_us,
            waited: layout.waited,
            guard_frames: guard_frames.unwrap_or(GUARD_FRAMES),
            taxels: array.len(),
            columns: array.columns.into(),
            frames: FrameBlock::default(),
            last: vec![],
            before: vec![],
            steps: None,
            noise: FirstNoise::new(array.len()),
            recent: RecentFrames::default(),
            held: Held::unknown(array.len()),
            changes: Events { intensity: Some(Intensities::default()), ..Events::empty(array.clone()) },
            clock: BoardClock::default(),
            pace: None,
            first: None,
            latest: None,
            count: 0,
        }
    }

    /// Reads the frames of a batch; returns whether the steps of their values are new, so that earlier changes are void.
    pub(super) fn push(&mut self, batch: &Batch) -> bool {
        let mut is_new = false;
        for (message, bytes) in batch.iter() {
            let (t, values) = read_message(bytes);
            self.before.clone_from(&self.last);
            self.last.clear();
            self.last.extend(values);
            self.frames.t.push(t);
            self.frames.values.extend_from_slice(&self.last);
            self.first.get_or_insert(t);
            self.latest = Some((t, message.arrived_ns));
            self.count += 1;
            if self.clock.note(t, message.arrived_ns) && !self.waited {
                self.pace = self.clock.pace();
            }
            is_new |= self.fit_steps();
            self.change(t);
            self.recent.take(message.arrived_ns, &self.last);
        }
        is_new
    }

    /// Fits the steps to the last frame; returns whether they are others than before.
    fn fit_steps(&mut self) -> bool {
        let mut steps = self.steps.unwrap_or_else(|| ValueSteps::of_first(&self.last));
        for &value in &self.last {
            if !steps.holds(value) {
                steps = steps.widened(value);
            }
        }
        if let Some(noise) = self.noise.take(&self.before, &self.last) {
            steps = steps.above_noise(noise);
        }
        let is_new = self.steps.is_some_and(|before| before != steps);
        self.steps = Some(steps);
        if is_new {
            self.held.clear();
            self.changes.clear();
        }
        is_new
    }

    /// Adds the changes of the last frame; one that is equal to the frame before has one change, for its time.
    #[allow(clippy::cast_possible_truncation)]
    fn change(&mut self, t: i64) {
        let Some(steps) = self.steps else { return };
        let before = self.changes.len();
        for (taxel, &value) in self.last.iter().enumerate() {
            let ticks = steps.ticks(value);
            let held = self.held.set(taxel, ticks);
            if held != ticks || (taxel + 1 == self.taxels && self.changes.len() == before) {
                self.changes.t.push(t);
                self.changes.x.push((taxel % self.columns) as u16);
                self.changes.y.push((taxel / self.columns) as u16);
                self.changes.p.push(held == UNKNOWN || ticks >= held);
                let intensity = self.changes.intensity.get_or_insert_default();
                intensity.ticks.push(ticks);
                intensity.present.push(ticks != UNKNOWN);
            }
        }
    }

    /// The frames that are about to be passed on, and the changes in them.
    pub(super) fn parts(&mut self) -> (&mut FrameBlock, &Events, &Held) {
        (&mut self.frames, &self.changes, &self.held)
    }

    /// Clears the frames that were passed on.
    pub(super) fn clear(&mut self) {
        self.frames.clear();
        self.changes.clear();
        self.changes.intensity.get_or_insert_default();
    }

    /// The steps of the values, and the time of the first frame, us.
    pub(super) fn steps(&self) -> Option<(ValueSteps, i64)> {
        self.steps.zip(self.first)
    }

    /// Writes the stage's counts.
    pub(super) fn publish(&self, counters: &mut Counters) {
        counters.decoding.decoded = self.count;
        counters.decoding.frames = self.count;
        counters.board.arrived_ns = self.latest.map(|(_, arrived_ns)| arrived_ns);
        counters.board.offset = self.clock.offset();
        counters.board.pace.clone_from(&self.pace);
        counters.board.board_us = self.latest.map(|(t, _)| t);
        // A source of frames sends one each so long, as a board its heartbeats.
        #[allow(clippy::cast_possible_truncation)]
        {
            counters.board.heartbeat_us = self.frame_us.map(|frame_us| frame_us.ceil() as i64);
        }
    }

    /// The interval at which the readout's time is advanced while no frames arrive.
    pub(super) fn tick(&self) -> Duration {
        TICK.max(Duration::from_secs_f64(self.frame_us.unwrap_or_default() * 1e-6))
    }

    /// The source's time before which everything has arrived, if nothing arrived until `until_ns`.
    #[allow(clippy::cast_possible_truncation)]
    pub(super) fn quiet_until(&self, until_ns: Option<i64>) -> Option<QuietUntil> {
        let (t, arrived_ns) = self.latest?;
        let guard_us = (self.guard_frames * self.frame_us?) as i64;
        let passed_us = (until_ns? - arrived_ns).max(0) / 1000;
        Some(QuietUntil::ByHostClock(t + passed_us - guard_us))
    }
}

/// The noise of the first frames.
struct FirstNoise {
    /// The sum of each taxel's squared differences from frame to frame.
    squares: Vec<f64>,
    frames: usize,
}

impl FirstNoise {
    fn new(taxels: usize) -> Self {
        Self { squares: vec![0.0; taxels], frames: 0 }
    }

    /// Takes the next frame; once, when it was measured, returns the standard deviation that 90 % of the taxels have at most.
    fn take(&mut self, before: &[f32], frame: &[f32]) -> Option<f64> {
        if self.frames >= NOISE_FRAMES || before.is_empty() {
            return None;
        }
        for (square, (&before, &value)) in self.squares.iter_mut().zip(before.iter().zip(frame)) {
            let difference = f64::from(value) - f64::from(before);
            *square += if difference.is_finite() { difference * difference } else { 0.0 };
        }
        self.frames += 1;
        if self.frames < NOISE_FRAMES {
            return None;
        }
        let most = (self.squares.len() - 1) * 9 / 10;
        let (_, square, _) = self.squares.select_nth_unstable_by(most, f64::total_cmp);
        // A difference has the noise of two frames.
        #[allow(clippy::cast_precision_loss)]
        Some((*square / (2.0 * NOISE_FRAMES as f64)).sqrt())
    }
}
