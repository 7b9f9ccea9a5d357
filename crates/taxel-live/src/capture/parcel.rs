//! The format in which datagrams are sent to other computers: unchanged, several in a parcel, with counts that reveal
//! every loss.
//!
//! All numbers are little-endian. The transport changes one field, the base time, so that tests can offset the clocks
//! of two computers; see docs/bridge.md.
//!
//! | bytes | field |
//! |---|---|
//! | 0-3 | `TXLP` |
//! | 4 | 1, the version of this format |
//! | 5 | 1 if it is the last parcel of its session, otherwise 0 |
//! | 6-7 | 0 |
//! | 8-15 | session: a random number, drawn each time a bridge starts |
//! | 16-23 | number of this parcel in its session, from 0 |
//! | 24-31 | base time, ns since 1970 of the computer that the board sends to |
//! | 32-35 | until, ns from the base (signed): every datagram that arrived before it is in this parcel or an earlier
//! one |
//! | 36-39 | number of datagrams |
//! | 40-47 | number of datagrams that the computer had received before them |
//! | 48-55 | number of those that it dropped because its queues were full |
//! | 56-63 | number of messages that its kernel had dropped; 2^64-1 if that is unknown |
//! | 64... | each datagram: its length (u16), its arrival time in ns from the base (i32), its bytes |

use std::hash::{BuildHasher, RandomState};

use crate::kernel_drops::KernelDrops;

const MAGIC: [u8; 4] = *b"TXLP";
const VERSION: u8 = 1;
const HEADER: usize = 64;

/// What stands for a number of dropped messages that is unknown.
const UNKNOWN: u64 = u64::MAX;

/// Length and time before each datagram, bytes.
const ENTRY: usize = 6;

/// A parcel is closed when its body has this length, bytes.
const FULL: usize = 1 << 18;

/// Largest length of a parcel, bytes: a full body and one more datagram.
pub const LONGEST: usize = FULL + HEADER + ENTRY + (1 << 16);

/// A received parcel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Parcel<'a> {
    pub(super) last: bool,
    pub(super) session: u64,
    pub(super) number: u64,
    base_ns: i64,
    until: i32,
    pub(super) count: u32,
    pub(super) before: u64,
    pub(super) dropped: u64,
    pub(super) dropped_by_kernel: KernelDrops,
    body: &'a [u8],
}

impl<'a> Parcel<'a> {
    /// Parses a parcel; `None` if the bytes are not a whole parcel.
    pub(super) fn read(bytes: &'a [u8]) -> Option<Self> {
        let (head, body) = bytes.split_first_chunk::<HEADER>()?;
        let last = match head[4..8] {
            [VERSION, last @ (0 | 1), 0, 0] => last == 1,
            _ => return None,
        };
        let long = |at: usize| u64::from_le_bytes(std::array::from_fn(|k| head[at + k]));
        let short = |at: usize| u32::from_le_bytes(std::array::from_fn(|k| head[at + k]));
        let parcel = Self {
            last,
            session: long(8),
            number: long(16),
            base_ns: long(24).cast_signed(),
            until: short(32).cast_signed(),
            count: short(36),
            before: long(40),
            dropped: long(48),
            dropped_by_kernel: KernelDrops(Some(long(56)).filter(|n| *n != UNKNOWN)),
            body,
        };
        let mut rest = body;
        for _ in 0..parcel.count {
            (_, _, rest) = first(rest)?;
        }
        (head[..4] == MAGIC && rest.is_empty() && bytes.len() <= LONGEST).then_some(parcel)
    }

    /// All datagrams that arrived before this time have been sent, ns of the other computer's clock.
    pub(super) fn until_ns(&self) -> i64 {
        self.base_ns.saturating_add(i64::from(self.until))
    }

    /// Each datagram with its arrival time, ns of the other computer's clock.
    pub(super) fn datagrams(&self) -> impl Iterator<Item = (i64, &'a [u8])> {
        let (mut rest, base) = (self.body, self.base_ns);
        std::iter::from_fn(move || {
            let (since, bytes, after) = first(rest)?;
            rest = after;
            Some((base.saturating_add(i64::from(since)), bytes))
        })
    }
}

/// Arrival time and bytes of the first datagram of a body, and the rest of the body.
fn first(body: &[u8]) -> Option<(i32, &[u8], &[u8])> {
    let (length, body) = body.split_first_chunk()?;
    let (since, body) = body.split_first_chunk()?;
    let (bytes, rest) = body.split_at_checked(usize::from(u16::from_le_bytes(*length)))?;
    Some((i32::from_le_bytes(*since), bytes, rest))
}

/// Gathers datagrams into parcels.
#[derive(Debug)]
pub struct ParcelPacker {
    session: u64,
    number: u64,
    base_ns: i64,
    count: u32,
    before: u64,
    /// The number of the next datagram if none is missing.
    next: u64,
    dropped: u64,
    body: Vec<u8>,
}

impl ParcelPacker {
    /// Starts a session after this number of received datagrams.
    #[must_use]
    pub fn after(received: u64) -> Self {
        Self {
            // A random number; the standard library has no other source of randomness.
            session: RandomState::new().hash_one(std::process::id()),
            number: 0,
            base_ns: 0,
            count: 0,
            before: 0,
            next: received,
            dropped: 0,
            body: vec![],
        }
    }

    /// Number of datagrams in the current parcel.
    #[must_use]
    pub fn waiting(&self) -> u32 {
        self.count
    }

    /// Adds a datagram, with its number among those received; returns the previous parcel if the datagram does not fit
    /// into it.
    pub fn push(
        &mut self,
        number: u64,
        arrived_ns: i64,
        bytes: &[u8],
        dropped_by_kernel: KernelDrops,
    ) -> Option<Vec<u8>> {
        let since = arrived_ns.checked_sub(self.base_ns).and_then(|since| i32::try_from(since).ok());
        let fits = self.next == number && since.is_some() && self.body.len() + bytes.len() <= FULL;
        let closed = (self.count > 0 && !fits).then(|| self.close(i64::MIN, dropped_by_kernel, false));
        self.dropped += number.saturating_sub(self.next);
        if self.count == 0 {
            (self.base_ns, self.before) = (arrived_ns, number);
        }
        // The length of a datagram fits in a u16, and a parcel's first datagram defines its base time.
        let length = u16::try_from(bytes.len()).unwrap_or(u16::MAX);
        let since = i32::try_from(arrived_ns.saturating_sub(self.base_ns)).unwrap_or(0);
        self.body.extend_from_slice(&length.to_le_bytes());
        self.body.extend_from_slice(&since.to_le_bytes());
        self.body.extend_from_slice(&bytes[..usize::from(length)]);
        self.count += 1;
        self.next = number + 1;
        closed
    }

    /// Closes the parcel, which may be empty: all datagrams that arrived before `until_ns` are in it or in earlier ones.
    pub fn close(&mut self, until_ns: i64, dropped_by_kernel: KernelDrops, last: bool) -> Vec<u8> {
        if self.count == 0 {
            (self.base_ns, self.before) = (until_ns, self.next);
        }
        // Without a time the parcel makes no promise.
        let until = until_ns.saturating_sub(self.base_ns).clamp(i64::from(i32::MIN), i64::from(i32::MAX));
        let mut parcel = Vec::with_capacity(HEADER + self.body.len());
        parcel.extend_from_slice(&MAGIC);
        parcel.extend_from_slice(&[VERSION, u8::from(last), 0, 0]);
        parcel.extend_from_slice(&self.session.to_le_bytes());
        parcel.extend_from_slice(&self.number.to_le_bytes());
        parcel.extend_from_slice(&self.base_ns.to_le_bytes());
        parcel.extend_from_slice(&i32::try_from(until).unwrap_or(i32::MIN).to_le_bytes());
        parcel.extend_from_slice(&self.count.to_le_bytes());
        parcel.extend_from_slice(&self.before.to_le_bytes());
        parcel.extend_from_slice(&self.dropped.to_le_bytes());
        parcel.extend_from_slice(&dropped_by_kernel.0.unwrap_or(UNKNOWN).to_le_bytes());
        parcel.append(&mut self.body);
        self.number += 1;
        self.count = 0;
        parcel
    }

    /// Counts the datagrams of a closed parcel that did not fit in the queue as dropped.
    pub fn count_dropped(&mut self, parcel: &[u8]) {
        self.dropped += Parcel::read(parcel).map_or(0, |parcel| u64::from(parcel.count));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_packed_is_unpacked() {
        let mut packer = ParcelPacker::after(0);
        let sent: Vec<(i64, Vec<u8>)> = (0..3000)
            .map(|k: i64| (7_000_000_000 + k * k * 1000, vec![(k % 251) as u8; (k * 7 % 1400) as usize]))
            .collect();
        let mut parcels = vec![];
        for (k, (at, bytes)) in sent.iter().enumerate() {
            parcels.extend(packer.push(k as u64, *at, bytes, KernelDrops(Some(3))));
        }
        parcels.push(packer.close(sent.last().expect("some").0 + 5, KernelDrops(Some(3)), true));
        assert!(parcels.len() > 5, "full ones are closed, and those that last too long");
        let mut got = vec![];
        for (k, bytes) in parcels.iter().enumerate() {
            assert!(bytes.len() <= LONGEST);
            let parcel = Parcel::read(bytes).expect("whole");
            assert_eq!((parcel.number, parcel.before), (k as u64, got.len() as u64));
            assert_eq!((parcel.dropped, parcel.dropped_by_kernel), (0, KernelDrops(Some(3))));
            assert_eq!(parcel.last, k + 1 == parcels.len());
            got.extend(parcel.datagrams().map(|(at, bytes)| (at, bytes.to_vec())));
        }
        assert_eq!(got, sent);
        assert_eq!(Parcel::read(parcels.last().expect("one")).expect("whole").until_ns(), sent[2999].0 + 5);
    }

    #[test]
    fn datagrams_that_a_queue_dropped_are_counted() {
        let mut packer = ParcelPacker::after(10);
        assert!(packer.push(10, 0, b"ten", KernelDrops::default()).is_none());
        let parcel = packer.push(15, 0, b"fifteen", KernelDrops::UNKNOWN).expect("11 to 14 are missing");
        assert_eq!(Parcel::read(&parcel).expect("whole").dropped, 0);
        let parcel = packer.close(1, KernelDrops::UNKNOWN, false);
        let read = Parcel::read(&parcel).expect("whole");
        assert_eq!((read.before, read.dropped, read.count), (15, 4, 1));
        assert_eq!(read.dropped_by_kernel, KernelDrops::UNKNOWN);
        packer.count_dropped(&parcel);
        let read = packer.close(2, KernelDrops::default(), false);
        let read = Parcel::read(&read).expect("whole");
        assert_eq!((read.number, read.before, read.dropped, read.count), (2, 16, 5, 0));
    }

    #[test]
    fn what_is_cut_or_changed_is_refused_or_read_and_never_a_panic() {
        let mut packer = ParcelPacker::after(0);
        for k in 0..3 {
            packer.push(k, i64::MAX - 5, b"bytes", KernelDrops::default());
        }
        let whole = packer.close(i64::MAX, KernelDrops::default(), false);
        assert!(Parcel::read(&whole).is_some());
        for cut in 0..whole.len() {
            assert!(Parcel::read(&whole[..cut]).is_none(), "{cut}");
        }
        assert!(Parcel::read(&[&whole[..], &[0]].concat()).is_none());
        for at in 0..whole.len() {
            for bit in 0..8 {
                let mut flipped = whole.clone();
                flipped[at] ^= 1 << bit;
                if let Some(parcel) = Parcel::read(&flipped) {
                    assert_eq!(parcel.datagrams().count() as u32, parcel.count);
                    let _ = parcel.until_ns();
                }
            }
        }
    }
}
