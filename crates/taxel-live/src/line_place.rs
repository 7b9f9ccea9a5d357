//! Where lines of text are read, and written: a serial line, a pipe or file, TCP or UDP.

use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};
use std::net::SocketAddr;
use std::path::PathBuf;

use taxel_core::problem;

use crate::serial_line::{BAUD, SerialPlace};
use crate::{Result, address};

/// How places are written, for errors.
pub const FORMS: &str = "serial:PLACE[,baud=RATE], lines:PATH, lines+tcp:HOST:PORT or lines+udp:HOST:PORT";

/// The place of lines of text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum LinePlace {
    /// A serial line.
    Serial(SerialPlace),
    /// A TCP server, to which a program connects.
    Tcp(SerialPlace),
    /// A named pipe, or a file that grows; `-` is the standard input.
    File(PathBuf),
    /// Datagrams: of whole lines to this local address, or of one line each to this address.
    Udp(SocketAddr),
}

impl LinePlace {
    /// Parses `serial:PLACE`, `lines:PATH`, `lines+tcp:HOST:PORT` or `lines+udp:HOST:PORT`; the option `baud` is that of a serial
    /// line. `None` if the text is of another kind.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` if a place, an address or a baud rate is not valid.
    pub fn parse(text: &str, options: &mut BTreeMap<&str, &str>) -> Result<Option<Self>> {
        let Some((kind, place)) = text.split_once(':').filter(|(_, place)| !place.is_empty()) else { return Ok(None) };
        Ok(Some(match kind {
            "serial" => {
                let stated = options.remove("baud");
                let Ok(baud) = stated.map_or(Ok(BAUD), str::parse) else {
                    let baud = stated.unwrap_or_default();
                    return Err(problem!("baud"; " is {baud:?}: must be a number of bits/s, for example {BAUD}").into());
                };
                match (SerialPlace::new(place, baud)?, stated) {
                    (SerialPlace::Tcp(..), Some(baud)) => {
                        return Err(problem!(
                            "baud"; " is {baud}: must be left out, because {place} is a TCP port"
                        )
                        .into());
                    }
                    (place, _) => Self::Serial(place),
                }
            }
            "lines" => Self::File(place.into()),
            "lines+tcp" => match address::host_and_port(place) {
                Some((host, port)) => Self::Tcp(SerialPlace::Tcp(host.to_owned(), port)),
                None => return Err(problem!("{place:?}: must be HOST:PORT, for example 127.0.0.1:9000").into()),
            },
            "lines+udp" => Self::Udp(address::of_text(place)?),
            _ => return Ok(None),
        }))
    }
}

impl LinePlace {
    /// Whether what arrives first may be the rest of a line: whatever sends may have begun before. A file is read from its
    /// beginning, and a datagram begins with a line.
    #[must_use]
    pub fn begins_anywhere(&self) -> bool {
        match self {
            Self::Serial(_) | Self::Tcp(_) => true,
            Self::File(_) => !self.is_regular_file(),
            Self::Udp(_) => false,
        }
    }

    /// Whether it is a file on a disk, which has what was written before it is read.
    #[must_use]
    pub fn is_regular_file(&self) -> bool {
        matches!(self, Self::File(path) if std::fs::metadata(path).is_ok_and(|about| about.is_file()))
    }
}

impl Display for LinePlace {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Serial(place @ SerialPlace::Port(_, baud)) => write!(f, "serial:{place},baud={baud}"),
            Self::Serial(place @ SerialPlace::Tcp(..)) => write!(f, "serial:{place}"),
            Self::Tcp(place) => write!(f, "lines+tcp:{place}"),
            Self::File(path) => write!(f, "lines:{}", path.display()),
            Self::Udp(address) => write!(f, "lines+udp:{address}"),
        }
    }
}
