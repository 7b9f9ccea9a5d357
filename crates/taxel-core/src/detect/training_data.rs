//! What the data of a training were like, with which a recording is compared.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::{Result, problem};

/// A summary of the data that a readout or a plain rule was trained on. Detecting does not depend on it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainingData {
    /// The noise floor by which loads were measured, in the unit of the values.
    pub noise_floor: f64,
    /// By how much detections are later than labels, ms: the median of each label with detections.
    pub error_ms: BTreeMap<String, f64>,
    /// By how much labels are later than what was felt, ms, of each label of which that was taken off.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub constants_ms: BTreeMap<String, f64>,
    /// The board that sent the data, where its registers are known and were the same in all of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub board: Option<TrainedBoard>,
    /// The median time from one frame to the next, us, where the data were frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub period_us: Option<f64>,
    /// The feet or hands of the sensors, "left" or "right", where all are stated.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sides: Vec<String>,
}

/// What a board's registers held in a training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainedBoard {
    /// The noise floor, ticks.
    pub noise_floor: u8,
    /// How long a frame lasts, us.
    pub frame_us: f64,
    /// The preset that they are, if any.
    pub preset: Option<String>,
}

impl TrainingData {
    /// Checks that the numbers are in their ranges.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the part.
    pub fn check(&self) -> Result<()> {
        if !(self.noise_floor >= 0.0 && self.noise_floor.is_finite()) {
            return Err(problem!("training: noise_floor is {}: must be 0 or more, and finite", self.noise_floor));
        }
        for (name, by_label) in [("error_ms", &self.error_ms), ("constants_ms", &self.constants_ms)] {
            if let Some((label, ms)) = by_label.iter().find(|(_, ms)| !ms.is_finite()) {
                return Err(problem!("training: {name} of {label} is {ms}: must be finite"));
            }
        }
        for (name, us) in [("frame_us", self.board.as_ref().map(|board| board.frame_us)), ("period_us", self.period_us)]
        {
            if let Some(us) = us.filter(|us| !(*us > 0.0 && us.is_finite())) {
                return Err(problem!("training: {name} is {us}: must be above 0, and finite"));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn board(frame_us: f64) -> TrainedBoard {
        TrainedBoard { noise_floor: 3, frame_us, preset: Some("5.2 kHz".to_owned()) }
    }

    fn data() -> TrainingData {
        TrainingData {
            noise_floor: 0.5,
            error_ms: BTreeMap::from([("contact".to_owned(), -3.0)]),
            constants_ms: BTreeMap::from([("contact".to_owned(), 80.0)]),
            board: Some(board(192.0)),
            period_us: Some(1e4),
            sides: vec!["left".to_owned()],
        }
    }

    #[test]
    fn it_is_checked_and_comes_back_from_its_text() {
        let text = serde_json::to_string(&data()).unwrap();
        assert_eq!(serde_json::from_str::<TrainingData>(&text).unwrap(), data());
        assert!(data().check().is_ok());
        for wrong in [
            TrainingData { noise_floor: -1.0, ..data() },
            TrainingData { error_ms: BTreeMap::from([("lift".to_owned(), f64::INFINITY)]), ..data() },
            TrainingData { constants_ms: BTreeMap::from([("lift".to_owned(), f64::NAN)]), ..data() },
            TrainingData { board: Some(board(0.0)), ..data() },
            TrainingData { period_us: Some(f64::NAN), ..data() },
        ] {
            assert!(wrong.check().is_err());
        }
    }
}
