//! Tells datagrams of version 1 that come again, as a network may deliver one twice.
//!
//! Version 1 does not number its datagrams, but a board's stamps never step back: after a datagram with events at two times,
//! or more, the next one begins no earlier than it ended, so that an equal one is the same one. Datagrams with events at one
//! time only may legitimately equal each other, where two frames fall into one stamp; not those whose events all have values,
//! if no event of their taxels came since: a board sends a value only where it is not the one it sent last.

use std::collections::VecDeque;

use crate::Array;
use crate::Events;
use crate::wire::decode;
use crate::wire::silence;

/// Number of datagrams that one is compared with.
const DATAGRAMS: usize = 8;

/// Stamps come again after 6.5536 s: what arrives later than this, us, is another datagram.
const WITHIN_US: i64 = 3_000_000;

/// The last datagrams, the latest first, each with the time of its arrival.
#[derive(Debug, Clone, Default)]
pub(super) struct RecentDatagrams(VecDeque<(Vec<u8>, Option<i64>)>);

impl RecentDatagrams {
    /// Adds a datagram; returns whether it was received before. `values`: intensities are values, not differences.
    pub(super) fn repeats(&mut self, datagram: &[u8], arrived: Option<i64>, array: &Array, values: bool) -> bool {
        let before = self.0.iter().position(|(known, then)| {
            known == datagram && then.zip(arrived).is_none_or(|(then, now)| silence(then, now) < WITHIN_US)
        });
        if let Some(before) = before {
            let events = |datagram| decode(datagram, array.clone()).0;
            let again = events(datagram);
            let since = self.0.iter().take(before).map(|(known, _)| events(known));
            if has_two_times(&again) || (values && has_values(&again) && has_no_repeated_taxel(&again, since)) {
                return true;
            }
        }
        let mut room = if self.0.len() == DATAGRAMS { self.0.pop_back() } else { None }.unwrap_or_default();
        room.0.clear();
        room.0.extend_from_slice(datagram);
        self.0.push_front((room.0, arrived));
        false
    }
}

fn has_two_times(events: &Events) -> bool {
    events.t.iter().any(|t| *t != events.t[0])
}

/// Whether there are events, and all have values.
fn has_values(events: &Events) -> bool {
    events.intensity.as_ref().is_some_and(|intensity| intensity.present.iter().all(|&present| present))
}

/// Whether no taxel has a second event, among these or those that came since.
fn has_no_repeated_taxel(events: &Events, since: impl Iterator<Item = Events>) -> bool {
    let taxels = |events: &Events| events.x.iter().copied().zip(events.y.iter().copied()).collect::<Vec<_>>();
    let mut touched = taxels(events);
    touched.sort_unstable();
    touched.windows(2).all(|pair| pair[0] != pair[1])
        && !since.flat_map(|events| taxels(&events)).any(|taxel| touched.binary_search(&taxel).is_ok())
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

    /// A datagram of one time with the values of some taxels.
    fn frame(values: &[(u16, u16)]) -> Vec<u8> {
        let mut events = Events::empty(Array::thesis());
        for &(x, ticks) in values {
            events.t.push(300);
            events.x.push(x);
            events.y.push(7);
            events.p.push(true);
            let intensity = events.intensity.get_or_insert_default();
            intensity.ticks.push(ticks);
            intensity.present.push(true);
        }
        encode(events.view()).unwrap()
    }

    fn repeated(datagrams: &[(&[u8], Option<i64>)]) -> u64 {
        repeated_of(datagrams, false)
    }

    fn repeated_of(datagrams: &[(&[u8], Option<i64>)], differences: bool) -> u64 {
        let mut sender = SenderDecoder::new(Decoder::new(Array::thesis()).differences(differences), 1);
        let mut events = Events::empty(Array::thesis());
        for (datagram, arrived) in datagrams {
            sender.push(datagram, *arrived, &mut events);
        }
        sender.totals().repeated
    }

    #[test]
    fn datagrams_that_come_again_are_counted_also_behind_some_others() {
        let all = sent(40, 100);
        for behind in 0..DATAGRAMS {
            let mut came: Vec<(&[u8], Option<i64>)> = vec![];
            for (k, datagram) in all.iter().enumerate() {
                came.push((datagram, Some(k as i64 * 1000)));
                if k >= behind && k % 10 == 9 {
                    came.push((&all[k - behind], Some(k as i64 * 1000)));
                    came.push((&all[k - behind], None));
                }
            }
            assert_eq!(repeated(&came), 8, "{behind} behind");
        }
        let mut in_turn = all.clone();
        in_turn.swap(3, 4);
        assert_eq!(repeated(&in_turn.iter().map(|datagram| (&datagram[..], None)).collect::<Vec<_>>()), 0);
    }

    #[test]
    fn a_frame_with_values_that_comes_again_is_counted_unless_its_taxels_moved_since() {
        let (first, second, back) = (frame(&[(3, 90), (4, 80)]), frame(&[(9, 90)]), frame(&[(4, 60)]));
        assert_eq!(repeated(&[(&first, Some(0)), (&second, Some(10)), (&first, Some(20))]), 1);
        assert_eq!(repeated(&[(&second, None), (&second, None), (&second, None)]), 2);
        // One of its taxels had another value between them.
        assert_eq!(repeated(&[(&first, Some(0)), (&back, Some(48)), (&first, Some(96))]), 0);
        assert_eq!(repeated(&[(&first, Some(0)), (&first, Some(6_553_600))]), 0);
        // Two equal differences in one stamp are two frames, and so are two of a taxel in one datagram.
        assert_eq!(repeated_of(&[(&first, Some(0)), (&first, Some(48))], true), 0);
        let twice = frame(&[(3, 90), (3, 80)]);
        assert_eq!(repeated(&[(&twice, Some(0)), (&twice, Some(48))]), 0);
        // Without values nothing tells them apart.
        assert_eq!(repeated(&[(&first[..5], Some(0)), (&first[..5], Some(48))]), 0);
    }

    #[test]
    fn equal_frames_within_one_stamp_and_a_turn_later_are_no_repetition() {
        let at_once = &sent(1, 0)[0];
        assert_eq!(repeated(&[(at_once, Some(0)), (at_once, Some(48))]), 0);
        let datagram = &sent(1, 100)[0];
        assert_eq!(repeated(&[(datagram, Some(0)), (datagram, Some(6_553_600))]), 0);
        assert_eq!(repeated(&[(datagram, Some(0)), (datagram, Some(10_000))]), 1);
        assert_eq!(repeated(&[(&datagram[..5], None), (&datagram[..5], None), (&[], None), (&[], None)]), 0);
    }
}
