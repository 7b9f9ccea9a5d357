//! Tests that all sets of vector instructions decode to the same events.

use rand::{Rng, SeedableRng, rngs::StdRng};
use taxel_core::Events;
use taxel_core::vectors::Instructions;
use taxel_core::wire::v2::{DatagramHeader, DatagramOutcome, Decoder};

use crate::scenes::{arrays, as_a_network, words};

#[test]
fn every_set_of_instructions_decodes_the_same() {
    for seed in 0..300 {
        let mut random = StdRng::seed_from_u64(seed);
        let array = arrays(&mut random);
        let right = (u16::BITS - (array.rows - 1).leading_zeros()) as u8;
        let mut time = 1 << 20;
        let kind = [0, 1, 1, 2, 2][random.random_range(0..5)];
        let datagrams: Vec<Vec<u8>> = (0..60)
            .map(|sequence| {
                let kind = if random.random_bool(0.8) { kind } else { [0, 1, 2, 6, 7][random.random_range(0..5)] };
                time = if random.random_bool(0.8) { time + 192 } else { random.random_range(0..1 << 21) };
                let stride = if random.random_bool(0.9) { right } else { random.random() };
                let flags = if random.random_bool(0.9) { 1 } else { random.random() };
                let line = if random.random_bool(0.5) { 0 } else { random.random() };
                let header =
                    DatagramHeader { kind, board: 1, sequence, base: time, session: 1, stride, line, flags, span: 192 };
                header.datagram(&words(&mut random, kind))
            })
            .collect();
        let datagrams = if seed % 2 == 0 { datagrams } else { as_a_network(&mut random, &datagrams) };
        let mut first = None;
        for set in Instructions::ALL.into_iter().filter(|set| set.present()) {
            let mut decoder = Decoder::new(array.clone()).instructions(set).unwrap();
            let mut events = Events::empty(array.clone());
            let found: Vec<DatagramOutcome> =
                datagrams.iter().map(|datagram| decoder.push(datagram, None, &mut events)).collect();
            assert!(seed % 2 == 1 || found.iter().all(|heard| matches!(heard, DatagramOutcome::Intact { .. })));
            events.view().check().unwrap();
            let heard = (events, decoder.counts(), decoder.held(), found);
            let first = first.get_or_insert_with(|| heard.clone());
            assert!(*first == heard, "seed {seed}: {set:?} decodes otherwise than {:?}", Instructions::ALL[0]);
        }
    }
}
