//! The filter of slowly adapting afferents, and the macro that declares SA-1 and SA-2.

use super::blocks::BLOCK;
use super::receptor::{Filter, FilterState, Lanes, LowPass};

/// `u = lowpass((1 + onset) x - onset y - loss z)`: x is the pressure, y and z are x filtered by low passes with
/// `onset_ms` and `loss_ms`; the outer low pass has `membrane_ms`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slow {
    onset: f64,
    loss: f64,
    recent: LowPass,
    long: LowPass,
    membrane: LowPass,
}

impl Slow {
    pub(super) fn new(
        [onset, onset_ms]: [f64; 2],
        [loss, loss_ms]: [f64; 2],
        membrane_ms: f64,
        period_ms: f64,
    ) -> Self {
        let low_pass = |tau| LowPass::new(tau, period_ms);
        Self { onset, loss, recent: low_pass(onset_ms), long: low_pass(loss_ms), membrane: low_pass(membrane_ms) }
    }
}

impl Filter for Slow {
    const SIGNALS_VALUES: bool = true;

    fn steady_state(&self, x: &Lanes) -> (FilterState, Lanes) {
        let drive = x.map(|x| (1.0 - self.loss) * x);
        ([*x, *x, *x, drive, [0.0; BLOCK]], drive)
    }

    #[inline(always)]
    fn step(&self, [before, recent, long, last_drive, _]: &mut FilterState, lane: usize, x: f64, u: f64) -> f64 {
        recent[lane] = self.recent.step(recent[lane], before[lane], x);
        long[lane] = self.long.step(long[lane], before[lane], x);
        let drive = (1.0 + self.onset) * x - self.onset * recent[lane] - self.loss * long[lane];
        let potential = self.membrane.step(u, last_drive[lane], drive);
        (before[lane], last_drive[lane]) = (x, drive);
        potential
    }
}

/// Declares a slowly adapting afferent: its documentation, its name, and the defaults of the parameters that differ.
macro_rules! slowly_adapting {
    ($(#[$about:meta])* $Kind:ident, threshold: $threshold:expr, onset: $onset:expr, loss: $loss:expr) => {
        use super::encoding::Encoding;
        use super::receptor::{self, firing};
        use super::slowly_adapting::Slow;
        use super::stream::Stream;
        use super::tare::Tare;
        use $crate::allowed::Range;
        use $crate::parameters::parameters;
        use $crate::{Array, Result, SpikeKind};

        parameters! {
            $(#[$about])*
            #[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
            #[serde(default, deny_unknown_fields)]
            pub struct $Kind {
                /// The largest pressure, in the sensor's unit. Default 150 ticks, the ramp of the board's 5.2 kHz
                /// preset.
                pub range: f64 = 150.0, "", Range::ABOVE_0;
                /// Threshold of the potential for a spike, as a fraction of `range`.
                pub threshold: f64 = $threshold, "", Range::ABOVE_0;
                /// Additional weight of a pressure while it is new.
                pub onset: f64 = $onset, "", Range::FROM_0;
                /// Time constant with which a pressure stops counting as new, ms.
                pub onset_ms: f64 = 200.0, "ms", Range::ABOVE_0;
                /// Fraction of a lasting pressure that adaptation removes in the end.
                pub loss: f64 = $loss, "", Range::within(0.0, 1.0);
                /// Time constant of this adaptation, ms.
                pub loss_ms: f64 = 5000.0, "ms", Range::ABOVE_0;
                /// Time constant of the membrane, ms.
                pub membrane_ms: f64 = 5.0, "ms", Range::ABOVE_0;
                /// Amount by which a spike raises the threshold, as a fraction of `range`.
                pub jump: f64 = 0.15, "", Range::ABOVE_0;
                /// Time constant with which the threshold decays again, ms.
                pub recovery_ms: f64 = 30.0, "ms", Range::ABOVE_0;
                /// Refractory time after a spike, ms.
                pub refractory_ms: f64 = 2.0, "ms", Range::FROM_0;
                /// Sampling period of events, ms; frames must arrive at this period, within half of it.
                pub period_ms: f64 = 1.0, "ms", Range::WHOLE_US;
                /// The taxels' rest, from which pressure is measured; 0 if there is none. It is valid for one board on
                /// one day: a saved readout has none and receives one when it is used.
                #[serde(skip_serializing_if = "Option::is_none")]
                pub tare: Option<Tare> = None;
            }
        }

        impl Encoding for $Kind {
            fn check(&self) -> Result<()> {
                self.check_ranges()?;
                self.tare.as_ref().map_or(Ok(()), Tare::check)
            }

            fn stream(&self, array: &Array) -> Result<Box<dyn Stream>> {
                let (onset, loss) = ([self.onset, self.onset_ms], [self.loss, self.loss_ms]);
                let filter = Slow::new(onset, loss, self.membrane_ms, self.period_ms);
                receptor::stream(filter, firing!(self), self.tare.as_ref(), array, self.trains_of(array))
            }

            fn kind(&self) -> SpikeKind {
                SpikeKind::Unsigned
            }

            fn set_tare(&mut self, tare: &Tare) {
                self.tare = Some(tare.clone());
            }
        }
    };
}
pub(super) use slowly_adapting;
