//! The counts of the pipeline, and how it ended.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::Serialize;
use taxel_core::encode::Tare;
use taxel_core::wire;

use super::sending::Sent;
use crate::bridged::Bridged;
use crate::capture;
use crate::clock::Offset;
use crate::latency::Quantiles;

/// Counts of what arrived, how it was processed, and what was lost at which stage.
///
/// Once [`Live::stop`](super::Live::stop) has returned, `capture.datagrams = decoded + capture.dropped_by_queue` and
/// `wire.bytes = 5 wire.words + wire.skipped`; if there is a readout, `events = read_out + events_dropped`.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Counters {
    /// Counts of the socket and of the queue behind it.
    pub capture: capture::Counts,
    /// Losses between another computer, which receives the board's datagrams, and this one.
    pub bridged: Option<Bridged>,
    /// Datagrams that were decoded.
    pub decoded: u64,
    /// Counts of the decoder of version 1.
    pub wire: wire::Counts,
    /// The board's version of the wire.
    pub wire_version: u8,
    /// Counts of the decoder of version 2.
    pub wire_v2: wire::v2::Counts,
    /// Bytes of version 1 that were refused because the board sends version 2.
    pub wire_refused: u64,
    /// Number of times that the board changed its version.
    pub wire_changes: u64,
    /// Events of version 2 that arrived after time had advanced without them: their datagram was delayed longer than
    /// the pipeline waits at a gap.
    pub wire_late: u64,
    /// Number of decoded events.
    pub events: u64,
    /// Events that the readout has processed.
    pub read_out: u64,
    /// Events that did not fit in the queue before the readout.
    pub events_dropped: u64,
    /// Events that arrived out of order, or more than 0.1 s after a silence that was assumed: the readout counted them
    /// at the time that it had come to.
    pub late: u64,
    /// Detections that were output.
    pub detections: u64,
    /// Detections among these that were output during a silence which an event then interrupted, because it arrived
    /// later than the guard time; the detections of the recording were output after them.
    pub wrong: u64,
    /// Detections that [`Live::next`](super::Live::next) did not read in time; the sinks received them.
    pub detections_dropped: u64,
    /// Counts of each destination: `sent + lost + waiting = detections`.
    pub sent: Vec<Sent>,
    /// Counts of the recording's other sources.
    pub sources: BTreeMap<String, SourceCounts>,
    /// Latency from the kernel's stamp to the end of decoding, per datagram.
    pub decode_latency: Quantiles,
    /// Latency from `known` to the output, by the board's clock.
    #[serde(rename = "said_latency")]
    pub output_latency: Quantiles,
    /// The relation of the host's clock to the board's; from the first datagram on.
    pub offset: Option<Offset>,
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
    /// Time since the socket was opened, s.
    pub seconds: f64,
    /// Whether a tare is being measured.
    pub taring: bool,
}

impl Counters {
    /// Whether no datagram has arrived, not even one that was lost.
    #[must_use]
    pub fn nothing_came(&self) -> bool {
        self.capture.messages + self.capture.dropped_by_kernel == 0
    }

    /// The difference from earlier counts. Clocks, versions and latencies are the current ones; datagrams that still
    /// wait are left out.
    #[must_use]
    pub(super) fn since(&self, earlier: &Self) -> Self {
        let decoded = self.decoded - earlier.decoded;
        let (now, before) = (&self.capture, &earlier.capture);
        let dropped_by_queue = now.dropped_by_queue - before.dropped_by_queue;
        let datagrams = decoded + dropped_by_queue;
        let capture = capture::Counts {
            // A message may have arrived whose datagrams still wait.
            messages: if datagrams == 0 { 0 } else { (now.messages - before.messages).max(1) },
            datagrams,
            bytes: now.bytes - before.bytes,
            dropped_by_kernel: now.dropped_by_kernel - before.dropped_by_kernel,
            dropped_by_queue,
            bytes_dropped_by_queue: now.bytes_dropped_by_queue - before.bytes_dropped_by_queue,
            waiting: 0,
            ..*now
        };
        Self {
            capture,
            bridged: self.bridged.map(|now| now.since(&earlier.bridged.unwrap_or_default())),
            decoded,
            wire: self.wire.since(&earlier.wire),
            wire_v2: self.wire_v2.since(&earlier.wire_v2),
            wire_refused: self.wire_refused - earlier.wire_refused,
            wire_changes: self.wire_changes - earlier.wire_changes,
            wire_late: self.wire_late - earlier.wire_late,
            events: self.events - earlier.events,
            read_out: self.read_out - earlier.read_out,
            events_dropped: self.events_dropped - earlier.events_dropped,
            late: self.late - earlier.late,
            detections: self.detections - earlier.detections,
            wrong: self.wrong - earlier.wrong,
            detections_dropped: self.detections_dropped - earlier.detections_dropped,
            markers: self.markers - earlier.markers,
            seconds: self.seconds - earlier.seconds,
            ..self.clone()
        }
    }
}

/// How a [`Live`](super::Live) ended.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// The final counts, whose sums are complete.
    pub counters: Counters,
    /// The verdict in one line: nothing lost after arrival, what was lost where, or that nothing arrived.
    pub verdict: String,
    /// The file, if something was recorded: if nothing arrived, a new file is removed and an earlier one is unchanged.
    pub path: Option<PathBuf>,
    /// The fresh tare, where one was completed.
    pub tare: Option<Tare>,
}

/// Counts of what arrived from a source, and of what was lost.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum SourceCounts {
    /// The counts of a board's pipeline.
    Board(Box<Counters>),
    /// The counts of a stream of numbers.
    Numbers {
        /// Number of lines, or of samples passed by a program.
        lines: u64,
        /// Number of lines that could not be parsed; they are recorded as they arrived.
        strange: u64,
        /// The system's last error, if reading failed.
        trouble: Option<String>,
    },
}
