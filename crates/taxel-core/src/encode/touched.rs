//! Whether a sensor has been touched for some time.

use super::driver::Sample;
use super::loaded::Loaded;
use crate::spikes::us;

/// Tells whether the touch that lasts began so long ago. A touch is the time in which the area is 1 or more.
#[derive(Clone)]
pub(super) struct Touched {
    loaded: Loaded,
    settling_us: f64,
    /// When the touch began, us, while there is one.
    began: Option<i64>,
}

impl Touched {
    /// Starts with no taxel loaded.
    pub(super) fn new(settling_ms: f64, loaded: Loaded) -> Self {
        Self { loaded, settling_us: us(settling_ms), began: None }
    }

    /// The loaded taxels, which receive values and rests.
    pub(super) fn loaded(&mut self) -> &mut Loaded {
        &mut self.loaded
    }

    /// Reads the values of all taxels.
    pub(super) fn take(&mut self, now: Sample<'_>) -> bool {
        self.loaded.take_frame(now);
        if self.loaded.area() == 0 {
            self.began = None;
            return false;
        }
        (now.t - *self.began.get_or_insert(now.t)) as f64 >= self.settling_us
    }
}
