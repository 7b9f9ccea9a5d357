//! Sends detections to other programs and machines: each as a line of JSON, by UDP, into a pipe or over a serial line.
//!
//! The thread that made a line writes it if the destination has room; other lines wait in a bounded queue for a
//! separate thread. If a reader is too slow, or absent, lines are lost and counted; the pipeline never waits for it.

use std::collections::{BTreeMap, VecDeque};
use std::fmt::{self, Display, Formatter};
use std::fs::File;
use std::io::{self, ErrorKind, Write};
use std::net::{SocketAddr, UdpSocket};
use std::str::FromStr;
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde::Serialize;
use taxel_core::problem;

use super::sink::{OutputDetection, Sink};
use crate::line_place::{FORMS, LinePlace};
use crate::locked::lock;
use crate::named_pipe::open_to_write;
use crate::serial_line::{CONNECT, SerialLine};
use crate::{Error, Result};

/// Capacity of the queue of lines.
const WAITING: usize = 1024;

/// Interval at which a failed destination is opened again, and the end is checked.
const AGAIN: Duration = Duration::from_millis(250);

/// Interval between attempts to write where there was no room.
const WRITE_EVERY: Duration = Duration::from_millis(2);

/// Longest wait for a slow reader at the end.
const LAST: Duration = Duration::from_secs(1);

/// A destination of detections: as lines are written there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Destination(LinePlace);

impl FromStr for Destination {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let in_text = |error: Error| error.in_part(&format!("send to {text:?}"));
        let (place, option) = text.split_once(',').map_or((text, None), |(place, option)| (place, Some(option)));
        let mut options: BTreeMap<&str, &str> = option.and_then(|option| option.split_once('=')).into_iter().collect();
        let found = LinePlace::parse(place, &mut options).map_err(in_text)?;
        match found.filter(|_| options.is_empty() && option.is_none_or(|option| option.contains('='))) {
            Some(place) => Ok(Self(place)),
            None => Err(problem!("send to {text:?}: must be {FORMS}").into()),
        }
    }
}

impl Display for Destination {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Counts of what was sent to a destination.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Sent {
    /// The destination.
    pub to: String,
    /// Lines that were written whole.
    pub sent: u64,
    /// Number of lines that were lost because there was no room, or no reader.
    pub lost: u64,
    /// Number of lines that wait.
    pub waiting: u64,
    /// The system's last error, if lines were lost for another reason than a slow reader.
    pub trouble: Option<String>,
}

/// Sends each detection to one destination.
pub(super) struct Sending {
    line: Arc<SendingLine>,
    thread: Option<JoinHandle<()>>,
}

/// State shared by the thread that makes detections and the one that sends waiting lines.
pub(super) struct SendingLine {
    to: Destination,
    state: Mutex<SendingState>,
    came: Condvar,
}

struct SendingState {
    device: Option<Device>,
    waiting: VecDeque<Vec<u8>>,
    /// Number of bytes of the first line that were already written.
    gone: usize,
    counts: Sent,
    closed: bool,
}

enum Device {
    Udp(UdpSocket, SocketAddr),
    File(File),
    Serial(SerialLine),
}

impl Sending {
    /// Opens the destination and starts.
    ///
    /// # Errors
    ///
    /// `File` or `Socket` if it cannot be opened, `Core(Problem)` if it is no pipe. A pipe without a reader is no error.
    pub(super) fn open(to: &Destination) -> Result<Self> {
        let device = Device::open(to)?;
        let counts = Sent { to: to.to_string(), ..Sent::default() };
        let state = SendingState { device, waiting: VecDeque::new(), gone: 0, counts, closed: false };
        let line = Arc::new(SendingLine { to: to.clone(), state: Mutex::new(state), came: Condvar::new() });
        let sender = Arc::clone(&line);
        let thread = std::thread::Builder::new().name("taxel-send".to_owned()).spawn(move || sender.send_what_waits());
        Ok(Self { line, thread: Some(thread.map_err(Error::socket("thread"))?) })
    }

    /// The counts, readable while it runs and afterwards.
    pub(super) fn line(&self) -> Arc<SendingLine> {
        Arc::clone(&self.line)
    }
}

impl Sink for Sending {
    fn output(&mut self, detection: &OutputDetection) -> io::Result<()> {
        let mut state = lock(&self.line.state);
        if state.device.is_none() && matches!(self.line.to.0, LinePlace::File(_)) {
            // A pipe may have a reader by now; a serial line takes longer to open, which is left to the other thread.
            state.set_device(Device::open(&self.line.to));
        }
        if state.device.is_none() || state.waiting.len() >= WAITING {
            state.counts.lost += 1;
            return Ok(());
        }
        state.waiting.push_back(detection.line()?);
        if state.waiting.len() == 1 {
            state.write();
        }
        if !state.waiting.is_empty() {
            self.line.came.notify_one();
        }
        Ok(())
    }
}

impl Drop for Sending {
    fn drop(&mut self) {
        lock(&self.line.state).closed = true;
        self.line.came.notify_one();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl SendingLine {
    /// The counts of the destination so far.
    pub(super) fn counts(&self) -> Sent {
        let state = lock(&self.state);
        Sent { waiting: state.waiting.len() as u64, ..state.counts.clone() }
    }

    /// The sending thread: writes the lines that wait until there was room for all.
    fn send_what_waits(&self) {
        let mut closed_at = None;
        let mut state = lock(&self.state);
        loop {
            if state.closed {
                let since = *closed_at.get_or_insert_with(Instant::now);
                if state.waiting.is_empty() || since.elapsed() >= LAST {
                    state.lose(None);
                    return;
                }
            }
            let writes = state.device.is_some() && !state.waiting.is_empty();
            let most = if writes { WRITE_EVERY } else { AGAIN };
            state = self.came.wait_timeout(state, most).unwrap_or_else(PoisonError::into_inner).0;
            if state.device.is_none() && !state.closed {
                // Opening a serial line may take long: the lock is released meanwhile.
                drop(state);
                let opened = Device::open(&self.to);
                state = lock(&self.state);
                state.set_device(opened);
            }
            state.write();
        }
    }
}

impl SendingState {
    /// Handles the result of another attempt to open the destination.
    fn set_device(&mut self, tried: Result<Option<Device>>) {
        match tried {
            Ok(Some(device)) => self.device = Some(device),
            Ok(None) => self.counts.trouble = Some("no reader".to_owned()),
            Err(error) => self.counts.trouble = Some(error.to_string()),
        }
    }

    /// Writes as many lines as fit.
    fn write(&mut self) {
        while let (Some(device), Some(line)) = (&mut self.device, self.waiting.front()) {
            match device.write(&line[self.gone..]) {
                Ok(0) => return,
                Ok(n) if self.gone + n < line.len() => self.gone += n,
                Ok(_) => {
                    self.waiting.pop_front();
                    self.gone = 0;
                    self.counts.sent += 1;
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => return,
                Err(error) if matches!(device, Device::Udp(..)) => {
                    // The system may refuse one datagram and send the next.
                    self.waiting.pop_front();
                    self.counts.lost += 1;
                    self.counts.trouble = Some(error.to_string());
                }
                Err(error) => {
                    let why = if error.kind() == ErrorKind::BrokenPipe {
                        "the reader has closed the pipe".to_owned()
                    } else {
                        error.to_string()
                    };
                    self.device = None;
                    self.lose(Some(why));
                }
            }
        }
    }

    /// Discards waiting lines: late detections would mislead.
    fn lose(&mut self, why: Option<String>) {
        self.counts.lost += self.waiting.len() as u64;
        self.counts.trouble = why.or(self.counts.trouble.take());
        self.waiting.clear();
        self.gone = 0;
    }
}

impl Device {
    /// Opens a destination; `None` for a pipe without a reader.
    fn open(to: &Destination) -> Result<Option<Self>> {
        match &to.0 {
            LinePlace::Udp(address) => {
                let any = if address.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
                let socket = UdpSocket::bind(any).and_then(|s| s.set_nonblocking(true).map(|()| s));
                Ok(Some(Self::Udp(socket.map_err(Error::socket(to))?, *address)))
            }
            LinePlace::File(path) => Ok(open_to_write(path)?.map(Self::File)),
            LinePlace::Serial(place) | LinePlace::Tcp(place) => {
                Ok(Some(Self::Serial(SerialLine::open(place, CONNECT)?)))
            }
        }
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Udp(socket, address) => socket.send_to(bytes, *address),
            Self::File(file) => file.write(bytes),
            Self::Serial(line) => line.write(bytes),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn destinations_are_read_as_they_are_written() {
        for (text, shown) in [
            ("lines+udp:127.0.0.1:9000", "lines+udp:127.0.0.1:9000"),
            ("lines+udp:[::1]:9", "lines+udp:[::1]:9"),
            ("lines+tcp:localhost:9000", "lines+tcp:localhost:9000"),
            ("lines:/tmp/out", "lines:/tmp/out"),
            ("serial:/dev/ttyACM0", "serial:/dev/ttyACM0,baud=115200"),
            ("serial:/dev/ttyACM0,baud=9600", "serial:/dev/ttyACM0,baud=9600"),
            ("serial:COM3", "serial:COM3,baud=115200"),
            ("serial:localhost:5209", "serial:localhost:5209"),
        ] {
            assert_eq!(text.parse::<Destination>().unwrap().to_string(), shown);
        }
        for text in [
            "",
            "udp:127.0.0.1:9000",
            "lines+udp:",
            "lines+udp:9000",
            "lines+tcp:9000",
            "lines:",
            "serial:",
            "serial:/dev/x,baud",
            "serial:/dev/x,baud=fast",
            "serial:/dev/x,rate=9600",
            "file:x",
        ] {
            assert!(text.parse::<Destination>().is_err(), "{text}");
        }
    }
}
