//! What arrives from a source of lines, for people, and how the lines seem to make frames.

use std::borrow::Cow;
use std::time::{Duration, Instant};

use taxel_core::problem;

use super::source::{DATES, SourcePlace, SourceText};
use crate::Result;
use crate::line_input::LineReader;
use crate::line_place::LinePlace;
use crate::recording::{cells, date, number};

/// Number of lines that are shown, the last ones.
const SHOWN: usize = 12;

/// Length of a line that is shown, characters.
const LONGEST: usize = 200;

/// So many lines of numbers are enough.
const ENOUGH: usize = 200;

/// An array that is not square has at most so many times as many columns as rows.
const FLATTEST: usize = 3;

/// Lines of a source and what they seem to be.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SourcePreview {
    /// The last lines that arrived.
    pub lines: Vec<String>,
    /// The source with what the lines show added to it: array, lines of a frame, time.
    pub source: String,
    /// What the lines seem to be, in words.
    pub about: String,
}

/// A line that arrived.
struct PreviewLine {
    numbers: Option<Vec<f64>>,
    /// Whether the first of them is a date.
    is_dated: bool,
    is_empty: bool,
    at_ns: i64,
}

impl PreviewLine {
    fn new(text: &str, at_ns: i64) -> Self {
        let cells: Vec<_> = cells(text).collect();
        let is_dated = cells.first().is_some_and(|cell| number(cell).is_none() && date(cell).is_some());
        let value = |(k, cell): (usize, &Cow<'_, str>)| if k == 0 && is_dated { date(cell) } else { number(cell) };
        let (numbers, is_empty) = (cells.iter().enumerate().map(value).collect::<Option<Vec<f64>>>(), cells.is_empty());
        Self { numbers: numbers.filter(|_| !is_empty), is_dated, is_empty, at_ns }
    }
}

impl SourcePreview {
    /// Reads a source of lines for so long at most.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` if it is no source of lines, `Socket` or `File` if it cannot be opened or read.
    pub fn read(source: &SourceText, most: Duration) -> Result<Self> {
        let SourcePlace::Lines(place) = &source.place else {
            return Err(problem!("source {:?}: sends no lines, so nothing can be shown", source.text).into());
        };
        let mut reader = LineReader::open(place)?;
        let is_serial = matches!(place, LinePlace::Serial(_));
        let (until, mut shown, mut found) = (Instant::now() + most, vec![], vec![]);
        let mut ended = false;
        while !ended && Instant::now() < until && found.len() < ENOUGH {
            ended = reader.fill().map_err(|error| reader.broken(error))?;
            while let Some((line, at_ns)) = reader.next_whole(ended, |_| !is_serial) {
                found.push(PreviewLine::new(&line.text, at_ns));
                shown.push(line.text.chars().take(LONGEST).collect::<String>());
            }
        }
        let lines = shown.split_off(shown.len().saturating_sub(SHOWN));
        let (keys, about) = guess(&found, source.states_array());
        let source = if keys.is_empty() { source.text.clone() } else { format!("{},{keys}", source.text) };
        Ok(Self { lines, source, about })
    }
}

/// The keys that the lines show, and what they are in words.
fn guess(lines: &[PreviewLine], array_is_stated: bool) -> (String, String) {
    let numbers: Vec<(&[f64], i64)> =
        lines.iter().filter_map(|line| Some((line.numbers.as_deref()?, line.at_ns))).collect();
    let text = lines.iter().filter(|line| line.numbers.is_none() && !line.is_empty).count();
    let Some(width) = usual(numbers.iter().map(|(line, _)| line.len())) else {
        let reason = match text {
            0 => "Nothing arrived: is the sensor connected and switched on?",
            _ => "No line of numbers arrived: is the baud rate right?",
        };
        return (String::new(), reason.to_owned());
    };
    let usual_lines: Vec<(&[f64], i64)> = numbers.iter().copied().filter(|(line, _)| line.len() == width).collect();
    let unlike = numbers.len() - usual_lines.len() + text;
    let beside = if unlike > 0 { format!("; {unlike} other lines") } else { String::new() };
    if array_is_stated {
        return (String::new(), format!("{width} numbers per line{beside}"));
    }
    // Whole groups lie between two empty lines.
    let groups: Vec<usize> = lines.split(|line| line.is_empty).map(<[PreviewLine]>::len).collect();
    let complete = groups.get(1..groups.len().saturating_sub(1)).unwrap_or_default();
    if let Some(rows) = usual(complete.iter().copied().filter(|&rows| rows > 0)) {
        let keys = format!("array={rows}x{width},frame_end=blank");
        return (keys, format!("{rows} lines of {width} numbers, then an empty line: {rows} x {width}{beside}"));
    }
    let are_dated = lines.iter().filter(|line| line.numbers.is_some()).all(|line| line.is_dated);
    let by_arrival = || clock_unit(&usual_lines).filter(|_| is_square(width - 1) || !is_square(width));
    let clock = if are_dated { Some(DATES) } else { by_arrival() }.filter(|_| width > 1);
    let (values, time) = clock.map_or((width, String::new()), |unit| (width - 1, format!(",time=1:{unit}")));
    let (rows, columns) = sides(values);
    let first = match clock {
        None => String::new(),
        Some(DATES) => " after a date".to_owned(),
        Some(unit) => format!(" after a time in {unit}"),
    };
    (format!("array={rows}x{columns}{time}"), format!("{values} numbers per line{first}: {rows} x {columns}{beside}"))
}

/// The most frequent of some numbers.
fn usual(numbers: impl Iterator<Item = usize>) -> Option<usize> {
    let mut counts = std::collections::BTreeMap::new();
    numbers.for_each(|n| *counts.entry(n).or_insert(0_usize) += 1);
    counts.into_iter().max_by_key(|&(_, count)| count).map(|(n, _)| n)
}

fn is_square(n: usize) -> bool {
    n.isqrt().pow(2) == n
}

/// Rows and columns of so many values: as square as possible, or one row.
fn sides(values: usize) -> (usize, usize) {
    let rows = (1..=values.isqrt()).rev().find(|rows| values.is_multiple_of(*rows)).unwrap_or(1);
    let columns = values / rows.max(1);
    if columns > FLATTEST * rows { (1, values) } else { (rows, columns) }
}

/// The unit of the first column, if it is a time: it ascends as arrival does.
#[allow(clippy::cast_precision_loss)]
fn clock_unit(lines: &[(&[f64], i64)]) -> Option<&'static str> {
    let stamps: Vec<f64> = lines.iter().map(|(line, _)| line[0]).collect();
    let ascends = stamps.len() >= 5 && stamps.windows(2).all(|two| two[1] > two[0]);
    let passed_s = (lines.last()?.1 - lines.first()?.1) as f64 * 1e-9;
    if !ascends || passed_s <= 0.0 {
        return None;
    }
    let by_second = (stamps[stamps.len() - 1] - stamps[0]) / passed_s;
    let units = [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)];
    units.into_iter().find(|(_, a_second)| (0.5..2.0).contains(&(by_second / a_second))).map(|(unit, _)| unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lines that arrive every 10 ms.
    fn lines(text: &str) -> Vec<PreviewLine> {
        let line = |(k, text): (usize, &str)| PreviewLine::new(text, 10_000_000 * i64::try_from(k).unwrap());
        text.split('\n').enumerate().map(line).collect()
    }

    #[test]
    fn rows_columns_and_time_are_guessed() {
        let row = |n: usize| vec!["7"; n].join(",");
        let repeated = |line: &dyn Fn(usize) -> String| (0..20).map(line).collect::<Vec<_>>().join("\n");
        for (text, keys) in [
            (repeated(&|_| row(256)), "array=16x16"),
            (repeated(&|_| row(1)), "array=1x1"),
            (repeated(&|_| row(192)), "array=12x16"),
            (repeated(&|_| row(7)), "array=1x7"),
            (repeated(&|k| format!("{},{}", 500 + 10 * k, row(256))), "array=16x16,time=1:ms"),
            (repeated(&|k| format!("{},{}", 10_000 * k, row(5))), "array=1x5,time=1:us"),
            (repeated(&|k| if k % 5 == 3 { String::new() } else { row(6) }), "array=4x6,frame_end=blank"),
            (repeated(&|k| format!("2024-05-01 10:15:02.{k:02}0,{}", row(7))), "array=1x7,time=1:iso"),
            (format!("Mat 1.0\n{}", repeated(&|_| row(64))), "array=8x8"),
            (repeated(&|_| "hello".to_owned()), ""),
            (String::new(), ""),
        ] {
            assert_eq!(guess(&lines(&text), false).0, keys, "{text}");
        }
        assert_eq!(guess(&lines(&repeated(&|_| row(9))), true), (String::new(), "9 numbers per line".to_owned()));
    }
}
