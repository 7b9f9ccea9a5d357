//! Runs the emulated board in real time: scans frames, sends datagrams and executes commands.

mod control;
mod feed;
mod line;
mod replay;
mod scenes;
mod sync;

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use serde::Serialize;
use taxel_core::board::{Board, BoardCounts, Crossed, Faults, Flawed, Flaws, Network, NetworkCounts};
use taxel_core::circuit::Chain;
use taxel_core::wire::Command;
use taxel_core::{Array, Stop};

use crate::Result;
use crate::capture::{SendCounts, Sender};
use crate::latency::{Latencies, Quantiles};
use crate::recording::now_ns;
use control::Control;
pub use feed::Feed;
use line::Line;
pub use replay::Replay;
pub use scenes::Scenes;
use sync::Sync;

/// Interval at which [`Emulator::run`] reads commands, checks whether to stop, and reports.
const LOOK_EVERY: Duration = Duration::from_millis(1);
const REPORT_EVERY: Duration = Duration::from_millis(100);

/// Longest busy wait before a frame is due, and the step by which the wait is adapted.
const MOST_AWAKE: Duration = Duration::from_micros(30);
const STEP: Duration = Duration::from_nanos(100);

/// Number of times that two clocks are read together; the pair read within the shortest time is used.
const READINGS: usize = 16;

/// The input that an emulated board scans: a scene, a replayed recording, noise.
pub trait Touch: Send {
    /// Writes the next frame's trip times (ticks of 1/300 us, one per taxel, by taxel index). Returns false if there
    /// are no more frames, or if the caller stops it while it waits; the board then stops.
    ///
    /// # Errors
    ///
    /// If the input cannot be played; the board then stops too.
    fn frame(&mut self, ticks: &mut [u16], stop: Stop<'_>) -> Result<bool>;

    /// Whether the next frame can be written now, or there is none. Waits for it for some milliseconds at most, so that
    /// a board without a frame still executes its commands.
    ///
    /// # Errors
    ///
    /// As [`Touch::frame`].
    fn is_there(&mut self) -> Result<bool> {
        Ok(true)
    }

    /// Whether the last written frame is the final one, if that is known.
    ///
    /// # Errors
    ///
    /// As [`Touch::frame`].
    fn is_last(&mut self, _stop: Stop<'_>) -> Result<bool> {
        Ok(false)
    }
}

/// A function that writes frames is a touch.
impl<F: FnMut(&mut [u16]) -> bool + Send> Touch for F {
    fn frame(&mut self, ticks: &mut [u16], _stop: Stop<'_>) -> Result<bool> {
        Ok(self(ticks))
    }
}

/// The options of an [`Emulator`].
#[derive(Debug, Clone)]
pub struct EmulatorOptions {
    /// Destination of the datagrams.
    pub to: SocketAddr,
    /// Send several datagrams in one call if the kernel can split them (`UDP_SEGMENT`).
    pub segment: bool,
    /// Whether frames take as long as on the board; otherwise they are scanned as fast as possible.
    pub real_time: bool,
    /// Address of the command port: TCP in place of the UART, commands in, status lines out (`None`: no port). Port 0
    /// selects a free one.
    pub control: Option<SocketAddr>,
    /// The serial line: the path of its name (a link to a pseudo-terminal), and its baud rate.
    pub line: Option<(PathBuf, u32)>,
    /// The file to which the sync line is written, and whether an existing file may be replaced.
    pub sync: Option<(PathBuf, bool)>,
    /// Scheduled commands, each with the frame before which it is executed; ascending.
    pub commands: Vec<(u64, Command)>,
    /// Whether the first frame is scanned without sending ([`Board::arm`]).
    pub arms: bool,
    /// Whether the board sends a stop marker at the end if a recording is running.
    pub marks_stop: bool,
    /// Faults of the simulated network.
    pub faults: Option<Faults>,
    /// The circuit that the taxels share, if it is not ideal; flaws are applied after it.
    pub circuit: Option<Chain>,
    /// Flaws of the taxels.
    pub flaws: Option<Flaws>,
    /// Interval between resets of the board, s of its time.
    pub reset_every_s: Option<f64>,
    /// Drift of the board's clock relative to the host's, parts per million.
    pub drift_ppm: f64,
    /// Local UDP port of the board; 0 selects a free one.
    pub source_port: u16,
}

impl EmulatorOptions {
    /// The default options: real time, to this destination, without commands.
    #[must_use]
    pub fn to(to: SocketAddr) -> Self {
        Self {
            to,
            segment: true,
            real_time: true,
            control: None,
            line: None,
            sync: None,
            commands: vec![],
            arms: false,
            marks_stop: false,
            faults: None,
            circuit: None,
            flaws: None,
            reset_every_s: None,
            drift_ppm: 0.0,
            source_port: 0,
        }
    }
}

/// A report of an [`Emulator`].
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Report {
    /// Counts of the board.
    pub board: BoardCounts,
    /// Counts of what was sent.
    pub sent: SendCounts,
    /// Counts of the simulated network, if there is one.
    pub network: Option<NetworkCounts>,
    /// Number of resets of the board.
    pub resets: u64,
    /// Delay of each frame's datagrams after the frame's end; empty if frames are not paced.
    pub late: Quantiles,
    /// Number of frames that were sent more than one frame late.
    pub late_frames: u64,
    /// The host's clock at the board's time 0, ns since 1970; in real time, every frame is due relative to it.
    pub began_ns: i64,
    /// Duration by the board's clock, s.
    pub board_seconds: f64,
    /// Duration by the host's clock, s.
    pub seconds: f64,
}

/// An emulated board that scans a touch and sends its datagrams.
#[derive(Debug)]
pub struct Emulator {
    board: Board,
    array: Array,
    sender: Sender,
    control: Control,
    sync: Option<Sync>,
    network: Option<Network>,
    crossed: Option<Crossed>,
    flawed: Option<Flawed>,
    options: EmulatorOptions,
}

impl Emulator {
    /// Opens the sockets; nothing is sent yet.
    ///
    /// # Errors
    ///
    /// `Socket` if the control port is in use, `File` if the serial line or the sync line cannot be opened;
    /// `Core(Problem)` if the schedule does not ascend, or if a fault, flaw, drift or reset is out of range.
    pub fn open(board: Board, array: &Array, options: EmulatorOptions) -> Result<Self> {
        if let Some(k) = options.commands.windows(2).position(|w| w[1].0 < w[0].0) {
            return Err(taxel_core::problem!("command {}: its frame lies before that of command {k}", k + 1).into());
        }
        if let Some(every) = options.reset_every_s.filter(|every| !(1e-3..=1e9).contains(every)) {
            return Err(taxel_core::problem!("reset each {every} s: must be 0.001 to 1e9").into());
        }
        if !(-100_000.0..=100_000.0).contains(&options.drift_ppm) {
            return Err(taxel_core::problem!("drift of {} ppm: must lie within 100000 of 0", options.drift_ppm).into());
        }
        let network = options.faults.map(Network::new).transpose()?;
        let circuit = options.circuit.clone();
        let crossed = circuit.map(|chain| Crossed::new(chain, board.registers(), array)).transpose()?;
        let flawed = options.flaws.map(|flaws| Flawed::new(flaws, array)).transpose()?;
        let sender = Sender::open_from(options.source_port, options.to, options.segment)?;
        let line = options.line.as_ref().map(|(link, baud)| Line::open(link, *baud)).transpose()?;
        let control = Control::open(options.control, line, &board)?;
        let sync = options.sync.as_ref().map(|(path, overwrite)| Sync::open(path, *overwrite)).transpose()?;
        Ok(Self { board, array: array.clone(), sender, control, sync, network, crossed, flawed, options })
    }

    /// The address for commands, if any.
    #[must_use]
    pub fn control_address(&self) -> Option<SocketAddr> {
        self.control.address()
    }

    /// Plays `touch` to its end, or until `stop`, which is not an error; `watch` receives a report ten times a second.
    ///
    /// The datagrams of a frame are sent at its end. A late frame does not delay later ones.
    ///
    /// # Errors
    ///
    /// `Socket` if the system refuses to send.
    #[allow(clippy::cast_possible_truncation)]
    pub fn run<T: Touch + ?Sized>(
        &mut self,
        touch: &mut T,
        mut watch: impl FnMut(&Report, &mut T),
        stop: Stop<'_>,
    ) -> Result<Report> {
        let mut ticks = vec![0; self.array.len()];
        let mut leaving = Leaving::default();
        let mut late = Latencies::default();
        let mut schedule = std::mem::take(&mut self.options.commands).into_iter().peekable();
        if self.options.real_time {
            wake_sharply();
        }
        let (begun, begun_ns) = now_by_both();
        let mut pace = Pace::default();
        let started_us = self.board.time_us();
        let began_ns = begun_ns - (started_us * 1e3) as i64;
        let mut report = Report { began_ns, ..Report::default() };
        let host_s_per_us = 1e-6 / (1.0 + 1e-6 * self.options.drift_ppm);
        let mut due = begun;
        // The board's time since its start, us, which a reset does not change; the board's own clock returns to 0.
        let mut before_reset_us = -started_us;
        let (mut polled, mut reported) = (begun, begun);
        let mut last = false;
        while !last {
            while !stop.asked() && !touch.is_there()? {
                self.control.serve(&mut self.board);
            }
            last = stop.asked() || !touch.frame(&mut ticks, stop)? || stop.asked();
            if last && !(self.options.marks_stop && self.board.registers().record) {
                break;
            }
            if self.options.marks_stop && (last || touch.is_last(stop)?) {
                self.board.record(false);
            }
            let since_us = before_reset_us + self.board.time_us();
            if let Some(every) = self.options.reset_every_s
                && since_us >= (report.resets + 1) as f64 * every * 1e6
            {
                before_reset_us = since_us;
                report.resets += 1;
                self.board.reset()?;
                self.control.greet(&self.board);
            }
            let frame = self.board.counts().frames;
            while let Some((_, command)) = schedule.next_if(|(at, _)| *at <= frame) {
                self.board.command(&command.to_bytes());
            }
            if let Some(sync) = &mut self.sync {
                sync.follow(since_us, self.board.registers().record);
            }
            if let Some(crossed) = &mut self.crossed
                && !last
            {
                match crossed.read(self.board.registers(), &mut ticks, stop) {
                    // A request to stop is not an error here; the loop checks for it.
                    Err(taxel_core::Error::Interrupted) => continue,
                    read => read?,
                }
            }
            if let Some(flawed) = &mut self.flawed
                && !last
            {
                flawed.read(since_us, &mut ticks);
            }
            let (sender, network) = (&mut self.sender, &mut self.network);
            if frame == 0 && self.options.arms {
                self.board.arm(&ticks)?;
                continue;
            }
            leaving.clear();
            self.board.frame(&ticks, |datagram| {
                match network {
                    None => leaving.push(datagram),
                    Some(network) => network.pass(datagram, &mut |out| leaving.push(out)),
                }
                true
            })?;
            // The length of the frame that was scanned: a command may have changed it.
            let before = due;
            due = begun + Duration::from_secs_f64((before_reset_us + self.board.time_us()) * host_s_per_us);
            let now = if self.options.real_time { pace.wait_until(due) } else { Instant::now() };
            leaving.iter().try_for_each(|datagram| sender.push(datagram))?;
            self.sender.flush()?;
            if self.options.real_time {
                let behind = now.saturating_duration_since(due);
                late.note(i64::try_from(behind.as_nanos()).unwrap_or(i64::MAX));
                report.late_frames += u64::from(behind > due - before);
            }
            if now.duration_since(polled) >= LOOK_EVERY {
                polled = now;
                self.control.serve(&mut self.board);
            }
            if now.duration_since(reported) >= REPORT_EVERY {
                reported = now;
                self.complete(&mut report, &late, begun, started_us + before_reset_us + self.board.time_us());
                watch(&report, touch);
            }
        }
        if let Some(network) = &mut self.network {
            let mut sent = Ok(());
            let sender = &mut self.sender;
            network.flush(&mut |out| {
                if sent.is_ok() && !out.is_empty() {
                    sent = sender.push(out);
                }
            });
            sent?;
            self.sender.flush()?;
        }
        if let Some(sync) = &mut self.sync {
            sync.follow(before_reset_us + self.board.time_us(), self.board.registers().record);
        }
        self.complete(&mut report, &late, begun, started_us + before_reset_us + self.board.time_us());
        watch(&report, touch);
        Ok(report)
    }

    fn complete(&self, report: &mut Report, late: &Latencies, begun: Instant, board_us: f64) {
        report.board = *self.board.counts();
        report.sent = self.sender.counts();
        report.network = self.network.as_ref().map(|network| *network.counts());
        report.late = late.quantiles();
        report.board_seconds = board_us * 1e-6;
        report.seconds = begun.elapsed().as_secs_f64();
    }
}

/// Datagrams that wait until the frame ends: a train is sent as soon as a datagram of another length follows.
#[derive(Default)]
struct Leaving {
    bytes: Vec<u8>,
    ends: Vec<usize>,
}

impl Leaving {
    fn push(&mut self, datagram: &[u8]) {
        if !datagram.is_empty() {
            self.bytes.extend_from_slice(datagram);
            self.ends.push(self.bytes.len());
        }
    }

    fn clear(&mut self) {
        self.bytes.clear();
        self.ends.clear();
    }

    fn iter(&self) -> impl Iterator<Item = &[u8]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| &self.bytes[start..end])
    }
}

/// The current time by the clock that paces frames, and by the one that stamps arrivals, ns since 1970. Both are read
/// several times, because the thread may be interrupted between the two.
fn now_by_both() -> (Instant, i64) {
    let read = |_| {
        let (before, now_ns) = (Instant::now(), now_ns());
        (before.elapsed(), before, now_ns)
    };
    let (took, before, now_ns) =
        (1..READINGS).map(read).fold(read(0), |best, next| if next.0 < best.0 { next } else { best });
    (before + took / 2, now_ns)
}

/// Waits until frames are due. A sleeping thread wakes some 10 us late, later on an idle core than on a busy one.
/// Therefore the sleep ends earlier by that time, and the rest is a busy wait.
#[derive(Debug, Default)]
struct Pace {
    sooner: Duration,
}

impl Pace {
    /// Waits until `due` if it has not passed; returns the current time.
    fn wait_until(&mut self, due: Instant) -> Instant {
        let mut now = Instant::now();
        let Some(left) = due.checked_duration_since(now) else { return now };
        if let Some(sleep) = left.checked_sub(self.sooner)
            && !sleep.is_zero()
        {
            std::thread::sleep(sleep);
            let woken = Instant::now();
            // Adapted so that nine in ten wake-ups are in time; a later one was caused by a busy core, where a longer
            // busy wait does not help.
            self.sooner = if woken.saturating_duration_since(now + sleep) > self.sooner {
                (self.sooner + 9 * STEP).min(MOST_AWAKE)
            } else {
                self.sooner.saturating_sub(STEP)
            };
            now = woken;
        }
        while now < due {
            std::hint::spin_loop();
            now = Instant::now();
        }
        now
    }
}

/// Disables the kernel's timer slack for this thread: it may delay wake-ups by 50 us, a quarter of a frame.
fn wake_sharply() {
    // SAFETY: PR_SET_TIMERSLACK takes one number and accesses no memory of ours; if it fails, wake-ups are less
    // precise.
    unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1_u64) };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_never_sent_before_it_is_due_nor_waited_for_awake_for_long() {
        let mut pace = Pace::default();
        let mut due = Instant::now();
        for _ in 0..300 {
            due += Duration::from_micros(400);
            assert!(pace.wait_until(due) >= due);
            assert!(pace.sooner <= MOST_AWAKE);
        }
        // The thread does not wait for a frame that is already due.
        let now = pace.wait_until(due);
        assert!(now >= due);
    }
}
