//! The text that names a source, `[NAME=]KIND:PLACE[,KEY=VALUE...]`, and the source that is opened of it: a board, frames
//! of numbers, or lines of numbers.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::str::FromStr;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use taxel_core::array::Pitch;
use taxel_core::wire::Registers;
use taxel_core::{Array, Stop, problem};

use crate::frame_lines::{FrameAssembler, FrameEnd, FrameLayout};
use crate::line_input::LineReader;
use crate::line_place::LinePlace;
use crate::locked::lock;
use crate::recording::{Header, StreamColumns, UNITS_US, cells, clock_unit_us, date, now_ns, number};
use crate::text_lines::TextLine;
use crate::{Error, Result, address};

/// Timeout for the first line of a source, which defines its columns, if they are not given.
const FIRST_LINE: Duration = Duration::from_secs(3);

/// The time from one frame to the next is measured until so many arrived, or for so long from the first one.
const MEASURED_FRAMES: usize = 32;
const MEASURE: Duration = Duration::from_secs(1);

/// The unit of a column of dates.
pub(super) const DATES: &str = "iso";

/// How a source is written, for errors.
const FORMS: &str = "[NAME=]board:HOST:PORT, serial:PLACE, lines:PATH (- is the standard input), lines+tcp:HOST:PORT, \
                     lines+udp:HOST:PORT or given, and KEY=VALUE after commas";

/// The options of a source that is no board, for errors.
const OPTIONS: &str =
    "array=ROWSxCOLUMNS, time, columns, leave_out, frame_lines, frame_end, unit, falls and rate (baud of serial:)";

/// A source as a text states it.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceText {
    /// The text.
    pub text: String,
    /// Its name, if it is stated.
    pub name: Option<String>,
    /// Where it is.
    pub place: SourcePlace,
    array: Option<Array>,
    columns: Option<Vec<String>>,
    time: Option<StatedTime>,
    end: Option<FrameEnd>,
    leave_out: Vec<String>,
    unit: Option<String>,
    turned: Option<f64>,
    rate_hz: Option<f64>,
}

/// Where a source is.
#[derive(Debug, Clone, PartialEq)]
pub enum SourcePlace {
    /// A board that sends to this local address, and the preset of its registers.
    Board(SocketAddr, String),
    /// Lines of text.
    Lines(LinePlace),
    /// A program passes numbers ([`Live::sample`](super::Live::sample)).
    Given,
}

/// The column of a source's clock.
#[derive(Debug, Clone, PartialEq)]
enum StatedTime {
    /// A column, and its unit, us; by its name where none is stated.
    Column(String, Option<f64>),
    /// A column of dates, or of times of a day.
    Dates(String),
    /// A column of seconds and one of nanoseconds, which are added.
    Sum(String, String),
}

/// A source with its name.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedSource {
    /// Name of the source.
    pub name: String,
    /// Kind of the source.
    pub kind: SourceKind,
}

/// The kind of a source.
#[derive(Debug, Clone, PartialEq)]
pub enum SourceKind {
    /// A board that sends to this local address.
    Board(SocketAddr, Box<Array>, Registers),
    /// Frames of numbers, from lines or, without them, from a program.
    Frames(Option<LinePlace>, Box<FrameLayout>, Opened),
    /// Lines of numbers that are no frames, as of an IMU; from a program if there are none.
    Numbers(Option<LinePlace>, StreamColumns, Opened),
}

/// Lines that were opened to read their columns, with what arrived so far. The reader continues there: reopening would
/// lose it, and closing a pipe ends the program that writes to it.
#[derive(Clone, Default)]
pub struct Opened(Arc<Mutex<Option<OpenedLines>>>);

/// An open reader, and the lines that were read to find their columns.
pub struct OpenedLines {
    pub(super) reader: LineReader,
    pub(super) begun: Vec<(TextLine, i64)>,
    /// Whether no more can arrive.
    has_ended: bool,
}

/// What the first line of a source shows.
struct FirstLine {
    columns: Vec<String>,
    /// The columns that hold dates, or times of a day.
    dated: Vec<usize>,
}

/// How long a source of lines may be silent before its first line.
#[derive(Clone, Copy)]
pub struct FirstLineWait<'a> {
    /// So long at most.
    pub most: Duration,
    /// What ends the wait.
    pub stop: Stop<'a>,
}

impl Default for FirstLineWait<'_> {
    fn default() -> Self {
        Self { most: FIRST_LINE, stop: Stop::never() }
    }
}

impl Opened {
    fn from_lines(lines: OpenedLines) -> Self {
        Self(Arc::new(Mutex::new(Some(lines))))
    }

    /// The open lines, or those of a place that is opened now.
    pub(super) fn take_or_open(&self, place: &LinePlace) -> Result<OpenedLines> {
        let opened = lock(&self.0).take();
        opened.map_or_else(|| OpenedLines::open(place), Ok)
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

impl NamedSource {
    /// The source's header in the recording.
    pub(super) fn header(&self) -> taxel_core::Result<Header> {
        let place = |input: &Option<LinePlace>| {
            input.as_ref().map_or_else(|| "given by a program".to_owned(), ToString::to_string)
        };
        match &self.kind {
            SourceKind::Board(address, array, registers) => {
                let board = Header::of_board((**array).clone(), Some(*registers), format!("udp {address}"), now_ns());
                Ok(Header { name: self.name.clone(), ..board })
            }
            SourceKind::Frames(input, layout, _) => {
                Header::of_frames(&self.name, layout.array.clone(), layout.properties(), place(input), now_ns())
            }
            SourceKind::Numbers(input, stream, _) => {
                Header::of_stream(&self.name, stream.clone(), place(input), now_ns())
            }
        }
    }
}

impl FromStr for SourceText {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let refused = |reason: String| -> Error { problem!("source {text:?}: {reason}").into() };
        let mut parts = text.split(',');
        let head = parts.next().unwrap_or_default();
        let kind_end = head.find(':').unwrap_or(head.len());
        let (name, head) = match head[..kind_end].split_once('=') {
            Some((name, _)) => (Some(name.trim().to_owned()), &head[name.len() + 1..]),
            None => (None, head),
        };
        let mut options = BTreeMap::new();
        for part in parts {
            let Some((key, value)) = part.split_once('=') else {
                return Err(refused(format!("{part:?} must be KEY=VALUE")));
            };
            options.insert(key.trim(), value.trim());
        }
        let is_board = head.starts_with("board:");
        let array = options.remove("array").map(|size| array_of(text, size, is_board)).transpose()?;
        let in_text = |error: Error| error.in_part(&format!("source {text:?}"));
        let place = match head.split_once(':') {
            Some(("board", place)) => {
                let preset = options.remove("preset").unwrap_or("5.2 kHz").to_owned();
                SourcePlace::Board(address::of_text(place)?, preset)
            }
            None if head == "given" => SourcePlace::Given,
            _ => match LinePlace::parse(head, &mut options).map_err(in_text)? {
                Some(place) => SourcePlace::Lines(place),
                None if is_serial_port(head) => return Err(refused(format!("a serial port is serial:{head}"))),
                None => return Err(refused(format!("must be {FORMS}"))),
            },
        };
        let mut take = |key: &str| options.remove(key).map(str::to_owned);
        let number = |key: &str, value: Option<String>| -> Result<Option<f64>> {
            let parsed = value.map(|value| {
                let number = value.parse::<f64>().ok().filter(|number| number.is_finite());
                number.ok_or_else(|| refused(format!("{key} is {value:?}: must be a number")))
            });
            parsed.transpose()
        };
        let listed = |value: Option<String>| value.map(|names| names.split(':').map(str::to_owned).collect());
        let mut source = Self {
            text: text.to_owned(),
            name,
            place,
            array,
            columns: None,
            time: None,
            end: None,
            leave_out: vec![],
            unit: None,
            turned: None,
            rate_hz: None,
        };
        if !matches!(source.place, SourcePlace::Board(..)) {
            source.columns = listed(take("columns"));
            source.time = take("time").map(|time| StatedTime::parse(text, &time)).transpose()?;
            source.leave_out = listed(take("leave_out")).unwrap_or_default();
            source.unit = take("unit");
            source.turned = match take("falls") {
                Some(falls) if falls == "true" => Some(0.0),
                Some(falls) if falls == "false" => None,
                Some(falls) if falls.parse::<f64>().is_err() => {
                    return Err(refused(format!("falls is {falls:?}: must be true, false or a number")));
                }
                falls => number("falls", falls)?,
            };
            source.rate_hz = number("rate", take("rate"))?;
            source.end = match (take("frame_lines"), take("frame_end")) {
                (Some(_), Some(_)) => {
                    return Err(refused("frame_lines and frame_end are both given: give only one of them".to_owned()));
                }
                (Some(lines), None) => match lines.parse() {
                    Ok(lines @ 1..=65_535) => Some(FrameEnd::Lines(lines)),
                    _ => return Err(refused(format!("frame_lines is {lines:?}: must be a number from 1 to 65535"))),
                },
                (None, Some(end)) if end == "blank" => Some(FrameEnd::EmptyLine),
                (None, Some(end)) => return Err(refused(format!("frame_end is {end:?}: must be blank"))),
                (None, None) => None,
            };
            if source.unit.as_ref().is_some_and(String::is_empty) {
                return Err(refused("unit is empty: must be the unit of the values, for example N or kPa".to_owned()));
            }
            if let Some(rate_hz) = source.rate_hz.filter(|rate_hz| !(1e6 / 3.6e9..=1e6).contains(rate_hz)) {
                return Err(refused(format!("rate is {rate_hz} Hz: must be from 1 per hour to 1000000")));
            }
        }
        match options.keys().next() {
            Some(key) => Err(refused(format!("has no option {key:?}; the options are {OPTIONS}"))),
            None => Ok(source),
        }
    }
}

impl StatedTime {
    fn parse(source: &str, text: &str) -> Result<Self> {
        if let Some((seconds, nanoseconds)) = text.split_once('+') {
            return Ok(Self::Sum(seconds.to_owned(), nanoseconds.to_owned()));
        }
        let Some((column, unit)) = text.split_once(':') else { return Ok(Self::Column(text.to_owned(), None)) };
        match UNITS_US.into_iter().find(|(known, _)| *known == unit) {
            Some((_, unit_us)) => Ok(Self::Column(column.to_owned(), Some(unit_us))),
            None if unit == DATES => Ok(Self::Dates(column.to_owned())),
            None => Err(problem!("source {source:?}: unit {unit:?} must be ns, us, ms, s or {DATES}").into()),
        }
    }
}

impl SourceText {
    /// Whether it is a board.
    #[must_use]
    pub fn is_board(&self) -> bool {
        matches!(self.place, SourcePlace::Board(..))
    }

    /// Whether its array is stated.
    pub(super) fn states_array(&self) -> bool {
        self.array.is_some()
    }

    /// The name, or that of the kind.
    #[must_use]
    pub fn name(&self) -> String {
        self.name.clone().unwrap_or_else(|| match (&self.place, self.frames_are_stated()) {
            (SourcePlace::Board(..), _) => "board".to_owned(),
            (_, true) => "frames".to_owned(),
            (_, false) => "numbers".to_owned(),
        })
    }

    /// Whether its lines are stated to be frames of an array.
    fn frames_are_stated(&self) -> bool {
        self.array.is_some() || self.end.is_some()
    }

    /// Opens the source. Lines are frames where an array is stated and where `readout_array` is given, that is, where they
    /// are read out and shown: without a stated array they are of that of the readout if it has as many taxels as a line
    /// has values, else of one row.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` if what is stated does not fit the lines, or if what arrives does not show the columns or the rate that
    /// are not stated; `File` or `Socket` if the place cannot be opened; `Core(Interrupted)` if asked to stop.
    pub fn open(&self, readout_array: Option<&Option<Array>>, wait: FirstLineWait<'_>) -> Result<SourceKind> {
        let input = match &self.place {
            SourcePlace::Board(address, preset) => {
                let array = self.array.clone().unwrap_or_else(Array::thesis);
                let registers = Registers::preset_on(preset, &array)?;
                return Ok(SourceKind::Board(*address, Box::new(array), registers));
            }
            SourcePlace::Lines(input) => Some(input.clone()),
            SourcePlace::Given => None,
        };
        let in_text = |error: Error| error.in_part(&format!("source {:?}", self.text));
        if readout_array.is_some() || self.frames_are_stated() {
            let (layout, opened) =
                self.frames(input.as_ref(), readout_array.and_then(Option::as_ref), wait).map_err(in_text)?;
            return Ok(SourceKind::Frames(input, Box::new(layout), opened));
        }
        let (first, opened) = self.columns_or_first_line(input.as_ref(), wait)?;
        let waited = input.as_ref().is_some_and(LinePlace::is_regular_file);
        let stream = StreamColumns { waited, ..self.stream(first).map_err(in_text)? };
        Ok(SourceKind::Numbers(input, stream, opened))
    }

    /// The columns that are stated, or those of the first line.
    fn columns_or_first_line(&self, input: Option<&LinePlace>, wait: FirstLineWait<'_>) -> Result<(FirstLine, Opened)> {
        match (&self.columns, input) {
            (Some(columns), _) => Ok((FirstLine { columns: columns.clone(), dated: vec![] }, Opened::default())),
            (None, None) => Err(problem!("source {:?}: needs columns=A:B:C", self.text).into()),
            (None, Some(input)) => {
                let mut lines = OpenedLines::open(input)?;
                lines.wait(wait)?;
                match lines.first(self)? {
                    Some(first) => Ok((first, Opened::from_lines(lines))),
                    None => Err(lines.nothing(self, 0, None)),
                }
            }
        }
    }

    /// The columns of lines of numbers that are no frames.
    fn stream(&self, first: FirstLine) -> Result<StreamColumns> {
        for (is_stated, key) in [
            (!self.leave_out.is_empty(), "leave_out"),
            (self.unit.is_some(), "unit"),
            (self.turned.is_some(), "falls"),
            (self.rate_hz.is_some(), "rate"),
        ] {
            if is_stated {
                return Err(problem!("{key} is only for frames: add array=ROWSxCOLUMNS").into());
            }
        }
        let stream = StreamColumns::of_columns(first.columns);
        let of_dates = |column: usize| {
            let time = Some(stream.columns[column].clone());
            StreamColumns { time, unit_us: 1e6, dates: true, ..stream.clone() }
        };
        match first.dated[..] {
            [] => {}
            [column] => return Ok(of_dates(column)),
            _ => {
                return Err(problem!("dates in several columns are only for frames: add array=ROWSxCOLUMNS").into());
            }
        }
        Ok(match &self.time {
            None => stream,
            Some(StatedTime::Column(column, unit_us)) => {
                let name = stream.columns[index_of("time", column, &stream.columns)?].clone();
                let unit_us = unit_us.or_else(|| clock_unit_us(&name)).unwrap_or(1.0);
                StreamColumns { time: Some(name), unit_us, ..stream }
            }
            Some(StatedTime::Dates(column)) => of_dates(index_of("time", column, &stream.columns)?),
            Some(StatedTime::Sum(..)) => {
                return Err(problem!("time=A+B is only for frames: add array=ROWSxCOLUMNS").into());
            }
        })
    }

    /// How the lines make frames, with what was read to find it.
    fn frames(
        &self,
        input: Option<&LinePlace>,
        readout_array: Option<&Array>,
        wait: FirstLineWait<'_>,
    ) -> Result<(FrameLayout, Opened)> {
        let end = self.end.unwrap_or(FrameEnd::Lines(1));
        let mut opened = None;
        let without_dates = |columns: Vec<String>| FirstLine { columns, dated: vec![] };
        let FirstLine { columns, dated } = match (&self.columns, input) {
            (Some(columns), _) => without_dates(columns.clone()),
            // What is stated says how many numbers a line has, if all of them are values of one row.
            (None, None) => without_dates(self.columns_of_array(end)?),
            (None, Some(input)) => {
                let mut lines = OpenedLines::open(input)?;
                // A source of which all is stated need not have sent anything.
                let stated = self.columns_of_array(end).ok().filter(|columns| {
                    self.rate_hz.is_some() && self.clock(columns, &[]).is_ok() && self.left_out(columns).is_ok()
                });
                if stated.is_none() {
                    lines.wait(wait)?;
                }
                let first = lines.first(self)?;
                let stated = stated.filter(|_| !lines.has_ended && lines.reader.came_ns == 0).map(without_dates);
                let Some(columns) = first.or(stated) else { return Err(lines.nothing(self, 0, None)) };
                opened = Some(lines);
                columns
            }
        };
        let (time, dates) = self.clock(&columns, &dated)?;
        let left = self.left_out(&columns)?;
        let is_value = |field: &usize| !left.contains(field) && time.iter().all(|(clock, _)| clock != field);
        let values: Vec<usize> = (0..columns.len()).filter(is_value).collect();
        if values.is_empty() {
            return Err(problem!(
                "a line of {} columns has no column of values, only its time and columns that are left out",
                columns.len()
            )
            .into());
        }
        let array = self.array_for(values.len(), end, readout_array)?;
        let is_named = self.columns.is_some() || !columns.iter().enumerate().all(|(k, name)| *name == numbered(k));
        let has_quantities = is_named && self.array.is_none() && array.rows == 1;
        let mut layout = FrameLayout {
            fields: columns.len(),
            names: if has_quantities { values.iter().map(|&k| columns[k].clone()).collect() } else { vec![] },
            array,
            time,
            dates,
            values,
            end,
            turned: self.turned,
            unit: self.unit.clone().unwrap_or_else(|| "counts".to_owned()),
            unit_is_stated: self.unit.is_some(),
            frame_us: self.rate_hz.map_or(1.0, |rate_hz| 1e6 / rate_hz),
            waited: input.is_some_and(LinePlace::is_regular_file),
        };
        layout.check()?;
        if self.rate_hz.is_none() {
            let Some(input) = input else {
                return Err(
                    problem!("rate=HZ is missing: it states how many frames per second the program passes").into()
                );
            };
            let mut lines = opened.map_or_else(|| OpenedLines::open(input), Ok)?;
            lines.wait(wait)?;
            layout.frame_us = lines.frame_us(&layout, self)?;
            layout.check()?;
            opened = Some(lines);
        }
        Ok((layout, opened.map(Opened::from_lines).unwrap_or_default()))
    }

    /// The columns that are left out.
    fn left_out(&self, columns: &[String]) -> taxel_core::Result<Vec<usize>> {
        self.leave_out.iter().map(|column| index_of("leave_out", column, columns)).collect()
    }

    /// The columns of lines without names that fill the stated array.
    fn columns_of_array(&self, end: FrameEnd) -> Result<Vec<String>> {
        let (Some(array), FrameEnd::Lines(lines)) = (&self.array, end) else {
            return Err(problem!("needs array=ROWSxCOLUMNS or columns=A:B:C").into());
        };
        let clocks = match &self.time {
            None => 0,
            Some(StatedTime::Column(..) | StatedTime::Dates(_)) => 1,
            Some(StatedTime::Sum(..)) => 2,
        };
        let columns = array.len() / lines + clocks + self.leave_out.len();
        Ok((0..columns).map(numbered).collect())
    }

    /// Whether a column may hold dates: one of the stated clock without a unit, or any where no clock is stated.
    fn may_be_dated(&self, column: usize, columns: &[String]) -> bool {
        let is = |stated: &String| index_of("", stated, columns) == Ok(column);
        match &self.time {
            None => columns.iter().all(|name| clock_unit_us(name).is_none()),
            Some(StatedTime::Column(stated, unit_us)) => unit_us.is_none() && is(stated),
            Some(StatedTime::Dates(stated)) => is(stated),
            Some(StatedTime::Sum(a, b)) => is(a) || is(b),
        }
    }

    /// The fields of the clock, each with its unit, us, and whether they hold dates, as the fields do that the first line shows
    /// to be `dated`; a date and a time of the day in two fields are added.
    fn clock(&self, columns: &[String], dated: &[usize]) -> taxel_core::Result<(Vec<(usize, f64)>, bool)> {
        if !dated.is_empty() {
            return Ok((dated.iter().map(|&field| (field, 1e6)).collect(), true));
        }
        let time = match &self.time {
            Some(StatedTime::Dates(column)) => return Ok((vec![(index_of("time", column, columns)?, 1e6)], true)),
            Some(StatedTime::Column(column, unit_us)) => {
                let field = index_of("time", column, columns)?;
                let Some(unit_us) = unit_us.or_else(|| clock_unit_us(&columns[field])) else {
                    return Err(problem!(
                        "time={column}: the unit is missing; add it, for example time={column}:ms, or \
                         time={column}:{DATES} for dates"
                    ));
                };
                vec![(field, unit_us)]
            }
            Some(StatedTime::Sum(seconds, nanoseconds)) => {
                vec![(index_of("time", seconds, columns)?, 1e6), (index_of("time", nanoseconds, columns)?, 1e-3)]
            }
            None => {
                let found = columns.iter().enumerate().find_map(|(field, name)| Some((field, clock_unit_us(name)?)));
                found.into_iter().collect()
            }
        };
        Ok((time, false))
    }

    /// The stated array, or the one that lines of so many values fill.
    fn array_for(&self, values: usize, end: FrameEnd, readout_array: Option<&Array>) -> Result<Array> {
        if let Some(array) = &self.array {
            return Ok(array.clone());
        }
        let FrameEnd::Lines(lines) = end else {
            return Err(problem!("frame_end=blank: add array=ROWSxCOLUMNS").into());
        };
        if let Some(array) = readout_array.filter(|array| array.len() == values * lines) {
            // Its name is that of the recording that the readout was trained on.
            return Ok(Array { name: self.name(), ..array.clone() });
        }
        let side = |n: usize| u16::try_from(n).map_err(|_| problem!("a line has {n} values: must be at most 65535"));
        let (rows, columns) = (side(lines)?, side(values)?);
        Ok(Array::unmeasured(rows, columns, &self.name()))
    }
}

/// Whether a text is the name of a serial port without its kind.
fn is_serial_port(text: &str) -> bool {
    let number = text.strip_prefix("COM").or_else(|| text.strip_prefix("com"));
    text.starts_with("/dev/") || number.is_some_and(|number| number.parse::<u16>().is_ok())
}

/// The name of a column without one.
fn numbered(column: usize) -> String {
    format!("column_{column}")
}

/// The index of a column that is named, or numbered from 1.
fn index_of(key: &str, column: &str, columns: &[String]) -> taxel_core::Result<usize> {
    if let Some(index) = columns.iter().position(|name| name == column) {
        return Ok(index);
    }
    match column.parse::<usize>() {
        Ok(number) if (1..=columns.len()).contains(&number) => Ok(number - 1),
        Ok(_) => Err(problem!("{key}={column}: a line has {} columns", columns.len())),
        Err(_) => Err(problem!("{key}={column}: this column is missing; the columns are {}", columns.join(", "))),
    }
}

/// Parses an array of rows x columns, with or without a pitch, mm; without one that of a board is the thesis', and that of other
/// sensors is unknown.
fn array_of(text: &str, size: &str, is_board: bool) -> Result<Array> {
    let wrong = || {
        problem!(
            "source {text:?}: array {size:?} must be rows x columns, for example 64x64, or with a pitch, for example \
             64x64x5"
        )
    };
    let sides: Vec<&str> = size.split('x').collect();
    let (rows, columns, pitch_mm) = match sides[..] {
        [rows, columns] => (rows, columns, None),
        [rows, columns, pitch] => (rows, columns, Some(pitch.parse::<f64>().map_err(|_| wrong())?)),
        _ => return Err(wrong().into()),
    };
    let (rows, columns) = (rows.parse().map_err(|_| wrong())?, columns.parse().map_err(|_| wrong())?);
    let thesis = Array::thesis();
    if is_board && pitch_mm.is_none() && (rows, columns) == (thesis.rows, thesis.columns) {
        return Ok(thesis);
    }
    let pitch_mm = pitch_mm.map(Pitch::square).or(thesis.pitch_mm.filter(|_| is_board));
    let array = Array { pitch_mm, ..Array::unmeasured(rows, columns, size) };
    array.check()?;
    Ok(array)
}

impl OpenedLines {
    fn open(input: &LinePlace) -> Result<Self> {
        Ok(Self { reader: LineReader::open(input)?, begun: vec![], has_ended: false })
    }

    /// Waits until something arrives, or the input ends.
    fn wait(&mut self, wait: FirstLineWait<'_>) -> Result<()> {
        let begun = Instant::now();
        while self.reader.came_ns == 0 && !self.has_ended {
            if begun.elapsed() >= wait.most {
                let seconds = begun.elapsed().as_secs();
                return Err(problem!("{}: no line arrived within {seconds} s", self.reader.place()).into());
            }
            wait.stop.check()?;
            self.fill()?;
        }
        Ok(())
    }

    fn fill(&mut self) -> Result<()> {
        self.has_ended |= self.reader.fill().map_err(|error| self.reader.broken(error))?;
        Ok(())
    }

    /// The next line that is whole text, if one arrives until then; the first one, which may lack its beginning, if it fits.
    fn next(&mut self, until: Instant, fits: impl Fn(&TextLine) -> bool) -> Result<Option<(TextLine, i64)>> {
        loop {
            while let Some((line, at_ns)) = self.reader.next_whole(self.has_ended, &fits) {
                if line.cut {
                    // It is too long to be numbers or names.
                    self.reader.lines.left_out.in_no_line += line.bytes;
                } else if !line.is_text() {
                    self.begun.push((line, at_ns));
                } else {
                    return Ok(Some((line, at_ns)));
                }
            }
            if self.has_ended || Instant::now() >= until {
                return Ok(None);
            }
            self.fill()?;
        }
    }

    /// Waits for the first line that defines the columns, and returns them: a line of names, or of numbers, whose columns are
    /// then named `column_0` and so on. Text before it that is neither is skipped. `None` if none arrives.
    fn first(&mut self, source: &SourceText) -> Result<Option<FirstLine>> {
        let until = Instant::now() + FIRST_LINE;
        let mut names: Option<Vec<String>> = None;
        let mut are_names = false;
        // The first line of a serial line is left out, as a part of a number is a number too.
        let is_serial = matches!(self.reader.place(), LinePlace::Serial(_));
        let mut may_be_cut = self.reader.is_cut;
        while let Some((line, at_ns)) = self.next(until, |_| !is_serial)? {
            let is_first = std::mem::take(&mut may_be_cut);
            let found: Vec<_> = cells(&line.text).collect();
            if found.is_empty() || line.text.starts_with('#') {
                continue;
            }
            let more = found.len() + 1;
            let is_counted = names.as_ref().is_some_and(|names| names.len() == more)
                || source.leave_out.iter().any(|left| *left == more.to_string());
            let count = found.len() + usize::from(is_counted && line.text.trim().ends_with([';', ',']));
            let begins_with_letter = line.text.trim_start().starts_with(char::is_alphabetic);
            // Text before the numbers names their columns if it has as many words.
            let named = names.take().filter(|names| names.len() == count);
            let columns = named.unwrap_or_else(|| (0..count).map(numbered).collect());
            let is_left = |k: usize| source.leave_out.iter().any(|left| index_of("", left, &columns) == Ok(k));
            let texts: Vec<usize> = (0..found.len()).filter(|&k| !is_left(k) && number(&found[k]).is_none()).collect();
            if texts.iter().all(|&k| date(&found[k]).is_some() && source.may_be_dated(k, &columns)) {
                if is_first && !is_serial && self.next_is_longer(found.len(), until)? {
                    // This was the rest of a line.
                    continue;
                }
                self.begun.push((line, at_ns));
                return Ok(Some(FirstLine { columns, dated: texts }));
            }
            if is_first && !is_serial && found.last().is_some_and(|cell| number(cell).is_some()) && !begins_with_letter
            {
                continue;
            }
            are_names = line.text.contains([',', ';', '\t']) && found.iter().all(|cell| number(cell).is_none());
            let words: Vec<String> = found.into_iter().map(Cow::into_owned).collect();
            // Text is counted, but for the names of the columns.
            self.begun.push((line, at_ns));
            if words.iter().any(|word| clock_unit_us(word).is_some()) {
                return Ok(Some(FirstLine { columns: words, dated: vec![] }));
            }
            names = Some(words);
        }
        // Only names have arrived: a message of words with blanks between, or a line of numbers and text, is none.
        let names = names.filter(|_| are_names && !self.has_ended);
        Ok(names.map(|columns| FirstLine { columns, dated: vec![] }))
    }

    /// Whether the next line is of more numbers than so many, so that the one before it lacks its beginning.
    fn next_is_longer(&mut self, count: usize, until: Instant) -> Result<bool> {
        let Some((next, _)) = self.next(until, |_| true)? else { return Ok(false) };
        self.reader.lines.put_back(&next);
        let are_numbers = cells(&next.text).all(|cell| number(&cell).or_else(|| date(&cell)).is_some());
        Ok(are_numbers && cells(&next.text).count() > count)
    }

    /// Measures the time from one frame to the next, us, from what arrives first.
    #[allow(clippy::cast_precision_loss)]
    fn frame_us(&mut self, layout: &FrameLayout, source: &SourceText) -> Result<f64> {
        let mut frames = FrameAssembler::new(layout.clone());
        let mut times: Vec<i64> =
            self.begun.iter().filter_map(|(line, at_ns)| Some(frames.push(line, *at_ns)?.0)).collect();
        let mut until = Instant::now() + FIRST_LINE;
        while times.len() <= MEASURED_FRAMES {
            let Some((line, at_ns)) = self.next(until, |line| frames.fits(line))? else { break };
            if let Some((t, _)) = frames.push(&line, at_ns) {
                times.push(t);
                if times.len() == 2 {
                    until = Instant::now() + MEASURE;
                }
            }
            self.begun.push((line, at_ns));
        }
        if times.len() < 2 {
            return Err(self.nothing(source, times.len(), Some(layout.fields)));
        }
        if layout.time.is_empty() {
            return Ok(arrival_period(&times));
        }
        let mut apart: Vec<i64> = times.windows(2).map(|two| two[1] - two[0]).collect();
        let middle = apart.len() / 2;
        Ok(*apart.select_nth_unstable(middle).1 as f64)
    }

    /// The error if no frame arrived, or only one, of lines with so many columns: what arrived, and what to state.
    fn nothing(&mut self, source: &SourceText, frames: usize, fields: Option<usize>) -> Error {
        self.reader.lines.discard();
        let left_out = self.reader.lines.take_left_out();
        let within = match self.has_ended {
            true => "before the end".to_owned(),
            false => format!("within {} s", FIRST_LINE.as_secs()),
        };
        let (lines, garbage): (Vec<_>, Vec<_>) =
            self.begun.iter().map(|(line, _)| line).partition(|line| line.is_text());
        let texts: Vec<&str> = lines.iter().map(|line| line.text.trim()).filter(|text| !text.is_empty()).collect();
        let garbage: u64 = garbage.iter().map(|line| line.bytes).sum();
        let came = match (&texts[..], frames) {
            ([], _) => match left_out.in_no_line + left_out.unfinished + garbage {
                0 => format!("no line arrived {within}"),
                bytes => format!("{bytes} bytes arrived {within}, but no line of numbers"),
            },
            (_, 0) => {
                let lines = if texts.len() == 1 { "1 line".to_owned() } else { format!("{} lines", texts.len()) };
                format!("{lines} arrived {within}, {}", unread(&texts, &source.leave_out, fields))
            }
            _ => format!("only 1 frame arrived {within}, so the rate is unknown: add rate=HZ"),
        };
        problem!("{}: {came}", self.reader.place()).into()
    }
}

/// The time from one frame to the next, us, by their arrivals, two or more. Lines arrive in packets, and those that waited
/// until they were read arrive at once: it is that from the second packet to the last.
#[allow(clippy::cast_precision_loss)]
fn arrival_period(times: &[i64]) -> f64 {
    let mean = |first: usize, last: usize| (times[last] - times[first]) as f64 / (last - first) as f64;
    let end = times.len() - 1;
    let at_once = mean(0, end) / 10.0;
    let is_with_next = |k: &usize| ((times[k + 1] - times[*k]) as f64) < at_once;
    let first = (0..end).take_while(is_with_next).last().map_or(0, |k| k + 2);
    let last = end - (0..end).rev().take_while(is_with_next).count();
    if first < last { mean(first, last) } else { mean(0, end) }.max(1.0)
}

/// Length of a text that an error shows, characters.
const SHOWN: usize = 60;

/// Why lines are no frames of so many columns, in words that follow their number, and what to state.
fn unread(texts: &[&str], leave_out: &[String], fields: Option<usize>) -> String {
    // Lines of a header stand before those that are all alike.
    let width = texts.last().map_or(0, |last| cells(last).count());
    let alike: Vec<&str> = texts.iter().copied().filter(|text| cells(text).count() == width).collect();
    let first: Vec<_> = cells(alike[0]).collect();
    let columns: Vec<String> = (0..first.len()).map(numbered).collect();
    let is_left = |k: usize| leave_out.iter().any(|left| index_of("", left, &columns) == Ok(k));
    let mut are_text = vec![true; first.len()];
    for text in &alike {
        for (cell, is_text) in cells(text).zip(&mut are_text) {
            *is_text &= number(&cell).is_none();
        }
    }
    let shared: Vec<usize> = (0..first.len()).filter(|&k| are_text[k] && !is_left(k)).collect();
    let shown = |text: &str| text.chars().take(SHOWN).collect::<String>();
    let listed = |separator: &str, word: &dyn Fn(usize) -> String| {
        shared.iter().map(|&k| word(k)).collect::<Vec<_>>().join(separator)
    };
    if fields == Some(width + 1) && alike.iter().all(|text| text.ends_with([';', ','])) {
        let left: Vec<String> = leave_out.iter().cloned().chain([(width + 1).to_string()]).collect();
        return format!("but the last of {} columns is empty: add leave_out={}", width + 1, left.join(":"));
    }
    if let Some(&cut) = shared.iter().find(|&&k| first[k].trim_matches(['\'', '"']) == "...") {
        let column = cut + 1;
        return format!(
            "all shortened to \"...\" in column {column}: the sender must print whole lines (ros2 topic echo: add --full-length)"
        );
    }
    if let Some(&dated) = shared.iter().find(|&&k| date(&first[k]).is_some()) {
        let column = dated + 1;
        return format!("all with a date in column {column} ({:?}): add time={column}:{DATES}", shown(&first[dated]));
    }
    match (&shared[..], fields) {
        ([], Some(fields)) if first.iter().all(|cell| number(cell).is_some()) && first.len() != fields => {
            format!("but the first has {} columns: must be {fields}", first.len())
        }
        ([], Some(_)) if first.iter().all(|cell| number(cell).is_some()) => {
            "but no whole frame: are frame_lines= or frame_end= right?".to_owned()
        }
        (all, _) if all.is_empty() || all.len() == first.len() => {
            format!("but no line contains only numbers; the first is {:?}", shown(alike[0]))
        }
        (several, _) => {
            let column = if several.len() == 1 { "a text in column" } else { "texts in columns" };
            let left: Vec<String> = leave_out.iter().cloned().chain([listed(":", &|k| (k + 1).to_string())]).collect();
            format!(
                "all with {column} {} ({}): add leave_out={}",
                listed(", ", &|k| (k + 1).to_string()),
                listed(", ", &|k| format!("{:?}", shown(&first[k]))),
                left.join(":")
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sources_are_read_as_they_are_written() {
        let open = |text: &str| text.parse::<SourceText>().unwrap().open(None, FirstLineWait::default()).unwrap();
        let board = open("board:127.0.0.1:5209,array=16x8,preset=2 kHz");
        let SourceKind::Board(address, array, _) = &board else { panic!("{board:?}") };
        assert_eq!((address.port(), array.rows, array.columns), (5209, 16, 8));
        let imu = open("serial:/dev/ttyACM0,baud=9600,columns=n:ax:ay,time=n:ms");
        let SourceKind::Numbers(Some(place), stream, _) = &imu else { panic!("{imu:?}") };
        assert_eq!(place.to_string(), "serial:/dev/ttyACM0,baud=9600");
        assert_eq!((stream.time.as_deref(), stream.unit_us), (Some("n"), 1e3));
        let mat: SourceText = "mat=lines:-,array=2x3,columns=s:ns:id:a:b:c,time=1+2,leave_out=id,frame_lines=2,rate=50,falls=1023,unit=kPa"
            .parse()
            .unwrap();
        assert_eq!(mat.name(), "mat");
        let SourceKind::Frames(Some(LinePlace::File(path)), layout, _) =
            mat.open(None, FirstLineWait::default()).unwrap()
        else {
            panic!()
        };
        assert_eq!(path.to_str(), Some("-"));
        assert_eq!((layout.fields, &layout.values[..], layout.frame_us), (6, &[3, 4, 5][..], 20_000.0));
        assert_eq!((&layout.time[..], layout.turned, &*layout.unit), (&[(0, 1e6), (1, 1e-3)][..], Some(1023.0), "kPa"));
    }

    #[test]
    fn another_source_is_refused() {
        for text in [
            "",
            "board:5209",
            "udp:127.0.0.1:5209",
            "board:127.0.0.1:5209,array=16",
            "board:127.0.0.1:5209,columns=a",
            "serial:/dev/x,baud=fast",
            "serial:localhost:7,baud=9600",
            "serial:ttyACM0",
            "lines:x,time=a:h",
            "lines:x,frame_end=never",
            "lines:x,frame_lines=0",
            "lines:x,frame_lines=2,frame_end=blank",
            "lines:x,rate=0",
            "lines:x,falls=perhaps",
            "lines:x,unit=",
            "given,columns",
            "given,speed=4",
            "pipe:x",
            "/dev/ttyACM0",
            "COM3",
            "lines:",
            "lines+tcp:9000",
        ] {
            assert!(text.parse::<SourceText>().is_err(), "{text}");
        }
        for text in [
            "given",
            "given,array=2x2",
            "given,columns=a,time=b",
            "given,columns=a,time=2",
            "given,columns=a,leave_out=a",
            "given,array=2x2,rate=9,columns=a:b:c",
            "given,array=3x1,rate=9,frame_lines=2",
            "lines:/nowhere",
        ] {
            let source: SourceText = text.parse().unwrap();
            assert!(source.open(None, FirstLineWait::default()).is_err(), "{text}");
        }
    }

    /// The source of a file with this text, and what opening it returns.
    fn opened(name: &str, text: &str, keys: &str, wait: FirstLineWait<'_>) -> Result<FrameLayout> {
        let path = std::env::temp_dir().join(format!("taxel-{}-{name}", std::process::id()));
        std::fs::write(&path, text).unwrap();
        let source: SourceText = format!("lines:{},{keys}", path.display()).parse().unwrap();
        let kind = source.open(Some(&None), wait);
        std::fs::remove_file(&path).unwrap();
        match kind? {
            SourceKind::Frames(_, layout, _) => Ok(*layout),
            kind => panic!("{kind:?}"),
        }
    }

    #[test]
    fn a_silent_source_starts_where_all_is_stated_and_is_waited_for_else() {
        let layout = opened("stated", "", "array=2x3,time=1+2,leave_out=3,rate=75", FirstLineWait::default()).unwrap();
        assert_eq!((layout.fields, &layout.values[..]), (9, &[3, 4, 5, 6, 7, 8][..]));
        let asked = FirstLineWait { most: Duration::MAX, stop: Stop::when(&|| true) };
        let error = opened("waits", "", "array=2x3,time=1+2,leave_out=3", asked).unwrap_err();
        assert!(matches!(error, Error::Core(taxel_core::Error::Interrupted)), "{error}");
        let none = FirstLineWait { most: Duration::ZERO, ..FirstLineWait::default() };
        let error = opened("silent", "", "array=2x3", none).unwrap_err();
        assert!(error.to_string().contains("no line arrived within 0 s"), "{error}");
    }

    #[test]
    fn an_empty_last_cell_is_a_column_where_it_is_counted() {
        let frames = "1;2;3;\n".repeat(9);
        for (header, left_out) in [("a;b;c;note\n", "note"), ("a;b;c;note\n", "4"), ("", "4"), ("M\u{fc}ller\n", "4")] {
            let keys = format!("array=1x3,rate=9,leave_out={left_out}");
            let layout = opened("cells", &format!("{header}{frames}"), &keys, FirstLineWait::default()).unwrap();
            assert_eq!((layout.fields, &layout.values[..]), (4, &[0, 1, 2][..]), "{header:?}, {left_out}");
        }
        let layout = opened("end", &frames, "array=1x3,rate=9", FirstLineWait::default()).unwrap();
        assert_eq!(layout.fields, 3);
    }

    #[test]
    fn an_array_that_the_rows_of_lines_cannot_fill_is_refused_with_the_one_that_they_fill() {
        let frames = "1 2 3 4 5 6 7\n".repeat(64) + "\n";
        for (keys, said) in [
            ("array=7x8,frame_lines=8,rate=9", "must be rows of 8: is it array=8x7?"),
            ("array=7x8,frame_end=blank,rate=9", "must be rows of 8: is it array=8x7?"),
            ("array=8x7,rate=9", "must be 56 per frame (or add frame_lines=8; or add frame_end=blank"),
            ("array=8x9,rate=9", "must be 72 per frame"),
            (
                "array=2x3,rate=9",
                "lines have 7 values: must be 6 per frame (state which column contains times, for example time=1:ms, \
                 and",
            ),
        ] {
            let error = opened("rows", &frames, keys, FirstLineWait::default()).unwrap_err().to_string();
            assert!(error.contains(said), "{keys}: {error}");
        }
        for keys in ["array=8x7,frame_lines=8,rate=9", "array=4x14,frame_lines=8,rate=9", "array=1x7,rate=9"] {
            opened("fits", &frames, keys, FirstLineWait::default()).unwrap();
        }
    }

    #[test]
    fn the_rate_by_arrival_does_not_count_the_frames_that_waited() {
        let late = |waited: i64, packet: i64| {
            (0..33).map(move |k| (k.max(waited) / packet) * packet * 13_333 + k.min(waited)).collect::<Vec<_>>()
        };
        for (waited, packet) in [(0, 1), (5, 1), (20, 1), (0, 4), (8, 4)] {
            let period = arrival_period(&late(waited, packet));
            assert!((period / 13_333.0 - 1.0).abs() < 0.001, "{waited}, {packet}: {period}");
        }
    }

    #[test]
    fn lines_that_make_no_frame_are_shown_with_what_to_state() {
        let line = |k: usize| format!("{k},2,palm_link,0.5,1\n");
        let lines: String = (0..40).map(line).collect();
        let error = opened("text", &lines, "array=1x2,time=1+2,rate=75", FirstLineWait::default()).unwrap_err();
        let said = "40 lines arrived within 3 s, all with a text in column 3 (\"palm_link\"): add leave_out=3";
        assert!(error.to_string().contains(said), "{error}");
        for (texts, leave_out, fields, said) in [
            (
                vec!["1,a,2,b", "2,a,3,b"],
                vec![],
                None,
                "all with texts in columns 2, 4 (\"a\", \"b\"): add leave_out=2:4",
            ),
            (vec!["1,a,2,b"], vec!["2"], None, "all with a text in column 4 (\"b\"): add leave_out=2:4"),
            (
                vec!["1,a,2,'...'", "1,a,3,'...'"],
                vec!["2"],
                None,
                "all shortened to \"...\" in column 4: the sender must print",
            ),
            (
                vec!["ros2: command not found"],
                vec![],
                None,
                "but no line contains only numbers; the first is \"ros2: command not found\"",
            ),
            (vec!["1,2", "1,2"], vec![], Some(5), "but the first has 2 columns: must be 5"),
            (vec!["1,2", "1,2"], vec![], Some(2), "but no whole frame: are frame_lines= or frame_end= right?"),
            (
                vec!["InsoleLab", "1;a;2", "2;b;3"],
                vec![],
                Some(3),
                "all with a text in column 2 (\"a\"): add leave_out=2",
            ),
            (vec!["1;2;", "1;2;"], vec!["1"], Some(3), "but the last of 3 columns is empty: add leave_out=1:3"),
        ] {
            let leave_out: Vec<String> = leave_out.into_iter().map(str::to_owned).collect();
            let found = unread(&texts, &leave_out, fields);
            assert!(found.starts_with(said), "{found}");
        }
    }
}
