//! Encodes events and runs the readout: in the decoding thread, or in a separate one.

use taxel_core::detect::{Detection, Detector, FrameTime, ReadoutStream};
use taxel_core::encode::{Tare, Zeroing};
use taxel_core::problem;
use taxel_core::{Array, Events};

use super::frame_block::FrameBlock;
use super::options::{LiveOptions, StatedTare};
use super::output::DetectionOutput;
use super::readout_queue::{BatchEnd, QuietUntil};
use super::shared::PipelineShared;
use super::speculative_readout::SpeculativeReadout;
use super::tare_measurement::TareMeasurement;

/// What is to read the events out.
pub enum ReadoutSetup {
    /// Nothing: datagrams are received and recorded only.
    None,
    /// A readout or a plain rule.
    Reading(Box<ReadoutStream>),
    /// A readout or a plain rule that first measures a tare: from the first event on for so long (us of the board's clock), or until the
    /// board marks a start.
    Taring(i64, Box<Detector>),
}

impl ReadoutSetup {
    /// The setup of a readout, where there is one, for frames of this length: it measures a fresh tare where the options say for
    /// how long, else it reads at once, with the saved tare where its encoder needs one.
    ///
    /// # Errors
    ///
    /// `Format` for a text that is no tare, `Problem` for a time that no tare takes; as [`Detector::stream`].
    pub fn new(readout: Option<Detector>, options: &LiveOptions, frames: FrameTime) -> taxel_core::Result<Self> {
        let Some(readout) = readout else { return Ok(Self::None) };
        let tare = match &options.tare {
            Some(StatedTare::Seconds(seconds)) => return Ok(Self::Taring(tare_us(*seconds)?, Box::new(readout))),
            Some(StatedTare::Saved(text)) => Some(Tare::from_json(text)?),
            None => None,
        };
        Ok(Self::Reading(Box::new(readout.stream(&options.array, frames, tare.as_ref())?)))
    }
}

/// How long a fresh tare takes, us.
#[allow(clippy::cast_possible_truncation)]
fn tare_us(seconds: f64) -> taxel_core::Result<i64> {
    if !(1e-6..=3600.0).contains(&seconds) {
        return Err(problem!("tare"; " is {seconds} s: must be from 1 us to an hour, or a taxel.Tare"));
    }
    Ok((seconds * 1e6).round_ties_even() as i64)
}

pub(super) struct RunningReadout {
    mode: Mode,
    /// Detections that do not wait for output yet.
    pub(super) found: Vec<Detection>,
    events: Events,
    /// Frames, in place of events, if the source sends them.
    block: FrameBlock,
    zeroings: Vec<Zeroing>,
    frames: FrameTime,
}

enum Mode {
    Reading(SpeculativeReadout),
    Taring(Box<TareMeasurement>),
    /// State during a change between the two, and after an error.
    Idle,
}

impl RunningReadout {
    pub(super) fn new(readout: ReadoutSetup, array: &Array, frames: FrameTime) -> Self {
        let events = Events::empty(array.clone());
        let mode = match readout {
            ReadoutSetup::None => Mode::Idle,
            ReadoutSetup::Reading(stream) => Mode::Reading(SpeculativeReadout::new(stream)),
            ReadoutSetup::Taring(stretch_us, readout) => {
                Mode::Taring(Box::new(TareMeasurement::new(stretch_us, readout, array)))
            }
        };
        Self { mode, found: vec![], events, block: FrameBlock::default(), zeroings: vec![], frames }
    }

    /// Publishes whether it measures a tare, and the rest that it reads with, before the first events.
    pub(super) fn begin(&self, shared: &PipelineShared) {
        shared.published().counters.readout.taring = matches!(self.mode, Mode::Taring(_));
        self.publish_rest(shared);
    }

    /// Runs in a separate thread: processes the queue until its end, and passes detections to the output.
    pub(super) fn run(mut self, shared: &PipelineShared, output: &DetectionOutput) {
        let mut last = false;
        loop {
            if !self.found.is_empty() {
                output.add(shared, &mut self.found);
                output.run(shared);
            }
            if last {
                break;
            }
            let end = shared.readout_queue.pop(&mut self.events, &mut self.block, &mut self.zeroings);
            self.process(shared, end);
            last = end.last;
        }
    }

    /// In the thread that decodes: reads its events out, and leaves the memory of the last ones there.
    pub(super) fn push(&mut self, shared: &PipelineShared, events: &mut Events, end: BatchEnd) {
        std::mem::swap(&mut self.events, events);
        self.process(shared, end);
        self.events.clear();
    }

    /// As [`RunningReadout::push`], of frames.
    pub(super) fn push_frames(&mut self, shared: &PipelineShared, frames: &mut FrameBlock) {
        std::mem::swap(&mut self.block, frames);
        self.process(shared, BatchEnd { quiet: None, last: false });
        self.block.clear();
    }

    /// Advances time without events.
    pub(super) fn advance(&mut self, shared: &PipelineShared, end: BatchEnd) {
        self.events.clear();
        self.block.clear();
        self.process(shared, end);
    }

    /// Adds zeroings, each of which has its own time.
    pub(super) fn zero(&mut self, zeroings: &[Zeroing]) {
        self.zeroings.extend_from_slice(zeroings);
    }

    fn process(&mut self, shared: &PipelineShared, end: BatchEnd) {
        if let Err(error) = self.try_process(shared, end) {
            shared.fail(error);
            self.mode = Mode::Idle;
        }
    }

    fn try_process(&mut self, shared: &PipelineShared, end: BatchEnd) -> crate::Result<()> {
        match &mut self.mode {
            Mode::Reading(readout) => {
                self.zeroings.drain(..).try_for_each(|zeroing| readout.zero(&zeroing))?;
                readout.push(self.events.view(), &mut self.found)?;
                for (t, frame) in self.block.view(&self.events.array).iter() {
                    readout.push_frame(t, frame, &mut self.found)?;
                }
                match end.quiet {
                    Some(QuietUntil::Ended) => readout.finish(&mut self.found)?,
                    Some(QuietUntil::ByBoard(t)) => readout.advance(t, &mut self.found)?,
                    Some(QuietUntil::ByHostClock(t)) if end.last => readout.advance(t, &mut self.found)?,
                    Some(QuietUntil::ByHostClock(t)) => readout.advance_silence(t, &mut self.found)?,
                    None => {}
                }
            }
            Mode::Taring(measurement) => {
                let quiet_until = end.quiet.map(QuietUntil::certain);
                let frames = self.block.view(&self.events.array);
                let over = match measurement.push_frames(frames)? {
                    None if self.block.is_empty() => measurement.push(&self.events, quiet_until)?,
                    over => over,
                };
                if let Some((stop, inside)) = over {
                    self.begin_reading(shared, stop, inside)?;
                }
            }
            Mode::Idle => self.zeroings.clear(),
        }
        if !self.events.is_empty() || !self.block.is_empty() || end.last {
            let counters = &mut shared.published().counters;
            counters.readout.read_out += (self.events.len() + self.block.t.len()) as u64;
            if let Mode::Reading(readout) = &self.mode {
                (counters.readout.late, counters.readout.wrong) = (readout.late(), readout.wrong());
            }
        }
        Ok(())
    }

    /// Ends the tare: runs the readout from the first event or frame after it on.
    fn begin_reading(&mut self, shared: &PipelineShared, stop: i64, inside: usize) -> crate::Result<()> {
        let Mode::Taring(measurement) = std::mem::replace(&mut self.mode, Mode::Idle) else { return Ok(()) };
        let (tare, stream) = measurement.finish(stop, self.frames)?;
        let mut readout = SpeculativeReadout::new(Box::new(stream));
        if self.block.is_empty() {
            readout.push(self.events.view().piece(inside..self.events.len()), &mut self.found)?;
        }
        for (t, frame) in self.block.view(&self.events.array).iter().skip(inside) {
            readout.push_frame(t, frame, &mut self.found)?;
        }
        self.mode = Mode::Reading(readout);
        self.publish_rest(shared);
        let mut published = shared.published();
        published.counters.readout.taring = false;
        published.tare = Some(tare);
        Ok(())
    }

    /// Publishes the readout's current rest, if its encoder uses a tare.
    fn publish_rest(&self, shared: &PipelineShared) {
        if let Mode::Reading(readout) = &self.mode {
            let rest = readout.rest();
            shared.published().rest = if rest.iter().all(Option::is_none) { vec![] } else { rest };
        }
    }
}
