//! Copies of the events for viewers: in pieces, twice as often as pictures while a viewer is connected.
//!
//! The decoding thread fills a piece of bounded size and hands it over where there is room; it never waits. What finds no
//! room is counted, and the next piece begins with the held values, so that a picture is right again within 0.1 s.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crossbeam_channel::{Receiver, Sender, TrySendError, bounded};
use std::sync::Arc;
use taxel_core::held::{Held, UNKNOWN};
use taxel_core::{Array, Events, Marker};

/// From piece to piece while a viewer is connected ...
const WATCHED: Duration = Duration::from_millis(8);
/// ... and while none is: a viewer that looks back begins where a piece does.
const UNWATCHED: Duration = Duration::from_millis(100);

/// How often a piece begins with the held values.
const HELD_EVERY: Duration = Duration::from_millis(100);

/// Changes that a piece holds at most: 4 MiB.
const MOST: usize = 1 << 18;

/// Markers that a piece holds at most.
const MARKERS: usize = 1 << 10;

/// Pieces that wait at most.
const WAITING: usize = 16;

/// A change at a taxel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Change {
    /// us.
    pub t: i64,
    /// Its index.
    pub taxel: u32,
    /// The value that arrived with it, ticks; [`UNKNOWN`] where none did.
    pub ticks: u16,
    /// More pressure.
    pub up: bool,
    /// Whether it comes from a state of version 2, not from an event.
    pub repaired: bool,
}

/// Changes in the order in which they came.
#[derive(Debug, Clone, Default)]
pub struct Piece {
    /// The changes.
    pub changes: Vec<Change>,
    /// The values that the taxels held before the first of them, in some pieces.
    pub held: Option<Vec<u16>>,
    /// The board's time before the first of them; `None` before anything came.
    pub since: Option<i64>,
    /// Events that arrived before them, those included that are missing.
    pub before: u64,
    /// Events that are missing between the last piece and this one.
    pub missing: u64,
    /// Whether the board was reset before it: what was held before holds no more.
    pub reset: bool,
    /// Starts and stops of the board.
    pub markers: Vec<Marker>,
}

/// The receiving end.
#[derive(Debug)]
pub struct ViewerEvents {
    pieces: Receiver<Piece>,
    watched: Arc<AtomicBool>,
}

impl ViewerEvents {
    /// The next piece, where one waits.
    #[must_use]
    pub fn next(&self) -> Option<Piece> {
        self.pieces.try_recv().ok()
    }

    /// Sets whether a viewer is connected: then pieces come often enough for sixty pictures a second, else ten times.
    pub fn set_watched(&self, watched: bool) {
        self.watched.store(watched, Ordering::Relaxed);
    }
}

/// The decoding thread's end.
#[derive(Debug)]
pub(super) struct ViewerQueue {
    pieces: Sender<Piece>,
    watched: Arc<AtomicBool>,
    piece: Piece,
    latest: Option<i64>,
    events: u64,
    /// When a piece last began with the held values.
    held_at: Instant,
    sent: Instant,
    columns: usize,
}

/// A queue for an array whose taxels hold these values, and its receiving end.
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
                // An array has 65 536 positions at most where it is live; files have 2^22.
                #[allow(clippy::cast_possible_truncation)]
                let taxel = taxel as u32;
                self.piece.changes.push(Change {
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
            // Too much waits: it is dropped, and the next piece restarts with the held values.
            let missing = self.piece.missing + (self.piece.changes.len() + events.len() - copied) as u64;
            let reset = self.piece.reset;
            self.begin(Some(held));
            (self.piece.missing, self.piece.reset) = (missing, reset);
        }
    }

    /// Hands over what waits, where it is time; false where the receiving end is gone.
    pub(super) fn tick(&mut self, held: &Held) -> bool {
        let every = if self.watched.load(Ordering::Relaxed) { WATCHED } else { UNWATCHED };
        let nothing = self.piece.changes.is_empty() && self.piece.held.is_none() && self.piece.markers.is_empty();
        if nothing || self.sent.elapsed() < every {
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

    /// The board was reset: its taxels hold no value until their next event.
    pub(super) fn reset(&mut self, held: &Held) {
        let waits = std::mem::take(&mut self.piece);
        let (missing, markers) = match self.pieces.try_send(waits) {
            Err(TrySendError::Full(piece)) => (piece.missing + piece.changes.len() as u64, piece.markers),
            Ok(()) | Err(TrySendError::Disconnected(_)) => (0, vec![]),
        };
        self.begin(Some(held));
        self.piece = Piece { missing, markers, reset: true, ..std::mem::take(&mut self.piece) };
    }

    /// Begins a piece, with these held values where there are any.
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
    fn a_viewer_that_does_not_read_loses_events_and_not_the_picture() {
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
        assert_eq!(piece.held.expect("begins anew")[array.index(1, 2)], 7);
        assert!(piece.changes.len() <= MOST);
        drop(viewer);
        queue.push(&events(&[2000], 7), &held);
        queue.sent = Instant::now() - UNWATCHED;
        assert!(!queue.tick(&held), "the receiving end is gone");
    }
}
