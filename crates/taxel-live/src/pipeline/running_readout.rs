//! Encodes events and runs the readout: in the decoding thread, or in a separate one.

use taxel_core::Array;
use taxel_core::detect::{Detection, Detector, FrameTime, ReadoutStream};
use taxel_core::encode::Tare;
use taxel_core::problem;

use super::options::{LiveOptions, StatedTare};
use super::output::DetectionOutput;
use super::readout_queue::{QuietUntil, ReadoutInput};
use super::shared::PipelineShared;
use super::speculative_readout::SpeculativeReadout;
use super::tare_measurement::TareMeasurement;

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
    array: Array,
    frames: FrameTime,
}

enum Mode {
    Reading(SpeculativeReadout),
    Taring(Box<TareMeasurement>),
    /// State during a change between the two, and after an error.
    Idle,
}

impl Mode {
    fn reading(stream: ReadoutStream) -> Self {
        Self::Reading(SpeculativeReadout::new(Box::new(stream)))
    }
}

impl RunningReadout {
    /// The readout that the options state, where they state one: it measures a fresh tare where they say for how long, else it
    /// reads at once, with the saved tare where its encoder needs one.
    ///
    /// # Errors
    ///
    /// `Format` for a text that is no readout or no tare, `Problem` for a time that no tare takes, or a source of another
    /// unit; as [`Detector::stream`].
    pub(super) fn open(options: &LiveOptions) -> taxel_core::Result<Option<Self>> {
        let Some(text) = &options.readout else { return Ok(None) };
        let readout = Detector::from_json(text)?;
        match options.layout() {
            None => readout.check_unit("ticks")?,
            Some(layout) => readout.check_unit(&layout.unit).map_err(|error| {
                let unit = readout.unit().unwrap_or_default();
                problem!("{error}; if the values are in {unit}, add unit={unit} in --source")
            })?,
        }
        let (array, frames) = (options.array.clone(), options.frame_time());
        let mode = match &options.tare {
            Some(StatedTare::Seconds(seconds)) => {
                readout.check()?;
                Mode::Taring(Box::new(TareMeasurement::new(tare_us(*seconds)?, Box::new(readout), &array)))
            }
            Some(StatedTare::Saved(text)) => {
                Mode::reading(readout.stream(&array, frames, Some(&Tare::from_json(text)?))?)
            }
            None => Mode::reading(readout.stream(&array, frames, None)?),
        };
        Ok(Some(Self { mode, found: vec![], array, frames }))
    }

    /// Publishes whether it measures a tare, and the rest that it reads with, before the first events.
    pub(super) fn begin(&self, shared: &PipelineShared) {
        shared.published().counters.readout.taring = matches!(self.mode, Mode::Taring(_));
        self.publish_rest(shared);
    }

    /// Runs in a separate thread: processes the queue until its end, and passes detections to the output.
    pub(super) fn run(mut self, shared: &PipelineShared, output: &DetectionOutput) {
        let mut input = ReadoutInput::new(&self.array);
        loop {
            if !self.found.is_empty() {
                output.add(shared, &mut self.found);
                output.run(shared);
            }
            if input.last {
                break;
            }
            shared.readout_queue.pop(&mut input);
            self.process(shared, &input);
        }
    }

    /// Processes input; an error ends the pipeline.
    pub(super) fn process(&mut self, shared: &PipelineShared, input: &ReadoutInput) {
        if let Err(error) = self.try_process(shared, input) {
            shared.fail(error);
            self.mode = Mode::Idle;
        }
    }

    fn try_process(&mut self, shared: &PipelineShared, input: &ReadoutInput) -> crate::Result<()> {
        let ReadoutInput { events, frames, zeroings, quiet, last } = input;
        match &mut self.mode {
            Mode::Reading(readout) => {
                zeroings.iter().try_for_each(|zeroing| readout.zero(zeroing))?;
                readout.push(events.view(), &mut self.found)?;
                for (t, frame) in frames.view(&self.array).iter() {
                    readout.push_frame(t, frame, &mut self.found)?;
                }
                match *quiet {
                    Some(QuietUntil::Ended) => readout.finish(&mut self.found)?,
                    Some(QuietUntil::ByBoard(t)) => readout.advance(t, &mut self.found)?,
                    Some(QuietUntil::ByHostClock(t)) if *last => readout.advance(t, &mut self.found)?,
                    Some(QuietUntil::ByHostClock(t)) => readout.advance_silence(t, &mut self.found)?,
                    None => {}
                }
            }
            Mode::Taring(measurement) => {
                let over = match measurement.push_frames(frames.view(&self.array))? {
                    None if frames.is_empty() => measurement.push(events, quiet.map(QuietUntil::certain))?,
                    over => over,
                };
                if let Some((stop, inside)) = over {
                    self.begin_reading(shared, input, stop, inside)?;
                }
            }
            Mode::Idle => {}
        }
        if !events.is_empty() || !frames.is_empty() || *last {
            let counters = &mut shared.published().counters;
            counters.readout.read_out += (events.len() + frames.t.len()) as u64;
            if let Mode::Reading(readout) = &self.mode {
                (counters.readout.late, counters.readout.wrong) = (readout.late(), readout.wrong());
                counters.readout.left_floor = readout.left_floor();
            }
        }
        Ok(())
    }

    /// Ends the tare: runs the readout from the first event or frame after it on, the one with the number `inside`.
    fn begin_reading(
        &mut self,
        shared: &PipelineShared,
        input: &ReadoutInput,
        stop: i64,
        inside: usize,
    ) -> crate::Result<()> {
        let Mode::Taring(measurement) = std::mem::replace(&mut self.mode, Mode::Idle) else { return Ok(()) };
        let (tare, stream) = measurement.finish(stop, self.frames)?;
        let mut readout = SpeculativeReadout::new(Box::new(stream));
        if input.frames.is_empty() {
            readout.push(input.events.view().piece(inside..input.events.len()), &mut self.found)?;
        }
        for (t, frame) in input.frames.view(&self.array).iter().skip(inside) {
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
