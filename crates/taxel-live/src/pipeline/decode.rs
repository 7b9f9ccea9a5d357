//! The second thread: decodes what was received, hands the events on, and records.

use std::time::{Duration, Instant};

use taxel_core::Events;
use taxel_core::wire::{Receiver, Took};

use super::handover;
use super::options::LiveOptions;
use super::shared::Shared;
use crate::Result;
use crate::capture::Batch;
use crate::clock::BoardClock;
use crate::recording::now_ns;

/// How often those who look on get a new picture, the recording too.
const PICTURE_EVERY: Duration = Duration::from_millis(100);

/// How often an unfinished recording learns what was lost.
const COUNTS_EVERY: Duration = Duration::from_secs(1);

/// In silence the readout's time is moved on this often at most, and once a frame where frames are longer.
const TICK: Duration = Duration::from_micros(500);

/// How long to wait for datagrams where silence means nothing.
const IDLE: Duration = Duration::from_millis(20);

/// Events are handed on when so many are there, also in the middle of a large batch.
const HAND_ON: usize = 1 << 14;

/// The largest datagram of a board that closes frames with a shorter one: 280 events.
const FULL: usize = 280 * taxel_core::wire::WORD_BYTES;

pub(super) fn run(shared: &Shared, sender: Receiver, options: &LiveOptions, listens: bool) {
    let mut work = Work {
        shared,
        sender,
        repaired: vec![],
        promise: Promise::default(),
        options,
        listens,
        clock: BoardClock::default(),
        events: Events::empty(options.array.clone()),
        held: vec![0; options.array.len()],
        has_intensities: false,
        decoded: 0,
        counted: 0,
        tared: false,
        pictured: Instant::now(),
        told: Instant::now(),
    };
    if let Err(error) = work.all() {
        shared.fail(error);
    }
    shared.handover.close();
    if !listens {
        shared.ended.store(true, std::sync::atomic::Ordering::Release);
    }
}

struct Work<'a> {
    shared: &'a Shared,
    sender: Receiver,
    /// For each event that waits whether a state repaired it (version 2).
    repaired: Vec<bool>,
    promise: Promise,
    options: &'a LiveOptions,
    listens: bool,
    clock: BoardClock,
    events: Events,
    held: Vec<u16>,
    /// Whether any intensity has come: from then on every piece has the column, so that a lost one is one missing value.
    has_intensities: bool,
    decoded: u64,
    counted: u64,
    /// Whether the recorder knows the tare.
    tared: bool,
    pictured: Instant,
    told: Instant,
}

/// What a board of version 2 has promised: nothing before it comes any more.
#[derive(Debug, Clone, Copy, Default)]
struct Promise {
    until: Option<i64>,
    /// Numbers that had not come when a gap was last waited for, and until when (us, host) it is.
    missing: u64,
    waits: Option<i64>,
}

impl Promise {
    /// A datagram came. At a gap what it promises waits for a frame: the missing ones may only be late.
    fn note(&mut self, took: &Took, arrived_us: i64, frame_us: i64) {
        if took.reset || took.missing < self.missing {
            (self.missing, self.waits) = (took.missing, None);
        } else if took.missing > self.missing {
            (self.missing, self.waits) = (took.missing, Some(arrived_us + frame_us));
        }
        if self.waits.is_some_and(|until| arrived_us >= until) {
            self.waits = None;
        }
        if self.waits.is_none() {
            self.until = took.until.or(self.until);
        }
    }

    fn take(&mut self) -> Option<i64> {
        self.until.take()
    }
}

impl Work<'_> {
    fn all(&mut self) -> Result<()> {
        let frame_us = self.options.registers.frame_us();
        let tick = if self.listens { TICK.max(Duration::from_secs_f64(frame_us * 1e-6)) } else { IDLE };
        let mut batch = Batch::new();
        while !self.shared.receiver.is_done() {
            if self.shared.receiver.take(&mut batch, tick)? {
                self.decode(&batch)?;
                if let Some(recorder) = &self.shared.recorder {
                    recorder.datagrams(&batch)?;
                }
            } else {
                self.silence();
            }
            self.look()?;
        }
        self.sender.finish_into(&mut self.events, &mut self.repaired);
        self.hand_on()?;
        self.silence();
        Ok(())
    }

    fn decode(&mut self, batch: &Batch) -> Result<()> {
        for (datagram, bytes) in batch.iter() {
            let before = self.events.len();
            let arrived_us = datagram.arrived_ns / 1000;
            let took = self.sender.push(bytes, Some(arrived_us), &mut self.events, &mut self.repaired);
            let now = now_ns();
            self.decoded += 1;
            if took.version == 2 {
                self.promise.note(&took, arrived_us, self.frame_us());
                if let Some(until) = took.until {
                    self.clock.note(until, datagram.arrived_ns);
                }
            } else if let Some(&t) = self.events.t[before..].last() {
                // What a frame saw leaves at its end, but for a full datagram, which leaves as soon as it is full.
                if bytes.len() < FULL {
                    self.clock.note(t + self.frame_us(), datagram.arrived_ns);
                }
            }
            self.shared.shown().decode_latency.note(now - datagram.arrived_ns);
            if self.events.len() >= HAND_ON {
                self.hand_on()?;
            }
        }
        self.hand_on()
    }

    #[allow(clippy::cast_possible_truncation)]
    fn frame_us(&self) -> i64 {
        self.options.registers.frame_us() as i64
    }

    /// Hands the events on to the readout, and tells those who look on.
    fn hand_on(&mut self) -> Result<()> {
        let events = &mut self.events;
        if let Some(intensity) = &events.intensity {
            self.has_intensities = true;
            for k in 0..events.t.len() {
                if intensity.present[k] {
                    self.held[events.array.index(events.x[k], events.y[k])] = intensity.ticks[k];
                }
            }
        }
        if let Some(recorder) = &self.shared.recorder {
            events.markers.iter().try_for_each(|m| recorder.marker(*m))?;
        }
        {
            let mut shown = self.shared.shown();
            shown.markers.extend_from_slice(&events.markers);
            let counters = &mut shown.counters;
            counters.decoded = self.decoded;
            counters.wire = *self.sender.counts();
            counters.wire_v2 = self.sender.two().counts();
            counters.wire_version = self.sender.version();
            counters.wire_refused = self.sender.refused();
            counters.wire_changes = self.sender.changes();
            counters.events += events.len() as u64;
            counters.offset = self.clock.offset();
            counters.board_us = counters.board_us.max(events.t.iter().max().copied());
            counters.markers += events.markers.len() as u64;
            counters.marked_start = events.markers.last().map(|m| m.start).or(counters.marked_start);
        }
        if self.listens {
            let dropped = self.shared.handover.put(events);
            self.shared.shown().counters.events_dropped = dropped;
        }
        handover::clear(events);
        self.repaired.clear();
        if let Some(until) = self.promise.take().filter(|_| self.listens) {
            self.shared.handover.quiet(until);
        }
        if self.has_intensities {
            events.intensity.get_or_insert_default();
        }
        Ok(())
    }

    /// Nothing waits: of a board that makes no promises the readout's time may move on by the host's clock.
    #[allow(clippy::cast_possible_truncation)]
    fn silence(&self) {
        if self.listens
            && self.sender.version() == 1
            && let Some(offset) = self.clock.offset()
        {
            let guard = (self.options.guard_frames * self.options.registers.frame_us()) as i64;
            // What a frame sees leaves at its end: before the start of the frame that ends now all has come.
            self.shared.handover.quiet(offset.board_us(now_ns()) - self.frame_us() - guard);
        }
    }

    /// What others look at, at their own pace.
    fn look(&mut self) -> Result<()> {
        if self.pictured.elapsed() < PICTURE_EVERY {
            return Ok(());
        }
        self.pictured = Instant::now();
        let new = self.decoded != self.counted;
        self.counted = self.decoded;
        let (counters, tare) = {
            let mut shown = self.shared.shown();
            shown.picture.copy_from_slice(&self.held);
            let tare = if self.tared { None } else { shown.tare.clone() };
            (shown.counters.clone(), tare)
        };
        let Some(recorder) = &self.shared.recorder else { return Ok(()) };
        if let Some(tare) = tare {
            recorder.tare(&tare)?;
            self.tared = true;
        }
        recorder.flush()?;
        if new && let Some(board_us) = counters.board_us {
            recorder.picture(board_us, self.options.array.columns, &self.held)?;
        }
        if self.told.elapsed() >= COUNTS_EVERY {
            self.told = Instant::now();
            let capture = self.shared.receiver.counts();
            recorder.so_far(&super::Counters { capture, ..counters })?;
        }
        Ok(())
    }
}
