//! A detector without training: a load at a level.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::allowed::above_0;
use crate::detect::running_rule::{EdgeNumbers, Limits, RunningRule};
use crate::detect::stream::Way;
use crate::detect::{FrameClock, FrameTime, ReadoutStream, TrainingData, file};
use crate::encode::{Measure, Quantity, Tare};
use crate::rest::Following;
use crate::spikes::us;
use crate::{Array, Result, problem, reading};

#[cfg(test)]
mod tests;

/// The latest age at which a rule may decide, the longest quiet time and the largest constant, ms.
const LONGEST_MS: f64 = 60_000.0;

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

/// A load at a level, with a label for its onset and one for its end.
///
/// The sensor is loaded from the first frame in which the quantity is at least the level, until it has been below `release`
/// times the level for `quiet_ms`; the first values show whether it is loaded at first. A detection's `t` is when the
/// quantity came to the level, or below `release` times it, or with a date when it last rose to `date` times the level, or
/// fell below that; `constant_ms` is taken off. It is `known` when the frame is complete in which the load begins, or that
/// holds at the end of the quiet time. A frame's quantity is that after its last event; its time is the stamp with which the
/// quantity passed the level. A frame of the input is one frame. With `touched_ms` the quantity is 0 unless the sensor has
/// been touched for so long (an area of 1 or more).
///
/// With an age it decides once a touch. A touch begins with the first frame in which the area is 2 taxels or more, and
/// ends with the first in which it is less. The label is that of the quantity in the frame that holds at the age after
/// the touch's begin, below the level or not; `t` is the begin, and `known` the end of that frame. At the end of a touch
/// it is that of its duration, and `known` the end of the frame in which the touch ends.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlainRule {
    /// What is compared with the level.
    pub quantity: Quantity,
    /// The level, above 0: taxels, units of noise, shares of ranges, ms, or the sensor's unit.
    pub level: f64,
    /// The part of the level below which the load ends, above 0, at most 1; 1 with an age.
    pub release: f64,
    /// For how long it is below that until the load has ended, ms; 0 with an age.
    pub quiet_ms: f64,
    /// The part of the level at which `t` is dated, from `release` to 1; `None`: onset and end are dated at level and
    /// release.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub date: Option<f64>,
    /// By how much labels are earlier than that at the median, ms, which is taken off `t`.
    pub constant_ms: f64,
    /// How long the sensor must have been touched, ms; before that the quantity counts as 0. `None`: it counts always.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub touched_ms: Option<f64>,
    /// The levels of a count, or of the area where a touch began, above 0 and ascending; none of other quantities.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub levels: Vec<f64>,
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
    /// How the rest of frames follows; `None`: it stays as it was measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rest: Option<Following>,
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
        above_0("level", self.level, "")?;
        if !(self.release > 0.0 && self.release <= 1.0) {
            return Err(problem!("release"; " is {}: must be above 0 and at most 1", self.release));
        }
        if !(0.0..=LONGEST_MS).contains(&self.quiet_ms) {
            return Err(problem!("quiet_ms"; " is {}: must be from 0 to {LONGEST_MS}", self.quiet_ms));
        }
        if let Some(touched) = self.touched_ms
            && !(0.0..=LONGEST_MS).contains(&touched)
        {
            return Err(problem!("touched_ms"; " is {touched}: must be from 0 to {LONGEST_MS}"));
        }
        if !(-LONGEST_MS..=LONGEST_MS).contains(&self.constant_ms) {
            return Err(problem!("constant_ms"; " is {}: must be within {LONGEST_MS} of 0", self.constant_ms));
        }
        if let Some(date) = self.date
            && !(self.release..=1.0).contains(&date)
        {
            return Err(problem!("date"; " is {date}: must be from {}, the release, to 1", self.release));
        }
        self.check_levels()?;
        if (self.quantity == Quantity::Duration) != matches!(self.age_ms, Some(Age::Named(NamedAge::End))) {
            return Err(problem!("age_ms"; " end and the quantity duration: must be given together"));
        }
        if let Some(age) = self.age_ms {
            if let Age::Ms(age) = age
                && !(0.0..=LONGEST_MS).contains(&age)
            {
                return Err(problem!("age_ms"; " is {age}: must be from 0 to {LONGEST_MS}"));
            }
            if self.touched_ms.is_some() {
                return Err(problem!("age_ms"; " and touched_ms: must not be given together"));
            }
            if self.release < 1.0 || self.quiet_ms > 0.0 || self.date.is_some() {
                return Err(problem!(
                    "age_ms"; " is given with a release below 1, a quiet time or a date: must be without them, because a \
                     touch then begins with the first frame in which 2 taxels are loaded"
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
        self.rest.as_ref().map_or(Ok(()), Following::check)?;
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

    /// Starts a stream for an array with frames of this duration.
    ///
    /// # Errors
    ///
    /// `Problem` if a part is not valid, if there is no tare or one of another array, or if the period is not valid.
    pub fn stream(&self, array: &Array, frames: impl Into<FrameTime>, tare: Option<&Tare>) -> Result<ReadoutStream> {
        let way = self.way(array, tare)?;
        let tare = tare.or(self.tare.as_ref());
        let rest = self.rest.zip(tare).map(|(following, tare)| tare.followed(array, following)).transpose()?;
        Ok(ReadoutStream::new(vec![way], array.clone(), FrameClock::new(frames)?, rest))
    }

    /// The way of its stream, for an array.
    pub(super) fn way(&self, array: &Array, tare: Option<&Tare>) -> Result<Way> {
        self.check()?;
        let tare = tare.or(self.tare.as_ref());
        let Self { levels, noise_floor, touched_ms, .. } = self;
        let measure = Measure { levels, noise_floor: *noise_floor, touched_ms: *touched_ms };
        let loads = Quantity::stream(&self.read(), measure, array, tare)?;
        let constant = us(self.constant_ms).round() as i64;
        Ok(Way::of_rule(loads, RunningRule::new(self.limits()), self.labels.clone(), constant))
    }

    /// The quantities that it reads: the one that is compared with the level, and with an age the area.
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

    /// How it decides; the parts must have been checked.
    fn limits(&self) -> Limits {
        let Self { level, release, quiet_ms, date, .. } = *self;
        match self.age_ms {
            Some(Age::Ms(age)) => Limits::at_age(self.read().len() as u32 - 1, level, age),
            Some(Age::Named(NamedAge::End)) => Limits::at_end(level),
            None => Limits::at_edges(&EdgeNumbers { level, release, quiet_ms, date }),
        }
    }

    /// The time after the last input within which its last detection is complete, us.
    pub(super) fn reach_us(&self, period_us: f64) -> i64 {
        period_us.ceil() as i64 + self.limits().reach()
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
