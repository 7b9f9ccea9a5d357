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

use super::sending::{BAUD, serial};
use crate::locked::lock;
use crate::recording::{Header, LeftOut, StreamColumns, fields, now_ns};
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
    /// A serial line and its speed, 8 data bits, no parity, 1 stop bit.
    Serial(PathBuf, u32),
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
            Self::Serial(path, baud) => write!(f, "serial {}@{baud}", path.display()),
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

/// Parses `udp:HOST:PORT`, `serial:PATH@BAUD`, `pipe:PATH` or `given`, followed by options after commas: `array=RxC`
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
                let (path, baud) = match place.rsplit_once('@') {
                    None => (place, BAUD),
                    Some((path, baud)) => match baud.parse() {
                        Ok(baud) if baud > 0 => (path, baud),
                        _ => return Err(problem!("source {text:?}: {baud:?} is no speed, as 115200").into()),
                    },
                };
                let place = LineInput::Serial(path.into(), baud);
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
                    "source {text:?}: must be udp:HOST:PORT, serial:PATH@BAUD, pipe:PATH or given, then options after \
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
        while let Some(TextLine { text, bytes, cut }) = reader.line(ended) {
            if std::mem::take(&mut skip) {
                reader.left_out.unfinished += bytes;
                continue;
            }
            // Neither numbers nor names.
            if cut || text.contains(|c: char| c == char::REPLACEMENT_CHARACTER || (c.is_control() && c != '\t')) {
                reader.left_out.in_no_line += bytes;
                continue;
            }
            let found: Vec<&str> = fields(&text).collect();
            if found.is_empty() || text.starts_with('#') {
                continue;
            }
            if found.iter().all(|field| field.parse::<f64>().is_ok()) {
                numbers = Some(found.len());
                // The first line contains data, so it is processed again.
                reader.bytes.splice(0..0, format!("{text}\n").into_bytes());
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
            let came = match reader.bytes.len() as u64 + reader.left_out.in_no_line + reader.left_out.unfinished {
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
    file: Option<Box<dyn ReadsAsItComes>>,
    /// What arrived after the last line: at most a line and what one read returns.
    bytes: Vec<u8>,
    /// Number of these bytes that hold no end of a line.
    searched: usize,
    /// Whether they continue a line of which the beginning was returned, as it is too long.
    cut: bool,
    left_out: LeftOut,
    /// When the last bytes arrived, ns since 1970.
    pub(super) came_ns: i64,
}

/// A line of text, without its end.
pub(super) struct TextLine {
    pub(super) text: String,
    /// Number of its bytes.
    pub(super) bytes: u64,
    /// Whether this is only the beginning of a line that is too long.
    pub(super) cut: bool,
}

trait ReadsAsItComes: Read + AsRawFd + Send {}
impl<T: Read + AsRawFd + Send> ReadsAsItComes for T {}

impl LineReader {
    pub(super) fn open(place: &LineInput) -> Result<Self> {
        let file = Some(open(place)?);
        let left_out = LeftOut::default();
        Ok(Self { place: place.clone(), file, bytes: vec![], searched: 0, cut: false, left_out, came_ns: 0 })
    }

    pub(super) fn is_serial(&self) -> bool {
        matches!(self.place, LineInput::Serial(..))
    }

    /// Waits briefly for more bytes; returns whether no more can arrive.
    pub(super) fn fill(&mut self) -> io::Result<bool> {
        let is_input = self.place == LineInput::Pipe(PathBuf::from("-"));
        let Some(file) = &mut self.file else {
            std::thread::sleep(LOOK_EVERY);
            return Ok(false);
        };
        if !is_readable(file.as_raw_fd(), LOOK_EVERY) {
            return Ok(false);
        }
        let mut piece = [0; 4096];
        match file.read(&mut piece) {
            // A pipe without a writer, or the end of a file: a program may still write to it.
            Ok(0) if is_input => return Ok(true),
            Ok(0) if matches!(self.place, LineInput::Serial(..)) => return Err(ErrorKind::BrokenPipe.into()),
            Ok(0) => std::thread::sleep(LOOK_EVERY),
            Ok(n) => {
                self.came_ns = now_ns();
                self.bytes.extend_from_slice(&piece[..n]);
            }
            Err(error)
                if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
            Err(error) => return Err(error),
        }
        Ok(false)
    }

    /// The next line, which a line feed or a carriage return ends; the last one may lack its end where no more can arrive
    /// (`ended`). Of a line that is too long the beginning is returned, and the rest is left out.
    pub(super) fn line(&mut self, ended: bool) -> Option<TextLine> {
        loop {
            let end = self.bytes[self.searched..].iter().position(|byte| matches!(byte, b'\n' | b'\r'));
            let end = end.map(|place| self.searched + place);
            let length = end.unwrap_or(self.bytes.len());
            if self.cut {
                self.left_out.in_no_line += length as u64;
                self.cut = end.is_none();
                self.remove(end.map_or(length, |end| end + 1));
                if self.cut {
                    return None;
                }
                continue;
            }
            let long = length > LONGEST;
            if end.is_none() && !long && !(ended && length > 0) {
                self.searched = length;
                return None;
            }
            let length = length.min(LONGEST);
            let text = String::from_utf8_lossy(&self.bytes[..length]).into_owned();
            self.cut = long;
            self.remove(if long { length } else { end.map_or(length, |end| end + 1) });
            return Some(TextLine { text, bytes: length as u64, cut: long });
        }
    }

    fn remove(&mut self, bytes: usize) {
        self.bytes.drain(..bytes);
        self.searched = 0;
    }

    /// The bytes that were left out since the last call; at the end (`last`) with those of the line that has not ended.
    pub(super) fn take_left_out(&mut self, last: bool) -> LeftOut {
        if last {
            self.discard();
        }
        std::mem::take(&mut self.left_out)
    }

    /// Leaves out what arrived of a line that has not ended.
    fn discard(&mut self) {
        let place = if self.cut { &mut self.left_out.in_no_line } else { &mut self.left_out.unfinished };
        *place += self.bytes.len() as u64;
        self.remove(self.bytes.len());
        self.cut = false;
    }

    pub(super) fn broken(&self, error: io::Error) -> Error {
        let (LineInput::Serial(path, _) | LineInput::Pipe(path)) = &self.place;
        Error::file(path)(error)
    }

    /// Opens the line again, and leaves out an incomplete line.
    pub(super) fn reopen(&mut self) {
        self.discard();
        self.file = open(&self.place).ok();
        if self.file.is_none() {
            std::thread::sleep(LOOK_EVERY);
            self.file = open(&self.place).ok();
        }
    }
}

fn open(place: &LineInput) -> Result<Box<dyn ReadsAsItComes>> {
    match place {
        LineInput::Serial(path, baud) => Ok(Box::new(serial(path, *baud)?)),
        LineInput::Pipe(path) if path == Path::new("-") => {
            // Bypasses the program's own buffer, whose content `poll` does not see.
            let input = io::stdin().as_fd().try_clone_to_owned().map_err(Error::file(path))?;
            Ok(Box::new(File::from(input)))
        }
        LineInput::Pipe(path) => {
            let file = File::options().read(true).custom_flags(libc::O_NONBLOCK).open(path);
            Ok(Box::new(file.map_err(Error::file(path))?))
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
    use rand::rngs::StdRng;
    use rand::{Rng, SeedableRng};

    use super::*;

    #[test]
    fn sources_are_read_as_they_are_written() {
        let board: SourceKind = "udp:127.0.0.1:5209,array=16x8,preset=2 kHz".parse().unwrap();
        let SourceKind::Board(address, array, _) = &board else { panic!("{board:?}") };
        assert_eq!((address.port(), array.rows, array.columns), (5209, 16, 8));
        let imu: SourceKind = "serial:/dev/ttyACM0@9600,columns=n:ax:ay,time=n:ms".parse().unwrap();
        let SourceKind::Lines(LineInput::Serial(path, 9600), stream, _) = &imu else { panic!("{imu:?}") };
        assert_eq!(path, Path::new("/dev/ttyACM0"));
        assert_eq!((stream.time.as_deref(), stream.unit_us), (Some("n"), 1e3));
        for text in [
            "",
            "udp:5209",
            "udp:127.0.0.1:5209,array=16",
            "udp:127.0.0.1:5209,columns=a",
            "serial:/dev/x@fast,columns=a",
            "serial:/dev/x,columns=a,time=a:h",
            "given",
            "given,columns=a,rate=4",
            "given,columns",
            "pipe:,columns=a",
        ] {
            assert!(text.parse::<SourceKind>().is_err(), "{text}");
        }
    }

    /// The lines of bytes by their definition, each with whether it is only a beginning, and what is left out.
    fn split(bytes: &[u8]) -> (Vec<(Vec<u8>, bool)>, LeftOut) {
        let (mut lines, mut left_out) = (vec![], LeftOut::default());
        let mut parts: Vec<&[u8]> = bytes.split(|byte| matches!(byte, b'\n' | b'\r')).collect();
        let last = parts.pop().unwrap_or_default();
        for line in parts {
            lines.push((line[..line.len().min(LONGEST)].to_vec(), line.len() > LONGEST));
            left_out.in_no_line += line.len().saturating_sub(LONGEST) as u64;
        }
        if last.len() > LONGEST {
            lines.push((last[..LONGEST].to_vec(), true));
            left_out.in_no_line += (last.len() - LONGEST) as u64;
        } else {
            left_out.unfinished = last.len() as u64;
        }
        (lines, left_out)
    }

    #[test]
    fn each_byte_that_comes_is_in_a_line_or_counted_and_few_are_held() {
        let folder = std::env::temp_dir().join(format!("taxel-lines-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        for seed in 0..30 {
            let mut random = StdRng::seed_from_u64(seed);
            let mut bytes: Vec<u8> = vec![];
            for _ in 0..random.random_range(0..20) {
                let near = LONGEST + random.random_range(0..3) - 1;
                let length = [random.random_range(0..20), 5000, near, 300_000][random.random_range(0..4)];
                match random.random_range(0..4) {
                    0 => bytes.extend((0..length).map(|_| random.random::<u8>())),
                    kind => bytes.extend(std::iter::repeat_n([b'1', 0, 0xff][kind - 1], length)),
                }
                bytes.extend([&b"\n"[..], b"\r\n", b"\r", b""][random.random_range(0..4)]);
            }
            let path = folder.join(format!("{seed}"));
            std::fs::write(&path, &bytes).unwrap();
            let mut reader = LineReader::open(&LineInput::Pipe(path)).unwrap();
            let (mut lines, mut left_out, mut read) = (vec![], LeftOut::default(), 0);
            while read < bytes.len() {
                read += (bytes.len() - read).min(4096);
                assert!(!reader.fill().unwrap());
                while let Some(line) = reader.line(false) {
                    lines.push((line.text, line.bytes, line.cut));
                }
                assert!(reader.bytes.capacity() <= 4 * LONGEST, "seed {seed}: {}", reader.bytes.capacity());
                let more = reader.take_left_out(read == bytes.len());
                left_out.in_no_line += more.in_no_line;
                left_out.unfinished += more.unfinished;
            }
            let (expected, of_rest) = split(&bytes);
            let text = |line: &[u8]| String::from_utf8_lossy(line).into_owned();
            let expected: Vec<_> = expected.iter().map(|(line, cut)| (text(line), line.len() as u64, *cut)).collect();
            assert!(lines == expected, "seed {seed}");
            assert_eq!(left_out, of_rest, "seed {seed}");
        }
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
