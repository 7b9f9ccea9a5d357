//! A board on its serial line: commands, their answers, and what the board reports without a request.

use std::collections::{BTreeMap, VecDeque};
use std::time::{Duration, Instant};

use taxel_core::wire::{Command, Greeting, StatusLine};
use taxel_core::{Error as CoreError, Stop};

use crate::serial_line::{SerialLine, SerialPlace};
use crate::text_lines::TextLines;
use crate::{Error, Result};

/// Longest wait before the caller is asked whether to stop, and the interval between attempts to open a line again.
const ASK_EVERY: Duration = Duration::from_millis(50);

/// Interval between attempts to write into a full line.
const WRITE_EVERY: Duration = Duration::from_millis(5);

/// Longest wait for the greeting of a board whose line was opened again.
const GREETING: Duration = Duration::from_millis(250);

/// Number of lines that are stored for [`BoardLine::take_lines`].
const RECENT: usize = 256;

/// Longest line of a board, bytes.
const LONGEST: usize = 1024;

/// A board on its serial line.
pub struct BoardLine {
    place: SerialPlace,
    timeout: Duration,
    /// `None` once it is closed.
    line: Option<SerialLine>,
    lines: TextLines,
    /// Number of bytes that are no text, as those of a line at another baud rate.
    no_text: u64,
    recent: VecDeque<String>,
    faults: BTreeMap<String, u64>,
    resets: u64,
}

impl BoardLine {
    /// Opens the line of a board, which may take so long to answer.
    ///
    /// # Errors
    ///
    /// As [`SerialLine::open`].
    pub fn open(place: SerialPlace, timeout: Duration) -> Result<Self> {
        let line = Some(SerialLine::open(&place, timeout)?);
        let (lines, recent) = (TextLines::new(LONGEST), VecDeque::new());
        Ok(Self { place, timeout, line, lines, no_text: 0, recent, faults: BTreeMap::new(), resets: 0 })
    }

    /// Writes a register, or reads it (a write of REG6); returns the value that the board reports.
    ///
    /// # Errors
    ///
    /// `Core(Device)` if the board refuses the command or does not answer, or the line is closed; `Socket` if the line
    /// has hung up.
    pub fn command(&mut self, command: Command, stop: Stop<'_>) -> Result<u32> {
        let Command { register, value } = command;
        let answered = if register == 6 { value } else { u32::from(register) };
        let answer = self.ask(command, self.timeout, stop, |line| match *line {
            StatusLine::Register { register, value } if answered == u32::from(register) => Some(Ok(value)),
            StatusLine::Refusal { register: refused, .. } if refused == register => Some(Err(line.to_string())),
            _ => None,
        })?;
        answer.map_err(|line| {
            let rule = line.trim_start_matches("bad ");
            self.device(&format!("the board refuses REG{register} = 0x{value:08X} ({rule} of its registers)"))
        })
    }

    /// Requests the greeting of the board, as its line at reset may not have been received.
    ///
    /// # Errors
    ///
    /// As [`BoardLine::command`].
    pub fn greeting(&mut self, stop: Stop<'_>) -> Result<Greeting> {
        self.greeting_within(self.timeout, stop)
    }

    fn greeting_within(&mut self, most: Duration, stop: Stop<'_>) -> Result<Greeting> {
        let request = Command { register: 6, value: 8 };
        let greeting = self.ask(request, most, stop, |line| match line {
            StatusLine::Greeting(greeting) => Some(*greeting),
            _ => None,
        })?;
        // This greeting was requested, so it does not indicate a reset.
        self.resets -= 1;
        Ok(greeting)
    }

    /// Reads the lines that have arrived.
    ///
    /// # Errors
    ///
    /// `Socket` if the line has hung up, `Core(Device)` if it is closed.
    pub fn listen(&mut self) -> Result<()> {
        let begun = Instant::now();
        loop {
            while self.next_status().is_some() {}
            // A line that never pauses is no board's.
            if !self.receive(Duration::ZERO)? || begun.elapsed() >= self.timeout {
                return Ok(());
            }
        }
    }

    /// The lines of the board since the last call, answers to commands included; at most the last 256.
    ///
    /// # Errors
    ///
    /// As [`BoardLine::listen`].
    pub fn take_lines(&mut self) -> Result<Vec<String>> {
        self.listen()?;
        Ok(self.recent.drain(..).collect())
    }

    /// Number of faults by name, as the board reported it last.
    #[must_use]
    pub fn faults(&self) -> &BTreeMap<String, u64> {
        &self.faults
    }

    /// Number of received greetings that were not requested: the board sends one at a reset and on connecting.
    #[must_use]
    pub fn resets(&self) -> u64 {
        self.resets
    }

    /// Opens the line again until the board answers with its greeting; the counts of faults begin again at 0.
    ///
    /// # Errors
    ///
    /// `Core(Device)` if no board answers within that time.
    pub fn reopen(&mut self, within: Duration, stop: Stop<'_>) -> Result<Greeting> {
        let (begun, most) = (Instant::now(), self.timeout.min(GREETING));
        loop {
            self.close();
            let opened = SerialLine::open(&self.place, most).and_then(|line| {
                self.line = Some(line);
                self.faults.clear();
                self.greeting_within(most, stop)
            });
            match opened {
                Err(Error::Core(CoreError::Interrupted)) | Ok(_) => return opened,
                Err(error) if begun.elapsed() >= within => {
                    let seconds = within.as_secs_f64();
                    return Err(self.device(&format!("no board answered within {seconds} s ({error})")));
                }
                Err(_) => std::thread::sleep(ASK_EVERY),
            }
            stop.check()?;
        }
    }

    /// Closes the line.
    pub fn close(&mut self) {
        self.line = None;
        self.lines = TextLines::new(LONGEST);
    }

    /// Sends a command; returns what `answer` finds first in the lines that follow.
    fn ask<T>(
        &mut self,
        command: Command,
        most: Duration,
        stop: Stop<'_>,
        answer: impl Fn(&StatusLine) -> Option<T>,
    ) -> Result<T> {
        // A line that arrived before the command is not its answer.
        self.listen()?;
        let (until, no_text) = (Instant::now() + most, self.no_text);
        let bytes = command.to_bytes();
        let mut sent = 0;
        loop {
            if sent < bytes.len() {
                sent += self.line()?.write(&bytes[sent..]).map_err(Error::socket(self.place.name()))?;
            }
            while let Some(line) = self.next_status() {
                if let Some(found) = answer(&line) {
                    return Ok(found);
                }
            }
            stop.check()?;
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(self.silence(most, self.no_text - no_text));
            }
            self.receive(left.min(if sent < bytes.len() { WRITE_EVERY } else { ASK_EVERY }))?;
        }
    }

    fn silence(&self, most: Duration, no_text: u64) -> Error {
        let why = match &self.place {
            SerialPlace::Port(_, baud) if no_text > 0 => {
                format!("{no_text} bytes arrived that are not text: is the board's baud rate {baud}?")
            }
            _ => "is this the board's serial line?".to_owned(),
        };
        self.device(&format!("no answer within {} s: {why}", most.as_secs_f64()))
    }

    fn device(&self, text: &str) -> Error {
        CoreError::device(format!("{}: {text}", self.place.name())).into()
    }

    fn line(&mut self) -> Result<&mut SerialLine> {
        let closed = self.device("the line is closed");
        self.line.as_mut().ok_or(closed)
    }

    /// Waits for bytes; returns whether any came.
    fn receive(&mut self, most: Duration) -> Result<bool> {
        let mut piece = [0; 4096];
        let n = self.line()?.read(&mut piece, most).map_err(Error::socket(self.place.name()))?;
        let is_text = |byte: &&u8| byte.is_ascii_graphic() || byte.is_ascii_whitespace();
        self.no_text += (n - piece[..n].iter().filter(is_text).count()) as u64;
        self.lines.push(&piece[..n]);
        Ok(n > 0)
    }

    /// The next line that has arrived and that a host reacts to. Counts faults and resets.
    fn next_status(&mut self) -> Option<StatusLine> {
        while let Some(line) = self.lines.next(false) {
            let text = line.text.trim();
            if text.is_empty() {
                continue;
            }
            if self.recent.len() == RECENT {
                self.recent.pop_front();
            }
            self.recent.push_back(text.to_owned());
            let Some(status) = StatusLine::parse(text) else { continue };
            match &status {
                StatusLine::Greeting(_) => self.resets += 1,
                StatusLine::Fault { name, count } => drop(self.faults.insert(name.clone(), *count)),
                _ => {}
            }
            return Some(status);
        }
        None
    }
}
