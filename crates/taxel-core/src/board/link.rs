//! The board's side of the link: encodes events, markers, states and totals as datagrams of either version of the wire,
//! in a bounded queue.

use std::collections::VecDeque;

use super::counts::BoardCounts;
use crate::wire::v2::{BoardTotals, Packer, Settings};
use crate::wire::{WORD_BYTES, Word};
use crate::{Array, Result};

/// Most words of a datagram of version 1: 1400 bytes (read).
pub const DATAGRAM_WORDS: usize = 280;

/// UDP port to which the board sends its datagrams (read).
pub const PORT: u16 = 5208;

/// Default capacity of the queue, words (read): two frames of 4096 taxels, change and intensity.
pub const QUEUE_WORDS: usize = 16_384;

/// Number of words as which an event of version 2 counts in the queue's capacity and in the totals.
const EVENT_WORDS: usize = 2;

/// An event found by the scan.
#[derive(Debug, Clone, Copy)]
pub(super) struct ScannedEvent {
    /// Time since reset, 10 ns.
    pub(super) at: u64,
    pub(super) x: u16,
    pub(super) y: u16,
    pub(super) p: bool,
    /// Content of its intensity word.
    pub(super) intensity: u16,
}

/// The current datagrams and the queue of those that wait.
#[derive(Debug, Clone)]
pub(super) struct Link {
    capacity: usize,
    /// The current datagram of version 1.
    filling: Vec<u8>,
    /// Builds the datagrams of version 2.
    packer: Packer,
    queue: DatagramQueue,
}

impl Link {
    /// An empty queue of [`QUEUE_WORDS`].
    pub(super) fn new(settings: Settings, array: &Array) -> Result<Self> {
        Ok(Self {
            capacity: QUEUE_WORDS,
            filling: Vec::with_capacity(DATAGRAM_WORDS * WORD_BYTES),
            packer: Packer::new(settings, array)?,
            queue: DatagramQueue::default(),
        })
    }

    /// Starts a session: the current datagrams are discarded, whole datagrams in the queue are still sent.
    pub(super) fn reset(&mut self, settings: Settings, array: &Array) -> Result<()> {
        self.filling.clear();
        self.packer = Packer::new(settings, array)?;
        Ok(())
    }

    /// Sets the capacity of the queue, in words.
    pub(super) fn bound(&mut self, words: usize) {
        self.capacity = words;
    }

    /// Continues with other settings of version 2; no event of version 2 may be waiting.
    pub(super) fn follow(&mut self, settings: Settings) {
        self.packer.follow(settings);
    }

    /// Passes the waiting datagrams to the sink, oldest first.
    pub(super) fn offer(&mut self, counts: &mut BoardCounts, sink: &mut impl FnMut(&[u8]) -> bool) {
        self.queue.offer(counts, sink);
    }

    /// Queues an event of version 1, with its intensity word if `valued`; returns false if the queue was full and the
    /// event was dropped.
    pub(super) fn words(
        &mut self,
        found: ScannedEvent,
        valued: bool,
        counts: &mut BoardCounts,
        sink: &mut impl FnMut(&[u8]) -> bool,
    ) -> bool {
        // Rule 8 guarantees that columns and rows fit in a byte on version 1.
        let (x, y, p) = (found.x as u8, found.y as u8, found.p);
        let mut words = [0; 2 * WORD_BYTES];
        words[..WORD_BYTES].copy_from_slice(&Word::Change { stamp: stamp(found.at), x, y, p }.to_bytes());
        words[WORD_BYTES..].copy_from_slice(&Word::Intensity { ticks: found.intensity, x, y, p }.to_bytes());
        self.enqueue(&words[..if valued { 2 } else { 1 } * WORD_BYTES], counts, sink)
    }

    /// Queues a marker of version 1; returns false if the queue was full and the marker was dropped.
    pub(super) fn marker_word(&mut self, at: u64, start: bool, counts: &mut BoardCounts) -> bool {
        let word = Word::Marker { stamp: stamp(at), start };
        self.enqueue(&word.to_bytes(), counts, &mut |_| false)
    }

    /// Queues the words of a taxel, or a marker; returns false if the queue was full and they were dropped.
    fn enqueue(&mut self, words: &[u8], counts: &mut BoardCounts, sink: &mut impl FnMut(&[u8]) -> bool) -> bool {
        if self.filling.len() + words.len() > DATAGRAM_WORDS * WORD_BYTES {
            self.flush_words(counts, sink);
        }
        let count = words.len() / WORD_BYTES;
        if self.queue.words + self.filling.len() / WORD_BYTES + count > self.capacity {
            counts.dropped += 1;
            return false;
        }
        self.filling.extend_from_slice(words);
        counts.words += count as u64;
        true
    }

    /// Ends the current datagram of version 1: passes it to the sink after those that wait, or queues it.
    pub(super) fn flush_words(&mut self, counts: &mut BoardCounts, sink: &mut impl FnMut(&[u8]) -> bool) {
        self.queue.offer(counts, sink);
        let words = self.filling.len() / WORD_BYTES;
        if words > 0 {
            self.queue.send(&self.filling, words, counts, sink);
            self.filling.clear();
        }
    }

    /// Drops an event that finds no room.
    pub(super) fn refuse(&mut self, counts: &mut BoardCounts) {
        counts.dropped += 1;
        self.packer.dropped();
    }

    /// Queues an event of version 2; returns false if the queue was full and the event was dropped.
    pub(super) fn pack(
        &mut self,
        found: ScannedEvent,
        counts: &mut BoardCounts,
        sink: &mut impl FnMut(&[u8]) -> bool,
    ) -> bool {
        let Self { capacity, packer, queue, .. } = self;
        if queue.words + EVENT_WORDS * packer.waiting() + EVENT_WORDS > *capacity {
            self.refuse(counts);
            return false;
        }
        counts.words += EVENT_WORDS as u64;
        let ScannedEvent { at, x, y, p, intensity } = found;
        packer.event(at / 100, (x, y), p, intensity, &mut |datagram, events| {
            queue.send(datagram, EVENT_WORDS * events, counts, sink);
        });
        true
    }

    /// Queues a marker of version 2, at a time in us.
    pub(super) fn marker(&mut self, now: u64, start: bool, counts: &mut BoardCounts) {
        let Self { packer, queue, .. } = self;
        packer.marker(now, start, &mut |datagram, events| {
            counts.words += if events == 0 { EVENT_WORDS as u64 } else { 0 };
            queue.send(datagram, EVENT_WORDS * events.max(1), counts, &mut |_| false);
        });
    }

    /// Sends the waiting events of version 2, regardless of the hold time.
    pub(super) fn flush(&mut self, now: u64, counts: &mut BoardCounts, sink: &mut impl FnMut(&[u8]) -> bool) {
        let Self { packer, queue, .. } = self;
        packer.flush(now, &mut |datagram, events| queue.send(datagram, EVENT_WORDS * events, counts, sink));
    }

    /// Ends a frame of version 2: every event before `now` was queued, and the next frame ends at `next` (us).
    pub(super) fn end_frame(
        &mut self,
        (now, next): (u64, u64),
        counts: &mut BoardCounts,
        sink: &mut impl FnMut(&[u8]) -> bool,
    ) {
        let Self { packer, queue, .. } = self;
        packer.over(now, next, &mut |datagram, events| queue.send(datagram, EVENT_WORDS * events, counts, sink));
    }

    /// Sends states: taxels by ascending position, each with its value.
    pub(super) fn states(
        &mut self,
        now: u64,
        taxels: impl Iterator<Item = ((u16, u16), u16)>,
        counts: &mut BoardCounts,
        sink: &mut impl FnMut(&[u8]) -> bool,
    ) {
        let Self { packer, queue, .. } = self;
        packer.states(now, taxels, &mut |datagram, events| {
            queue.send(datagram, EVENT_WORDS * events, counts, sink);
        });
    }

    /// Sends the board's totals.
    pub(super) fn status(
        &mut self,
        now: u64,
        status: &BoardTotals,
        counts: &mut BoardCounts,
        sink: &mut impl FnMut(&[u8]) -> bool,
    ) {
        let Self { packer, queue, .. } = self;
        packer.status(now, status, &mut |datagram, events| queue.send(datagram, EVENT_WORDS * events, counts, sink));
    }
}

/// Datagrams that the sink has not accepted yet, oldest first, and the number of words as which they count.
#[derive(Debug, Clone, Default)]
struct DatagramQueue {
    waiting: VecDeque<(Vec<u8>, usize)>,
    words: usize,
}

impl DatagramQueue {
    /// Passes the waiting datagrams to the sink, oldest first.
    fn offer(&mut self, counts: &mut BoardCounts, sink: &mut impl FnMut(&[u8]) -> bool) {
        while let Some((oldest, words)) = self.waiting.front() {
            if !sink(oldest) {
                break;
            }
            count_sent(counts, *words);
            self.words -= words;
            self.waiting.pop_front();
        }
    }

    /// Passes a datagram to the sink after those that wait, or queues it.
    fn send(&mut self, datagram: &[u8], words: usize, counts: &mut BoardCounts, sink: &mut impl FnMut(&[u8]) -> bool) {
        self.offer(counts, sink);
        if self.waiting.is_empty() && sink(datagram) {
            count_sent(counts, words);
        } else {
            self.words += words;
            self.waiting.push_back((datagram.to_vec(), words));
        }
    }
}

fn count_sent(counts: &mut BoardCounts, words: usize) {
    counts.datagrams += 1;
    counts.sent += words as u64;
}

/// The stamp of version 1 for a time in 10 ns.
fn stamp(time: u64) -> u16 {
    ((time / 10_000) & 0xffff) as u16
}
