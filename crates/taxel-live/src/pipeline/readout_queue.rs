//! The queue between decoding and reading out.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use taxel_core::encode::Zeroing;
use taxel_core::events::FARTHEST_BACK_US;
use taxel_core::{Array, Events};

use super::frame_block::FrameBlock;
use crate::locked::lock;

/// Events that wait for the readout, and the time up to which there are no more.
#[derive(Debug)]
pub(super) struct ReadoutQueue {
    state: Mutex<WaitingEvents>,
    came: Condvar,
    limit: usize,
}

#[derive(Debug)]
struct WaitingEvents {
    events: Events,
    frames: FrameBlock,
    quiet: Option<QuietUntil>,
    zeroings: Vec<Zeroing>,
    dropped: u64,
    closed: bool,
}

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

/// What follows the events that the readout processes at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct BatchEnd {
    /// The time before which no more events follow.
    pub quiet: Option<QuietUntil>,
    /// No more data will arrive.
    pub last: bool,
}

impl ReadoutQueue {
    pub(super) fn new(array: &Array, limit: usize) -> Self {
        let events = Events::empty(array.clone());
        let frames = FrameBlock::default();
        let state = WaitingEvents { events, frames, quiet: None, zeroings: vec![], dropped: 0, closed: false };
        Self { state: Mutex::new(state), came: Condvar::new(), limit }
    }

    /// Adds events, with the board's promise after them, and leaves `events` empty; those that do not fit are dropped.
    /// Returns the number dropped so far. Wakes the reader once.
    pub(super) fn push(&self, events: &mut Events, promised: Option<i64>) -> u64 {
        let mut state = self.state();
        let room = self.limit.saturating_sub(state.events.len());
        if state.events.is_empty() && state.events.markers.is_empty() && events.len() <= room {
            std::mem::swap(&mut state.events, events);
        } else {
            let dropped = events.len().saturating_sub(room);
            state.dropped += dropped as u64;
            state.events.append(events, room.min(events.len()));
            events.clear();
        }
        state.quiet = promised.map(QuietUntil::ByBoard);
        let dropped = state.dropped;
        drop(state);
        self.came.notify_one();
        dropped
    }

    /// Adds frames, and leaves `frames` empty; a block that does not fit is dropped. Returns the number of frames dropped so
    /// far.
    pub(super) fn push_frames(&self, frames: &mut FrameBlock) -> u64 {
        let mut state = self.state();
        // A frame has as many values as the array; a block that waits alone always fits.
        if state.frames.is_empty() || state.frames.values.len() + frames.values.len() <= self.limit {
            state.frames.append(frames);
        } else {
            state.dropped += frames.t.len() as u64;
            frames.clear();
        }
        state.quiet = None;
        let dropped = state.dropped;
        drop(state);
        self.came.notify_one();
        dropped
    }

    /// Sets the time before which no data follow the queued events.
    pub(super) fn set_quiet(&self, quiet: QuietUntil) {
        self.state().quiet = Some(quiet);
        self.came.notify_one();
    }

    /// Adds zeroings, each of which has its own time.
    pub(super) fn zero(&self, zeroings: &[Zeroing]) {
        self.state().zeroings.extend_from_slice(zeroings);
        self.came.notify_one();
    }

    /// Ends the queue; `quiet` is the time before which nothing arrived.
    pub(super) fn close(&self, quiet: Option<QuietUntil>) {
        let mut state = self.state();
        state.quiet = quiet.or(state.quiet);
        state.closed = true;
        drop(state);
        self.came.notify_one();
    }

    /// Waits until something is there and removes all of it; adds to `zeroings`.
    pub(super) fn pop(&self, events: &mut Events, frames: &mut FrameBlock, zeroings: &mut Vec<Zeroing>) -> BatchEnd {
        events.clear();
        frames.clear();
        let nothing = |s: &mut WaitingEvents| {
            let silent = s.events.is_empty() && s.events.markers.is_empty() && s.zeroings.is_empty();
            silent && s.frames.is_empty() && s.quiet.is_none() && !s.closed
        };
        let mut state = self.came.wait_while(self.state(), nothing).unwrap_or_else(PoisonError::into_inner);
        std::mem::swap(&mut state.events, events);
        std::mem::swap(&mut state.frames, frames);
        zeroings.append(&mut state.zeroings);
        BatchEnd { quiet: state.quiet.take(), last: state.closed }
    }

    /// Locks the state. No holder of the lock can panic half-way through a change, so a poisoned lock still guards a
    /// valid state.
    fn state(&self) -> MutexGuard<'_, WaitingEvents> {
        lock(&self.state)
    }
}

#[cfg(test)]
mod tests {
    use taxel_core::Intensities;

    use super::*;

    fn events(t: &[i64], ticks: Option<u16>) -> Events {
        let n = t.len();
        let intensity = ticks.map(|v| Intensities { ticks: vec![v; n], present: vec![true; n] });
        let (x, y, p) = (vec![1; n], vec![2; n], vec![true; n]);
        Events { t: t.to_vec(), x, y, p, intensity, ..Events::empty(Array::thesis()) }
    }

    #[test]
    fn what_was_pushed_in_pieces_is_popped_as_one() {
        let readout_queue = ReadoutQueue::new(&Array::thesis(), 10);
        for (t, ticks) in [(&[1, 2][..], None), (&[3], Some(7)), (&[4], None)] {
            let mut piece = events(t, ticks);
            assert_eq!(readout_queue.push(&mut piece, None), 0);
            assert!(piece.is_empty());
        }
        let mut popped = Events::empty(Array::thesis());
        assert_eq!(
            readout_queue.pop(&mut popped, &mut FrameBlock::default(), &mut vec![]),
            BatchEnd { quiet: None, last: false }
        );
        assert_eq!(popped.t, [1, 2, 3, 4]);
        let intensity = popped.intensity.as_ref().expect("one had an intensity");
        assert_eq!(intensity.ticks, [0, 0, 7, 0]);
        assert_eq!(intensity.present, [false, false, true, false]);
        popped.view().check().expect("columns are equally long");
    }

    #[test]
    fn what_finds_no_room_is_counted() {
        let readout_queue = ReadoutQueue::new(&Array::thesis(), 3);
        assert_eq!(readout_queue.push(&mut events(&[1, 2], None), None), 0);
        assert_eq!(readout_queue.push(&mut events(&[3, 4, 5], None), None), 2);
        let mut popped = Events::empty(Array::thesis());
        readout_queue.pop(&mut popped, &mut FrameBlock::default(), &mut vec![]);
        assert_eq!(popped.t, [1, 2, 3]);
    }

    #[test]
    fn silence_is_popped_once_and_only_where_nothing_came_after_it() {
        let readout_queue = ReadoutQueue::new(&Array::thesis(), 10);
        let mut popped = Events::empty(Array::thesis());
        readout_queue.set_quiet(QuietUntil::ByHostClock(100));
        assert_eq!(
            readout_queue.pop(&mut popped, &mut FrameBlock::default(), &mut vec![]).quiet,
            Some(QuietUntil::ByHostClock(100))
        );
        readout_queue.set_quiet(QuietUntil::ByHostClock(200));
        readout_queue.push(&mut events(&[150], None), None);
        assert_eq!(readout_queue.pop(&mut popped, &mut FrameBlock::default(), &mut vec![]).quiet, None);
        readout_queue.push(&mut events(&[], None), Some(300));
        assert_eq!(
            readout_queue.pop(&mut popped, &mut FrameBlock::default(), &mut vec![]).quiet,
            Some(QuietUntil::ByBoard(300))
        );
        readout_queue.close(None);
        assert!(readout_queue.pop(&mut popped, &mut FrameBlock::default(), &mut vec![]).last);
    }
}
