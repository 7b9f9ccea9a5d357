//! Cuts raw bytes of version 1 into datagrams, as a recorder would have received them.

use super::decoder::clock::StampClock;
use super::v1::{FIRST, STAMP_US, WORD_BYTES, Word};

/// Largest datagram, bytes: 280 words.
const MOST_BYTES: usize = 1400;

/// Longest time from a datagram's first stamp to its last, us. A reader assumes that a time is within half a turn of
/// the stamps.
const LONGEST_US: i64 = 1_000_000;

/// Datagrams, stored one after the other.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CutDatagrams {
    /// Where each datagram begins, and where the last one ends.
    pub offsets: Vec<usize>,
    /// The board's time of each datagram's first stamp, us, which stands for its arrival time; never decreases.
    pub times: Vec<i64>,
}

/// Cuts bytes into datagrams, never between a change and its intensity.
///
/// The bytes have no arrival times. Each datagram gets the time of its first stamp, unwrapped from the stamps alone, so
/// that a reader can unwrap the stamps again; a datagram spans at most a second.
#[must_use]
pub fn cut(bytes: &[u8]) -> CutDatagrams {
    let stamped = stamped(bytes);
    let mut cut = CutDatagrams { offsets: vec![0], times: vec![] };
    let (mut begin, mut k) = (0, 0);
    while begin < bytes.len() {
        k += stamped[k..].partition_point(|&(at, _)| at < begin);
        let now = stamped.get(k).or(stamped.last()).map_or(0, |&(_, t)| t);
        let late = stamped[k..].partition_point(|&(_, t)| t <= now + LONGEST_US);
        let fits = match begin + MOST_BYTES {
            limit if limit >= bytes.len() => stamped.len() - k,
            limit => stamped[k..].partition_point(|&(at, _)| at <= limit).saturating_sub(1),
        };
        let wanted = stamped.get(k + late.min(fits)).map_or(bytes.len(), |&(at, _)| at);
        let most = bytes.len().min(begin + MOST_BYTES);
        // If no word with a time begins within reach, as in damaged data, only the length bounds a datagram.
        begin = if (begin + 1..=most).contains(&wanted) { wanted } else { most };
        cut.offsets.push(begin);
        cut.times.push(now);
    }
    cut
}

/// Offsets of the whole words that have a time (changes and markers), and the latest time up to each, us.
fn stamped(bytes: &[u8]) -> Vec<(usize, i64)> {
    let mut clock = StampClock::default();
    let (mut found, mut latest, mut at) = (vec![], i64::MIN, 0);
    while let Some(word) = bytes.get(at..).and_then(|rest| rest.first_chunk::<WORD_BYTES>()) {
        let is_word = word[0] & FIRST != 0 && word[1..].iter().all(|byte| byte & FIRST == 0);
        if !is_word {
            at += 1;
            continue;
        }
        if let Word::Change { stamp, .. } | Word::Marker { stamp, .. } = Word::from_bytes(*word) {
            latest = latest.max(clock.unwrap(stamp, None).0 * STAMP_US);
            found.push((at, latest));
        }
        at += WORD_BYTES;
    }
    found
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng, rngs::StdRng};

    use super::*;
    use crate::wire::{Decoder, decode};
    use crate::{Array, Events};

    fn bytes(words: &[Word]) -> Vec<u8> {
        words.iter().flat_map(|word| word.to_bytes()).collect()
    }

    #[test]
    fn datagrams_give_the_events_of_the_whole_and_their_times() {
        let mut random = StdRng::seed_from_u64(4);
        for _ in 0..200 {
            let (mut words, mut t) = (vec![], 0_i64);
            for _ in 0..random.random_range(0..2000) {
                t += [0, 0, 1, 2, 500, 20_000, 64_000, -900][random.random_range(0..8)];
                let (x, y, p) = (random.random_range(0..64), random.random_range(0..64), random.random());
                words.push(Word::Change { stamp: t.rem_euclid(65_536) as u16, x, y, p });
                if random.random() {
                    words.push(Word::Intensity { ticks: random.random(), x, y, p });
                }
            }
            let mut stream = bytes(&words);
            for _ in 0..random.random_range(0..5) {
                if !stream.is_empty() {
                    let at = random.random_range(0..stream.len());
                    stream[at] = random.random();
                }
            }
            let cut = cut(&stream);
            assert_eq!((cut.offsets[0], *cut.offsets.last().unwrap()), (0, stream.len()));
            assert_eq!(cut.times.len() + 1, cut.offsets.len());
            assert!(cut.times.is_sorted(), "arrivals never step back");
            let mut decoder = Decoder::new(Array::thesis());
            let mut events = Events::empty(Array::thesis());
            for (part, &t) in cut.offsets.windows(2).zip(&cut.times) {
                assert!((1..=MOST_BYTES).contains(&(part[1] - part[0])));
                decoder.push(&stream[part[0]..part[1]], Some(t), &mut events);
                decoder.end_of_datagram(&mut events);
            }
            decoder.finish(&mut events);
            let (whole, _) = decode(&stream, Array::thesis());
            assert_eq!((&events.t, &events.x, &events.intensity), (&whole.t, &whole.x, &whole.intensity));
        }
    }
}
