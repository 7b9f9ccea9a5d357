//! Tracks which sequence numbers of a board's session have arrived.

use crate::wire::v2::DatagramHeader;

/// How far a datagram may be behind the highest sequence number and still be distinguished from a repeated one.
pub(super) const WINDOW: usize = 65_536;

/// How many datagrams with other contents, as many as came at all, show that a session begins again.
pub(super) const LEAST_UNLIKE: u32 = 8;

/// How a number follows those that came before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Noted {
    /// It is new.
    New,
    /// It came before, with the same contents.
    Again,
    /// It came before, with other contents: another board sent one of the two.
    Unlike,
    /// It is too old to decide.
    Old,
}

/// The state of one session: the datagrams between two resets.
#[derive(Debug, Clone)]
pub(super) struct BoardSession {
    pub(super) number: u16,
    lowest: i64,
    pub(super) highest: i64,
    received: u64,
    /// The number from which on a recording counts, and by how much fewer numbers before it are missing since it began.
    pub(super) from: i64,
    pub(super) filled: i64,
    /// A bit for each number modulo the window: whether its datagram has arrived.
    received_bits: Vec<u64>,
    /// Half of the checksum of the datagram that came under each number, counted from the first one modulo the window; as
    /// many as were needed so far, as most streams are short.
    sums: Vec<u16>,
    first: i64,
    /// Added to the board's times, us.
    pub(super) offset: i64,
    /// The latest base time.
    pub(super) latest: u64,
    /// Number of datagrams whose contents differ from those that came before, since the last one that was ahead.
    pub(super) unlike: u32,
}

impl BoardSession {
    /// The session of a datagram; with `reset` the board was reset before it, so that the numbers from 0 on are missing.
    pub(super) fn new(header: &DatagramHeader, offset: i64, reset: bool) -> Self {
        let first = i64::from(header.sequence);
        // Numbers count modulo 2^32: in the upper half 0 may have come after this one.
        let from_0 = reset && header.sequence < 1 << 31;
        Self {
            number: header.session,
            lowest: if from_0 { 0 } else { first },
            highest: first,
            received: 0,
            from: i64::MIN,
            filled: 0,
            received_bits: vec![0; WINDOW / 64],
            sums: vec![],
            first,
            offset,
            latest: header.base,
            unlike: 0,
        }
    }

    pub(super) fn number_of(&self, sequence: u32) -> i64 {
        self.highest + i64::from(sequence.wrapping_sub(self.highest as u32) as i32)
    }

    /// Whether a datagram comes after all that were received.
    #[inline]
    pub(super) fn is_ahead(&self, header: &DatagramHeader) -> bool {
        self.number == header.session && self.number_of(header.sequence) > self.highest
    }

    /// Whether the datagram of a number was received: one within the window, and at most the highest.
    pub(super) fn has(&self, number: i64) -> bool {
        let (word, bit) = bit_of(number);
        self.received_bits[word] & bit != 0
    }

    /// Whether a number came before, with other contents.
    pub(super) fn differs(&self, number: i64, sum: u32) -> bool {
        let in_window = (self.highest - WINDOW as i64 + 1..=self.highest).contains(&number);
        in_window && self.has(number) && self.sums.get(self.index_of_sum(number)) != Some(&(sum as u16))
    }

    /// Whether as many datagrams differ as came at all, and more than another board sends by chance in that order.
    pub(super) fn is_contradicted(&self) -> bool {
        self.unlike >= LEAST_UNLIKE && u64::from(self.unlike) >= self.received
    }

    #[inline]
    pub(super) fn missing(&self) -> u64 {
        (self.highest - self.lowest + 1) as u64 - self.received
    }

    /// Records a datagram that is ahead of all others, as usual; returns its base time, us. None for any other datagram.
    #[inline(always)]
    pub(super) fn take_ahead(&mut self, header: &DatagramHeader, sum: u32) -> Option<i64> {
        let number = self.number_of(header.sequence);
        if self.unlike > 0 || !(1..=64).contains(&(number - self.highest)) {
            return None;
        }
        self.note_ahead(number, sum);
        self.latest = self.latest.max(header.base);
        Some(self.offset + header.base as i64)
    }

    /// Records a number, and the checksum of its datagram.
    #[inline(always)]
    pub(super) fn note(&mut self, number: i64, sum: u32) -> Noted {
        if (1..=64).contains(&(number - self.highest)) {
            self.note_ahead(number, sum);
            return Noted::New;
        }
        self.note_out_of_turn(number, sum)
    }

    /// Records a number at most 64 ahead, the usual case, and clears the bits of the numbers between, which still
    /// describe numbers one window earlier. Branch-free, because a processor cannot predict after which datagrams
    /// numbers are missing.
    #[inline(always)]
    fn note_ahead(&mut self, number: i64, sum: u32) {
        let (word, bit) = bit_of(number);
        let between = (number - self.highest - 1) as u32;
        let in_word = between.min(bit.trailing_zeros());
        // Masks of the bits just below the number's bit, and at the top of the word before.
        let below = bit - (bit >> in_word);
        let before = (u64::MAX << 1) << (63 - (between - in_word));
        self.received_bits[(word + WINDOW / 64 - 1) % (WINDOW / 64)] &= !before;
        self.received_bits[word] = self.received_bits[word] & !below | bit;
        self.store(number, sum);
        (self.highest, self.received) = (number, self.received + 1);
    }

    #[cold]
    fn note_out_of_turn(&mut self, number: i64, sum: u32) -> Noted {
        if number <= self.highest - WINDOW as i64 {
            return Noted::Old;
        }
        if number > self.highest {
            self.clear((self.highest + 1).max(number + 1 - WINDOW as i64), number);
            self.highest = number;
        }
        let missing = self.missing();
        self.lowest = self.lowest.min(number);
        if self.has(number) {
            return if self.differs(number, sum) { Noted::Unlike } else { Noted::Again };
        }
        let (word, bit) = bit_of(number);
        self.store(number, sum);
        self.received_bits[word] |= bit;
        self.received += 1;
        if number < self.from {
            self.filled += missing as i64 - self.missing() as i64;
        }
        Noted::New
    }

    #[inline(always)]
    fn index_of_sum(&self, number: i64) -> usize {
        (number - self.first) as usize % WINDOW
    }

    /// Stores half of a checksum: two contents that differ have one in 65 536 times.
    #[inline(always)]
    fn store(&mut self, number: i64, sum: u32) {
        let index = self.index_of_sum(number);
        if index >= self.sums.len() {
            self.make_room(index);
        }
        self.sums[index] = sum as u16;
    }

    #[cold]
    fn make_room(&mut self, index: usize) {
        self.sums.resize((index + 1).next_power_of_two().max(1024), 0);
    }

    /// Clears the bits from `first` to `last`, at most a window of them, a word at a time because many may be missing.
    fn clear(&mut self, mut first: i64, last: i64) {
        while first <= last {
            let (word, bit) = bit_of(first);
            let numbers = (64 - i64::from(bit.trailing_zeros())).min(last + 1 - first);
            self.received_bits[word] &= !(bit.wrapping_mul(u64::MAX >> (64 - numbers)));
            first += numbers;
        }
    }
}

fn bit_of(number: i64) -> (usize, u64) {
    let at = number.rem_euclid(WINDOW as i64) as usize;
    (at / 64, 1 << (at % 64))
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use rand::{Rng, SeedableRng, rngs::StdRng};

    use super::*;

    #[test]
    fn a_number_is_new_once_however_far_apart_they_come_and_then_its_contents_are_known() {
        let mut random = StdRng::seed_from_u64(1);
        for begin in [0, 7, u32::MAX - 40_000] {
            let header = DatagramHeader {
                kind: 1,
                board: 0,
                sequence: begin,
                base: 0,
                session: 1,
                stride: 6,
                line: 0,
                flags: 0,
                span: 0,
            };
            let mut session = BoardSession::new(&header, 0, false);
            let (mut received_bits, mut highest) = (BTreeSet::from([i64::from(begin)]), i64::from(begin));
            let mut sums = BTreeMap::from([(highest, 7)]);
            assert_eq!(session.note(highest, 7), Noted::New);
            for _ in 0..20_000 {
                let far = [1, 3, 63, 64, 65, 700, 65_535, 65_536, 65_537, 200_000][random.random_range(0..10)];
                let number = highest + if random.random() { 1 } else { random.random_range(-far..=far) };
                let sum = random.random_range(0..3);
                let expected = match number > highest - WINDOW as i64 {
                    false => Noted::Old,
                    true if received_bits.insert(number) => Noted::New,
                    true if sums[&number] == sum => Noted::Again,
                    true => Noted::Unlike,
                };
                assert_eq!(session.note(number, sum), expected, "{number} of {highest}");
                if expected == Noted::New {
                    sums.insert(number, sum);
                }
                highest = highest.max(number);
            }
            assert_eq!(
                session.missing(),
                (highest + 1 - received_bits.first().unwrap()) as u64 - received_bits.len() as u64
            );
        }
    }
}
