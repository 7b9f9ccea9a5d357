//! The words of a datagram's events while it is filled, by a board and for files.

use super::{BODY_BYTES, LAST_LINE, LATEST_OFFSET, Layout, START, STOP, before};

/// A body of events in one layout of words; its times and positions count from its first event.
#[derive(Debug, Clone)]
pub(super) struct EventWords {
    layout: Layout,
    stride: u8,
    pub(super) bytes: Vec<u8>,
    /// Number of events.
    pub(super) events: usize,
    /// The time of the first event, us.
    pub(super) base: i64,
    /// The time of the last event, us, and its position.
    at: i64,
    position: i64,
    /// The latest time of an event, us.
    pub(super) latest: i64,
    /// The line from which positions count; 0 without any event.
    pub(super) line: u8,
}

impl EventWords {
    pub(super) fn new(layout: Layout, stride: u8) -> Self {
        Self { layout, stride, bytes: vec![], events: 0, base: 0, at: 0, position: -1, latest: 0, line: 0 }
    }

    /// Takes the body; the next one has the same layout.
    pub(super) fn take(&mut self) -> Self {
        let next = Self::new(self.layout, self.stride);
        std::mem::replace(self, next)
    }

    fn position_of(&self, (x, y): (u16, u16)) -> i64 {
        i64::from(x) << self.stride | i64::from(y)
    }

    /// Whether an event needs no word of time: it has the time of the last one, and comes after it.
    pub(super) fn continues(&self, t: i64, taxel: (u16, u16)) -> bool {
        t == self.at && self.position_of(taxel) > self.position
    }

    /// Whether an event can be added: within the reach of offsets from the base, and of the bytes of a body.
    pub(super) fn takes(&self, t: i64, taxel: (u16, u16)) -> bool {
        let (position, continues) = (self.position_of(taxel), self.continues(t, taxel));
        let (gap, time) = if continues { (position - self.position - 1, 0) } else { (position, 2) };
        let more = self.layout.bytes * (self.layout.words(gap) + time);
        let offset = u64::try_from(t - self.base);
        self.events == 0 || offset.is_ok_and(|us| us <= LATEST_OFFSET) && self.bytes.len() + more <= BODY_BYTES
    }

    /// Adds an event, which the body must take.
    pub(super) fn add(&mut self, t: i64, taxel: (u16, u16), p: bool, value: u16) {
        let layout = self.layout;
        if self.events == 0 {
            self.line = taxel.0.min(LAST_LINE) as u8;
            (self.base, self.at, self.latest) = (t, t, t);
            self.position = before(self.line, self.stride);
        }
        if !self.continues(t, taxel) {
            self.put(true, layout.control(), 0);
            let offset = ((t - self.base) as u32).to_le_bytes();
            self.bytes.extend(&offset[..layout.bytes]);
            (self.at, self.position) = (t, -1);
        }
        let position = self.position_of(taxel);
        let ((step, most), mut gap) = (layout.advance(), position - self.position - 1);
        if gap >= i64::from(layout.control()) {
            let mut left = gap / step;
            gap -= left * step;
            while left > 0 {
                let now = left.min(most);
                self.put(false, layout.control(), (now - 1) as u32);
                left -= now;
            }
        }
        self.put(p, gap as u32, u32::from(value).min((1 << layout.value) - 1));
        (self.position, self.latest, self.events) = (position, self.latest.max(t), self.events + 1);
    }

    fn put(&mut self, p: bool, skip: u32, value: u32) {
        let Layout { bytes, skip: skip_bits, value: value_bits } = self.layout;
        let bits = u32::from(p) << (skip_bits + value_bits) | skip << value_bits | value;
        self.bytes.extend(&bits.to_le_bytes()[..bytes]);
    }
}

impl Layout {
    /// Number of words for a gap and its event.
    fn words(self, gap: i64) -> usize {
        let (step, most) = self.advance();
        if gap < i64::from(self.control()) { 1 } else { 1 + ((gap / step) as u64).div_ceil(most as u64) as usize }
    }
}

/// The body of the start or stop of a recording, at the base time.
pub(super) fn marker_body(start: bool) -> [u8; 8] {
    let [low, high] = (if start { START } else { STOP }).to_le_bytes();
    [0, 0, 0, 0, low, high, 0, 0]
}
