//! A serial line: a port of this computer, or TCP to a serial server or an emulated board.

use std::fmt::{self, Display, Formatter};
use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::ops::RangeInclusive;
use std::str::FromStr;
use std::time::Duration;

use serialport::{ClearBuffer, SerialPort};
use taxel_core::problem;

use crate::ports::ports;
use crate::{Error, Result, address};

/// Default baud rate, bits/s.
pub const BAUD: u32 = 115_200;

/// Baud rates that are accepted, bits/s; a port may refuse some of them.
pub const BAUDS: RangeInclusive<u32> = 300..=4_000_000;

/// How long a server may take to answer where its user waits for nothing else.
pub const CONNECT: Duration = Duration::from_secs(1);

/// The least time limit of a port: Windows takes 0 for no limit.
const AT_ONCE: Duration = if cfg!(windows) { Duration::from_millis(1) } else { Duration::ZERO };

/// Where a serial line is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SerialPlace {
    /// A port of this computer and its baud rate; 8 data bits, no parity, 1 stop bit.
    Port(String, u32),
    /// A host, by name or number, and a TCP port.
    Tcp(String, u16),
}

impl SerialPlace {
    /// Parses "COM3", "/dev/ttyACM0" or "HOST:PORT"; over TCP there is no baud rate.
    ///
    /// # Errors
    ///
    /// `Problem` if the place is none of these, or the baud rate is out of its range.
    pub fn new(text: &str, baud: u32) -> taxel_core::Result<Self> {
        let number = text.get(..3).filter(|start| start.eq_ignore_ascii_case("COM")).map(|_| &text[3..]);
        let is_com = number.is_some_and(|number| !number.is_empty() && number.bytes().all(|c| c.is_ascii_digit()));
        if !BAUDS.contains(&baud) {
            return Err(problem!("baud"; " is {baud}: must be from {} to {}", BAUDS.start(), BAUDS.end()));
        }
        if is_com || text.starts_with('/') {
            return Ok(Self::Port(text.to_owned(), baud));
        }
        match address::host_and_port(text) {
            Some((host, port)) => Ok(Self::Tcp(host.to_owned(), port)),
            None => Err(problem!("place"; " is {text:?}: must be a serial port (COM3, /dev/ttyACM0) or HOST:PORT")),
        }
    }

    /// The place as errors name it.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Port(path, _) => path.clone(),
            Self::Tcp(..) => format!("TCP {self}"),
        }
    }
}

/// Parses a place, with the default baud rate.
impl FromStr for SerialPlace {
    type Err = taxel_core::Error;

    fn from_str(text: &str) -> taxel_core::Result<Self> {
        Self::new(text, BAUD)
    }
}

impl Display for SerialPlace {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Port(path, _) => f.write_str(path),
            Self::Tcp(host, port) if host.contains(':') => write!(f, "[{host}]:{port}"),
            Self::Tcp(host, port) => write!(f, "{host}:{port}"),
        }
    }
}

/// An open serial line.
pub struct SerialLine(Stream);

enum Stream {
    Port(Box<dyn SerialPort>),
    Tcp(TcpStream),
}

impl SerialLine {
    /// Opens a line; a server may take so long to answer.
    ///
    /// # Errors
    ///
    /// `Socket` if it cannot be opened, `Core(Device)` if it is no serial port.
    pub fn open(place: &SerialPlace, within: Duration) -> Result<Self> {
        match place {
            SerialPlace::Port(path, baud) => open_port(path, *baud),
            SerialPlace::Tcp(host, port) => connect(host, *port, within).map_err(Error::socket(place.name())),
        }
    }

    /// Reads what has arrived, and waits for it if nothing has; returns the number of bytes, 0 if none came in time.
    ///
    /// # Errors
    ///
    /// Those of the system: the line was disconnected.
    pub fn read(&mut self, bytes: &mut [u8], within: Duration) -> io::Result<usize> {
        let read = match &mut self.0 {
            Stream::Port(port) => {
                port.set_timeout(within.max(AT_ONCE)).map_err(io::Error::from).and_then(|()| port.read(bytes))
            }
            Stream::Tcp(stream) => stream.set_nonblocking(within.is_zero()).and_then(|()| {
                // A limit of 0 is refused.
                stream.set_read_timeout(Some(within.max(Duration::from_millis(1))))?;
                stream.read(bytes)
            }),
        };
        passed(read.and_then(|n| if n == 0 { Err(ErrorKind::UnexpectedEof.into()) } else { Ok(n) }))
    }

    /// Writes as many bytes as there is room for, without waiting; returns their number.
    ///
    /// # Errors
    ///
    /// Those of the system: the line was disconnected.
    pub fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        passed(match &mut self.0 {
            Stream::Port(port) => port.set_timeout(AT_ONCE).map_err(io::Error::from).and_then(|()| port.write(bytes)),
            Stream::Tcp(stream) => stream.set_nonblocking(true).and_then(|()| stream.write(bytes)),
        })
    }
}

fn open_port(path: &str, baud: u32) -> Result<SerialLine> {
    // A USB device may send only while DTR is set, which Linux does by itself.
    let port = serialport::new(path, baud).dtr_on_open(true).open_native().map_err(|error| unopened(path, error))?;
    write_in_part(&port).map_err(Error::socket(path))?;
    // What arrived before the line was opened is older than what its user asks for.
    port.clear(ClearBuffer::Input).map_err(|error| unopened(path, error))?;
    Ok(SerialLine(Stream::Port(Box::new(port))))
}

/// Why a port could not be opened.
fn unopened(path: &str, error: serialport::Error) -> Error {
    use serialport::ErrorKind::{Io, NoDevice};
    let is_listed = || ports().is_ok_and(|ports| ports.iter().any(|port| port.place.eq_ignore_ascii_case(path)));
    let source = match error.kind() {
        // In Windows a port that does not exist has this kind too.
        NoDevice if cfg!(unix) || is_listed() => {
            io::Error::new(ErrorKind::ResourceBusy, "another program has opened this port")
        }
        NoDevice => io::Error::new(ErrorKind::NotFound, error),
        Io(_) => error.into(),
        _ => return taxel_core::Error::device(format!("{path}: no serial port ({error})")).into(),
    };
    Error::socket(path)(source)
}

/// Lets a write return where a port has room for a part of the bytes only: in Unix `serialport` waits for all.
#[cfg(unix)]
fn write_in_part(port: &impl std::os::fd::AsRawFd) -> io::Result<()> {
    // SAFETY: a descriptor that `port` holds open, and a flag.
    match unsafe { libc::fcntl(port.as_raw_fd(), libc::F_SETFL, libc::O_NONBLOCK) } {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}

#[cfg(not(unix))]
fn write_in_part<Port>(_: &Port) -> io::Result<()> {
    Ok(())
}

fn connect(host: &str, port: u16, within: Duration) -> io::Result<SerialLine> {
    let mut failed = None;
    for address in (host, port).to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, within.max(Duration::from_millis(1))) {
            Ok(stream) => return stream.set_nodelay(true).map(|()| SerialLine(Stream::Tcp(stream))),
            Err(error) => failed = Some(error),
        }
    }
    Err(failed.unwrap_or_else(|| io::Error::new(ErrorKind::NotFound, "no such host")))
}

/// The result of a read or write: that nothing passed in time is no error, and every error means that the line has hung
/// up.
fn passed(result: io::Result<usize>) -> io::Result<usize> {
    result.or_else(|error| match error.kind() {
        ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted => Ok(0),
        ErrorKind::UnexpectedEof | ErrorKind::BrokenPipe => {
            Err(io::Error::new(ErrorKind::NotConnected, "the line was disconnected"))
        }
        _ => Err(io::Error::new(ErrorKind::NotConnected, format!("the line was disconnected: {error}"))),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_read_as_they_are_written() {
        for (text, place, shown) in [
            ("COM3", SerialPlace::Port("COM3".into(), BAUD), "COM3"),
            ("com12", SerialPlace::Port("com12".into(), BAUD), "com12"),
            ("/dev/ttyACM0", SerialPlace::Port("/dev/ttyACM0".into(), BAUD), "/dev/ttyACM0"),
            ("/dev/a@b", SerialPlace::Port("/dev/a@b".into(), BAUD), "/dev/a@b"),
            ("localhost:5209", SerialPlace::Tcp("localhost".into(), 5209), "localhost:5209"),
            ("com3:7", SerialPlace::Tcp("com3".into(), 7), "com3:7"),
            ("[::1]:5209", SerialPlace::Tcp("::1".into(), 5209), "[::1]:5209"),
        ] {
            assert_eq!(text.parse(), Ok(place));
            let place: SerialPlace = text.parse().unwrap();
            assert_eq!((place.to_string(), place.to_string().parse()), (shown.to_owned(), Ok(place)));
        }
    }

    #[test]
    fn another_place_or_baud_rate_is_refused_by_name() {
        for (text, said) in [
            ("ttyUSB0", "place is \"ttyUSB0\": must be a serial port (COM3, /dev/ttyACM0) or HOST:PORT"),
            ("", "place is \"\": must be a serial port (COM3, /dev/ttyACM0) or HOST:PORT"),
            ("COM", "place is \"COM\": must be a serial port (COM3, /dev/ttyACM0) or HOST:PORT"),
            ("é3", "place is \"é3\": must be a serial port (COM3, /dev/ttyACM0) or HOST:PORT"),
            ("host:99999", "place is \"host:99999\": must be a serial port (COM3, /dev/ttyACM0) or HOST:PORT"),
        ] {
            assert_eq!(text.parse::<SerialPlace>().unwrap_err().to_string(), said);
        }
        for baud in [0, 299, 4_000_001] {
            let said = format!("baud is {baud}: must be from 300 to 4000000");
            assert_eq!(SerialPlace::new("COM3", baud).unwrap_err().to_string(), said);
        }
    }
}
