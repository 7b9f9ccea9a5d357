//! The specification of a further source of a recording, and its parser: another board, lines of numbers from a serial
//! line or a pipe, or numbers that a program passes; and a reader of lines as they arrive.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::net::SocketAddr;
use std::os::fd::{AsFd, AsRawFd, RawFd};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use taxel_core::wire::Registers;
use taxel_core::{Array, problem};

use crate::locked::lock;
use crate::recording::{Header, StreamColumns, fields, now_ns};
use crate::serial_line::{CONNECT, SerialLine, SerialPlace};
use crate::text_lines::{TextLine, TextLines};
use crate::{Error, Result, address};

/// Timeout for the first line of a source, which defines its columns, if they are not given.
const FIRST_LINE: Duration = Duration::from_secs(3);

/// Interval at which a failed line is opened again, and the end is checked.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// Longest line, bytes; a longer one is not a line of numbers, and what follows in it is left out.
const LONGEST: usize = 1 << 16;

/// A further source of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct FurtherSource {
    /// Name of the source.
    pub name: String,
    /// Kind of the source.
    pub kind: SourceKind,
}

/// The kind of a further source.
#[derive(Debug, Clone, PartialEq)]
pub enum SourceKind {
    /// A board that sends to this local address.
    Board(SocketAddr, Box<Array>, Registers),
    /// Lines of numbers; already open if the columns were read from the first line.
    Lines(LineInput, StreamColumns, Opened),
    /// Numbers that a program passes ([`Live::sample`](super::Live::sample)).
    Given(StreamColumns),
}

/// The place from which lines of numbers are read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum LineInput {
    /// A serial line.
    Serial(SerialPlace),
    /// A named pipe, or any file that is read to its end and then watched for more; `-` is the standard input.
    Pipe(PathBuf),
}

/// Lines that were opened to read their columns, with the bytes after the first line. The reader continues there:
/// reopening would lose those bytes, and closing a pipe ends the program that writes to it.
#[derive(Clone, Default)]
pub struct Opened(Arc<Mutex<Option<LineReader>>>);

impl Opened {
    pub(super) fn take(&self) -> Option<LineReader> {
        lock(&self.0).take()
    }
}

impl std::fmt::Debug for Opened {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Opened")
    }
}

/// Two sources are equal whether or not their lines were read already.
impl PartialEq for Opened {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl std::fmt::Display for LineInput {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Serial(place) => write!(f, "serial {place}"),
            Self::Pipe(path) => write!(f, "pipe {}", path.display()),
        }
    }
}

impl FurtherSource {
    /// The source's header in the recording.
    pub(super) fn header(&self) -> taxel_core::Result<Header> {
        match &self.kind {
            SourceKind::Board(address, array, registers) => {
                let board = Header::of_board((**array).clone(), Some(*registers), format!("udp {address}"), now_ns());
                Ok(Header { name: self.name.clone(), ..board })
            }
            SourceKind::Lines(place, stream, _) => {
                Header::of_stream(&self.name, stream.clone(), place.to_string(), now_ns())
            }
            SourceKind::Given(stream) => {
                Header::of_stream(&self.name, stream.clone(), "given by a program".to_owned(), now_ns())
            }
        }
    }
}

/// Parses `udp:HOST:PORT`, `serial:PLACE@BAUD`, `pipe:PATH` or `given`, followed by options after commas: `array=RxC`
/// and `preset=NAME` for a board, `columns=A:B:C` and `time=NAME:UNIT` for numbers. Without `columns` the first line is
/// awaited, which defines them.
impl FromStr for SourceKind {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let mut parts = text.split(',');
        let input = parts.next().unwrap_or_default();
        let mut options = BTreeMap::new();
        for part in parts {
            let Some((key, value)) = part.split_once('=') else {
                return Err(problem!("source {text:?}: {part:?} must be KEY=VALUE").into());
            };
            options.insert(key.trim(), value.trim());
        }
        let kind = match input.split_once(':') {
            Some(("udp", place)) => {
                let array = options.remove("array").map_or(Ok(Array::thesis()), |size| array_of(text, size))?;
                let registers = Registers::preset_on(options.remove("preset").unwrap_or("5.2 kHz"), &array)?;
                Self::Board(address::of_text(place)?, Box::new(array), registers)
            }
            Some(("serial", place)) if !place.is_empty() => {
                let place = place.parse::<SerialPlace>().map_err(|error| error.in_part(&format!("source {text:?}")))?;
                let place = LineInput::Serial(place);
                let (stream, opened) = columns_or_first_line(stream_of(text, &mut options)?, &place)?;
                Self::Lines(place, stream, opened)
            }
            Some(("pipe", place)) if !place.is_empty() => {
                let place = LineInput::Pipe(place.into());
                let (stream, opened) = columns_or_first_line(stream_of(text, &mut options)?, &place)?;
                Self::Lines(place, stream, opened)
            }
            None if input == "given" => match stream_of(text, &mut options)? {
                Some(stream) => Self::Given(stream),
                None => return Err(problem!("source {text:?}: needs columns=A:B:C").into()),
            },
            _ => {
                return Err(problem!(
                    "source {text:?}: must be udp:HOST:PORT, serial:PLACE@BAUD, pipe:PATH or given, then options after \
                     commas"
                )
                .into());
            }
        };
        match options.keys().next() {
            Some(key) => Err(problem!("source {text:?}: has no option {key:?}").into()),
            None => Ok(kind),
        }
    }
}

/// Parses an array of rows x columns, with the thesis' pitch.
fn array_of(text: &str, size: &str) -> Result<Array> {
    let sides = size.split_once('x').and_then(|(rows, columns)| Some((rows.parse().ok()?, columns.parse().ok()?)));
    let Some((rows, columns)) = sides else {
        return Err(problem!("source {text:?}: array {size:?} must be rows x columns, as 64x64").into());
    };
    let thesis = Array::thesis();
    if (rows, columns) == (thesis.rows, thesis.columns) {
        return Ok(thesis);
    }
    let array = Array { pitch_mm: thesis.pitch_mm, ..Array::unmeasured(rows, columns, size) };
    array.check()?;
    Ok(array)
}

/// The columns that the options define, if any.
fn stream_of(text: &str, options: &mut BTreeMap<&str, &str>) -> Result<Option<StreamColumns>> {
    let columns = options.remove("columns").map(|names| names.split(':').map(str::to_owned).collect());
    let time = options.remove("time");
    let Some(columns) = columns else {
        if time.is_some() {
            return Err(problem!("source {text:?}: time without columns").into());
        }
        return Ok(None);
    };
    let mut stream = StreamColumns::of_columns(columns);
    if let Some(time) = time {
        let (name, unit) = time.split_once(':').unwrap_or((time, "us"));
        let unit_us =
            [("ns", 1e-3), ("us", 1.0), ("ms", 1e3), ("s", 1e6)].into_iter().find(|(known, _)| *known == unit);
        let Some((_, unit_us)) = unit_us else {
            return Err(problem!("source {text:?}: unit {unit:?} must be ns, us, ms or s").into());
        };
        stream = StreamColumns { time: Some(name.to_owned()), unit_us, ..stream };
    }
    Ok(Some(stream))
}

/// The given columns, or those of the first line.
fn columns_or_first_line(named: Option<StreamColumns>, place: &LineInput) -> Result<(StreamColumns, Opened)> {
    named.map_or_else(|| first_line(place), |stream| Ok((stream, Opened::default())))
}

/// Opens lines and waits for the first one that defines the columns: a line of names, or of numbers, whose columns are
/// then named a, b, c and so on.
fn first_line(place: &LineInput) -> Result<(StreamColumns, Opened)> {
    let mut reader = LineReader::open(place)?;
    let until = Instant::now() + FIRST_LINE;
    // After opening, a serial line may start in the middle of a line: the rest of that line is skipped.
    let mut skip = matches!(place, LineInput::Serial(..));
    let mut numbers = None;
    while Instant::now() < until {
        let ended = reader.fill().map_err(|error| reader.broken(error))?;
        while let Some(line) = reader.lines.next(ended) {
            let TextLine { text, bytes, cut } = &line;
            if std::mem::take(&mut skip) {
                reader.lines.left_out.unfinished += bytes;
                continue;
            }
            // Neither numbers nor names.
            if *cut || text.contains(|c: char| c == char::REPLACEMENT_CHARACTER || (c.is_control() && c != '\t')) {
                reader.lines.left_out.in_no_line += bytes;
                continue;
            }
            let found: Vec<&str> = fields(text).collect();
            if found.is_empty() || text.starts_with('#') {
                continue;
            }
            if found.iter().all(|field| field.parse::<f64>().is_ok()) {
                numbers = Some(found.len());
                // The first line contains data, so it is processed again.
                reader.lines.put_back(&line);
                break;
            }
            let stream = StreamColumns::of_columns(found.into_iter().map(str::to_owned).collect());
            return Ok((stream, Opened(Arc::new(Mutex::new(Some(reader))))));
        }
        if numbers.is_some() || ended {
            break;
        }
    }
    match numbers {
        Some(n) => {
            let stream = StreamColumns::of_columns((0..n).map(|k| format!("column_{k}")).collect());
            Ok((stream, Opened(Arc::new(Mutex::new(Some(reader))))))
        }
        None => {
            let waited = FIRST_LINE.as_secs();
            reader.lines.discard();
            let left_out = reader.lines.take_left_out();
            let came = match left_out.in_no_line + left_out.unfinished {
                0 => String::new(),
                bytes => format!(" in the {bytes} bytes that came"),
            };
            Err(problem!("{place}: no line{came} within {waited} s; name its columns, as columns=t_us:ax:ay:az").into())
        }
    }
}

/// Lines of text from a serial line, a pipe or the standard input, as they arrive.
pub(super) struct LineReader {
    place: LineInput,
    input: Option<OpenInput>,
    pub(super) lines: TextLines,
    /// When the last bytes arrived, ns since 1970.
    pub(super) came_ns: i64,
}

enum OpenInput {
    Serial(SerialLine),
    Pipe(File),
}

impl LineReader {
    pub(super) fn open(place: &LineInput) -> Result<Self> {
        let input = Some(OpenInput::open(place)?);
        Ok(Self { place: place.clone(), input, lines: TextLines::new(LONGEST), came_ns: 0 })
    }

    pub(super) fn is_serial(&self) -> bool {
        matches!(self.place, LineInput::Serial(..))
    }

    /// Waits briefly for more bytes; returns whether no more can arrive.
    pub(super) fn fill(&mut self) -> io::Result<bool> {
        let mut piece = [0; 4096];
        let n = match &mut self.input {
            None => {
                std::thread::sleep(LOOK_EVERY);
                0
            }
            Some(OpenInput::Serial(line)) => line.read(&mut piece, LOOK_EVERY)?,
            Some(OpenInput::Pipe(file)) if is_readable(file.as_raw_fd(), LOOK_EVERY) => match file.read(&mut piece) {
                Ok(0) if self.place == LineInput::Pipe(PathBuf::from("-")) => return Ok(true),
                // A pipe without a writer, or the end of a file: a program may still write to it.
                Ok(0) => {
                    std::thread::sleep(LOOK_EVERY);
                    0
                }
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => 0,
                read => read?,
            },
            Some(OpenInput::Pipe(_)) => 0,
        };
        if n > 0 {
            self.came_ns = now_ns();
            self.lines.push(&piece[..n]);
        }
        Ok(false)
    }

    pub(super) fn broken(&self, error: io::Error) -> Error {
        match &self.place {
            LineInput::Serial(place) => Error::socket(place.name())(error),
            LineInput::Pipe(path) => Error::file(path)(error),
        }
    }

    /// Opens the line again, and leaves out an incomplete line.
    pub(super) fn reopen(&mut self) {
        self.lines.discard();
        // A port that is open is not opened again.
        self.input = None;
        self.input = OpenInput::open(&self.place).ok();
        if self.input.is_none() {
            std::thread::sleep(LOOK_EVERY);
            self.input = OpenInput::open(&self.place).ok();
        }
    }
}

impl OpenInput {
    fn open(place: &LineInput) -> Result<Self> {
        match place {
            LineInput::Serial(place) => SerialLine::open(place, CONNECT).map(Self::Serial),
            LineInput::Pipe(path) if path == Path::new("-") => {
                // Bypasses the program's own buffer, whose content `poll` does not see.
                let input = io::stdin().as_fd().try_clone_to_owned().map_err(Error::file(path))?;
                Ok(Self::Pipe(File::from(input)))
            }
            LineInput::Pipe(path) => {
                let file = File::options().read(true).custom_flags(libc::O_NONBLOCK).open(path);
                Ok(Self::Pipe(file.map_err(Error::file(path))?))
            }
        }
    }
}

/// Waits until data can be read, or the end was reached.
fn is_readable(descriptor: RawFd, most: Duration) -> bool {
    let mut asked = libc::pollfd { fd: descriptor, events: libc::POLLIN, revents: 0 };
    let most = i32::try_from(most.as_millis()).unwrap_or(i32::MAX);
    // SAFETY: one entry, on our stack, of a descriptor that the caller holds open.
    unsafe { libc::poll(&raw mut asked, 1, most) > 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sources_are_read_as_they_are_written() {
        let board: SourceKind = "udp:127.0.0.1:5209,array=16x8,preset=2 kHz".parse().unwrap();
        let SourceKind::Board(address, array, _) = &board else { panic!("{board:?}") };
        assert_eq!((address.port(), array.rows, array.columns), (5209, 16, 8));
        let imu: SourceKind = "serial:/dev/ttyACM0@9600,columns=n:ax:ay,time=n:ms".parse().unwrap();
        let SourceKind::Lines(LineInput::Serial(place), stream, _) = &imu else { panic!("{imu:?}") };
        assert_eq!(*place, SerialPlace::Port("/dev/ttyACM0".to_owned(), 9600));
        assert_eq!((stream.time.as_deref(), stream.unit_us), (Some("n"), 1e3));
        for text in [
            "",
            "udp:5209",
            "udp:127.0.0.1:5209,array=16",
            "udp:127.0.0.1:5209,columns=a",
            "serial:/dev/x@fast,columns=a",
            "serial:ttyACM0,columns=a",
            "serial:/dev/x,columns=a,time=a:h",
            "given",
            "given,columns=a,rate=4",
            "given,columns",
            "pipe:,columns=a",
        ] {
            assert!(text.parse::<SourceKind>().is_err(), "{text}");
        }
    }
}
