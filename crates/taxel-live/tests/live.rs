//! From the emulated board's frames to recorded datagrams and detections: nothing is lost uncounted, and the recording
//! gives what was received live.

mod defaults;
mod ways;

use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead, BufReader, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpStream};
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use taxel_core::board::Board;
use taxel_core::detect::{Detection, Detector, Readout, TrainedNeuron};
use taxel_core::encode::Encoder;
use taxel_core::neuron::{Neuron, Time};
use taxel_core::wire::{Command, Decoder, Registers};
use taxel_core::{Array, Events, Stop};
use taxel_live::capture::Sender;
use taxel_live::emulate::{self, Emulator, Report, Touch};
use taxel_live::pipeline::{Live, LiveOptions, LiveSummary, OutputDetection, Sink, StatedTare};
use taxel_live::recording::{FileEnding, NOTHING_LOST, Reader, RecordingStatus, Topic};

const ANY: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(Ipv4Addr::LOCALHOST), 0);

/// A file name of its own for each test, removed at the end.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("taxel-{}-{name}", std::process::id()));
        let _ = std::fs::remove_file(&path);
        Self(path)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
        let _ = std::fs::remove_file(self.0.with_extension("lss"));
    }
}

/// Presses that come and go every 40 ms on a square that wanders; quiet from frame `pressed` on.
fn presses(frames: u64, pressed: u64) -> impl Touch {
    let mut k = 0;
    move |ticks: &mut [u16]| {
        ticks.fill(20);
        let (press, phase) = (k / 208, (k % 208) as u16);
        if k < pressed && phase < 80 {
            let (x, y) = ((press * 7 % 50) as usize, (press * 11 % 50) as usize);
            for row in y..y + 6 {
                ticks[row * 64 + x..row * 64 + x + 6].fill(20 + 2 * phase.min(80 - phase));
            }
        }
        k += 1;
        k <= frames
    }
}

/// What the board sends of these frames, straight from its state machine.
fn sent(frames: u64, pressed: u64) -> Events {
    let array = Array::thesis();
    let mut board = Board::new(Registers::default(), &array).expect("a valid preset");
    let mut decoder = Decoder::new(array.clone());
    let mut events = Events::empty(array.clone());
    let mut touch = presses(frames, pressed);
    let mut ticks = vec![0; array.len()];
    while touch.frame(&mut ticks, Stop::never()).expect("a frame") {
        board
            .frame(&ticks, |datagram| {
                decoder.push(datagram, None, &mut events);
                decoder.end_of_datagram(&mut events);
                true
            })
            .expect("a frame of the array's size");
    }
    decoder.finish(&mut events);
    events
}

fn emulate(to: SocketAddr, real_time: bool, mut touch: impl Touch) -> Report {
    let array = Array::thesis();
    let board = Board::new(Registers::default(), &array).expect("a valid preset");
    let options = emulate::EmulatorOptions { real_time, ..emulate::EmulatorOptions::to(to) };
    let mut emulator = Emulator::open(board, &array, options).expect("a socket");
    emulator.run(&mut touch, |_, _| {}, Stop::never()).expect("sent")
}

/// Reads every event and fires after some forty within `tau` ms, which is how slowly its kernel rises.
fn readout(tau: f64) -> Readout {
    let neuron = Neuron { tau, refractory: 15.0, theta_0: 0.4, ..Neuron::default() };
    let cell = TrainedNeuron { delay_ms: 0.0, inputs: vec![], weights: vec![0.03; 2 * 4096], neuron };
    readout_of(r#"{"name": "change_events"}"#, cell)
}

fn readout_of(encoder: &str, cell: TrainedNeuron) -> Readout {
    Readout {
        encoder: Encoder::from_json(encoder).expect("an encoder"),
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
    }
}

fn options(record: Option<&Scratch>) -> LiveOptions {
    let record = record.map(|s| s.0.clone());
    // A machine too slow for real time holds frames back: here the host's clock moves nothing on, so no event is late.
    LiveOptions {
        record,
        compression: "lz4".to_owned(),
        guard_frames: Some(1e9),
        ..defaults::options(&Array::thesis(), ANY)
    }
}

fn reading(readout: &Readout, options: LiveOptions) -> LiveOptions {
    LiveOptions { readout: defaults::stated(readout), ..options }
}

fn wait_for(live: &Live, what: impl Fn(&Live) -> bool) {
    let begun = Instant::now();
    while !what(live) {
        assert!(begun.elapsed() < Duration::from_secs(30), "never came: {:?}", live.counters());
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn assert_closed(summary: &LiveSummary, report: &Report) {
    let c = &summary.counters;
    assert_eq!(report.board.datagrams, report.sent.datagrams);
    assert_eq!(c.capture.datagrams, c.decoding.decoded + c.capture.dropped_by_queue);
    assert_eq!(c.capture.waiting, 0);
    assert_eq!(c.decoding.wire.bytes, 5 * c.decoding.wire.words + c.decoding.wire.skipped);
    assert_eq!(c.decoding.wire.bytes, c.capture.bytes - c.capture.bytes_dropped_by_queue);
    assert_eq!(c.capture.messages + c.capture.dropped_by_kernel.known(), report.sent.messages);
    assert_eq!(c.capture.dropped_by_kernel.are_known(), !ways::is_portable());
    // Without the kernel's stamps it is not known how long a datagram waited.
    assert_eq!(c.decode_latency.count > 0, !ways::is_portable());
}

fn recorded(path: &Scratch) -> (Events, Vec<Detection>) {
    let reader = Reader::open(&path.0).expect("a recording");
    let mut decoder = Decoder::new(reader.header().array.clone());
    let mut events = Events::empty(reader.header().array.clone());
    reader
        .messages(Stop::never(), |message| {
            if message.topic == Topic::Datagrams {
                decoder.push(message.data, Some(message.at_ns / 1000), &mut events);
                decoder.end_of_datagram(&mut events);
            }
            Ok(())
        })
        .expect("sound chunks");
    decoder.finish(&mut events);
    let detections = reader.remarks(Stop::never()).expect("sound chunks").0.detections;
    (events, detections.into_iter().map(|(_, d)| d).collect())
}

#[test]
fn a_recording_holds_the_events_that_the_board_sent() {
    let path = Scratch::new("events.mcap");
    let live = Live::open(options(Some(&path)), vec![]).expect("a port and a file");
    let report = emulate(live.address(), false, presses(3000, 3000));
    let summary = live.stop().expect("no error");
    assert_closed(&summary, &report);
    let expected = sent(3000, 3000);
    assert!(expected.len() > 4096);
    assert_eq!(summary.counters.decoding.events, expected.len() as u64);
    assert_eq!(recorded(&path).0, expected);
    let (text, status) = match ways::is_portable() {
        true => ("losses unknown: the kernel does not count dropped datagrams", RecordingStatus::Unknown),
        false => (NOTHING_LOST, RecordingStatus::CompleteAfterArrival),
    };
    assert_eq!((summary.verdict.text().as_str(), summary.verdict.status), (text, status));
    // The file says the same.
    let reader = Reader::open(&path.0).expect("a recording");
    let Some(FileEnding::Finished { counts }) = reader.ending() else { panic!("{:?}", reader.ending()) };
    assert_eq!(counts.verdict(), summary.verdict);
    assert_eq!(
        (counts.dropped_by_kernel, counts.stamped_when_read),
        (summary.counters.capture.dropped_by_kernel, ways::is_portable())
    );
}

#[test]
fn detections_live_are_those_of_the_recording() {
    let path = Scratch::new("detections.mcap");
    let delivered = Arc::new(Mutex::new(Vec::<OutputDetection>::new()));
    let sink = Arc::clone(&delivered);
    let sinks: Vec<Box<dyn Sink>> = vec![Box::new(move |output: &OutputDetection| {
        sink.lock().expect("not poisoned").push(output.clone());
        Ok(())
    })];
    let live = Live::open(reading(&readout(2.0), options(Some(&path))), sinks).expect("a port and a file");
    let report = emulate(live.address(), true, presses(4000, 4000));
    let mut queued = vec![];
    while let Some(output) = live.next(Duration::from_millis(500)).expect("no error") {
        queued.push(output);
    }
    let summary = live.stop().expect("no error");
    assert_closed(&summary, &report);
    assert_eq!(summary.counters.readout.late, 0);
    assert_eq!(summary.counters.decoding.events, summary.counters.readout.read_out);
    let delivered = delivered.lock().expect("not poisoned");
    assert_eq!(*delivered, queued, "sink and queue get the same");
    let output: Vec<Detection> = delivered.iter().map(|s| s.detection.clone()).collect();
    let (events, detections) = recorded(&path);
    assert_eq!(detections, output, "the recording has the detections that were output");
    let mut again = Detector::from(readout(2.0))
        .run_events(events.view(), 192.0, None, &[], None, Stop::never())
        .expect("a sound readout");
    // Nothing moved the time on after the last event, and what it would have led to was not output.
    again.retain(|d| Some(&d.t) < events.t.last());
    assert_eq!(again, output);
    assert!(again.len() > 5, "the presses are detected: {}", again.len());
    // By the host's clock less the offset no detection can be output before it was known, but for the clocks' estimate.
    assert!(delivered.iter().all(|s| s.reported_us >= s.detection.known - 192), "{delivered:?}");
}

#[test]
fn a_recording_has_ten_previews_a_second() {
    let path = Scratch::new("preview_times.mcap");
    let begun = Instant::now();
    let live = Live::open(reading(&readout(2.0), options(Some(&path))), vec![]).expect("a port and a file");
    emulate(live.address(), true, presses(6000, 6000));
    while live.next(Duration::from_millis(200)).expect("no error").is_some() {}
    live.stop().expect("no error");
    let (remarks, _) = Reader::open(&path.0).and_then(|reader| reader.remarks(Stop::never())).expect("a recording");
    let (tenths, previews) = (begun.elapsed().as_millis() / 100, remarks.messages[&Topic::Pressure]);
    assert!(previews > 2 && u128::from(previews) <= tenths + 2, "{previews} in {tenths} tenths of a second");
}

#[test]
fn in_silence_time_moves_on_by_the_hosts_clock() {
    let live = Live::open(reading(&readout(20.0), LiveOptions { guard_frames: Some(5.0), ..options(None) }), vec![])
        .expect("a port");
    // Two frames are all that ever comes; the potential crosses some ms after them.
    let mut frames = 0;
    emulate(live.address(), true, move |ticks: &mut [u16]| {
        frames += 1;
        ticks[..40].fill(20 * frames);
        frames <= 2
    });
    let output = live.next(Duration::from_secs(30)).expect("no error").expect("it is output though no event follows");
    assert!(output.detection.t > 1000, "the kernel takes its time: {output:?}");
    live.stop().expect("no error");
}

#[test]
fn damaged_and_reordered_datagrams_are_counted_and_close_the_sum_of_bytes() {
    let live = Live::open(options(None), vec![]).expect("a port");
    let mut datagrams: Vec<Vec<u8>> = vec![];
    let mut board = Board::new(Registers::default(), &Array::thesis()).expect("a valid preset");
    let mut touch = presses(800, 800);
    let mut ticks = vec![0; 4096];
    while touch.frame(&mut ticks, Stop::never()).expect("a frame") {
        board
            .frame(&ticks, |datagram| {
                datagrams.push(datagram.to_vec());
                true
            })
            .expect("a frame");
    }
    let mut random = 7_u32;
    let mut next = |n: usize| {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (random >> 8) as usize % n
    };
    for k in 0..datagrams.len() {
        let length = datagrams[k].len();
        match next(6) {
            0 => datagrams[k].truncate(next(length)),
            1 => datagrams[k].drain(..next(length)).for_each(drop),
            2 => datagrams[k][next(length)] ^= 1 << next(8),
            3 if k > 0 => datagrams.swap(k, k - 1),
            _ => {}
        }
    }
    let mut sender = Sender::open(live.address(), true).expect("a socket");
    datagrams.iter().for_each(|d| sender.push(d).expect("sent"));
    sender.flush().expect("sent");
    let summary = live.stop().expect("no error");
    let (c, sent) = (summary.counters, sender.counts());
    assert_eq!(
        (c.capture.datagrams, c.capture.bytes, c.decoding.decoded),
        (sent.datagrams, sent.bytes, sent.datagrams)
    );
    assert_eq!(c.decoding.wire.bytes, sent.bytes);
    assert_eq!(c.decoding.wire.bytes, 5 * c.decoding.wire.words + c.decoding.wire.skipped);
    let w = c.decoding.wire;
    assert!(w.skipped > 0 && w.short > 0 && w.unpaired > 0 && w.back > 0, "{w:?}");
    let kinds = w.changes + w.intensities + w.unpaired + w.markers + w.contradictory + w.outside;
    assert_eq!(w.words, kinds);
    for cause in ["bytes skipped", "short events", "events out of order"] {
        assert!(summary.verdict.text().contains(cause), "{}", summary.verdict.text());
    }
}

#[test]
fn a_slow_readout_loses_events_where_they_are_counted_and_the_recording_loses_none() {
    let path = Scratch::new("slow.mcap");
    let slow: Box<dyn Sink> = Box::new(|_: &OutputDetection| {
        std::thread::sleep(Duration::from_millis(50));
        Ok(())
    });
    let options = LiveOptions { readout_events: 1000, ..options(Some(&path)) };
    let live = Live::open(reading(&readout(20.0), options), vec![slow]).expect("started");
    let report = emulate(live.address(), false, presses(3000, 3000));
    let summary = live.stop().expect("no error");
    assert_closed(&summary, &report);
    let c = &summary.counters;
    assert!(c.readout.events_dropped > 0);
    assert_eq!(c.decoding.events, c.readout.read_out + c.readout.events_dropped);
    assert_eq!(recorded(&path).0, sent(3000, 3000));
}

#[test]
fn a_slow_sink_delays_neither_what_comes_nor_what_is_read_out() {
    let (free, held) = std::sync::mpsc::channel::<()>();
    let delivered = Arc::new(Mutex::new(Vec::<Detection>::new()));
    let sink = Arc::clone(&delivered);
    let slow: Box<dyn Sink> = Box::new(move |output: &OutputDetection| {
        sink.lock().expect("not poisoned").push(output.detection.clone());
        // Waits until the test drops the other end; then returns at once.
        let _ = held.recv();
        Ok(())
    });
    let live = Live::open(reading(&readout(2.0), options(None)), vec![slow]).expect("a port");
    let report = emulate(live.address(), true, presses(1500, 1500));
    let expected = sent(1500, 1500);
    wait_for(&live, |live| live.counters().readout.read_out == expected.len() as u64);
    assert_eq!((delivered.lock().expect("not poisoned").len(), live.counters().readout.detections), (1, 0));
    drop(free);
    let summary = live.stop().expect("no error");
    assert_closed(&summary, &report);
    let mut again = Detector::from(readout(2.0))
        .run_events(expected.view(), 192.0, None, &[], None, Stop::never())
        .expect("a sound readout");
    again.retain(|d| Some(&d.t) < expected.t.last());
    assert!(again.len() > 3, "the presses are detected: {}", again.len());
    assert_eq!(*delivered.lock().expect("not poisoned"), again, "each once, in their order");
    assert_eq!(summary.counters.readout.detections, again.len() as u64);
}

#[test]
fn a_file_that_exists_stays_and_its_port_is_free() {
    let path = Scratch::new("earlier.mcap");
    std::fs::write(&path.0, "mine").expect("written");
    let error = Live::open(options(Some(&path)), vec![]).err().expect("refused");
    assert!(matches!(&error, taxel_live::Error::File { .. }), "{error}");
    assert_eq!(std::fs::read(&path.0).expect("still there"), b"mine");
}

#[test]
fn a_port_that_is_taken_leaves_no_file_behind() {
    let path = Scratch::new("unborn.mcap");
    let holder = Live::open(options(None), vec![]).expect("a port");
    let error = Live::open(LiveOptions { port: Some(holder.address().port()), ..options(Some(&path)) }, vec![])
        .err()
        .expect("refused");
    assert!(matches!(&error, taxel_live::Error::Socket { .. }), "{error}");
    assert!(!path.0.exists());
}

#[test]
fn a_stop_ends_also_while_datagrams_pour_in() {
    let live = Live::open(options(None), vec![]).expect("a port");
    let to = live.address();
    let done = Arc::new(std::sync::atomic::AtomicBool::new(false));
    let theirs = Arc::clone(&done);
    let pouring = std::thread::spawn(move || {
        let mut sender = Sender::open(to, true).expect("a socket");
        while !theirs.load(std::sync::atomic::Ordering::Relaxed) {
            sender.push(&[0; 1400]).expect("sent");
        }
    });
    wait_for(&live, |live| live.counters().decoding.decoded > 1000);
    let summary = live.stop().expect("no error");
    done.store(true, std::sync::atomic::Ordering::Relaxed);
    pouring.join().expect("sent all along");
    let c = summary.counters;
    assert_eq!(c.capture.datagrams, c.decoding.decoded + c.capture.dropped_by_queue);
}

#[test]
fn a_tare_is_made_of_the_stretch_before_the_start_marker_and_the_readout_reads_what_follows() {
    let mut weights = vec![0.0; 10];
    weights[0] = 3.0;
    let neuron = Neuron { tau: 0.5, refractory: 15.0, ..Neuron::default() };
    let readout =
        readout_of(r#"{"name": "contact_area"}"#, TrainedNeuron { neuron, delay_ms: 0.0, inputs: vec![], weights });
    let path = Scratch::new("tare.mcap");
    let options = LiveOptions { tare: Some(StatedTare::Seconds(1.0)), ..reading(&readout, options(Some(&path))) };
    let live = Live::open(options, vec![]).expect("a port");
    wait_for(&live, |live| live.counters().readout.taring);
    let array = Array::thesis();
    let board = Board::new(Registers::default(), &array).expect("a valid preset");
    let commands = vec![(260, Command::new(7, 1 << 16).expect("a command"))];
    let options = emulate::EmulatorOptions { commands, ..emulate::EmulatorOptions::to(live.address()) };
    let mut emulator = Emulator::open(board, &array, options).expect("a socket");
    let (mut quiet, mut pressed) = (presses(300, 0), presses(1500, 1000));
    let mut touch = move |ticks: &mut [u16]| {
        let never = Stop::never();
        quiet.frame(ticks, never).expect("a frame") || pressed.frame(ticks, never).expect("a frame")
    };
    let report = emulator.run(&mut touch, |_, _| {}, Stop::never()).expect("sent");
    let mut detections = vec![];
    while let Some(next) = live.next(Duration::from_millis(500)).expect("no error") {
        detections.push(next.detection);
    }
    let start = 260 * 192 / 100 * 100;
    assert_eq!(live.take_markers().iter().map(|m| (m.t, m.start)).collect::<Vec<_>>(), [(start, true)]);
    let tare = live.tare().expect("measured");
    assert!(!live.counters().readout.taring);
    let summary = live.stop().expect("no error");
    assert_closed(&summary, &report);
    assert_eq!((tare.start_us, tare.stop_us), (0, start));
    assert!(tare.rest.iter().all(|&rest| rest == Some(20.0)));
    assert_eq!(detections.len(), 5, "a press each 208 frames of 1000");
    let again = Detector::from(readout)
        .run_events(recorded(&path).0.view(), 192.0, Some(&tare), &[], None, Stop::never())
        .expect("a sound readout");
    assert_eq!(again, detections);
}

#[test]
fn the_board_takes_commands_and_answers() {
    let live = Live::open(options(None), vec![]).expect("a port");
    let array = Array::thesis();
    let board = Board::new(Registers::default(), &array).expect("a valid preset");
    let control = Some(ANY);
    let options = emulate::EmulatorOptions { control, ..emulate::EmulatorOptions::to(live.address()) };
    let mut emulator = Emulator::open(board, &array, options).expect("sockets");
    let address = emulator.control_address().expect("a port");
    let stop = std::sync::atomic::AtomicBool::new(false);
    let asked = || stop.load(std::sync::atomic::Ordering::Relaxed);
    std::thread::scope(|scope| {
        let board = scope.spawn(|| emulator.run(&mut presses(u64::MAX, 0), |_, _| {}, Stop::when(&asked)));
        let mut cable = TcpStream::connect(address).expect("the board listens");
        let mut lines = BufReader::new(cable.try_clone().expect("a handle")).lines();
        let mut answer = |command: Option<(u8, u32)>| {
            if let Some((register, value)) = command {
                cable.write_all(&Command::new(register, value).expect("a command").to_bytes()).expect("sent");
            }
            lines.next().expect("a line").expect("text")
        };
        assert_eq!(answer(None), "taxel-board v1 64x64 16ch");
        assert_eq!(answer(Some((7, 1 << 16))), "ok REG7=0x00010000");
        assert_eq!(answer(Some((2, 301))), "bad REG2 rule 1");
        wait_for(&live, |live| live.counters().board.marked_start == Some(true));
        stop.store(true, std::sync::atomic::Ordering::Relaxed);
        let report = board.join().expect("no panic").expect("sent");
        assert_eq!(report.late.count, report.board.frames);
    });
    live.stop().expect("no error");
}
