//! The keyframe index of a live source: the last minute, or what fits into 512 MB.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard};

use taxel_core::{Array, problem};

use super::event_rate::EventRate;
use super::{Block, KeyframeIndex};
use crate::array_state::{ArrayState, Keyframe};
use crate::taxel_history::TaxelHistory;
use crate::time_columns::{SPAN, TimeColumns};
use taxel_core::held::UNKNOWN;
use taxel_live::Result;
use taxel_live::locked::lock;
use taxel_live::pipeline::{Piece, TaxelChange};

/// How far back a live source can be viewed, us ...
pub(crate) const REACH_US: i64 = 60_000_000;
/// ... and the memory that it may take, bytes.
const REACH_BYTES: usize = 512 << 20;

/// A stored piece.
#[derive(Debug)]
pub struct StoredPiece {
    /// The piece.
    pub piece: Piece,
    rest: Option<Arc<Vec<u16>>>,
    bytes: usize,
}

/// The stored pieces, oldest first.
#[derive(Debug)]
struct Ring {
    pieces: VecDeque<Arc<StoredPiece>>,
    /// Sequence number of the first piece.
    first: u64,
    bytes: usize,
    latest: Option<i64>,
    rest: Option<(u64, Arc<Vec<u16>>)>,
}

/// Keyframes and changes of a live source. Clones share the stored pieces.
#[derive(Debug, Clone)]
pub struct LiveIndex {
    ring: Arc<Mutex<Ring>>,
    array: Array,
    noise_floor: u16,
}

impl LiveIndex {
    /// An empty index.
    #[must_use]
    pub fn new(array: Array, noise_floor: u16) -> Self {
        let ring = Ring { pieces: VecDeque::new(), first: 0, bytes: 0, latest: None, rest: None };
        Self { ring: Arc::new(Mutex::new(ring)), array, noise_floor }
    }

    fn ring(&self) -> MutexGuard<'_, Ring> {
        lock(&self.ring)
    }

    /// Stores a piece; `state` is the state of the array before it.
    pub fn push(&self, piece: Piece, state: &ArrayState) -> Arc<StoredPiece> {
        let mut ring = self.ring();
        let rest = piece.held.is_some().then(|| {
            if ring.rest.as_ref().is_none_or(|(rests, _)| *rests != state.rests()) {
                ring.rest = Some((state.rests(), Arc::new(state.rest().to_vec())));
            }
            Arc::clone(&ring.rest.as_ref().expect("it was stored above").1)
        });
        let held = piece.held.as_ref().map_or(0, Vec::len);
        let bytes = piece.changes.len() * size_of::<TaxelChange>() + 4 * held + size_of::<StoredPiece>();
        ring.latest = ring.latest.max(piece.changes.iter().map(|c| c.t).max());
        ring.bytes += bytes;
        let stored = Arc::new(StoredPiece { piece, rest, bytes });
        ring.pieces.push_back(Arc::clone(&stored));
        let latest = ring.latest;
        // Pieces are dropped up to the next keyframe, so that the first piece always has one.
        loop {
            let second = ring.pieces.iter().skip(1).position(|stored| stored.piece.held.is_some()).map(|k| k + 1);
            let Some(second) = second else { break };
            let old = ring.pieces[second].piece.since.zip(latest).is_some_and(|(since, now)| now - since > REACH_US);
            if !old && ring.bytes <= REACH_BYTES {
                break;
            }
            for _ in 0..second {
                let gone = ring.pieces.pop_front().map_or(0, |stored| stored.bytes);
                ring.bytes -= gone;
                ring.first += 1;
            }
        }
        stored
    }

    /// Number of pieces so far; [`LiveIndex::changes_from`] continues there.
    #[must_use]
    pub fn next_piece(&self) -> u64 {
        let ring = self.ring();
        ring.first + ring.pieces.len() as u64
    }

    /// Calls `apply` with the changes of every piece from a sequence number on; returns the next number.
    pub fn changes_from(&self, number: u64, mut apply: impl FnMut(&[TaxelChange])) -> u64 {
        let mut number = number;
        loop {
            let stored = {
                let ring = self.ring();
                number = number.max(ring.first);
                #[allow(clippy::cast_possible_truncation)]
                ring.pieces.get((number - ring.first) as usize).cloned()
            };
            let Some(stored) = stored else { return number };
            apply(&stored.piece.changes);
            number += 1;
        }
    }

    /// History of a taxel so far, by columns of `column_us`, and the next piece to apply.
    #[must_use]
    pub fn history(&self, taxel: u32, column_us: i64) -> (TaxelHistory, u64) {
        let from = self.range().map_or(0, |(_, latest)| latest - SPAN * column_us);
        let (number, held, since) = {
            let ring = self.ring();
            let index = ring.keyframe_at(from).unwrap_or(0);
            let stored = ring.pieces.get(index);
            let held = stored.and_then(|stored| stored.piece.held.as_ref());
            (
                ring.first + index as u64,
                held.map_or(UNKNOWN, |held| held[taxel as usize]),
                stored.and_then(|k| k.piece.since),
            )
        };
        let mut history = TaxelHistory::new(taxel, held, since, column_us);
        let number = self.changes_from(number, |changes| changes.iter().for_each(|change| history.apply(change)));
        (history, number)
    }

    /// Memory in use, bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.ring().bytes
    }

    /// Number of events over time: start and width of a bin (us), counts.
    #[must_use]
    pub fn event_rate(&self) -> (i64, i64, Vec<u64>) {
        let mut rate = EventRate::default();
        let first = self.ring().first;
        self.changes_from(first, |changes| rate.add(changes));
        rate.into_bins()
    }
}

impl Ring {
    /// Index of the last piece with a keyframe at or before `t`, or of the first one.
    fn keyframe_at(&self, t: i64) -> Option<usize> {
        let has_values = |stored: &Arc<StoredPiece>| stored.piece.held.is_some();
        let last = self
            .pieces
            .iter()
            .rposition(|stored| has_values(stored) && stored.piece.since.is_none_or(|since| since <= t));
        last.or_else(|| self.pieces.iter().position(has_values))
    }
}

impl KeyframeIndex for LiveIndex {
    fn array(&self) -> &Array {
        &self.array
    }

    fn noise_floor(&self) -> u16 {
        self.noise_floor
    }

    fn range(&self) -> Option<(i64, i64)> {
        let ring = self.ring();
        let latest = ring.latest?;
        // Pieces from before the first event have no time.
        let begin = |stored: &Arc<StoredPiece>| stored.piece.since.or(stored.piece.changes.first().map(|c| c.t));
        Some((ring.pieces.iter().find_map(begin).unwrap_or(latest), latest))
    }

    fn open(&self, t: i64) -> Result<(Keyframe, u64)> {
        let ring = self.ring();
        let index = ring.keyframe_at(t).ok_or_else(|| problem!("no events yet"))?;
        let stored = &ring.pieces[index];
        let held = stored.piece.held.clone().unwrap_or_default();
        let rest = stored.rest.as_ref().map_or_else(|| held.clone(), |rest| rest.to_vec());
        let keyframe = Keyframe { latest: stored.piece.since, events: stored.piece.before, held, rest, tracked: None };
        Ok((keyframe, ring.first + index as u64))
    }

    fn block(&self, number: u64) -> Result<Option<Block>> {
        let ring = self.ring();
        let at = number.max(ring.first);
        #[allow(clippy::cast_possible_truncation)]
        let Some(stored) = ring.pieces.get((at - ring.first) as usize).cloned() else { return Ok(None) };
        drop(ring);
        let piece = &stored.piece;
        let is_gap = at > number || piece.missing > 0 || piece.reset;
        let held = piece.held.as_ref().filter(|_| is_gap).map(|held| (held.clone(), piece.before));
        Ok(Some(Block { next: at + 1, held, changes: piece.changes.clone(), rest: None }))
    }

    fn keyframe_before(&self, t: i64) -> Option<i64> {
        let ring = self.ring();
        ring.pieces
            .iter()
            .rev()
            .filter(|stored| stored.piece.held.is_some())
            .filter_map(|k| k.piece.since)
            .find(|&s| s < t)
    }

    fn time_columns(&self) -> Option<&TimeColumns> {
        None
    }

    fn events_before(&self, t: i64) -> u64 {
        let ring = self.ring();
        ring.keyframe_at(t).map_or(0, |index| ring.pieces[index].piece.before)
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng, rngs::StdRng};

    use super::*;
    use crate::keyframe_index::events::tests::held_at;
    use crate::time_columns::COLUMN_US;
    use crate::view::player::{Player, ViewOptions};

    #[test]
    fn a_minute_is_stored_and_a_view_of_the_past_equals_what_was_decoded() {
        let array = Array::thesis();
        let index = LiveIndex::new(array.clone(), 3);
        let blank = vec![UNKNOWN; array.len()];
        let start = Keyframe::blank(array.len());
        let mut state = ArrayState::new(&array, 3, &start, COLUMN_US, 0);
        index.push(Piece { held: Some(blank.clone()), ..Piece::default() }, &state);
        assert_eq!(index.range(), None);
        index.push(
            Piece {
                changes: vec![TaxelChange { t: 5, taxel: 0, ticks: 50, up: true, repaired: false }],
                ..Piece::default()
            },
            &state,
        );
        index.push(
            Piece {
                changes: vec![TaxelChange { t: 9, taxel: 0, ticks: 51, up: true, repaired: false }],
                ..Piece::default()
            },
            &state,
        );
        assert_eq!(index.range(), Some((5, 9)));
        let index = LiveIndex::new(array.clone(), 3);
        let (mut held, mut all, mut random) = (blank, vec![], StdRng::seed_from_u64(9));
        for n in 0..900_i64 {
            let changes: Vec<TaxelChange> = (0..40)
                .map(|k| TaxelChange {
                    t: n * 100_000 + k * 2000,
                    taxel: random.random_range(0..4096),
                    ticks: random.random_range(20..140),
                    up: true,
                    repaired: false,
                })
                .collect();
            let since = all.last().map(|change: &TaxelChange| change.t);
            let piece = Piece {
                held: Some(held.clone()),
                since,
                before: all.len() as u64,
                changes: changes.clone(),
                ..Piece::default()
            };
            index.push(piece, &state);
            for change in changes {
                held[change.taxel as usize] = change.ticks;
                state.apply_one(&change);
                all.push(change);
            }
        }
        let (first, last) = index.range().unwrap();
        assert!((REACH_US..REACH_US + 1_000_000).contains(&(last - first)), "{} us", last - first);
        for _ in 0..20 {
            let t = random.random_range(first + 6_000_000..=last);
            let player = Player::open(Arc::new(index.clone()), t, ViewOptions::plain(COLUMN_US)).unwrap();
            assert_eq!(player.state().held(), held_at(&all, t, array.len()).0, "at {t} us");
        }
        assert!(index.bytes() < 16 << 20);
    }
}
