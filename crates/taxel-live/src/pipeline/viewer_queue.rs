//! Copies of the events for viewers: in pieces, twice as often as frames while a viewer is connected.
//!
//! The decoding thread fills a piece of bounded size and queues it if there is room; it never waits. Events that do not
//! fit are counted, and the next piece begins with the taxels' values, so that what is shown is correct again within 0.1 s.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crossbeam_channel::{Receiver, Sender, TrySendError, bounded};
use std::sync::Arc;
use taxel_core::held::{Held, UNKNOWN};
use taxel_core::{Array, Events, Marker};

/// Interval between pieces while a viewer is connected.
const WATCHED: Duration = Duration::from_millis(8);
/// Interval between pieces while no viewer is connected; a later look at the past can begin at the start of a piece
/// only.
const UNWATCHED: Duration = Duration::from_millis(100);

/// Interval at which a piece begins with the taxels' values.
const HELD_EVERY: Duration = Duration::from_millis(100);

/// Largest number of changes in a piece: 4 MiB.
const MOST: usize = 1 << 18;

/// Largest number of markers in a piece.
const MARKERS: usize = 1 << 10;

/// Capacity of the queue of pieces.
const WAITING: usize = 16;

/// A change at a taxel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TaxelChange {
    /// Time, us.
    pub t: i64,
    /// Index of the taxel.
    pub taxel: u32,
    /// The value that arrived with the change, ticks; [`UNKNOWN`] if there was none.
    pub ticks: u16,
    /// Whether the pressure rose.
    pub up: bool,
    /// Whether the change was decoded from a state of version 2, not from an event.
    pub repaired: bool,
}

/// Changes in order of arrival.
#[derive(Debug, Clone, Default)]
pub struct Piece {
    /// The changes.
    pub changes: Vec<TaxelChange>,
    /// The taxels' values before the first change, in some pieces.
    pub held: Option<Vec<u16>>,
    /// The board's time before the first change; `None` before the first event.
    pub since: Option<i64>,
    /// Number of events before these changes, including the missing ones.
    pub before: u64,
    /// Number of events that are missing between the last piece and this one.
    pub missing: u64,
    /// Whether the board was reset before the piece: earlier values are void.
    pub reset: bool,
    /// Start and stop markers of the board.
    pub markers: Vec<Marker>,
}

/// The receiving end of the queue.
#[derive(Debug)]
pub struct ViewerEvents {
    pieces: Receiver<Piece>,
    watched: Arc<AtomicBool>,
}

impl ViewerEvents {
    /// The next piece, if one waits.
    #[must_use]
    pub fn next(&self) -> Option<Piece> {
        self.pieces.try_recv().ok()
    }

    /// Sets whether a viewer is connected: pieces are then frequent enough for sixty frames a second, otherwise for
    /// ten.
    pub fn set_watched(&self, watched: bool) {
        self.watched.store(watched, Ordering::Relaxed);
    }
}

/// The decoding thread's end of the queue.
#[derive(Debug)]
pub(super) struct ViewerQueue {
    pieces: Sender<Piece>,
    watched: Arc<AtomicBool>,
    piece: Piece,
    latest: Option<i64>,
    events: u64,
    /// When a piece last began with the taxels' values.
    held_at: Instant,
    sent: Instant,
    columns: usize,
}

/// A queue for an array whose taxels have these values, and its receiving end.
pub(super) fn viewer_queue(
    array: &Array,
    held: &Held,
    latest: Option<i64>,
    events: u64,
) -> (ViewerQueue, ViewerEvents) {
    let (sender, pieces) = bounded(WAITING);
    let watched = Arc::new(AtomicBool::new(true));
    let now = Instant::now();
    let first = Piece { held: Some(held.values().to_vec()), since: latest, before: events, ..Piece::default() };
    let queue = ViewerQueue {
        pieces: sender,
        watched: Arc::clone(&watched),
        piece: first,
        latest,
        events,
        held_at: now,
        sent: now,
        columns: usize::from(array.columns),
    };
    (queue, ViewerEvents { pieces, watched })
}

impl ViewerQueue {
    /// Copies the next events, whose values are among those that the taxels hold.
    pub(super) fn push(&mut self, events: &Events, held: &Held) {
        let room = MOST - self.piece.changes.len().min(MOST);
        let copied = events.len().min(room);
        for k in 0..events.len() {
            let taxel = usize::from(events.y[k]) * self.columns + usize::from(events.x[k]);
            let ticks = match &events.intensity {
                Some(intensity) if intensity.present[k] => intensity.ticks[k],
                _ => UNKNOWN,
            };
            self.latest = self.latest.max(Some(events.t[k]));
            if k < copied {
                // A live array has at most 65 536 positions; files have up to 2^22.
                #[allow(clippy::cast_possible_truncation)]
                let taxel = taxel as u32;
                self.piece.changes.push(TaxelChange {
                    t: events.t[k],
                    taxel,
                    ticks,
                    up: events.p[k],
                    repaired: events.is_repaired(k),
                });
            }
        }
        self.events += events.len() as u64;
        let room = MARKERS.saturating_sub(self.piece.markers.len());
        self.piece.markers.extend(events.markers.iter().take(room));
        if copied < events.len() {
            // The piece is full: it is dropped, and the next one restarts with the taxels' values.
            let missing = self.piece.missing + (self.piece.changes.len() + events.len() - copied) as u64;
            let reset = self.piece.reset;
            self.begin(Some(held));
            (self.piece.missing, self.piece.reset) = (missing, reset);
        }
    }

    /// Queues the current piece if it is due; returns false if the receiving end was dropped.
    pub(super) fn tick(&mut self, held: &Held) -> bool {
        let interval = if self.watched.load(Ordering::Relaxed) { WATCHED } else { UNWATCHED };
        let nothing = self.piece.changes.is_empty() && self.piece.held.is_none() && self.piece.markers.is_empty();
        if nothing || self.sent.elapsed() < interval {
            return true;
        }
        match self.pieces.try_send(std::mem::take(&mut self.piece)) {
            Ok(()) => {
                self.sent = Instant::now();
                self.begin(Some(held).filter(|_| self.held_at.elapsed() >= HELD_EVERY));
                true
            }
            Err(TrySendError::Full(piece)) => {
                self.piece = piece;
                true
            }
            Err(TrySendError::Disconnected(_)) => false,
        }
    }

    /// Handles a reset of the board: the taxels' values are unknown until their next event.
    pub(super) fn reset(&mut self, held: &Held) {
        let waits = std::mem::take(&mut self.piece);
        let (missing, markers) = match self.pieces.try_send(waits) {
            Err(TrySendError::Full(piece)) => (piece.missing + piece.changes.len() as u64, piece.markers),
            Ok(()) | Err(TrySendError::Disconnected(_)) => (0, vec![]),
        };
        self.begin(Some(held));
        self.piece = Piece { missing, markers, reset: true, ..std::mem::take(&mut self.piece) };
    }

    /// Starts a piece, with these values if given.
    fn begin(&mut self, held: Option<&Held>) {
        if held.is_some() {
            self.held_at = Instant::now();
        }
        let held = held.map(|held| held.values().to_vec());
        self.piece = Piece { held, since: self.latest, before: self.events, ..Piece::default() };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_core::Intensities;

    fn events(t: &[i64], ticks: u16) -> Events {
        let n = t.len();
        let intensity = Some(Intensities { ticks: vec![ticks; n], present: vec![true; n] });
        Events {
            t: t.to_vec(),
            x: vec![1; n],
            y: vec![2; n],
            p: vec![true; n],
            intensity,
            ..Events::empty(Array::thesis())
        }
    }

    #[test]
    fn a_viewer_that_does_not_read_loses_events_and_not_the_values() {
        let array = Array::thesis();
        let mut held = Held::unknown(array.len());
        let (mut queue, viewer) = viewer_queue(&array, &held, None, 0);
        let many: Vec<i64> = (0..1000).collect();
        let mut sent = 0_u64;
        while sent < 3 * MOST as u64 {
            held.push(events(&many, 7).view());
            queue.push(&events(&many, 7), &held);
            sent += 1000;
        }
        queue.sent = Instant::now() - UNWATCHED;
        assert!(queue.tick(&held));
        let piece = viewer.next().expect("one waits");
        assert_eq!(piece.missing + piece.changes.len() as u64, sent);
        assert_eq!(piece.before + piece.changes.len() as u64, sent);
        assert_eq!(piece.held.expect("begins again")[array.index(1, 2)], 7);
        assert!(piece.changes.len() <= MOST);
        drop(viewer);
        queue.push(&events(&[2000], 7), &held);
        queue.sent = Instant::now() - UNWATCHED;
        assert!(!queue.tick(&held), "the receiving end is gone");
    }
}
