//! The emulated board as a process of its own: frames felt, datagrams sent, commands heard, in real time.

mod control;

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use serde::Serialize;
use taxel_core::board::{Board, BoardCounts};
use taxel_core::wire::Command;
use taxel_core::{Array, Stop};

use crate::Result;
use crate::capture::{SendCounts, Sender};
use crate::latency::{Latencies, Quantiles};
use crate::recording::now_ns;
use control::Control;

/// How often [`Emulator::run`] looks for commands, asks whether to stop, and reports.
const LOOK_EVERY: Duration = Duration::from_millis(1);
const REPORT_EVERY: Duration = Duration::from_millis(100);

/// What an emulated board feels: a scene, a recording played again, noise.
pub trait Touch: Send {
    /// Writes the next frame's trip times (ticks of 1/300 us, one a taxel, by taxel index); false where there is none
    /// any more, and the board stops.
    fn frame(&mut self, ticks: &mut [u16]) -> bool;
}

/// A function that writes frames is a touch.
impl<F: FnMut(&mut [u16]) -> bool + Send> Touch for F {
    fn frame(&mut self, ticks: &mut [u16]) -> bool {
        self(ticks)
    }
}

/// How an [`Emulator`] works.
#[derive(Debug, Clone)]
pub struct EmulatorOptions {
    /// Where the datagrams go.
    pub to: SocketAddr,
    /// Send trains of datagrams in one call where the kernel can cut them (`UDP_SEGMENT`).
    pub segment: bool,
    /// Frames take the time that they take on the board; else they go as fast as they can.
    pub real_time: bool,
    /// Where the board takes its commands: TCP in place of the UART, bytes in, status lines out (`None`: nowhere). Port 0
    /// finds a free one.
    pub control: Option<SocketAddr>,
    /// Commands of the schedule: before which frame, and which; ascending.
    pub commands: Vec<(u64, Command)>,
}

impl EmulatorOptions {
    /// In real time to `to`, without commands.
    #[must_use]
    pub fn to(to: SocketAddr) -> Self {
        Self { to, segment: true, real_time: true, control: None, commands: vec![] }
    }
}

/// What an [`Emulator`] has done.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Report {
    /// What the board counted.
    pub board: BoardCounts,
    /// What was sent.
    pub sent: SendCounts,
    /// How long after its end each frame was sent; nothing where frames go as fast as they can.
    pub late: Quantiles,
    /// Frames that were sent more than a frame late.
    pub late_frames: u64,
    /// The host's clock at the board's time 0, ns since 1970: in real time all that the board does is due by it.
    pub began_ns: i64,
    /// Time by the board's clock, s.
    pub board_seconds: f64,
    /// Time by the host's clock, s.
    pub seconds: f64,
}

/// An emulated board that sends what it feels.
#[derive(Debug)]
pub struct Emulator {
    board: Board,
    array: Array,
    sender: Sender,
    control: Option<Control>,
    options: EmulatorOptions,
}

impl Emulator {
    /// Opens the sockets; nothing is sent yet.
    ///
    /// # Errors
    ///
    /// `Socket` where the control port is taken; `Core(Problem)` where the schedule does not ascend.
    pub fn open(board: Board, array: &Array, options: EmulatorOptions) -> Result<Self> {
        if let Some(k) = options.commands.windows(2).position(|w| w[1].0 < w[0].0) {
            return Err(taxel_core::problem!("command {}: its frame lies before that of command {k}", k + 1).into());
        }
        let sender = Sender::open(options.to, options.segment)?;
        let control = options.control.map(|address| Control::listen(address, &board)).transpose()?;
        Ok(Self { board, array: array.clone(), sender, control, options })
    }

    /// Where commands are taken, if anywhere.
    #[must_use]
    pub fn control_address(&self) -> Option<SocketAddr> {
        self.control.as_ref().map(Control::address)
    }

    /// Plays `touch` to its end, or until `stop`, which is no error; `watch` gets a report ten times a second.
    ///
    /// A frame's datagrams leave when it ends. A frame that comes late does not move the ones after it.
    ///
    /// # Errors
    ///
    /// `Socket` where the system refuses to send.
    #[allow(clippy::cast_possible_truncation)]
    pub fn run(&mut self, touch: &mut dyn Touch, mut watch: impl FnMut(&Report), stop: Stop<'_>) -> Result<Report> {
        let mut ticks = vec![0; self.array.len()];
        let mut late = Latencies::default();
        let mut schedule = std::mem::take(&mut self.options.commands).into_iter().peekable();
        if self.options.real_time {
            wake_sharply();
        }
        let (begun, begun_ns) = (Instant::now(), now_ns());
        let started_us = self.board.time_us();
        let began_ns = begun_ns - (started_us * 1e3) as i64;
        let mut report = Report { began_ns, ..Report::default() };
        let mut due = begun;
        let (mut looked, mut told) = (begun, begun);
        while !stop.asked() && touch.frame(&mut ticks) {
            let frame = self.board.counts().frames;
            while let Some((_, command)) = schedule.next_if(|(at, _)| *at <= frame) {
                self.board.command(&command.to_bytes());
            }
            let sender = &mut self.sender;
            let mut sent = Ok(());
            self.board.frame(&ticks, |datagram| {
                sent = sender.push(datagram);
                sent.is_ok()
            })?;
            sent?;
            // The board knows how long its frame was: a command may have changed that.
            let before = due;
            due = begun + Duration::from_secs_f64((self.board.time_us() - started_us) * 1e-6);
            let now = if self.options.real_time { wait_until(due) } else { Instant::now() };
            self.sender.flush()?;
            if self.options.real_time {
                let behind = now.saturating_duration_since(due);
                late.note(i64::try_from(behind.as_nanos()).unwrap_or(i64::MAX));
                report.late_frames += u64::from(behind > due - before);
            }
            if now.duration_since(looked) >= LOOK_EVERY {
                looked = now;
                if let Some(control) = &mut self.control {
                    control.serve(&mut self.board);
                }
            }
            if now.duration_since(told) >= REPORT_EVERY {
                told = now;
                self.complete(&mut report, &late, begun);
                watch(&report);
            }
        }
        self.complete(&mut report, &late, begun);
        Ok(report)
    }

    fn complete(&self, report: &mut Report, late: &Latencies, begun: Instant) {
        report.board = *self.board.counts();
        report.sent = self.sender.counts();
        report.late = late.quantiles();
        report.board_seconds = self.board.time_us() * 1e-6;
        report.seconds = begun.elapsed().as_secs_f64();
    }
}

/// Sleeps until `due`, if it is not past; gives the time then.
fn wait_until(due: Instant) -> Instant {
    let now = Instant::now();
    match due.checked_duration_since(now) {
        Some(left) if !left.is_zero() => {
            std::thread::sleep(left);
            Instant::now()
        }
        _ => now,
    }
}

/// Asks the kernel not to gather this thread's wake-ups: it may let them come 50 us late, a quarter of a frame.
fn wake_sharply() {
    // SAFETY: PR_SET_TIMERSLACK takes one number and touches no memory of ours; where it fails, sleeps are coarser.
    unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1_u64) };
}
