//! Echo: the neuron fires with the one input train that most often spikes shortly before a target.

use serde::{Deserialize, Serialize};

use taxel_core::allowed::{Range, one_weight_a_train};
use taxel_core::parameters::parameters;
use taxel_core::{Result, SpikeTrains, Stop};

use super::batch::{BatchRule, Learnt};
use crate::checks::check_ungraded;

parameters! {
    /// Parameters of the echo.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Echo {
        /// Longest time from a spike to the target, ms.
        pub within_ms: f64 = 20.0, "ms", Range::ABOVE_0;
    }
}

impl BatchRule for Echo {
    fn check(&self) -> Result<()> {
        self.check_ranges()
    }

    /// The weight of a train is the number of targets shortly after one of its spikes.
    fn fit(&self, patterns: &[SpikeTrains], targets: &[Vec<f64>], stop: Stop<'_>) -> Result<Learnt> {
        let mut weights = vec![0.0; patterns[0].len()];
        for (pattern, targets) in patterns.iter().zip(targets) {
            stop.check()?;
            check_ungraded(pattern, "echo")?;
            for (n, weight) in weights.iter_mut().enumerate() {
                let before = |target: f64| pattern.train(n).iter().any(|t| (0.0..=self.within_ms).contains(&(target - t)));
                *weight += targets.iter().filter(|&&target| before(target)).count() as f64;
            }
        }
        Ok(Learnt { weights, results: serde_json::Map::new() })
    }

    fn run(&self, learnt: &Learnt, pattern: &SpikeTrains, _: Stop<'_>) -> Result<Vec<f64>> {
        check_ungraded(pattern, "echo")?;
        one_weight_a_train(&learnt.weights, pattern.len())?;
        let best = (0..pattern.len()).max_by(|&a, &b| learnt.weights[a].total_cmp(&learnt.weights[b]));
        Ok(best.map_or(vec![], |n| pattern.train(n).to_vec()))
    }
}
