//! Where lines of text are read, and written: a serial line, a pipe or file, TCP or UDP.

use std::fmt::{self, Display, Formatter};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::str::FromStr;

use taxel_core::problem;

use crate::serial_line::{BAUD, SerialPlace};
use crate::{Error, Result, address};

/// How places are written, for errors.
const FORMS: &str = "serial:PLACE[,baud=RATE], lines:PATH, lines+tcp:HOST:PORT or lines+udp:HOST:PORT";

/// The place of lines of text, read from `serial:PLACE[,baud=RATE]`, `lines:PATH`, `lines+tcp:HOST:PORT` or `lines+udp:HOST:PORT`.
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

impl FromStr for LinePlace {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let (whole, baud) = text.split_once(",baud=").map_or((text, None), |(whole, baud)| (whole, Some(baud)));
        let (kind, place) = whole.split_once(':').unwrap_or_default();
        if let Some(baud) = baud.filter(|_| kind != "serial") {
            return Err(problem!("baud"; " is {baud}: must be left out, because {whole} is no serial port").into());
        }
        Ok(match kind {
            "serial" if !place.is_empty() && !place.contains(',') => {
                let Ok(rate) = baud.map_or(Ok(BAUD), str::parse) else {
                    let baud = baud.unwrap_or_default();
                    return Err(problem!("baud"; " is {baud:?}: must be a number of bits/s, for example {BAUD}").into());
                };
                match (SerialPlace::new(place, rate)?, baud) {
                    (SerialPlace::Tcp(..), Some(baud)) => {
                        return Err(problem!(
                            "baud"; " is {baud}: must be left out, because {place} is a TCP port"
                        )
                        .into());
                    }
                    (place, _) => Self::Serial(place),
                }
            }
            "lines" if !place.is_empty() => Self::File(place.into()),
            "lines+tcp" => match address::host_and_port(place) {
                Some((host, port)) => Self::Tcp(SerialPlace::Tcp(host.to_owned(), port)),
                None => return Err(problem!("{place:?}: must be HOST:PORT, for example 127.0.0.1:9000").into()),
            },
            "lines+udp" => Self::Udp(address::of_text(place)?),
            _ => return Err(problem!("{text:?}: must be {FORMS}").into()),
        })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_read_as_they_are_written() {
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
            assert_eq!(text.parse::<LinePlace>().unwrap().to_string(), shown);
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
            assert!(text.parse::<LinePlace>().is_err(), "{text}");
        }
    }
}
