//! The board's side of the link: encodes events, markers, states and totals as datagrams of either version of the wire,
//! in a bounded queue.

use std::collections::VecDeque;

use super::counts::BoardCounts;
use crate::wire::v2::{Packer, Settings};
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
    /// Datagrams that the sink has not accepted yet, oldest first, each with the number of words as which it counts.
    waiting: VecDeque<(Vec<u8>, usize)>,
    waiting_words: usize,
}

impl Link {
    /// An empty queue of so many words.
    pub(super) fn new(settings: Settings, array: &Array, capacity: usize) -> Result<Self> {
        let packer = Packer::new(settings, array)?;
        Ok(Self { capacity, filling: vec![], packer, waiting: VecDeque::new(), waiting_words: 0 })
    }

    /// Starts a session: the current datagrams are discarded, whole datagrams in the queue are still sent.
    pub(super) fn reset(&mut self, settings: Settings, array: &Array) -> Result<()> {
        self.filling.clear();
        self.packer = Packer::new(settings, array)?;
        Ok(())
    }

    /// Continues with other settings of version 2; no event of version 2 may be waiting.
    pub(super) fn follow(&mut self, settings: Settings) {
        self.packer.follow(settings);
    }

    /// Passes the waiting datagrams to the sink, oldest first, until it accepts one no more.
    pub(super) fn offer(&mut self, counts: &mut BoardCounts, sink: &mut impl FnMut(&[u8]) -> bool) {
        while let Some((oldest, words)) = self.waiting.front() {
            if !sink(oldest) {
                break;
            }
            counts.datagrams += 1;
            counts.sent += *words as u64;
            self.waiting_words -= words;
            self.waiting.pop_front();
        }
    }

    /// Queues an event of version 1, with its intensity word if `valued`; returns false if the queue was full and the
    /// event was dropped.
    pub(super) fn words(&mut self, found: ScannedEvent, valued: bool, counts: &mut BoardCounts) -> bool {
        // Rule 8 guarantees that columns and rows fit in a byte on version 1.
        let (x, y, p) = (found.x as u8, found.y as u8, found.p);
        let mut words = [0; 2 * WORD_BYTES];
        words[..WORD_BYTES].copy_from_slice(&Word::Change { stamp: stamp(found.at), x, y, p }.to_bytes());
        words[WORD_BYTES..].copy_from_slice(&Word::Intensity { ticks: found.intensity, x, y, p }.to_bytes());
        self.enqueue(&words[..if valued { 2 } else { 1 } * WORD_BYTES], counts)
    }

    /// Queues a marker of version 1; returns false if the queue was full and the marker was dropped.
    pub(super) fn marker_word(&mut self, at: u64, start: bool, counts: &mut BoardCounts) -> bool {
        self.enqueue(&Word::Marker { stamp: stamp(at), start }.to_bytes(), counts)
    }

    /// Queues the words of a taxel, or a marker; returns false if the queue was full and they were dropped.
    fn enqueue(&mut self, words: &[u8], counts: &mut BoardCounts) -> bool {
        if self.filling.len() + words.len() > DATAGRAM_WORDS * WORD_BYTES {
            self.flush_words();
        }
        let count = words.len() / WORD_BYTES;
        if self.waiting_words + self.filling.len() / WORD_BYTES + count > self.capacity {
            counts.dropped += 1;
            return false;
        }
        self.filling.extend_from_slice(words);
        counts.words += count as u64;
        true
    }

    /// Ends the current datagram of version 1.
    pub(super) fn flush_words(&mut self) {
        if !self.filling.is_empty() {
            let datagram = std::mem::take(&mut self.filling);
            let words = datagram.len() / WORD_BYTES;
            self.waiting_words += words;
            self.waiting.push_back((datagram, words));
        }
    }

    /// Drops an event that finds no room.
    pub(super) fn refuse(&mut self, counts: &mut BoardCounts) {
        counts.dropped += 1;
        self.packer.dropped();
    }

    /// Queues an event of version 2; returns false if the queue was full and the event was dropped.
    pub(super) fn pack(&mut self, found: ScannedEvent, counts: &mut BoardCounts) -> bool {
        if self.waiting_words + EVENT_WORDS * self.packer.waiting() + EVENT_WORDS > self.capacity {
            self.refuse(counts);
            return false;
        }
        counts.words += EVENT_WORDS as u64;
        let ScannedEvent { at, x, y, p, intensity } = found;
        self.with_packer(|packer| packer.event(at / 100, (x, y), p, intensity));
        true
    }

    /// Queues a marker of version 2, at a time in us.
    pub(super) fn marker(&mut self, now: u64, start: bool, counts: &mut BoardCounts) {
        self.with_packer(|packer| packer.flush(now));
        counts.words += EVENT_WORDS as u64;
        self.packer.marker(now, start);
        self.take_packed(1);
    }

    /// Queues the datagrams of version 2 that a call of the packer completes.
    pub(super) fn with_packer(&mut self, call: impl FnOnce(&mut Packer)) {
        call(&mut self.packer);
        self.take_packed(0);
    }

    /// Queues what is packed; a datagram counts as at least so many events.
    fn take_packed(&mut self, least: usize) {
        for (datagram, events) in self.packer.take() {
            let words = EVENT_WORDS * events.max(least);
            self.waiting_words += words;
            self.waiting.push_back((datagram, words));
        }
    }
}

/// The stamp of version 1 for a time in 10 ns.
fn stamp(time: u64) -> u16 {
    ((time / 10_000) & 0xffff) as u16
}
