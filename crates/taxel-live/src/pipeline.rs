//! Datagrams to detections, as they come.
//!
//! Threads with fixed jobs: *receive* ([`crate::capture`]), *decode and record*, *encode and read out*. What waits between
//! two of them is bounded, and what finds no room is counted where it was lost. A detection leaves from the thread that
//! made it. Who looks on gets copies ([`Live::counters`], [`Live::picture`]) and slows nothing.

mod ahead;
mod decode;
mod handover;
mod read;
mod recorder;
mod rest;

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crossbeam_channel as channel;
use serde::Serialize;
use taxel_core::detect::Detection;
use taxel_core::encode::Tare;
use taxel_core::wire::{self, Decoder, Registers};
use taxel_core::{Array, Marker};

use crate::capture::{self, Receiver};
use crate::clock::Offset;
use crate::latency::{Latencies, Quantiles};
use crate::recording::Compression;
use crate::{Error, Result};
use handover::Handover;
pub use read::Ear;
use recorder::Recorder;

/// How many detections wait for [`Live::next`]; more are counted and lost to it, not to the sinks.
const SAID_WAITING: usize = 1 << 14;

/// How a [`Live`] works.
#[derive(Debug, Clone)]
pub struct LiveOptions {
    /// The sensor.
    pub array: Array,
    /// The board's registers, as far as they are known: its frame's length is taken from them.
    pub registers: Registers,
    /// Whether the board sends differences for intensities (the panel's "delta intensity").
    pub differences: bool,
    /// In silence the readout's time follows the host's clock, this many frames behind it.
    pub guard_frames: f64,
    /// How many events may wait for the readout.
    pub readout_events: usize,
    /// The socket and the queue behind it.
    pub capture: capture::ReceiverOptions,
    /// Where everything is kept, if anywhere.
    pub record: Option<Record>,
}

impl LiveOptions {
    /// The usual ones for an array: the first preset's registers, 5 frames' guard, nothing recorded.
    #[must_use]
    pub fn new(array: Array) -> Self {
        Self {
            array,
            registers: Registers::default(),
            differences: false,
            guard_frames: 5.0,
            readout_events: 1 << 20,
            capture: capture::ReceiverOptions::default(),
            record: None,
        }
    }
}

/// Where and how to record: `.lsa` for the manual's raw bytes, `.mcap` for all that is known.
#[derive(Debug, Clone)]
pub struct Record {
    /// The file.
    pub path: PathBuf,
    /// Of the chunks of `.mcap`.
    pub compression: Compression,
    /// Whether an existing file may be replaced.
    pub overwrite: bool,
}

/// A detection, and when it was said.
#[derive(Debug, Clone, PartialEq)]
pub struct Said {
    /// What was said.
    pub detection: Detection,
    /// When it was said by the host's clock, ns since 1970.
    pub said_ns: i64,
    /// The same by the board's clock, as far as the host can tell: `said_ns` less the estimated offset; us.
    pub said: i64,
}

/// Takes detections in the thread that made them; what it does there, the next detection waits for.
pub trait Sink: Send {
    /// One was said.
    ///
    /// # Errors
    ///
    /// Where it cannot be handed on: then the whole way ends.
    fn take(&mut self, said: &Said) -> std::io::Result<()>;
}

impl<F: FnMut(&Said) -> std::io::Result<()> + Send> Sink for F {
    fn take(&mut self, said: &Said) -> std::io::Result<()> {
        self(said)
    }
}

/// Writes each detection as a line of JSON, with the keys of `taxel detect --json` and when it was said.
#[derive(Debug)]
pub struct Lines<W>(pub W);

impl<W: std::io::Write + Send> Sink for Lines<W> {
    fn take(&mut self, said: &Said) -> std::io::Result<()> {
        let Said { detection, said_ns, said } = said;
        let mut line = serde_json::to_vec(&serde_json::json!({
            "label": detection.label,
            "t_us": detection.t,
            "known_us": detection.known,
            "slope_mv_per_ms": detection.slope,
            "said_us": said,
            "said_ns": said_ns,
        }))?;
        line.push(b'\n');
        self.0.write_all(&line)?;
        self.0.flush()
    }
}

/// What came, what became of it, and what was lost where.
///
/// Once [`Live::stop`] has returned, `capture.datagrams = decoded + capture.dropped_by_queue` and
/// `wire.bytes = 5 wire.words + wire.skipped`; `events = read_out + events_dropped` where there is a readout.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Counters {
    /// At the socket and in the queue behind it.
    pub capture: capture::Counts,
    /// Datagrams that were decoded.
    pub decoded: u64,
    /// What the decoder saw in them.
    pub wire: wire::Counts,
    /// The version of the wire that the board speaks.
    pub wire_version: u8,
    /// What was heard and missed of version 2.
    pub wire_v2: wire::v2::Counts,
    /// Bytes of version 1 that were refused, because the board speaks version 2.
    pub wire_refused: u64,
    /// How often the board changed its version.
    pub wire_changes: u64,
    /// Events that it gave.
    pub events: u64,
    /// Events that the readout has heard.
    pub read_out: u64,
    /// Events that found no room before the readout.
    pub events_dropped: u64,
    /// Events that came out of order, or more than 0.1 s after a silence that was believed: the readout heard them as of
    /// the time that it had come to.
    pub late: u64,
    /// Detections that were said.
    pub detections: u64,
    /// Those among them that were said in a silence that was none: an event came later than the guard, and what the
    /// recording says was said after them.
    pub wrong: u64,
    /// Detections that [`Live::next`] was too slow for; the sinks had them.
    pub detections_dropped: u64,
    /// From the kernel's stamp to the end of decoding, a datagram each.
    pub decode_latency: Quantiles,
    /// From `known` to said, by the board's clock.
    pub said_latency: Quantiles,
    /// What the host's clock shows when the board's shows a time; from the first datagram on.
    pub offset: Option<Offset>,
    /// The latest stamp, us.
    pub board_us: Option<i64>,
    /// Starts and stops that the board marked.
    pub markers: u64,
    /// Whether the last marker was a start; `None` before the first.
    pub marked_start: Option<bool>,
    /// Since the socket was opened, s.
    pub seconds: f64,
    /// Whether a tare is being taken.
    pub taring: bool,
}

impl Counters {
    /// Whether not even a datagram that was lost has come.
    #[must_use]
    pub fn nothing_came(&self) -> bool {
        self.capture.messages + self.capture.dropped_by_kernel == 0
    }
}

/// How a [`Live`] ended.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// All of them, closed.
    pub counters: Counters,
    /// One line: nothing lost after arrival, what was lost where, or that nothing came.
    pub verdict: String,
    /// The file, where something was recorded: one to which nothing came is not kept, and none is replaced by it.
    pub path: Option<PathBuf>,
}

/// What the threads tell those who look on.
#[derive(Debug, Default)]
struct Board {
    counters: Counters,
    decode_latency: Latencies,
    said_latency: Latencies,
    markers: Vec<Marker>,
    picture: Vec<u16>,
    tare: Option<Tare>,
    failed: Option<Error>,
}

/// What all threads share.
struct Shared {
    receiver: Receiver,
    handover: Handover,
    board: Mutex<Board>,
    recorder: Option<Recorder>,
    ended: AtomicBool,
}

impl Shared {
    fn board(&self) -> MutexGuard<'_, Board> {
        self.board.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Ends everything because of an error, which [`Live::next`] and [`Live::stop`] then give.
    fn fail(&self, error: Error) {
        self.board().failed.get_or_insert(error);
        self.receiver.stop();
    }
}

/// Datagrams to detections, from [`Live::start`] until [`Live::stop`].
pub struct Live {
    shared: Arc<Shared>,
    said: channel::Receiver<Said>,
    threads: Vec<JoinHandle<()>>,
    begun: Instant,
}

impl Live {
    /// Opens the socket (and the file), and begins.
    ///
    /// # Errors
    ///
    /// `Socket` where the port is taken, `File` where the file exists or cannot be created, `Core(Problem)` for options
    /// that make no sense.
    pub fn start(address: SocketAddr, options: LiveOptions, ear: Ear, sinks: Vec<Box<dyn Sink>>) -> Result<Self> {
        if !(options.guard_frames.is_finite() && options.guard_frames >= 0.0) {
            return Err(taxel_core::problem!("guard_frames is {}: must be 0 or more", options.guard_frames).into());
        }
        if options.readout_events == 0 {
            return Err(taxel_core::problem!("readout_events is 0: must be 1 or more").into());
        }
        options.registers.check(&options.array)?;
        match &ear {
            Ear::Taring(stretch_us, _) if *stretch_us <= 0 => {
                return Err(taxel_core::problem!("tare of {stretch_us} us: must be above 0").into());
            }
            Ear::Taring(_, readout) => readout.check()?,
            Ear::Deaf | Ear::Reading(_) => {}
        }
        // The socket first: where the port is taken no empty file is left behind.
        let receiver = Receiver::bind(address, options.capture)?;
        let recorder =
            options.record.as_ref().map(|r| Recorder::create(r, &options, receiver.address())).transpose()?;
        let board = Board { picture: vec![0; options.array.len()], ..Board::default() };
        let shared = Arc::new(Shared {
            receiver,
            handover: Handover::new(&options.array, options.readout_events),
            board: Mutex::new(board),
            recorder,
            ended: AtomicBool::new(false),
        });
        let (say, said) = channel::bounded(SAID_WAITING);
        let decoder = Decoder::new(options.array.clone()).differences(options.differences);
        let sender = wire::Receiver::new(decoder, 1);
        let listens = !matches!(ear, Ear::Deaf);
        let mut live = Self { shared: Arc::clone(&shared), said, threads: vec![], begun: Instant::now() };
        let theirs = Arc::clone(&shared);
        let decode_options = options.clone();
        live.spawn("taxel-decode", move || decode::run(&theirs, sender, &decode_options, listens))?;
        if listens {
            let reader = read::Reader::new(ear, sinks, say, &options);
            live.spawn("taxel-readout", move || reader.run(&shared))?;
        }
        Ok(live)
    }

    fn spawn(&mut self, name: &str, job: impl FnOnce() + Send + 'static) -> Result<()> {
        let thread = std::thread::Builder::new().name(name.to_owned()).spawn(job);
        self.threads.push(thread.map_err(Error::socket("thread"))?);
        Ok(())
    }

    /// Where it listens; the port that was found where 0 was asked for.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.shared.receiver.address()
    }

    /// The next detection; `None` after `timeout` without one, or at once when all is over.
    ///
    /// # Errors
    ///
    /// What ended the way early: the disk is full, the socket failed, the encoder cannot use what comes.
    pub fn next(&self, timeout: Duration) -> Result<Option<Said>> {
        match self.said.recv_timeout(timeout) {
            Ok(said) => Ok(Some(said)),
            Err(channel::RecvTimeoutError::Timeout) => self.check().map(|()| None),
            Err(channel::RecvTimeoutError::Disconnected) => {
                self.check()?;
                // Without a readout nobody ever speaks: wait as asked, but not after the end.
                if !self.is_over() {
                    std::thread::sleep(timeout);
                }
                Ok(None)
            }
        }
    }

    fn check(&self) -> Result<()> {
        self.shared.board().failed.take().map_or(Ok(()), Err)
    }

    /// Whether the way has ended, by [`Live::end`] or by an error, and everything was worked through.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.shared.ended.load(Ordering::Acquire)
    }

    /// What came and what became of it up to now.
    #[must_use]
    pub fn counters(&self) -> Counters {
        let board = self.shared.board();
        Counters {
            capture: self.shared.receiver.counts(),
            decode_latency: board.decode_latency.quantiles(),
            said_latency: board.said_latency.quantiles(),
            seconds: self.begun.elapsed().as_secs_f64(),
            ..board.counters.clone()
        }
    }

    /// The values that the taxels hold, ticks, by taxel index, ten times a second; 0 until a taxel was heard of.
    #[must_use]
    pub fn picture(&self) -> Vec<u16> {
        self.shared.board().picture.clone()
    }

    /// The tare that was taken, once it is complete.
    #[must_use]
    pub fn tare(&self) -> Option<Tare> {
        self.shared.board().tare.clone()
    }

    /// The starts and stops that came since this was asked last.
    #[must_use]
    pub fn take_markers(&self) -> Vec<Marker> {
        std::mem::take(&mut self.shared.board().markers)
    }

    /// Writes something down in the recording, with the time of now.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where nothing is recorded that can hold notes, `File` where the disk is full.
    pub fn note(&self, text: &str) -> Result<()> {
        let Some(recorder) = &self.shared.recorder else {
            return Err(taxel_core::problem!("a note is kept in a recording: record to a .mcap file").into());
        };
        let board_us = self.shared.board().counters.board_us;
        recorder.note(board_us, text)
    }

    /// Asks all threads to end once they have worked through what came; [`Live::stop`] waits for them.
    pub fn end(&self) {
        self.shared.receiver.stop();
    }

    /// Ends: works through what came, closes the file, and says what was lost.
    ///
    /// # Errors
    ///
    /// What ended the way early, or `File` where the end of the recording cannot be written.
    pub fn stop(mut self) -> Result<Summary> {
        let joined = self.join();
        let counters = self.counters();
        // All other holders were threads that have ended.
        let recorder = Arc::get_mut(&mut self.shared).and_then(|shared| shared.recorder.take());
        let path = recorder.map_or(Ok(None), |recorder| recorder.finish(&counters))?;
        let verdict = if counters.nothing_came() {
            let address = self.address();
            format!(
                "nothing arrived at UDP {address} in {:.1} s: does the board send to this machine, and to port {}?",
                counters.seconds,
                address.port()
            )
        } else {
            recorder::losses(&counters).verdict()
        };
        joined?;
        self.check()?;
        Ok(Summary { counters, verdict, path })
    }

    fn join(&mut self) -> Result<()> {
        self.end();
        for thread in self.threads.drain(..) {
            if let Err(panic) = thread.join() {
                std::panic::resume_unwind(panic);
            }
        }
        Ok(())
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.end();
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}
