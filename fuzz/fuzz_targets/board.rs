//! Any commands and trip times: no panic, datagrams of whole words within their length or intact ones of version 2, and a
//! decoder that reads them.

#![no_main]

use libfuzzer_sys::fuzz_target;
use taxel_core::board::{Board, BoardOptions, DATAGRAM_WORDS};
use taxel_core::wire::v2::{self, DATAGRAM_BYTES, DatagramHeader};
use taxel_core::wire::{Decoder, Registers, WORD_BYTES};
use taxel_core::{Array, Events};

fuzz_target!(|input: &[u8]| {
    let Some((&[queue, commands, takes], rest)) = input.split_first_chunk::<3>() else { return };
    let array = Array::new(8, 64, 1.0, "fuzz").unwrap();
    let options = BoardOptions { queue: 8 * usize::from(queue), ..BoardOptions::default() };
    let mut board = Board::with_options(Registers::default(), &array, options).unwrap();
    let (serial, touch) = rest.split_at(rest.len().min(commands.into()));
    let answers = ["ok REG", "bad REG", "taxel-board v", "status frames="];
    assert!(board.command(serial).lines().all(|line| answers.iter().any(|begin| line.starts_with(begin))));
    let mut decoder = Decoder::new(array.clone());
    let (mut second, mut other) = (v2::Decoder::new(array.clone()), Events::empty(array.clone()));
    let mut first = Events::empty(array.clone());
    let mut ticks = vec![0; array.len()];
    for (frame, values) in touch.chunks(64).enumerate() {
        for (k, &value) in values.iter().enumerate() {
            ticks[(k * 7 + frame * 31) % array.len()] = u16::from(value) * 257;
        }
        let mut taken = 0u32;
        board
            .frame(&ticks, |datagram| {
                taken += 1;
                let takes = taken <= takes.into();
                if datagram[0] == v2::MAGIC {
                    assert!(datagram.len() <= DATAGRAM_BYTES && DatagramHeader::read(datagram).is_ok());
                    if takes {
                        second.push(datagram, None, &mut other);
                    }
                    return takes;
                }
                assert!(datagram.len() <= DATAGRAM_WORDS * WORD_BYTES && datagram.len() % WORD_BYTES == 0);
                if takes {
                    decoder.push(datagram, None, &mut first);
                    decoder.end_of_datagram(&mut first);
                }
                takes
            })
            .unwrap();
    }
    assert_eq!((decoder.counts().skipped, decoder.counts().unpaired), (0, 0));
    let counts = second.counts();
    assert_eq!((counts.missing, counts.repeated, counts.malformed, counts.outside, counts.unknown_kind), (0, 0, 0, 0, 0));
    if counts.intact == 0 {
        assert_eq!(decoder.counts().words, board.counts().sent);
    }
});
