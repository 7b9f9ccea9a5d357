//! Any bodies of version 2, sealed so that they are read: no panic, and the same events, counts and held values with every set of
//! instructions.

#![no_main]

use libfuzzer_sys::fuzz_target;
use taxel_core::vectors::Instructions;
use taxel_core::wire::v2::{Decoder, DatagramHeader, DatagramOutcome, stride};
use taxel_core::{Array, Events};

fuzz_target!(|input: &[u8]| {
    let Some((&[rows, columns], mut rest)) = input.split_first_chunk::<2>() else { return };
    let array = Array::new(1 << (rows % 10), u16::from(columns) + 1, 1.0, "fuzz").unwrap();
    let mut datagrams = vec![];
    let mut base = 0;
    while let Some((&[kind, flags, length, on], after)) = rest.split_first_chunk::<4>() {
        let (body, after) = after.split_at(after.len().min(2 * usize::from(length)));
        rest = after;
        // Nearly always the array's own stride, nearly always ahead.
        let stride = if flags & 0xe0 == 0xe0 { on % 32 } else { stride(array.rows) };
        base = if flags & 0x1c == 0x1c { u64::from(on) } else { base + u64::from(on) };
        let (sequence, line) = (datagrams.len() as u32, if kind & 0x40 == 0 { 0 } else { on });
        let header = DatagramHeader { kind: kind & 7, board: 1, sequence, base, session: 1, stride, line, flags, span: 0 };
        datagrams.push(header.datagram(body));
    }
    let mut first = None;
    for set in Instructions::ALL.into_iter().filter(|set| set.present()) {
        let mut decoder = Decoder::new(array.clone()).instructions(set).unwrap();
        let mut events = Events::empty(array.clone());
        for datagram in &datagrams {
            assert!(matches!(decoder.push(datagram, None, &mut events), DatagramOutcome::Intact { .. }));
        }
        events.view().check().unwrap();
        assert_eq!(decoder.counts().events, events.len() as u64);
        let decoded = (events, decoder.counts(), decoder.held());
        let first = first.get_or_insert_with(|| decoded.clone());
        assert_eq!(*first, decoded);
    }
});
