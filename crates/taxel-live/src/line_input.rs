//! Lines of text from a serial line, a pipe, a file that grows, TCP or UDP, as they arrive.

use std::io::{self, ErrorKind};
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::line_place::LinePlace;
use crate::readable_file::ReadableFile;
use crate::recording::now_ns;
use crate::serial_line::{CONNECT, SerialLine};
use crate::text_lines::{TextLine, TextLines};
use crate::{Error, Result};

/// Interval at which a failed line is opened again, and the end is checked.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// Longest line, bytes; a longer one is not a line of numbers, and what follows in it is left out.
const LONGEST: usize = 1 << 16;

/// The largest datagram that UDP can carry.
const DATAGRAM_BYTES: usize = 1 << 16;

/// Reads lines as they arrive.
pub struct LineReader {
    place: LinePlace,
    input: Option<OpenInput>,
    /// The lines that arrived.
    pub lines: TextLines,
    /// When the last bytes arrived, ns since 1970.
    pub came_ns: i64,
    /// Whether the next line may lack its beginning, as of a serial line that was just opened.
    is_cut: bool,
    /// Whether the line was interrupted, so that a line that lacks its beginning is a loss.
    was_interrupted: bool,
    piece: Vec<u8>,
}

enum OpenInput {
    Serial(SerialLine),
    File(ReadableFile),
    Udp(UdpSocket),
}

impl LineReader {
    /// Opens the place.
    ///
    /// # Errors
    ///
    /// `Socket` or `File` if it cannot be opened.
    pub fn open(place: &LinePlace) -> Result<Self> {
        let input = Some(OpenInput::open(place)?);
        let bytes = if matches!(place, LinePlace::Udp(_)) { DATAGRAM_BYTES } else { 4096 };
        let (is_cut, lines) = (place.begins_anywhere(), TextLines::new(LONGEST));
        let piece = vec![0; bytes];
        Ok(Self { place: place.clone(), input, lines, came_ns: 0, is_cut, was_interrupted: false, piece })
    }

    /// The next line, if one waits; the last one may lack its end where no more can arrive (`ended`).
    pub fn next(&mut self, ended: bool) -> Option<TextLine> {
        self.lines.next(ended)
    }

    /// Whether the next line may lack its beginning, and whether that is a loss, as the line was interrupted; once.
    pub fn take_cut(&mut self) -> Option<bool> {
        std::mem::take(&mut self.is_cut).then_some(self.was_interrupted)
    }

    /// Waits briefly for more bytes; returns whether no more can arrive.
    ///
    /// # Errors
    ///
    /// Those of the system: the line has hung up.
    pub fn fill(&mut self) -> io::Result<bool> {
        let n = match &mut self.input {
            None => {
                std::thread::sleep(LOOK_EVERY);
                // A plug that was pulled may be put back at any time.
                self.input = OpenInput::open(&self.place).ok();
                0
            }
            Some(OpenInput::Serial(line)) => line.read(&mut self.piece, LOOK_EVERY)?,
            Some(OpenInput::Udp(socket)) => match socket.recv(&mut self.piece) {
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => 0,
                received => received?,
            },
            Some(OpenInput::File(file)) => match file.read(&mut self.piece, LOOK_EVERY)? {
                Some(0) if self.place == LinePlace::File(PathBuf::from("-")) => return Ok(true),
                // A pipe without a writer, or the end of a file: a program may still write to it.
                Some(0) => {
                    std::thread::sleep(LOOK_EVERY);
                    0
                }
                read => read.unwrap_or(0),
            },
        };
        if n > 0 {
            self.came_ns = now_ns();
            self.lines.push(&self.piece[..n]);
            if matches!(self.place, LinePlace::Udp(_)) && self.piece[n - 1] != b'\n' {
                // The end of a datagram ends its last line.
                self.lines.push(b"\n");
            }
        }
        Ok(false)
    }

    /// An error of the system, which names the place.
    #[must_use]
    pub fn broken(&self, error: io::Error) -> Error {
        match &self.place {
            LinePlace::Serial(place) | LinePlace::Tcp(place) => Error::socket(place.name())(error),
            LinePlace::File(path) => Error::file(path)(error),
            LinePlace::Udp(address) => Error::socket(format!("UDP {address}"))(error),
        }
    }

    /// Opens the line again, and leaves out an incomplete line.
    pub fn reopen(&mut self) {
        self.lines.discard();
        // A port that is open is not opened again.
        self.input = None;
        self.input = OpenInput::open(&self.place).ok();
        (self.is_cut, self.was_interrupted) = (self.place.begins_anywhere(), true);
    }
}

impl OpenInput {
    fn open(place: &LinePlace) -> Result<Self> {
        match place {
            LinePlace::Serial(place) | LinePlace::Tcp(place) => SerialLine::open(place, CONNECT).map(Self::Serial),
            LinePlace::File(path) => {
                let is_input = path == Path::new("-");
                let file = if is_input { ReadableFile::standard_input() } else { ReadableFile::open(path) };
                file.map(Self::File).map_err(Error::file(path))
            }
            LinePlace::Udp(address) => {
                let socket = UdpSocket::bind(address).and_then(|socket| {
                    socket.set_read_timeout(Some(LOOK_EVERY))?;
                    Ok(socket)
                });
                Ok(Self::Udp(socket.map_err(Error::socket(format!("UDP {address}")))?))
            }
        }
    }
}
