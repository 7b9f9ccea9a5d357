//! What changed, when.

use crate::{Array, Result, problem};

/// How far an event may lie behind one before it and still be heard, us: datagrams overtake each other.
pub const FARTHEST_BACK_US: i64 = 100_000;

/// The intensity words that belong to events.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Intensities {
    /// Ticks of the converter's counter (1/300 us), one an event; 0 where none is present.
    pub ticks: Vec<u16>,
    /// Whether the event came with an intensity.
    pub present: Vec<bool>,
}

/// Start or stop of a recording, as the board marked it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Marker {
    /// us, unwrapped.
    pub t: i64,
    /// Start (true) or stop.
    pub start: bool,
}

/// Changes at taxels, in the order in which they came; one column a field.
#[derive(Debug, Clone, PartialEq)]
pub struct Events {
    /// The sensor.
    pub array: Array,
    /// us, unwrapped.
    pub t: Vec<i64>,
    /// Column.
    pub x: Vec<u16>,
    /// Row.
    pub y: Vec<u16>,
    /// More pressure (true) or less.
    pub p: Vec<bool>,
    /// The held values that came with the changes, or none at all.
    pub intensity: Option<Intensities>,
    /// Starts and stops, by time.
    pub markers: Vec<Marker>,
}

impl Events {
    /// No event yet.
    #[must_use]
    pub fn empty(array: Array) -> Self {
        Self { array, t: vec![], x: vec![], y: vec![], p: vec![], intensity: None, markers: vec![] }
    }

    /// How many events.
    #[must_use]
    pub fn len(&self) -> usize {
        self.t.len()
    }

    /// Whether there is no event.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.t.is_empty()
    }

    /// The events of a range of places, without markers.
    #[must_use]
    pub fn piece(&self, range: std::ops::Range<usize>) -> Self {
        Self {
            array: self.array.clone(),
            t: self.t[range.clone()].to_vec(),
            x: self.x[range.clone()].to_vec(),
            y: self.y[range.clone()].to_vec(),
            p: self.p[range.clone()].to_vec(),
            intensity: self
                .intensity
                .as_ref()
                .map(|i| Intensities { ticks: i.ticks[range.clone()].to_vec(), present: i.present[range].to_vec() }),
            markers: vec![],
        }
    }

    /// Checks that the events of a whole recording came in order, but for what [`FARTHEST_BACK_US`] allows.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the first event that lies farther back.
    pub fn check_order(&self) -> Result<()> {
        let (mut latest, mut row) = (i64::MIN, 0);
        for (k, &t) in self.t.iter().enumerate() {
            if t >= latest {
                (latest, row) = (t, k);
            } else if latest.abs_diff(t) > FARTHEST_BACK_US.unsigned_abs() {
                return Err(problem!(
                    "event {k} at {t} us: lies more than 0.1 s behind event {row} at {latest} us; put them in order of \
                     time with Events.sorted()"
                ));
            }
        }
        Ok(())
    }

    /// Forgets all events and markers but keeps the columns' memory, to be filled again.
    pub fn clear(&mut self) {
        self.t.clear();
        self.x.clear();
        self.y.clear();
        self.p.clear();
        self.markers.clear();
        if let Some(intensity) = &mut self.intensity {
            intensity.ticks.clear();
            intensity.present.clear();
        }
    }

    /// Checks that columns are equally long and that every event lies on the array.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the column or the event.
    pub fn check(&self) -> Result<()> {
        let pairs = self.intensity.as_ref().map(|i| (i.ticks.len(), i.present.len()));
        check(&self.array, self.t.len(), &self.x, &self.y, self.p.len(), pairs)
    }
}

/// [`Events::check`] for columns wherever they lie; of t, p and a pair of ticks and present their lengths matter.
///
/// # Errors
///
/// `Problem`, naming the column or the event.
pub fn check(array: &Array, t: usize, x: &[u16], y: &[u16], p: usize, intensity: Option<(usize, usize)>) -> Result<()> {
    for (name, len) in [("x", x.len()), ("y", y.len()), ("p", p)] {
        if len != t {
            return Err(problem!("events: {name} has {len} entries, t has {t}: they must be equal"));
        }
    }
    if let Some((ticks, present)) = intensity
        && (ticks != t || present != t)
    {
        return Err(problem!("events: intensity has {ticks} entries, t has {t}: they must be equal"));
    }
    let (columns, rows) = (array.columns, array.rows);
    for (k, (&x, &y)) in x.iter().zip(y).enumerate() {
        if x >= columns || y >= rows {
            return Err(problem!("event {k}: taxel x={x}, y={y} lies outside {rows} rows x {columns} columns"));
        }
    }
    Ok(())
}
