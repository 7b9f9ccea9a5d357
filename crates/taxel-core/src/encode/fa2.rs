//! FA-2: the fast adapting afferent of large fields, which responds to vibration and to the moment of contact.

use serde::{Deserialize, Serialize};

use super::blocks::BLOCK;
use super::encoding::Encoding;
use super::receptor::{self, Filter, FilterState, Lanes, LowPass, firing};
use super::stream::Stream;
use crate::allowed::Range;
use crate::parameters::parameters;
use crate::{Array, Result, SpikeKind};

parameters! {
    /// The FA-2 afferent (Pacini): silent while pressure is constant or changes slowly; one spike per cycle at 200 to
    /// 250 Hz.
    ///
    /// Two high-pass filters with `corner_ms` and a low-pass filter with `membrane_ms`, for x the pressure as a
    /// fraction of `range`: `u = lowpass(highpass(highpass(x)))`. Thresholds therefore fall by 12 dB per octave up to
    /// the best frequency, as those of the Pacinian channel do (Bolanowski et al. 1988, J. Acoust. Soc. Am. 84:1680).
    /// The threshold adapts as that of [`Sa1`](super::Sa1). We fitted `corner_ms`, `membrane_ms`, `jump` and
    /// `recovery_ms` so that the amplitude for one spike per cycle is least between 200 and 250 Hz. `threshold` is
    /// limited by the sensor: a step of one tick in 150 stays below it; a finger is far more sensitive. Negative
    /// pressure counts as 0. One unsigned train per taxel, at most one spike per sample. The initial state is that of a
    /// constant input equal to the first sample.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Fa2 {
        /// The largest pressure, in the sensor's unit. Default 150 ticks, the ramp of the board's 5.2 kHz preset.
        pub range: f64 = 150.0, "", Range::ABOVE_0;
        /// Threshold of the potential for a spike, as a fraction of `range`.
        pub threshold: f64 = 0.003, "", Range::ABOVE_0;
        /// Time constant of the two high-pass filters, ms.
        pub corner_ms: f64 = 0.9, "ms", Range::ABOVE_0;
        /// Time constant of the membrane, ms.
        pub membrane_ms: f64 = 1.5, "ms", Range::ABOVE_0;
        /// Amount by which a spike raises the threshold, as a fraction of `range`.
        pub jump: f64 = 0.003, "", Range::ABOVE_0;
        /// Time constant with which the threshold decays again, ms.
        pub recovery_ms: f64 = 1.5, "ms", Range::ABOVE_0;
        /// Refractory time after a spike, ms.
        pub refractory_ms: f64 = 2.0, "ms", Range::FROM_0;
        /// Sampling period of events, ms, at most 1; frames must arrive at this period, within half of it.
        pub period_ms: f64 = 0.2, "ms", Range::WHOLE_US.at_most(1.0);
    }
}

impl Fa2 {
    pub(super) fn filter(&self) -> Fast {
        let low_pass = |tau| LowPass::new(tau, self.period_ms);
        Fast { corner: low_pass(self.corner_ms), membrane: low_pass(self.membrane_ms) }
    }
}

impl Encoding for Fa2 {
    fn check(&self) -> Result<()> {
        self.check_ranges()
    }

    fn stream(&self, array: &Array) -> Result<Box<dyn Stream>> {
        receptor::stream(self.filter(), firing!(self), None, array, self.trains_of(array))
    }

    fn kind(&self) -> SpikeKind {
        SpikeKind::Unsigned
    }
}

/// The coefficients of two high-pass filters and a low-pass filter.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fast {
    corner: LowPass,
    membrane: LowPass,
}

impl Filter for Fast {
    /// The input; the output of the low-pass filter that the first high-pass filter subtracts, and the difference; the
    /// same for the second high-pass filter.
    fn steady_state(&self, x: &Lanes) -> (FilterState, Lanes) {
        let none = [0.0; BLOCK];
        ([*x, *x, none, none, none], none)
    }

    #[inline(always)]
    fn step(&self, [before, first, once, second, twice]: &mut FilterState, lane: usize, x: f64, u: f64) -> f64 {
        first[lane] = self.corner.step(first[lane], before[lane], x);
        let now_once = x - first[lane];
        second[lane] = self.corner.step(second[lane], once[lane], now_once);
        let now_twice = now_once - second[lane];
        let potential = self.membrane.step(u, twice[lane], now_twice);
        (before[lane], once[lane], twice[lane]) = (x, now_once, now_twice);
        potential
    }

    fn shift(&self, [before, first, ..]: &mut FilterState, lane: usize, by: f64) {
        before[lane] += by;
        first[lane] += by;
    }
}
