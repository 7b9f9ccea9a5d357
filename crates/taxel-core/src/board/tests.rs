//! Tests of the emulated board as a whole: trip times and commands in, datagrams and status lines out.

use super::*;
use crate::wire::registers::PRESETS;
use crate::wire::{Command, Registers, WORD_BYTES, Word, decode};
use crate::{Array, Error};

fn board() -> Board {
    board_with(BoardOptions::default())
}

fn board_with(options: BoardOptions) -> Board {
    Board::with_options(Registers::default(), &Array::thesis(), options).unwrap()
}

fn play(board: &mut Board, ticks: &[u16]) -> Vec<Vec<u8>> {
    let mut datagrams = vec![];
    board
        .frame(ticks, |datagram| {
            datagrams.push(datagram.to_vec());
            true
        })
        .unwrap();
    datagrams
}

fn words(datagrams: &[Vec<u8>]) -> Vec<Word> {
    let word = |w: &[u8]| Word::from_bytes(w.try_into().unwrap());
    datagrams.iter().flat_map(|d| d.chunks(WORD_BYTES)).map(word).collect()
}

#[test]
fn a_full_frame_goes_line_by_line_step_by_step_channel_by_channel() {
    let datagrams = play(&mut board(), &[100; 4096]);
    assert!(datagrams.iter().all(|d| d.len() <= 1400 && d.len() % 10 == 0));
    assert_eq!(datagrams.len(), (8192_usize).div_ceil(280));
    let (events, _) = decode(&datagrams.concat(), Array::thesis());
    let order: Vec<(u16, u16)> = events.x.iter().copied().zip(events.y.iter().copied()).collect();
    let mut expected = vec![];
    for line in 0..64 {
        for step in 0..4 {
            expected.extend((0..16).map(|channel| (line, 4 * channel + step)));
        }
    }
    assert_eq!(order, expected);
}

#[test]
fn a_change_must_exceed_the_floor_and_a_ramp_is_never_exceeded() {
    let mut board = board();
    let mut ticks = vec![0; 4096];
    ticks[7] = 3;
    assert!(play(&mut board, &ticks).is_empty());
    ticks[7] = 4;
    let change = Word::Change { stamp: 1, x: 7, y: 0, p: true };
    assert_eq!(words(&play(&mut board, &ticks)), [change, Word::Intensity { ticks: 4, x: 7, y: 0, p: true }]);
    ticks[7] = 9000;
    assert_eq!(words(&play(&mut board, &ticks))[1], Word::Intensity { ticks: 150, x: 7, y: 0, p: true });
    ticks[7] = NOT_RETURNED;
    assert!(play(&mut board, &ticks).is_empty());
    assert_eq!((board.faults(), board.faults()), ("fault comparator 1\n".to_owned(), String::new()));
}

#[test]
fn a_slow_rise_is_sent_with_the_last_value_sent_and_never_with_the_last_sample() {
    let sent = |mut board: Board| -> usize {
        (0..20_u16).map(|frame| play(&mut board, &[frame; 4096]).concat().len() / 10).sum()
    };
    assert_eq!(sent(board()), 4 * 4096);
    assert_eq!(sent(board_with(BoardOptions { previous: Previous::LastSample, ..BoardOptions::default() })), 0);
}

#[test]
fn differences_carry_their_sign_in_the_polarity() {
    let mut board = board_with(BoardOptions { intensity: IntensityWord::Difference, ..BoardOptions::default() });
    let mut ticks = vec![0; 4096];
    for (value, difference, p) in [(50, 50, true), (20, 30, false)] {
        ticks[0] = value;
        assert_eq!(words(&play(&mut board, &ticks))[1], Word::Intensity { ticks: difference, x: 0, y: 0, p });
    }
}

#[test]
fn stamps_are_the_frames_with_sync_and_the_steps_without() {
    let slow = Registers { line_period: 10_000, ..Registers::default() };
    for (frame_sync, expected) in [(true, 0), (false, 63)] {
        let mut board = Board::new(Registers { frame_sync, ..slow }, &Array::thesis()).unwrap();
        let all = words(&play(&mut board, &[100; 4096]));
        let Some(Word::Change { stamp, .. }) = all.iter().rev().nth(1) else { panic!("a change") };
        assert_eq!(*stamp, expected);
    }
}

#[test]
fn random_lines_visit_each_line_once_a_frame_in_an_order_of_its_own() {
    let registers = Registers { random_lines: true, line_period: 1024, noise_floor: 0, ..Registers::default() };
    let mut board = Board::new(registers, &Array::thesis()).unwrap();
    let mut orders = std::collections::HashSet::new();
    for frame in 0..50_u16 {
        let (events, _) = decode(&play(&mut board, &[frame + 1; 4096]).concat(), Array::thesis());
        let order: Vec<u16> = events.x.chunks(64).map(|line| line[0]).collect();
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..64).collect::<Vec<u16>>());
        assert!(orders.insert(order), "frame {frame} repeats an order");
    }
}

/// The order of lines as `docs/readings.md` words it.
fn drawn(word: &mut u16, lines: u16) -> Vec<u16> {
    let mut order: Vec<u16> = (0..lines).collect();
    for k in 0..usize::from(lines) - 1 {
        for _ in 0..16 {
            let taps = [0, 2, 3, 5].map(|bit| *word >> bit & 1);
            *word = (*word >> 1) | ((taps.iter().sum::<u16>() % 2) << 15);
        }
        let left = usize::from(lines) - k;
        order.swap(k, k + ((usize::from(*word) * left) >> 16));
    }
    order
}

#[test]
fn the_random_order_is_drawn_line_by_line() {
    let registers = Registers { random_lines: true, line_period: 1024, noise_floor: 0, ..Registers::default() };
    let (mut board, mut word) = (Board::new(registers, &Array::thesis()).unwrap(), 0xace1);
    for frame in 0..20_u16 {
        let (events, _) = decode(&play(&mut board, &[frame + 1; 4096]).concat(), Array::thesis());
        let order: Vec<u16> = events.x.chunks(64).map(|line| line[0]).collect();
        assert_eq!(order, drawn(&mut word, 64), "frame {frame}");
    }
}

#[test]
fn totals_count_since_reset_and_markers_among_what_was_dropped() {
    let mut board = board_with(BoardOptions { queue: 1000, ..BoardOptions::default() });
    let nine = Command { register: 6, value: 9 }.to_bytes();
    let mut ticks = [100; 4096];
    ticks[9] = NOT_RETURNED;
    board.frame(&ticks, |_| false).unwrap();
    board.record(true);
    assert_eq!(board.command(&nine), "status frames=1 events=500 dropped=3596 datagrams=0 faults=1\n");
    board.frame(&ticks, |_| true).unwrap();
    let counts = *board.counts();
    let expected = format!("status frames=2 events=4095 dropped=3596 datagrams={} faults=2\n", counts.datagrams);
    assert_eq!(board.command(&nine), expected);
    board.reset().unwrap();
    assert_eq!(board.command(&nine), "status frames=0 events=0 dropped=0 datagrams=0 faults=0\n");
}

#[test]
fn fault_counts_begin_at_0_at_each_reset() {
    let mut board = board_with(BoardOptions { queue: 1000, ..BoardOptions::default() });
    let mut ticks = [100; 4096];
    ticks[9] = NOT_RETURNED;
    board.frame(&ticks, |_| false).unwrap();
    // No command, and the first two bytes of one, which the reset discards.
    board.command(&[0x60, 0xe0, 0]);
    assert_eq!(board.faults(), "fault queue 3595\nfault comparator 1\nfault command 1\n");
    board.reset().unwrap();
    assert_eq!((board.faults(), board.command(&[0, 0, 8])), (String::new(), String::new()));
    ticks.fill(0);
    ticks[9] = NOT_RETURNED;
    board.frame(&ticks, |_| true).unwrap();
    assert_eq!(board.faults(), "fault comparator 1\nfault command 3\n");
}

#[test]
fn the_first_datagram_begun_after_a_loss_carries_the_flag() {
    let registers = Registers { wire_version: 2, ..Registers::default() };
    let version_2 = Version2 { hold_us: 500, ..Version2::default() };
    let mut board =
        Board::with_options(registers, &Array::thesis(), BoardOptions { version_2, ..BoardOptions::default() })
            .unwrap();
    let (mut ticks, mut flags) = ([0; 4096], vec![]);
    ticks[9] = 100;
    for frame in 0..4 {
        ticks[10] = if frame == 0 { 0 } else { 100 };
        // The event of the second frame finds no room, while the datagram of the first is held.
        let accepted = [frame != 1; 4096];
        let sink = |datagram: &[u8]| {
            flags.push(datagram[17] & 4);
            true
        };
        board.frame_accepting(&ticks, Some(&accepted), sink).unwrap();
    }
    assert_eq!(flags, [0, 4]);
}

#[test]
fn only_events_of_accepted_taxels_find_room() {
    for wire_version in [1, 2] {
        let mut board = Board::new(Registers { wire_version, ..Registers::default() }, &Array::thesis()).unwrap();
        let accepted: Vec<bool> = (0..4096).map(|taxel| taxel % 3 == 0).collect();
        board.frame_accepting(&[100; 4096], Some(&accepted), |_| true).unwrap();
        let counts = *board.counts();
        assert_eq!((counts.changes, counts.dropped), (4096, 4096 - 1366), "version {wire_version}");
        // The others still differ.
        board.frame(&[100; 4096], |_| true).unwrap();
        assert_eq!(board.counts().changes, 2 * 4096 - 1366);
        assert!(board.frame_accepting(&[0; 4096], Some(&[true]), |_| true).is_err());
    }
}

#[test]
fn a_full_queue_drops_both_words_of_a_taxel_and_counts_them() {
    let mut board = board_with(BoardOptions { queue: 1000, ..BoardOptions::default() });
    board.frame(&[100; 4096], |_| false).unwrap();
    assert_eq!((board.counts().words, board.counts().dropped), (1000, 4096 - 500));
    let later = play(&mut board, &[100; 4096]);
    // Values that were never sent still differ from the reference, so the next frame sends them.
    assert_eq!(words(&later).len(), 2 * 4096);
    assert_eq!(board.counts().sent, board.counts().words);
    assert_eq!(board.faults(), "fault queue 3596\n");
}

#[test]
fn commands_are_answered_and_taken_over_at_a_frames_edge() {
    let mut board = board();
    assert_eq!(board.greeting(), "taxel-board v1 64x64 16ch\n");
    let write = |register, value| Command { register, value }.to_bytes();
    assert_eq!(board.command(&write(4, 160)), "ok REG4=0x000000A0\n");
    assert_eq!(board.command(&write(4, 161)), "bad REG4 rule 3\n");
    assert_eq!(board.command(&write(6, 4)), "ok REG4=0x000000A0\n");
    assert_eq!(board.command(&write(6, 8)), board.greeting());
    assert_eq!(board.command(&write(6, 9)), "status frames=0 events=0 dropped=0 datagrams=0 faults=0\n");
    assert_eq!(board.command(&write(6, 10)), "bad REG6 rule 4\n");
    assert_eq!(
        board.command(&[write(5, 0x003f_0a00), write(6, 5)].concat()),
        "ok REG5=0x003F0A00\nok REG5=0x003F0A00\n"
    );
    let bytes = write(1, 400);
    let answers: Vec<String> = bytes.iter().map(|&byte| board.command(&[byte])).collect();
    assert_eq!(answers.concat(), "ok REG1=0x00000190\n");
    play(&mut board, &[0; 4096]);
    assert_eq!(board.time_us(), 256.0);
}

#[test]
fn record_marks_the_stream_once_each_way() {
    let mut board = board();
    play(&mut board, &[0; 4096]);
    board.command(&Command { register: 7, value: 1 << 16 }.to_bytes());
    board.record(true);
    assert_eq!(words(&play(&mut board, &[0; 4096])), [Word::Marker { stamp: 1, start: true }]);
    board.record(false);
    assert_eq!(words(&play(&mut board, &[0; 4096])), [Word::Marker { stamp: 3, start: false }]);
    // A reset discards what was not sent.
    board.record(true);
    board.reset().unwrap();
    assert!(play(&mut board, &[0; 4096]).is_empty());
}

#[test]
fn a_board_of_afferents_fires_as_equations_5_1_to_5_5_say() {
    use rand::{Rng, SeedableRng, rngs::StdRng};
    let mut random = StdRng::seed_from_u64(9);
    let registers = Registers::preset("5.2 kHz, FA-1").unwrap();
    let mut board = Board::new(registers, &Array::thesis()).unwrap();
    // In units of 2^-16, as the page of the registers defines.
    let rest = i64::from(registers.threshold_rest) * 64;
    let jump = i64::from(registers.threshold_jump) * rest / 256;
    let decay = i64::from(registers.threshold_decay) * rest / 1024;
    let (mut base, mut theta, mut spikes) = (None, rest, 0);
    let mut ticks = vec![40_u16; 4096];
    for frame in 0..5000 {
        let step: u16 = [0, 0, 0, 1, 2, 40][random.random_range(0..6)];
        ticks[70] = if random.random() { ticks[70] + step } else { ticks[70].saturating_sub(step) }.min(150);
        // A frame in which the comparator had not returned is as if it had not been: the first one that counts comes after it.
        let returned = frame >= 3 && random.random_range(0..10) > 0;
        let mut read = ticks.clone();
        read[70] = if returned { ticks[70] } else { NOT_RETURNED };
        let sent = words(&play(&mut board, &read));
        if !returned {
            assert!(sent.is_empty(), "frame {frame}: {sent:?}");
            continue;
        }
        let pressure = (f64::from(ticks[70]).powf(0.7) * 65_536.0).round() as i64;
        let integral = pressure - *base.get_or_insert(pressure);
        if integral.abs() > theta {
            spikes += 1;
            let [Word::Change { x, y, p, .. }, Word::Intensity { ticks: told, .. }] = sent[..] else {
                panic!("frame {frame}: {sent:?}, {integral} against {theta}")
            };
            assert_eq!((x, y, p), (6, 1, integral > 0), "frame {frame}");
            assert_eq!(i64::from(told), integral.abs() / 64, "frame {frame}");
            (base, theta) = (Some(pressure), theta + jump);
        } else {
            assert!(sent.is_empty(), "frame {frame}: {sent:?}, {integral} against {theta}");
            theta = if theta > rest { theta - decay } else { rest };
        }
    }
    assert!(spikes > 50, "{spikes}");
}

#[test]
fn presets_play_on_boards_that_fit_them() {
    for preset in PRESETS.iter().filter(|p| p.sense_lines == 64 && !p.registers.mechanoreceptor) {
        let mut board = Board::new(preset.registers, &Array::thesis()).unwrap();
        assert_eq!(words(&play(&mut board, &[50; 4096])).len(), 8192, "{}", preset.name);
    }
}

#[test]
fn the_pattern_reads_as_its_page_has_it_and_begins_anew() {
    let thesis = Array::thesis();
    let of_page = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (63, 63, 0), (5, 2, 0), (0, 3, 100), (0, 4, 100)];
    let values = of_page.map(|(x, y, n)| pattern(&thesis, (x, y), n, 150));
    assert_eq!(values, [128, 112, 104, 104, 32, 121, 111]);
    assert_eq!(pattern(&thesis, (0, 0), 0, 90), 90);
    // What the comparators do has no effect; each frame without the pattern ends it.
    let mut board = Board::new(Registers { pattern: true, noise_floor: 0, ..Registers::default() }, &thesis).unwrap();
    let mut held = vec![0; 4096];
    for on in [true, false, true] {
        let word = board.registers().word(0) & !(1 << 6) | u32::from(on) << 6;
        board.command(&Command { register: 0, value: word }.to_bytes());
        for n in 0..40 {
            for word in words(&play(&mut board, &[NOT_RETURNED; 4096])) {
                if let Word::Intensity { ticks, x, y, .. } = word {
                    held[thesis.index(x.into(), y.into())] = ticks;
                }
            }
            let expected = |k: usize| pattern(&thesis, ((k % 64) as u16, (k / 64) as u16), n, 150);
            assert!(!on || (0..4096).all(|k| held[k] == expected(k)), "frame {n}");
        }
    }
    assert_eq!(board.counts().not_returned, 40 * 4096);
}

#[test]
fn nonsense_is_refused() {
    let mut board = board();
    assert!(matches!(board.frame(&[0; 4095], |_| true), Err(Error::Problem(_))));
    let wide = Array::new(2, 65, 1.0, "wide").unwrap();
    assert!(matches!(Board::new(Registers::default(), &wide), Err(Error::Device(_))));
    let huge = Array::new(257, 256, 1.0, "huge").unwrap();
    assert!(matches!(Board::new(Registers::at_reset(&huge, 64), &huge), Err(Error::Problem(_))));
    let small = Array::new(8, 8, 1.0, "small").unwrap();
    assert!(matches!(Board::new(Registers::default(), &small), Err(Error::Device(_))));
}
