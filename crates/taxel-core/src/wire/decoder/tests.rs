//! Tests of the decoder of version 1 beside those in Python, which compare it with a slow reference on any bytes.

use rand::{Rng, SeedableRng, rngs::StdRng, seq::IndexedRandom};

use super::clock::TURN;
use super::*;

fn change(stamp: u16, x: u8, y: u8) -> Word {
    Word::Change { stamp, x, y, p: true }
}

fn intensity(ticks: u16, x: u8, y: u8) -> Word {
    Word::Intensity { ticks, x, y, p: true }
}

fn bytes(words: &[Word]) -> Vec<u8> {
    words.iter().flat_map(|w| w.to_bytes()).collect()
}

fn decode(words: &[Word]) -> (Events, Counts) {
    crate::wire::decode(&bytes(words), Array::thesis())
}

/// What a decoder returns for these bytes.
fn push(decoder: &mut Decoder, bytes: &[u8], arrived: Option<i64>) -> Events {
    let mut events = Events::empty(decoder.array().clone());
    decoder.push(bytes, arrived, &mut events);
    events
}

fn intensities(events: &Events) -> Vec<Option<u16>> {
    let i = events.intensity.clone().unwrap_or_default();
    i.ticks.iter().zip(&i.present).map(|(&t, &p)| p.then_some(t)).collect()
}

#[test]
fn a_tenth_of_a_second_back_is_a_step_back_and_more_lies_ahead() {
    let (events, counts) = decode(&[change(1000, 0, 0), change(0, 0, 0), change(1001, 0, 0)]);
    assert_eq!((events.t, counts.back), (vec![100_000, 0, 100_100], 1));
    let (events, counts) = decode(&[change(1001, 0, 0), change(0, 0, 0)]);
    assert_eq!((events.t, counts.back), (vec![100_100, 6_553_600], 0));
    let (events, _) = decode(&[change(0, 0, 0), change(65_535, 0, 0)]);
    assert_eq!(events.t, [0, -100]);
}

#[test]
fn arrival_times_tell_how_long_a_silence_was() {
    for turns in 0..4_i64 {
        for rest in [0, 1, 999, 40_000, 65_000, 65_535] {
            let silence = turns * TURN + rest;
            for late in [-200_000, 0, 200_000] {
                let mut decoder = Decoder::new(Array::thesis());
                let mut events = push(&mut decoder, &bytes(&[change(7, 0, 0)]), Some(1_000_000));
                let arrived = 1_000_000 + silence * STAMP_US + late;
                let stamp = ((7 + silence) % TURN) as u16;
                decoder.push(&bytes(&[change(stamp, 1, 0)]), Some(arrived), &mut events);
                decoder.finish(&mut events);
                assert_eq!(events.t[1] - events.t[0], silence * STAMP_US, "silence {silence}, late {late}");
            }
        }
    }
}

#[test]
fn arrival_times_out_of_all_reason_do_no_harm() {
    let mut decoder = Decoder::new(Array::thesis());
    for arrived in [i64::MIN, i64::MAX, 0, i64::MAX, i64::MIN] {
        push(&mut decoder, &bytes(&[change(7, 0, 0)]), Some(arrived));
    }
    assert_eq!(decoder.counts().words, 5);
}

#[test]
fn differences_add_up_from_what_was_held_and_to_nothing_from_what_is_unknown() {
    let words = [change(0, 1, 1), intensity(50, 1, 1), change(1, 2, 1), intensity(7, 2, 1)];
    let mut decoder = Decoder::new(Array::thesis()).differences(true);
    let index = Array::thesis().index(1, 1);
    decoder.begin_with((0..4096).map(|taxel| (taxel == index).then_some(300)));
    let mut events = push(&mut decoder, &bytes(&words), None);
    decoder.finish(&mut events);
    assert_eq!((events.len(), intensities(&events)), (2, vec![Some(350), None]));
    assert_eq!((decoder.counts().intensities, decoder.counts().unpaired), (1, 1));
}

/// The rounds of a test; two under Miri, which is thousands of times slower.
fn rounds(many: u64) -> std::ops::Range<u64> {
    0..if cfg!(miri) { 2 } else { many }
}

/// A stream of stretches: clean changes, pairs, a mix, stamps that jump or fall, rare kinds, damage.
fn stream(random: &mut StdRng, words: usize) -> Vec<u8> {
    let mut bytes = vec![];
    let mut stamp: u16 = random.random();
    let mut last = (0, 0);
    while bytes.len() < 5 * words {
        let run = random.random_range(1..200);
        let (style, quiet) = (random.random_range(0..9), random.random_bool(0.5));
        let top = *[8, 63, 64].choose(random).unwrap();
        for k in 0..run {
            stamp = match style {
                5 => stamp.wrapping_add(random.random()),
                6 if random.random_bool(0.02) => stamp.wrapping_sub(*[1, 999, 1000, 1001].choose(random).unwrap()),
                _ if quiet => stamp,
                _ => stamp.wrapping_add(random.random_range(0..3)),
            };
            let p = random.random();
            let intensity = match style {
                0 | 5 | 6 => false,
                1 | 2 => k % 2 == 1,
                _ => random.random(),
            };
            if !intensity || random.random_bool(0.05) {
                last = (random.random_range(0..top), random.random_range(0..top));
            }
            let (x, y) = last;
            let mut word = if intensity {
                Word::Intensity { ticks: random.random(), x, y, p }
            } else {
                Word::Change { stamp, x, y, p }
            }
            .to_bytes();
            word[0] |= random.random::<u8>() & 0x14 & if style == 0 { 0xff } else { 0x10 };
            word[3] |= random.random::<u8>() & 0x40;
            match random.random_range(0..if style < 7 { 2000 } else { 30 }) {
                0 => word[0] |= 0x08,
                1 => word[0] |= 0x28,
                2 => word[random.random_range(0..5)] ^= 0x80,
                3 => bytes.truncate(bytes.len() - bytes.len().min(random.random_range(1..7))),
                4 => bytes.extend((0..random.random_range(1..7)).map(|_| random.random::<u8>())),
                _ => {}
            }
            bytes.extend(word);
        }
    }
    bytes
}

/// Decodes in pieces of at most `longest` bytes, with arrival times if `heard` is set.
fn pieces(mut decoder: Decoder, bytes: &[u8], longest: usize, heard: bool, seed: u64) -> (Events, Counts) {
    let mut random = StdRng::seed_from_u64(seed);
    let mut events = Events::empty(decoder.array().clone());
    let (mut rest, mut now) = (bytes, 0);
    while !rest.is_empty() {
        let (piece, after) = rest.split_at(random.random_range(0..=longest.min(rest.len())));
        decoder.push(piece, heard.then_some(now), &mut events);
        now += if random.random_bool(0.02) { random.random_range(0..20_000_000) } else { 0 };
        rest = after;
    }
    decoder.finish(&mut events);
    events.view().check().unwrap();
    (events, *decoder.counts())
}

#[test]
fn every_set_of_instructions_decodes_alike() {
    let mut random = StdRng::seed_from_u64(11);
    let mut seen = (0, 0);
    for round in rounds(250) {
        let side = *[8, 40, 63, 64, 200].choose(&mut random).unwrap();
        let decoder = Decoder::new(Array::new(side, 64, 1.0, "array").unwrap());
        let bytes = stream(&mut random, 3000);
        let (longest, heard) = (*[7, 300, 1400, 100_000].choose(&mut random).unwrap(), random.random());
        let with = |set| pieces(decoder.clone().instructions(set).unwrap(), &bytes, longest, heard, round);
        let (events, counts) = with(Instructions::Plain);
        seen.0 += counts.changes;
        seen.1 += counts.intensities;
        for set in Instructions::ALL.into_iter().filter(|set| set.present()) {
            let (other, others) = with(set);
            assert!(other == events, "{set:?}, round {round}: other events");
            assert_eq!(others, counts, "{set:?}, round {round}");
        }
    }
    assert!(seen.0 > 300_000 && seen.1 > 60_000, "streams that say little: {seen:?}");
}

#[test]
fn overtaken_datagrams_decode_as_byte_by_byte() {
    let mut random = StdRng::seed_from_u64(17);
    let mut back = 0;
    for round in rounds(60) {
        let mut datagrams: Vec<Vec<u8>> = Vec::new();
        let mut stamp: u16 = random.random();
        for _ in 0..40 {
            let mut datagram = Vec::new();
            for _ in 0..random.random_range(0..300) {
                stamp = stamp.wrapping_add(u16::from(random.random_bool(0.05)));
                let (x, y) = (random.random_range(0..65), random.random_range(0..64));
                datagram.extend(Word::Change { stamp, x, y, p: random.random() }.to_bytes());
                if random.random_bool(0.3) {
                    datagram.extend(Word::Intensity { ticks: random.random(), x, y, p: true }.to_bytes());
                }
            }
            datagrams.push(datagram);
            stamp = stamp.wrapping_add(random.random_range(0..400));
        }
        for _ in 0..10 {
            let k = random.random_range(1..datagrams.len());
            datagrams.swap(k - 1, k);
        }
        let decode = |set, whole: bool| {
            let mut decoder = Decoder::new(Array::thesis()).instructions(set).unwrap();
            let mut events = Events::empty(Array::thesis());
            for (k, datagram) in datagrams.iter().enumerate() {
                let arrived = Some(20_000 * k as i64);
                for piece in datagram.chunks(if whole { usize::MAX } else { 1 }) {
                    decoder.push(piece, arrived, &mut events);
                }
                decoder.end_of_datagram(&mut events);
            }
            (events, *decoder.counts())
        };
        let slow = decode(Instructions::Plain, false);
        back += slow.1.back;
        for set in Instructions::ALL.into_iter().filter(|set| set.present()) {
            assert!(decode(set, true) == slow, "{set:?}, round {round}");
        }
    }
    assert!(back > 20_000, "streams that say little: {back} back");
}

/// 10^9 random bytes; minutes without optimisation, seconds with.
#[test]
#[ignore = "long; run by make slow"]
fn a_thousand_million_random_bytes_neither_panic_nor_grow() {
    let mut random = StdRng::seed_from_u64(14);
    let mut decoders = Instructions::ALL.map(|set| {
        let decoder = Decoder::new(Array::new(50, 60, 1.0, "array").unwrap());
        if set.present() { decoder.instructions(set).unwrap() } else { decoder }
    });
    let mut columns = Events::empty(decoders[0].array().clone());
    let mut bytes = vec![0; 1_000_000];
    let mut memory = 0;
    for round in 0..1000 {
        random.fill(&mut bytes[..]);
        if round % 2 == 1 {
            // Damage to a few bits of valid words exercises more of the decoder than random bytes do.
            for (k, byte) in bytes.iter_mut().enumerate() {
                *byte = if k % 5 == 0 { *byte | 0x80 } else { *byte & 0x7f } ^ (u8::from(k % 977 == 0) << 7);
            }
        }
        for decoder in &mut decoders {
            columns.clear();
            decoder.push(&bytes, (round % 3 == 0).then_some(round), &mut columns);
        }
        if round == 10 {
            memory = columns.t.capacity();
        }
    }
    assert_eq!(columns.t.capacity(), memory, "columns grew");
    let counts = decoders.map(|mut d| {
        d.finish(&mut columns);
        *d.counts()
    });
    assert!(counts.iter().all(|c| c == &counts[0]));
    assert_eq!(counts[0].bytes, 1_000_000_000);
    assert_eq!(counts[0].bytes, 5 * counts[0].words + counts[0].skipped);
}
