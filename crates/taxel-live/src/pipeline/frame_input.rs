//! Frames of numbers as the input of a pipeline: reads lines, makes frames of them, and passes these on as messages, as
//! datagrams of a board are.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use serde::Serialize;
use taxel_core::problem;

use super::source::OpenedLines;
use crate::Result;
use crate::capture::{MessageFeed, Origin, Receiver, ReceiverOptions};
use crate::frame_lines::{FrameAssembler, FrameLayout, UnreadLines, write_message};
use crate::line_input::LineReader;
use crate::line_place::LinePlace;
use crate::locked::lock;
use crate::recording::{Cause, Found, now_ns};
use crate::text_lines::TextLine;

/// Interval at which a reader checks whether there is room for its frames.
const ROOM_EVERY: Duration = Duration::from_millis(1);

/// Counts of lines of numbers.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct LineCounts {
    /// Number of lines, or of samples passed by a program.
    pub lines: u64,
    /// Number of lines that could not be parsed.
    pub strange: u64,
    /// Number of bytes that were left out, as they are in no line of numbers: what follows in a line that is longer than
    /// 65 536 bytes, and before the first line what cannot be one.
    pub bytes_in_no_line: u64,
    /// Number of bytes of lines whose end did not arrive, or whose beginning did not.
    pub bytes_of_unfinished_lines: u64,
    /// The system's last error, if reading failed.
    pub trouble: Option<String>,
    /// The lines of a source of frames that could not be parsed, by kind.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unread: Option<UnreadLines>,
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
            unread: None,
            faults,
        }
    }

    /// The difference from earlier counts.
    pub(super) fn since(&self, earlier: &Self) -> Self {
        let counts = self.faults.counts.since(&earlier.faults.counts);
        let faults = Found { counts, ..self.faults.clone() };
        let since = Self::new(self.lines - earlier.lines, faults, self.trouble.clone());
        Self { unread: self.unread.clone(), ..since }
    }
}

/// The input of a pipeline of frames.
pub(super) struct FrameInput {
    pub(super) layout: FrameLayout,
    /// The place; a program passes the numbers if there is none.
    place: Option<LinePlace>,
    state: Mutex<InputState>,
}

struct InputState {
    frames: FrameAssembler,
    feed: MessageFeed,
    message: Vec<u8>,
    trouble: Option<String>,
}

impl FrameInput {
    /// The input, and what a pipeline receives of it.
    pub(super) fn new(
        place: Option<LinePlace>,
        layout: FrameLayout,
        options: ReceiverOptions,
    ) -> (Arc<Self>, Receiver) {
        let origin = place.as_ref().map_or_else(|| "a program".to_owned(), ToString::to_string);
        let (receiver, feed) = Receiver::of_messages(Origin::Frames(origin), options, place.is_some());
        let frames = FrameAssembler::new(layout.clone());
        let state = Mutex::new(InputState { frames, feed, message: vec![], trouble: None });
        (Arc::new(Self { layout, place, state }), receiver)
    }

    /// Processes the numbers of a line that a program passes.
    pub(super) fn sample(&self, name: &str, arrived_ns: i64, values: &[f64]) -> Result<()> {
        let mut state = lock(&self.state);
        let InputState { frames, feed, message, .. } = &mut *state;
        if self.place.is_some() {
            return Err(
                problem!("source {name:?}: taxel reads its lines itself, so a program cannot give it values").into()
            );
        }
        if feed.is_over() {
            return Err(problem!("source {name:?}: has ended").into());
        }
        let frame = frames.push_values(values, arrived_ns).map_err(|error| error.in_part(&format!("source {name}")))?;
        if let Some((t, values)) = frame {
            write_message(t, values, message);
            feed.push(arrived_ns, message);
        }
        feed.send(now_ns());
        Ok(())
    }

    pub(super) fn counts(&self) -> LineCounts {
        let state = lock(&self.state);
        let counts = LineCounts::new(state.frames.lines(), state.frames.found(now_ns()), state.trouble.clone());
        LineCounts { unread: Some(state.frames.unread().clone()), ..counts }
    }

    /// Reads until the input or the pipeline ends; a line that failed is opened again. `opened` has read up to a line's start.
    pub(super) fn read(&self, opened: OpenedLines) {
        let OpenedLines { mut reader, begun, .. } = opened;
        {
            let mut state = lock(&self.state);
            begun.iter().for_each(|(line, at_ns)| state.line(line, *at_ns));
            state.feed.send(now_ns());
        }
        loop {
            if lock(&self.state).feed.is_over() {
                break;
            }
            let ended = match reader.fill() {
                Ok(ended) => ended,
                Err(error) => {
                    let mut state = lock(&self.state);
                    state.trouble = Some(reader.broken(error).to_string());
                    state.frames.restart();
                    drop(state);
                    reader.reopen();
                    continue;
                }
            };
            self.take_lines(&mut reader, ended);
            if ended {
                break;
            }
            while lock(&self.state).feed.is_full() {
                std::thread::sleep(ROOM_EVERY);
            }
        }
        let mut state = lock(&self.state);
        reader.lines.discard();
        state.frames.count_left_out(reader.lines.take_left_out());
        state.frames.end(now_ns());
        state.feed.close(None);
    }

    fn take_lines(&self, reader: &mut LineReader, ended: bool) {
        let mut state = lock(&self.state);
        while let Some((line, at_ns)) = reader.next_whole(ended, |line| state.frames.fits(line)) {
            state.line(&line, at_ns);
        }
        state.frames.count_left_out(reader.lines.take_left_out());
        if ended {
            state.end();
        }
        state.feed.send(now_ns());
    }
}

impl InputState {
    /// Processes a line of text.
    fn line(&mut self, line: &TextLine, arrived_ns: i64) {
        if let Some((t, values)) = self.frames.push(line, arrived_ns) {
            // A line that failed is there again.
            self.trouble = None;
            write_message(t, values, &mut self.message);
            self.feed.push(arrived_ns, &self.message);
        }
    }

    /// Ends the last frame, which no empty line may follow.
    fn end(&mut self) {
        let end = TextLine { text: String::new(), bytes: 0, cut: false };
        self.line(&end, now_ns());
    }
}
