//! The counts of the pipeline, and how it ended.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::Serialize;
use taxel_core::counts_since;
use taxel_core::encode::Tare;
use taxel_core::rest::LeftFloor;
use taxel_core::wire::{self, SenderTotals, StepBack};

use super::frame_input::LineCounts;
use super::sending::Sent;
use crate::capture;
use crate::clock::{Offset, Pace};
use crate::latency::Quantiles;
use crate::recording::Verdict;

/// Counts of what arrived, how it was processed, and what was lost at which stage.
///
/// Once [`Live::stop`](super::Live::stop) has returned, `capture.datagrams = decoded + capture.dropped_by_queue` and
/// `wire.bytes = 5 wire.words + wire.skipped`; if there is a readout, `events = read_out + events_dropped`. In JSON, as in
/// Python, all are fields of one object but for those of the socket and the wire.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Counters {
    /// Counts of the socket and of the queue behind it.
    pub capture: capture::CaptureCounts,
    /// Counts of the lines of a source of frames.
    pub lines: Option<LineCounts>,
    /// What was decoded.
    #[serde(flatten)]
    pub decoding: DecodingCounts,
    /// What the readout did with the events.
    #[serde(flatten)]
    pub readout: ReadoutCounts,
    /// Counts of each destination: `sent + lost + waiting = detections`.
    pub sent: Vec<Sent>,
    /// Counts of the recording's other sources.
    pub sources: BTreeMap<String, Counters>,
    /// Latency from the kernel's stamp to the end of decoding, per datagram; none if the kernel does not stamp.
    pub decode_latency: Quantiles,
    /// Latency from `known` to the output, by the board's clock.
    pub report_latency: Quantiles,
    /// What is known of the board's clock and of its signs of life.
    #[serde(flatten)]
    pub board: BoardState,
    /// Time since the socket was opened, s.
    pub seconds: f64,
}

/// Counts of the decoder, and what it refused.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct DecodingCounts {
    /// Datagrams that were decoded.
    pub decoded: u64,
    /// Counts of the decoder of version 1.
    pub wire: wire::Counts,
    /// The board's version of the wire.
    pub wire_version: u8,
    /// Counts of the decoder of version 2.
    pub wire_v2: wire::v2::Counts,
    /// Events of version 2 that arrived after time had advanced without them: their datagram was delayed longer than
    /// the pipeline waits at a gap.
    pub wire_late: u64,
    /// The counts that do not belong to the decoder of either version.
    #[serde(flatten)]
    pub totals: SenderTotals,
    /// The largest steps back of times; of a recording that began later none, as its own clock may have others.
    #[serde(skip)]
    pub wire_steps: Vec<StepBack>,
    /// Number of decoded events.
    pub events: u64,
    /// Number of frames of numbers.
    pub frames: u64,
}

/// Counts of the readout and of its detections.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct ReadoutCounts {
    /// Events that the readout has processed.
    pub read_out: u64,
    /// Events that did not fit in the queue before the readout.
    pub events_dropped: u64,
    /// Events that arrived out of order: the readout counted them at the time that it had come to.
    pub late: u64,
    /// Detections that were output.
    pub detections: u64,
    /// Detections among these that were output during a silence which an event then interrupted, because it arrived
    /// later than the guard time; the detections of the recording were output after them.
    pub wrong: u64,
    /// Detections that [`Live::next`](super::Live::next) did not read in time; the sinks received them.
    pub detections_dropped: u64,
    /// Whether a tare is being measured.
    pub taring: bool,
    /// Since when what is at rest is outside the noise floor of the training, if it was so far; known of frames.
    pub left_floor: Option<LeftFloor>,
}

/// When the board was last received, at which time of its clock, and its start and stop markers.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct BoardState {
    /// The relation of the host's clock to the board's; from the first datagram on.
    pub offset: Option<Offset>,
    /// The drift and the delays that arrivals show, and whether they can be, four times a second.
    pub pace: Option<Pace>,
    /// When the latest datagram arrived, ns since 1970.
    pub arrived_ns: Option<i64>,
    /// The longest interval between two heartbeats of a board of version 2 since it began or was reset, us.
    pub heartbeat_us: Option<i64>,
    /// The latest stamp, us.
    pub board_us: Option<i64>,
    /// Number of start and stop markers.
    pub markers: u64,
    /// Whether the last marker was a start; `None` before the first.
    pub marked_start: Option<bool>,
}

/// Without any datagram for so long a source is quiet, ns.
const QUIET_NS: i64 = 1_000_000_000;

/// A source with heartbeats is lost after so many of the longest intervals between them, and after this time at least, ns.
const MISSING_HEARTBEATS: i64 = 3;
const LOST_NS: i64 = 500_000_000;

/// Whether datagrams arrive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ArrivalState {
    /// None has arrived so far.
    Nothing,
    /// They arrive.
    Arriving,
    /// None for a while from a board that sends no heartbeats.
    Quiet,
    /// None from a board whose heartbeats should have arrived.
    Lost,
}

/// Whether datagrams arrive, since when none do, and how long they may be missing.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Arrival {
    /// Whether they arrive.
    pub state: ArrivalState,
    /// When the latest one arrived, ns since 1970.
    pub since_ns: Option<i64>,
    /// How long ago that was, s.
    pub silent_s: f64,
    /// The longest interval between two heartbeats, us.
    pub heartbeat_us: Option<i64>,
}

impl Counters {
    /// Whether datagrams arrive, at `now_ns` since 1970.
    #[must_use]
    pub fn arrival(&self, now_ns: i64) -> Arrival {
        let silent_ns = self.board.arrived_ns.map_or(0, |arrived_ns| (now_ns - arrived_ns).max(0));
        let lost_ns = self.board.heartbeat_us.map(|interval| (MISSING_HEARTBEATS * interval * 1000).max(LOST_NS));
        let state = match (self.board.arrived_ns, lost_ns) {
            (None, _) => ArrivalState::Nothing,
            (Some(_), Some(lost_ns)) if silent_ns > lost_ns => ArrivalState::Lost,
            (Some(_), None) if silent_ns > QUIET_NS => ArrivalState::Quiet,
            _ => ArrivalState::Arriving,
        };
        #[allow(clippy::cast_precision_loss)]
        let silent_s = silent_ns as f64 / 1e9;
        Arrival { state, since_ns: self.board.arrived_ns, silent_s, heartbeat_us: self.board.heartbeat_us }
    }

    /// Whether no datagram has arrived, not even one that was lost.
    #[must_use]
    pub fn nothing_came(&self) -> bool {
        let lines = self.lines.as_ref().map_or(0, |counts| counts.lines);
        self.capture.messages + self.capture.dropped_by_kernel.known() + lines == 0
    }

    /// The difference from earlier counts. Clocks, versions and latencies are the current ones; datagrams that still
    /// wait are left out.
    #[must_use]
    pub(super) fn since(&self, earlier: &Self) -> Self {
        let decoded = self.decoding.decoded - earlier.decoding.decoded;
        let (now, before) = (&self.capture, &earlier.capture);
        let dropped_by_queue = now.dropped_by_queue - before.dropped_by_queue;
        let datagrams = decoded + dropped_by_queue;
        let capture = capture::CaptureCounts {
            // A message may have arrived whose datagrams still wait.
            messages: if datagrams == 0 { 0 } else { (now.messages - before.messages).max(1) },
            datagrams,
            bytes: now.bytes - before.bytes,
            dropped_by_kernel: now.dropped_by_kernel.since(before.dropped_by_kernel),
            dropped_by_queue,
            bytes_dropped_by_queue: now.bytes_dropped_by_queue - before.bytes_dropped_by_queue,
            changes_between_senders: now.changes_between_senders - before.changes_between_senders,
            changes_of_address: now.changes_of_address - before.changes_of_address,
            waiting: 0,
            ..*now
        };
        Self {
            capture,
            lines: self.lines.as_ref().map(|now| earlier.lines.as_ref().map_or_else(|| now.clone(), |l| now.since(l))),
            decoding: self.decoding.since(&earlier.decoding),
            readout: self.readout.since(&earlier.readout),
            board: BoardState { markers: self.board.markers - earlier.board.markers, ..self.board.clone() },
            seconds: self.seconds - earlier.seconds,
            ..self.clone()
        }
    }
}

impl DecodingCounts {
    fn since(&self, earlier: &Self) -> Self {
        counts_since! {
            self, earlier;
            decoded, wire_late, events, frames;
            wire: self.wire.since(&earlier.wire),
            wire_version: self.wire_version,
            wire_v2: self.wire_v2.since(&earlier.wire_v2),
            totals: self.totals.since(&earlier.totals),
            wire_steps: vec![],
        }
    }
}

impl ReadoutCounts {
    fn since(&self, earlier: &Self) -> Self {
        counts_since! {
            self, earlier;
            read_out, events_dropped, late, detections, wrong, detections_dropped;
            taring: self.taring,
            left_floor: self.left_floor,
        }
    }
}

/// How a [`Live`](super::Live) ended.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LiveSummary {
    /// The final counts, whose sums are complete.
    pub counters: Counters,
    /// The verdict: nothing lost after arrival, what was lost where, or that nothing arrived.
    pub verdict: Verdict,
    /// The file, if something was recorded: if nothing arrived, a new file is removed and an earlier one is unchanged.
    pub path: Option<PathBuf>,
    /// The fresh tare, where one was completed.
    pub tare: Option<Tare>,
}
