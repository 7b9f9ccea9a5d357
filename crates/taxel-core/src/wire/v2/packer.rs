//! Encodes events as datagrams of version 2, as the board sends them.

use super::{
    BODY_BYTES, BoardTotals, BodyKind, DATAGRAM_BYTES, DIFFERENCES, DROPPED, DatagramHeader, FRAME_SYNC, LAST_LINE,
    LATEST_OFFSET, Layout, START, STOP, before, checked_stride,
};
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
    word: Layout,
    sequence: u32,
    /// Events were dropped since the last datagram was begun.
    dropped: bool,
    /// Events were dropped before the current datagram was begun, and after the one before it.
    after_loss: bool,
    body: Vec<u8>,
    events: usize,
    base: u64,
    at: u64,
    /// The line from which the positions of the current datagram count.
    line: u8,
    position: i64,
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
        let word = layout(settings.kind)?;
        Ok(Self {
            settings,
            stride,
            word,
            sequence: 0,
            dropped: false,
            after_loss: false,
            body: Vec::with_capacity(BODY_BYTES),
            events: 0,
            base: 0,
            at: 0,
            line: 0,
            position: -1,
            promised: 0,
            last_event: None,
            complete: vec![],
        })
    }

    /// Continues with other settings; no event may be waiting ([`Self::flush`]), and the kind must be one of events.
    pub(crate) fn follow(&mut self, settings: Settings) {
        debug_assert_eq!(self.events, 0);
        if let Ok(word) = layout(settings.kind) {
            (self.settings, self.word) = (settings, word);
        }
    }

    /// Number of events in the current datagram.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.events
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
    pub fn event(&mut self, t: u64, (x, y): (u16, u16), p: bool, value: u16) {
        let position = i64::from(x) << self.stride | i64::from(y);
        if self.events > 0 && (t - self.base > LATEST_OFFSET || self.body.len() + self.bytes(t, position) > BODY_BYTES)
        {
            self.send(t);
        }
        if self.events == 0 {
            (self.base, self.at, self.line) = (t, t, first_line(x));
            self.after_loss = std::mem::take(&mut self.dropped);
            self.position = before(self.line, self.stride);
        }
        let word = self.word;
        if t != self.at || position <= self.position {
            put(&mut self.body, word, true, word.control(), 0);
            let offset = ((t - self.base) as u32).to_le_bytes();
            self.body.extend(&offset[..word.bytes]);
            (self.at, self.position) = (t, -1);
        }
        add(&mut self.body, word, position - self.position - 1, p, value);
        self.position = position;
        self.events += 1;
        self.last_event = Some(t);
    }

    /// Ends a frame: every event before `now` was added, and the next frame ends at `next`. Sends what is due: events,
    /// or a heartbeat. Without a hold time no event waits, even where two frames end within a microsecond.
    pub fn over(&mut self, now: u64, next: u64) {
        if self.events > 0 {
            if self.settings.hold_us == 0 || next - self.base > self.settings.hold_us {
                self.send(now);
            }
            return;
        }
        let restless = self.last_event.is_some_and(|t| now - t <= RESTLESS_US);
        if now > self.promised && (restless || now - self.promised >= self.settings.heartbeat_us) {
            self.base = now.saturating_sub(u64::from(u16::MAX)).max(self.promised);
            self.send(now);
        }
    }

    /// Sends the events that wait, regardless of the hold time.
    pub fn flush(&mut self, now: u64) {
        if self.events > 0 {
            self.send(now);
        }
    }

    /// Sends the start or stop of a recording, after the events that wait.
    pub fn marker(&mut self, t: u64, start: bool) {
        self.flush(t);
        let mut body = vec![0; 4];
        body.extend((if start { START } else { STOP }).to_le_bytes());
        body.extend([0, 0]);
        self.base = t;
        self.write(BodyKind::Markers, &body, (0, 0), 0);
    }

    /// Sends the board's totals; the packer itself fills in the number of datagrams.
    pub fn status(&mut self, t: u64, status: &BoardTotals) {
        self.flush(t);
        let totals = [status.frames, status.events, status.dropped, self.sequence.into(), status.faults];
        let body: Vec<u8> = totals.iter().flat_map(|total| total.to_le_bytes()).collect();
        self.base = t;
        self.write(BodyKind::Status, &body, (0, 0), 0);
    }

    /// Sends values again as states: taxels by ascending position, each with the value that the board compares with.
    pub fn states(&mut self, t: u64, taxels: impl Iterator<Item = ((u16, u16), u16)>) {
        self.flush(t);
        let (kind, word) = match self.settings.kind {
            BodyKind::Small => (BodyKind::SmallStates, Layout { bytes: 2, skip: 7, value: 8 }),
            _ => (BodyKind::LargeStates, Layout { bytes: 4, skip: 15, value: 16 }),
        };
        let (mut body, mut line, mut last) = (Vec::with_capacity(BODY_BYTES), 0, -1);
        self.base = t;
        for ((x, y), value) in taxels {
            let position = i64::from(x) << self.stride | i64::from(y);
            if body.len() + steps(word, position - last - 1) * word.bytes > BODY_BYTES {
                self.write(kind, &body, (line, 0), 0);
                body.clear();
            }
            if body.is_empty() {
                line = first_line(x);
                last = before(line, self.stride);
            }
            add(&mut body, word, position - last - 1, false, value);
            last = position;
        }
        if !body.is_empty() {
            self.write(kind, &body, (line, 0), 0);
        }
    }

    /// Number of bytes that an event takes.
    fn bytes(&self, t: u64, position: i64) -> usize {
        let again = t != self.at || position <= self.position;
        let gap = if again { position } else { position - self.position - 1 };
        self.word.bytes * (steps(self.word, gap) + if again { 2 } else { 0 })
    }

    /// Sends the body, with the promise that no later event is before `now`.
    fn send(&mut self, now: u64) {
        let body = std::mem::take(&mut self.body);
        let span = now - self.base;
        let line = if self.events > 0 { self.line } else { 0 };
        self.write(self.settings.kind, &body, (line, span.min(u64::from(u16::MAX)) as u16), self.events);
        self.promised = self.promised.max(self.base + span.min(u64::from(u16::MAX)));
        self.body = body;
        self.body.clear();
        self.events = 0;
        if span > u64::from(u16::MAX) {
            // A promise that exceeds 16 bits is sent as an empty datagram with a later base.
            self.base = now - u64::from(u16::MAX);
            self.write(self.settings.kind, &[], (0, u16::MAX), 0);
            self.promised = now;
        }
    }

    /// Sends a body whose positions count from a line, with its span.
    fn write(&mut self, kind: BodyKind, body: &[u8], (line, span): (u8, u16), events: usize) {
        let Settings { board, session, frame_sync, differences, .. } = self.settings;
        let flag = |set: bool, bit: u8| if set { bit } else { 0 };
        let after_loss = if events > 0 { self.after_loss } else { std::mem::take(&mut self.dropped) };
        let states = matches!(kind, BodyKind::SmallStates | BodyKind::LargeStates);
        let header = DatagramHeader {
            kind: kind.number(),
            board,
            sequence: self.sequence,
            base: self.base,
            session,
            stride: self.stride,
            line,
            flags: flag(frame_sync, FRAME_SYNC) | flag(differences && !states, DIFFERENCES) | flag(after_loss, DROPPED),
            span,
        };
        self.sequence = self.sequence.wrapping_add(1);
        let mut datagram = Vec::with_capacity(DATAGRAM_BYTES);
        header.write(body, &mut datagram);
        self.complete.push((datagram, events));
    }
}

/// The line from which positions count if the first event is in column `x`.
pub(super) fn first_line(x: u16) -> u8 {
    x.min(LAST_LINE) as u8
}

/// The layout of the words of a kind of events.
fn layout(kind: BodyKind) -> Result<Layout> {
    match kind {
        BodyKind::Changes | BodyKind::Small | BodyKind::Large => kind.layout(),
        _ => None,
    }
    .ok_or_else(|| problem!("events can be sent only as changes, small changes or large changes"))
}

/// Number of words for a gap and its event.
pub(super) fn steps(word: Layout, gap: i64) -> usize {
    let (step, most) = word.advance();
    if gap < i64::from(word.control()) { 1 } else { 1 + ((gap / step) as u64).div_ceil(most as u64) as usize }
}

/// Appends an event `gap` positions after the expected one.
pub(super) fn add(body: &mut Vec<u8>, word: Layout, mut gap: i64, p: bool, value: u16) {
    let (step, most) = word.advance();
    if gap >= i64::from(word.control()) {
        let mut left = gap / step;
        gap -= left * step;
        while left > 0 {
            let now = left.min(most);
            put(body, word, false, word.control(), (now - 1) as u32);
            left -= now;
        }
    }
    let largest = (1_u32 << word.value) - 1;
    put(body, word, p, gap as u32, u32::from(value).min(largest));
}

pub(super) fn put(body: &mut Vec<u8>, word: Layout, p: bool, skip: u32, value: u32) {
    let bits = u32::from(p) << (word.skip + word.value) | skip << word.value | value;
    body.extend(&bits.to_le_bytes()[..word.bytes]);
}
