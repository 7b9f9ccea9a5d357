//! The running sources of a recording besides the board.
//!
//! Each source has its own clock, in addition to the host's arrival times, and its own counts.

use std::sync::Mutex;
use std::time::Instant;

use taxel_core::problem;

use super::counters::SourceCounts;
use super::frame_input::{LineCounts, ReadLines};
use super::record_stage::COUNTS_EVERY;
use crate::Result;
use crate::locked::lock;
use crate::recording::{self, Cause, Counts, Found, SourceWriter, StreamColumns, StreamFaults, now_ns};

/// Sources by their names.
pub(super) type Named<T> = Vec<(String, T)>;

/// A running stream of numbers.
pub(super) struct NumberStream {
    name: String,
    track: Mutex<NumbersTrack>,
    stream: StreamColumns,
    trouble: Mutex<Option<String>>,
}

/// The part of a recording into which lines are written, if any.
struct NumbersTrack {
    track: Option<SourceWriter>,
    /// Number of all lines, and of those before this part.
    lines: u64,
    before: u64,
    /// What is wrong with the lines of this part, and of all.
    faults: StreamFaults,
    all: StreamFaults,
    /// When the counts were last written.
    counted: Option<Instant>,
}

impl NumberStream {
    pub(super) fn new(name: &str, stream: StreamColumns, track: Option<SourceWriter>) -> Self {
        let faults = StreamFaults::new(&stream);
        let track = NumbersTrack { track, lines: 0, before: 0, all: faults.clone(), faults, counted: None };
        Self { name: name.to_owned(), track: Mutex::new(track), stream, trouble: Mutex::default() }
    }

    /// Records the lines that a reader passes on.
    pub(super) fn push(&self, read: &ReadLines) -> Result<()> {
        let (columns, n) = (self.stream.columns.len(), read.values.len());
        if n != read.arrived_ns.len() * columns {
            let (name, columns) = (&self.name, self.stream.columns.join(", "));
            return Err(problem!("source {name}: {n} values; must be one per column: {columns}").into());
        }
        if read.trouble.is_some() || !read.arrived_ns.is_empty() {
            // A line that failed is there again where numbers arrive.
            lock(&self.trouble).clone_from(&read.trouble);
        }
        for (values, &at_ns) in read.values.chunks_exact(columns).zip(&read.arrived_ns) {
            let faults = |faults: &mut StreamFaults| faults.line(&self.stream, values, at_ns);
            self.record(faults, |track, number| track.sample(at_ns, number, values))?;
        }
        for (at_ns, text) in &read.unread {
            let strange = |faults: &mut StreamFaults| faults.found.counts[Cause::Strange] += 1;
            self.record(strange, |track, number| track.strange_line(*at_ns, number, text))?;
        }
        self.count_left_out(&read.counts)
    }

    /// Counts a line with its faults, and records it if a recording runs. Each line belongs to one recording.
    fn record(
        &self,
        count: impl Fn(&mut StreamFaults),
        write: impl FnOnce(&SourceWriter, u64) -> Result<()>,
    ) -> Result<()> {
        let mut current = lock(&self.track);
        let number = current.lines;
        current.lines += 1;
        count(&mut current.faults);
        count(&mut current.all);
        current.track.as_ref().map_or(Ok(()), |track| write(track, number))
    }

    /// Counts bytes that arrived and are in no line; an unfinished recording states them too.
    fn count_left_out(&self, bytes: &Counts) -> Result<()> {
        if bytes.iter().next().is_none() {
            return Ok(());
        }
        let mut current = lock(&self.track);
        current.faults.add(bytes);
        current.all.add(bytes);
        if let Some(track) = &current.track {
            track.note_left_out();
        }
        if current.counted.is_some_and(|counted| counted.elapsed() < COUNTS_EVERY) {
            return Ok(());
        }
        current.counted = Some(Instant::now());
        let counts = losses_of_lines(current.lines - current.before, &current.faults.found);
        current.track.as_ref().map_or(Ok(()), |track| track.counts(now_ns(), &counts))
    }

    /// Records into this part of a recording from now on, or not at all; ends the previous part with its counts, and
    /// returns them.
    pub(super) fn record_into(&self, track: Option<SourceWriter>) -> SourceCounts {
        let mut current = lock(&self.track);
        let ended = std::mem::replace(&mut current.track, track);
        let faults = std::mem::replace(&mut current.faults, StreamFaults::new(&self.stream)).found;
        let lines = current.lines - current.before;
        current.before = current.lines;
        drop(current);
        if let Some(track) = ended {
            track.end(losses_of_lines(lines, &faults));
        }
        self.counts_of(lines, faults)
    }

    pub(super) fn counts(&self) -> SourceCounts {
        let current = lock(&self.track);
        let (lines, faults) = (current.lines, current.all.found.clone());
        drop(current);
        self.counts_of(lines, faults)
    }

    fn counts_of(&self, lines: u64, faults: Found) -> SourceCounts {
        SourceCounts::Numbers(Box::new(LineCounts::new(lines, faults, lock(&self.trouble).clone())))
    }
}

/// The losses of a stream of numbers, as recordings state them.
pub(super) fn losses_of_lines(lines: u64, faults: &Found) -> recording::RecordingCounts {
    let decoder = faults.counts;
    recording::RecordingCounts { received: lines, recorded: lines, decoder, ..recording::RecordingCounts::default() }
}
