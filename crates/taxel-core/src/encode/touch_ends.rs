//! Touches as they end: how long each lasted, and how large it was. What differs by its duration is told by nothing
//! sooner.

use serde::{Deserialize, Serialize};

use super::blocks::Block;
use super::by_stamp::{ByStamp, Measure};
use super::encoding::Encoding;
use super::loaded::Loaded;
use super::stream::Stream;
use super::tare::Tare;
use crate::allowed::Range;
use crate::parameters::parameters;
use crate::spikes::{ms, us};
use crate::{Array, Result, Spike, SpikeKind};

/// The train of the duration.
pub(crate) const DURATION: usize = 0;

/// The duration, the largest area, total and peak, and 1.
const TRAINS: usize = 5;

parameters! {
    /// A graded spike on each train when a touch ends, which says how long it lasted and how large it was.
    ///
    /// A touch begins when the area, the number of taxels that count for [`ContactArea`](super::ContactArea), rises
    /// above 0 and ends when it is 0 again. A channel, which has no neighbours, counts alone: from the noise floor on, or
    /// from six times its noise in the tare if that is more, until it is below half of it. Trains: log(1 + duration, ms),
    /// then log(1 + the largest) of the touch of area, total and peak, as of [`Moments`](super::Moments), and 1. A touch
    /// that has not ended gives nothing.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct TouchEnds {
        /// The board's noise floor, 0 or more, in the sensor's unit (ticks). Default 3, that of the fast presets.
        pub noise_floor: f64 = 3.0, "", Range::FROM_0;
        /// The taxels' rest. It is valid for one board on one day: a saved readout has none and receives one when it is
        /// used.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub tare: Option<Tare> = None;
        /// Whether the time of a detection is the end of the touch, not its beginning.
        pub at_end: bool = false;
    }
}

impl Encoding for TouchEnds {
    fn check(&self) -> Result<()> {
        self.check_ranges()?;
        self.tare.as_ref().map_or(Ok(()), Tare::check)
    }

    fn stream(&self, array: &Array) -> Result<Box<dyn Stream>> {
        let loaded = Loaded::new("touch ends", array, self.tare.as_ref(), self.noise_floor)?;
        Ok(Box::new(ByStamp::new(PresentTouch::default(), loaded, array)))
    }

    fn trains(&self, _array: &Array) -> usize {
        TRAINS
    }

    fn kind(&self) -> SpikeKind {
        SpikeKind::Graded
    }

    fn set_tare(&mut self, tare: &Tare) {
        self.tare = Some(tare.clone());
    }
}

/// The duration of a touch, us, given the value of a spike of its train.
pub(crate) fn duration_us(value: f32) -> f64 {
    us(libm::expm1(f64::from(value)))
}

/// The touch that lasts: when it began, us, and its largest area, total and peak.
#[derive(Clone, Default)]
struct PresentTouch(Option<(i64, [f64; 3])>);

impl Measure for PresentTouch {
    fn trains(&self) -> usize {
        TRAINS
    }

    fn kind(&self) -> SpikeKind {
        SpikeKind::Graded
    }

    fn emit(&mut self, t: i64, loaded: &Loaded, held: &[Block], out: &mut Vec<Spike>) {
        if loaded.area() > 0 {
            let sums = loaded.sums(held);
            let (_, largest) = self.0.get_or_insert((t, [0.0; 3]));
            for (largest, now) in largest.iter_mut().zip([f64::from(loaded.area()), sums.total, sums.peak]) {
                *largest = largest.max(now);
            }
        } else if let Some((begin, [area, total, peak])) = self.0.take() {
            let values = [ms(t - begin), area, total, peak].map(libm::log1p);
            for (train, value) in values.into_iter().chain([1.0]).enumerate() {
                out.push(Spike { t: ms(t), train: train as u32, value: value as f32 });
            }
        }
    }
}
