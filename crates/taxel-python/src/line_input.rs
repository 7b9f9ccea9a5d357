//! Lines of text as they arrive, for Python, which reads their numbers.

use pyo3::prelude::*;
use taxel_live::line_input::LineReader;
use taxel_live::line_place::LinePlace;
use taxel_live::text_lines::TextLine;

use taxel_border::enter::{Exclusive, enter};

/// What arrived in a short time.
#[pyclass(frozen, get_all)]
pub struct ArrivedLines {
    /// Each line with its number of bytes, whether it is only the beginning of one that is too long, and whether it is text.
    lines: Vec<(String, u64, bool, bool)>,
    /// When the last bytes arrived, ns since 1970; 0 before any.
    arrived_ns: i64,
    /// Whether the first line may lack its beginning: then whether that is a loss.
    cut: Option<bool>,
    /// Number of bytes in no line, and of lines that did not end or begin.
    in_no_line: u64,
    unfinished: u64,
    /// Whether no more can arrive.
    ended: bool,
    /// Why reading failed: the place was opened again, and the next line begins anew.
    trouble: Option<String>,
}

/// The lines of a serial line, a pipe, a file that grows, TCP or UDP.
#[pyclass(frozen)]
pub struct LineInput {
    reader: Exclusive<LineReader>,
    /// The place, in words.
    #[pyo3(get)]
    place: String,
    /// Whether it is a file on a disk, which has what was written before it is read.
    #[pyo3(get)]
    is_file: bool,
    /// Whether it is a serial port or server.
    #[pyo3(get)]
    is_serial: bool,
}

#[pymethods]
impl LineInput {
    /// Opens serial:PLACE[,baud=RATE], lines:PATH, lines+tcp:HOST:PORT or lines+udp:HOST:PORT.
    #[new]
    fn open(py: Python<'_>, place: &str) -> PyResult<Self> {
        let (found, reader) = enter(py, |_| {
            let found: LinePlace = place.parse()?;
            LineReader::open(&found).map(|reader| (found, reader))
        })?;
        Ok(Self {
            reader: Exclusive::new(reader),
            place: found.to_string(),
            is_file: found.is_regular_file(),
            is_serial: matches!(found, LinePlace::Serial(_)),
        })
    }

    /// Waits for lines for 50 ms at most.
    fn read(&self, py: Python<'_>) -> ArrivedLines {
        self.reader.with(py, |reader| {
            let (ended, trouble) = match reader.fill() {
                Ok(ended) => (ended, None),
                Err(error) => {
                    let trouble = reader.broken(error).to_string();
                    reader.reopen();
                    (false, Some(trouble))
                }
            };
            let out = |line: TextLine| {
                let is_text = line.is_text();
                (line.text, line.bytes, line.cut, is_text)
            };
            let lines: Vec<_> = std::iter::from_fn(|| reader.next(ended)).map(out).collect();
            let cut = if lines.is_empty() { None } else { reader.take_cut() };
            let left_out = reader.lines.take_left_out();
            let (in_no_line, unfinished) = (left_out.in_no_line, left_out.unfinished);
            ArrivedLines { lines, arrived_ns: reader.came_ns, cut, in_no_line, unfinished, ended, trouble }
        })
    }

    /// Ends reading; returns the bytes in no line and those of a line whose end did not arrive.
    fn end(&self, py: Python<'_>) -> (u64, u64) {
        self.reader.with(py, |reader| {
            reader.lines.discard();
            let left_out = reader.lines.take_left_out();
            (left_out.in_no_line, left_out.unfinished)
        })
    }
}
