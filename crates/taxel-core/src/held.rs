//! The current value of each taxel: the value of its latest event that has one.

use crate::events::IntensitiesView;
use crate::{Array, Events, EventsView, Intensities, Result, problem};

/// The value of a taxel without any event so far, and of a change without a value.
pub const UNKNOWN: u16 = u16::MAX;

/// The current value of each taxel, by index.
#[derive(Debug, Clone, PartialEq)]
pub struct Held<V = u16> {
    values: Vec<V>,
}

impl<V: Copy> Held<V> {
    /// Sets every one of `taxels` to `value`.
    #[must_use]
    pub fn all(taxels: usize, value: V) -> Self {
        Self { values: vec![value; taxels] }
    }

    /// The values by taxel index.
    #[must_use]
    pub fn values(&self) -> &[V] {
        &self.values
    }

    /// The values by taxel index, for writing.
    pub fn values_mut(&mut self) -> &mut [V] {
        &mut self.values
    }

    /// Sets the value of a taxel; returns the previous one.
    #[inline(always)]
    pub fn set(&mut self, taxel: usize, value: V) -> V {
        std::mem::replace(&mut self.values[taxel], value)
    }
}

impl<V: Copy + From<u16>> Held<V> {
    /// Applies the values of events on the same array.
    pub fn push(&mut self, events: EventsView<'_>) {
        for (_, taxel, ticks) in events.values() {
            self.set(taxel, V::from(ticks));
        }
    }
}

impl<V> From<Vec<V>> for Held<V> {
    fn from(values: Vec<V>) -> Self {
        Self { values }
    }
}

impl Held {
    /// The values of an array of so many taxels, none of which has had an event.
    #[must_use]
    pub fn unknown(taxels: usize) -> Self {
        Self::all(taxels, UNKNOWN)
    }

    /// Sets all values to unknown.
    pub fn clear(&mut self) {
        self.values.fill(UNKNOWN);
    }

    /// The values as a frame shows them, in which a taxel without any event so far is 0.
    pub fn frame(&self) -> impl Iterator<Item = u16> {
        self.values.iter().map(|&value| if value == UNKNOWN { 0 } else { value })
    }
}

/// Events at `t` us that report the known values of an array's taxels. They are marked as repaired, because they are
/// not changes.
#[must_use]
pub fn as_events(held: &[u16], t: i64, array: &Array) -> Events {
    let known: Vec<usize> = (0..held.len()).filter(|&taxel| held[taxel] != UNKNOWN).collect();
    let (n, columns) = (known.len(), usize::from(array.columns));
    let (x, y) = (known.iter().map(|k| (k % columns) as u16).collect(), known.iter().map(|k| (k / columns) as u16));
    let intensity = Intensities { ticks: known.iter().map(|&taxel| held[taxel]).collect(), present: vec![true; n] };
    Events {
        t: vec![t; n],
        x,
        y: y.collect(),
        p: vec![true; n],
        intensity: Some(intensity),
        repaired: Some(vec![true; n]),
        ..Events::empty(array.clone())
    }
}

impl EventsView<'_> {
    /// For each event with a value its row, its taxel's index and the value, ticks.
    pub fn values(&self) -> impl Iterator<Item = (usize, usize, u16)> {
        let (ticks, present) =
            self.intensity.map_or((&[][..], &[][..]), |IntensitiesView { ticks, present }| (ticks, present));
        let valued = present.iter().zip(ticks).enumerate().filter(|(_, (present, _))| **present);
        valued.map(|(k, (_, &ticks))| (k, self.array.index(self.x[k], self.y[k]), ticks))
    }
}

/// A value that a taxel has from a time on.
#[derive(Debug, Clone, Copy)]
struct HeldChange<V> {
    t: i64,
    slot: u32,
    value: V,
}

/// The taxels' values at any time of a whole recording.
///
/// The state is saved at intervals when a time is first passed, so that an earlier time is reached without starting
/// from the beginning. The saved states use at most as much memory as the changes.
#[derive(Debug, Clone)]
pub struct HeldOverTime<V> {
    /// The changes by time; those of equal time in order of arrival.
    changes: Vec<HeldChange<V>>,
    /// The state before every `stride`-th change, up to the latest time that was passed.
    states: Vec<Held<V>>,
    stride: usize,
    held: Held<V>,
    /// Number of changes applied to the current state.
    applied: usize,
}

impl<V: Copy + From<u16>> HeldOverTime<V> {
    /// The values of the `chosen` taxels (by index; all if `None`) from the events' values; before its first event, a
    /// taxel has the value in `begins`.
    ///
    /// # Errors
    ///
    /// `Problem` if columns are unequal, a taxel is outside the array, or `begins` does not have one value per chosen
    /// taxel.
    pub fn new(events: EventsView<'_>, chosen: Option<&[u32]>, begins: Vec<V>) -> Result<Self> {
        events.check()?;
        let values = events.values().map(|(k, taxel, ticks)| (events.t[k], taxel, V::from(ticks)));
        Self::from_values(events.array, values, chosen, begins)
    }

    fn from_values(
        array: &Array,
        values: impl Iterator<Item = (i64, usize, V)>,
        chosen: Option<&[u32]>,
        begins: Vec<V>,
    ) -> Result<Self> {
        /// Marks a taxel that was not chosen.
        const NONE: u32 = u32::MAX;
        let slots = chosen.map(|chosen| {
            let mut slots = vec![NONE; array.len()];
            for (slot, &taxel) in (0..).zip(chosen) {
                if let Some(entry) = slots.get_mut(taxel as usize) {
                    *entry = slot;
                }
            }
            slots
        });
        let wanted = chosen.map_or(array.len(), <[u32]>::len);
        if begins.len() != wanted {
            return Err(problem!("{} first values: must be {wanted}, one per taxel", begins.len()));
        }
        // Readers limit an array to 2^22 taxels, so an index fits in 32 bits.
        let slot = |taxel: usize| slots.as_ref().map_or(taxel as u32, |slots| slots[taxel]);
        let changes = values.map(|(t, taxel, value)| HeldChange { t, slot: slot(taxel), value });
        let mut changes: Vec<HeldChange<V>> = changes.filter(|change| change.slot != NONE).collect();
        changes.sort_by_key(|change| change.t);
        Ok(Self { changes, states: vec![], stride: begins.len().max(4096), held: begins.into(), applied: 0 })
    }

    /// Number of chosen taxels.
    #[must_use]
    pub fn taxels(&self) -> usize {
        self.held.values.len()
    }

    /// The times of the changes, us, ascending.
    pub fn times(&self) -> impl Iterator<Item = i64> {
        self.changes.iter().map(|change| change.t)
    }

    /// The values at `t` us, after the events up to and at that time.
    pub fn at(&mut self, t: i64) -> &[V] {
        if self.applied > 0 && self.changes[self.applied - 1].t > t {
            let earlier = self.changes.partition_point(|change| change.t <= t) / self.stride;
            self.held.clone_from(&self.states[earlier]);
            self.applied = earlier * self.stride;
        }
        let end = self.applied + self.changes[self.applied..].partition_point(|change| change.t <= t);
        while self.applied < end {
            if self.applied == self.states.len() * self.stride {
                self.states.push(self.held.clone());
            }
            let next = end.min((self.applied / self.stride + 1) * self.stride);
            for change in &self.changes[self.applied..next] {
                self.held.values[change.slot as usize] = change.value;
            }
            self.applied = next;
        }
        self.held.values()
    }
}

impl HeldOverTime<f32> {
    /// As [`HeldOverTime::new`], for events without values: each taxel begins with 0, and each event is a step of 1 up
    /// or down.
    ///
    /// # Errors
    ///
    /// As [`HeldOverTime::new`].
    pub fn by_steps(events: EventsView<'_>, chosen: Option<&[u32]>) -> Result<Self> {
        events.check()?;
        let taxel = |k: usize| events.array.index(events.x[k], events.y[k]);
        let steps = (0..events.len()).map(|k| (events.t[k], taxel(k), if events.p[k] { 1.0 } else { -1.0 }));
        let mut stepped =
            Self::from_values(events.array, steps, chosen, vec![0.0; chosen.map_or(events.array.len(), <[u32]>::len)])?;
        let mut level = stepped.held.clone();
        for change in &mut stepped.changes {
            change.value += level.values[change.slot as usize];
            level.set(change.slot as usize, change.value);
        }
        Ok(stepped)
    }
}
