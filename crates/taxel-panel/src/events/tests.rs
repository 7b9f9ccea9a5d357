//! The view of any time of a recording equals that of a full decode.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rand::{Rng, SeedableRng, rngs::StdRng};
use taxel_core::Array;
use taxel_core::board::Board;
use taxel_core::wire::{Command, Registers};

use super::*;
use crate::columns::{COLUMN_US, SPAN, column_of};
use crate::player::{Player, ViewOptions};
use crate::state::ArrayState;
use crate::view::frame::{About, write};
use taxel_live::recording::{Header, Writer, WriterOptions};

/// The taxel whose history is shown.
const WATCHED: u32 = 2080;

/// Recording of a simulated board, with pauses longer than a turn of its clock and changes of the wire version.
pub(crate) fn recorded(name: &str, seed: u64) -> PathBuf {
    let path = std::env::temp_dir().join(format!("taxel-{name}-{}.mcap", std::process::id()));
    let array = Array::thesis();
    let mut random = StdRng::seed_from_u64(seed);
    let mut board = Board::new(Registers::default(), &array).unwrap();
    let header = Header::of_board(array.clone(), Some(Registers::default()), String::new(), 0);
    let how = WriterOptions { overwrite: true, ..WriterOptions::default() };
    let writer = Writer::create(&path, &header, how).unwrap();
    let (mut ticks, mut number) = (vec![48_u16; array.len()], 0);
    for part in 0..6 {
        if part % 2 == 1 {
            let version = if part % 4 == 1 { 2 } else { 1 };
            let registers = Registers { wire_version: version, ..*board.registers() };
            board.command(&Command { register: 0, value: registers.word(0) }.to_bytes());
        }
        for frame in 0..4000 {
            // A pause between frames 1500 and 2000.
            if !(1500..2000).contains(&frame) && random.random_range(0..3) == 0 {
                for _ in 0..random.random_range(1..300) {
                    let taxel = random.random_range(0..array.len());
                    ticks[taxel] = random.random_range(20..140);
                }
            }
            let now_ns = (board.time_us() * 1000.0) as i64 + 1_000_000_000;
            board
                .frame(&ticks, |datagram| {
                    writer.datagram(now_ns, number, datagram).unwrap();
                    number += 1;
                    true
                })
                .unwrap();
        }
    }
    writer.finish(taxel_live::recording::RecordingCounts::default()).unwrap();
    path
}

/// Held values at a time, computed from the changes alone, without state or keyframe.
pub(crate) fn held_at(changes: &[TaxelChange], t: i64, taxels: usize) -> (Vec<u16>, u64) {
    let (mut held, mut events) = (vec![UNKNOWN; taxels], 0);
    for change in changes.iter().take_while(|change| change.t <= t) {
        if change.ticks != UNKNOWN {
            held[change.taxel as usize] = change.ticks;
        }
        events += 1;
    }
    (held, events)
}

/// The index of a recording with so many bytes in memory, and all of its changes.
pub(crate) fn indexed(path: &Path, memory: u64) -> (Arc<Index>, Vec<TaxelChange>) {
    let reader = Reader::open(path).unwrap();
    // A temporary file is in the folder of the system, as this one cannot be written.
    let kept = Kept::All { memory, folder: "/nowhere".into() };
    let (index, ..) = Index::of_board(&reader, kept).unwrap();
    (Arc::new(index), changes(reader.decode(Stop::never()).unwrap().events.view()))
}

/// Raster and curves of a frame, and of which columns they are.
fn shown(player: &mut Player, us: i64) -> (std::ops::Range<i64>, Vec<u8>, Vec<u8>) {
    let about = About { flags: 0, from: i64::MIN, watched: Some(WATCHED), column_us: us };
    player.state.update_curve();
    let (bytes, _) = write(&player.state, &player.state, player.history.as_ref(), about);
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let section = |k: usize| bytes[word(64 + 8 * k)..][..word(68 + 8 * k)].to_vec();
    let first = i64::from_le_bytes(bytes[48..56].try_into().unwrap());
    assert_eq!(word(44) as i64, us);
    (first..first + word(56) as i64, section(2), section(3))
}

/// The same computed from the changes alone: each change up to `t` counts in its column, at most 15 per row.
fn counted(changes: &[TaxelChange], columns: std::ops::Range<i64>, us: i64, t: i64, array: &Array) -> Vec<u8> {
    let rows = usize::from(array.rows);
    let mut raster = vec![0_u8; (columns.end - columns.start) as usize * rows];
    for change in changes.iter().filter(|c| c.t <= t && columns.contains(&column_of(c.t, us))) {
        let row = change.taxel as usize / usize::from(array.columns);
        let cell = &mut raster[(column_of(change.t, us) - columns.start) as usize * rows + row];
        let (ups, downs) = (*cell & 15, *cell >> 4);
        *cell = if change.up { (ups + 1).min(15) | downs << 4 } else { ups | (downs + 1).min(15) << 4 };
    }
    raster
}

#[test]
fn any_time_of_a_recording_looks_as_after_a_full_decode() {
    for (seed, memory) in [(1, u64::MAX), (2, 10 << 20)] {
        let path = recorded("any-time", seed);
        let (index, changes) = indexed(&path, memory);
        assert_eq!(index.changes(), changes.len() as u64);
        let (first, last) = index.range().unwrap();
        let keys: BTreeSet<u64> = (0..100).map(|k| index.open(first + k * (last - first) / 100).unwrap().1).collect();
        assert!(keys.len() >= 5, "{seed}: {} keyframes", keys.len());
        let mut random = StdRng::seed_from_u64(7);
        for turn in 0..25 {
            let t = if turn == 24 { last } else { random.random_range(first..=last) };
            let us = [COLUMN_US, 500, 64_000][turn % 3];
            let options = ViewOptions { watched: Some(WATCHED), ..ViewOptions::plain(us) };
            let mut player = Player::open(&index, t, &options, None).unwrap();
            let (held, events) = held_at(&changes, t, index.sensor.array.len());
            assert_eq!((player.state.held(), player.state.events), (&held[..], events), "{seed} at {t} us");
            let (columns, raster, curves) = shown(&mut player, us);
            assert_eq!(columns.end, column_of(t, us) + 1);
            let begin = (columns.end - SPAN).max(column_of(first, us));
            assert_eq!(columns.start, begin, "{seed} at {t} us: all of the window");
            assert!(
                raster == counted(&changes, columns.clone(), us, t, &index.sensor.array),
                "{seed}: raster at {t} us by {us} us"
            );
            // Curves and changes by a state of the same column width, from the beginning, without a keyframe.
            let blank = Keyframe::blank(index.sensor.array.len());
            let mut slow = ArrayState::new(&index.sensor, &blank, us, 1 << 22);
            changes.iter().filter(|change| change.t <= t).for_each(|change| slow.apply(&[*change]));
            slow.advance(t);
            slow.update_curve();
            assert_eq!(player.state.change(), slow.change(), "{seed} at {t} us");
            // A column wider than those that are stored has the least and the greatest of its parts.
            let part_us = us.min(COLUMN_US);
            let mut parts = ArrayState::new(&index.sensor, &blank, part_us, 1 << 22);
            changes.iter().filter(|change| change.t <= t).for_each(|change| parts.apply(&[*change]));
            parts.advance(t);
            parts.update_curve();
            let mut same = vec![];
            for column in columns.clone() {
                let last = (((column + 1) * us - 1).div_euclid(part_us)).min(column_of(t, part_us));
                let mut whole = parts.columns().no_curves();
                parts.columns().join_curves(column * us / part_us..last + 1, &mut whole);
                whole.sums[0].write(&mut same);
            }
            assert!(curves == same, "{seed}: curves at {t} us by {us} us");
        }
        std::fs::remove_file(&path).unwrap();
    }
}

#[test]
fn steps_go_from_stamp_to_stamp_both_ways_and_through_silence() {
    let path = recorded("steps", 3);
    let (index, changes) = indexed(&path, 0);
    let mut stamps: Vec<i64> = changes.iter().map(|change| change.t).collect();
    stamps.dedup();
    let mut random = StdRng::seed_from_u64(8);
    for _ in 0..20 {
        let n = random.random_range(1..stamps.len() - 1);
        let mut player = Player::open(&index, stamps[n], &ViewOptions::plain(COLUMN_US), None).unwrap();
        assert_eq!(index.stamp_before(player.t).unwrap(), Some(stamps[n - 1]));
        assert_eq!(player.next_stamp().unwrap(), Some(stamps[n + 1]));
    }
    std::fs::remove_file(&path).unwrap();
}
