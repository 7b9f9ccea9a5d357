//! How far a run of the emulated board is: its clocks, its schedule, the datagrams of its frame.

use std::iter::Peekable;
use std::time::{Duration, Instant};

use taxel_core::board::Board;
use taxel_core::wire::Command;

use super::pace::FramePacer;
use crate::latency::Latencies;
use crate::recording::now_ns;

/// How often commands are read.
pub(super) const POLL_EVERY: Duration = Duration::from_millis(1);

/// How often the caller gets a report.
pub(super) const REPORT_EVERY: Duration = Duration::from_millis(100);

/// How often two clocks are read; the pair read within the shortest time counts.
const READINGS: usize = 16;

/// A run of the board, from its first frame on.
pub(super) struct BoardRun {
    pub(super) leaving: OutgoingDatagrams,
    pub(super) pace: FramePacer,
    /// How long after its end each frame was sent, and how many were sent more than a frame late.
    pub(super) late: Latencies,
    pub(super) late_frames: u64,
    pub(super) resets: u64,
    /// The host's clock at the board's time 0, ns since 1970.
    pub(super) began_ns: i64,
    pub(super) begun: Instant,
    /// When the last frame was due.
    pub(super) due: Instant,
    /// What is added to the board's own clock, which a reset sets back to 0, for its time since the start, us.
    pub(super) before_reset_us: f64,
    /// The board's own clock at the start, us.
    started_us: f64,
    host_s_per_us: f64,
    /// The commands that are still to be executed.
    pub(super) schedule: Peekable<std::vec::IntoIter<(u64, Command)>>,
    /// When commands were last read, and the caller last got a report.
    pub(super) polled: Instant,
    pub(super) reported: Instant,
}

impl BoardRun {
    #[allow(clippy::cast_possible_truncation)]
    pub(super) fn new(board: &Board, commands: Vec<(u64, Command)>, drift_ppm: f64) -> Self {
        let (begun, begun_ns) = now_by_both();
        let started_us = board.time_us();
        Self {
            leaving: OutgoingDatagrams::default(),
            pace: FramePacer::default(),
            late: Latencies::default(),
            late_frames: 0,
            resets: 0,
            began_ns: begun_ns - (started_us * 1e3) as i64,
            begun,
            due: begun,
            before_reset_us: -started_us,
            started_us,
            host_s_per_us: 1e-6 / (1.0 + 1e-6 * drift_ppm),
            schedule: commands.into_iter().peekable(),
            polled: begun,
            reported: begun,
        }
    }

    /// The board's time since its start, us, over all resets.
    pub(super) fn since_us(&self, board: &Board) -> f64 {
        self.before_reset_us + board.time_us()
    }

    /// The board's time over all resets, by a clock that shows at the start what the board's showed, us.
    pub(super) fn board_us(&self, board: &Board) -> f64 {
        self.started_us + self.before_reset_us + board.time_us()
    }

    /// Moves on to when the frame that the board has scanned ends; returns how long it is.
    pub(super) fn next_due(&mut self, board: &Board) -> Duration {
        let before = self.due;
        self.due = self.begun + Duration::from_secs_f64(self.since_us(board) * self.host_s_per_us);
        self.due - before
    }

    /// Counts by how much the frame of this length was sent late.
    pub(super) fn note_late(&mut self, now: Instant, frame: Duration) {
        let behind = now.saturating_duration_since(self.due);
        self.late.note(i64::try_from(behind.as_nanos()).unwrap_or(i64::MAX));
        self.late_frames += u64::from(behind > frame);
    }
}

/// Whether so long has passed since `last`, which is then set to now.
pub(super) fn is_due(last: &mut Instant, now: Instant, interval: Duration) -> bool {
    let due = now.duration_since(*last) >= interval;
    if due {
        *last = now;
    }
    due
}

/// Datagrams that are sent when the frame ends, not earlier: a train is sent as soon as a datagram of another length follows.
#[derive(Default)]
pub(super) struct OutgoingDatagrams {
    bytes: Vec<u8>,
    ends: Vec<usize>,
}

impl OutgoingDatagrams {
    pub(super) fn push(&mut self, datagram: &[u8]) {
        if !datagram.is_empty() {
            self.bytes.extend_from_slice(datagram);
            self.ends.push(self.bytes.len());
        }
    }

    pub(super) fn clear(&mut self) {
        self.bytes.clear();
        self.ends.clear();
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &[u8]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| &self.bytes[start..end])
    }
}

/// Now by the clock that paces frames, and by the one that arrivals are stamped with, ns since 1970. Where the thread was held
/// up between the two, they are read again.
fn now_by_both() -> (Instant, i64) {
    let read = |_| {
        let (before, now_ns) = (Instant::now(), now_ns());
        (before.elapsed(), before, now_ns)
    };
    let (passed, before, now_ns) =
        (1..READINGS).map(read).fold(read(0), |best, next| if next.0 < best.0 { next } else { best });
    (before + passed / 2, now_ns)
}
