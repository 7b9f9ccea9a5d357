//! Tests of loss, repetition, reordering, damage, resets and unknown datagrams.

use std::collections::BTreeMap;

use rand::{Rng, SeedableRng, rngs::StdRng, seq::SliceRandom};
use taxel_core::board::{Board, BoardOptions, IntensityWord, Version2};
use taxel_core::wire::Registers;
use taxel_core::wire::v2::{DatagramHeader, DatagramOutcome, Decoder};
use taxel_core::{Array, Events};

use crate::scenes::{board, rows, scene};

#[test]
fn each_intact_datagram_is_decoded_once_whatever_the_network_does() {
    for seed in 0..40 {
        let mut random = StdRng::seed_from_u64(1000 + seed);
        let array = Array::new(64, 64, 1.0, "thesis").unwrap();
        let mut board = board(&mut random, &array, [0, 1000][seed as usize % 2]);
        let mut sent = vec![];
        for frame in scene(&mut random, &array, 200, 150) {
            board
                .frame(&frame, |datagram| {
                    sent.push(datagram.to_vec());
                    true
                })
                .unwrap();
        }
        // Each datagram is decoded alone; differences depend on their order, so only taxels and times are compared.
        let alone = |datagram: &[u8]| -> Vec<(i64, u16, u16, bool)> {
            let mut events = Events::empty(array.clone());
            Decoder::new(array.clone()).push(datagram, None, &mut events);
            rows(&events).into_iter().map(|r| (r.0, r.1, r.2, r.3)).collect()
        };
        let mut arriving: Vec<(usize, Vec<u8>)> = vec![];
        let (mut lost, mut hurt) = (vec![], 0);
        for (k, datagram) in sent.iter().enumerate() {
            match random.random_range(0..10) {
                0 => lost.push(k),
                1 => {
                    let mut bad = datagram.clone();
                    if random.random() {
                        bad.truncate(random.random_range(0..bad.len()));
                    } else {
                        let bit = random.random_range(0..8 * bad.len());
                        bad[bit / 8] ^= 1 << (bit % 8);
                    }
                    arriving.push((usize::MAX, bad));
                    lost.push(k);
                    hurt += 1;
                }
                2 => (0..random.random_range(2..4)).for_each(|_| arriving.push((k, datagram.clone()))),
                _ => arriving.push((k, datagram.clone())),
            }
        }
        for chunk in arriving.chunks_mut(random.random_range(1..50)) {
            chunk.shuffle(&mut random);
        }
        let mut decoder = Decoder::new(array.clone());
        let mut events = Events::empty(array.clone());
        let (mut once, mut refused) = (vec![], 0);
        for (k, datagram) in &arriving {
            match decoder.push(datagram, None, &mut events) {
                DatagramOutcome::Intact { .. } => once.push(*k),
                DatagramOutcome::Repeated => assert!(once.contains(k)),
                DatagramOutcome::Refused(_) => refused += 1,
            }
        }
        assert_eq!(refused, hurt);
        let mut expected: Vec<_> = once.iter().flat_map(|&k| alone(&sent[k])).collect();
        let mut heard: Vec<_> = rows(&events).into_iter().map(|r| (r.0, r.1, r.2, r.3)).collect();
        expected.sort_unstable();
        heard.sort_unstable();
        assert_eq!(heard, expected, "seed {seed}");
        once.sort_unstable();
        assert!(once.windows(2).all(|w| w[0] < w[1]), "seed {seed}: one was decoded twice");
        let counts = decoder.counts();
        let inner = lost.iter().filter(|&&k| k > once[0] && k < once[once.len() - 1]).count() as u64;
        assert_eq!(counts.missing, inner, "seed {seed}");
        assert_eq!(
            counts.datagrams,
            counts.intact + counts.repeated + counts.old + counts.short + counts.foreign + counts.checksum
        );
    }
}

#[test]
fn repeated_states_repair_the_values_after_a_loss() {
    let mut random = StdRng::seed_from_u64(3);
    let array = Array::new(16, 16, 1.0, "small").unwrap();
    let registers = Registers { wire_version: 2, lines: 16, noise_floor: 0, ..Registers::default() };
    for intensity in [IntensityWord::Value, IntensityWord::Difference] {
        let version_2 = Version2 { states_us: 20_000, ..Version2::default() };
        let mut board =
            Board::with_options(registers, &array, BoardOptions { intensity, version_2, ..BoardOptions::default() })
                .unwrap();
        let mut decoder = Decoder::new(array.clone());
        let mut events = Events::empty(array.clone());
        let mut frames = scene(&mut random, &array, 200, 150);
        let last = frames[199].clone();
        frames.extend(vec![last.clone(); 500]);
        for (k, frame) in frames.iter().enumerate() {
            let lossy = k < 200;
            board
                .frame(frame, |datagram| {
                    if !(lossy && random.random_range(0..3) == 0) {
                        decoder.push(datagram, None, &mut events);
                    }
                    true
                })
                .unwrap();
        }
        let held: Vec<u16> = decoder.held().iter().map(|held| held.expect("every state is repeated")).collect();
        let expected: Vec<u16> = last.iter().map(|&t| t.min(registers.ramp)).collect();
        assert_eq!(held, expected);
        let counts = decoder.counts();
        assert!(counts.missing > 0 && counts.repaired > 0 && counts.states > 256);
        assert_eq!(counts.repaired, (0..events.len()).filter(|&k| events.is_repaired(k)).count() as u64);
        // The events alone, including repaired ones, must lead to the same values.
        let mut frame = vec![0_u16; 256];
        for (_, x, y, _, value) in rows(&events) {
            frame[array.index(x, y)] = value;
        }
        assert_eq!(frame, expected);
        let status = decoder.status().expect("totals are sent");
        assert!(status.datagrams > 0 && status.events <= board.counts().changes);
    }
}

#[test]
fn totals_of_a_stranger_may_be_any_number() {
    let mut decoder = Decoder::new(Array::thesis());
    let mut events = Events::empty(Array::thesis());
    for session in 0..3 {
        let header =
            DatagramHeader { kind: 4, board: 0, sequence: 0, base: 0, session, stride: 6, line: 0, flags: 0, span: 0 };
        decoder.push(&header.datagram(&[0xff; 40]), None, &mut events);
    }
    assert_eq!(decoder.counts().events_dropped, u64::MAX);
}

#[test]
fn time_goes_on_after_a_reset_which_is_counted() {
    let array = Array::thesis();
    let registers = Registers { wire_version: 2, ..Registers::default() };
    let mut board = Board::new(registers, &array).unwrap();
    let mut decoder = Decoder::new(array.clone());
    let mut events = Events::empty(array.clone());
    let (mut arrived, mut resets) = (1_000_000, 0);
    for round in 0..3_u16 {
        for k in 0..20_u16 {
            let frame = vec![10 * (k % 2 + 1) + round; 4096];
            board
                .frame(&frame, |datagram| {
                    let heard = decoder.push(datagram, Some(arrived), &mut events);
                    resets += u64::from(matches!(heard, DatagramOutcome::Intact { reset: true, .. }));
                    true
                })
                .unwrap();
            arrived += 192;
        }
        board.reset().unwrap();
        assert_eq!(board.registers().wire_version, 2);
        arrived += 500_000;
    }
    assert_eq!((resets, decoder.counts().resets), (2, 2));
    assert!(events.t.is_sorted());
    let (first, last) = (events.t[0], events.t[events.len() - 1]);
    assert!((last - first - (2 * 500_000 + 59 * 192)).abs() < 2000, "{first} {last}");
}

#[test]
fn a_number_drawn_twice_is_a_reset_once() {
    let mut decoder = Decoder::new(Array::thesis());
    let mut events = Events::empty(Array::thesis());
    let mut hear = |sequence, base| {
        let header =
            DatagramHeader { kind: 1, board: 1, sequence, base, session: 9, stride: 6, line: 0, flags: 0, span: 192 };
        decoder.push(&header.datagram(&[0x05, 0x80]), None, &mut events)
    };
    let intact = |heard| matches!(heard, DatagramOutcome::Intact { .. });
    assert!(intact(hear(70_000, 20_000_000)));
    assert!(intact(hear(70_001, 20_000_192)));
    // After the reset each number is decoded once; a repeated one stays repeated, and the old session has ended.
    for sequence in 0..5 {
        assert!(intact(hear(sequence, 192 * u64::from(sequence))));
        assert!(matches!(hear(sequence, 192 * u64::from(sequence)), DatagramOutcome::Repeated));
    }
    let counts = decoder.counts();
    assert_eq!((counts.intact, counts.repeated, counts.resets, counts.missing), (7, 5, 1, 0));
    assert!(events.t.is_sorted());
}

#[test]
fn what_another_board_sent_under_the_same_number_is_refused_by_every_set_of_instructions() {
    for seed in 0..60 {
        let mut random = StdRng::seed_from_u64(seed);
        let array = Array::thesis();
        let sent = |random: &mut StdRng, sequence: u32| {
            let base = 192 * u64::from(sequence) + random.random_range(0..3);
            let header = DatagramHeader {
                kind: 1,
                board: 1,
                sequence,
                base,
                session: 9,
                stride: 6,
                line: 0,
                flags: 0,
                span: 192,
            };
            header.datagram(&[random.random_range(0..4), 0x80])
        };
        let (mut numbers, mut came) = ([7, random.random_range(0..200)], vec![]);
        for _ in 0..2000 {
            let board = random.random_range(0..2);
            came.push(sent(&mut random, numbers[board]));
            numbers[board] += 1;
        }
        let mut first = BTreeMap::new();
        let (mut again, mut other) = (0, 0);
        for datagram in &came {
            let known: &Vec<u8> =
                first.entry(DatagramHeader::read(datagram).unwrap().0.sequence).or_insert(datagram.clone());
            again += u64::from(known == datagram);
            other += u64::from(known != datagram);
        }
        let mut decoder = Decoder::new(array.clone());
        let mut events = Events::empty(array.clone());
        for datagram in &came {
            decoder.push(datagram, None, &mut events);
        }
        let counts = decoder.counts();
        assert_eq!((counts.intact, counts.repeated), (first.len() as u64, again - first.len() as u64), "seed {seed}");
        assert_eq!((counts.foreign, counts.other_board, counts.resets), (other, other, 0), "seed {seed}");
    }
}

#[test]
fn unknown_kinds_and_flags_are_counted_and_anything_is_survived() {
    let mut random = StdRng::seed_from_u64(5);
    let array = Array::new(100, 100, 1.0, "any").unwrap();
    let mut decoder = Decoder::new(array.clone());
    let mut events = Events::empty(array.clone());
    for sequence in 0..20_000_u32 {
        let body: Vec<u8> = (0..random.random_range(0..80)).map(|_| random.random()).collect();
        let header = DatagramHeader {
            kind: random.random_range(0..16),
            board: 3,
            sequence,
            base: random.random_range(0..1 << 48),
            session: random.random_range(0..40),
            stride: random.random(),
            line: random.random(),
            flags: random.random(),
            span: random.random(),
        };
        decoder.push(&header.datagram(&body), Some(random.random_range(i64::MIN / 4..i64::MAX / 4)), &mut events);
        events.view().check().unwrap();
        events.clear();
    }
    let counts = decoder.counts();
    assert!(counts.unknown_kind > 0 && counts.unknown_flags > 0 && counts.malformed > 0 && counts.outside > 0);
}
