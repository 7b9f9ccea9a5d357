//! What each taxel holds: the value of its latest event that came with one.

use crate::events::IntensitiesView;
use crate::{Array, Events, EventsView, Intensities, Result, problem};

/// The value of a taxel without any event so far, and of a change without a value.
pub const UNKNOWN: u16 = u16::MAX;

/// The latest value of each taxel, by index.
#[derive(Debug, Clone, PartialEq)]
pub struct Held<V = u16> {
    values: Vec<V>,
}

impl<V: Copy> Held<V> {
    /// Every one of `taxels` holds `value`.
    #[must_use]
    pub fn all(taxels: usize, value: V) -> Self {
        Self { values: vec![value; taxels] }
    }

    /// By taxel index.
    #[must_use]
    pub fn values(&self) -> &[V] {
        &self.values
    }

    /// By taxel index, to be replaced.
    pub fn values_mut(&mut self) -> &mut [V] {
        &mut self.values
    }

    /// Sets the value of a taxel; returns the former one.
    #[inline(always)]
    pub fn set(&mut self, taxel: usize, value: V) -> V {
        std::mem::replace(&mut self.values[taxel], value)
    }
}

impl<V: Copy + From<u16>> Held<V> {
    /// Sets the values that events on the same array came with.
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
    /// No taxel had an event so far.
    #[must_use]
    pub fn unknown(taxels: usize) -> Self {
        Self::all(taxels, UNKNOWN)
    }

    /// Forgets all values.
    pub fn clear(&mut self) {
        self.values.fill(UNKNOWN);
    }

    /// The values as a picture shows them, in which 0 is also a taxel without any event so far.
    pub fn picture(&self) -> impl Iterator<Item = u16> {
        self.values.iter().map(|&value| if value == UNKNOWN { 0 } else { value })
    }
}

/// Events at `t` us that report what the taxels of an array hold, unless that is unknown. They are marked as repaired: they are no
/// changes.
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
    /// Of each event that came with a value its row, its taxel's index and the value, ticks.
    pub fn values(&self) -> impl Iterator<Item = (usize, usize, u16)> {
        let (ticks, present) =
            self.intensity.map_or((&[][..], &[][..]), |IntensitiesView { ticks, present }| (ticks, present));
        let valued = present.iter().zip(ticks).enumerate().filter(|(_, (present, _))| **present);
        valued.map(|(k, (_, &ticks))| (k, self.array.index(self.x[k], self.y[k]), ticks))
    }
}

/// A value that a taxel takes on at a time.
#[derive(Debug, Clone, Copy)]
struct Change<V> {
    t: i64,
    place: u32,
    value: V,
}

/// What taxels hold at any time, by a whole recording.
///
/// States are stored as time is first passed, so that an earlier time is found again without a walk from the beginning; they take
/// as much memory as the changes at most.
#[derive(Debug, Clone)]
pub struct HeldOverTime<V> {
    /// By time; those of one time in the order in which they came.
    changes: Vec<Change<V>>,
    /// The state before every `stride`-th change, as far as time was passed.
    states: Vec<Held<V>>,
    stride: usize,
    held: Held<V>,
    /// How many changes the state has.
    applied: usize,
}

impl<V: Copy + From<u16>> HeldOverTime<V> {
    /// What the taxels `chosen` (by index; all where `None`) hold by the values of events; before their first event, `begins`.
    ///
    /// # Errors
    ///
    /// `Problem` if columns are unequal, a taxel lies outside the array, or there is not one value in `begins` a chosen taxel.
    pub fn new(events: EventsView<'_>, chosen: Option<&[u32]>, begins: Vec<V>) -> Result<Self> {
        events.check()?;
        let values = events.values().map(|(k, taxel, ticks)| (events.t[k], taxel, V::from(ticks)));
        Self::of(events.array, values, chosen, begins)
    }

    fn of(
        array: &Array,
        values: impl Iterator<Item = (i64, usize, V)>,
        chosen: Option<&[u32]>,
        begins: Vec<V>,
    ) -> Result<Self> {
        /// The place of a taxel that was not chosen.
        const NONE: u32 = u32::MAX;
        let places = chosen.map(|chosen| {
            let mut places = vec![NONE; array.len()];
            for (place, &taxel) in (0..).zip(chosen) {
                if let Some(of) = places.get_mut(taxel as usize) {
                    *of = place;
                }
            }
            places
        });
        let wanted = chosen.map_or(array.len(), <[u32]>::len);
        if begins.len() != wanted {
            return Err(problem!("{} values to begin with: must be {wanted}, one a taxel", begins.len()));
        }
        // An array of recordings has 2^22 taxels at most.
        let place = |taxel: usize| places.as_ref().map_or(taxel as u32, |places| places[taxel]);
        let changes = values.map(|(t, taxel, value)| Change { t, place: place(taxel), value });
        let mut changes: Vec<Change<V>> = changes.filter(|change| change.place != NONE).collect();
        changes.sort_by_key(|change| change.t);
        Ok(Self { changes, states: vec![], stride: begins.len().max(4096), held: begins.into(), applied: 0 })
    }

    /// How many taxels were chosen.
    #[must_use]
    pub fn taxels(&self) -> usize {
        self.held.values.len()
    }

    /// The times of the changes, us, ascending.
    pub fn times(&self) -> impl Iterator<Item = i64> {
        self.changes.iter().map(|change| change.t)
    }

    /// What is held at `t` us, by the events up to and at that time.
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
                self.held.values[change.place as usize] = change.value;
            }
            self.applied = next;
        }
        self.held.values()
    }
}

impl HeldOverTime<f32> {
    /// As [`HeldOverTime::new`] where events came without values: a taxel begins with 0, and each event is a step of 1 up or down.
    ///
    /// # Errors
    ///
    /// As [`HeldOverTime::new`].
    pub fn by_steps(events: EventsView<'_>, chosen: Option<&[u32]>) -> Result<Self> {
        events.check()?;
        let taxel = |k: usize| events.array.index(events.x[k], events.y[k]);
        let steps = (0..events.len()).map(|k| (events.t[k], taxel(k), if events.p[k] { 1.0 } else { -1.0 }));
        let mut stepped =
            Self::of(events.array, steps, chosen, vec![0.0; chosen.map_or(events.array.len(), <[u32]>::len)])?;
        let mut level = stepped.held.clone();
        for change in &mut stepped.changes {
            change.value += level.values[change.place as usize];
            level.set(change.place as usize, change.value);
        }
        Ok(stepped)
    }
}
