//! Any datagrams of either version, half of them with a checksum that holds: no panic, sums that close, and nothing twice.

#![no_main]

use libfuzzer_sys::fuzz_target;
use taxel_core::wire::v2::{DATAGRAM_BYTES, HEADER_BYTES, DatagramHeader};
use taxel_core::wire::{Decoder, SenderDecoder};
use taxel_core::{Array, Events};

fuzz_target!(|input: &[u8]| {
    let Some((&[way, rows, columns], mut rest)) = input.split_first_chunk::<3>() else { return };
    let array = Array::new(u16::from(rows).max(1), u16::from(columns).max(1), 1.0, "fuzz").unwrap();
    let mut decoder = SenderDecoder::new(Decoder::new(array.clone()), 1 + (way & 1));
    let mut events = Events::empty(array);
    let (mut first, mut bytes, mut took) = (Vec::new(), 0, 0u64);
    while let Some((&[kind, length, wait], after)) = rest.split_first_chunk::<3>() {
        let (piece, after) = after.split_at(after.len().min(usize::from(length)));
        rest = after;
        let seals = kind & 1 == 0 && piece.len() >= HEADER_BYTES;
        let datagram = if seals { seal(piece, kind) } else { piece.to_vec() };
        assert!(datagram.len() <= DATAGRAM_BYTES);
        took += i64::from(wait) as u64;
        let arrived = (way & 2 != 0).then_some((took as i64) << (way >> 2));
        bytes += datagram.len() as u64;
        decoder.push(&datagram, arrived, &mut events);
        // The same again, when its version is certain: of version 2 it gives nothing, unless it shows that a session, whose
        // number was drawn twice, begins again.
        if kind & 2 != 0 && DatagramHeader::read(&datagram).is_ok() {
            let (decoded, counts) = (events.len(), decoder.version_2().counts());
            bytes += datagram.len() as u64;
            decoder.push(&datagram, arrived, &mut events);
            let now = decoder.version_2().counts();
            assert!(now.resets > counts.resets || (events.len(), now.intact) == (decoded, counts.intact));
        }
        first.push(datagram);
    }
    decoder.finish_into(&mut events);
    events.view().check().unwrap();
    let (one, two) = (*decoder.counts(), decoder.version_2().counts());
    assert_eq!(two.datagrams, two.intact + two.repeated + two.old + two.short + two.foreign + two.checksum);
    assert_eq!(one.bytes, 5 * one.words + one.skipped);
    assert_eq!(events.len() as u64, one.changes + two.events);
    assert!(one.bytes + decoder.totals().refused <= bytes);
});

/// A datagram of version 2 whose checksum holds: its header's first bytes from the piece, few boards and sessions.
fn seal(piece: &[u8], kind: u8) -> Vec<u8> {
    let (head, body) = piece.split_at(HEADER_BYTES);
    let header = DatagramHeader {
        kind: head[1] & 0xf,
        board: u16::from(head[2] & 1),
        sequence: u32::from_le_bytes([head[4], head[5], if kind & 4 == 0 { 0 } else { head[6] }, if kind & 4 == 0 { 0 } else { head[7] }]),
        base: (0..6).fold(0, |base, at| base << 8 | u64::from(head[8 + at])) >> (kind & 0x38),
        session: u16::from(head[14] & 7),
        stride: head[16],
        line: head[16] >> 5 | head[17] & 0x70,
        flags: head[17],
        span: u16::from_le_bytes([head[3], head[15]]),
    };
    header.datagram(body)
}
