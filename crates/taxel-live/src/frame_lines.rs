//! Frames of the whole array from lines of numbers: a line, or several, make a frame.

use std::borrow::Cow;

use serde::Serialize;
use taxel_core::{Array, problem};

use crate::recording::{Cause, Found, FrameProperties, StreamFaults, cells, date, number};
use crate::text_lines::{LeftOut, TextLine};

/// How lines of numbers make frames.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameLayout {
    /// The sensor.
    pub array: Array,
    /// Number of fields of a line.
    pub fields: usize,
    /// The fields whose sum is the time of the frame, each with its unit, us; without any it is the time of arrival.
    pub time: Vec<(usize, f64)>,
    /// Whether the field of the time holds dates, or times of a day, as texts, which count as seconds.
    pub dates: bool,
    /// The fields with values, in the order of the taxels.
    pub values: Vec<usize>,
    /// Where a frame ends.
    pub end: FrameEnd,
    /// The number from which each reading is subtracted, if readings fall with pressure.
    pub turned: Option<f64>,
    /// Unit of the values.
    pub unit: String,
    /// Whether the source states it.
    pub unit_is_stated: bool,
    /// The names of the columns, if each is a quantity of its own.
    pub names: Vec<String>,
    /// Time from one frame to the next, us.
    pub frame_us: f64,
    /// Whether the lines waited in a file until they were read, so that their arrival is no clock to compare with.
    pub waited: bool,
}

/// Where a frame of several lines ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameEnd {
    /// After so many lines; an empty line between two frames is allowed.
    Lines(usize),
    /// At an empty line.
    EmptyLine,
}

impl FrameLayout {
    /// Takes the unit of a readout, if the source states none.
    pub fn assume_unit(&mut self, unit: Option<&str>) {
        if let Some(unit) = unit.filter(|_| !self.unit_is_stated) {
            unit.clone_into(&mut self.unit);
        }
    }

    /// The properties that a recording states.
    #[must_use]
    pub fn properties(&self) -> FrameProperties {
        FrameProperties {
            unit: self.unit.clone(),
            clock: true,
            columns: self.names.clone(),
            turned: self.turned,
            frame_us: Some(self.frame_us),
        }
    }

    /// Checks that the values of a frame fill the array, and that a line holds a row of it, several, or an even part of one.
    ///
    /// # Errors
    ///
    /// `Problem`, with the numbers.
    pub fn check(&self) -> taxel_core::Result<()> {
        self.array.check()?;
        let (rows, columns, n) = (self.array.rows, self.array.columns, self.values.len());
        let fits = match self.end {
            FrameEnd::Lines(lines) => lines * n == self.array.len(),
            FrameEnd::EmptyLine => n > 0 && self.array.len().is_multiple_of(n),
        };
        let lines = match self.end {
            FrameEnd::Lines(1) => String::new(),
            FrameEnd::Lines(lines) => format!(", {lines} lines per frame"),
            FrameEnd::EmptyLine => ", an empty line after each frame".to_owned(),
        };
        let (frame, row) = (self.array.len(), usize::from(columns));
        if !fits {
            let several = match frame / n.max(1) {
                several @ 2.. if self.end == FrameEnd::Lines(1) && several * n == frame => {
                    format!(" (or add frame_lines={several}; or add frame_end=blank if an empty line ends each frame)")
                }
                0 => " (state which column contains times, for example time=1:ms, and which columns are not readings, \
                      for example leave_out=1)"
                    .to_owned(),
                _ => String::new(),
            };
            return Err(problem!(
                "array={rows}x{columns}: lines have {n} values{lines}: must be {frame} per frame{several}"
            ));
        }
        if !n.is_multiple_of(row) && !row.is_multiple_of(n) {
            let turned =
                if n == usize::from(rows) { format!(": is it array={columns}x{rows}?") } else { String::new() };
            return Err(problem!(
                "array={rows}x{columns}: lines have {n} values{lines}: must be rows of {columns}{turned}"
            ));
        }
        if !(1.0..=3.6e9).contains(&self.frame_us) {
            return Err(problem!("a frame lasts {} us: must be from 1 us to an hour", self.frame_us));
        }
        Ok(())
    }
}

/// Lines that are no part of a frame, by kind, with the first of each, and frames whose time is wrong.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct UnreadLines {
    /// Lines of text.
    pub text: UnreadKind,
    /// Lines with another number of values.
    pub other_length: UnreadKind,
    /// Lines with bytes that are no text, as of another speed of a serial line.
    pub no_text: UnreadKind,
    /// Lines of frames that lack lines, or of which the time is none.
    pub unfinished_frames: UnreadKind,
    /// Frames whose stamp is not after the one before, with the column of the first such stamp.
    pub repeated_stamps: UnreadKind,
}

/// Lines of a kind.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct UnreadKind {
    /// Their number.
    pub lines: u64,
    /// The beginning of the first one.
    pub first: String,
}

/// Length of the first line of a kind, as it is kept, characters.
const SHOWN: usize = 40;

impl UnreadKind {
    fn count(&mut self, lines: u64, text: &str) {
        if self.lines == 0 && lines > 0 {
            self.first = text.chars().take(SHOWN).collect();
        }
        self.lines += lines;
    }
}

/// Makes frames of lines as they arrive, and counts what is in no frame.
#[derive(Debug)]
pub struct FrameAssembler {
    layout: FrameLayout,
    faults: StreamFaults,
    unread: UnreadLines,
    lines: u64,
    /// The numbers of the last line, NaN in the columns that are left out, and which columns are not.
    numbers: Vec<f64>,
    is_read: Vec<bool>,
    /// The values of the frame so far, its first stamp and the arrival of its first line, ns since 1970.
    values: Vec<f32>,
    begun: Option<(Option<f64>, i64)>,
    /// Number of lines of the frame so far, and of their bytes.
    rows: u64,
    bytes: u64,
    /// Whether the end of a frame was seen since reading began, so that the next one has its beginning.
    is_whole: bool,
    /// Whether the lines were interrupted, so that a frame that lacks its beginning is a loss.
    was_interrupted: bool,
    /// Whether numbers came since the lines began or went on: text before them, as a board prints when it starts, is no fault.
    has_begun: bool,
    /// Stamp of the last frame, and its time, us.
    stamp: Option<f64>,
    last: Option<i64>,
    /// When the last frame arrived, ns since 1970.
    arrived_ns: Option<i64>,
    silences: Silences,
    /// When the last line was read that can come, ns since 1970.
    ended_ns: Option<i64>,
}

/// Silences between frames that arrive.
#[derive(Debug, Clone, Copy, Default)]
struct Silences {
    count: u64,
    ns: u64,
}

/// Without any frame for so long a source is silent, ns; one of slow frames after so many of them.
const SILENT_NS: i64 = 1_000_000_000;
const SILENT_FRAMES: f64 = 3.0;

impl FrameAssembler {
    /// Begins without any line.
    #[must_use]
    pub fn new(layout: FrameLayout) -> Self {
        let unit_us = match layout.time[..] {
            [(_, unit_us)] => unit_us,
            _ => 1.0,
        };
        let faults = StreamFaults::by_clock(unit_us, layout.waited);
        let mut is_read = vec![false; layout.fields];
        let clocks = layout.time.iter().map(|(field, _)| field);
        layout.values.iter().chain(clocks).for_each(|&field| is_read[field] = true);
        Self {
            faults,
            unread: UnreadLines::default(),
            lines: 0,
            numbers: Vec::with_capacity(layout.fields),
            is_read,
            values: Vec::with_capacity(layout.array.len()),
            layout,
            begun: None,
            rows: 0,
            bytes: 0,
            is_whole: false,
            was_interrupted: false,
            has_begun: false,
            stamp: None,
            last: None,
            arrived_ns: None,
            silences: Silences::default(),
            ended_ns: None,
        }
    }

    /// How lines make frames.
    #[must_use]
    pub fn layout(&self) -> &FrameLayout {
        &self.layout
    }

    /// Adds a line that arrived at `arrived_ns` (ns since 1970); where it ends a frame, returns the frame's time (us) and
    /// values, row by row.
    pub fn push(&mut self, line: &TextLine, arrived_ns: i64) -> Option<(i64, &[f32])> {
        let text = line.text.trim();
        if text.is_empty() {
            return self.end_at_empty_line();
        }
        if text.starts_with('#') || (self.begun.is_none() && self.names_columns(text)) {
            return None;
        }
        self.lines += 1;
        let mut numbers = std::mem::take(&mut self.numbers);
        let is_read = self.read(text, &mut numbers) && !line.cut;
        let ends = is_read && self.push_numbers(&numbers, arrived_ns);
        self.numbers = numbers;
        self.bytes += line.bytes;
        if !is_read {
            self.count_unread(line);
            self.discard();
        }
        if ends { self.end_frame() } else { None }
    }

    /// Adds the numbers of a line, as [`FrameAssembler::push`].
    ///
    /// # Errors
    ///
    /// `Problem` if a line has another number of fields.
    pub fn push_values(&mut self, numbers: &[f64], arrived_ns: i64) -> taxel_core::Result<Option<(i64, &[f32])>> {
        let (n, expected) = (numbers.len(), self.layout.fields);
        if n != expected {
            return Err(problem!("{n} values: must be {expected}"));
        }
        self.lines += 1;
        Ok(if self.push_numbers(numbers, arrived_ns) { self.end_frame() } else { None })
    }

    /// Whether a line has the numbers of the layout.
    #[must_use]
    pub fn fits(&self, line: &TextLine) -> bool {
        self.read(&line.text, &mut vec![])
    }

    /// Reads the numbers of a line, NaN in the columns that are left out; returns whether it is a line of the layout.
    fn read(&self, text: &str, numbers: &mut Vec<f64>) -> bool {
        numbers.clear();
        for cell in cells(text) {
            let field = numbers.len();
            let value = match self.is_read.get(field) {
                Some(true) if self.holds_date(field) => date(&cell),
                Some(true) => number(&cell),
                Some(false) => Some(f64::NAN),
                None => None,
            };
            let Some(value) = value else { return false };
            numbers.push(value);
        }
        // An empty last cell is one where the layout counts it.
        if self.is_read.get(numbers.len()) == Some(&false) && text.trim().ends_with([';', ',']) {
            numbers.push(f64::NAN);
        }
        numbers.len() == self.layout.fields
    }

    fn holds_date(&self, field: usize) -> bool {
        self.layout.dates && self.layout.time.iter().any(|(clock, _)| *clock == field)
    }

    /// Counts a line that is no part of a frame.
    fn count_unread(&mut self, line: &TextLine) {
        let text = line.text.trim();
        let is_number = |(k, cell): (usize, Cow<'_, str>)| match self.holds_date(k) {
            true => date(&cell).is_some(),
            false => number(&cell).is_some(),
        };
        let are_numbers = cells(text).enumerate().all(is_number);
        let kind = match are_numbers {
            _ if !line.is_text() => &mut self.unread.no_text,
            true => &mut self.unread.other_length,
            false => &mut self.unread.text,
        };
        kind.count(1, text);
        if self.has_begun || are_numbers {
            self.faults.strange();
        }
    }

    /// Adds the numbers of a line; returns whether it ends a frame.
    fn push_numbers(&mut self, numbers: &[f64], arrived_ns: i64) -> bool {
        self.has_begun = true;
        if self.begun.is_none() {
            let stamp = match self.layout.time[..] {
                [] => None,
                [(field, _)] => Some(numbers[field]),
                _ => Some(self.layout.time.iter().map(|&(field, unit_us)| numbers[field] * unit_us).sum()),
            };
            self.begun = Some((stamp, arrived_ns));
            self.values.clear();
        }
        let turned = self.layout.turned;
        // Values of frames have 32 bits, as in recordings.
        #[allow(clippy::cast_possible_truncation)]
        let value = |&field: &usize| match turned {
            Some(from) => from as f32 - numbers[field] as f32,
            None => numbers[field] as f32,
        };
        self.values.extend(self.layout.values.iter().map(value));
        self.rows += 1;
        match self.layout.end {
            FrameEnd::Lines(lines) => self.rows == lines as u64,
            FrameEnd::EmptyLine => {
                if self.values.len() > self.layout.array.len() {
                    self.discard();
                }
                false
            }
        }
    }

    /// Ends a frame at an empty line; a frame that lacks lines is left out, and its lines are counted.
    fn end_at_empty_line(&mut self) -> Option<(i64, &[f32])> {
        if self.begun.is_some() && self.values.len() == self.layout.array.len() {
            return self.end_frame();
        }
        self.discard();
        self.is_whole = true;
        None
    }

    fn end_frame(&mut self) -> Option<(i64, &[f32])> {
        let (stamp, arrived_ns) = self.begun.take()?;
        let rows = std::mem::take(&mut self.rows);
        (self.bytes, self.is_whole) = (0, true);
        let Some(t) = self.faults.time(stamp, arrived_ns) else {
            self.count_unfinished(rows);
            return None;
        };
        if let Some(stamp) = stamp {
            if self.stamp.is_some_and(|before| stamp <= before) {
                let columns: Vec<String> = self.layout.time.iter().map(|(field, _)| (field + 1).to_string()).collect();
                self.unread.repeated_stamps.count(1, &format!("{stamp} in column {}", columns.join("+")));
            }
            self.stamp = Some(stamp);
        }
        self.faults.missing(self.values.iter().copied().map(f64::from));
        // Lines that came in one packet have one arrival time.
        let t = self.last.map_or(t, |last| t.max(last + 1));
        self.last = Some(t);
        self.silences = self.silences_until(arrived_ns);
        self.arrived_ns = Some(arrived_ns);
        Some((t, &self.values))
    }

    /// Leaves out an unfinished frame. One that was under way when reading began lost nothing.
    fn discard(&mut self) {
        self.begun = None;
        self.values.clear();
        let (rows, bytes) = (std::mem::take(&mut self.rows), std::mem::take(&mut self.bytes));
        if self.is_whole {
            self.count_unfinished(rows);
        } else if rows > 0 && self.was_interrupted {
            self.faults.count_left_out(LeftOut { unfinished: bytes, ..LeftOut::default() });
        }
    }

    fn count_unfinished(&mut self, rows: u64) {
        self.faults.strange_lines(rows);
        self.unread.unfinished_frames.count(rows, "");
    }

    /// Lines that are no part of a frame, by kind.
    #[must_use]
    pub fn unread(&self) -> &UnreadLines {
        &self.unread
    }

    /// Whether a line names the columns.
    fn names_columns(&self, text: &str) -> bool {
        let mut fields = 0;
        let are_names = cells(text).inspect(|_| fields += 1).all(|cell| number(&cell).is_none());
        are_names && fields == self.layout.fields
    }

    /// Handles an interruption: the next line begins a frame.
    pub fn restart(&mut self) {
        self.discard();
        (self.is_whole, self.was_interrupted, self.has_begun) = (false, true, false);
    }

    /// Ends at this time, ns since 1970: no line can come, so that what follows is no silence.
    pub fn end(&mut self, at_ns: i64) {
        self.ended_ns = Some(at_ns);
    }

    /// Counts bytes that are in no line.
    pub fn count_left_out(&mut self, bytes: LeftOut) {
        self.faults.count_left_out(bytes);
    }

    /// Number of lines, without empty ones and those of names.
    #[must_use]
    pub fn lines(&self) -> u64 {
        self.lines
    }

    /// The silences so far, with that which lasts until `now_ns` since 1970.
    fn silences_until(&self, now_ns: i64) -> Silences {
        if self.layout.waited {
            return self.silences;
        }
        let now_ns = self.ended_ns.unwrap_or(now_ns);
        let Silences { count, ns } = self.silences;
        #[allow(clippy::cast_possible_truncation)]
        let least = SILENT_NS.max((SILENT_FRAMES * 1000.0 * self.layout.frame_us) as i64);
        match self.arrived_ns.map(|arrived_ns| now_ns - arrived_ns) {
            Some(silent) if silent > least => Silences { count: count + 1, ns: ns + silent.unsigned_abs() },
            _ => self.silences,
        }
    }

    /// What is wrong with the lines until `now_ns` since 1970, as a verdict states it.
    #[must_use]
    pub fn found(&self, now_ns: i64) -> Found {
        let Silences { count, ns } = self.silences_until(now_ns);
        let mut found = self.faults.found();
        found.counts.extend([(Cause::Silences, count), (Cause::SilentMs, ns / 1_000_000)]);
        found
    }
}

/// A frame as a message: its time, us, and its values.
pub fn write_message(t: i64, values: &[f32], out: &mut Vec<u8>) {
    out.clear();
    out.extend_from_slice(&t.to_le_bytes());
    values.iter().for_each(|value| out.extend_from_slice(&value.to_le_bytes()));
}

/// The time of a frame's message, us, and its values.
///
/// # Panics
///
/// If the message was not made by [`write_message`].
pub fn read_message(message: &[u8]) -> (i64, impl Iterator<Item = f32> + '_) {
    let (t, values) = message.split_first_chunk().expect("a message begins with its time");
    let value = |four: &[u8]| f32::from_le_bytes([four[0], four[1], four[2], four[3]]);
    (i64::from_le_bytes(*t), values.chunks_exact(4).map(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lines of so many values, and of a clock before them, that are frames of one row.
    fn layout(values: usize, time: &[(usize, f64)]) -> FrameLayout {
        let fields = values + time.len();
        FrameLayout {
            array: Array::unmeasured(1, u16::try_from(values).unwrap(), "row"),
            fields,
            time: time.to_vec(),
            values: (time.len()..fields).collect(),
            end: FrameEnd::Lines(1),
            turned: None,
            unit: "counts".to_owned(),
            unit_is_stated: false,
            names: vec![],
            frame_us: 10_000.0,
            waited: false,
            dates: false,
        }
    }

    fn line(text: &str) -> TextLine {
        TextLine { text: text.to_owned(), bytes: text.len() as u64, cut: false }
    }

    #[test]
    fn what_follows_the_end_is_no_silence() {
        let mut frames = FrameAssembler::new(layout(2, &[]));
        let silent_ms = |frames: &FrameAssembler, now_ns| frames.found(now_ns).counts[Cause::SilentMs];
        frames.push(&line("1,2"), 0);
        frames.push(&line("1,2"), 3_000_000_000);
        assert_eq!(silent_ms(&frames, 8_000_000_000), 8_000);
        frames.end(3_500_000_000);
        assert_eq!(silent_ms(&frames, 600_000_000_000), 3_000);
    }

    #[test]
    fn a_frame_that_was_under_way_when_reading_began_is_no_loss_and_a_later_one_is() {
        let end = FrameEnd::EmptyLine;
        let mut frames =
            FrameAssembler::new(FrameLayout { array: Array::unmeasured(2, 2, "square"), end, ..layout(2, &[]) });
        let mut push = |text: &str| frames.push(&line(text), 0).is_some();
        assert!(!["1,2", "", "1,2", "3,4"].into_iter().any(&mut push));
        assert!(push(""));
        let lost = |frames: &FrameAssembler| frames.unread().unfinished_frames.lines;
        assert_eq!(
            (lost(&frames), frames.found(0).counts[Cause::Strange], frames.found(0).counts[Cause::UnfinishedLines]),
            (0, 0, 0)
        );
        for text in ["5,6", "", "7,8"] {
            frames.push(&line(text), 0);
        }
        assert_eq!(lost(&frames), 1);
        frames.restart();
        assert_eq!(lost(&frames), 2);
        frames.push(&line("9,9"), 0);
        frames.push(&line(""), 0);
        assert_eq!(
            (lost(&frames), frames.found(0).counts[Cause::Strange], frames.found(0).counts[Cause::UnfinishedLines]),
            (2, 2, 3)
        );
    }

    #[test]
    fn text_before_the_first_numbers_is_counted_and_is_no_fault() {
        let mut frames = FrameAssembler::new(layout(2, &[]));
        let mut push = |text: &str| {
            frames.push(&line(text), 0);
            (frames.found(0).counts[Cause::Strange], frames.unread().text.lines, frames.unread().no_text.lines)
        };
        assert_eq!(
            ["rst:0x1 (POWERON RESET)", "\u{fffd}\u{1}", "1,2", "boot"].map(&mut push),
            [(0, 1, 0), (0, 1, 1), (0, 1, 1), (1, 2, 1)]
        );
        frames.restart();
        frames.push(&line("rst:0x1 (POWERON RESET)"), 0);
        assert_eq!((frames.found(0).counts[Cause::Strange], frames.unread().text.lines), (1, 3));
    }

    #[test]
    fn stamps_that_repeat_or_step_back_are_counted_with_their_column() {
        let repeated = |stamps: &[&str], time: &[(usize, f64)]| {
            let mut frames = FrameAssembler::new(layout(1, time));
            for stamp in stamps {
                frames.push(&line(&format!("{stamp},5")), 0);
            }
            let UnreadKind { lines, first } = &frames.unread().repeated_stamps;
            (*lines, first.clone())
        };
        assert_eq!(repeated(&["17", "17", "17", "18", "16", "19"], &[(0, 1e6)]), (3, "17 in column 1".to_owned()));
        assert_eq!(repeated(&["17", "18", "19"], &[(0, 1e6)]), (0, String::new()));
        assert_eq!(
            repeated(&["1,0", "1,1000", "1,1000"], &[(0, 1e6), (1, 1e-3)]),
            (1, "1000001 in column 1+2".to_owned())
        );
    }
}
