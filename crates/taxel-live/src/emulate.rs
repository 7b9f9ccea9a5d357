//! Runs the emulated board in real time: scans frames, sends datagrams and executes commands.

mod control;
mod pace;
mod replay;
mod run;
mod scenes;

use std::net::SocketAddr;
use std::time::Instant;

use serde::Serialize;
use taxel_core::board::{Board, BoardCounts, Crossed, Flawed, Flaws, Network, NetworkCounts, NetworkFaults};
use taxel_core::circuit::Chain;
use taxel_core::contact::Contact;
use taxel_core::wire::Command;
use taxel_core::{Array, Stop};

use crate::Result;
use crate::capture::{SendCounts, Sender};
use crate::latency::Quantiles;
use control::CommandPort;
use pace::wake_sharply;
pub use replay::Replay;
use run::{BoardRun, POLL_EVERY, REPORT_EVERY, is_due};
pub use scenes::Scenes;

/// The input that an emulated board scans: a scene, a replayed recording, noise.
pub trait Touch: Send {
    /// Writes the next frame's trip times (ticks of 1/300 us, one per taxel, by taxel index). Returns false if there
    /// are no more frames, or if the caller stops it while it waits; the board then stops.
    ///
    /// # Errors
    ///
    /// If the input cannot be played; the board then stops too.
    fn frame(&mut self, ticks: &mut [u16], stop: Stop<'_>) -> Result<bool>;

    /// Whether the last written frame is the final one, if that is known.
    ///
    /// # Errors
    ///
    /// As [`Touch::frame`].
    fn is_last(&mut self, _stop: Stop<'_>) -> Result<bool> {
        Ok(false)
    }

    /// Touches that became known since the last call, us from the first frame's start; none where they are not known.
    fn take_contacts(&mut self) -> Vec<Contact> {
        vec![]
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
    /// Scheduled commands, each with the frame before which it is executed; ascending.
    pub commands: Vec<(u64, Command)>,
    /// Whether the first frame is scanned without sending ([`Board::arm`]).
    pub arms: bool,
    /// Whether the board sends a stop marker at the end if a recording is running.
    pub marks_stop: bool,
    /// Faults of the simulated network.
    pub faults: Option<NetworkFaults>,
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
    control: CommandPort,
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
    /// `Socket` where the control port is taken; `Core(Problem)` where the schedule does not ascend, or a fault, flaw, drift
    /// or reset makes no sense.
    pub fn open(board: Board, array: &Array, options: EmulatorOptions) -> Result<Self> {
        if let Some(k) = options.commands.windows(2).position(|w| w[1].0 < w[0].0) {
            return Err(taxel_core::problem!(
                "command {}: its frame must not be before the frame of command {k}",
                k + 1
            )
            .into());
        }
        if let Some(interval_s) = options.reset_every_s.filter(|interval_s| !(1e-3..=1e9).contains(interval_s)) {
            return Err(taxel_core::problem!("reset_every_s"; " is {interval_s}: must be from 0.001 to 1e9").into());
        }
        if !(-100_000.0..=100_000.0).contains(&options.drift_ppm) {
            return Err(
                taxel_core::problem!("drift_ppm"; " is {}: must be from -100000 to 100000", options.drift_ppm).into()
            );
        }
        let network = options.faults.map(Network::new).transpose()?;
        let circuit = options.circuit.clone();
        let crossed = circuit.map(|chain| Crossed::new(chain, board.registers(), array)).transpose()?;
        let flawed = options.flaws.map(|flaws| Flawed::new(flaws, array)).transpose()?;
        let sender = Sender::open_from(options.source_port, options.to, options.segment)?;
        let control = CommandPort::open(options.control)?;
        Ok(Self { board, array: array.clone(), sender, control, network, crossed, flawed, options })
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
    pub fn run<T: Touch + ?Sized>(
        &mut self,
        touch: &mut T,
        mut watch: impl FnMut(&Report, &mut T),
        stop: Stop<'_>,
    ) -> Result<Report> {
        let mut ticks = vec![0; self.array.len()];
        let mut run = self.begin();
        let mut last = false;
        while !last {
            last = stop.asked() || !touch.frame(&mut ticks, stop)? || stop.asked();
            if last && !(self.options.marks_stop && self.board.registers().record) {
                break;
            }
            if self.options.marks_stop && (last || touch.is_last(stop)?) {
                self.board.record(false);
            }
            let since_us = run.since_us(&self.board);
            self.reset_where_due(&mut run, since_us)?;
            let frame = self.board.counts().frames;
            while let Some((_, command)) = run.schedule.next_if(|(at, _)| *at <= frame) {
                self.board.command(&command.to_bytes());
            }
            if !last {
                self.read_taxels(&mut ticks, since_us)?;
            }
            if frame == 0 && self.options.arms {
                self.board.arm(&ticks)?;
                continue;
            }
            let now = self.send_frame(&mut run, &ticks)?;
            if is_due(&mut run.polled, now, POLL_EVERY) {
                self.control.serve(&mut self.board);
            }
            if is_due(&mut run.reported, now, REPORT_EVERY) {
                watch(&self.report(&run), touch);
            }
        }
        self.send_delayed()?;
        let report = self.report(&run);
        watch(&report, touch);
        Ok(report)
    }

    /// The state of a run that begins now.
    fn begin(&mut self) -> BoardRun {
        if self.options.real_time {
            wake_sharply();
        }
        BoardRun::new(&self.board, std::mem::take(&mut self.options.commands), self.options.drift_ppm)
    }

    /// Resets the board where its time since its start, us, has reached the next reset.
    fn reset_where_due(&mut self, run: &mut BoardRun, since_us: f64) -> Result<()> {
        if let Some(interval_s) = self.options.reset_every_s
            && since_us >= (run.resets + 1) as f64 * interval_s * 1e6
        {
            run.before_reset_us = since_us;
            run.resets += 1;
            self.board.reset()?;
            self.control.send_greeting(&self.board);
        }
        Ok(())
    }

    /// From what the taxels feel to what the board reads of them, through the circuit and the flaws.
    fn read_taxels(&mut self, ticks: &mut [u16], since_us: f64) -> Result<()> {
        if let Some(crossed) = &mut self.crossed {
            crossed.read(self.board.registers(), ticks)?;
        }
        if let Some(flawed) = &mut self.flawed {
            flawed.read(since_us, ticks);
        }
        Ok(())
    }

    /// Scans a frame, and sends its datagrams at its end; returns the time then.
    fn send_frame(&mut self, run: &mut BoardRun, ticks: &[u16]) -> Result<Instant> {
        let (network, leaving) = (&mut self.network, &mut run.leaving);
        leaving.clear();
        self.board.frame(ticks, |datagram| {
            match network {
                None => leaving.push(datagram),
                Some(network) => network.pass(datagram, &mut |out| leaving.push(out)),
            }
            true
        })?;
        // The length of the frame that was scanned: a command may have changed it.
        let frame = run.next_due(&self.board);
        let now = if self.options.real_time { run.pace.wait_until(run.due) } else { Instant::now() };
        run.leaving.iter().try_for_each(|datagram| self.sender.push(datagram))?;
        self.sender.flush()?;
        if self.options.real_time {
            run.note_late(now, frame);
        }
        Ok(now)
    }

    /// Sends the datagrams that the network has delayed.
    fn send_delayed(&mut self) -> Result<()> {
        let Some(network) = &mut self.network else { return Ok(()) };
        let mut sent = Ok(());
        let sender = &mut self.sender;
        network.flush(&mut |out| {
            if sent.is_ok() && !out.is_empty() {
                sent = sender.push(out);
            }
        });
        sent?;
        self.sender.flush()
    }

    /// What was done up to now.
    fn report(&self, run: &BoardRun) -> Report {
        Report {
            board: *self.board.counts(),
            sent: self.sender.counts(),
            network: self.network.as_ref().map(|network| *network.counts()),
            resets: run.resets,
            late: run.late.quantiles(),
            late_frames: run.late_frames,
            began_ns: run.began_ns,
            board_seconds: run.board_us(&self.board) * 1e-6,
            seconds: run.begun.elapsed().as_secs_f64(),
        }
    }
}
