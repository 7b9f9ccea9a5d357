//! The second stage: decodes datagrams to events, and tracks the taxels' values and the board's clock.

use std::time::Duration;

use taxel_core::Events;
use taxel_core::held::Held;
use taxel_core::wire::{DatagramInfo, Decoder, STAMP_US, SenderDecoder};

use super::counters::Counters;
use super::options::LiveOptions;
use super::readout_queue::QuietUntil;
use crate::capture::Datagram;
use crate::clock::{BoardClock, Offset, Pace, leaves};
use crate::recording::now_ns;

/// Shortest interval at which the readout's time is advanced during silence; if frames are longer, it is advanced once
/// per frame.
const TICK: Duration = Duration::from_micros(500);

/// How long to wait at a gap in the sequence of version 2, frames: the data may only be late.
const GAP_FRAMES: f64 = 1.0;

/// How far the readout stays behind the host's clock in a silence, unless that is stated, frames.
const GUARD_FRAMES: f64 = 3.0;

pub(super) struct DecodeStage {
    pub(super) decoder: SenderDecoder,
    promise: Promise,
    arrivals: Heartbeats,
    clock: BoardClock,
    /// What the clock showed when its last stretch ended.
    pace: Option<Pace>,
    /// When the latest datagram with events could leave the board, us, and when it arrived, ns since 1970.
    sent: Option<(i64, i64)>,
    /// Events that were decoded and not passed on yet.
    pub(super) events: Events,
    pub(super) held: Held,
    /// The board's time of the latest datagram, us.
    pub(super) latest: Option<i64>,
    pub(super) frame_us: f64,
    guard_frames: f64,
    /// Whether any intensity has arrived: from then on every piece has the column, so that a lost one is one missing value.
    has_intensities: bool,
    pub(super) decoded: u64,
    late: u64,
}

/// A datagram that was decoded.
pub(super) struct DecodedDatagram {
    pub(super) info: DatagramInfo,
    pub(super) arrived_ns: i64,
    bytes: usize,
    /// Indices of the datagram's first event and first marker among those that were not passed on.
    first: (usize, usize),
}

/// The time before which a board of version 2 has promised to send no more events.
#[derive(Debug, Clone, Copy, Default)]
struct Promise {
    until: Option<i64>,
    /// Missing sequence numbers at the last gap for which the pipeline waited, and until when it waits (us, host).
    missing: u64,
    waits: Option<i64>,
}

impl Promise {
    /// Processes a datagram's promise. At a gap the promise takes effect a frame later: the missing datagrams may only
    /// be late.
    fn note(&mut self, info: &DatagramInfo, arrived_us: i64, gap_us: i64) {
        if info.reset || info.missing < self.missing {
            (self.missing, self.waits) = (info.missing, None);
        } else if info.missing > self.missing {
            (self.missing, self.waits) = (info.missing, Some(arrived_us + gap_us));
        }
        if self.waits.is_some_and(|until| arrived_us >= until) {
            self.waits = None;
        }
        if self.waits.is_none() {
            self.until = info.until.or(self.until);
        }
    }
}

/// The latest arrival, and the heartbeats of a board of version 2.
#[derive(Debug, Clone, Copy, Default)]
struct Heartbeats {
    latest_ns: Option<i64>,
    /// The board's time of the latest datagram, us, and missing sequence numbers up to there.
    now: Option<i64>,
    missing: u64,
    /// The longest interval that a heartbeat has ended, us.
    heartbeat_us: Option<i64>,
}

impl Heartbeats {
    /// Notes a datagram; `empty`: without events, which in version 2 is a heartbeat.
    fn note(&mut self, info: &DatagramInfo, arrived_ns: i64, empty: bool) {
        self.latest_ns = self.latest_ns.max(Some(arrived_ns));
        if info.reset || info.version != 2 {
            (self.now, self.heartbeat_us) = (None, None);
        }
        // A gap in the sequence is no interval that the board chose.
        if let Some((before, now)) = self.now.zip(info.now).filter(|_| empty && info.missing == self.missing) {
            self.heartbeat_us = self.heartbeat_us.max(Some(now - before).filter(|&interval| interval > 0));
        }
        (self.now, self.missing) = (info.now.filter(|_| info.version == 2), info.missing);
    }
}

impl DecodeStage {
    pub(super) fn new(options: &LiveOptions) -> Self {
        Self {
            decoder: SenderDecoder::new(Decoder::new(options.array.clone()).differences(options.differences), 1),
            promise: Promise::default(),
            arrivals: Heartbeats::default(),
            clock: BoardClock::default(),
            pace: None,
            sent: None,
            events: Events::empty(options.array.clone()),
            held: Held::unknown(options.array.len()),
            latest: None,
            frame_us: options.registers.frame_us(),
            guard_frames: options.guard_frames.unwrap_or(GUARD_FRAMES),
            has_intensities: false,
            decoded: 0,
            late: 0,
        }
    }

    /// Decodes a datagram. After a reset ([`DatagramInfo::reset`]) the caller must first pass on the events before it
    /// ([`DecodeStage::split_at_reset`]), and then continue with [`DecodeStage::note`], as for every datagram.
    pub(super) fn push(&mut self, datagram: &Datagram, bytes: &[u8]) -> DecodedDatagram {
        let first = (self.events.len(), self.events.markers.len());
        let arrived_ns = datagram.arrived_ns;
        let info = self.decoder.push(bytes, Some(arrived_ns / 1000), &mut self.events);
        DecodedDatagram { info, arrived_ns, bytes: bytes.len(), first }
    }

    /// Removes and returns the events after a reset; those before it stay.
    pub(super) fn split_at_reset(&mut self, decoded: &mut DecodedDatagram) -> Events {
        let (rows, markers) = std::mem::take(&mut decoded.first);
        self.events.split_off(rows, markers)
    }

    /// Handles a reset of the board: the taxels' values become unknown; continues with the events after it.
    pub(super) fn reset(&mut self, later: &Events) {
        self.held.clear();
        self.events.append(later, later.len());
    }

    /// Counts a datagram, and takes from it the board's clock and its promise. `announced` is the time up to which the readout was
    /// informed that no more events will follow, us: events before it are late.
    #[allow(clippy::cast_possible_truncation)]
    pub(super) fn note(&mut self, decoded: &DecodedDatagram, announced: Option<i64>) {
        let DecodedDatagram { info, arrived_ns, bytes, first: (row, _) } = decoded;
        self.decoded += 1;
        self.latest = info.now.or(self.latest);
        self.arrivals.note(info, *arrived_ns, self.events.len() == *row);
        if info.version == 2 {
            let announced = announced.filter(|_| !info.reset);
            let late = self.events.t[*row..].iter().filter(|&&t| announced.is_some_and(|until| t < until));
            self.late += late.count() as u64;
            self.promise.note(info, arrived_ns / 1000, (GAP_FRAMES * self.frame_us) as i64);
        }
        let last = self.events.t[*row..].last().copied();
        let left = leaves(info, last, *bytes, self.frame_us());
        self.sent = left.or(last).map(|left| (left, *arrived_ns)).or(self.sent);
        if let Some(left) = left
            && self.clock.note(left, *arrived_ns)
        {
            self.pace = self.clock.pace();
        }
    }

    /// Where a recording that begins with this datagram begins on the board's clock, us, if the datagram shows it.
    pub(super) fn origin(&self, decoded: &DecodedDatagram) -> Option<i64> {
        let (row, marker) = decoded.first;
        let marked = self.events.markers.get(marker).map(|marker| marker.t);
        self.decoder.origin(self.events.t.get(row).copied().into_iter().chain(marked).min())
    }

    /// Holds the values of the events that are about to be handed on.
    pub(super) fn update_held(&mut self) {
        self.has_intensities |= self.events.intensity.is_some();
        self.held.push(self.events.view());
    }

    /// The time before which the board has newly promised no more events, us.
    pub(super) fn take_promise(&mut self) -> Option<i64> {
        self.promise.until.take()
    }

    /// Clears the events that were passed on.
    pub(super) fn clear(&mut self) {
        self.events.clear();
        if self.has_intensities {
            self.events.intensity.get_or_insert_default();
        }
    }

    /// Ends the stream: the last event no longer waits for its intensity.
    pub(super) fn finish(&mut self) {
        self.decoder.finish_into(&mut self.events);
    }

    /// Writes the stage's counts.
    pub(super) fn publish(&self, counters: &mut Counters) {
        counters.decoding.decoded = self.decoded;
        counters.decoding.wire = *self.decoder.counts();
        counters.decoding.wire_v2 = self.decoder.version_2().counts();
        counters.decoding.wire_version = self.decoder.version();
        counters.decoding.wire_late = self.late;
        counters.decoding.totals = *self.decoder.totals();
        self.decoder.steps_back().clone_into(&mut counters.decoding.wire_steps);
        counters.decoding.events += self.events.len() as u64;
        counters.board.arrived_ns = self.arrivals.latest_ns;
        counters.board.heartbeat_us = self.arrivals.heartbeat_us;
        counters.board.offset = self.clock.offset();
        counters.board.pace.clone_from(&self.pace);
        counters.board.board_us = counters.board.board_us.max(self.events.t.iter().max().copied());
        counters.board.markers += self.events.markers.len() as u64;
        counters.board.marked_start = self.events.markers.last().map(|m| m.start).or(counters.board.marked_start);
    }

    /// Sets the version of the wire to which the board was set; returns whether it is a different one.
    pub(super) fn expect(&mut self, version: u8) -> bool {
        let changed = version != self.decoder.version();
        if changed {
            self.decoder.expect(version, &mut self.events);
        }
        changed
    }

    #[allow(clippy::cast_possible_truncation)]
    fn frame_us(&self) -> i64 {
        self.frame_us as i64
    }

    /// How long to wait for data before the readout's time is advanced; only for version 1, which has no promises. Until the
    /// guard of the latest events has passed, nothing more is known of them.
    pub(super) fn tick(&self) -> Option<Duration> {
        if self.decoder.version() != 1 {
            return None;
        }
        // A spike comes a little after the event that causes it.
        let guard_ns = 1000 * (self.guard_us().min(i64::from(u32::MAX)) + STAMP_US / 2);
        let guarded_ns = self.sent.map_or(0, |(_, arrived_ns)| arrived_ns + guard_ns - now_ns());
        let interval = TICK.max(Duration::from_secs_f64(self.frame_us * 1e-6));
        Some(u64::try_from(guarded_ns).map_or(interval, Duration::from_nanos))
    }

    /// The board's time before which everything has arrived, if nothing arrived until `until_ns`: the latest datagram's, and as
    /// much as has passed since on the host's clock. A sender that lags its own clock is not assumed to have caught up.
    pub(super) fn quiet_until(&self, until_ns: Option<i64>) -> Option<QuietUntil> {
        if self.decoder.version() != 1 {
            return None;
        }
        let (board_us, host_ns) = self.sent?;
        let since = Offset { board_us, host_ns, ..self.clock.offset().unwrap_or_default() };
        // Events of a frame are sent at its end: all events before the start of the frame that ends now have arrived.
        Some(QuietUntil::ByHostClock(since.board_us(until_ns?) - self.frame_us() - self.guard_us()))
    }

    #[allow(clippy::cast_possible_truncation)]
    fn guard_us(&self) -> i64 {
        (self.guard_frames * self.frame_us) as i64
    }
}
