//! Any bytes, in any pieces: no panic, sums that close, and the same events with every set of instructions.
//!
//! `cargo +nightly fuzz run decode` (see cargo-fuzz's book).

#![no_main]

use libfuzzer_sys::fuzz_target;
use taxel_core::vectors::Instructions;
use taxel_core::wire::Decoder;
use taxel_core::{Array, Events};

fuzz_target!(|input: &[u8]| {
    let Some((&[way, rows, columns, step], bytes)) = input.split_first_chunk::<4>() else { return };
    let array = Array::new(u16::from(rows).max(1), u16::from(columns).max(1), 1.0, "fuzz").unwrap();
    let mut first = None;
    for set in Instructions::ALL.into_iter().filter(|set| set.present()) {
        let mut decoder = Decoder::new(array.clone()).differences(way & 2 != 0).instructions(set).unwrap();
        let mut events = Events::empty(array.clone());
        for (k, piece) in bytes.chunks(1 + 4 * usize::from(step)).enumerate() {
            let arrived = (way & 4 != 0).then(|| (k as i64).wrapping_mul(i64::from(way) << 16));
            decoder.push(piece, arrived, &mut events);
            if way & 8 != 0 {
                decoder.end_of_datagram(&mut events);
            }
        }
        decoder.finish(&mut events);
        events.view().check().unwrap();
        let c = *decoder.counts();
        assert_eq!(c.bytes, bytes.len() as u64);
        assert_eq!(c.bytes, 5 * c.words + c.skipped);
        assert_eq!(c.words, c.changes + c.intensities + c.unpaired + c.markers + c.contradictory + c.outside);
        assert_eq!(c.changes, events.len() as u64);
        let first = first.get_or_insert((events.clone(), c));
        assert_eq!(*first, (events, c));
    }
});
