//! Tests of streams of datagrams: cut anywhere, damaged, decoded in one call.

use rand::{Rng, SeedableRng, rngs::StdRng};
use taxel_core::vectors::Instructions;
use taxel_core::wire::Columns;
use taxel_core::wire::v2::{self, Counts, DatagramHeader, Decoder, MAGIC, StreamReader};
use taxel_core::{Array, Events, Stop};

use crate::scenes::{arrays, as_a_network, few_words, words};

#[test]
fn a_stream_is_cut_anywhere_and_found_again_after_damage() {
    let mut random = StdRng::seed_from_u64(8);
    for _ in 0..200 {
        let (mut stream, mut sent, mut junk) = (vec![], vec![], 0);
        for sequence in 0..random.random_range(1..30) {
            let body: Vec<u8> = (0..random.random_range(0..200)).map(|_| random.random()).collect();
            let header = DatagramHeader {
                kind: 1,
                board: 1,
                sequence,
                base: 0,
                session: 1,
                stride: 6,
                line: 0,
                flags: 0,
                span: 0,
            };
            let bytes = header.datagram(&body);
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
                    // A length that exceeds the remaining stream, and so delays the decoding of what follows until the
                    // stream ends.
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

/// A decoded stream: its events, its counts, and the number of bytes that belonged to no datagram.
type Decoded = (Events, Counts, u64);

fn one_by_one(stream: &[u8], array: &Array) -> Decoded {
    let (mut reader, mut datagrams) = (StreamReader::default(), vec![]);
    reader.push(stream, |datagram| datagrams.push(datagram.to_vec()));
    reader.finish(|datagram| datagrams.push(datagram.to_vec()));
    let mut decoder = Decoder::new(array.clone()).instructions(Instructions::Plain).unwrap();
    let mut events = Events::empty(array.clone());
    for datagram in datagrams {
        decoder.push(&datagram, None, &mut events);
    }
    (events, decoder.counts(), reader.skipped())
}

fn in_one_call(stream: &[u8], array: &Array) -> Decoded {
    let rows = v2::most_rows(stream.len());
    let (mut t, mut x, mut y, mut ticks) = (vec![0; rows], vec![0; rows], vec![0; rows], vec![0; rows]);
    let (mut p, mut present) = (vec![0; rows], vec![0; rows]);
    let mut columns = Columns::new(&mut t, [&mut x, &mut y, &mut ticks], [&mut p, &mut present]).unwrap();
    let (counts, skipped) = v2::decode(stream, array.clone(), &mut columns, Stop::never()).unwrap();
    let mut events = Events::empty(array.clone());
    events.repaired = columns.repaired();
    let Columns { rows: n, paired, markers, .. } = columns;
    events.markers = markers;
    let bools = |column: &[u8]| column[..n].iter().map(|&byte| byte == 1).collect::<Vec<bool>>();
    (events.t, events.x, events.y, events.p) = (t[..n].to_vec(), x[..n].to_vec(), y[..n].to_vec(), bools(&p));
    events.intensity = paired.then(|| taxel_core::Intensities { ticks: ticks[..n].to_vec(), present: bools(&present) });
    (events, counts, skipped)
}

/// Scenes of short datagrams, with everything that is not plain: other kinds, states, differences, times, taxels
/// outside the array, missing numbers, resets, another board, noise.
#[test]
fn a_stream_in_one_call_gives_what_its_datagrams_give_one_by_one() {
    let mut events = 0;
    for seed in 0..400 {
        let mut random = StdRng::seed_from_u64(seed);
        let tall = Array::new(1024, 16, 1.0, "tall").unwrap();
        let array = if random.random_bool(0.1) { tall } else { arrays(&mut random) };
        let right = v2::stride(array.rows);
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
                    0..3 if !long => few_words(&mut random, kind, &array, right),
                    _ => (random.random_range(0..4), words(&mut random, kind)),
                };
                time = if late { random.random_range(0..1 << 21) } else { time + 192 };
                if reset {
                    (session, sequence, time) = (random.random_range(1..4), random.random_range(0..3), 0);
                }
                let header = DatagramHeader {
                    kind,
                    board: u16::from(foreign),
                    sequence,
                    base: time,
                    session,
                    stride: if wide { random.random() } else { right },
                    line: if far { random.random() } else { line },
                    flags: if strange { random.random() } else { 1 },
                    span: [0, 192, u16::MAX][random.random_range(0..3)],
                };
                sequence = sequence.wrapping_add(if lost {
                    [2, 3, 70, 65_536, 200_000][random.random_range(0..5)]
                } else {
                    1
                });
                header.datagram(&body)
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
        let found = in_one_call(&stream, &array);
        found.0.view().check().unwrap();
        events += found.0.len();
        assert!(found == one_by_one(&stream, &array), "seed {seed}");
    }
    assert!(events > 200_000, "streams of too few events: {events} events");
}
