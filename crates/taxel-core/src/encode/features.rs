//! What is computed of the values of all taxels at each stamp, or each frame, and the spikes of its levels and changes.

use super::begin_area::BeginArea;
use super::channels::Channels;
use super::driver::{Clock, Driver, Rule, Sample, Trains};
use super::level_count::LevelCount;
use super::levels::Levels;
use super::load_sum::LoadSum;
use super::loaded::Loaded;
use super::local_sums::{LocalSums, SumPair};
use super::moved::Moved;
use super::peak_load::PeakLoad;
use super::range_load::RangeLoad;
use super::shear::Shear;
use super::stream::Stream;
use super::touched::Touched;
use crate::rest::Rest;
use crate::spikes::ms;
use crate::{Array, Spike};

/// What is computed of the values of all taxels; none of it depends on position.
#[derive(Clone)]
pub(super) enum Feature {
    /// The number of loaded taxels.
    Area(Loaded),
    /// The sum of all values above rest, and that without the largest.
    Load(LoadSum),
    /// What moved within the load, the rise and the fall of the sum.
    Moved(Moved),
    /// The rise and the fall of the shear.
    Shear(Shear),
    /// The largest local sums: above the rest, then above and below each running mean.
    Local(LocalSums),
    /// The load by running range.
    Range(RangeLoad),
    /// The largest deviation of a taxel in units of its own noise.
    Peak(PeakLoad),
    /// The number of levels that the taxels are above.
    Count(LevelCount),
    /// The number of those by which a touch began.
    Begin(BeginArea),
}

impl Feature {
    /// Whether it changes while the values hold.
    fn drifts(&self) -> bool {
        matches!(self, Self::Local(_) | Self::Moved(_) | Self::Shear(_))
    }

    /// Appends its values.
    fn take(&mut self, now: Sample<'_>, values: &mut Vec<f64>) {
        match self {
            Self::Area(loaded) => {
                loaded.take_frame(now);
                values.push(f64::from(loaded.area()));
            }
            Self::Load(load) => values.extend(load.take(now)),
            Self::Moved(moved) => values.extend(moved.take(now)),
            Self::Shear(shear) => values.extend(shear.take(now)),
            Self::Local(sums) => {
                let mut of_rest = true;
                sums.take(now.t, now.held.as_flattened(), |SumPair { largest, .. }| {
                    let present = if std::mem::take(&mut of_rest) { &largest[..1] } else { &largest };
                    values.extend_from_slice(present);
                });
            }
            Self::Range(range) => values.push(range.take(now)),
            Self::Peak(peak) => values.push(peak.take(now.held.as_flattened())),
            Self::Count(count) => values.push(count.take(now) as f64),
            Self::Begin(begin) => values.push(begin.take(now) as f64),
        }
    }

    fn set_rest(&mut self, taxel: usize, rest: f64) {
        match self {
            Self::Area(loaded) => loaded.set_rest(taxel, rest),
            Self::Load(load) => load.set_rest(taxel, rest),
            Self::Moved(moved) => moved.set_rest(taxel, rest),
            Self::Shear(shear) => shear.set_rest(taxel, rest),
            Self::Local(sums) => sums.set_rest(taxel, rest),
            Self::Range(_) => {}
            Self::Peak(peak) => peak.set_rest(taxel, rest),
            Self::Count(count) => count.set_rest(taxel, rest),
            Self::Begin(begin) => begin.loaded().set_rest(taxel, rest),
        }
    }
}

/// The spikes of features' values.
#[derive(Clone)]
pub(super) enum Emit {
    /// Those of levels, equally many of each value.
    Crossings(Levels),
    /// One for every change of some values, by their number, with the new value. The first frame shows the first ones, where
    /// they are known (else NaN); of events all are 0 at first.
    Changes { which: Vec<usize>, last: Vec<f32> },
}

/// Features, and the spikes of their values.
#[derive(Clone)]
struct FeatureRule {
    features: Vec<Feature>,
    /// When they count; at all other times they are 0. `None`: always.
    touched: Option<Touched>,
    /// The axis of each channel, where taxels have three.
    axes: Vec<usize>,
    /// The rest of each taxel as it was measured or set.
    rest: Rest<f64>,
    values: Vec<f64>,
    emit: Emit,
}

/// A stream of features at each stamp of events, or each frame; they are 0 when `touched` is given and does not hold.
pub(super) fn stream(
    features: Vec<Feature>,
    touched: Option<Touched>,
    rest: Rest<f64>,
    emit: Emit,
    array: &Array,
    trains: Trains,
) -> Box<dyn Stream> {
    let clock = Clock::Stamps { drifts: touched.is_some() || features.iter().any(Feature::drifts) };
    let rule = FeatureRule { features, touched, axes: array.axes(), rest, values: vec![], emit };
    Box::new(Driver::new(rule, Channels::grid(array), trains, clock))
}

impl Rule for FeatureRule {
    /// The first frame shows which levels the values are above; before the first event they are at rest.
    fn begin(&mut self, now: Sample<'_>, out: &mut Vec<Spike>) {
        if now.of_frame && matches!(self.emit, Emit::Crossings(_)) {
            let mut crossed = vec![];
            self.sample(now, &mut crossed);
        } else {
            self.sample(now, out);
        }
    }

    #[inline(always)]
    fn sample(&mut self, now: Sample<'_>, out: &mut Vec<Spike>) {
        let Self { features, touched, values, emit, .. } = self;
        values.clear();
        features.iter_mut().for_each(|feature| feature.take(now, values));
        if touched.as_mut().is_some_and(|touched| !touched.take(now)) {
            values.fill(0.0);
        }
        // In single precision, which holds every number of taxels and of their levels exactly.
        match emit {
            Emit::Crossings(levels) => {
                let each = levels.len() / values.len();
                levels.take(now.t, 0..levels.len(), |level| f64::from(values[level / each] as f32), out);
            }
            Emit::Changes { which, last } => {
                for (train, (&value, last)) in (0..).zip(which.iter().zip(last)) {
                    let value = values[value] as f32;
                    if last.is_nan() && !now.of_frame {
                        *last = 0.0;
                        out.push(Spike { t: ms(now.t), train, value: 0.0 });
                    }
                    if value != *last && !value.is_nan() {
                        *last = value;
                        out.push(Spike { t: ms(now.t), train, value });
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn read(&mut self, channel: usize, _from: f32, to: f32, _repaired: bool) {
        for feature in &mut self.features {
            match feature {
                Feature::Area(loaded) => loaded.take(channel, to),
                Feature::Begin(begin) => begin.loaded().take(channel, to),
                _ => {}
            }
        }
        if let Some(touched) = &mut self.touched {
            touched.loaded().take(channel, to);
        }
    }

    fn set_rest(&mut self, channel: usize, rest: f64) {
        self.rest.set(channel, rest);
        let is_pressed = self.axes.get(channel).is_none_or(|&axis| axis == 2);
        let follow = |feature: &&mut Feature| is_pressed || matches!(feature, Feature::Shear(_));
        self.features.iter_mut().filter(follow).for_each(|feature| feature.set_rest(channel, rest));
        if let Some(touched) = self.touched.as_mut().filter(|_| is_pressed) {
            touched.loaded().set_rest(channel, rest);
        }
    }

    fn rest(&self, channel: usize) -> Option<f64> {
        Some(self.rest.values()[channel]).filter(|rest| rest.is_finite())
    }
}
