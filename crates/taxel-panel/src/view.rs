//! A client's view: which source it shows, at which time, and how; and the frames that are sent of it.

mod delivered;
mod following;
pub(super) mod frame;
mod playback;

use std::sync::Arc;

use serde_json::{Value, json};
use taxel_core::held::UNKNOWN;
use taxel_core::problem;
use taxel_live::Result;
use taxel_live::locked::lock;

use crate::columns::{COLUMN_US, COLUMNS_US, Curve, MISSING, is_column};
use crate::index::Index;
use crate::live_source::LiveSource;
use crate::player::{Player, ViewOptions};
use delivered::Delivered;
use following::Following;
use frame::{About, FOLLOWS, MOVES, RESTART};
use playback::Playback;

/// Where in its source a view is.
enum Position {
    /// At the newest state of the live source.
    Following(Box<Following>),
    /// At a time of a recording or of the live source; empty where nothing can be shown.
    At(Option<Box<SourcePosition>>),
}

/// A time of a source, and the columns of time beside it.
struct SourcePosition {
    player: Player,
    /// The columns of the window that the client chose; `None`: those up to the time.
    window: Option<Player>,
}

/// The source, the time and the options of what a client sees.
pub struct View {
    live: Option<Arc<LiveSource>>,
    /// The recording that is shown, in place of the live source.
    recording: Option<Arc<Index>>,
    position: Position,
    playback: Playback,
    options: ViewOptions,
    /// Where the window of columns ends, us; `None`: at the time of the view.
    window_us: Option<i64>,
    delivered: Delivered,
    /// A new frame can be shown.
    dirty: bool,
    /// What the live source had received when the last frame was made.
    received: u64,
    /// Messages to the client that go with its next frame.
    texts: Vec<String>,
}

impl View {
    /// A view that follows a live source, where there is one.
    #[must_use]
    pub fn new(live: Option<Arc<LiveSource>>) -> Self {
        Self {
            live,
            recording: None,
            position: Position::Following(Box::default()),
            playback: Playback::paused(),
            options: ViewOptions::plain(COLUMN_US),
            window_us: None,
            delivered: Delivered::nothing(),
            dirty: true,
            received: 0,
            texts: vec![],
        }
    }

    /// Replaces the live source, which is then followed unless a recording is shown.
    pub fn set_live(&mut self, live: Option<Arc<LiveSource>>) {
        self.live = live;
        if self.recording.is_none() {
            self.follow_newest();
        }
    }

    /// What it does (`following`, `playing` or `paused`), the speed, and the board time, us.
    #[must_use]
    pub fn transport(&self) -> (&'static str, f64, Option<i64>) {
        let state = match (&self.position, self.playback.is_playing()) {
            (Position::Following(_), _) => "following",
            (Position::At(_), true) => "playing",
            (Position::At(_), false) => "paused",
        };
        (state, self.playback.speed, self.t())
    }

    /// Whether [`View::advance`] has work to do before the next frame.
    #[must_use]
    pub fn moves(&self) -> bool {
        self.playback.is_playing()
    }

    fn is_following(&self) -> bool {
        matches!(self.position, Position::Following(_))
    }

    /// Board time of the view, us.
    fn t(&self) -> Option<i64> {
        match &self.position {
            Position::At(Some(position)) => Some(position.player.t),
            Position::At(None) => None,
            Position::Following(_) => self.live.as_ref().and_then(|live| lock(&live.state).latest),
        }
    }

    fn index(&self) -> Result<Arc<Index>> {
        match (&self.recording, &self.live) {
            (Some(index), _) => Ok(Arc::clone(index)),
            (None, Some(live)) => Ok(Arc::clone(&live.index)),
            (None, None) => Err(problem!("nothing is shown: open a recording first").into()),
        }
    }

    /// Makes the `values` message of a time, us: the curves, and what the watched taxel holds then. It takes as long as
    /// [`View::seek`], without the view.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where nothing is shown; `File` or `Core` where the recording cannot be read.
    pub fn values(&self) -> Result<impl FnOnce(i64) -> Result<Value> + Send + use<>> {
        let (index, watched) = (self.index()?, self.options.watched);
        Ok(move |t| {
            let Player { state, .. } = Player::open(&index, t, &ViewOptions::plain(COLUMNS_US.0), None)?;
            let curves = state.curves().map(|Curve { sum, area, x, y }| match area {
                area if area == MISSING.area => Value::Null,
                area => json!({ "sum": sum, "area": area, "x": x, "y": y }),
            });
            let taxel = watched.map(|taxel| state.held()[taxel as usize]).filter(|&held| held != UNKNOWN);
            Ok(json!({ "type": "values", "t_us": t, "curves": curves.collect::<Vec<_>>(), "taxel": taxel }))
        })
    }

    fn warn(&mut self, error: &taxel_live::Error) {
        self.texts.push(json!({ "type": "warning", "text": error.to_string() }).to_string());
    }

    // ------------------------------------------------------------------------------------------ frames

    /// Moves a playing view on; returns whether it has arrived at the end of its recording.
    pub fn advance(&mut self) -> bool {
        let Some(t) = self.playback.now() else { return false };
        let moved = self.position().and_then(|position| {
            // A window that the view leaves moves with it.
            if let Some(window) = position.window.as_mut().filter(|window| window.t < t) {
                window.advance(t)?;
            }
            position.player.advance(t)
        });
        let more = match moved {
            Ok(more) => more || self.recording.is_none(),
            Err(error) => {
                self.warn(&error);
                false
            }
        };
        self.dirty = true;
        self.window_us = self.window_us.map(|end| end.max(t));
        if !more {
            self.playback.pause();
        }
        !more
    }

    /// The next frame, and messages that go with it; `None` where there is nothing new to show.
    pub fn frame(&mut self) -> Option<(Vec<u8>, Vec<String>)> {
        if let (Position::Following(following), Some(live)) = (&mut self.position, &self.live) {
            let received = live.received();
            self.dirty |= std::mem::replace(&mut self.received, received) != received;
            self.delivered.note_source_restarts(lock(&live.state).restarts);
            if self.dirty && self.options.watched.is_some() {
                following.read(live).ok()?;
            }
        }
        if !std::mem::take(&mut self.dirty) {
            return None;
        }
        let restart = if self.delivered.is_restart() { RESTART } else { 0 };
        let moves = match self.position {
            Position::Following(_) => MOVES | FOLLOWS,
            Position::At(_) if self.playback.is_playing() => MOVES,
            Position::At(_) => 0,
        };
        let about = About {
            flags: restart | moves,
            from: self.delivered.from(),
            watched: self.options.watched,
            column_us: self.options.column_us,
        };
        let (bytes, last) = match &mut self.position {
            Position::Following(following) => following.frame(self.live.as_ref()?, about),
            Position::At(position) => {
                let SourcePosition { player, window } = &mut **position.as_mut()?;
                window.iter_mut().for_each(|window| window.state.update_curve());
                player.state.update_curve();
                let beside = window.as_ref().unwrap_or(player);
                frame::write(&player.state, &beside.state, beside.history.as_ref(), about)
            }
        };
        self.delivered.frame(last, self.options.column_us);
        Some((bytes, std::mem::take(&mut self.texts)))
    }

    // ------------------------------------------------------------------------------------------ moving

    fn position(&mut self) -> Result<&mut SourcePosition> {
        match &mut self.position {
            Position::Following(_) => Err(problem!("the view follows the newest data").into()),
            Position::At(None) => Err(problem!("this view has ended: open the recording again").into()),
            Position::At(Some(position)) => Ok(position),
        }
    }

    /// Moves the view to a time.
    fn go(&mut self, t: i64) -> Result<()> {
        let index = self.index()?;
        // For the past of a live source at wide columns, the shared state has them all.
        let live = self.live.as_ref().filter(|_| self.recording.is_none() && self.options.column_us > COLUMN_US);
        let whole = live.map(|live| {
            let mut state = lock(&live.state);
            state.update_curve();
            Arc::new(state.columns().clone())
        });
        // A window whose columns the client has already stays as it is.
        let same = match &mut self.position {
            Position::At(Some(position)) if !self.delivered.is_restart() => position.window.take(),
            _ => None,
        };
        let end = self.window_us;
        if end.is_none() || same.is_none() {
            self.restart();
        }
        let open = |t, options: &ViewOptions| Player::open(&index, t, options, whole.as_ref());
        let position = match end {
            None => open(t, &self.options).map(|player| SourcePosition { player, window: None }),
            Some(end) => open(t, &ViewOptions::plain(COLUMN_US)).and_then(|player| {
                let window = same.map_or_else(|| open(end, &self.options), Ok)?;
                Ok(SourcePosition { player, window: Some(window) })
            }),
        };
        if position.is_err() {
            self.restart();
        }
        self.position = Position::At(Some(Box::new(position?)));
        self.dirty = true;
        Ok(())
    }

    /// The next frame shows everything anew.
    fn restart(&mut self) {
        self.dirty = true;
        self.delivered.invalidate();
    }

    /// Shows the newest state of the live source from now on.
    fn follow_newest(&mut self) {
        (self.recording, self.window_us) = (None, None);
        self.playback.pause();
        self.begin_following();
    }

    fn begin_following(&mut self) {
        self.restart();
        self.position = Position::Following(Box::default());
        // Of what all clients share there are no narrower ones.
        self.options.column_us = self.options.column_us.max(COLUMN_US);
        let Some(live) = self.live.clone() else { return };
        match Following::begin(&live, &self.options) {
            Ok(following) => self.position = Position::Following(Box::new(following)),
            Err(error) => self.warn(&error),
        }
    }

    /// Shows the same time with other options.
    fn reopen(&mut self) -> Result<()> {
        self.restart();
        match self.t() {
            _ if self.is_following() => self.begin_following(),
            Some(t) => {
                self.go(t)?;
                if self.playback.is_playing() {
                    self.playback.start(self.playback.speed, t);
                }
            }
            None => {}
        }
        Ok(())
    }

    // ------------------------------------------------------------------------------------------ requests

    /// Sends the history of a taxel (column, row) from now on, or none.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` for a taxel outside the array; `File` or `Core` where the recording cannot be read.
    pub fn watch(&mut self, taxel: Option<(u16, u16)>) -> Result<()> {
        let index = self.index()?;
        let array = &index.sensor.array;
        let (rows, columns) = (array.rows, array.columns);
        if taxel.is_some_and(|(x, y)| x >= columns || y >= rows) {
            return Err(problem!("taxel"; ": must be [x, y] on {rows} rows x {columns} columns, or null").into());
        }
        self.options.watched = taxel.and_then(|(x, y)| u32::try_from(array.index(x, y)).ok());
        self.reopen()
    }

    /// Shows columns of this width, us, which end at a time or, without one, at that of the view. Those of a view that
    /// follows are 4 ms wide at least.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` for a width that does not exist; `File` or `Core` where the recording cannot be read.
    pub fn zoom(&mut self, column_us: i64, end_us: Option<i64>) -> Result<()> {
        if !is_column(column_us) {
            let (least, most) = COLUMNS_US;
            return Err(problem!("column_us"; ": must be {least} times a power of two, up to {most}").into());
        }
        self.options.column_us = column_us;
        self.window_us = end_us.filter(|_| !self.is_following());
        self.reopen()
    }

    /// Moves the view to a time, us, and stops playing.
    ///
    /// # Errors
    ///
    /// `File` or `Core` where the recording cannot be read.
    pub fn seek(&mut self, t: i64) -> Result<()> {
        self.playback.pause();
        self.go(t)
    }

    /// Plays from here, from the end of a recording from its beginning; at the last speed unless one is given.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where nothing is shown, or the view follows the newest data.
    pub fn play(&mut self, speed: Option<f64>) -> Result<()> {
        let speed = speed.unwrap_or(self.playback.speed);
        let t = self.t().ok_or_else(|| problem!("nothing is shown yet"))?;
        if self.is_following() {
            // Playing the live source from now on would be a delay of zero, which is following.
            return Err(problem!("the view already follows the newest data: go to an earlier time first").into());
        }
        let (first, last) = self.index()?.range().unwrap_or((t, t));
        let at_end = t >= last && self.recording.is_some();
        if at_end {
            self.go(first)?;
        }
        self.playback.start(speed, if at_end { first } else { t });
        Ok(())
    }

    /// Stops playing, or following.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` before the first event.
    pub fn pause(&mut self) -> Result<()> {
        self.playback.pause();
        if self.is_following() {
            let t = self.t().ok_or_else(|| problem!("no events have arrived yet"))?;
            self.go(t)?;
        }
        self.dirty = true;
        Ok(())
    }

    /// Moves by so many time stamps that have events, back where negative.
    ///
    /// # Errors
    ///
    /// As [`View::pause`]; `File` or `Core` where the recording cannot be read.
    pub fn step(&mut self, steps: i64) -> Result<()> {
        self.pause()?;
        for _ in 0..steps.unsigned_abs() {
            let player = &mut self.position()?.player;
            if steps > 0 {
                let Some(t) = player.next_stamp()? else { break };
                player.advance(t)?;
            } else {
                let before = player.t;
                let Some(t) = self.index()?.stamp_before(before)? else { break };
                self.go(t)?;
            }
        }
        self.dirty = true;
        Ok(())
    }

    /// Follows the live source.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where there is none.
    pub fn follow(&mut self) -> Result<()> {
        if self.live.is_none() {
            return Err(problem!("this panel shows recordings only: start it by taxel live --panel").into());
        }
        self.follow_newest();
        Ok(())
    }

    /// Shows a recording at its beginning, paused.
    ///
    /// # Errors
    ///
    /// `File` or `Core` where the recording cannot be read.
    pub fn show(&mut self, index: Arc<Index>) -> Result<()> {
        self.options.watched = self.options.watched.filter(|&taxel| (taxel as usize) < index.sensor.array.len());
        (self.recording, self.window_us) = (Some(Arc::clone(&index)), None);
        self.playback.pause();
        match index.range() {
            Some((first, _)) => self.go(first)?,
            None => self.position = Position::At(None),
        }
        Ok(())
    }
}
