//! The values of taxels at rest, for one board on one day.

use serde::{Deserialize, Serialize};

use super::channels::not_finite;
use crate::held::Held;
use crate::rest::{FollowedRest, Following, Rest, Value};
use crate::{Array, EventsView, FramesView, Result, problem, reading};

/// The rest of each taxel, the time average of its value over an interval without contact, and its noise there.
///
/// Record it with the board's noise floor at 0; otherwise a taxel's rest is known only to within the floor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tare {
    /// The sensor.
    pub array: Array,
    /// Rest by taxel (`row * columns + column`), in the sensor's unit; `None` for a taxel without any event.
    pub rest: Vec<Option<f64>>,
    /// Standard deviation of the taxels' values over the interval, weighted by time, in the sensor's unit; `None` where
    /// the rest is unknown.
    pub noise: Vec<Option<f64>>,
    /// Start of the interval at rest, us.
    pub start_us: i64,
    /// End of the interval, us.
    pub stop_us: i64,
    /// A note, for example the board and the day.
    pub note: String,
}

impl Tare {
    /// Checks that there is one finite rest per taxel, and one finite noise of 0 or more where there is any.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the taxel.
    pub fn check(&self) -> Result<()> {
        let (rows, columns) = (self.array.rows, self.array.columns);
        self.array.check().map_err(|error| problem!("tare: {error}"))?;
        if self.start_us >= self.stop_us {
            return Err(problem!("tare from {} to {} us: start must be before stop", self.start_us, self.stop_us));
        }
        for (what, values, least) in [("rest", &self.rest, f64::MIN), ("noise", &self.noise, 0.0)] {
            if values.len() != self.array.len() {
                let n = values.len();
                return Err(problem!(
                    "tare: {what} of {n} taxels for {rows} x {columns} taxels: must be one per taxel"
                ));
            }
            let sound = |value: f64| value.is_finite() && value >= least;
            if let Some(taxel) = values.iter().position(|value| value.is_some_and(|value| !sound(value))) {
                let (at, value) = (self.array.position_text(taxel), values[taxel].unwrap_or_default());
                let or_more = if least == 0.0 { " and 0 or more" } else { "" };
                return Err(problem!("tare: {what} of the taxel at {at} is {value}: must be finite{or_more}"));
            }
        }
        Ok(())
    }

    /// The tare as that of a larger array's first rows and columns; taxels beyond have none.
    #[must_use]
    pub fn padded_to(&self, array: &Array) -> Self {
        let padded = |values: &[Option<f64>]| array.padded(values, self.array.columns, &None);
        Self { array: array.clone(), rest: padded(&self.rest), noise: padded(&self.noise), ..self.clone() }
    }

    /// The rest of each taxel of an array; unknown if the taxel does not exist. Of three axes that of x and y is unknown, too:
    /// z says what is touched.
    ///
    /// # Errors
    ///
    /// `Problem` if the tare is of an array of another shape.
    pub(super) fn rest_of(&self, array: &Array) -> Result<Rest<f64>> {
        let (mut rest, axes) = (self.rest_of_axes(array)?, array.axes());
        rest.iter_mut().zip(axes).filter(|(_, axis)| *axis < 2).for_each(|(rest, _)| *rest = f64::NO_REST);
        Ok(Rest::measured(rest))
    }

    /// The rest of each taxel of an array, or of each axis of it; likewise.
    ///
    /// # Errors
    ///
    /// As [`Tare::rest_of`].
    pub(super) fn rest_of_axes(&self, array: &Array) -> Result<Vec<f64>> {
        let (from, to) = (&self.array, array);
        if !from.fits(to) {
            let others =
                if (from.rows, from.columns) == (to.rows, to.columns) { ", with other taxels missing" } else { "" };
            return Err(problem!(
                "tare of {} x {} taxels: the array has {} x {}{others}",
                from.rows,
                from.columns,
                to.rows,
                to.columns
            ));
        }
        let rest_of = |(taxel, rest): (usize, &Option<f64>)| rest.filter(|_| array.has(taxel)).unwrap_or(f64::NO_REST);
        Ok(self.rest.iter().enumerate().map(rest_of).collect())
    }

    /// The rest of an array's frames, which follows from the tare on.
    ///
    /// # Errors
    ///
    /// `Problem` if the tare is of an array of another shape, or a number of `following` is not in its range.
    pub fn followed(&self, array: &Array, following: Following) -> Result<FollowedRest> {
        following.check()?;
        Ok(FollowedRest::new(following, array, &self.rest_of_axes(array)?, &self.place_noise()))
    }

    /// The noise of each taxel; 0 where it is not known.
    pub(super) fn place_noise(&self) -> Vec<f64> {
        self.noise.iter().map(|noise| noise.unwrap_or(0.0)).collect()
    }

    /// Computes a tare from events in order of time, from `start` to `stop` us, or from all of them.
    ///
    /// # Errors
    ///
    /// As [`EventsView::check_order`], [`TareBuilder::push_events`] and [`TareBuilder::finish`].
    pub fn of_events(events: EventsView<'_>, start: Option<i64>, stop: Option<i64>, note: &str) -> Result<Self> {
        events.check()?;
        events.check_order()?;
        let stop = stop.or(events.t.iter().max().copied());
        let kept = events.t.iter().position(|&t| stop.is_some_and(|stop| t >= stop)).unwrap_or(events.len());
        let mut tare = TareBuilder::new(events.array, start);
        tare.push_events(events.piece(0..kept))?;
        tare.finish(stop.unwrap_or_default(), note)
    }

    /// Computes a tare from frames, from `start` to `stop` us, or from all of them.
    ///
    /// # Errors
    ///
    /// As [`FramesView::check`], [`TareBuilder::push_frame`] and [`TareBuilder::finish`].
    pub fn of_frames(frames: FramesView<'_>, start: Option<i64>, stop: Option<i64>, note: &str) -> Result<Self> {
        frames.check()?;
        let stop = stop.or(frames.t.last().copied());
        let mut tare = TareBuilder::new(frames.array, start);
        for (t, frame) in frames.iter().filter(|&(t, _)| stop.is_some_and(|stop| t < stop)) {
            tare.push_frame(t, frame)?;
        }
        tare.finish(stop.unwrap_or_default(), note)
    }

    /// Reads a tare from JSON.
    ///
    /// # Errors
    ///
    /// `Format` if the JSON is not a tare, `Problem` if its parts do not match.
    pub fn from_json(json: &str) -> Result<Self> {
        let tare: Self = reading::from_text(json).map_err(|unfit| unfit.format("tare"))?;
        tare.check()?;
        Ok(tare)
    }

    /// The tare as JSON.
    #[must_use]
    pub fn to_json(&self) -> String {
        // `check` guarantees finite rests, and nothing else here can fail to serialise.
        serde_json::to_string(self).unwrap_or_default()
    }
}

/// A taxel that a person zeroed: from then on its rest is the value that it had. Taxels are never zeroed automatically,
/// because sustained contact would be mistaken for rest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Zeroing {
    /// Time, us: after all events up to it, before later ones.
    pub t: i64,
    /// The taxel's column.
    pub x: u16,
    /// The taxel's row.
    pub y: u16,
    /// The new rest, in the sensor's unit.
    pub rest: f64,
    /// The rest before; `None` if it was not known.
    pub before: Option<f64>,
}

impl Zeroing {
    /// Checks that the taxel exists and that its rest is a number.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the taxel.
    pub fn check(&self, array: &Array) -> Result<()> {
        let Self { x, y, rest, .. } = *self;
        if x >= array.columns || y >= array.rows || !array.has(array.index(x, y)) {
            let (rows, columns) = (array.rows, array.columns);
            return Err(problem!(
                "taxel at row {y}, column {x}: does not exist in this array of {rows} x {columns} taxels"
            ));
        }
        if rest.is_finite() {
            Ok(())
        } else {
            Err(problem!("taxel at row {y}, column {x}: its rest is {rest}; must be finite"))
        }
    }
}

/// Computes a tare from events or frames as they arrive.
pub struct TareBuilder {
    array: Array,
    start: Option<i64>,
    present: i64,
    held: Held<f64>,
    integrals: Vec<Integral>,
}

/// The integral of one taxel's held value over time since the start.
#[derive(Clone, Copy, Default)]
struct Integral {
    /// End of the integral, us; `None` before the taxel's first event.
    until: Option<i64>,
    /// Integral of the value over time, in the sensor's unit times us.
    area: f64,
    /// Duration of the integral, us.
    time: f64,
    /// Integral of the squared deviation from the mean, in the square of the sensor's unit times us.
    squares: f64,
}

impl Integral {
    /// Extends the integral to `t` us; the taxel's value was `value` until then.
    fn extend(&mut self, t: i64, value: f64) {
        if let Some(until) = self.until {
            let time = (t - until).max(0) as f64;
            let before = self.mean().unwrap_or(value);
            self.area += value * time;
            self.time += time;
            // Welford's update, which does not subtract large squares from each other.
            self.squares += time * (value - before) * (value - self.mean().unwrap_or(value));
        }
        self.until = self.until.max(Some(t));
    }

    /// The mean over time; `None` without any time.
    fn mean(&self) -> Option<f64> {
        (self.time > 0.0).then(|| self.area / self.time)
    }

    /// The standard deviation over time; `None` without any time.
    fn deviation(&self) -> Option<f64> {
        (self.time > 0.0).then(|| (self.squares / self.time).max(0.0).sqrt())
    }
}

impl TareBuilder {
    /// Starts at `start` us, or at the first input; values from before still hold at the start.
    #[must_use]
    pub fn new(array: &Array, start: Option<i64>) -> Self {
        let (held, integrals) = (Held::all(array.len(), 0.0), vec![Integral::default(); array.len()]);
        Self { array: array.clone(), start, present: i64::MIN, held, integrals }
    }

    /// Adds the next events of the sensor.
    ///
    /// # Errors
    ///
    /// `Problem` if they have no intensities.
    pub fn push_events(&mut self, events: EventsView<'_>) -> Result<()> {
        let Some(intensity) = &events.intensity else {
            return Err(problem!("events without intensities: a tare needs intensities"));
        };
        for k in 0..events.len() {
            self.present = events.t[k].max(self.present);
            let start = *self.start.get_or_insert(self.present);
            if intensity.present[k] {
                let taxel = self.array.index(events.x[k], events.y[k]);
                let before = self.held.set(taxel, f64::from(intensity.ticks[k]));
                self.integrals[taxel].extend(self.present.max(start), before);
            }
        }
        Ok(())
    }

    /// Adds the next frame of the sensor, at `t` us.
    ///
    /// # Errors
    ///
    /// `Problem` if the frame contains NaN or is out of order.
    pub fn push_frame(&mut self, t: i64, values: &[f32]) -> Result<()> {
        if t < self.present {
            return Err(problem!("frame at {t} us comes after {} us: times must ascend", self.present));
        }
        if let Some(bad) = values.iter().find(|v| !v.is_finite()) {
            return Err(not_finite(t, *bad));
        }
        self.present = t;
        let start = *self.start.get_or_insert(t);
        for (taxel, &value) in values.iter().enumerate() {
            let before = self.held.set(taxel, f64::from(value));
            self.integrals[taxel].extend(t.max(start), before);
        }
        Ok(())
    }

    /// The tare up to `stop` us; no later input has arrived.
    ///
    /// # Errors
    ///
    /// `Problem` if there was no event, or the interval is empty.
    pub fn finish(mut self, stop: i64, note: &str) -> Result<Tare> {
        let Some(start) = self.start else { return Err(problem!("tare: nothing has arrived")) };
        if stop <= start {
            return Err(problem!("tare from {start} to {stop} us: start must be before stop"));
        }
        for (integral, &held) in self.integrals.iter_mut().zip(self.held.values()) {
            integral.extend(stop, held);
        }
        let of_each = |measure: fn(&Integral) -> Option<f64>| -> Vec<Option<f64>> {
            let of = |(taxel, integral)| measure(integral).filter(|_| self.array.has(taxel));
            self.integrals.iter().enumerate().map(of).collect()
        };
        let (rest, noise) = (of_each(Integral::mean), of_each(Integral::deviation));
        if rest.iter().all(Option::is_none) {
            return Err(problem!("tare from {start} to {stop} us: no value arrived"));
        }
        Ok(Tare { rest, noise, array: self.array, start_us: start, stop_us: stop, note: note.to_owned() })
    }
}
