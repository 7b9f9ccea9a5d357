//! A board that speaks version 2, received live: what was lost is known, and its promises say when a moment is over.

mod defaults;
mod ways;

use std::collections::{BTreeMap, BTreeSet};
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use taxel_core::board::{Board, BoardOptions, Version2};
use taxel_core::detect::{Readout, TrainedNeuron};
use taxel_core::encode::Encoder;
use taxel_core::neuron::{Neuron, Time};
use taxel_core::wire::{Registers, v2};
use taxel_core::{Array, Events, Stop};
use taxel_live::pipeline::{Live, LiveOptions};
use taxel_live::recording::Reader;

const ANY: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(Ipv4Addr::LOCALHOST), 0);

struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        Self(std::env::temp_dir().join(format!("taxel-{}-{name}", std::process::id())))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

fn options(array: &Array, registers: Registers, record: Option<&Scratch>) -> LiveOptions {
    let record = record.map(|s| s.0.clone());
    // The host's clock moves nothing on.
    LiveOptions {
        record,
        compression: "lz4".to_owned(),
        registers,
        guard_frames: Some(1e9),
        ..defaults::options(array, ANY)
    }
}

/// The datagrams of frames in which a square comes and goes.
fn datagrams(array: &Array, registers: Registers, frames: u16) -> Vec<Vec<u8>> {
    let version_2 = Version2 { states_us: 20_000, ..Version2::default() };
    let options = BoardOptions { version_2, ..BoardOptions::default() };
    let mut board = Board::with_options(registers, array, options).expect("sound registers");
    let mut sent = vec![];
    for k in 0..frames {
        // Above the floor of every preset, so that each taxel is sent once.
        let mut ticks = vec![40; array.len()];
        let columns = usize::from(array.columns);
        for y in 4..20 {
            ticks[y * columns + 5..y * columns + 15].fill(40 + 3 * (k % 40).min(40 - k % 40));
        }
        board
            .frame(&ticks, |datagram| {
                sent.push(datagram.to_vec());
                true
            })
            .expect("a frame");
    }
    sent
}

fn send(to: SocketAddr, datagrams: &[Vec<u8>]) {
    let socket = UdpSocket::bind(ANY).expect("a socket");
    for (k, datagram) in datagrams.iter().enumerate() {
        socket.send_to(datagram, to).expect("sent");
        if k % 16 == 15 {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

fn wait_for(live: &Live, what: impl Fn(&Live) -> bool) {
    let begun = Instant::now();
    while !what(live) {
        assert!(begun.elapsed() < Duration::from_secs(30), "never came: {:?}", live.counters());
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn decoded(array: &Array, datagrams: &[Vec<u8>]) -> Events {
    let (mut events, mut decoder) = (Events::empty(array.clone()), v2::Decoder::new(array.clone()));
    for datagram in datagrams {
        decoder.push(datagram, None, &mut events);
    }
    events
}

#[test]
fn a_large_array_is_recorded_and_every_loss_is_counted() {
    let array = Array::new(128, 128, 1.0, "large").expect("an array");
    let registers = Registers::at_reset(&array, 64);
    let mut sent = datagrams(&array, registers, 300);
    for lossy in [false, true] {
        let path = Scratch::new(if lossy { "lossy.mcap" } else { "whole.mcap" });
        let live = Live::open(options(&array, registers, Some(&path)), vec![]).expect("a port");
        let mut lost = 0;
        if lossy {
            let whole = std::mem::take(&mut sent);
            let last = whole.len() - 1;
            for (k, mut datagram) in whole.into_iter().enumerate() {
                match k % 50 {
                    7 if k < last => lost += 1,
                    9 if k < last => {
                        lost += 1;
                        datagram[20] ^= 8;
                        sent.push(datagram);
                    }
                    _ => sent.push(datagram),
                }
            }
        }
        send(live.address(), &sent);
        wait_for(&live, |live| live.counters().decoding.decoded == sent.len() as u64);
        let summary = live.stop().expect("a sound way");
        let counters = &summary.counters;
        assert_eq!((counters.decoding.wire_version, counters.decoding.wire.bytes), (2, 0));
        assert_eq!(counters.decoding.wire_v2.missing, lost);
        let verdict = if lossy {
            format!("LOST: {lost} datagrams lost or damaged on the way")
        } else {
            "nothing lost".to_owned()
        };
        assert!(summary.verdict.text().starts_with(&verdict), "{}", summary.verdict.text());
        let reader = Reader::open(&path.0).expect("a recording");
        let read = reader.decode(Stop::never()).expect("sound chunks");
        let expected = decoded(&array, &sent);
        assert_eq!((read.events.t.len(), &read.events), (expected.t.len(), &expected));
        assert_eq!(read.version_2, counters.decoding.wire_v2);
        assert_eq!(read.version_2.repaired > 0, lossy);
    }
}

#[test]
fn in_silence_time_moves_on_by_the_boards_promises() {
    let array = Array::thesis();
    let registers = Registers { wire_version: 2, ..Registers::default() };
    let neuron = Neuron { tau: 20.0, refractory: 15.0, theta_0: 0.4, ..Neuron::default() };
    let cell = TrainedNeuron { delay_ms: 0.0, inputs: vec![], weights: vec![0.03; 2 * 4096], neuron };
    let readout = Readout {
        encoder: Encoder::from_json(r#"{"name": "change_events"}"#).expect("an encoder"),
        array: None,
        unit: None,
        time: Time::Continuous,
        after_spike: cell.neuron.after_spike,
        run_threshold: 1.0,
        pads: false,
        delays_ms: vec![0.0],
        neurons: [("touch".to_owned(), cell)].into(),
        rules: BTreeMap::new(),
        by_rule: BTreeSet::new(),
        rest: None,
        training: None,
    };
    let options = LiveOptions { readout: defaults::stated(&readout), ..options(&array, registers, None) };
    let live = Live::open(options, vec![]).expect("a port");
    let mut board = Board::new(registers, &array).expect("sound registers");
    let socket = UdpSocket::bind(ANY).expect("a socket");
    // Two frames with events, then nothing but heartbeats; the potential crosses some ms later.
    for k in 0..200_u16 {
        let mut ticks = vec![0; 4096];
        ticks[..40].fill(20 * (k + 1).min(2));
        board.frame(&ticks, |datagram| socket.send_to(datagram, live.address()).is_ok()).expect("a frame");
        std::thread::sleep(Duration::from_micros(100));
    }
    let output = live.next(Duration::from_secs(30)).expect("no error").expect("it is output though no event follows");
    assert!(output.detection.t > 1000, "the kernel takes its time: {output:?}");
    assert_eq!(live.counters().readout.wrong, 0);
    live.stop().expect("a sound way");
}
