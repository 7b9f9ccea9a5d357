//! What the readout processes, and the queue in which it waits for a readout in a thread of its own.

use std::sync::{Condvar, Mutex, PoisonError};

use taxel_core::encode::Zeroing;
use taxel_core::events::FARTHEST_BACK_US;
use taxel_core::{Array, Events};

use super::frame_block::FrameBlock;
use crate::locked::lock;

/// A time before which no data follow the queued events, us.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum QuietUntil {
    /// By the host's clock: an event that arrives late may contradict it.
    ByHostClock(i64),
    /// As the board has promised.
    ByBoard(i64),
    /// The input has ended: none follow at all.
    Ended,
}

impl QuietUntil {
    /// The time before which no data can follow, us: a silence that is believed counts once an event in it would be too late
    /// to be accepted.
    pub(super) fn certain(self) -> i64 {
        match self {
            Self::ByHostClock(t) => t - FARTHEST_BACK_US,
            Self::ByBoard(t) => t,
            Self::Ended => i64::MAX,
        }
    }
}

/// What the readout processes at once.
#[derive(Debug)]
pub(super) struct ReadoutInput {
    pub(super) events: Events,
    /// Frames, in place of events, if the source sends them.
    pub(super) frames: FrameBlock,
    /// Taxels that were zeroed, each at its own time.
    pub(super) zeroings: Vec<Zeroing>,
    /// The time before which no data follow these.
    pub(super) quiet: Option<QuietUntil>,
    /// No more data will arrive.
    pub(super) last: bool,
}

impl ReadoutInput {
    pub(super) fn new(array: &Array) -> Self {
        let events = Events::empty(array.clone());
        Self { events, frames: FrameBlock::default(), zeroings: vec![], quiet: None, last: false }
    }

    /// Whether there are events, markers or frames.
    fn has_data(&self) -> bool {
        !(self.events.is_empty() && self.events.markers.is_empty() && self.frames.is_empty())
    }

    /// Whether there is nothing to process.
    pub(super) fn is_empty(&self) -> bool {
        !self.has_data() && self.zeroings.is_empty() && self.quiet.is_none() && !self.last
    }

    /// Clears all of it, and keeps its memory.
    pub(super) fn clear(&mut self) {
        self.events.clear();
        self.frames.clear();
        self.zeroings.clear();
        (self.quiet, self.last) = (None, false);
    }
}

/// The input that waits for a readout in a thread of its own, as one.
#[derive(Debug)]
pub(super) struct ReadoutQueue {
    waiting: Mutex<ReadoutInput>,
    came: Condvar,
    limit: usize,
}

impl ReadoutQueue {
    pub(super) fn new(array: &Array, limit: usize) -> Self {
        Self { waiting: Mutex::new(ReadoutInput::new(array)), came: Condvar::new(), limit }
    }

    /// Adds input. Returns the number of events or frames that were dropped, as they did not fit.
    pub(super) fn push(&self, input: &mut ReadoutInput) -> usize {
        let mut waiting = lock(&self.waiting);
        if input.has_data() || input.quiet.is_some() {
            // A silence counts only where nothing came after it.
            waiting.quiet = input.quiet;
        }
        let fitting = self.limit.saturating_sub(waiting.events.len()).min(input.events.len());
        let mut dropped = input.events.len() - fitting;
        waiting.events.append(&input.events, fitting);
        // A frame has as many values as the array; a block that waits alone always fits.
        if waiting.frames.is_empty() || waiting.frames.values.len() + input.frames.values.len() <= self.limit {
            waiting.frames.append(&mut input.frames);
        } else {
            dropped += input.frames.t.len();
        }
        waiting.zeroings.append(&mut input.zeroings);
        waiting.last |= input.last;
        drop(waiting);
        self.came.notify_one();
        dropped
    }

    /// Waits until there is input, and takes all of it.
    pub(super) fn pop(&self, input: &mut ReadoutInput) {
        input.clear();
        let waiting = self.came.wait_while(lock(&self.waiting), |waiting| waiting.is_empty());
        std::mem::swap(&mut *waiting.unwrap_or_else(PoisonError::into_inner), input);
    }

    /// Ends the queue early, as no more input can come.
    pub(super) fn close(&self) {
        lock(&self.waiting).last = true;
        self.came.notify_one();
    }
}

#[cfg(test)]
mod tests {
    use taxel_core::Intensities;

    use super::*;

    fn input(t: &[i64], ticks: Option<u16>, quiet: Option<QuietUntil>) -> ReadoutInput {
        let n = t.len();
        let intensity = ticks.map(|v| Intensities { ticks: vec![v; n], present: vec![true; n] });
        let (x, y, p) = (vec![1; n], vec![2; n], vec![true; n]);
        let events = Events { t: t.to_vec(), x, y, p, intensity, ..Events::empty(Array::thesis()) };
        ReadoutInput { events, quiet, ..ReadoutInput::new(&Array::thesis()) }
    }

    fn popped(queue: &ReadoutQueue) -> ReadoutInput {
        let mut popped = ReadoutInput::new(&Array::thesis());
        queue.pop(&mut popped);
        popped
    }

    #[test]
    fn what_was_pushed_in_pieces_is_popped_as_one() {
        let queue = ReadoutQueue::new(&Array::thesis(), 10);
        for (t, ticks) in [(&[1, 2][..], None), (&[3], Some(7)), (&[4], None)] {
            assert_eq!(queue.push(&mut input(t, ticks, None)), 0);
        }
        let popped = popped(&queue);
        assert_eq!((popped.quiet, popped.last), (None, false));
        assert_eq!(popped.events.t, [1, 2, 3, 4]);
        let intensity = popped.events.intensity.as_ref().expect("one had an intensity");
        assert_eq!(intensity.ticks, [0, 0, 7, 0]);
        assert_eq!(intensity.present, [false, false, true, false]);
        popped.events.view().check().expect("columns are equally long");
    }

    #[test]
    fn what_finds_no_room_is_counted() {
        let queue = ReadoutQueue::new(&Array::thesis(), 3);
        assert_eq!(queue.push(&mut input(&[1, 2], None, None)), 0);
        assert_eq!(queue.push(&mut input(&[3, 4, 5], None, None)), 2);
        assert_eq!(popped(&queue).events.t, [1, 2, 3]);
    }

    #[test]
    fn silence_is_popped_once_and_only_where_nothing_came_after_it() {
        let (queue, [by_host, by_board]) =
            (ReadoutQueue::new(&Array::thesis(), 10), [QuietUntil::ByHostClock(100), QuietUntil::ByBoard(300)]);
        queue.push(&mut input(&[], None, Some(by_host)));
        assert_eq!(popped(&queue).quiet, Some(by_host));
        queue.push(&mut input(&[], None, Some(by_host)));
        queue.push(&mut input(&[150], None, None));
        assert_eq!(popped(&queue).quiet, None);
        queue.push(&mut input(&[], None, Some(by_board)));
        queue.push(&mut ReadoutInput { last: true, ..input(&[], None, None) });
        let popped = popped(&queue);
        assert_eq!((popped.quiet, popped.last), (Some(by_board), true));
    }
}
