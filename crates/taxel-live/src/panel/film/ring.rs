//! The film of what comes while live: the last minute, or what 512 MB hold.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard};

use taxel_core::{Array, problem};

use super::rate::Rate;
use super::{Film, Next, Reel};
use crate::Result;
use crate::locked::lock;
use crate::panel::lens::{History, Keyframe, Lens, SPAN, Strip};
use crate::pipeline::{Change, Piece, UNKNOWN};

/// How far back a live view may look, us ...
pub(in crate::panel) const REACH_US: i64 = 60_000_000;
/// ... and what that may cost, bytes.
const REACH_BYTES: usize = 512 << 20;

/// A piece in the ring.
#[derive(Debug)]
pub struct Kept {
    /// What came.
    pub piece: Piece,
    rest: Option<Arc<Vec<u16>>>,
    bytes: usize,
}

/// Its pieces.
#[derive(Debug)]
struct Ring {
    pieces: VecDeque<Arc<Kept>>,
    /// The number of the first.
    first: u64,
    bytes: usize,
    latest: Option<i64>,
    rest: Option<(u64, Arc<Vec<u16>>)>,
}

/// See the module.
#[derive(Debug, Clone)]
pub struct RingFilm {
    ring: Arc<Mutex<Ring>>,
    array: Array,
    floor: u16,
}

impl RingFilm {
    /// An empty one.
    #[must_use]
    pub fn new(array: Array, floor: u16) -> Self {
        let ring = Ring { pieces: VecDeque::new(), first: 0, bytes: 0, latest: None, rest: None };
        Self { ring: Arc::new(Mutex::new(ring)), array, floor }
    }

    fn ring(&self) -> MutexGuard<'_, Ring> {
        lock(&self.ring)
    }

    /// Keeps a piece; `lens` is as it was before it.
    pub fn keep(&self, piece: Piece, lens: &Lens) -> Arc<Kept> {
        let mut ring = self.ring();
        let rest = piece.held.is_some().then(|| {
            if ring.rest.as_ref().is_none_or(|(rests, _)| *rests != lens.rests()) {
                ring.rest = Some((lens.rests(), Arc::new(lens.rest().to_vec())));
            }
            Arc::clone(&ring.rest.as_ref().expect("it was put there").1)
        });
        let held = piece.held.as_ref().map_or(0, Vec::len);
        let bytes = piece.changes.len() * size_of::<Change>() + 4 * held + size_of::<Kept>();
        ring.latest = ring.latest.max(piece.changes.iter().map(|c| c.t).max());
        ring.bytes += bytes;
        let kept = Arc::new(Kept { piece, rest, bytes });
        ring.pieces.push_back(Arc::clone(&kept));
        let latest = ring.latest;
        // The first is always one to begin with.
        loop {
            let second = ring.pieces.iter().skip(1).position(|kept| kept.piece.held.is_some()).map(|k| k + 1);
            let Some(second) = second else { break };
            let old = ring.pieces[second].piece.since.zip(latest).is_some_and(|(since, now)| now - since > REACH_US);
            if !old && ring.bytes <= REACH_BYTES {
                break;
            }
            for _ in 0..second {
                let gone = ring.pieces.pop_front().map_or(0, |kept| kept.bytes);
                ring.bytes -= gone;
                ring.first += 1;
            }
        }
        kept
    }

    /// How many pieces have come; [`RingFilm::changes_from`] goes on there.
    #[must_use]
    pub fn come_to(&self) -> u64 {
        let ring = self.ring();
        ring.first + ring.pieces.len() as u64
    }

    /// Hands out the changes of the pieces from a number on; gives the next number.
    pub fn changes_from(&self, number: u64, mut take: impl FnMut(&[Change])) -> u64 {
        let mut number = number;
        loop {
            let kept = {
                let ring = self.ring();
                number = number.max(ring.first);
                #[allow(clippy::cast_possible_truncation)]
                ring.pieces.get((number - ring.first) as usize).cloned()
            };
            let Some(kept) = kept else { return number };
            take(&kept.piece.changes);
            number += 1;
        }
    }

    /// The history of a taxel up to now by columns of so many us, and where to go on.
    #[must_use]
    pub fn history(&self, taxel: u32, column_us: i64) -> (History, u64) {
        let from = self.range().map_or(0, |(_, latest)| latest - SPAN * column_us);
        let (number, held, since) = {
            let ring = self.ring();
            let place = ring.begin(from).unwrap_or(0);
            let kept = ring.pieces.get(place);
            let held = kept.and_then(|kept| kept.piece.held.as_ref());
            (
                ring.first + place as u64,
                held.map_or(UNKNOWN, |held| held[taxel as usize]),
                kept.and_then(|k| k.piece.since),
            )
        };
        let mut history = History::new(taxel, held, since, column_us);
        let number = self.changes_from(number, |changes| changes.iter().for_each(|change| history.take(change)));
        (history, number)
    }

    /// Bytes of memory.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.ring().bytes
    }

    /// Events by bin from the first time on: step us, counts.
    #[must_use]
    pub fn rate(&self) -> (i64, i64, Vec<u64>) {
        let mut rate = Rate::default();
        let first = self.ring().first;
        self.changes_from(first, |changes| changes.iter().for_each(|change| rate.take(change.t, 1)));
        rate.said()
    }
}

impl Ring {
    /// The place of the last keyframe at or before a time, or of the first.
    fn begin(&self, t: i64) -> Option<usize> {
        let whole = |kept: &Arc<Kept>| kept.piece.held.is_some();
        let last = self.pieces.iter().rposition(|kept| whole(kept) && kept.piece.since.is_none_or(|since| since <= t));
        last.or_else(|| self.pieces.iter().position(whole))
    }
}

struct RingReel {
    film: RingFilm,
    number: u64,
    /// The piece whose held values were told.
    told: Option<u64>,
}

impl Reel for RingReel {
    fn next(&mut self, out: &mut Vec<Change>) -> Result<Next> {
        let ring = self.film.ring();
        let lost = self.number < ring.first;
        self.number = self.number.max(ring.first);
        #[allow(clippy::cast_possible_truncation)]
        let Some(kept) = ring.pieces.get((self.number - ring.first) as usize).cloned() else { return Ok(Next::End) };
        drop(ring);
        if (lost || kept.piece.missing > 0 || kept.piece.reset)
            && self.told != Some(self.number)
            && let Some(held) = &kept.piece.held
        {
            self.told = Some(self.number);
            return Ok(Next::Held(held.clone(), kept.piece.before));
        }
        out.extend_from_slice(&kept.piece.changes);
        self.number += 1;
        Ok(Next::Changes)
    }
}

impl Film for RingFilm {
    fn array(&self) -> &Array {
        &self.array
    }

    fn floor(&self) -> u16 {
        self.floor
    }

    fn range(&self) -> Option<(i64, i64)> {
        let ring = self.ring();
        let latest = ring.latest?;
        // Before anything came there are pieces that hold nothing.
        let begin = |kept: &Arc<Kept>| kept.piece.since.or(kept.piece.changes.first().map(|c| c.t));
        Some((ring.pieces.iter().find_map(begin).unwrap_or(latest), latest))
    }

    fn open(&self, t: i64) -> Result<(Keyframe, Box<dyn Reel>)> {
        let ring = self.ring();
        let place = ring.begin(t).ok_or_else(|| problem!("nothing came yet"))?;
        let kept = &ring.pieces[place];
        let held = kept.piece.held.clone().unwrap_or_default();
        let rest = kept.rest.as_ref().map_or_else(|| held.clone(), |rest| rest.to_vec());
        let frame = Keyframe { latest: kept.piece.since, events: kept.piece.before, held, rest };
        let number = ring.first + place as u64;
        drop(ring);
        Ok((frame, Box::new(RingReel { film: self.clone(), number, told: Some(number) })))
    }

    fn earlier(&self, t: i64) -> Option<i64> {
        let ring = self.ring();
        ring.pieces.iter().rev().filter(|kept| kept.piece.held.is_some()).filter_map(|k| k.piece.since).find(|&s| s < t)
    }

    fn strip(&self) -> Option<&Strip> {
        None
    }

    fn events_before(&self, t: i64) -> u64 {
        let ring = self.ring();
        ring.begin(t).map_or(0, |place| ring.pieces[place].piece.before)
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng, rngs::StdRng};

    use super::*;
    use crate::panel::film::file::tests::held_at;
    use crate::panel::lens::COLUMN_US;
    use crate::panel::player::{Gaze, Player};

    #[test]
    fn the_ring_keeps_a_minute_and_a_view_back_sees_what_was() {
        let array = Array::thesis();
        let film = RingFilm::new(array.clone(), 3);
        let blank = vec![UNKNOWN; array.len()];
        let start = Keyframe { latest: None, events: 0, held: blank.clone(), rest: blank.clone() };
        let mut lens = Lens::new(array.columns, 3, &start, COLUMN_US, 0);
        // Who looks before anything came is told so.
        film.keep(Piece { held: Some(blank.clone()), ..Piece::default() }, &lens);
        assert_eq!(film.range(), None);
        film.keep(
            Piece {
                changes: vec![Change { t: 5, taxel: 0, ticks: 50, up: true, repaired: false }],
                ..Piece::default()
            },
            &lens,
        );
        film.keep(
            Piece {
                changes: vec![Change { t: 9, taxel: 0, ticks: 51, up: true, repaired: false }],
                ..Piece::default()
            },
            &lens,
        );
        assert_eq!(film.range(), Some((5, 9)));
        let film = RingFilm::new(array.clone(), 3);
        let (mut held, mut all, mut random) = (blank, vec![], StdRng::seed_from_u64(9));
        for n in 0..900_i64 {
            let changes: Vec<Change> = (0..40)
                .map(|k| Change {
                    t: n * 100_000 + k * 2000,
                    taxel: random.random_range(0..4096),
                    ticks: random.random_range(20..140),
                    up: true,
                    repaired: false,
                })
                .collect();
            let since = all.last().map(|change: &Change| change.t);
            let piece = Piece {
                held: Some(held.clone()),
                since,
                before: all.len() as u64,
                changes: changes.clone(),
                ..Piece::default()
            };
            film.keep(piece, &lens);
            for change in changes {
                held[change.taxel as usize] = change.ticks;
                lens.take(&change);
                all.push(change);
            }
        }
        let (first, last) = film.range().unwrap();
        assert!((REACH_US..REACH_US + 1_000_000).contains(&(last - first)), "{} us", last - first);
        for _ in 0..20 {
            let t = random.random_range(first + 6_000_000..=last);
            let player = Player::open(Arc::new(film.clone()), t, Gaze::plain(COLUMN_US)).unwrap();
            assert_eq!(player.lens().held(), held_at(&all, t, array.len()).0, "at {t} us");
        }
        assert!(film.bytes() < 16 << 20);
    }
}
