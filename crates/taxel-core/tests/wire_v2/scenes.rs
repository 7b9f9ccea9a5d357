//! Random scenes, boards and datagrams for the tests of version 2, and the rows of events.

use rand::{Rng, rngs::StdRng};
use taxel_core::board::{Board, BoardOptions, IntensityWord, Version2};
use taxel_core::wire::Registers;
use taxel_core::{Array, Events};

/// A random scene on an array: touches that appear and disappear, noise, and sometimes a change of all taxels.
pub(crate) fn scene(random: &mut StdRng, array: &Array, frames: usize, ramp: u16) -> Vec<Vec<u16>> {
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

pub(crate) fn arrays(random: &mut StdRng) -> Array {
    let sizes = [(1, 1), (8, 8), (64, 64), (3, 64), (64, 5), (65, 33), (128, 128), (100, 200), (256, 256), (512, 128)];
    let (rows, columns) = sizes[random.random_range(0..sizes.len())];
    Array::new(rows, columns, 1.0, "drawn").unwrap()
}

pub(crate) fn board(random: &mut StdRng, array: &Array, hold_us: u64) -> Board {
    let channels = if random.random() { 16 } else { 64 };
    let mut registers = Registers::at_reset(array, channels);
    registers.wire_version = 2;
    registers.random_lines = random.random();
    if registers.random_lines {
        registers.line_period = registers.line_period.max(16 * u32::from(registers.lines));
    }
    registers.frame_sync = random.random();
    registers.noise_floor = random.random_range(0..6);
    let words = [IntensityWord::Value, IntensityWord::Difference, IntensityWord::Nothing];
    let intensity = words[random.random_range(0..3)];
    let version_2 = Version2 { board: 7, seed: random.random(), hold_us, states_us: 0, ..Version2::default() };
    let options = BoardOptions { intensity, version_2, queue: usize::MAX, ..BoardOptions::default() };
    Board::with_options(registers, array, options).unwrap()
}

pub(crate) type Row = (i64, u16, u16, bool, u16);

pub(crate) fn rows(events: &Events) -> Vec<Row> {
    let ticks = |k: usize| events.intensity.as_ref().filter(|i| i.present[k]).map_or(0, |i| i.ticks[k]);
    (0..events.len()).map(|k| (events.t[k], events.x[k], events.y[k], events.p[k], ticks(k))).collect()
}

/// Random words, including ones that a board never sends.
pub(crate) fn words(random: &mut StdRng, kind: u8) -> Vec<u8> {
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
            // An offset, sometimes one that resembles a control word.
            let offset = if random.random_bool(0.1) { u32::MAX } else { random.random_range(0..40_000) };
            body.extend(&offset.to_le_bytes()[..bytes]);
        }
    }
    if random.random_bool(0.1) {
        body.truncate(random.random_range(0..=body.len()));
    }
    body
}

/// Words of a few events on the array or slightly beyond it, and the line from which their positions count.
pub(crate) fn few_words(random: &mut StdRng, kind: u8, array: &Array, stride: u8) -> (u8, Vec<u8>) {
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

/// Drops, duplicates, delays and truncates some datagrams, and flips a bit in others; some of these get a valid
/// checksum, so that they are decoded.
pub(crate) fn as_a_network(random: &mut StdRng, datagrams: &[Vec<u8>]) -> Vec<Vec<u8>> {
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
