//! The number of loaded taxels, as crossings of 2, 4, 8, 16 and 32. It does not depend on position, so what is learnt
//! at one position holds at others.

use serde::{Deserialize, Serialize};

use super::blocks::{BLOCK, Next, blocks, in_blocks};
use super::channels::Channels;
use super::law::Law;
use super::loaded::Loaded;
use super::sampled::Source;
use super::stream::Stream;
use super::tare::Tare;
use crate::allowed::{Range, ranges};
use crate::held::Held;
use crate::parameters::Described;
use crate::spikes::ms;
use crate::{Array, EventsView, Result, Spike, SpikeKind, problem};

/// Contact area: rises and falls of the number of loaded taxels through levels.
///
/// A taxel is loaded while its value exceeds its rest by more than the board's noise floor and half a tick; it counts
/// only if one of its 8 neighbours is loaded too, which rejects noise. A taxel without any event, in the tare or since,
/// is unloaded. The area is computed once per stamp, after its last event; spikes have the stamp's time. Trains,
/// unsigned: rises through each level, then falls below each.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ContactArea {
    /// The board's noise floor, 0 or more, in the sensor's unit (ticks). Default 3, that of the fast presets.
    pub noise_floor: f64,
    /// Numbers of taxels, ascending; default 2, 4, 8, 16, 32.
    pub levels: Vec<u32>,
    /// The taxels' rest. It is valid for one board on one day: a saved readout has none and receives one when it is
    /// used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tare: Option<Tare>,
}

impl Default for ContactArea {
    fn default() -> Self {
        Self { noise_floor: 3.0, levels: vec![2, 4, 8, 16, 32], tare: None }
    }
}

impl ContactArea {
    ranges! {
        noise_floor: "", Range::FROM_0;
    }
}

impl Law for ContactArea {
    fn described() -> Described {
        Described::by(&Self::default(), &[], Self::RANGES).or_nothing("tare")
    }

    fn check(&self) -> Result<()> {
        self.check_ranges()?;
        if self.levels.is_empty() {
            return Err(problem!("levels: must hold one number of taxels or more"));
        }
        if self.levels[0] == 0 || self.levels.windows(2).any(|w| w[1] <= w[0]) {
            return Err(problem!("levels are {:?}: must ascend from 1 or more", self.levels));
        }
        self.tare.as_ref().map_or(Ok(()), Tare::check)
    }

    fn stream(&self, array: &Array) -> Result<Box<dyn Stream>> {
        Ok(Box::new(Area {
            levels: self.levels.clone(),
            loaded: Loaded::new("contact area", array, self.tare.as_ref(), self.noise_floor)?,
            reported: 0,
            held: Held::all(blocks(array.len()) * BLOCK, 0.0),
            changed: vec![false; blocks(array.len())],
            // Channels are all places here; `loaded` defines which taxels exist.
            channels: Channels::new(&Array { exists: None, ..array.clone() }),
            source: Source::Unknown,
        }))
    }

    fn trains(&self, _array: &Array) -> usize {
        2 * self.levels.len()
    }

    fn kind(&self) -> SpikeKind {
        SpikeKind::Unsigned
    }

    fn set_tare(&mut self, tare: &Tare) {
        self.tare = Some(tare.clone());
    }
}

#[derive(Clone)]
struct Area {
    levels: Vec<u32>,
    loaded: Loaded,
    /// The area at the end of the last stamp.
    reported: u32,
    held: Held<f32>,
    changed: Vec<bool>,
    channels: Channels,
    source: Source,
}

impl Area {
    /// Ends the stamp at `t` us: emits a spike for each level that the area has crossed since the previous stamp.
    fn say(&mut self, t: i64, out: &mut Vec<Spike>) {
        let (before, now) = (self.reported, self.loaded.area());
        if before == now {
            return;
        }
        for (train, &level) in self.levels.iter().enumerate() {
            if before < level && level <= now {
                out.push(Spike { t: ms(t), train: train as u32, value: 1.0 });
            }
        }
        for (train, &level) in self.levels.iter().enumerate() {
            if now < level && level <= before {
                out.push(Spike { t: ms(t), train: (self.levels.len() + train) as u32, value: 1.0 });
            }
        }
        self.reported = now;
    }
}

impl Stream for Area {
    fn fork(&self) -> Box<dyn Stream> {
        Box::new(self.clone())
    }

    fn late(&self) -> u64 {
        self.source.late()
    }

    fn trains(&self) -> usize {
        2 * self.levels.len()
    }

    fn kind(&self) -> SpikeKind {
        SpikeKind::Unsigned
    }

    fn latency_ms(&self) -> f64 {
        0.0
    }

    fn push_events(&mut self, events: EventsView<'_>, out: &mut Vec<Spike>) -> Result<()> {
        self.channels.check(events)?;
        let Some(intensity) = &events.intensity else {
            return Err(problem!("events without intensities: this encoder reads held values, so record intensities"));
        };
        let Some(mut present) = self.source.events(events.t)? else { return Ok(()) };
        for k in 0..events.len() {
            if events.t[k] > present {
                self.say(present, out);
                present = events.t[k];
            }
            if intensity.present[k] {
                let place = events.array.index(events.x[k], events.y[k]);
                let value = f32::from(intensity.ticks[k]);
                self.held.set(place, value);
                self.loaded.take(place, value);
            }
        }
        Ok(())
    }

    fn set_rest(&mut self, t: i64, place: usize, rest: f64, out: &mut Vec<Spike>) {
        self.advance(t, out);
        self.loaded.set_rest(place, rest);
        match self.source {
            // Marks the block as changed, so that it is computed with the new rest in the next frame.
            Source::Frames { .. } => self.changed[place / BLOCK] = true,
            _ => self.loaded.take(place, self.held.values()[place]),
        }
    }

    fn rest(&self, place: usize) -> Option<f64> {
        self.loaded.rest(place)
    }

    fn push_frame(&mut self, t: i64, values: &[f32], out: &mut Vec<Spike>) -> Result<()> {
        self.source.frame(t)?;
        self.channels.load(t, values, &mut self.held, &mut self.changed, &mut Next::after(values))?;
        for (block, values) in in_blocks(self.held.values()).iter().enumerate() {
            if std::mem::take(&mut self.changed[block]) {
                self.loaded.take_block(block, values);
            }
        }
        self.say(t, out);
        Ok(())
    }

    fn advance(&mut self, t: i64, out: &mut Vec<Spike>) {
        match &mut self.source {
            Source::Unknown => {}
            Source::Frames { open } => *open = t.max(*open),
            Source::Events { present, .. } => {
                let stamp = *present;
                if t > stamp {
                    *present = t;
                    self.say(stamp, out);
                }
            }
        }
    }

    fn finish(&mut self, out: &mut Vec<Spike>) -> Option<f64> {
        let end = match self.source {
            Source::Unknown => return None,
            Source::Events { present, .. } => present,
            Source::Frames { open } => open - 1,
        };
        self.advance(end + 1, out);
        Some(ms(end))
    }
}
