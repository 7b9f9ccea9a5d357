//! Serial ports and lines, and the status lines of a board.

use std::time::Duration;

use pyo3::prelude::*;
use serde_json::{Value, json};
use taxel_core::wire::StatusLine;
use taxel_live::line_place::LinePlace;
use taxel_live::serial_line::SerialPlace;
use taxel_live::{Error, ports, serial_line};

use taxel_border::enter::{Exclusive, enter};
use taxel_border::errors::{core, live};
use taxel_border::parameters::Plain;

/// The current time of the host's clock, which nobody sets while something is received, ns since 1970.
#[pyfunction]
pub fn now_ns() -> i64 {
    taxel_live::recording::now_ns()
}

/// The serial ports that the system knows.
#[pyfunction]
pub fn serial_ports(py: Python<'_>) -> PyResult<Plain<Vec<ports::Port>>> {
    enter(py, |_| ports::ports()).map(Plain)
}

/// Kind of a place of lines, where it is, its baud rate, and all of it as it is shown.
#[pyfunction]
pub fn line_place(py: Python<'_>, text: &str) -> PyResult<(&'static str, String, u32, String)> {
    let place: LinePlace = enter(py, |_| text.parse())?;
    let shown = place.to_string();
    Ok(match place {
        LinePlace::Serial(SerialPlace::Port(port, baud)) => ("serial", port, baud, shown),
        LinePlace::Serial(server) => ("serial", server.to_string(), serial_line::BAUD, shown),
        LinePlace::Tcp(server) => ("tcp", server.to_string(), serial_line::BAUD, shown),
        LinePlace::File(path) => ("file", path.to_string_lossy().into_owned(), 0, shown),
        LinePlace::Udp(address) => ("udp", address.to_string(), 0, shown),
    })
}

/// Kind and parts of a line of a board; None of another line.
#[pyfunction]
pub fn status_line(text: &str) -> Option<(&'static str, Plain<Value>)> {
    Some(match StatusLine::parse(text)? {
        StatusLine::Greeting(greeting) => ("greeting", Plain(json!(greeting))),
        StatusLine::Register { register, value } => ("register", Plain(json!((register, value)))),
        StatusLine::Refusal { register, rule } => ("refusal", Plain(json!((register, rule)))),
        StatusLine::Fault { name, count } => ("fault", Plain(json!((name, count)))),
    })
}

/// An open serial line: a port, or TCP to a server.
#[pyclass(frozen)]
pub struct SerialLine {
    line: Exclusive<serial_line::SerialLine>,
    /// The place as errors name it.
    #[pyo3(get)]
    name: String,
}

#[pymethods]
impl SerialLine {
    /// A server may take so many seconds to answer.
    #[new]
    fn open(py: Python<'_>, place: &str, baud: u32, within: f64) -> PyResult<Self> {
        let place = SerialPlace::new(place, baud).map_err(core)?;
        let line = enter(py, |_| serial_line::SerialLine::open(&place, seconds(within)))?;
        Ok(Self { line: Exclusive::new(line), name: place.name() })
    }

    /// What has arrived, after at most so many seconds.
    fn read(&self, py: Python<'_>, within: f64) -> PyResult<Vec<u8>> {
        let mut bytes = vec![0; 1 << 16];
        let n = self.line.with(py, |line| line.read(&mut bytes, seconds(within)));
        bytes.truncate(n.map_err(|error| live(Error::socket(&self.name)(error)))?);
        Ok(bytes)
    }

    /// Writes as many bytes as there is room for; returns their number.
    fn write(&self, py: Python<'_>, data: &[u8]) -> PyResult<usize> {
        self.line.with(py, |line| line.write(data)).map_err(|error| live(Error::socket(&self.name)(error)))
    }
}

/// A time of 0 or more; infinity is the longest one.
fn seconds(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds.max(0.0)).unwrap_or(Duration::MAX)
}
