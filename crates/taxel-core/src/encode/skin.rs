//! A skin: afferents of all four types at drawn positions on one array.

use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};

use super::blocks::{BLOCK, Block, NextFrame, blocks};
use super::channels::Channels;
use super::encoding::Encoding;
use super::fa1::{self, Decay, Fa1};
use super::fa2::{Fa2, Fast};
use super::fields::Fields;
use super::receptor::TaxelAfferents;
use super::sa1::Sa1;
use super::sa2::Sa2;
use super::sampled::{Rule, Sampled};
use super::slow::Slow;
use super::stream::{Stream, sort_from};
use super::tare::Tare;
use crate::allowed::Range;
use crate::array::Pitch;
use crate::parameters::parameters;
use crate::{Array, Result, Spike, SpikeKind, problem};

parameters! {
    /// SA-1, FA-1, SA-2 and FA-2 afferents with given densities, at positions drawn by a seed; each has a field of
    /// taxels.
    ///
    /// The densities are those of a fingertip: 70, 140 and 25 per cm^2 for SA-1, FA-1 and FA-2, and for SA-2 the
    /// remainder of a total of 241 (Johansson and Vallbo 1979, J. Physiol. 286:283; the three as used by Saal et al.
    /// 2017, PNAS 114:E5693). Field areas: medians of 11.0 mm^2 for SA-1 and 12.6 for FA-1, some 5 times as much for
    /// SA-2 and 10 times for FA-2 (Johansson and Vallbo 1980, Brain Res. 184:353). The input of an afferent is the mean
    /// of the taxels in its field, a disc, weighted by a Gaussian whose second standard deviation is the field's edge;
    /// this shape is our choice. If the field contains no taxel's centre, the input is the taxel at the afferent's
    /// position. Each type is the encoder of its name with its defaults and this `range`; FA-1's threshold decays per
    /// ms, so that the sampling period matters as little as possible.
    ///
    /// Trains, unsigned as a nerve's spikes: all SA-1, then FA-1, SA-2, FA-2, each from the first taxel to the last.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Skin {
        /// Density of SA-1 afferents, per cm^2 of taxels.
        pub sa1_per_cm2: f64 = 70.0, "", Range::FROM_0;
        /// Density of FA-1 afferents, per cm^2.
        pub fa1_per_cm2: f64 = 140.0, "", Range::FROM_0;
        /// Density of SA-2 afferents, per cm^2.
        pub sa2_per_cm2: f64 = 6.0, "", Range::FROM_0;
        /// Density of FA-2 afferents, per cm^2.
        pub fa2_per_cm2: f64 = 25.0, "", Range::FROM_0;
        /// Area of an SA-1 afferent's field, mm^2.
        pub sa1_field_mm2: f64 = 11.0, "", Range::ABOVE_0;
        /// Area of an FA-1 afferent's field, mm^2.
        pub fa1_field_mm2: f64 = 12.6, "", Range::ABOVE_0;
        /// Area of an SA-2 afferent's field, mm^2.
        pub sa2_field_mm2: f64 = 60.0, "", Range::ABOVE_0;
        /// Area of an FA-2 afferent's field, mm^2.
        pub fa2_field_mm2: f64 = 120.0, "", Range::ABOVE_0;
        /// The largest pressure, in the sensor's unit. Default 150 ticks, the ramp of the board's 5.2 kHz preset.
        pub range: f64 = 150.0, "", Range::ABOVE_0;
        /// Seed of the positions.
        pub seed: u64 = 1;
        /// Sampling period of events, ms, at most 1; frames must arrive at this period, within half of it.
        pub period_ms: f64 = 0.2, "ms", Range::WHOLE_US.at_most(1.0);
        /// The taxels' rest, from which pressure is measured; 0 if there is none. It is valid for one board on one day:
        /// a saved readout has none and receives one when it is used.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub tare: Option<Tare> = None;
    }
}

/// The four types of afferents.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ReceptorKind {
    /// Slowly adapting, small fields.
    #[serde(rename = "SA-1")]
    Sa1,
    /// Fast adapting, small fields.
    #[serde(rename = "FA-1")]
    Fa1,
    /// Slowly adapting, large fields.
    #[serde(rename = "SA-2")]
    Sa2,
    /// Fast adapting, large fields.
    #[serde(rename = "FA-2")]
    Fa2,
}

impl ReceptorKind {
    /// The type's name in the literature.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Sa1 => "SA-1",
            Self::Fa1 => "FA-1",
            Self::Sa2 => "SA-2",
            Self::Fa2 => "FA-2",
        }
    }
}

/// An afferent of a skin: its type, and its position, mm from the centre of the first taxel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    /// Type of the afferent.
    pub kind: ReceptorKind,
    /// Distance to the right.
    pub x_mm: f64,
    /// Distance downwards.
    pub y_mm: f64,
}

/// Most afferents of a skin.
const MOST: usize = 1_000_000;

impl Skin {
    /// Type, density per cm^2 and field in mm^2, in the order of the trains.
    fn types(&self) -> [(ReceptorKind, f64, f64); 4] {
        [
            (ReceptorKind::Sa1, self.sa1_per_cm2, self.sa1_field_mm2),
            (ReceptorKind::Fa1, self.fa1_per_cm2, self.fa1_field_mm2),
            (ReceptorKind::Sa2, self.sa2_per_cm2, self.sa2_field_mm2),
            (ReceptorKind::Fa2, self.fa2_per_cm2, self.fa2_field_mm2),
        ]
    }

    /// Number of afferents on an array at this density.
    fn count(array: &Array, density: f64) -> usize {
        // Without a pitch, which `afferents` refuses, there are none.
        let area_cm2 = array
            .pitch_mm
            .map_or(0.0, |Pitch { rows, columns }| Channels::new(array).len() as f64 * columns * rows / 100.0);
        (density * area_cm2).round() as usize
    }

    /// All afferents on an array, one per train.
    ///
    /// # Errors
    ///
    /// `Problem` if a parameter is out of range, if the pitch of the array is not known, or if there would be more than
    /// a million afferents.
    pub fn afferents(&self, array: &Array) -> Result<Vec<Placed>> {
        self.check()?;
        let pitch = array.pitch("skin")?;
        let count = Encoding::trains(self, array);
        if count > MOST {
            let (array, Pitch { rows, columns }) = (&array.name, pitch);
            return Err(problem!(
                "skin on {array} of pitch {rows} x {columns} mm: {count} afferents; must be at most {MOST}"
            ));
        }
        let (mut all, taxels) = (vec![], places(array));
        for (kind, density, _) in self.types() {
            let count = Self::count(array, density);
            // Each type has its own random generator, so that a density changes no other type's positions.
            let mut draw = StdRng::seed_from_u64(self.seed.wrapping_mul(4).wrapping_add(kind as u64));
            for k in 0..count {
                // Splits the taxels, in their order, into as many equal parts and draws one position in each: an even
                // distribution.
                let at: f64 = draw.random();
                let within = [draw.random::<f64>() - 0.5, draw.random::<f64>() - 0.5];
                let part = ((k as f64 + at) / count as f64 * taxels.len() as f64) as usize;
                let [x, y] = taxels[part.min(taxels.len() - 1)];
                let (x_mm, y_mm) = ((x + within[0]) * pitch.columns, (y + within[1]) * pitch.rows);
                all.push(Placed { kind, x_mm, y_mm });
            }
        }
        Ok(all)
    }
}

/// Column and row of each taxel that exists, in the order of their index.
fn places(array: &Array) -> Vec<[f64; 2]> {
    let columns = usize::from(array.columns);
    (0..array.len())
        .filter(|&taxel| array.exists.as_ref().is_none_or(|exists| exists[taxel]))
        .map(|taxel| [(taxel % columns) as f64, (taxel / columns) as f64])
        .collect()
}

impl Encoding for Skin {
    fn check(&self) -> Result<()> {
        self.check_ranges()?;
        self.tare.as_ref().map_or(Ok(()), Tare::check)
    }

    fn stream(&self, array: &Array) -> Result<Box<dyn Stream>> {
        let placed = self.afferents(array)?;
        let sampled = Sampled::new(self, PlacedAfferents::new(self, array, &placed)?, array, self.period_ms)?;
        Ok(Box::new(sampled.steady().above(self.tare.as_ref(), array)?))
    }

    fn trains(&self, array: &Array) -> usize {
        self.types().iter().map(|&(_, density, _)| Self::count(array, density)).sum()
    }

    fn kind(&self) -> SpikeKind {
        SpikeKind::Unsigned
    }

    fn set_tare(&mut self, tare: &Tare) {
        self.tare = Some(tare.clone());
    }
}

/// The channels in each afferent's field, with their weights.
fn fields_of(array: &Array, placed: &[&Placed], field_mm2: f64) -> Result<Vec<Vec<(u32, f32)>>> {
    let (taxels, pitch) = (places(array), array.pitch("skin")?);
    let edge = (field_mm2 / std::f64::consts::PI).sqrt();
    // Distances are computed in units of the columns' pitch.
    let (across, down) = (pitch.columns, pitch.rows / pitch.columns);
    // Channels are consecutive within a row of the array; only the rows that a field can reach are searched.
    let rows: Vec<usize> =
        (0..=usize::from(array.rows)).map(|row| taxels.partition_point(|at| at[1] < row as f64)).collect();
    let field_of = |at: &&Placed| {
        let (x, y) = (at.x_mm / pitch.columns, at.y_mm / pitch.rows);
        let reach = edge / pitch.rows;
        let row = |y: f64| (y.max(0.0) as usize).min(rows.len() - 1);
        let near = rows[row((y - reach).ceil())]..rows[row((y + reach).floor() + 1.0)];
        let (mut field, mut sum) = (vec![], 0.0);
        for channel in near {
            let [column, line] = taxels[channel];
            let away = ((column - x).powi(2) + ((line - y) * down).powi(2)) * across * across;
            if away <= edge * edge {
                // The edge is at the second standard deviation.
                let weight = libm::exp(-2.0 * away / (edge * edge));
                field.push((channel as u32, weight as f32));
                sum += weight;
            }
        }
        if field.is_empty() {
            let nearest = [x.round(), y.round()];
            let channel = taxels.iter().position(|taxel| *taxel == nearest).unwrap_or(0);
            field.push((channel as u32, 1.0));
            sum = 1.0;
        }
        field.iter_mut().for_each(|(_, weight)| *weight /= sum as f32);
        field
    };
    Ok(placed.iter().map(field_of).collect())
}

/// The afferents of one type, with their fields.
#[derive(Clone)]
struct Type<R> {
    rule: R,
    /// Index of its first train.
    first: usize,
    fields: Fields,
    /// Input of the afferent in each lane.
    held: Vec<Block>,
    changed: Vec<bool>,
}

impl<R: Rule> Type<R> {
    fn new(rule: R, array: &Array, first: usize, placed: &[&Placed], field_mm2: f64) -> Result<Self> {
        let fields = Fields::new(&fields_of(array, placed, field_mm2)?, Channels::new(array).len());
        let n = blocks(placed.len());
        Ok(Self { rule, first, fields, held: vec![[0.0; BLOCK]; n], changed: vec![true; n] })
    }

    #[inline(always)]
    fn take(&mut self, held: &[Block], changed: &[bool]) {
        for (block, felt) in self.held.iter_mut().enumerate() {
            self.changed[block] = self.fields.any(block, changed);
            if self.changed[block] {
                *felt = self.fields.inputs_of_block(block, held);
            }
        }
    }

    fn begin(&mut self, t: i64, held: &[Block], out: &mut Vec<Spike>) {
        let all = vec![true; held.len()];
        self.take(held, &all);
        self.rule.begin(t, &self.held, out);
    }

    #[inline(always)]
    fn sample(&mut self, t: i64, held: &[Block], changed: &[bool], next: &mut NextFrame, out: &mut Vec<Spike>) {
        self.take(held, changed);
        let from = out.len();
        self.rule.sample(t, &self.held, &self.changed, next, out);
        for spike in &mut out[from..] {
            spike.train = self.first as u32 + self.fields.afferent(spike.train as usize);
            spike.value = 1.0;
        }
    }

    /// Changes a channel's value as if the change were in the past.
    fn repair(&mut self, channel: usize, from: f32, to: f32) {
        if R::SPIKES_OF_REPAIRED {
            return;
        }
        for (lane, weight) in self.fields.lanes_of_channel(channel) {
            let felt = &mut self.held[lane / BLOCK][lane % BLOCK];
            let before = *felt;
            *felt += weight * (to - from);
            self.rule.repair(lane, before, *felt);
        }
    }
}

#[derive(Clone)]
struct PlacedAfferents {
    sa1: Type<TaxelAfferents<Slow>>,
    fa1: Type<fa1::Fa1Afferents>,
    sa2: Type<TaxelAfferents<Slow>>,
    fa2: Type<TaxelAfferents<Fast>>,
}

impl PlacedAfferents {
    fn new(skin: &Skin, array: &Array, placed: &[Placed]) -> Result<Self> {
        let (range, period_ms) = (skin.range, skin.period_ms);
        let sa1 = Sa1 { range, period_ms, ..Sa1::default() };
        let fa1 = Fa1 { range: Some(range), period_ms, decay: Decay::Ms, ..Fa1::default() };
        let sa2 = Sa2 { range, period_ms, ..Sa2::default() };
        let fa2 = Fa2 { range, period_ms, ..Fa2::default() };
        let first = |kind| placed.iter().position(|p| p.kind == kind).unwrap_or(0);
        let of_kind = |kind| placed.iter().filter(|p| p.kind == kind).collect::<Vec<_>>();
        let [a, b, c, d] = skin.types().map(|(kind, _, field)| (first(kind), of_kind(kind), field));
        Ok(Self {
            sa1: Type::new(TaxelAfferents::new(sa1.filter(), sa1.firing(), range, a.1.len()), array, a.0, &a.1, a.2)?,
            fa1: Type::new(fa1::Fa1Afferents::new(&fa1), array, b.0, &b.1, b.2)?,
            sa2: Type::new(TaxelAfferents::new(sa2.filter(), sa2.firing(), range, c.1.len()), array, c.0, &c.1, c.2)?,
            fa2: Type::new(TaxelAfferents::new(fa2.filter(), fa2.firing(), range, d.1.len()), array, d.0, &d.1, d.2)?,
        })
    }
}

impl Rule for PlacedAfferents {
    fn begin(&mut self, t: i64, held: &[Block], out: &mut Vec<Spike>) {
        self.sa1.begin(t, held, out);
        self.fa1.begin(t, held, out);
        self.sa2.begin(t, held, out);
        self.fa2.begin(t, held, out);
    }

    const PREFETCHES: bool = true;

    #[inline(always)]
    fn sample(&mut self, t: i64, held: &[Block], changed: &[bool], next: &mut NextFrame, out: &mut Vec<Spike>) {
        let from = out.len();
        self.sa1.sample(t, held, changed, next, out);
        self.fa1.sample(t, held, changed, next, out);
        self.sa2.sample(t, held, changed, next, out);
        self.fa2.sample(t, held, changed, next, out);
        sort_from(out, from);
    }

    fn repair(&mut self, channel: usize, from: f32, to: f32) {
        self.fa1.repair(channel, from, to);
        self.fa2.repair(channel, from, to);
    }

    fn idle(&self) -> bool {
        self.sa1.rule.idle() && self.fa1.rule.idle() && self.sa2.rule.idle() && self.fa2.rule.idle()
    }
}
