//! Sends detections to other programs and machines: each as a line of JSON, by UDP, into a pipe or over a serial line.
//!
//! The thread that made a line sends it by UDP; other lines wait in a bounded queue for a thread of their destination. If a
//! reader is too slow, or absent, lines are lost and counted; the pipeline never waits for it.

use std::fs::File;
use std::io::{self, ErrorKind, Write};
use std::net::{SocketAddr, UdpSocket};
use std::sync::{Arc, Mutex, OnceLock};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crossbeam_channel as channel;
use serde::Serialize;

use super::sink::{OutputDetection, Sink};
use crate::line_place::LinePlace;
use crate::locked::lock;
use crate::named_pipe::open_to_write;
use crate::serial_line::{CONNECT, SerialLine};
use crate::{Error, Result};

/// Capacity of the queue of lines.
const WAITING: usize = 1024;

/// Interval at which a failed destination is opened again.
const AGAIN: Duration = Duration::from_millis(250);

/// Interval between attempts to write where there was no room.
const WRITE_EVERY: Duration = Duration::from_millis(2);

/// Longest wait for a slow reader at the end.
const LAST: Duration = Duration::from_secs(1);

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

/// Sends each detection to one destination: a datagram at once, anything else by a thread, which waits for room.
pub(super) struct Sending {
    counts: Arc<Mutex<Sent>>,
    udp: Option<(UdpSocket, SocketAddr)>,
    lines: Option<channel::Sender<Vec<u8>>>,
    /// When the pipeline ended.
    ended: Arc<OnceLock<Instant>>,
    thread: Option<JoinHandle<()>>,
}

impl Sending {
    /// Opens the destination and starts.
    ///
    /// # Errors
    ///
    /// `File` or `Socket` if it cannot be opened, `Core(Problem)` if it is no pipe. A pipe without a reader is no error.
    pub(super) fn open(to: &str) -> Result<Self> {
        let to: LinePlace = to.parse().map_err(|error: Error| error.in_part("send"))?;
        let counts = Arc::new(Mutex::new(Sent { to: to.to_string(), ..Sent::default() }));
        let mut sending = Self { counts, udp: None, lines: None, ended: Arc::default(), thread: None };
        if let LinePlace::Udp(address) = to {
            let any = if address.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
            let socket = UdpSocket::bind(any).and_then(|socket| socket.set_nonblocking(true).map(|()| socket));
            sending.udp = Some((socket.map_err(Error::socket(&to))?, address));
            return Ok(sending);
        }
        let (lines, waiting) = channel::bounded(WAITING);
        let (counts, ended) = (Arc::clone(&sending.counts), Arc::clone(&sending.ended));
        let line = WaitingLines { device: Device::open(&to)?, place: to, lines: waiting, counts, ended };
        let thread = std::thread::Builder::new().name("taxel-send".to_owned()).spawn(move || line.send());
        (sending.lines, sending.thread) = (Some(lines), Some(thread.map_err(Error::socket("thread"))?));
        Ok(sending)
    }

    /// The counts, readable while it runs and afterwards.
    pub(super) fn counts(&self) -> Arc<Mutex<Sent>> {
        Arc::clone(&self.counts)
    }
}

impl Sink for Sending {
    fn output(&mut self, detection: &OutputDetection) -> io::Result<()> {
        let line = detection.line()?;
        let mut counts = lock(&self.counts);
        if let Some((socket, address)) = &self.udp {
            match socket.send_to(&line, *address) {
                Ok(_) => counts.sent += 1,
                // The system may refuse one datagram and send the next.
                Err(error) => {
                    counts.lost += 1;
                    counts.trouble = Some(error.to_string());
                }
            }
        }
        if let Some(lines) = &self.lines {
            match lines.try_send(line) {
                Ok(()) => counts.waiting += 1,
                Err(_) => counts.lost += 1,
            }
        }
        Ok(())
    }
}

impl Drop for Sending {
    fn drop(&mut self) {
        self.ended.get_or_init(Instant::now);
        self.lines = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// The lines that wait for a destination, and the thread's end of it.
struct WaitingLines {
    place: LinePlace,
    device: Option<Device>,
    lines: channel::Receiver<Vec<u8>>,
    counts: Arc<Mutex<Sent>>,
    ended: Arc<OnceLock<Instant>>,
}

enum Device {
    File(File),
    Serial(SerialLine),
}

impl WaitingLines {
    /// The sending thread, until the end.
    fn send(mut self) {
        let mut tried = Instant::now();
        loop {
            let line = match self.lines.recv_timeout(AGAIN) {
                Ok(line) => Some(line),
                Err(channel::RecvTimeoutError::Timeout) => None,
                Err(channel::RecvTimeoutError::Disconnected) => return,
            };
            // A pipe may have a reader by now; a serial line takes longer to open.
            let is_pipe = matches!(self.place, LinePlace::File(_));
            if self.device.is_none() && (is_pipe || tried.elapsed() >= AGAIN) {
                self.open();
                tried = Instant::now();
            }
            if let Some(line) = line {
                self.write(&line);
            }
        }
    }

    /// Tries to open the destination again.
    fn open(&mut self) {
        match Device::open(&self.place) {
            Ok(Some(device)) => self.device = Some(device),
            Ok(None) => lock(&self.counts).trouble = Some("no reader".to_owned()),
            Err(error) => lock(&self.counts).trouble = Some(error.to_string()),
        }
    }

    /// Writes a line, as soon as there is room for it.
    fn write(&mut self, mut line: &[u8]) {
        while let Some(device) = &mut self.device {
            if self.ended.get().is_some_and(|ended| ended.elapsed() >= LAST) {
                break;
            }
            match device.write(line) {
                Ok(n) if n == line.len() => {
                    let mut counts = lock(&self.counts);
                    (counts.sent, counts.waiting) = (counts.sent + 1, counts.waiting - 1);
                    return;
                }
                Ok(n) if n > 0 => line = &line[n..],
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Ok(_) => std::thread::sleep(WRITE_EVERY),
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                    std::thread::sleep(WRITE_EVERY);
                }
                Err(error) => {
                    let closed = error.kind() == ErrorKind::BrokenPipe;
                    let why = if closed { "the reader has closed the pipe".to_owned() } else { error.to_string() };
                    (self.device, lock(&self.counts).trouble) = (None, Some(why));
                }
            }
        }
        // Late detections would mislead: those that wait are lost with this one.
        let lost = 1 + self.lines.try_iter().count() as u64;
        let mut counts = lock(&self.counts);
        (counts.lost, counts.waiting) = (counts.lost + lost, counts.waiting - lost);
    }
}

impl Device {
    /// Opens a destination; `None` for a pipe without a reader.
    fn open(place: &LinePlace) -> Result<Option<Self>> {
        match place {
            LinePlace::File(path) => Ok(open_to_write(path)?.map(Self::File)),
            LinePlace::Serial(place) | LinePlace::Tcp(place) => {
                Ok(Some(Self::Serial(SerialLine::open(place, CONNECT)?)))
            }
            // A datagram is sent at once.
            LinePlace::Udp(_) => Ok(None),
        }
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.write(bytes),
            Self::Serial(line) => line.write(bytes),
        }
    }
}
