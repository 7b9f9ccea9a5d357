//! Frames of numbers as the input of a pipeline: a reader of lines, or a program, passes them, and they go on as messages, as
//! datagrams of a board do.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use serde::Serialize;
use taxel_core::problem;

use super::frame_block::write_message;
use super::frame_times::FrameTimes;
use super::source::FrameLayout;
use crate::Result;
use crate::capture::{MessageFeed, Origin, Receiver};
use crate::locked::lock;
use crate::recording::{Cause, Counts, Found, now_ns};

/// Interval at which a caller checks whether there is room for its frames.
const ROOM_EVERY: Duration = Duration::from_millis(1);

/// Lines that a reader passes on at once.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReadLines {
    /// When each frame arrived, ns since 1970.
    pub arrived_ns: Vec<i64>,
    /// The stamp of each frame; empty if they have none.
    pub stamps: Vec<f64>,
    /// The values of all frames, row by row.
    pub values: Vec<f64>,
    /// Number of lines, with those that could not be read.
    pub lines: u64,
    /// What could not be read: lines, bytes in no line, bytes of unfinished lines.
    pub counts: Counts,
    /// Lines that were not read, as they came, with their arrival; text before the first numbers is not counted.
    pub unread: Vec<(i64, String)>,
    /// The system's error, if reading fails now.
    pub trouble: Option<String>,
    /// All that arrived before this time, ns since 1970, was read.
    pub until_ns: i64,
}

/// Counts of lines of numbers.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct LineCounts {
    /// Number of lines, or of samples passed by a program.
    pub lines: u64,
    /// Number of lines that could not be read.
    pub strange: u64,
    /// Number of bytes that were left out, as they are in no line: what follows in a line that is longer than 65 536 bytes.
    pub bytes_in_no_line: u64,
    /// Number of bytes of lines whose end did not arrive, or whose beginning did not.
    pub bytes_of_unfinished_lines: u64,
    /// The system's last error, if reading failed.
    pub trouble: Option<String>,
    /// What is wrong with the lines and stamps, as a verdict states it.
    #[serde(skip)]
    pub faults: Found,
}

impl LineCounts {
    /// The counts of so many lines with these faults.
    pub(super) fn new(lines: u64, faults: Found, trouble: Option<String>) -> Self {
        Self {
            lines,
            strange: faults.counts[Cause::Strange],
            bytes_in_no_line: faults.counts[Cause::InNoLine],
            bytes_of_unfinished_lines: faults.counts[Cause::UnfinishedLines],
            trouble,
            faults,
        }
    }

    /// The difference from earlier counts.
    pub(super) fn since(&self, earlier: &Self) -> Self {
        let counts = self.faults.counts.since(&earlier.faults.counts);
        // A doubt from before is not one of times that arrived since by a clock that was sound.
        let is_doubtful = [Cause::Jumps, Cause::StampsBack, Cause::Drifts].iter().any(|&cause| counts[cause] > 0);
        let doubtful_after_us = self.faults.doubtful_after_us.filter(|_| is_doubtful);
        let faults = Found { counts, doubtful_after_us, ..self.faults.clone() };
        Self::new(self.lines - earlier.lines, faults, self.trouble.clone())
    }
}

/// The input of a pipeline of frames.
pub(super) struct FrameInput {
    taxels: usize,
    state: Mutex<InputState>,
}

struct InputState {
    times: FrameTimes,
    lines: u64,
    feed: MessageFeed,
    message: Vec<u8>,
    trouble: Option<String>,
}

impl FrameInput {
    /// The input, and what a pipeline receives of it.
    pub(super) fn new(place: &str, layout: &FrameLayout) -> (Arc<Self>, Receiver) {
        let (receiver, feed) = Receiver::of_messages(Origin::Frames(place.to_owned()));
        let times = FrameTimes::new(layout);
        let state = Mutex::new(InputState { times, lines: 0, feed, message: vec![], trouble: None });
        (Arc::new(Self { taxels: layout.array.len(), state }), receiver)
    }

    /// Passes frames on, and waits until there is room for more.
    pub(super) fn push(&self, name: &str, read: &ReadLines) -> Result<()> {
        let taxels = self.taxels;
        let (frames, values, stamps) = (read.arrived_ns.len(), read.values.len(), read.stamps.len());
        if values != frames * taxels || !(stamps == 0 || stamps == frames) {
            return Err(problem!("source {name}: {values} values: must be {taxels} per frame").into());
        }
        let mut state = lock(&self.state);
        if state.feed.is_over() {
            return Err(problem!("source {name:?}: has ended").into());
        }
        state.push(read, taxels);
        drop(state);
        while lock(&self.state).feed.is_full() {
            std::thread::sleep(ROOM_EVERY);
        }
        Ok(())
    }

    /// Ends the input: no more frames can come.
    pub(super) fn end(&self) {
        let mut state = lock(&self.state);
        state.times.end(now_ns());
        state.feed.close(None);
    }

    pub(super) fn counts(&self) -> LineCounts {
        let state = lock(&self.state);
        LineCounts::new(state.lines, state.times.found(now_ns()), state.trouble.clone())
    }
}

impl InputState {
    fn push(&mut self, read: &ReadLines, taxels: usize) {
        self.lines += read.lines;
        self.times.faults.found.counts.extend(read.counts.iter());
        if read.trouble.is_some() || !read.arrived_ns.is_empty() {
            // A line that failed is there again where frames arrive.
            self.trouble.clone_from(&read.trouble);
        }
        let mut frame = vec![];
        for (k, (values, &arrived_ns)) in read.values.chunks_exact(taxels).zip(&read.arrived_ns).enumerate() {
            let Some(t) = self.times.time(read.stamps.get(k).copied(), arrived_ns) else {
                self.times.faults.found.counts[Cause::Strange] += 1;
                continue;
            };
            self.times.faults.missing(values.iter().copied());
            frame.clear();
            // Values of frames have 32 bits, as in recordings.
            #[allow(clippy::cast_possible_truncation)]
            frame.extend(values.iter().map(|&value| value as f32));
            write_message(t, &frame, &mut self.message);
            self.feed.push(arrived_ns, &self.message);
        }
        self.feed.send(read.until_ns);
    }
}
