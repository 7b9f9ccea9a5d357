//! Events: changes at taxels, with their times.

use crate::{Array, Result, problem};

/// How far an event may be behind an earlier one and still be valid, us: the network may reorder datagrams.
pub const FARTHEST_BACK_US: i64 = 100_000;

/// The values of the intensity words that belong to events.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Intensities {
    /// Ticks of the converter's counter (1/300 us), one per event; 0 if none is present.
    pub ticks: Vec<u16>,
    /// Whether the event has an intensity.
    pub present: Vec<bool>,
}

/// Start or stop of a recording, as marked by the board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Marker {
    /// Time, us, unwrapped.
    pub t: i64,
    /// Start (true) or stop.
    pub start: bool,
}

/// Changes at taxels, in order of arrival; one column per field.
#[derive(Debug, Clone, PartialEq)]
pub struct Events {
    /// The sensor.
    pub array: Array,
    /// Time, us, unwrapped.
    pub t: Vec<i64>,
    /// Column.
    pub x: Vec<u16>,
    /// Row.
    pub y: Vec<u16>,
    /// Polarity: true if the pressure rose.
    pub p: Vec<bool>,
    /// The taxels' values at the changes; none if no event has a value.
    pub intensity: Option<Intensities>,
    /// Whether the event was decoded from a state of version 2, because the state's value differed: the change itself
    /// happened some time before. None if there is no such event.
    pub repaired: Option<Vec<bool>>,
    /// Starts and stops, by time.
    pub markers: Vec<Marker>,
}

impl Events {
    /// A table without events.
    #[must_use]
    pub fn empty(array: Array) -> Self {
        Self { array, t: vec![], x: vec![], y: vec![], p: vec![], intensity: None, repaired: None, markers: vec![] }
    }

    /// Number of events.
    #[must_use]
    pub fn len(&self) -> usize {
        self.t.len()
    }

    /// Bytes of the columns.
    #[must_use]
    pub fn size(&self) -> usize {
        self.len() * (13 + 3 * usize::from(self.intensity.is_some()) + usize::from(self.repaired.is_some()))
    }

    /// Whether there is no event.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.t.is_empty()
    }

    /// A view of the columns.
    #[must_use]
    pub fn view(&self) -> EventsView<'_> {
        EventsView {
            array: &self.array,
            t: &self.t,
            x: &self.x,
            y: &self.y,
            p: &self.p,
            intensity: self.intensity.as_ref().map(|i| IntensitiesView { ticks: &i.ticks, present: &i.present }),
            repaired: self.repaired.as_deref(),
            markers: &self.markers,
        }
    }

    /// Whether event `k` was decoded from a state.
    #[must_use]
    pub fn is_repaired(&self, k: usize) -> bool {
        self.view().is_repaired(k)
    }

    /// Adds a column of intensities, if it is missing, in which the events so far have none.
    #[inline]
    pub(crate) fn complete_intensities(&mut self) {
        let n = self.len();
        let column = self.intensity.get_or_insert_default();
        if column.ticks.len() != n || column.present.len() != n {
            column.ticks.resize(n, 0);
            column.present.resize(n, false);
        }
    }

    /// Marks the events from index `from` on, which were just added, as decoded from states or not.
    #[inline]
    pub(crate) fn mark_repaired(&mut self, from: usize, repaired: bool) {
        let n = self.len();
        if repaired && from < n {
            self.repaired.get_or_insert_default().resize(from, false);
        }
        if let Some(column) = &mut self.repaired {
            column.resize(n, repaired);
        }
    }

    /// Appends the first `n` events of a table of the same array, and all its markers; a column that only one table has
    /// is filled for the other.
    pub fn append(&mut self, more: &Self, n: usize) {
        if let Some(Intensities { ticks, present }) = &more.intensity {
            self.complete_intensities();
            let column = self.intensity.get_or_insert_default();
            column.ticks.extend_from_slice(&ticks[..n]);
            column.present.extend_from_slice(&present[..n]);
        }
        let rows = self.len();
        self.t.extend_from_slice(&more.t[..n]);
        self.x.extend_from_slice(&more.x[..n]);
        self.y.extend_from_slice(&more.y[..n]);
        self.p.extend_from_slice(&more.p[..n]);
        self.markers.extend_from_slice(&more.markers);
        if self.intensity.is_some() {
            self.complete_intensities();
        }
        match &more.repaired {
            None => self.mark_repaired(rows, false),
            Some(repaired) => {
                let column = self.repaired.get_or_insert_default();
                column.resize(rows, false);
                column.extend_from_slice(&repaired[..n]);
            }
        }
    }

    /// Splits off the events from index `rows` on, and the markers from index `markers` on.
    #[must_use]
    pub fn split_off(&mut self, rows: usize, markers: usize) -> Self {
        let intensity = self.intensity.as_mut();
        Self {
            array: self.array.clone(),
            t: self.t.split_off(rows),
            x: self.x.split_off(rows),
            y: self.y.split_off(rows),
            p: self.p.split_off(rows),
            intensity: intensity
                .map(|i| Intensities { ticks: i.ticks.split_off(rows), present: i.present.split_off(rows) }),
            repaired: self.repaired.as_mut().map(|repaired| repaired.split_off(rows)),
            markers: self.markers.split_off(markers),
        }
    }

    /// Removes all events and markers but keeps the columns' memory, to be filled again.
    pub fn clear(&mut self) {
        self.t.clear();
        self.x.clear();
        self.y.clear();
        self.p.clear();
        self.markers.clear();
        self.repaired = None;
        if let Some(intensity) = &mut self.intensity {
            intensity.ticks.clear();
            intensity.present.clear();
        }
    }
}

/// The intensity words of an [`EventsView`].
#[derive(Debug, Clone, Copy)]
pub struct IntensitiesView<'a> {
    /// As [`Intensities::ticks`].
    pub ticks: &'a [u16],
    /// As [`Intensities::present`].
    pub present: &'a [bool],
}

/// A view of events whose columns are in an [`Events`], or in memory of a caller, who must not change them meanwhile.
#[derive(Debug, Clone, Copy)]
pub struct EventsView<'a> {
    /// The sensor.
    pub array: &'a Array,
    /// Time, us, unwrapped.
    pub t: &'a [i64],
    /// Column.
    pub x: &'a [u16],
    /// Row.
    pub y: &'a [u16],
    /// Polarity: true if the pressure rose.
    pub p: &'a [bool],
    /// The taxels' values at the changes; none if no event has a value.
    pub intensity: Option<IntensitiesView<'a>>,
    /// As [`Events::repaired`].
    pub repaired: Option<&'a [bool]>,
    /// Starts and stops, by time.
    pub markers: &'a [Marker],
}

impl<'a> EventsView<'a> {
    /// Number of events.
    #[must_use]
    pub fn len(&self) -> usize {
        self.t.len()
    }

    /// Whether there is no event.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.t.is_empty()
    }

    /// Whether event `k` was decoded from a state.
    #[must_use]
    pub fn is_repaired(&self, k: usize) -> bool {
        self.repaired.is_some_and(|repaired| repaired[k])
    }

    /// The events of a range of indices, without markers.
    #[must_use]
    pub fn piece(&self, range: std::ops::Range<usize>) -> Self {
        let part = |i: IntensitiesView<'a>| IntensitiesView {
            ticks: &i.ticks[range.clone()],
            present: &i.present[range.clone()],
        };
        Self {
            array: self.array,
            t: &self.t[range.clone()],
            x: &self.x[range.clone()],
            y: &self.y[range.clone()],
            p: &self.p[range.clone()],
            intensity: self.intensity.map(part),
            repaired: self.repaired.map(|repaired| &repaired[range.clone()]),
            markers: &[],
        }
    }

    /// Splits the events into views of `count` events each, without markers.
    pub fn pieces(self, count: usize) -> impl Iterator<Item = Self> {
        (0..self.len()).step_by(count).map(move |begin| self.piece(begin..self.len().min(begin + count)))
    }

    /// Checks that the events of a whole recording are in order, except for the reordering that [`FARTHEST_BACK_US`]
    /// allows.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the first event that is farther behind.
    pub fn check_order(&self) -> Result<()> {
        let (mut latest, mut row) = (i64::MIN, 0);
        for (k, &t) in self.t.iter().enumerate() {
            if t >= latest {
                (latest, row) = (t, k);
            } else if latest.abs_diff(t) > FARTHEST_BACK_US.unsigned_abs() {
                return Err(problem!(
                    "event {k} at {t} us: is more than 0.1 s before event {row} at {latest} us; sort the events by \
                     time with Events.sorted()"
                ));
            }
        }
        Ok(())
    }

    /// Checks that columns are equally long and that every event is on the array.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the column or the event.
    pub fn check(&self) -> Result<()> {
        let t = self.len();
        let repaired = self.repaired.map_or(t, <[bool]>::len);
        for (name, len) in [("x", self.x.len()), ("y", self.y.len()), ("p", self.p.len()), ("repaired", repaired)] {
            if len != t {
                return Err(problem!("events: {name} has {len} entries, t has {t}: the numbers must be equal"));
            }
        }
        if let Some(IntensitiesView { ticks, present }) = self.intensity
            && (ticks.len() != t || present.len() != t)
        {
            let ticks = ticks.len();
            return Err(problem!("events: intensity has {ticks} entries, t has {t}: the numbers must be equal"));
        }
        let (columns, rows) = (self.array.columns, self.array.rows);
        for (k, (&x, &y)) in self.x.iter().zip(self.y).enumerate() {
            if x >= columns || y >= rows {
                return Err(problem!("event {k}: row {y}, column {x} is outside {rows} rows x {columns} columns"));
            }
        }
        Ok(())
    }
}
