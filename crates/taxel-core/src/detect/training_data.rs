//! What the data of a training were like: a recording that differs may not be detected in as the scores say.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::{Result, problem};

/// A summary of the data that a readout or a plain rule was trained on. Detecting does not depend on it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainingData {
    /// Rows and columns of the sensor.
    pub shape: [u16; 2],
    /// For each taxel, row by row, whether touches loaded it: 1 or 0.
    pub touched: String,
    /// The noise of a taxel while nothing touched, in the unit of the values.
    pub noise: f64,
    /// The largest sum of all taxels above rest in a touch, in the unit of the values: their median.
    pub strength: f64,
    /// The share of the touches with a detection.
    pub detected: f64,
    /// The shortest time between two labels of a name, ms.
    pub apart_ms: BTreeMap<String, f64>,
}

impl TrainingData {
    /// Checks that the numbers are in their ranges, and that there is one mark for each taxel.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the part.
    pub fn check(&self) -> Result<()> {
        let named = [("noise", self.noise), ("strength", self.strength), ("detected", self.detected)];
        let apart = self.apart_ms.values().map(|&apart| ("apart_ms", apart));
        if let Some((name, value)) =
            named.into_iter().chain(apart).find(|(_, value)| !(*value >= 0.0 && value.is_finite()))
        {
            return Err(problem!("training: {name} is {value}: must be 0 or more, and finite"));
        }
        let taxels = usize::from(self.shape[0]) * usize::from(self.shape[1]);
        if self.touched.len() != taxels || self.touched.bytes().any(|mark| !matches!(mark, b'0' | b'1')) {
            return Err(problem!("training: touched must contain 0 or 1 for each of {taxels} taxels"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn data() -> TrainingData {
        let apart_ms = BTreeMap::from([("contact".to_owned(), 700.0)]);
        TrainingData { shape: [2, 2], touched: "0110".to_owned(), noise: 0.5, strength: 90.0, detected: 1.0, apart_ms }
    }

    #[test]
    fn it_is_checked_and_comes_back_from_its_text() {
        let text = serde_json::to_string(&data()).unwrap();
        assert_eq!(serde_json::from_str::<TrainingData>(&text).unwrap(), data());
        assert!(data().check().is_ok());
        for wrong in [
            TrainingData { touched: "011".to_owned(), ..data() },
            TrainingData { touched: "0121".to_owned(), ..data() },
            TrainingData { noise: -1.0, ..data() },
            TrainingData { strength: f64::NAN, ..data() },
            TrainingData { apart_ms: BTreeMap::from([("lift".to_owned(), f64::INFINITY)]), ..data() },
        ] {
            assert!(wrong.check().unwrap_err().to_string().starts_with("training: "));
        }
    }
}
