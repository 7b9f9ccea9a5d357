//! Version 2 of the wire between the emulated board and the decoder, under every fault that a network knows.

use rand::{Rng, SeedableRng, rngs::StdRng, seq::SliceRandom};
use taxel_core::board::{Board, IntensityWord, Version2};
use taxel_core::vectors::Instructions;
use taxel_core::wire::v2::{self, Counts, Decoder, Header, Kind, MAGIC, Outcome, Packer, Settings, StreamReader};
use taxel_core::wire::{Decoder as Decoder1, Registers, Room};
use taxel_core::{Array, Events, Stop};

/// A scene on an array: blobs that come and go, noise, now and then everything at once.
fn scene(random: &mut StdRng, array: &Array, frames: usize, ramp: u16) -> Vec<Vec<u16>> {
    let taxels = array.len();
    let mut held = vec![0_u16; taxels];
    let most = [0, 3, 40, taxels][random.random_range(0..4)];
    (0..frames)
        .map(|_| {
            match random.random_range(0..20) {
                0 => held.fill(random.random_range(0..=ramp)),
                1 => held.iter_mut().for_each(|t| *t = random.random_range(0..=ramp)),
                2..6 => {}
                _ => {
                    for _ in 0..most.min(random.random_range(0..60)) {
                        held[random.random_range(0..taxels)] = random.random_range(0..=ramp.saturating_mul(2));
                    }
                }
            }
            held.clone()
        })
        .collect()
}

fn arrays(random: &mut StdRng) -> Array {
    let sizes = [(1, 1), (8, 8), (64, 64), (3, 64), (64, 5), (65, 33), (128, 128), (100, 200), (256, 256), (512, 128)];
    let (rows, columns) = sizes[random.random_range(0..sizes.len())];
    Array::new(rows, columns, 1.0, "drawn").unwrap()
}

fn board(random: &mut StdRng, array: &Array, hold_us: u64) -> Board {
    let channels = if random.random() { 16 } else { 64 };
    let mut registers = Registers::at_reset(array, channels);
    registers.wire_version = 2;
    registers.random_lines = random.random();
    registers.frame_sync = random.random();
    registers.noise_floor = random.random_range(0..6);
    let words = [IntensityWord::Value, IntensityWord::Difference, IntensityWord::Nothing];
    Board::new(registers, array)
        .unwrap()
        .intensity(words[random.random_range(0..3)])
        .queue(usize::MAX)
        .version_2(Version2 { board: 7, seed: random.random(), hold_us, states_us: 0, ..Version2::default() })
        .unwrap()
}

type Row = (i64, u16, u16, bool, u16);

fn rows(events: &Events) -> Vec<Row> {
    let ticks = |k: usize| events.intensity.as_ref().filter(|i| i.present[k]).map_or(0, |i| i.ticks[k]);
    (0..events.len()).map(|k| (events.t[k], events.x[k], events.y[k], events.p[k], ticks(k))).collect()
}

/// What the board meant to say, by comparing values as the contract says.
fn meant(frames: &[Vec<u16>], array: &Array, registers: &Registers, valued: bool) -> Vec<(i64, Vec<Row>)> {
    let mut held = vec![0_u16; array.len()];
    let mut all = vec![];
    for (k, frame) in (0_u64..).zip(frames) {
        let t = (k * registers.frame_10ns() / 100) as i64;
        let mut rows = vec![];
        for x in 0..registers.lines {
            for y in 0..array.rows {
                let taxel = array.index(x, y);
                let value = frame[taxel].min(registers.ramp);
                if value.abs_diff(held[taxel]) > registers.noise_floor.into() {
                    rows.push((t, x, y, value >= held[taxel], if valued { value } else { 0 }));
                    held[taxel] = value;
                }
            }
        }
        all.push((t, rows));
    }
    all
}

#[test]
fn what_the_board_means_is_what_the_host_hears() {
    for seed in 0..60 {
        let mut random = StdRng::seed_from_u64(seed);
        let array = arrays(&mut random);
        let mut board = board(&mut random, &array, 0);
        let registers = *board.registers();
        let count = if array.len() > 20_000 { 6 } else { 40 };
        let frames = scene(&mut random, &array, count, registers.ramp);
        let mut decoder = Decoder::new(array.clone());
        let mut events = Events::empty(array.clone());
        let mut until = 0;
        for frame in &frames {
            board
                .frame(frame, |datagram| {
                    assert!(datagram.len() <= 1400);
                    let before = events.len();
                    let heard = decoder.push(datagram, None, &mut events);
                    assert!(events.t[before..].iter().all(|&t| t >= until), "seed {seed}: a promise was broken");
                    let Outcome::Intact { until: promised, missing: 0, reset: false } = heard else {
                        panic!("{heard:?}")
                    };
                    until = until.max(promised.unwrap_or(0));
                    true
                })
                .unwrap();
            assert!(registers.frame_us() > 65_535.0 || events.is_empty() || until >= board.time_us() as i64);
        }
        let valued = events.intensity.is_some();
        let mut heard = rows(&events);
        let mut expected: Vec<Row> = meant(&frames, &array, &registers, valued).into_iter().flat_map(|f| f.1).collect();
        assert!(registers.frame_sync || events.t.is_sorted());
        // By taxel, in the order of time: with frame sync at the frame's time, else at its step's within the frame.
        heard.sort_by_key(|&(t, x, y, ..)| (x, y, t));
        expected.sort_by_key(|&(t, x, y, ..)| (x, y, t));
        assert_eq!(heard.len(), expected.len(), "seed {seed}");
        let late = if registers.frame_sync { 0 } else { registers.frame_us() as i64 };
        for (a, b) in heard.iter().zip(&expected) {
            assert!((a.1, a.2, a.3, a.4) == (b.1, b.2, b.3, b.4), "seed {seed}: {a:?} for {b:?}");
            assert!((0..=late).contains(&(a.0 - b.0)), "seed {seed}: {a:?} for {b:?}");
        }
        assert_eq!(decoder.counts().events, board.counts().changes);
        assert_eq!(events.repaired, None);
    }
}

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
        // Each alone tells what it holds; differences need their order, so only taxels and times are compared.
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
                Outcome::Intact { .. } => once.push(*k),
                Outcome::Repeated => assert!(once.contains(k)),
                Outcome::Refused(_) => refused += 1,
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
fn values_told_again_mend_the_picture_after_a_loss() {
    let mut random = StdRng::seed_from_u64(3);
    let array = Array::new(16, 16, 1.0, "small").unwrap();
    let registers = Registers { wire_version: 2, lines: 16, noise_floor: 0, ..Registers::default() };
    for intensity in [IntensityWord::Value, IntensityWord::Difference] {
        let version_2 = Version2 { states_us: 20_000, ..Version2::default() };
        let mut board = Board::new(registers, &array).unwrap().intensity(intensity).version_2(version_2).unwrap();
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
        let held: Vec<u16> = decoder.held().iter().map(|held| held.expect("told again")).collect();
        let expected: Vec<u16> = last.iter().map(|&t| t.min(registers.ramp)).collect();
        assert_eq!(held, expected);
        let counts = decoder.counts();
        assert!(counts.missing > 0 && counts.repaired > 0 && counts.states > 256);
        assert_eq!(counts.repaired, (0..events.len()).filter(|&k| events.is_repaired(k)).count() as u64);
        // The events alone, repaired ones included, lead to the same picture.
        let mut picture = vec![0_u16; 256];
        for (_, x, y, _, value) in rows(&events) {
            picture[array.index(x, y)] = value;
        }
        assert_eq!(picture, expected);
        let status = decoder.status().expect("totals are told");
        assert!(status.datagrams > 0 && status.events <= board.counts().changes);
    }
}

#[test]
fn a_reset_goes_on_in_time_and_is_noticed() {
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
                    resets += u64::from(matches!(heard, Outcome::Intact { reset: true, .. }));
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
fn version_1_and_version_2_say_the_same_of_one_scene() {
    let mut random = StdRng::seed_from_u64(11);
    let array = Array::thesis();
    let frames = scene(&mut random, &array, 100, 150);
    let play = |version: u8| {
        let registers = Registers { wire_version: version, ..Registers::default() };
        let mut board = Board::new(registers, &array).unwrap().queue(usize::MAX);
        let mut bytes = vec![];
        for frame in &frames {
            board
                .frame(frame, |datagram| {
                    bytes.push(datagram.to_vec());
                    true
                })
                .unwrap();
        }
        bytes
    };
    let mut one = Decoder1::new(array.clone()).push(&play(1).concat(), None);
    let (mut two, mut decoder) = (Events::empty(array.clone()), Decoder::new(array.clone()));
    for datagram in play(2) {
        decoder.push(&datagram, None, &mut two);
    }
    // Version 1 cuts times to 100 us.
    two.t.iter_mut().for_each(|t| *t = *t / 100 * 100);
    let (mut a, mut b) = (rows(&one), rows(&two));
    a.sort_unstable();
    b.sort_unstable();
    assert_eq!(a, b);
    one.clear();
}

#[test]
fn a_slow_board_still_promises_and_silence_has_its_heartbeats() {
    let array = Array::new(4, 4, 1.0, "slow").unwrap();
    // A frame of 120 ms: longer than a span can say.
    let registers = Registers { wire_version: 2, lines: 4, line_period: 3_000_000, ..Registers::default() };
    let mut board = Board::new(registers, &array).unwrap();
    let mut decoder = Decoder::new(array.clone());
    let mut until = 0;
    for k in 0..20_u16 {
        board
            .frame(&[if k == 3 { 50 } else { 0 }; 16], |datagram| {
                if let Outcome::Intact { until: Some(u), .. } =
                    decoder.push(datagram, None, &mut Events::empty(array.clone()))
                {
                    until = until.max(u);
                }
                true
            })
            .unwrap();
        assert_eq!(until, board.time_us() as i64, "frame {k}");
    }
    let mut quiet = Board::new(Registers { wire_version: 2, ..Registers::default() }, &Array::thesis()).unwrap();
    let mut beats = vec![];
    for k in 0..2000_u16 {
        let mut sent = 0;
        quiet
            .frame(&[if k < 100 { 0 } else { 50 }; 4096], |datagram| {
                let (header, body) = Header::read(datagram).unwrap();
                sent += usize::from(body.is_empty() && header.kind == 1);
                true
            })
            .unwrap();
        beats.push(sent);
    }
    assert_eq!(beats[..100].iter().sum::<usize>(), 1, "every 10 ms");
    let after = &beats[101..];
    assert!(after[..500].iter().all(|&n| n == 1), "each frame for 0.1 s after an event");
    assert!((20..40).contains(&after[600..].iter().sum::<usize>()));
}

#[test]
fn unknown_kinds_and_flags_are_counted_and_anything_is_survived() {
    let mut random = StdRng::seed_from_u64(5);
    let array = Array::new(100, 100, 1.0, "any").unwrap();
    let mut decoder = Decoder::new(array.clone());
    let mut events = Events::empty(array.clone());
    let mut bytes = vec![];
    for sequence in 0..20_000_u32 {
        let body: Vec<u8> = (0..random.random_range(0..80)).map(|_| random.random()).collect();
        let header = Header {
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
        header.write(&body, &mut bytes);
        decoder.push(&bytes, Some(random.random_range(i64::MIN / 4..i64::MAX / 4)), &mut events);
        events.view().check().unwrap();
        events.clear();
    }
    let counts = decoder.counts();
    assert!(counts.unknown_kind > 0 && counts.unknown_flags > 0 && counts.malformed > 0 && counts.outside > 0);
}

#[test]
fn a_stream_is_cut_anywhere_and_found_again_after_damage() {
    let mut random = StdRng::seed_from_u64(8);
    for _ in 0..200 {
        let (mut stream, mut sent, mut junk) = (vec![], vec![], 0);
        for sequence in 0..random.random_range(1..30) {
            let body: Vec<u8> = (0..random.random_range(0..200)).map(|_| random.random()).collect();
            let header =
                Header { kind: 1, board: 1, sequence, base: 0, session: 1, stride: 6, line: 0, flags: 0, span: 0 };
            let mut bytes = vec![];
            header.write(&body, &mut bytes);
            let mut framed = [&(bytes.len() as u16).to_le_bytes()[..], &bytes].concat();
            match random.random_range(0..6) {
                0 => {
                    let noise: Vec<u8> = (0..random.random_range(1..60)).map(|_| random.random()).collect();
                    junk += noise.len() as u64;
                    stream.extend(noise);
                    sent.push(bytes);
                }
                1 => {
                    let at = random.random_range(0..framed.len());
                    framed[at] ^= 1 << random.random_range(0..8);
                    junk += framed.len() as u64;
                }
                2 => {
                    // What promises more than there is, and so swallows what follows until the stream ends.
                    let promise = [random.random_range(100..1400_u16).to_le_bytes(), [MAGIC, 0x21]].concat();
                    junk += promise.len() as u64;
                    stream.extend(promise);
                    sent.push(bytes);
                }
                3 => {
                    framed.truncate(random.random_range(1..framed.len()));
                    junk += framed.len() as u64;
                }
                _ => sent.push(bytes),
            }
            stream.extend(framed);
        }
        let (mut reader, mut found, mut rest) = (taxel_core::wire::v2::StreamReader::default(), vec![], &stream[..]);
        while !rest.is_empty() {
            let (piece, later) = rest.split_at(random.random_range(1..=rest.len()));
            reader.push(piece, |datagram| found.push(datagram.to_vec()));
            rest = later;
        }
        reader.finish(|datagram| found.push(datagram.to_vec()));
        assert_eq!((found, reader.skipped()), (sent, junk));
    }
}

/// Words as a board would never send them, among those that it would.
fn words(random: &mut StdRng, kind: u8) -> Vec<u8> {
    let (bytes, skip_bits, value_bits) = [(2, 15, 0), (2, 7, 8), (4, 15, 16)][[0, 1, 2, 0, 0, 0, 1, 2][kind as usize]];
    let control = (1_u32 << skip_bits) - 1;
    let (many, far) = (random.random_range(1..200), random.random_range(0..=control / 4));
    let rare = random.random_range(0.0..0.3_f64) * f64::from(random.random::<bool>());
    let mut body = vec![];
    for _ in 0..random.random_range(0..many) {
        let value = random.random_range(0..1_u64 << value_bits) as u32;
        let (p, skip, value) = match random.random_bool(rare).then(|| random.random_range(0..5)) {
            None => (random.random(), if random.random_bool(0.7) { 0 } else { random.random_range(0..=far) }, value),
            Some(0) => (false, control, value),
            Some(1) => (false, control, value.min(2)),
            Some(2) => (random.random(), random.random_range(0..=control), value),
            Some(_) => (true, control, value),
        };
        let word = u32::from(p) << (skip_bits + value_bits) | skip << value_bits | value;
        body.extend(&word.to_le_bytes()[..bytes]);
        if p && skip == control {
            // An offset, now and then one that looks like a control word.
            let offset = if random.random_bool(0.1) { u32::MAX } else { random.random_range(0..40_000) };
            body.extend(&offset.to_le_bytes()[..bytes]);
        }
    }
    if random.random_bool(0.1) {
        body.truncate(random.random_range(0..=body.len()));
    }
    body
}

/// Some lost, some twice, some late, some cut, some with a flipped bit, of which a part is sealed again, so that it is read.
fn as_a_network(random: &mut StdRng, datagrams: &[Vec<u8>]) -> Vec<Vec<u8>> {
    let mut out: Vec<Vec<u8>> = vec![];
    for datagram in datagrams {
        let mut datagram = datagram.clone();
        match random.random_range(0..10) {
            0 => continue,
            1 => out.push(datagram.clone()),
            2 => datagram.truncate(random.random_range(0..datagram.len())),
            3 | 4 => {
                let bit = random.random_range(0..8 * datagram.len());
                datagram[bit / 8] ^= 1 << (bit % 8);
                if random.random() {
                    let sealed = crc32c::crc32c(&datagram[..datagram.len() - 4]);
                    let sum = datagram.len() - 4;
                    datagram[sum..].copy_from_slice(&sealed.to_le_bytes());
                }
            }
            _ => {}
        }
        let place = out.len() - random.random_range(0..=out.len().min(3)) * usize::from(random.random_bool(0.1));
        out.insert(place, datagram);
    }
    out
}

#[test]
fn every_set_of_instructions_hears_the_same() {
    for seed in 0..300 {
        let mut random = StdRng::seed_from_u64(seed);
        let array = arrays(&mut random);
        let own = (u16::BITS - (array.rows - 1).leading_zeros()) as u8;
        let mut time = 1 << 20;
        let kind = [0, 1, 1, 2, 2][random.random_range(0..5)];
        let datagrams: Vec<Vec<u8>> = (0..60)
            .map(|sequence| {
                let kind = if random.random_bool(0.8) { kind } else { [0, 1, 2, 6, 7][random.random_range(0..5)] };
                time = if random.random_bool(0.8) { time + 192 } else { random.random_range(0..1 << 21) };
                let stride = if random.random_bool(0.9) { own } else { random.random() };
                let flags = if random.random_bool(0.9) { 1 } else { random.random() };
                let line = if random.random_bool(0.5) { 0 } else { random.random() };
                let header =
                    Header { kind, board: 1, sequence, base: time, session: 1, stride, line, flags, span: 192 };
                let mut datagram = vec![];
                header.write(&words(&mut random, kind), &mut datagram);
                datagram
            })
            .collect();
        let datagrams = if seed % 2 == 0 { datagrams } else { as_a_network(&mut random, &datagrams) };
        let mut first = None;
        for set in Instructions::ALL.into_iter().filter(|set| set.present()) {
            let mut decoder = Decoder::new(array.clone()).instructions(set).unwrap();
            let mut events = Events::empty(array.clone());
            let told: Vec<Outcome> =
                datagrams.iter().map(|datagram| decoder.push(datagram, None, &mut events)).collect();
            assert!(seed % 2 == 1 || told.iter().all(|heard| matches!(heard, Outcome::Intact { .. })));
            events.view().check().unwrap();
            let heard = (events, decoder.counts(), decoder.held(), told);
            let first = first.get_or_insert_with(|| heard.clone());
            assert!(*first == heard, "seed {seed}: {set:?} hears otherwise than {:?}", Instructions::ALL[0]);
        }
    }
}

/// Words of a few events on the array, or nearly, behind a line in which they begin.
fn few_words(random: &mut StdRng, kind: u8, array: &Array, stride: u8) -> (u8, Vec<u8>) {
    let (bytes, skip_bits, value_bits) = [(2, 15, 0), (2, 7, 8), (4, 15, 16)][kind as usize];
    let control = (1_u64 << skip_bits) - 1;
    let many = [3, 9, 24][random.random_range(0..3)];
    let mut place = || {
        let beyond = [(); 2].map(|()| u64::from(random.random_bool(0.01)));
        let x = random.random_range(0..u64::from(array.columns) + beyond[0]);
        x << stride | random.random_range(0..u64::from(array.rows) + beyond[1])
    };
    let mut places: Vec<u64> = (0..many).map(|_| place()).collect();
    places.truncate(random.random_range(0..=places.len()));
    places.sort_unstable();
    places.dedup();
    let line = places.first().map_or(0, |place| (place >> stride).min(127));
    let line = if random.random_bool(0.8) { line } else { random.random_range(0..=line) };
    let (mut body, mut next) = (vec![], line << stride);
    for place in places {
        let mut gap = place - next;
        while gap >= control {
            let step = (gap >> (skip_bits - 1)).min(1 << value_bits);
            body.extend(&(control << value_bits | (step - 1)).to_le_bytes()[..bytes]);
            gap -= step << (skip_bits - 1);
        }
        let (p, value) = (random.random::<bool>(), random.random_range(0..1_u64 << value_bits));
        body.extend(&(u64::from(p) << (skip_bits + value_bits) | gap << value_bits | value).to_le_bytes()[..bytes]);
        next = place + 1;
    }
    (line as u8, body)
}

/// What is known of a stream: its events, what was counted, and how many bytes were none of its datagrams.
type Told = (Events, Counts, u64);

fn one_by_one(stream: &[u8], array: &Array, set: Instructions) -> Told {
    let (mut reader, mut datagrams) = (StreamReader::default(), vec![]);
    reader.push(stream, |datagram| datagrams.push(datagram.to_vec()));
    reader.finish(|datagram| datagrams.push(datagram.to_vec()));
    let mut decoder = Decoder::new(array.clone()).instructions(set).unwrap();
    let mut events = Events::empty(array.clone());
    for datagram in datagrams {
        decoder.push(&datagram, None, &mut events);
    }
    (events, decoder.counts(), reader.skipped())
}

/// What each datagram was and told, as a host hears it that hands its events on now and then, and what was held, missed and said
/// of the board by then.
fn as_they_arrive(
    datagrams: &[Vec<u8>],
    array: &Array,
    set: Instructions,
    every: usize,
) -> Vec<impl PartialEq + use<>> {
    let mut decoder = Decoder::new(array.clone()).instructions(set).unwrap();
    let mut events = Events::empty(array.clone());
    let mut told = vec![];
    for (k, datagram) in datagrams.iter().enumerate() {
        // Behind the board's clock, and every now and then nothing says when.
        let arrived = (k % 7 > 0).then_some(5_000_000 + 211 * k as i64);
        let heard = decoder.push(datagram, arrived, &mut events);
        if (k + 1) % every == 0 || k + 1 == datagrams.len() {
            events.view().check().unwrap();
            told.push((heard, Some((events.clone(), decoder.held(), decoder.counts(), decoder.status().copied()))));
            events.clear();
        } else {
            told.push((heard, None));
        }
    }
    told
}

fn in_one_go(stream: &[u8], array: &Array) -> Told {
    let rows = v2::stream_rows(stream.len());
    let (mut t, mut x, mut y, mut ticks) = (vec![0; rows], vec![0; rows], vec![0; rows], vec![0; rows]);
    let (mut p, mut present) = (vec![0; rows], vec![0; rows]);
    let room = Room::new(&mut t, [&mut x, &mut y, &mut ticks], [&mut p, &mut present]).unwrap();
    let told = v2::decode(stream, array.clone(), room, Stop::never()).unwrap();
    let n = told.columns.filled.rows;
    let bools = |column: &[u8]| column[..n].iter().map(|&byte| byte == 1).collect::<Vec<bool>>();
    let mut events = Events::empty(array.clone());
    (events.t, events.x, events.y, events.p) = (t[..n].to_vec(), x[..n].to_vec(), y[..n].to_vec(), bools(&p));
    events.intensity = told
        .columns
        .filled
        .paired
        .then(|| taxel_core::Intensities { ticks: ticks[..n].to_vec(), present: bools(&present) });
    (events.repaired, events.markers) = (told.columns.repaired, told.columns.markers);
    (events, told.counts, told.skipped)
}

/// Scenes of short datagrams, with all that ends a run of them: other kinds, states, differences, times, taxels outside, numbers
/// that are missing, resets, another board, noise.
#[test]
fn a_stream_in_one_go_says_what_its_datagrams_say_one_by_one_with_vectors_or_without() {
    let mut events = 0;
    for seed in 0..400 {
        let mut random = StdRng::seed_from_u64(seed);
        let tall = Array::new(1024, 16, 1.0, "tall").unwrap();
        let array = if random.random_bool(0.1) { tall } else { arrays(&mut random) };
        let own = v2::stride(array.rows);
        let (kind, rare) = (random.random_range(0..3), [0.0, 0.05, 0.3][random.random_range(0..3)]);
        let (mut time, mut session, mut sequence) = (1_u64 << 20, 1, random.random());
        let datagrams: Vec<Vec<u8>> = (0..120)
            .map(|_| {
                let mut odd = |share: f64| random.random_bool(rare * share);
                let (other, long, lost, late, reset) = (odd(1.0), odd(0.5), odd(1.0), odd(0.3), odd(0.2));
                let (strange, foreign, wide, far) = (odd(0.5), odd(0.1), odd(0.1), odd(0.2));
                let kind = if other { [0, 1, 2, 3, 4, 6, 7][random.random_range(0..7)] } else { kind };
                let (line, body) = match kind {
                    3 | 4 => (0, (0..random.random_range(0..48)).map(|_| random.random_range(0..3)).collect()),
                    0..3 if !long => few_words(&mut random, kind, &array, own),
                    _ => (random.random_range(0..4), words(&mut random, kind)),
                };
                time = if late { random.random_range(0..1 << 21) } else { time + 192 };
                if reset {
                    (session, sequence, time) = (random.random_range(1..4), random.random_range(0..3), 0);
                }
                let header = Header {
                    kind,
                    board: u16::from(foreign),
                    sequence,
                    base: time,
                    session,
                    stride: if wide { random.random() } else { own },
                    line: if far { random.random() } else { line },
                    flags: if strange { random.random() } else { 1 },
                    span: [0, 192, u16::MAX][random.random_range(0..3)],
                };
                sequence = sequence.wrapping_add(if lost {
                    [2, 3, 70, 65_536, 200_000][random.random_range(0..5)]
                } else {
                    1
                });
                let mut datagram = vec![];
                header.write(&body, &mut datagram);
                datagram
            })
            .collect();
        let datagrams = if seed % 2 == 0 { datagrams } else { as_a_network(&mut random, &datagrams) };
        let mut stream = vec![];
        for datagram in &datagrams {
            if random.random_bool(rare * 0.2) {
                stream.extend((0..random.random_range(1..40)).map(|_| random.random::<u8>()));
            }
            stream.extend((datagram.len() as u16).to_le_bytes());
            stream.extend(datagram);
        }
        let told = in_one_go(&stream, &array);
        told.0.view().check().unwrap();
        events += told.0.len();
        for set in [Instructions::Plain, Instructions::best()] {
            assert!(told == one_by_one(&stream, &array, set), "seed {seed}, {set:?}");
        }
        let every = random.random_range(1..20);
        let [plain, best] =
            [Instructions::Plain, Instructions::best()].map(|set| as_they_arrive(&datagrams, &array, set, every));
        assert!(plain == best, "seed {seed}");
    }
    assert!(events > 200_000, "streams that say little: {events} events");
}

#[test]
fn a_datagram_of_one_event_is_one_word_wherever_it_lies_in_the_first_128_lines() {
    let array = Array::new(64, 256, 1.0, "wide").unwrap();
    let settings = Settings {
        board: 1,
        session: 1,
        kind: Kind::Small,
        frame_sync: true,
        differences: false,
        hold_us: 0,
        heartbeat_us: 10_000,
    };
    let mut packer = Packer::new(settings, &array).unwrap();
    let (mut decoder, mut events) = (Decoder::new(array.clone()), Events::empty(array.clone()));
    let mut expected = vec![];
    for x in 0..256 {
        for y in 0..64 {
            let t = 1000 * (u64::from(x) * 64 + u64::from(y));
            let mut sink = |datagram: &[u8], n| {
                let far = x > 127 && (x - 127) * 64 + y >= 127;
                assert_eq!((datagram.len(), n), (if far { 28 } else { 26 }, 1), "line {x}, row {y}");
                decoder.push(datagram, None, &mut events);
            };
            packer.event(t, (x, y), true, y, &mut sink);
            packer.over(t + 192, t + 384, &mut sink);
            expected.push((t as i64, x, y));
        }
    }
    let heard: Vec<_> = (0..events.len()).map(|k| (events.t[k], events.x[k], events.y[k])).collect();
    assert_eq!(heard, expected);
}

type Meant = (i64, u16, u16, bool, Option<u16>, bool);

#[derive(serde::Deserialize)]
struct Vector {
    rows: u16,
    columns: u16,
    events: Vec<Meant>,
    markers: Vec<(i64, bool)>,
    counts: std::collections::BTreeMap<String, u64>,
}

#[test]
fn a_vector_means_what_its_json_says() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/wire_v2");
    let mut seen = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "json") {
            continue;
        }
        let vector: Vector = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        let bytes = std::fs::read(path.with_extension("bin")).unwrap();
        let array = Array::new(vector.rows, vector.columns, 1.0, "vector").unwrap();
        let mut decoder = Decoder::new(array.clone());
        let (mut events, mut at) = (Events::empty(array), 0);
        while at < bytes.len() {
            let end = at + 2 + usize::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]));
            decoder.push(&bytes[at + 2..end], None, &mut events);
            at = end;
        }
        let ticks = |k: usize| events.intensity.as_ref().and_then(|i| i.present[k].then_some(i.ticks[k]));
        let heard: Vec<Meant> = (0..events.len())
            .map(|k| (events.t[k], events.x[k], events.y[k], events.p[k], ticks(k), events.is_repaired(k)))
            .collect();
        for (k, (a, b)) in heard.iter().zip(&vector.events).enumerate() {
            assert_eq!(a, b, "{path:?}, event {k}");
        }
        assert_eq!(heard.len(), vector.events.len(), "{path:?}");
        let markers: Vec<_> = events.markers.iter().map(|m| (m.t, m.start)).collect();
        assert_eq!(markers, vector.markers, "{path:?}");
        let counts = serde_json::to_value(decoder.counts()).unwrap();
        for (name, count) in &vector.counts {
            assert_eq!(counts[name], *count, "{path:?}, {name}");
        }
        seen += 1;
    }
    assert!(seen >= 12, "{seen} vectors");
}

#[test]
fn a_number_drawn_twice_is_a_reset_once() {
    let mut decoder = Decoder::new(Array::thesis());
    let mut events = Events::empty(Array::thesis());
    let mut datagram = Vec::new();
    let mut hear = |sequence, base| {
        let header = Header { kind: 1, board: 1, sequence, base, session: 9, stride: 6, line: 0, flags: 0, span: 192 };
        header.write(&[0x05, 0x80], &mut datagram);
        decoder.push(&datagram, None, &mut events)
    };
    let intact = |heard| matches!(heard, Outcome::Intact { .. });
    assert!(intact(hear(70_000, 20_000_000)));
    assert!(intact(hear(70_001, 20_000_192)));
    // After the reset, each once; what comes again stays a repetition, and the old session is over.
    for sequence in 0..5 {
        assert!(intact(hear(sequence, 192 * u64::from(sequence))));
        assert!(matches!(hear(sequence, 192 * u64::from(sequence)), Outcome::Repeated));
    }
    let counts = decoder.counts();
    assert_eq!((counts.intact, counts.repeated, counts.resets, counts.missing), (7, 5, 1, 0));
    assert!(events.t.is_sorted());
}
