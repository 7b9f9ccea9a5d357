//! Tests of the decoder of version 2.

use rand::{Rng, SeedableRng, rngs::StdRng};

use super::session::LEAST_UNLIKE;
use super::*;
use crate::board::Board;
use crate::wire::Registers;
use crate::wire::v2::BodyKind;

/// A datagram with its checksum.
fn datagram(kind: BodyKind, session: u16, sequence: u32, base: u64, body: &[u8]) -> Vec<u8> {
    let (kind, stride) = (kind as u8, crate::wire::v2::stride(64));
    let header = DatagramHeader { kind, board: 0, sequence, base, session, stride, line: 0, flags: 0, span: 0 };
    header.datagram(body)
}

#[test]
fn a_recording_misses_what_is_lost_since_it_began_whatever_comes_late_from_before() {
    let mut draw = StdRng::seed_from_u64(5);
    for _ in 0..200 {
        let mut decoder = Decoder::new(Array::thesis());
        let mut events = Events::empty(Array::thesis());
        let begins = draw.random_range(1..100_u32);
        let mut order: Vec<u32> = (7..200).filter(|_| draw.random_bool(0.9)).collect();
        for k in 0..order.len() {
            if draw.random_bool(0.1) {
                let last = (k + draw.random_range(0..20)).min(order.len() - 1);
                order[k..=last].rotate_left(1);
            }
        }
        let (before, since) = order.split_at(begins as usize);
        for &number in before {
            decoder.push(&datagram(BodyKind::Small, 1, number, 0, &[]), None, &mut events);
        }
        let then = decoder.counts();
        decoder.begin_recording();
        for &number in since {
            decoder.push(&datagram(BodyKind::Small, 1, number, 0, &[]), None, &mut events);
        }
        let (highest, last) = (before.iter().max().unwrap(), order.iter().max().unwrap());
        let missing = (highest + 1..=*last).filter(|number| !since.contains(number)).count();
        assert_eq!(decoder.counts().since(&then).missing, missing as u64);
    }
}

#[test]
fn the_newest_status_of_the_latest_session_counts() {
    let mut decoder = Decoder::new(Array::thesis());
    let mut events = Events::empty(Array::thesis());
    let totals = |n: u64| [n; 5].map(u64::to_le_bytes).concat();
    for (session, sequence, body, frames) in [
        (1, 5, totals(50), 50),
        (1, 4, totals(40), 50),
        (1, 7, totals(70)[..39].to_vec(), 50),
        (2, 0, totals(1), 1),
        (1, 9, totals(90), 1),
        (2, 1, totals(2), 2),
    ] {
        decoder.push(&datagram(BodyKind::Status, session, sequence, 1000, &body), None, &mut events);
        assert_eq!(decoder.status().unwrap().frames, frames, "session {session}, number {sequence}");
    }
    assert_eq!((decoder.counts().malformed, decoder.counts().intact), (1, 6));
}

#[test]
fn a_straggler_of_before_a_reset_changes_nothing_that_is_held_since() {
    let array = Array::thesis();
    let registers = Registers { wire_version: 2, ..Registers::default() };
    let mut board = Board::new(registers, &array).unwrap();
    let mut sent = |ticks: u16, taxels: usize| {
        let mut out = vec![];
        for level in [0, ticks, ticks + 20] {
            let mut pressed = vec![0; 4096];
            pressed[..taxels].fill(level);
            board
                .frame(&pressed, |datagram| {
                    out.push(datagram.to_vec());
                    true
                })
                .unwrap();
        }
        board.reset().unwrap();
        out
    };
    let (before, since) = (sent(50, 4096), sent(200, 100));
    let (late, begun) = before.split_last().unwrap();
    let mut decoder = Decoder::new(array.clone());
    let mut events = Events::empty(array);
    for datagram in begun.iter().chain(&since) {
        decoder.push(datagram, None, &mut events);
    }
    let held = decoder.held();
    let heard = events.len();
    assert!(matches!(decoder.push(late, None, &mut events), DatagramOutcome::Intact { reset: false, .. }));
    assert!(events.len() > heard, "its events are events");
    assert_eq!(decoder.held(), held);
}

#[test]
fn a_board_that_begins_again_with_the_same_session_is_not_taken_for_repetition() {
    let sent = |sequence: u32| datagram(BodyKind::Changes, 7, sequence, u64::from(sequence) * 192, &[]);
    let (mut decoder, mut events) = (Decoder::new(Array::thesis()), Events::empty(Array::thesis()));
    let mut came = |decoder: &mut Decoder, sequence: u32| decoder.push(&sent(sequence), None, &mut events);
    for sequence in 0..2000 {
        came(&mut decoder, sequence);
    }
    for sequence in 0..500 {
        came(&mut decoder, sequence);
    }
    let counts = decoder.counts();
    assert_eq!((counts.resets, counts.repeated, counts.intact), (1, u64::from(IN_TURN), 2500 - u64::from(IN_TURN)));
    assert_eq!(counts.missing, u64::from(IN_TURN));

    // A network repeats: each once, some behind others, the first ones long after, a part in turn.
    let mut decoder = Decoder::new(Array::thesis());
    for sequence in 0..2000 {
        came(&mut decoder, sequence);
        came(&mut decoder, sequence);
        came(&mut decoder, sequence / 2);
    }
    for sequence in (0..1000).step_by(3).chain(0..IN_TURN).chain(1900..2000) {
        came(&mut decoder, sequence);
    }
    assert_eq!((decoder.counts().resets, decoder.counts().missing, decoder.counts().intact), (0, 0, 2000));
}

#[test]
fn a_board_that_begins_again_with_the_same_session_is_no_other_board_however_short_its_first_life_was() {
    let life = |life: u8, n: u32| {
        (0..n).map(move |k| datagram(BodyKind::Small, 7, k, u64::from(k) * 192, &[life, 0, k as u8 % 60 + 1, 0x80]))
    };
    for first in (1..=70).chain((80..3000).step_by(97)).chain([255, 256, 257, 1023, 1024, 3000]) {
        for silent in [None, Some(0), Some(300_000)] {
            let (mut decoder, mut events) = (Decoder::new(Array::thesis()), Events::empty(Array::thesis()));
            let mut now = 0;
            for (k, bytes) in life(1, first).chain(life(2, 3000)).enumerate() {
                // Without a clock no silence is known.
                now += 192 + if k == first as usize { silent.unwrap_or(0) } else { 0 };
                decoder.push(&bytes, silent.map(|_| now), &mut events);
            }
            let (counts, case) = (decoder.counts(), format!("{first} datagrams, {silent:?}"));
            if first < LEAST_UNLIKE && silent != Some(300_000) {
                // They may as well be datagrams of another board between those of one.
                assert_eq!((counts.resets, counts.other_board, counts.missing), (0, first.into(), 0), "{case}");
                continue;
            }
            let lost = if silent == Some(300_000) { 0 } else { first.min(IN_TURN) };
            assert_eq!((counts.resets, counts.other_board, counts.foreign), (1, 0, 0), "{case}");
            assert_eq!((counts.missing, counts.repeated), (lost.into(), lost.into()), "{case}");
            assert_eq!(counts.intact + counts.repeated, u64::from(first) + 3000, "{case}");
            assert!(events.t.is_sorted(), "{case}");
        }
    }
}

#[test]
fn a_single_datagram_of_another_board_is_no_reset_whenever_it_comes() {
    for at in 1..300_u32 {
        for silent in [0, 300_000] {
            let (mut decoder, mut events) = (Decoder::new(Array::thesis()), Events::empty(Array::thesis()));
            let mut now = 0;
            for k in 0..400 {
                if k == at {
                    now += silent;
                    // Number 0 after a silence is what a board sends at its reset.
                    let other = if silent == 0 { at / 2 } else { (at / 2).max(1).min(at - 1) };
                    if silent == 0 || other > 0 {
                        let bytes = datagram(BodyKind::Small, 7, other, u64::from(other) * 192, &[9, 0x80]);
                        decoder.push(&bytes, Some(now), &mut events);
                    }
                }
                now += 192;
                let bytes = datagram(BodyKind::Small, 7, k, u64::from(k) * 192, &[5, 0x80]);
                decoder.push(&bytes, Some(now), &mut events);
            }
            let counts = decoder.counts();
            let others = u64::from(silent == 0 || at > 1);
            assert_eq!((counts.resets, counts.missing, counts.other_board), (0, 0, others), "{at}, {silent} us");
        }
    }
}

#[test]
fn a_recording_that_began_while_a_session_was_to_begin_again_counts_no_other_board() {
    for begins in 0..IN_TURN {
        let (mut decoder, mut events) = (Decoder::new(Array::thesis()), Events::empty(Array::thesis()));
        let mut then = decoder.counts();
        for (life, n) in [(1, 200), (2, 600)] {
            for k in 0..n {
                if (life, k) == (2, begins) {
                    then = decoder.counts();
                    decoder.begin_recording();
                }
                decoder.push(&datagram(BodyKind::Small, 7, k, u64::from(k) * 192, &[life, 0x80]), None, &mut events);
            }
        }
        let since = decoder.counts().since(&then);
        assert_eq!((since.resets, since.other_board, since.foreign), (1, 0, 0), "from number {begins} on");
    }
}
