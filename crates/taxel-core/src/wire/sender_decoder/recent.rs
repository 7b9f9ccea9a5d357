//! Tells datagrams of version 1 that come again, as a network may deliver one twice.
//!
//! Version 1 does not number its datagrams, but a board's stamps never step back: after a datagram with events at two times,
//! or more, the next one begins no earlier than it ended. One that begins and ends as it did, and is as long, is the same
//! one. Datagrams with events at one time only may legitimately equal each other, where two frames fall into one stamp.

use crate::Array;
use crate::wire::silence::silence;
use crate::wire::{Pairing, decode};

/// Number of datagrams that one is compared with.
const DATAGRAMS: usize = 8;

/// Stamps come again after 6.5536 s: what arrives later than this, us, is another datagram.
const WITHIN_US: i64 = 3_000_000;

/// First and last eight bytes, and the length.
type Seen = ([u8; 8], [u8; 8], usize);

/// The last datagrams.
#[derive(Debug, Clone, Default)]
pub(super) struct Recent {
    /// Each with the time of its arrival.
    datagrams: [(Seen, Option<i64>); DATAGRAMS],
    next: usize,
}

impl Recent {
    /// Adds a datagram; returns whether it was received before.
    pub(super) fn repeats(&mut self, datagram: &[u8], arrived: Option<i64>, array: &Array) -> bool {
        let (Some(first), Some(last)) = (datagram.first_chunk(), datagram.last_chunk()) else { return false };
        let seen = (*first, *last, datagram.len());
        let again = self.datagrams.iter().any(|&(known, then)| {
            known == seen && then.zip(arrived).is_none_or(|(then, now)| silence(then, now) < WITHIN_US)
        });
        if again && has_two_times(datagram, array) {
            return true;
        }
        self.datagrams[self.next] = (seen, arrived);
        self.next = (self.next + 1) % DATAGRAMS;
        false
    }
}

/// Whether a datagram has events at two times, or more.
fn has_two_times(datagram: &[u8], array: &Array) -> bool {
    let (events, _) = decode(datagram, array.clone(), Pairing::Direct);
    events.t.iter().any(|t| *t != events.t[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Events;
    use crate::wire::{Decoder, SenderDecoder, encode};

    /// Datagrams of ten events each, `every` us apart.
    fn sent(n: i64, every: i64) -> Vec<Vec<u8>> {
        let mut all = vec![];
        for k in 0..n {
            let mut events = Events::empty(Array::thesis());
            events.t = (0..10).map(|j| (k * 10 + j) * every).collect();
            events.x = (0..10).collect();
            (events.y, events.p) = (vec![3; 10], vec![true; 10]);
            all.push(encode(events.view()).unwrap());
        }
        all
    }

    fn repeated(datagrams: &[(&[u8], Option<i64>)]) -> u64 {
        let mut sender = SenderDecoder::new(Decoder::new(Array::thesis()), 1);
        let mut events = Events::empty(Array::thesis());
        for (datagram, arrived) in datagrams {
            sender.push(datagram, *arrived, &mut events);
        }
        sender.repeated()
    }

    #[test]
    fn datagrams_that_come_again_are_counted_also_behind_some_others() {
        let all = sent(40, 100);
        for behind in 0..DATAGRAMS {
            let mut came: Vec<(&[u8], Option<i64>)> = vec![];
            for (k, one) in all.iter().enumerate() {
                came.push((one, Some(k as i64 * 1000)));
                if k >= behind && k % 10 == 9 {
                    came.push((&all[k - behind], Some(k as i64 * 1000)));
                    came.push((&all[k - behind], None));
                }
            }
            assert_eq!(repeated(&came), 8, "{behind} behind");
        }
        let mut in_turn = all.clone();
        in_turn.swap(3, 4);
        assert_eq!(repeated(&in_turn.iter().map(|one| (&one[..], None)).collect::<Vec<_>>()), 0);
    }

    #[test]
    fn equal_frames_within_one_stamp_and_a_turn_later_are_no_repetition() {
        let at_once = &sent(1, 0)[0];
        assert_eq!(repeated(&[(at_once, Some(0)), (at_once, Some(48))]), 0);
        let one = &sent(1, 100)[0];
        assert_eq!(repeated(&[(one, Some(0)), (one, Some(6_553_600))]), 0);
        assert_eq!(repeated(&[(one, Some(0)), (one, Some(10_000))]), 1);
        assert_eq!(repeated(&[(&one[..5], None), (&one[..5], None), (&[], None), (&[], None)]), 0);
    }
}
