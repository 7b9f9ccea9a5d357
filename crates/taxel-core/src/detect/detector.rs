//! What makes detections: a readout or a plain rule, whichever a file holds.

use crate::detect::{Detection, FrameTime, PlainRule, Readout, ReadoutStream, file};
use crate::encode::{Tare, Zeroing};
use crate::rest::LeftFloor;
use crate::{Array, EventsView, FramesView, Result, Stop, problem};

/// The time that a recording is continued after its last event or frame, us: longer than any input can keep a
/// potential rising (the slowest neuron of Table 6.2 peaks after 190 ms).
pub(super) const SILENCE_US: i64 = 1_000_000;

/// A readout or a plain rule.
#[expect(clippy::large_enum_variant, reason = "there is one by pipeline, moved once")]
#[derive(Debug, Clone, PartialEq)]
pub enum Detector {
    /// Trained neurons.
    Readout(Readout),
    /// A load above a threshold.
    PlainRule(PlainRule),
}

impl From<Readout> for Detector {
    fn from(readout: Readout) -> Self {
        Self::Readout(readout)
    }
}

impl From<PlainRule> for Detector {
    fn from(rule: PlainRule) -> Self {
        Self::PlainRule(rule)
    }
}

impl Detector {
    /// Reads a readout or a plain rule from the text of its file, whichever it is, and checks it.
    ///
    /// # Errors
    ///
    /// `Format` if the text is neither, has an unknown version, or has parts that are not valid.
    pub fn from_json(text: &str) -> Result<Self> {
        let (format, parts) = file::parts("readout", text, &[Readout::FORMAT, PlainRule::FORMAT])?;
        if format == Readout::FORMAT {
            Readout::from_parts(parts).map(Self::Readout)
        } else {
            PlainRule::from_parts(parts).map(Self::PlainRule)
        }
    }

    /// The text of its file; reading it returns exactly the same numbers.
    #[must_use]
    pub fn to_json(&self) -> String {
        match self {
            Self::Readout(readout) => readout.to_json(),
            Self::PlainRule(rule) => rule.to_json(),
        }
    }

    /// Checks that each part is valid and that the parts fit together.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the part.
    pub fn check(&self) -> Result<()> {
        match self {
            Self::Readout(readout) => readout.check(),
            Self::PlainRule(rule) => rule.check(),
        }
    }

    /// The unit of the values that it was trained on, if it is known.
    #[must_use]
    pub fn unit(&self) -> Option<&str> {
        match self {
            Self::Readout(readout) => readout.unit.as_deref(),
            Self::PlainRule(rule) => rule.unit.as_deref(),
        }
    }

    /// Checks that values in this unit are those that it was trained on.
    ///
    /// # Errors
    ///
    /// `Problem`, naming both units.
    pub fn check_unit(&self, unit: &str) -> Result<()> {
        let kind = match self {
            Self::Readout(_) => "readout",
            Self::PlainRule(_) => "plain rule",
        };
        match self.unit().filter(|&trained| trained != unit) {
            None => Ok(()),
            Some(trained) => Err(problem!(
                "live values are in {unit}, but the {kind} was trained on {trained}: give values in {trained}, or train a \
                 {kind} on recordings in {unit}"
            )),
        }
    }

    /// Starts a stream for an array with frames of this duration.
    ///
    /// # Errors
    ///
    /// Those of [`Readout::stream`] and [`PlainRule::stream`].
    pub fn stream(&self, array: &Array, frames: impl Into<FrameTime>, tare: Option<&Tare>) -> Result<ReadoutStream> {
        let frames = frames.into();
        let stream = match self {
            Self::Readout(readout) => readout.stream(array, frames, tare)?,
            Self::PlainRule(rule) => rule.stream(array, frames, tare)?,
        };
        Ok(stream.with_silence(self.silence_us(frames)))
    }

    /// The time that a recording is continued after its end, us.
    fn silence_us(&self, frames: FrameTime) -> i64 {
        SILENCE_US
            + match self {
                Self::Readout(readout) => readout.reach_us(frames.period_us),
                Self::PlainRule(rule) => rule.reach_us(frames.period_us),
            }
    }

    /// The detections of a whole recording of events with taxels that a person zeroed, continued by a second of
    /// silence. Nothing is detected before `begin` us ([`ReadoutStream::begin_at`]).
    ///
    /// # Errors
    ///
    /// Those of [`Detector::stream`], [`ReadoutStream::zero`], [`ReadoutStream::push_events`] and
    /// [`EventsView::check_order`]; `Interrupted` if asked to stop.
    pub fn run_events(
        &self,
        events: EventsView<'_>,
        frames: impl Into<FrameTime>,
        tare: Option<&Tare>,
        zeroings: &[Zeroing],
        begin: Option<i64>,
        stop: Stop<'_>,
    ) -> Result<Vec<Detection>> {
        let last = events.t.iter().copied().chain(events.markers.iter().map(|m| m.t)).max().unwrap_or(0);
        let mut stream = self.stream(events.array, frames, tare)?;
        begin.into_iter().for_each(|t| stream.begin_at(t));
        zeroings.iter().try_for_each(|zeroing| stream.zero(zeroing))?;
        events.check_order()?;
        let mut found = stream.push_recording(events, stop)?;
        stream.finish(last, &mut found)?;
        Ok(found)
    }

    /// The detections of a whole recording of frames, and since when what is at rest is outside its noise floor, with taxels that a person zeroed, continued for a second with the
    /// last frame. Frames last `frame_us`, or by default
    /// the median distance between frames. Nothing is detected before `begin` us: of the frames before it, at rest, only
    /// the last one is read.
    ///
    /// # Errors
    ///
    /// Those of [`Detector::stream`], [`ReadoutStream::zero`] and [`ReadoutStream::push_frames`]; `Interrupted` if asked to
    /// stop.
    pub fn run_frames(
        &self,
        frames: FramesView<'_>,
        frame_us: Option<f64>,
        tare: Option<&Tare>,
        zeroings: &[Zeroing],
        begin: Option<i64>,
        stop: Stop<'_>,
    ) -> Result<(Vec<Detection>, Option<LeftFloor>)> {
        let frame_us = match frame_us {
            Some(frame_us) => frame_us,
            None => usual_distance(frames.t)?,
        };
        let last = frames.t.last().copied().unwrap_or(0);
        let mut stream = self.stream(frames.array, frame_us, tare)?;
        frames.check()?;
        begin.into_iter().for_each(|t| stream.begin_at(t));
        zeroings.iter().try_for_each(|zeroing| stream.zero(zeroing))?;
        let first = begin.map_or(0, |begin| frames.t.partition_point(|&t| t < begin).saturating_sub(1));
        let rest = FramesView { t: &frames.t[first..], values: &frames.values[first * frames.array.len()..], ..frames };
        let mut found = stream.push_frames(rest, stop)?;
        stream.finish(last, &mut found)?;
        Ok((found, stream.left_floor()))
    }
}

/// The median distance between frames, us.
pub(super) fn usual_distance(t: &[i64]) -> Result<f64> {
    let mut apart: Vec<u64> = t.windows(2).map(|w| w[1].abs_diff(w[0])).collect();
    if t.is_empty() {
        return Err(problem!("there are no frames, so nothing can be detected"));
    }
    if apart.is_empty() {
        return Err(problem!("there is only one frame, which does not show how long a frame lasts: give frame_us"));
    }
    let middle = apart.len() / 2;
    Ok(*apart.select_nth_unstable(middle).1 as f64)
}
