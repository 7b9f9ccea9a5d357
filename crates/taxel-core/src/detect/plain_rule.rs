//! A detector without training: a load above a threshold for some frames.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::allowed::above_0;
use crate::detect::running_rule::{EdgeNumbers, Limits, RunningRule};
use crate::detect::stream::Way;
use crate::detect::{FrameClock, FrameTime, ReadoutStream, TrainingData, file};
use crate::encode::{Quantity, Tare};
use crate::spikes::us;
use crate::{Array, Result, problem, reading};

#[cfg(test)]
mod tests;

/// The largest number of frames in a row.
const MOST_FRAMES: u32 = 1_000_000;

/// The latest age at which a rule may decide, ms.
const LATEST_AGE_MS: f64 = 60_000.0;

/// The age of a touch at which a rule decides.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Age {
    /// So long after its begin, ms.
    Ms(f64),
    /// Its end.
    Named(NamedAge),
}

/// An age that is no number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NamedAge {
    /// When the touch ends.
    End,
}

/// A load above a threshold for some frames, with a label for its onset and one for its end.
///
/// The sensor is loaded from the first of `frames` frames in a row in which the quantity is at least the threshold, to
/// the first of `frames` frames in a row in which it is below `release` times the threshold. A detection's `t` is the
/// time of the first of these frames; it is `known` when the last one is complete. A frame's quantity is that after its
/// last event; its time is the stamp with which the quantity passed the threshold. A frame of the input is one frame.
///
/// A quantity with levels thus rises to n after it was at most r with the threshold n and the release (r + 1) / n, and falls to r after it
/// was at least n. With `dated_at` `t` is when the quantity last rose to that value, or fell below it; what the rule detects,
/// and when it is known, stay the same. With `of_largest` the load ends where the quantity is below `release` times its
/// largest value since the begin, and both it and the threshold are above a rest, which is 0 at first, follows the quantity
/// down while nothing is loaded, and is where the quantity was as a load ended.
///
/// With an age it decides once a touch. A touch begins with the first frame in which the area is 2 taxels or more, and
/// ends with the first in which it is less. The label is that of the quantity in the frame that holds at the age after
/// the touch's begin, below the threshold or not; `t` is the begin, and `known` the end of that frame. At the end of a touch
/// it is that of its duration, and `known` the end of the frame in which the touch ends.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlainRule {
    /// What is compared with the threshold.
    pub quantity: Quantity,
    /// The threshold, above 0: taxels, units of noise, or the sensor's unit.
    pub threshold: f64,
    /// The part of the threshold below which the load ends, above 0, at most 1; 1 with an age.
    pub release: f64,
    /// The number of frames in a row, 1 or more; 1 with an age.
    pub frames: u32,
    /// The levels of a count, or of the area where a touch began, above 0 and ascending; none of other quantities.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub levels: Vec<f64>,
    /// The value at which `t` is dated, from `release` times the threshold to the threshold; `None`: onset and end are
    /// dated at these.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dated_at: Option<f64>,
    /// Whether `release` is a part of the largest value since the load began, above a rest that follows.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub of_largest: bool,
    /// The age of a touch at which the rule decides between two kinds, ms; `None`: it detects onsets and ends.
    pub age_ms: Option<Age>,
    /// The labels of onset and end, or of the kinds below and above the threshold; `None` omits those detections.
    pub labels: [Option<String>; 2],
    /// The board's noise floor, 0 or more, in the sensor's unit (ticks).
    pub noise_floor: f64,
    /// The unit of the values on which it was tuned, as of a readout.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// The taxels' rest. It is valid for one board on one day: a saved rule has none and receives one when it is used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tare: Option<Tare>,
    /// What the data of the training were like; `None` if it is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub training: Option<TrainingData>,
}

impl PlainRule {
    /// The name of the format in the file.
    pub(in crate::detect) const FORMAT: &str = "taxel plain rule";

    /// Checks that each part is valid and that the parts fit together.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the part.
    pub fn check(&self) -> Result<()> {
        above_0("threshold", self.threshold, "")?;
        if !(self.release > 0.0 && self.release <= 1.0) {
            return Err(problem!("release"; " is {}: must be above 0 and at most 1", self.release));
        }
        if !(1..=MOST_FRAMES).contains(&self.frames) {
            return Err(problem!("frames"; " is {}: must be from 1 to {MOST_FRAMES}", self.frames));
        }
        self.check_levels()?;
        self.check_dated()?;
        if (self.quantity == Quantity::Duration) != matches!(self.age_ms, Some(Age::Named(NamedAge::End))) {
            return Err(problem!("age_ms"; " end and the quantity duration: must be given together"));
        }
        if let Some(age) = self.age_ms {
            if let Age::Ms(age) = age
                && !(0.0..=LATEST_AGE_MS).contains(&age)
            {
                return Err(problem!("age_ms"; " is {age}: must be from 0 to {LATEST_AGE_MS}"));
            }
            if self.release < 1.0 || self.frames > 1 {
                return Err(problem!(
                    "release is {} and frames is {}: with age_ms both must be 1, because a touch then begins with the first \
                     frame in which 2 taxels are loaded",
                    self.release,
                    self.frames
                ));
            }
        }
        if !(self.noise_floor >= 0.0 && self.noise_floor.is_finite()) {
            return Err(problem!("noise_floor"; " is {}: must be 0 or more, and finite", self.noise_floor));
        }
        file::check_unit(self.unit.as_deref())?;
        match &self.labels {
            [None, None] => return Err(problem!("labels"; " are both left out: give one or both")),
            [first, second] if first == second => {
                return Err(problem!("labels"; " are both {}: must differ", first.as_deref().unwrap_or_default()));
            }
            labels if labels.iter().flatten().any(|label| label.trim().is_empty()) => {
                return Err(problem!("labels"; ": a label is empty: must be a name, or left out"));
            }
            _ => {}
        }
        self.training.as_ref().map_or(Ok(()), TrainingData::check)?;
        self.tare.as_ref().map_or(Ok(()), Tare::check)
    }

    fn check_levels(&self) -> Result<()> {
        if self.quantity.has_levels() == self.levels.is_empty() {
            return Err(problem!("levels"; " and a count, or begin_area: must be given together"));
        }
        for (k, &level) in self.levels.iter().enumerate() {
            above_0("levels", level, "")?;
            if k > 0 && self.levels[k - 1] as f32 >= level as f32 {
                return Err(problem!("levels"; ": {level} comes after {}; must ascend", self.levels[k - 1]));
            }
        }
        Ok(())
    }

    fn check_dated(&self) -> Result<()> {
        let (end, threshold) = (self.release * self.threshold, self.threshold);
        match self.dated_at {
            Some(_) if self.age_ms.is_some() || self.of_largest => {
                Err(problem!("dated_at"; ": must be left out with age_ms, and with of_largest"))
            }
            Some(at) if !(end..=threshold).contains(&at) => {
                Err(problem!("dated_at"; " is {at}: must be from {end}, where the load ends, to {threshold}"))
            }
            None if self.age_ms.is_some() && self.of_largest => {
                Err(problem!("of_largest"; ": must be left out with age_ms"))
            }
            _ => Ok(()),
        }
    }

    /// Starts a stream for an array with frames of this duration.
    ///
    /// # Errors
    ///
    /// `Problem` if a part is not valid, if there is no tare or one of another array, or if the period is not valid.
    pub fn stream(&self, array: &Array, frames: impl Into<FrameTime>, tare: Option<&Tare>) -> Result<ReadoutStream> {
        let way = self.way(array, tare)?;
        Ok(ReadoutStream::new(vec![way], array.clone(), FrameClock::new(frames)?))
    }

    /// The way of its stream, for an array.
    pub(super) fn way(&self, array: &Array, tare: Option<&Tare>) -> Result<Way> {
        self.check()?;
        let loads = Quantity::stream(&self.read(), &self.levels, array, tare.or(self.tare.as_ref()), self.noise_floor)?;
        Ok(Way::of_rule(loads, RunningRule::new(self.limits()), self.labels.clone()))
    }

    /// The quantities that it reads: the one that is compared with the threshold, and with an age the area.
    fn read(&self) -> Vec<Quantity> {
        if self.quantity == Quantity::Duration {
            return vec![Quantity::Area];
        }
        let mut read = vec![self.quantity];
        if self.age_ms.is_some() && self.quantity != Quantity::Area {
            read.push(Quantity::Area);
        }
        read
    }

    /// The numbers by which it finds begins and ends of loads.
    fn edges(&self) -> EdgeNumbers {
        let Self { threshold, release, frames, dated_at, of_largest, .. } = *self;
        EdgeNumbers { threshold, release, frames, dated_at, of_largest }
    }

    /// How it decides; the parts must have been checked.
    fn limits(&self) -> Limits {
        match self.age_ms {
            Some(Age::Ms(age)) => Limits::at_age(self.read().len() as u32 - 1, self.threshold, age),
            Some(Age::Named(NamedAge::End)) => Limits::at_end(self.threshold),
            None => Limits::at_edges(&self.edges()),
        }
    }

    /// The noise floor above the tare, in the sensor's unit; 0 of quantities that follow or need no rest.
    pub(super) fn floor_above_tare(&self) -> f64 {
        if self.quantity.is_local() || self.quantity == Quantity::RangeCount { 0.0 } else { self.noise_floor }
    }

    /// The time after the last input within which its last detection is complete, us.
    pub(super) fn reach_us(&self, period_us: f64) -> i64 {
        (f64::from(self.frames) * period_us
            + match self.age_ms {
                Some(Age::Ms(age)) => us(age),
                _ => 0.0,
            })
        .ceil() as i64
    }

    /// Reads a rule from the text of its file and checks it.
    ///
    /// # Errors
    ///
    /// `Format` if the text is not a rule, has an unknown version, or has parts that are not valid.
    pub fn from_json(text: &str) -> Result<Self> {
        Self::from_parts(file::parts("plain rule", text, &[Self::FORMAT])?.1)
    }

    /// As [`PlainRule::from_json`], from the contents of the file without format and version.
    pub(super) fn from_parts(parts: Value) -> Result<Self> {
        let rule: Self = reading::from_value(parts).map_err(|unfit| unfit.format("plain rule"))?;
        rule.check().map_err(|error| error.in_part("plain rule").into_format())?;
        Ok(rule)
    }

    /// The rule as the text of its file; reading it returns exactly the same numbers.
    #[must_use]
    pub fn to_json(&self) -> String {
        file::text(Self::FORMAT, self)
    }
}
