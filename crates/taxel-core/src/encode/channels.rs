//! The existing taxels of an array as an encoder's channels, which of them a frame changes, and which events are
//! valid.

use super::blocks::{BLOCK, Block};
use crate::held::Held;
use crate::vectors::wide;
use crate::{Array, Error, EventsView, Result, problem};

/// Times beyond this, us (36 000 years), are refused, so that no sum of times can overflow.
pub(super) const FARTHEST: u64 = 1 << 60;

wide! {
    /// Copies the blocks of a frame that differ from the stored ones.
    fn take(t: i64, new: &[Block], held: &mut [Block], changed: &mut [bool]) -> Result<()> {
        /// All exponent bits: infinite or not a number.
        const NOT_FINITE: u32 = 0x7f80_0000;
        for ((new, held), changed) in new.iter().zip(held).zip(changed) {
            let (mut difference, mut bad) = (0, 0);
            for (new, held) in new.iter().zip(held.iter()) {
                difference |= new.to_bits() ^ held.to_bits();
                bad |= u32::from(new.to_bits() & NOT_FINITE == NOT_FINITE);
            }
            if bad != 0 {
                let bad = new.iter().find(|v| !v.is_finite()).unwrap_or(&f32::NAN);
                return Err(not_finite(t, *bad));
            }
            if difference != 0 {
                *held = *new;
                *changed = true;
            }
        }
        Ok(())
    }
}

/// The error for a frame that holds a value that is not finite; NaN is one that is missing.
pub(super) fn not_finite(t: i64, value: f32) -> Error {
    let filled = if value.is_nan() { "; Frames.held replaces missing values by the last value before" } else { "" };
    problem!("frame at {t} us contains {value}: values must be finite{filled}")
}

/// A value that is finite, otherwise 0.
fn finite(value: f32) -> f32 {
    if value.is_finite() { value } else { 0.0 }
}

/// The mapping between taxels and channels.
#[derive(Clone)]
pub(super) struct Channels {
    rows: u16,
    columns: u16,
    name: String,
    /// The taxel of each channel in a frame; `None` if every place is a channel.
    taxels: Option<Vec<u32>>,
    /// The channel of each taxel, [`NONE`] if no taxel exists there; `None` if every taxel exists.
    of_taxel: Option<Vec<u32>>,
}

const NONE: u32 = u32::MAX;

impl Channels {
    pub(super) fn new(array: &Array) -> Self {
        let (mut taxels, mut of_taxel) = (None, None);
        if let Some(exists) = &array.exists {
            let existing: Vec<u32> = (0..).zip(exists).filter(|&(_, &e)| e).map(|(taxel, _)| taxel).collect();
            let mut channels = vec![NONE; exists.len()];
            for (channel, &taxel) in (0..).zip(&existing) {
                channels[taxel as usize] = channel;
            }
            (taxels, of_taxel) = (Some(existing), Some(channels));
        }
        Self { rows: array.rows, columns: array.columns, name: array.name.clone(), taxels, of_taxel }
    }

    /// Every place of the grid as a channel, for what does not depend on position; events where no taxel exists are none.
    pub(super) fn grid(array: &Array) -> Self {
        let of_taxel = array.exists.as_ref().map(|exists| {
            let channel = |(taxel, &exists): (u32, &bool)| if exists { taxel } else { NONE };
            (0..).zip(exists).map(channel).collect()
        });
        Self { taxels: None, of_taxel, ..Self::new(array) }
    }

    /// Number of channels.
    pub(super) fn len(&self) -> usize {
        self.taxels.as_ref().map_or(self.places(), Vec::len)
    }

    fn places(&self) -> usize {
        usize::from(self.rows) * usize::from(self.columns)
    }

    /// The taxel of a column and a row.
    pub(super) fn taxel(&self, x: u16, y: u16) -> usize {
        usize::from(y) * usize::from(self.columns) + usize::from(x)
    }

    /// The channel of a taxel; `None` if no taxel exists there.
    pub(super) fn of_taxel(&self, taxel: usize) -> Option<usize> {
        match &self.of_taxel {
            None => Some(taxel),
            Some(channels) => (channels[taxel] != NONE).then_some(channels[taxel] as usize),
        }
    }

    /// Copies a frame into blocks and marks those that changed.
    pub(super) fn load(&self, t: i64, values: &[f32], held: &mut Held<f32>, changed: &mut [bool]) -> Result<()> {
        let held = held.values_mut().as_chunks_mut().0;
        if values.len() != self.places() {
            let (rows, columns) = (self.rows, self.columns);
            return Err(problem!("frame at {t} us: {} values; must be {rows} x {columns}", values.len()));
        }
        let Some(taxels) = &self.taxels else {
            // What a frame has where no taxel exists is not refused.
            let existing: Option<Vec<f32>> = self.of_taxel.as_ref().map(|of_taxel| {
                let read = |(&value, &channel): (&f32, &u32)| if channel == NONE { finite(value) } else { value };
                values.iter().zip(of_taxel).map(read).collect()
            });
            let values = existing.as_deref().unwrap_or(values);
            let (full, rest) = values.as_chunks::<BLOCK>();
            take(t, full, held, changed)?;
            if !rest.is_empty() {
                let mut new = [0.0; BLOCK];
                new[..rest.len()].copy_from_slice(rest);
                take(t, &[new], &mut held[full.len()..], &mut changed[full.len()..])?;
            }
            return Ok(());
        };
        for (block, taxels) in taxels.chunks(BLOCK).enumerate() {
            let mut new = [0.0; BLOCK];
            for (value, &taxel) in new.iter_mut().zip(taxels) {
                *value = values[taxel as usize];
            }
            take(t, &[new], &mut held[block..], &mut changed[block..])?;
        }
        Ok(())
    }

    /// Refuses events of another sensor, and columns that are not valid.
    pub(super) fn check(&self, events: EventsView<'_>) -> Result<()> {
        let (rows, columns) = (events.array.rows, events.array.columns);
        if (rows, columns) != (self.rows, self.columns) {
            let (name, wanted) = (&self.name, (self.rows, self.columns));
            return Err(problem!(
                "events of {rows} x {columns} taxels: this stream was begun for {name}, {} x {} taxels",
                wanted.0,
                wanted.1
            ));
        }
        if let Some(&t) = events.t.iter().find(|t| t.unsigned_abs() > FARTHEST) {
            return Err(problem!("event at {t} us: the time is too far from 0"));
        }
        events.check()
    }
}
