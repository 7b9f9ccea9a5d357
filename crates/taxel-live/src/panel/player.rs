//! A view of a film at a time, which goes on, back and from stamp to stamp.

use std::sync::Arc;

use taxel_core::encode::Encoder;
use taxel_core::problem;

use super::film::{Film, Next, Reel};
use super::lens::{COLUMN_US, FORGET, History, LATE_US, Lens, SPAN, Strip, column_of};
use super::spikes::Spikes;
use crate::Result;
use crate::pipeline::{Change, UNKNOWN};

/// Changes that may be read for the history of a taxel and an encoder's spikes alone.
const HISTORY_CHANGES: u64 = 2_000_000;

/// How a view looks at a film.
#[derive(Debug, Clone)]
pub struct Gaze {
    /// A column of time, us ([`is_column`](super::lens::is_column)).
    pub column_us: i64,
    /// Whose history is shown.
    pub watched: Option<u32>,
    /// Whose spikes.
    pub encoder: Option<Encoder>,
    /// Raster and curves of all that can be shown, where the film does not keep them itself.
    pub whole: Option<Arc<Strip>>,
}

impl Gaze {
    /// By columns of so many us, and nothing else.
    #[must_use]
    pub fn plain(column_us: i64) -> Self {
        Self { column_us, watched: None, encoder: None, whole: None }
    }

    /// Whether columns are narrower than what films keep.
    #[must_use]
    pub fn is_near(&self) -> bool {
        self.column_us < COLUMN_US
    }
}

/// A film at a time.
pub struct Player {
    film: Arc<dyn Film>,
    reel: Box<dyn Reel>,
    lens: Lens,
    /// From this column of the lens on its own strip holds; before it the film's.
    own: i64,
    waiting: Vec<Change>,
    place: usize,
    t: i64,
    history: Option<History>,
    spikes: Option<Spikes>,
    gaze: Gaze,
}

impl Player {
    /// Shows a time (us), cut to what there is, as it is looked at.
    ///
    /// # Errors
    ///
    /// As [`Film::open`] and [`Reel::next`]; `Core(Problem)` where the encoder cannot be of this array.
    pub fn open(film: Arc<dyn Film>, t: i64, gaze: Gaze) -> Result<Self> {
        let (first, last) = film.range().ok_or_else(|| problem!("nothing to show: it holds no events"))?;
        let t = t.clamp(first, last);
        let span = SPAN * gaze.column_us;
        let kept = !gaze.is_near() && (film.strip().is_some() || gaze.whole.is_some());
        let wants = gaze.watched.is_some() || gaze.encoder.is_some();
        let dense = film.events_before(t).saturating_sub(film.events_before(t - span)) > HISTORY_CHANGES;
        let needs = if kept && (!wants || dense) { 0 } else { span };
        let (frame, reel) = film.open(t.saturating_sub(needs.max(FORGET * COLUMN_US) + LATE_US))?;
        let columns = film.array().columns;
        let unit_us = gaze.column_us.min(COLUMN_US);
        let room = Strip::room(film.array().rows.into(), span / unit_us);
        let lens = Lens::new(columns, film.floor(), &frame, unit_us, room);
        let own = frame.latest.map_or(i64::MIN, |latest| column_of(latest + LATE_US, unit_us));
        let history = gaze.watched.map(|taxel| {
            let held = frame.held.get(taxel as usize).copied().unwrap_or(UNKNOWN);
            History::new(taxel, held, frame.latest, gaze.column_us)
        });
        let encoder = gaze.encoder.as_ref();
        let spikes = encoder.map(|e| Spikes::new(e, film.array(), gaze.column_us, &frame.held, frame.latest));
        let spikes = spikes.transpose()?;
        let mut player = Self { film, reel, lens, own, waiting: vec![], place: 0, t, history, spikes, gaze };
        player.advance(t)?;
        Ok(player)
    }

    /// Moves on to a later time, at most to the end; gives whether there is more.
    ///
    /// # Errors
    ///
    /// As [`Reel::next`].
    pub fn advance(&mut self, t: i64) -> Result<bool> {
        let last = self.film.range().map_or(t, |(_, last)| last);
        self.follow(t.min(last))?;
        if let Some(spikes) = self.spikes.as_mut().filter(|_| t >= last) {
            // Nothing more comes at the last stamp either.
            spikes.advance(last + 1);
        }
        Ok(t < last)
    }

    /// Moves on to a later time, into the silence behind the end too.
    ///
    /// # Errors
    ///
    /// As [`Reel::next`].
    pub fn follow(&mut self, t: i64) -> Result<()> {
        loop {
            let ahead = &self.waiting[self.place..];
            let now = ahead.iter().position(|change| change.t > t).unwrap_or(ahead.len());
            let (now, later) = ahead.split_at(now);
            self.lens.take_all(now);
            if let Some(history) = &mut self.history {
                now.iter().for_each(|change| history.take(change));
            }
            if let Some(spikes) = &mut self.spikes {
                spikes.take(now);
            }
            self.place += now.len();
            if !later.is_empty() {
                break;
            }
            self.waiting.clear();
            self.place = 0;
            match self.reel.next(&mut self.waiting)? {
                Next::Changes => {}
                Next::Held(held, events) => self.lens.hold(&held, events),
                Next::End => break,
            }
        }
        self.lens.advance(t);
        if let Some(spikes) = &mut self.spikes {
            spikes.advance(t);
        }
        self.t = self.t.max(t);
        Ok(())
    }

    /// The time of the next stamp that has events, us.
    ///
    /// # Errors
    ///
    /// As [`Reel::next`].
    pub fn next_stamp(&mut self) -> Result<Option<i64>> {
        loop {
            if let Some(change) = self.waiting.get(self.place) {
                return Ok(Some(change.t.max(self.t)));
            }
            self.waiting.clear();
            self.place = 0;
            match self.reel.next(&mut self.waiting)? {
                Next::Changes => {}
                Next::Held(held, events) => self.lens.hold(&held, events),
                Next::End => return Ok(None),
            }
        }
    }

    /// The time of the last stamp before this one that has events, us.
    ///
    /// # Errors
    ///
    /// As [`Film::open`] and [`Reel::next`].
    pub fn last_stamp(&self) -> Result<Option<i64>> {
        let mut from = self.t;
        loop {
            let (_, mut reel) = self.film.open(from.saturating_sub(1))?;
            let (mut changes, mut found) = (vec![], None);
            'reading: loop {
                changes.clear();
                match reel.next(&mut changes)? {
                    Next::Changes => {}
                    Next::Held(..) => continue,
                    Next::End => break,
                }
                for change in &changes {
                    if change.t >= self.t {
                        break 'reading;
                    }
                    found = found.max(Some(change.t));
                }
            }
            if found.is_some() {
                return Ok(found);
            }
            match self.film.earlier(from.saturating_sub(1)) {
                Some(earlier) => from = earlier,
                None => return Ok(None),
            }
        }
    }

    /// The time shown, us.
    #[must_use]
    pub fn t(&self) -> i64 {
        self.t
    }

    /// What it shows.
    #[must_use]
    pub fn lens(&self) -> &Lens {
        &self.lens
    }

    /// The film.
    #[must_use]
    pub fn film(&self) -> &Arc<dyn Film> {
        &self.film
    }

    /// The same, to take rest and floor of another.
    pub fn lens_mut(&mut self) -> &mut Lens {
        &mut self.lens
    }

    /// What is watched.
    #[must_use]
    pub fn history(&self) -> Option<&History> {
        self.history.as_ref()
    }

    pub(super) fn spikes(&self) -> Option<&Spikes> {
        self.spikes.as_ref()
    }

    pub(super) fn spikes_mut(&mut self) -> Option<&mut Spikes> {
        self.spikes.as_mut()
    }

    /// The lens' strip, and from which column on it holds; before that the film's, where one is kept.
    #[must_use]
    pub fn strips(&self) -> (&Strip, i64, Option<&Strip>) {
        let whole = if self.gaze.is_near() { None } else { self.gaze.whole.as_deref().or(self.film.strip()) };
        (self.lens.strip(), self.own, whole)
    }
}
