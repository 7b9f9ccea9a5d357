//! Tests of the emulated board's output: every event once, promises that hold, heartbeats in silence.

use rand::{SeedableRng, rngs::StdRng};
use taxel_core::board::Board;
use taxel_core::wire::Registers;
use taxel_core::wire::v2::{BodyKind, DatagramHeader, DatagramOutcome, Decoder, Packer, Settings};
use taxel_core::{Array, Events};

use crate::scenes::{Row, arrays, board, rows, scene};

/// The events that a board must send for each frame, found by comparing values as the specification does.
fn expected_events(frames: &[Vec<u16>], array: &Array, registers: &Registers, valued: bool) -> Vec<(i64, Vec<Row>)> {
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
fn the_host_decodes_the_events_that_the_board_sent() {
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
                    assert!(
                        events.t[before..].iter().all(|&t| t >= until),
                        "seed {seed}: an event before the promised time"
                    );
                    let DatagramOutcome::Intact { until: promised, missing: 0, reset: false } = heard else {
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
        let mut expected: Vec<Row> =
            expected_events(&frames, &array, &registers, valued).into_iter().flat_map(|f| f.1).collect();
        assert!(registers.frame_sync || events.t.is_sorted());
        // By taxel and in order of time: with frame sync at the frame's time, otherwise at the time of the step in the
        // frame.
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
fn a_slow_board_still_promises_and_silence_has_its_heartbeats() {
    let array = Array::new(4, 4, 1.0, "slow").unwrap();
    // Frames of 120 ms, which exceed the largest span.
    let registers = Registers { wire_version: 2, lines: 4, line_period: 3_000_000, ..Registers::default() };
    let mut board = Board::new(registers, &array).unwrap();
    let mut decoder = Decoder::new(array.clone());
    let mut until = 0;
    for k in 0..20_u16 {
        board
            .frame(&[if k == 3 { 50 } else { 0 }; 16], |datagram| {
                if let DatagramOutcome::Intact { until: Some(u), .. } =
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
                let (header, body) = DatagramHeader::read(datagram).unwrap();
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
fn a_datagram_of_one_event_is_one_word_wherever_it_lies_in_the_first_128_lines() {
    let array = Array::new(64, 256, 1.0, "wide").unwrap();
    let settings = Settings {
        board: 1,
        session: 1,
        kind: BodyKind::Small,
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
            packer.event(t, (x, y), true, y);
            packer.over(t + 192, t + 384);
            for (datagram, n) in packer.take() {
                let far = x > 127 && (x - 127) * 64 + y >= 127;
                assert_eq!((datagram.len(), n), (if far { 28 } else { 26 }, 1), "line {x}, row {y}");
                decoder.push(&datagram, None, &mut events);
            }
            expected.push((t as i64, x, y));
        }
    }
    let heard: Vec<_> = (0..events.len()).map(|k| (events.t[k], events.x[k], events.y[k])).collect();
    assert_eq!(heard, expected);
}
