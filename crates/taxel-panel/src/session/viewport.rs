//! A client's view: which source it shows, at which time, and how.

use std::sync::Arc;
use std::time::Instant;

use serde_json::{Map, Value};
use taxel_core::problem;
use taxel_live::locked::lock;

use super::delivered::Delivered;
use super::following::Following;
use super::playback::Playback;
use crate::hub::Hub;
use crate::hub::folder::size;
use crate::hub::indexed::OpenRecording;
use crate::hub::live_source::LiveSource;
use crate::keyframe_index::KeyframeIndex;
use crate::protocol::messages::{Message, ViewState};
use crate::protocol::refusal::{Answer, Refusal, words};
use crate::protocol::request::Taxel;
use crate::readout_encoders::{ReadoutEncoders, ViewEncoder};
use crate::requests::{labels, opening, readout_of};
use crate::time_columns::{COLUMN_US, COLUMNS_US, is_column};
use crate::view::encoded_spikes::EncodedSpikes;
use crate::view::frame::{self, About, FOLLOWS, LIVE, MOVES, RESTART};
use crate::view::player::{Player, ViewOptions};

/// Where in its source a view is.
enum Position {
    /// At the newest state of the live source.
    Following,
    /// At a time of a recording or of the live source; empty while another thread works on it.
    At(Option<Box<SourcePosition>>),
}

/// A time of a source, and the columns of time beside it.
struct SourcePosition {
    player: Player,
    /// The columns of the window that the client chose; `None`: those up to the time.
    window: Option<Player>,
}

/// The source, the time and the options of what a client sees.
pub(super) struct Viewport {
    live: Option<Arc<LiveSource>>,
    /// The recording that is shown, in place of the live source.
    recording: Option<OpenRecording>,
    position: Position,
    playback: Playback,
    options: ViewOptions,
    /// The encoder that the client has requested.
    requested_encoder: Option<Map<String, Value>>,
    /// The encoders of the readout that reads the recording.
    recording_encoders: ReadoutEncoders,
    /// Where the window of columns ends, us; `None`: at the time of the view.
    window_us: Option<i64>,
    following: Following,
    delivered: Delivered,
    /// A new frame can be shown.
    dirty: bool,
    /// Texts for the user that no message has had yet.
    warnings: Vec<String>,
}

impl Viewport {
    pub(super) fn new(live: Option<Arc<LiveSource>>) -> Self {
        Self {
            live,
            recording: None,
            position: Position::Following,
            playback: Playback::paused(),
            options: ViewOptions::plain(COLUMN_US),
            requested_encoder: None,
            recording_encoders: ReadoutEncoders::default(),
            window_us: None,
            following: Following::default(),
            delivered: Delivered::nothing(),
            dirty: true,
            warnings: vec![],
        }
    }

    pub(super) fn recording_name(&self) -> Option<&str> {
        self.recording.as_ref().map(|shown| shown.name.as_str())
    }

    /// The recording that is shown.
    pub(super) fn open_recording(&self) -> Option<OpenRecording> {
        self.recording.clone()
    }

    pub(super) fn is_playing(&self) -> bool {
        self.playback.is_playing()
    }

    pub(super) fn is_dirty(&self) -> bool {
        self.dirty
    }

    pub(super) fn mark_dirty(&mut self) {
        self.dirty = true;
    }

    pub(super) fn take_dirty(&mut self) -> bool {
        std::mem::take(&mut self.dirty)
    }

    pub(super) fn take_warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    /// Replaces the live source, which is then followed unless a recording is shown.
    pub(super) fn set_live(&mut self, live: Option<Arc<LiveSource>>) {
        self.live = live;
        if self.recording.is_none() {
            self.follow();
        }
    }

    /// The `transport` message.
    pub(super) fn transport_message(&self) -> Message {
        let state = match (&self.position, self.playback.is_playing()) {
            (Position::Following, _) => ViewState::Following,
            (Position::At(_), true) => ViewState::Playing,
            (Position::At(_), false) => ViewState::Paused,
        };
        let source = self.recording_name().map(str::to_owned);
        Message::Transport { source, state, speed: self.playback.speed(), t_us: self.t() }
    }

    /// The `overview` message.
    pub(super) fn overview_message(&self) -> Answer<Message> {
        match (&self.recording, &self.live) {
            (Some(shown), _) => Ok(shown.indexed.overview(&shown.name)),
            (None, Some(live)) => {
                let (start_us, step_us, events) = live.index.event_rate();
                let columns = lock(&live.state);
                let force = columns.time_columns().greatest_sums(start_us, step_us, events.len(), COLUMN_US);
                Ok(Message::Overview { source: None, start_us, step_us, events, force })
            }
            (None, None) => Err("nothing is shown: open a recording first".into()),
        }
    }

    /// Board time of the view, us.
    fn t(&self) -> Option<i64> {
        match &self.position {
            Position::At(Some(position)) => Some(position.player.t()),
            Position::At(None) => None,
            Position::Following => self.live.as_ref().and_then(|live| lock(&live.state).latest()),
        }
    }

    fn index(&self) -> Answer<Arc<dyn KeyframeIndex>> {
        match (&self.recording, &self.live) {
            (Some(shown), _) => Ok(shown.indexed.index()),
            (None, Some(live)) => Ok(Arc::new(live.index.clone())),
            (None, None) => Err("nothing is shown: open a recording first".into()),
        }
    }

    // ------------------------------------------------------------------------------------------ frames

    /// Moves a playing view on; returns whether it has arrived to the end of its recording.
    pub(super) async fn play_on(&mut self) -> bool {
        let Some(t) = self.playback.now() else { return false };
        let moved = self.with_position(move |position| {
            // A window that the view leaves moves with it.
            if let Some(window) = position.window.as_mut().filter(|window| window.t() < t) {
                window.advance(t)?;
            }
            position.player.advance(t)
        });
        match moved.await {
            Ok(more) => {
                self.dirty = true;
                self.window_us = self.window_us.map(|end| end.max(t));
                if more || self.recording.is_none() {
                    return false;
                }
                self.playback.pause();
                true
            }
            Err(refusal) => {
                self.playback.pause();
                self.warnings.push(refusal.reason);
                false
            }
        }
    }

    /// Decodes columns narrower than those of the live state, where such are shown.
    pub(super) async fn update_narrow(&mut self) {
        let follows = matches!(self.position, Position::Following);
        let live = self.live.as_ref().filter(|_| follows);
        if let Err(refusal) = self.following.update_narrow(live, self.options.column_us).await {
            self.warnings.push(refusal.reason);
        }
    }

    /// The next frame; `None` where there is nothing to show.
    pub(super) fn frame(&mut self, flags: u16, number: u32) -> Option<Vec<u8>> {
        if let (Position::Following, Some(live)) = (&self.position, &self.live) {
            self.delivered.note_source_restarts(lock(&live.state).restarts());
        }
        let restart = if self.delivered.is_restart() { RESTART } else { 0 };
        let live = if self.recording.is_none() { LIVE } else { 0 };
        let moves = match self.position {
            Position::Following => MOVES | FOLLOWS,
            Position::At(_) if self.playback.is_playing() => MOVES,
            Position::At(_) => 0,
        };
        let about = About {
            flags: flags | restart | live | moves,
            number,
            from: self.delivered.from(),
            with_rest: false,
            watched: self.options.watched,
            column_us: self.options.column_us,
        };
        let needs_rest = |rests: u64| self.delivered.needs_rest(rests, moves != 0);
        let (bytes, last, rests) = match &mut self.position {
            Position::Following => self.following.frame(self.live.as_ref()?, about, needs_rest),
            Position::At(position) => {
                let SourcePosition { player, window } = &mut **position.as_mut()?;
                let rests = Some(player.state().rests()).filter(|rests| needs_rest(*rests));
                let about = About { with_rest: rests.is_some(), ..about };
                let (bytes, last) = frame::of_player(player, window.as_mut(), about);
                (bytes, last, rests)
            }
        };
        self.delivered.frame(last, self.options.column_us, rests);
        Some(bytes)
    }

    /// The `spikes` message, where the encoder has made any since the last call.
    pub(super) fn spikes_message(&mut self) -> Option<Message> {
        self.options.encoder.as_ref()?;
        let spikes = match &mut self.position {
            Position::Following => self.following.encode(self.live.as_ref()?),
            Position::At(position) => {
                let position = position.as_mut()?;
                position.window.as_mut().unwrap_or(&mut position.player).spikes_mut()
            }
        }?;
        let (message, failed) = (spikes.message(), spikes.failed().map(|error| words(&error.clone().into())));
        if let Some(reason) = failed {
            (self.options.encoder, self.requested_encoder) = (None, None);
            self.following.stop_encoding();
            self.warnings.push(reason);
        }
        message
    }

    // ------------------------------------------------------------------------------------------ moving

    /// Works on the position in another thread: a disk may be slow.
    async fn with_position<T: Send + 'static>(
        &mut self,
        work: impl FnOnce(&mut SourcePosition) -> taxel_live::Result<T> + Send + 'static,
    ) -> Answer<T> {
        let Position::At(position) = &mut self.position else { return Err("the view follows the newest data".into()) };
        let Some(mut position) = position.take() else {
            return Err("this view has ended: open the recording again".into());
        };
        let worked = tokio::task::spawn_blocking(move || {
            let outcome = work(&mut position);
            (position, outcome)
        });
        match worked.await {
            Ok((position, outcome)) => {
                self.position = Position::At(Some(position));
                Ok(outcome?)
            }
            Err(_) => {
                self.position = Position::Following;
                Err(Refusal::bug("the view"))
            }
        }
    }

    /// Moves the view to a time.
    async fn seek(&mut self, t: i64) -> Answer {
        let index = self.index()?;
        if let Err(error) = self.choose_encoder(&index) {
            self.warnings.push(words(&error));
        }
        // For the past of a live source at wide columns, the shared state has them all.
        let live = self.live.as_ref().filter(|_| self.recording.is_none() && self.options.column_us > COLUMN_US);
        let all_columns = live.map(|live| {
            let mut state = lock(&live.state);
            state.update_curve();
            Arc::new(state.time_columns().clone())
        });
        let options = ViewOptions { all_columns, ..self.options.clone() };
        // A window whose columns the client has already stays as it is.
        let same = match &mut self.position {
            Position::At(Some(position)) if !self.delivered.is_restart() => position.window.take(),
            _ => None,
        };
        let end = self.window_us;
        if end.is_none() || same.is_none() {
            self.restart();
        }
        let opened = tokio::task::spawn_blocking(move || -> taxel_live::Result<SourcePosition> {
            let Some(end) = end else {
                return Ok(SourcePosition { player: Player::open(index, t, options)?, window: None });
            };
            let player = Player::open(Arc::clone(&index), t, ViewOptions::plain(COLUMN_US))?;
            let window = same.map_or_else(|| Player::open(index, end, options), Ok)?;
            Ok(SourcePosition { player, window: Some(window) })
        });
        let position = opened.await.map_err(|_| Refusal::bug("the view")).and_then(|opened| Ok(opened?));
        if position.is_err() {
            self.restart();
        }
        self.position = Position::At(Some(Box::new(position?)));
        self.delivered.invalidate_rest();
        self.dirty = true;
        self.following.stop_encoding();
        Ok(())
    }

    /// The next frame shows everything anew.
    fn restart(&mut self) {
        self.dirty = true;
        self.delivered.invalidate();
        self.following.restart();
    }

    /// Shows the newest state of the live source from now on.
    fn follow(&mut self) {
        (self.position, self.recording, self.window_us) = (Position::Following, None, None);
        self.recording_encoders = ReadoutEncoders::default();
        self.playback.pause();
        self.restart();
        self.start_encoding();
    }

    /// While following: begins the encoder anew.
    fn start_encoding(&mut self) {
        self.following.stop_encoding();
        let (Position::Following, Ok(index), Some(live)) = (&self.position, self.index(), self.live.clone()) else {
            return;
        };
        let started = self.choose_encoder(&index).and_then(|()| match &self.options.encoder {
            Some(encoder) => self.following.start_encoding(&live, encoder, self.options.column_us),
            None => Ok(()),
        });
        if let Err(error) = started {
            (self.options.encoder, self.requested_encoder) = (None, None);
            self.warnings.push(words(&error));
        }
    }

    /// Chooses the encoder that the client has requested, of the readout that reads what is shown; none where it does not
    /// encode what an index holds.
    fn choose_encoder(&mut self, index: &Arc<dyn KeyframeIndex>) -> taxel_live::Result<()> {
        self.options.encoder = None;
        let Some(request) = self.requested_encoder.take() else { return Ok(()) };
        let live = self.live.as_ref().filter(|_| self.recording.is_none());
        let encoder = match live {
            Some(live) => ViewEncoder::requested(&request, &live.encoders())?,
            None => ViewEncoder::requested(&request, &self.recording_encoders)?,
        };
        let stream = match index.frames() {
            Some(frames) => EncodedSpikes::of_frames(&encoder, &frames, COLUMN_US, None)?.check(),
            None => encoder.encoder.stream(index.array()).map(drop).map_err(Into::into),
        };
        if stream.is_err() && encoder.of_readout && live.is_some_and(|live| live.measures_tare()) {
            let name = encoder.name;
            return Err(problem!(
                "encoder {name}: the readout is still measuring its tare; choose the encoder again after it"
            )
            .into());
        }
        stream?;
        (self.options.encoder, self.requested_encoder) = (Some(encoder), Some(request));
        Ok(())
    }

    /// These are the encoders of the readout that reads a recording from now on, if it is the one that is shown.
    pub(super) async fn set_readout(&mut self, recording: &str, encoders: &ReadoutEncoders) {
        if self.recording_name() != Some(recording) {
            return;
        }
        self.recording_encoders = encoders.clone();
        if self.requested_encoder.is_some()
            && let Err(refusal) = self.reopen().await
        {
            self.warnings.push(refusal.reason);
        }
    }

    /// Shows the same time with other options.
    async fn reopen(&mut self) -> Answer {
        self.restart();
        match self.t() {
            Some(t) if matches!(self.position, Position::At(_)) => {
                self.seek(t).await?;
                self.playback.continue_from(t);
            }
            _ => self.start_encoding(),
        }
        Ok(())
    }

    // ------------------------------------------------------------------------------------------ requests

    pub(super) async fn watch(&mut self, taxel: Option<Taxel>) -> Answer {
        let index = self.index()?;
        let array = index.array();
        let (rows, columns) = (array.rows, array.columns);
        if taxel.is_some_and(|(x, y)| x >= columns || y >= rows) {
            return Err(Refusal::of_field(
                "taxel",
                format!("must be [x, y] on {rows} rows x {columns} columns, or null"),
            ));
        }
        self.options.watched = taxel.and_then(|(x, y)| u32::try_from(array.index(x, y)).ok());
        if !matches!(self.position, Position::Following) {
            return self.reopen().await;
        }
        self.dirty = true;
        self.delivered.invalidate();
        self.following.restart_history();
        Ok(())
    }

    pub(super) async fn encode(&mut self, encoder: Option<Map<String, Value>>) -> Answer {
        self.requested_encoder = None;
        if encoder.is_some() {
            let index = self.index()?;
            self.requested_encoder = encoder;
            let chosen = self.choose_encoder(&index);
            chosen.map_err(|error| Refusal { reason: words(&error), field: Some("encoder".to_owned()) })?;
        }
        self.reopen().await
    }

    pub(super) async fn zoom(&mut self, column_us: i64, end_us: Option<i64>) -> Answer {
        if !is_column(column_us) {
            let (least, most) = COLUMNS_US;
            return Err(Refusal::of_field("column_us", format!("must be {least} times a power of two, up to {most}")));
        }
        self.options.column_us = column_us;
        self.window_us = end_us.filter(|_| !matches!(self.position, Position::Following));
        self.reopen().await
    }

    pub(super) async fn seek_request(&mut self, t: i64) -> Answer {
        self.playback.pause();
        self.seek(t).await
    }

    pub(super) async fn play(&mut self, speed: Option<f64>) -> Answer {
        let speed = speed.unwrap_or_else(|| self.playback.speed());
        let t = self.t().ok_or("nothing is shown yet")?;
        if matches!(self.position, Position::Following) {
            // Playing the live source from now on would be a delay of zero, which is following.
            return Err("the view already follows the newest data: go to an earlier time first".into());
        }
        let (first, last) = self.index()?.range().unwrap_or((t, t));
        let at_end = t >= last && self.recording.is_some();
        if at_end {
            self.seek(first).await?;
        }
        self.playback.start(speed, if at_end { first } else { t });
        Ok(())
    }

    pub(super) async fn pause(&mut self) -> Answer {
        self.playback.pause();
        if matches!(self.position, Position::Following) {
            let t = self.t().ok_or("no events have arrived yet")?;
            self.seek(t).await?;
        }
        self.dirty = true;
        Ok(())
    }

    pub(super) async fn step(&mut self, steps: i64) -> Answer {
        self.pause().await?;
        for _ in 0..steps.unsigned_abs() {
            let moved = if steps > 0 {
                self.with_position(|position| {
                    let next = position.player.next_stamp()?;
                    next.map_or(Ok(None), |t| position.player.advance(t).map(|_| Some(t)))
                })
                .await?
            } else {
                let before = self.with_position(|position| position.player.last_stamp()).await?;
                if let Some(t) = before {
                    self.seek(t).await?;
                }
                before
            };
            if moved.is_none() {
                break;
            }
        }
        self.dirty = true;
        Ok(())
    }

    pub(super) fn follow_request(&mut self) -> Answer {
        if self.live.is_none() {
            return Err("this panel shows recordings only: start it by taxel live --panel".into());
        }
        self.follow();
        Ok(())
    }

    /// Opens a recording at its beginning; returns the messages about it.
    pub(super) async fn open(&mut self, hub: &Arc<Hub>, name: String, trial: Option<String>) -> Answer<Vec<Message>> {
        self.show(hub, name, trial, None).await
    }

    /// Shows the whole of a recording where its beginning is shown, at the same time; returns the messages about it.
    pub(super) async fn reopen_whole(&mut self, hub: &Arc<Hub>, name: &str) -> Option<Vec<Message>> {
        let shown = self.recording.clone().filter(|shown| shown.name == name)?;
        let (t, playing) = (self.t(), self.playback.is_playing());
        let messages = self.show(hub, shown.name, shown.trial, t).await;
        if let (true, Some(t)) = (playing, t) {
            self.playback.start(self.playback.speed(), t);
        }
        messages.map_err(|refusal| self.warnings.push(refusal.reason)).ok()
    }

    /// Shows a recording at a time, or at its beginning; returns the messages about it.
    async fn show(
        &mut self,
        hub: &Arc<Hub>,
        name: String,
        trial: Option<String>,
        t: Option<i64>,
    ) -> Answer<Vec<Message>> {
        let begun = Instant::now();
        // The reason names the file.
        let refused = |error: taxel_live::Error| Refusal { reason: words(&error), field: Some("name".to_owned()) };
        let indexed = opening::index(hub, &name, trial.as_deref()).await.map_err(refused)?;
        let labels = labels::read(hub, &name, indexed.label_times()).await;
        let bytes = size(&hub.folder.file(&name).map_err(refused)?).map_err(refused)?;
        let (file, out) =
            (hub.folder.file(&name).map_err(refused)?, hub.folder.file(&readout_of(&name)).map_err(refused)?);
        let train = hub.ask(move |handlers| handlers.training.command(&file, &out)).await?;
        let mut answer = vec![indexed.opened(&name, bytes, train, begun)];
        let index = indexed.index();
        self.options.watched = self.options.watched.filter(|&taxel| (taxel as usize) < index.array().len());
        (self.recording, self.window_us) = (Some(OpenRecording { name: name.clone(), trial, indexed }), None);
        self.recording_encoders = ReadoutEncoders::default();
        self.playback.pause();
        match index.range() {
            Some((first, _)) => self.seek(t.unwrap_or(first)).await?,
            None => self.position = Position::At(None),
        }
        answer.push(hub.labels.message(&name));
        answer.push(self.transport_message());
        if let Err(refusal) = labels {
            answer.push(Message::warning(refusal.reason));
        }
        Ok(answer)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;
    use taxel_core::encode::{ChangeEvents, Composite, Encoder, Fa1};

    use super::*;
    use crate::hub::indexed::Indexed;
    use crate::keyframe_index::recording::{RecordingIndex, tests::recorded};

    /// The `spikes` message, and whether it is of the readout's encoder.
    fn spikes(view: &mut Viewport) -> (Value, bool) {
        let mut message = json!(view.spikes_message().unwrap());
        let of_readout = message["of_readout"].take();
        (message, of_readout.as_bool().unwrap())
    }

    async fn encode(view: &mut Viewport, encoder: Value) -> (Value, bool) {
        view.encode(encoder.as_object().cloned()).await.unwrap();
        spikes(view)
    }

    #[test]
    fn an_encoder_by_its_name_alone_is_the_readout_s() {
        let path = recorded("readout-encoder", "mcap", 3);
        let index = RecordingIndex::open(&path).unwrap();
        let last = index.range().unwrap().1;
        let mut view = Viewport::new(None);
        let (name, indexed) = ("walk.mcap".to_owned(), Indexed::Events(index));
        view.recording = Some(OpenRecording { name, trial: None, indexed });
        let coarse = Encoder::ChangeEvents(ChangeEvents { noise_floor: 20.0, ..ChangeEvents::default() });
        let by_name = || json!({ "name": "change_events" });
        tokio::runtime::Builder::new_current_thread().build().unwrap().block_on(async {
            view.seek(last).await.unwrap();
            let (defaults, of_readout) = encode(&mut view, by_name()).await;
            assert!(!of_readout);
            let (stated, _) = encode(&mut view, json!(coarse)).await;
            assert_ne!(stated, defaults);
            view.set_readout("other.mcap", &coarse.clone().into()).await;
            assert_eq!(encode(&mut view, by_name()).await, (defaults.clone(), false));
            // A readout that reads from now on gives its parameters without another request.
            view.set_readout("walk.mcap", &coarse.clone().into()).await;
            assert_eq!(spikes(&mut view), (stated.clone(), true));
            // Stated parameters are those of the request.
            assert!(!encode(&mut view, json!(Encoder::ChangeEvents(ChangeEvents::default()))).await.1);
            // A part of a composite, and the whole.
            let parts = [("on", coarse), ("afferent", Encoder::Fa1(Fa1::default()))];
            let parts = parts.map(|(name, part)| (name.to_owned(), part)).into();
            let composite = Encoder::Composite(Composite { parts });
            let encoders = ReadoutEncoders::from(composite.clone());
            assert_eq!(json!(encoders), json!(["change_events", "composite", "fa1"]));
            view.set_readout("walk.mcap", &encoders).await;
            assert_eq!(encode(&mut view, by_name()).await, (stated, true));
            let (whole, _) = encode(&mut view, json!(composite)).await;
            assert_eq!(encode(&mut view, json!({ "name": "composite" })).await, (whole, true));
            view.set_readout("walk.mcap", &ReadoutEncoders::default()).await;
            assert!(view.take_warnings()[0].contains("needs a readout with several encoders"));
        });
        std::fs::remove_file(&path).unwrap();
    }
}
