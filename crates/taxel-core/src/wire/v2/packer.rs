//! Encodes events as datagrams of version 2, as the board sends them.

use super::event_words::{EventWords, marker_body};
use super::{BoardTotals, BodyKind, DIFFERENCES, DROPPED, DatagramHeader, FRAME_SYNC, Layout, checked_stride};
use crate::{Array, Result, problem};

/// For how long after an event the end of every frame is promised, us.
const RESTLESS_US: u64 = 100_000;

/// The settings that a board's datagrams share.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// Number of the board.
    pub board: u16,
    /// Random number drawn at each reset.
    pub session: u16,
    /// The kind in which its events are sent: changes without values, with small or with large values.
    pub kind: BodyKind,
    /// All events of a frame carry its time.
    pub frame_sync: bool,
    /// Values are differences.
    pub differences: bool,
    /// Longest time that an event may wait for more events, us; 0 sends each frame at its end.
    pub hold_us: u64,
    /// Interval between promises while there are no events, us.
    pub heartbeat_us: u64,
}

/// Gathers events into datagrams; [`Packer::take`] takes those that are complete, each with its number of events.
///
/// Times are us since reset and never decrease; within one time and line, rows ascend.
#[derive(Debug, Clone)]
pub struct Packer {
    settings: Settings,
    stride: u8,
    sequence: u32,
    /// Events were dropped since the last datagram was begun.
    dropped: bool,
    /// Events were dropped before the current datagram was begun, and after the one before it.
    after_loss: bool,
    words: EventWords,
    /// No later event is before this time, us.
    promised: u64,
    last_event: Option<u64>,
    complete: Vec<(Vec<u8>, usize)>,
}

impl Packer {
    /// A packer at reset.
    ///
    /// # Errors
    ///
    /// `Problem` if the array's positions need more than 16 bits, or the kind is not one of events.
    pub fn new(settings: Settings, array: &Array) -> Result<Self> {
        let stride = checked_stride(array)?;
        let words = EventWords::new(layout(settings.kind)?, stride);
        Ok(Self {
            settings,
            stride,
            sequence: 0,
            dropped: false,
            after_loss: false,
            words,
            promised: 0,
            last_event: None,
            complete: vec![],
        })
    }

    /// Continues with other settings; no event may be waiting ([`Self::flush`]), and the kind must be one of events.
    pub(crate) fn follow(&mut self, settings: Settings) {
        debug_assert_eq!(self.waiting(), 0);
        if let Ok(layout) = layout(settings.kind) {
            (self.settings, self.words) = (settings, EventWords::new(layout, self.stride));
        }
    }

    /// Number of events in the current datagram.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.words.events
    }

    /// Takes the datagrams that are complete, in the order of their numbers, each with its number of events.
    pub fn take(&mut self) -> impl Iterator<Item = (Vec<u8>, usize)> {
        self.complete.drain(..)
    }

    /// Notes that an event was dropped; the next datagram that is begun carries the flag.
    pub fn dropped(&mut self) {
        self.dropped = true;
    }

    /// Adds an event.
    pub fn event(&mut self, t: u64, taxel: (u16, u16), p: bool, value: u16) {
        if !self.words.takes(t as i64, taxel) {
            self.flush(t);
        }
        if self.waiting() == 0 {
            self.after_loss = std::mem::take(&mut self.dropped);
        }
        self.words.add(t as i64, taxel, p, value);
        self.last_event = Some(t);
    }

    /// Ends a frame: every event before `now` was added, and the next frame ends at `next`. Sends what is due: events,
    /// or a heartbeat. Without a hold time no event waits, even where two frames end within a microsecond.
    pub fn over(&mut self, now: u64, next: u64) {
        if self.waiting() > 0 {
            if self.settings.hold_us == 0 || next - self.words.base as u64 > self.settings.hold_us {
                self.flush(now);
            }
            return;
        }
        let restless = self.last_event.is_some_and(|t| now - t <= RESTLESS_US);
        if now > self.promised && (restless || now - self.promised >= self.settings.heartbeat_us) {
            self.send(now.saturating_sub(u64::from(u16::MAX)).max(self.promised), now);
        }
    }

    /// Sends the events that wait, regardless of the hold time.
    pub fn flush(&mut self, now: u64) {
        if self.waiting() > 0 {
            self.send(self.words.base as u64, now);
        }
    }

    /// Sends the start or stop of a recording, after the events that wait.
    pub fn marker(&mut self, t: u64, start: bool) {
        self.flush(t);
        self.write(BodyKind::Markers, (t, 0, 0), &marker_body(start), 0);
    }

    /// Sends the board's totals; the packer itself fills in the number of datagrams.
    pub fn status(&mut self, t: u64, status: &BoardTotals) {
        self.flush(t);
        let totals = [status.frames, status.events, status.dropped, self.sequence.into(), status.faults];
        let body: Vec<u8> = totals.iter().flat_map(|total| total.to_le_bytes()).collect();
        self.write(BodyKind::Status, (t, 0, 0), &body, 0);
    }

    /// Sends values again as states: taxels by ascending position, each with the value that the board compares with.
    pub fn states(&mut self, t: u64, taxels: impl Iterator<Item = ((u16, u16), u16)>) {
        self.flush(t);
        let kind = if self.settings.kind == BodyKind::Small { BodyKind::SmallStates } else { BodyKind::LargeStates };
        let Some(layout) = kind.layout() else { return };
        let mut words = EventWords::new(layout, self.stride);
        for (taxel, value) in taxels {
            if !words.takes(t as i64, taxel) {
                let EventWords { bytes, line, .. } = words.take();
                self.write(kind, (t, line, 0), &bytes, 0);
            }
            words.add(t as i64, taxel, false, value);
        }
        if words.events > 0 {
            self.write(kind, (t, words.line, 0), &words.bytes, 0);
        }
    }

    /// Sends the events that wait, if any, with the promise that no later event is before `now`.
    fn send(&mut self, base: u64, now: u64) {
        let (EventWords { bytes, line, events, .. }, kind) = (self.words.take(), self.settings.kind);
        let longest = u64::from(u16::MAX);
        let span = (now - base).min(longest);
        self.write(kind, (base, line, span as u16), &bytes, events);
        self.promised = self.promised.max(base + span);
        if now - base > longest {
            // A promise that exceeds 16 bits is sent as an empty datagram with a later base.
            self.write(kind, (now - longest, 0, u16::MAX), &[], 0);
            self.promised = now;
        }
    }

    /// Sends a body whose times count from a base and positions from a line, with its span.
    fn write(&mut self, kind: BodyKind, (base, line, span): (u64, u8, u16), body: &[u8], events: usize) {
        let Settings { board, session, frame_sync, differences, .. } = self.settings;
        let flag = |set: bool, bit: u8| if set { bit } else { 0 };
        let after_loss = if events > 0 { self.after_loss } else { std::mem::take(&mut self.dropped) };
        let states = matches!(kind, BodyKind::SmallStates | BodyKind::LargeStates);
        let header = DatagramHeader {
            kind: kind.number(),
            board,
            sequence: self.sequence,
            base,
            session,
            stride: self.stride,
            line,
            flags: flag(frame_sync, FRAME_SYNC) | flag(differences && !states, DIFFERENCES) | flag(after_loss, DROPPED),
            span,
        };
        self.sequence = self.sequence.wrapping_add(1);
        self.complete.push((header.datagram(body), events));
    }
}

/// The layout of the words of a kind of events.
fn layout(kind: BodyKind) -> Result<Layout> {
    match kind {
        BodyKind::Changes | BodyKind::Small | BodyKind::Large => kind.layout(),
        _ => None,
    }
    .ok_or_else(|| problem!("events can be sent only as changes, small changes or large changes"))
}
