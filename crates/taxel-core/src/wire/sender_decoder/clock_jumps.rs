//! Detects where the times of version 1 jump ahead of the host's clock, as they do after a damaged stamp: the stamps that
//! follow seem to lie a turn of the 16-bit counter later, and all times since are 6.5536 s too late. A reset of the board has
//! the same effect: times are late by the rest of the turn.

use crate::events::FARTHEST_BACK_US;

/// Reading: a board's time that gains so much on the host's clock has jumped, us: more than datagrams are late by when the first
/// ones come, and less than half a turn of the counter, as a damaged stamp and the next one may gain half a turn each.
const JUMP_US: i64 = 1_000_000;

/// Reading: a board's clock drifts less than 1 in this against the host's.
const DRIFT: i64 = 1000;

/// Detects jumps of a sender's time ahead of the host's clock.
///
/// Compared are datagrams: how far the last stamp of each is ahead of its arrival, against the most before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct ClockJumps {
    /// The most that a stamp was ahead of its arrival, us, and the last arrival.
    most: Option<(i64, i64)>,
    /// How much farther ahead the last datagram was, and the newest time before it, if that was more than
    /// [`FARTHEST_BACK_US`].
    rose: Option<(i64, i64)>,
}

impl ClockJumps {
    /// Notes a datagram: the newest time before it, the times of its first and its last stamp, and its arrival, us. Returns the
    /// newest time before the jump if this datagram shows one.
    pub(super) fn note(&mut self, newest: Option<i64>, first: i64, last: i64, arrived: i64) -> Option<i64> {
        let ahead = |t: i64| t.saturating_sub(arrived);
        let allowed = match self.most {
            Some((most, then)) if then <= arrived => most.saturating_sub(arrived.saturating_sub(then) / DRIFT),
            // The first datagram, or the host's clock was set back.
            _ => ahead(first),
        };
        let rise = ahead(last).saturating_sub(allowed);
        let before = newest.unwrap_or(first);
        let rose = self.rose.take();
        let jumped = rise > JUMP_US && rose.is_none_or(|(rise, _)| rise <= JUMP_US);
        // One datagram alone may be ahead by its damaged last stamp.
        let stays = rise <= FARTHEST_BACK_US || rose.is_some();
        self.rose = (!stays).then_some((rise, before));
        self.most = Some((if stays { allowed.max(ahead(last)) } else { allowed }, arrived));
        jumped.then(|| rose.map_or(before, |(_, before)| before))
    }
}

#[cfg(test)]
mod tests {
    use crate::wire::SenderDecoder;
    use crate::wire::decoder::Decoder;
    use crate::wire::v1::Word;
    use crate::{Array, Events};

    /// The decoder after datagrams of stamps, each with its arrival, us.
    fn decode(datagrams: impl IntoIterator<Item = (Vec<u16>, i64)>) -> (SenderDecoder, Events) {
        let mut decoder = SenderDecoder::new(Decoder::new(Array::thesis()), 1);
        let mut events = Events::empty(Array::thesis());
        for (stamps, arrived) in datagrams {
            let words = stamps.iter().flat_map(|&stamp| Word::Change { stamp, x: 3, y: 4, p: true }.to_bytes());
            decoder.push(&words.collect::<Vec<_>>(), Some(arrived), &mut events);
        }
        (decoder, events)
    }

    /// A datagram of three stamps every 10 ms, from `from` on.
    fn regular(from: i64, count: i64) -> impl Iterator<Item = (Vec<u16>, i64)> {
        (from..from + count).map(|k| ((0..3).map(|n| (100 * k + n) as u16).collect(), 7_000_000 + 10_000 * k))
    }

    #[test]
    fn a_damaged_stamp_makes_times_doubtful_from_there_on() {
        for flipped in [1 << 11, 1 << 14, 1 << 15] {
            for word in 0..3 {
                let mut datagrams: Vec<_> = regular(1, 100).collect();
                datagrams[50].0[word] ^= flipped;
                let (decoder, events) = decode(datagrams);
                assert_eq!(decoder.totals().jumps, 1, "{flipped} at {word}");
                let after = decoder.totals().doubtful_after.unwrap();
                let (wrong, at) = (events.t[150 + word], events.t[149]);
                assert!(wrong != 510_000 + 100 * word as i64);
                assert_eq!(after, at, "{flipped} at {word}");
                assert!(events.t[299] - events.t[0] > 7_000_000, "a turn too late");
            }
        }
    }

    #[test]
    fn a_reset_that_moves_times_by_a_second_or_more_makes_them_doubtful() {
        // The stamp, in units of 10 ms, that the board came to before it began anew: what is left of 655 moves all later times.
        for (came_to, jumps) in [(20, 1), (200, 1), (400, 1), (550, 1), (570, 0), (650, 0), (700, 1), (1200, 1)] {
            let before = regular(came_to - 15, 15);
            let after = regular(0, 50).map(|(stamps, at)| (stamps, at + 10_000 * came_to));
            let (decoder, events) = decode(before.chain(after));
            let last = events.t[44];
            assert_eq!(
                (decoder.totals().jumps, decoder.totals().doubtful_after),
                (jumps, (jumps > 0).then_some(last)),
                "{came_to}"
            );
            assert!(events.t[45] > last, "{came_to}: ahead, wherever the reset was");
        }
    }

    #[test]
    fn silences_delays_drift_and_a_host_set_back_are_no_jumps() {
        let silent = regular(1, 50).chain(regular(900, 50)).chain(regular(9000, 50));
        assert_eq!(decode(silent).0.totals().jumps, 0);
        let delayed =
            regular(1, 900).map(|(stamps, at)| (stamps, at + if at % 3_000_000 < 400_000 { 900_000 } else { 0 }));
        assert_eq!(decode(delayed).0.totals().jumps, 0);
        let drifting = (0..30_000).map(|k| (vec![(1000 * k) as u16], 100_000 * k - 9 * k));
        assert_eq!(decode(drifting).0.totals().jumps, 0);
        let set_back = regular(1, 100).map(|(stamps, at)| (stamps, if at < 7_500_000 { at } else { at - 60_000_000 }));
        assert_eq!(decode(set_back).0.totals().jumps, 0);
    }
}
