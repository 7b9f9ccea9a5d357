//! What the noise of frames above a rest that was found adds up to: a sum up to that is no touch.

/// Length of a stretch, us: a quiet one holds one of them at least.
const STRETCH_US: i64 = 250_000;

/// Reading: noise adds up to at most so many times the greatest sum of the stretch in which that is least ...
const TIMES_LEAST: f64 = 1.5;

/// ... and so many taxels just above the noise floor.
const NOISY_TAXELS: f64 = 4.0;

/// The greatest sum of the stretch in which it is least, while the sums of frames arrive.
#[derive(Debug, Clone, Copy)]
pub struct FrameNoise {
    begin: Option<i64>,
    stretch: i64,
    greatest: f64,
    least: Option<f64>,
}

impl Default for FrameNoise {
    fn default() -> Self {
        Self { begin: None, stretch: 0, greatest: f64::NEG_INFINITY, least: None }
    }
}

impl FrameNoise {
    /// Takes the sum of a frame above rest at a time, us; times ascend.
    pub fn take(&mut self, t: i64, sum: f64) {
        let stretch = (t - *self.begin.get_or_insert(t)) / STRETCH_US;
        if stretch != self.stretch {
            self.least = Some(self.least.map_or(self.greatest, |least| least.min(self.greatest)));
            (self.stretch, self.greatest) = (stretch, f64::NEG_INFINITY);
        }
        self.greatest = self.greatest.max(sum);
    }

    /// The most that noise adds up to, of taxels that count as loaded above `floor`; both in the unit of the sums. The
    /// last stretch may be short, and counts only where it is the only one.
    #[must_use]
    pub fn most(self, floor: f64) -> f64 {
        let least = self.least.unwrap_or(self.greatest).max(0.0);
        TIMES_LEAST * least + NOISY_TAXELS * floor
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quietest_whole_stretch_counts_whenever_the_frames_begin() {
        for begin in [0, 1_000_000, -7] {
            let mut noise = FrameNoise::default();
            assert_eq!(noise.most(2.0), 8.0);
            // Three whole stretches, of which the second is the quietest, and a short last one.
            for (k, sum) in [30.0, 40.0, 10.0, 20.0, 50.0, 60.0, 1.0].into_iter().enumerate() {
                noise.take(begin + 125_000 * k as i64, sum);
                let expected = [30.0, 40.0, 40.0, 40.0, 20.0, 20.0, 20.0][k];
                assert_eq!(noise.most(2.0), 1.5 * expected + 8.0);
            }
        }
    }
}
