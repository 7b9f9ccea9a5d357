//! Serial ports, and a board on its serial line.

use std::collections::BTreeMap;
use std::time::Duration;

use pyo3::prelude::*;
use taxel_core::wire::{Command, Greeting};
use taxel_live::serial_line::SerialPlace;
use taxel_live::{board_line, ports};

use taxel_border::enter::{Exclusive, enter};
use taxel_border::errors::core;
use taxel_border::parameters::Plain;

/// The serial ports that the system knows.
#[pyfunction]
pub fn serial_ports(py: Python<'_>) -> PyResult<Plain<Vec<ports::Port>>> {
    enter(py, |_| ports::ports()).map(Plain)
}

/// A board on its serial line.
#[pyclass(frozen)]
pub struct BoardLine(Exclusive<board_line::BoardLine>);

#[pymethods]
impl BoardLine {
    /// The board may take `timeout` s to answer.
    #[new]
    fn new(py: Python<'_>, place: &str, baud: u32, timeout: f64) -> PyResult<Self> {
        let place = SerialPlace::new(place, baud).map_err(core)?;
        let line = enter(py, |_| board_line::BoardLine::open(place, seconds(timeout)))?;
        Ok(Self(Exclusive::new(line)))
    }

    /// Writes a register; returns the value that the board reports.
    fn command(&self, py: Python<'_>, register: u8, value: u32) -> PyResult<u32> {
        let command = Command::new(register, value).map_err(core)?;
        self.0.enter(py, |line, stop| line.command(command, stop))
    }

    /// Requests the greeting of the board.
    fn greeting(&self, py: Python<'_>) -> PyResult<Plain<Greeting>> {
        self.0.enter(py, |line, stop| line.greeting(stop)).map(Plain)
    }

    /// Reads the lines that have arrived.
    fn listen(&self, py: Python<'_>) -> PyResult<()> {
        self.0.enter(py, |line, _| line.listen())
    }

    /// The lines of the board since the last call.
    fn take_lines(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.0.enter(py, |line, _| line.take_lines())
    }

    /// Opens the line again until the board answers, for at most `within` s.
    fn reopen(&self, py: Python<'_>, within: f64) -> PyResult<Plain<Greeting>> {
        self.0.enter(py, |line, stop| line.reopen(seconds(within), stop)).map(Plain)
    }

    /// Closes the line.
    fn close(&self, py: Python<'_>) {
        self.0.with(py, board_line::BoardLine::close);
    }

    /// Number of faults by name.
    fn faults(&self, py: Python<'_>) -> BTreeMap<String, u64> {
        self.0.with(py, |line| line.faults().clone())
    }

    /// Number of received greetings that were not requested.
    fn resets(&self, py: Python<'_>) -> u64 {
        self.0.with(py, |line| line.resets())
    }
}

/// A time of 0 or more; infinity is the longest one.
fn seconds(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds.max(0.0)).unwrap_or(Duration::MAX)
}
