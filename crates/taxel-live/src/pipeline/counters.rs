//! What the pipeline counts, and how it ended.

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

/// What arrived, what became of it, and what was lost where.
///
/// Once [`Live::stop`](super::Live::stop) has returned, `capture.datagrams = decoded + capture.dropped_by_queue` and
/// `wire.bytes = 5 wire.words + wire.skipped`; `events = read_out + events_dropped` where there is a readout.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Counters {
    /// Counts of the socket and of the queue behind it.
    pub capture: capture::Counts,
    /// Losses between another computer, which receives the board's datagrams, and this one.
    pub bridged: Option<Bridged>,
    /// Datagrams that were decoded.
    pub decoded: u64,
    /// What the decoder saw in them.
    pub wire: wire::Counts,
    /// The version of the wire that the board speaks.
    pub wire_version: u8,
    /// What arrived and what was missing of version 2.
    pub wire_v2: wire::v2::Counts,
    /// Bytes of version 1 that were refused, because the board speaks version 2.
    pub wire_refused: u64,
    /// How often the board changed its version.
    pub wire_changes: u64,
    /// Events of version 2 that arrived when time had gone on without them: their datagram was overtaken by more than a gap is
    /// waited for.
    pub wire_late: u64,
    /// Events that it gave.
    pub events: u64,
    /// Events that the readout has processed.
    pub read_out: u64,
    /// Events that found no room before the readout.
    pub events_dropped: u64,
    /// Events that arrived out of order, or more than 0.1 s after a silence that was assumed: the readout counted them
    /// at the time that it had come to.
    pub late: u64,
    /// Detections that were output.
    pub detections: u64,
    /// Those among them that were output in a silence which an event then interrupted: it came later than the guard, and the
    /// detections of the recording were output after them.
    pub wrong: u64,
    /// Detections that [`Live::next`](super::Live::next) was too slow for; the sinks had them.
    pub detections_dropped: u64,
    /// What went to each destination: `sent + lost + waiting = detections`.
    pub sent: Vec<Sent>,
    /// What arrived of the recording's other sources.
    pub sources: BTreeMap<String, SourceCounts>,
    /// From the kernel's stamp to the end of decoding, a datagram each.
    pub decode_latency: Quantiles,
    /// From `known` to the output, by the board's clock.
    #[serde(rename = "said_latency")]
    pub output_latency: Quantiles,
    /// What the host's clock shows when the board's shows a time; from the first datagram on.
    pub offset: Option<Offset>,
    /// The latest stamp, us.
    pub board_us: Option<i64>,
    /// Starts and stops that the board marked.
    pub markers: u64,
    /// Whether the last marker was a start; `None` before the first.
    pub marked_start: Option<bool>,
    /// Since the socket was opened, s.
    pub seconds: f64,
    /// Whether a tare is being measured.
    pub taring: bool,
}

impl Counters {
    /// Whether not even a datagram that was lost has arrived.
    #[must_use]
    pub fn nothing_came(&self) -> bool {
        self.capture.messages + self.capture.dropped_by_kernel == 0
    }

    /// The counts since an earlier time. Clocks, versions and latencies are those of now; what waits at the end is left out.
    #[must_use]
    pub(super) fn since(&self, earlier: &Self) -> Self {
        let decoded = self.decoded - earlier.decoded;
        let (now, before) = (&self.capture, &earlier.capture);
        let dropped_by_queue = now.dropped_by_queue - before.dropped_by_queue;
        let datagrams = decoded + dropped_by_queue;
        let capture = capture::Counts {
            // A message may have arrived whose datagrams wait.
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
    /// At the end, with closed sums.
    pub counters: Counters,
    /// One line: nothing lost after arrival, what was lost where, or that nothing arrived.
    pub verdict: String,
    /// The file, where something was recorded: one to which nothing arrived is removed, and replaces none.
    pub path: Option<PathBuf>,
    /// The fresh tare, where one was completed.
    pub tare: Option<Tare>,
}

/// What arrived of a source, and what was lost.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum SourceCounts {
    /// Of a board all that is counted of one.
    Board(Box<Counters>),
    /// Of numbers.
    Numbers {
        /// Lines, or samples given.
        lines: u64,
        /// Those that could not be parsed; they are recorded as they arrived.
        strange: u64,
        /// The system's last error, where the line broke.
        trouble: Option<String>,
    },
}
