//! One who looks: his credits, his view, his requests.

use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::extract::ws::{CloseFrame, Message, WebSocket};
use serde_json::{Map, Value, json};
use taxel_core::encode::Encoder;
use tokio::sync::{broadcast, mpsc, watch};

use super::film::Film;
use super::film::file::FileFilm;
use super::hub::{Hub, LiveSide, Seat, Told, said_of, said_of_zeroing};
use super::lens::{COLUMN_US, COLUMNS_US, History, LATE_US, column_of, is_column};
use super::limits::{MOST_BYTES, MOST_CREDITS};
use super::picture::{self, About, FOLLOWS, LIVE, MOVES, RECORDS, RESTART};
use super::player::{Gaze, Player};
use super::requests::{Answer, Asked, Refused, carry_out, prepare};
use super::spikes::Spikes;
use crate::locked::lock;

/// From picture to picture at least.
const FRAME: Duration = Duration::from_micros(16_000);

/// Who does not take a message for so long is let go.
const SEND_WITHIN: Duration = Duration::from_secs(5);

const PING_EVERY: Duration = Duration::from_secs(10);
const ALIVE_WITHIN: Duration = Duration::from_secs(30);

/// So many refusals in [`REFUSALS_WITHIN`] are one too many.
const MOST_REFUSALS: usize = 100;
const REFUSALS_WITHIN: Duration = Duration::from_secs(10);

/// Who follows by narrow columns and has left off for so long begins anew, us.
const NEAR_US: i64 = 1_000_000;

/// How often a rest that changes is sent.
const REST_EVERY: Duration = Duration::from_millis(500);

/// Requests of a client that are worked on at a time.
const AT_WORK: usize = 8;

const GOING_AWAY: u16 = 1001;
const UNSUPPORTED: u16 = 1003;
const POLICY: u16 = 1008;
const TOO_BIG: u16 = 1009;

/// Why a session ends.
enum End {
    Gone,
    Close(u16, &'static str),
}

/// What is looked at.
enum View {
    Following,
    /// A film at a time, of a recording or of what came live; taken out while it is moved.
    At(Option<Box<Player>>),
}

struct Session {
    hub: Arc<Hub>,
    socket: WebSocket,
    credits: u32,
    number: u32,
    view: View,
    recording: Option<(String, Arc<FileFilm>)>,
    /// Speed, and when and where playing began; `None` while it holds.
    plays: Option<(f64, Instant, i64)>,
    speed: f64,
    dirty: bool,
    restart: bool,
    from: i64,
    rests: Option<u64>,
    restarts: u64,
    rest_sent: Option<Instant>,
    /// A column of time, us.
    column_us: i64,
    watched: Option<u32>,
    encoder: Option<Encoder>,
    /// While following: history and spikes, and where to go on; and the time shown by narrower columns than the lens has.
    history: Option<(History, u64)>,
    spikes: Option<(Spikes, u64)>,
    near: Option<Box<Player>>,
    spikes_told: Instant,
    live: Option<Arc<LiveSide>>,
    pictured: Instant,
    sent: u32,
    refusals: std::collections::VecDeque<Instant>,
    answers: mpsc::Sender<Value>,
    at_work: Arc<tokio::sync::Semaphore>,
}

/// Serves one until he goes, or is let go.
pub(super) async fn run(socket: WebSocket, hub: Arc<Hub>, end: watch::Receiver<bool>, seat: Seat) {
    let (answers, given) = mpsc::channel(64);
    let session = Session {
        live: hub.live(),
        hub,
        socket,
        credits: 0,
        number: 0,
        view: View::Following,
        recording: None,
        plays: None,
        speed: 1.0,
        dirty: true,
        restart: true,
        from: i64::MIN,
        rests: None,
        restarts: 0,
        rest_sent: None,
        column_us: COLUMN_US,
        watched: None,
        encoder: None,
        history: None,
        spikes: None,
        near: None,
        spikes_told: Instant::now(),
        pictured: Instant::now(),
        sent: 0,
        refusals: std::collections::VecDeque::new(),
        answers,
        at_work: Arc::new(tokio::sync::Semaphore::new(AT_WORK)),
    };
    session.serve(end, given).await;
    drop(seat);
}

impl Session {
    async fn serve(mut self, end: watch::Receiver<bool>, given: mpsc::Receiver<Value>) {
        if let Err(End::Close(code, reason)) = self.all(end, given).await {
            let frame = CloseFrame { code, reason: reason.into() };
            let _ = self.send(Message::Close(Some(frame))).await;
        }
    }

    async fn send(&mut self, message: Message) -> Result<(), End> {
        match tokio::time::timeout(SEND_WITHIN, self.socket.send(message)).await {
            Ok(Ok(())) => Ok(()),
            Ok(Err(_)) | Err(_) => Err(End::Gone),
        }
    }

    async fn say(&mut self, said: &Value) -> Result<(), End> {
        self.send(Message::text(said.to_string())).await
    }

    async fn all(&mut self, mut end: watch::Receiver<bool>, mut given: mpsc::Receiver<Value>) -> Result<(), End> {
        let (mut told, mut moved) = self.hub.hear();
        let hub = Arc::clone(&self.hub);
        prepare(&hub).await;
        for said in [hub.hello(), hub.registers(), hub.presets(), hub.recorder.said(), hub.recordings(), hub.zeroed()] {
            self.say(&said).await?;
        }
        let (mut heard, mut pinged) = (Instant::now(), Instant::now());
        loop {
            // What is new less than a frame after the last picture is due with the next frame.
            let due = self.plays.is_some() || self.dirty && self.credits > 0;
            let soon = tokio::time::sleep(if due { FRAME } else { Duration::from_secs(1) });
            tokio::select! {
                biased;
                () = async { drop(end.wait_for(|ended| *ended).await) } => return Err(End::Close(GOING_AWAY, "the server ends")),
                message = self.socket.recv() => {
                    heard = Instant::now();
                    match message {
                        Some(Ok(Message::Text(text))) if text.len() > MOST_BYTES => {
                            return Err(End::Close(TOO_BIG, "a message of more than 65536 bytes"));
                        }
                        Some(Ok(Message::Text(text))) => self.hear(&text).await?,
                        Some(Ok(Message::Binary(_))) => return Err(End::Close(UNSUPPORTED, "text only")),
                        Some(Ok(Message::Ping(_) | Message::Pong(_))) => {}
                        Some(Ok(Message::Close(_)) | Err(_)) | None => return Err(End::Gone),
                    }
                }
                said = told.recv() => match said {
                    Ok(said) => self.pass_on(said).await?,
                    // He takes nothing.
                    Err(broadcast::error::RecvError::Lagged(_)) => return Err(End::Gone),
                    Err(broadcast::error::RecvError::Closed) => return Err(End::Close(GOING_AWAY, "the server ends")),
                },
                Some(answer) = given.recv() => self.say(&answer).await?,
                _ = moved.changed() => self.dirty = true,
                () = soon => {}
            }
            if heard.elapsed() > ALIVE_WITHIN {
                return Err(End::Close(POLICY, "no sign of life"));
            }
            if pinged.elapsed() > PING_EVERY {
                pinged = Instant::now();
                self.send(Message::Ping(Vec::new().into())).await?;
            }
            self.show().await?;
            self.tell_spikes().await?;
        }
    }

    // ------------------------------------------------------------------------------------------ what he is told

    async fn pass_on(&mut self, told: Told) -> Result<(), End> {
        match told {
            Told::Text(text) => self.send(Message::text(text.as_ref())).await,
            Told::Counters(counters) => {
                let mut said = Map::clone(&counters);
                said.insert("pictures_per_s".to_owned(), json!(f64::from(self.sent) * 4.0));
                self.sent = 0;
                self.say(&Value::Object(said)).await
            }
            Told::Labels(name) => {
                let looks = self.recording.as_ref().is_some_and(|(shown, _)| *shown == name)
                    || self.recording.is_none() && self.hub.recorder.file().as_ref() == Some(&name);
                if looks { self.say(&self.hub.labels(&name)).await } else { Ok(()) }
            }
            Told::Hello => {
                self.live = self.hub.live();
                if self.recording.is_none() {
                    self.follow();
                }
                self.say(&self.hub.hello()).await?;
                self.say(&self.hub.registers()).await
            }
        }
    }

    fn transport(&self) -> Value {
        let state = match (&self.view, self.plays) {
            (View::Following, _) => "following",
            (View::At(_), Some(_)) => "playing",
            (View::At(_), None) => "paused",
        };
        json!({
            "type": "transport", "source": self.recording.as_ref().map(|(name, _)| name), "state": state,
            "speed": self.speed, "t_us": self.t(),
        })
    }

    fn t(&self) -> Option<i64> {
        match &self.view {
            View::At(Some(player)) => Some(player.t()),
            View::At(None) => None,
            View::Following => self.live.as_ref().and_then(|live| lock(&live.lens).latest()),
        }
    }

    // ------------------------------------------------------------------------------------------ what he sees

    /// Sends a picture where there is a credit, something new, and it is time.
    async fn show(&mut self) -> Result<(), End> {
        if self.credits == 0 || self.pictured.elapsed() < FRAME.mul_f64(0.9) {
            return Ok(());
        }
        if let Some((speed, since, from)) = self.plays {
            #[allow(clippy::cast_possible_truncation)]
            let t = from.saturating_add((since.elapsed().as_secs_f64() * speed * 1e6) as i64);
            let live = self.recording.is_none();
            match self.with_player(move |player| player.advance(t)).await {
                Ok(more) => {
                    self.dirty = true;
                    if !more && !live {
                        self.plays = None;
                        self.say(&self.transport()).await?;
                    }
                }
                Err(refused) => {
                    self.plays = None;
                    self.say(&json!({ "type": "warning", "text": refused.reason })).await?;
                }
            }
        }
        if !self.dirty {
            return Ok(());
        }
        self.dirty = false;
        if let Err(refused) = self.come_near().await {
            self.say(&json!({ "type": "warning", "text": refused.reason })).await?;
        }
        let Some(bytes) = self.picture() else { return Ok(()) };
        (self.credits, self.number, self.sent) = (self.credits - 1, self.number.wrapping_add(1), self.sent + 1);
        self.pictured = Instant::now();
        self.send(Message::binary(bytes)).await
    }

    fn picture(&mut self) -> Option<Vec<u8>> {
        if let (View::Following, Some(live)) = (&self.view, &self.live) {
            let restarts = lock(&live.lens).restarts();
            self.restart |= std::mem::replace(&mut self.restarts, restarts) != restarts;
        }
        let records = self.hub.recorder.file().is_some() || self.hub.state().registers.record;
        let mut flags = if records { RECORDS } else { 0 };
        flags |= if self.restart { RESTART } else { 0 };
        flags |= if self.recording.is_none() { LIVE } else { 0 };
        let about = About {
            flags,
            number: self.number,
            from: if self.restart { i64::MIN } else { self.from },
            with_rest: false,
            watched: self.watched,
            column_us: self.column_us,
        };
        let rest_is_due = self.rest_sent.is_none_or(|at| at.elapsed() >= REST_EVERY);
        let (restart, known) = (self.restart, self.rests);
        let with_rest = |rests: u64| restart || rest_is_due && known != Some(rests);
        let (bytes, last, rests) = match &mut self.view {
            View::Following => {
                let live = self.live.clone()?;
                if let Some(watched) = self.watched {
                    let (history, next) =
                        self.history.get_or_insert_with(|| live.film.history(watched, about.column_us));
                    *next = live.film.changes_from(*next, |changes| changes.iter().for_each(|c| history.take(c)));
                }
                let mut lens = lock(&live.lens);
                let (columns, rests) = (live.film.array().columns, lens.rests());
                let about = About { flags: about.flags | MOVES | FOLLOWS, with_rest: with_rest(rests), ..about };
                let near = self.near.as_deref_mut();
                let history = self.history.as_ref().map(|(history, _)| history);
                let spikes = self.spikes.as_ref().map(|(spikes, _)| spikes);
                let come = near.as_ref().map_or(i64::MAX, |near| column_of(near.t(), about.column_us));
                let (bytes, last) = picture::of_lens(&mut lens, near, columns, history, spikes, about);
                // The lens may have gone on since the narrow columns were read: those in between come again.
                let last = last.min(come);
                (bytes, last, rests)
            }
            View::At(player) => {
                let player = player.as_mut()?;
                let rests = player.lens().rests();
                let moves = if self.plays.is_some() { MOVES } else { 0 };
                let about = About { flags: about.flags | moves, with_rest: with_rest(rests), ..about };
                let (bytes, last) = picture::of_player(player, about);
                (bytes, last, rests)
            }
        };
        if with_rest(rests) {
            (self.rests, self.rest_sent) = (Some(rests), Some(Instant::now()));
        }
        // What comes late still changes the last columns.
        (self.restart, self.from) = (false, last.saturating_sub(LATE_US / self.column_us + 1));
        Some(bytes)
    }

    /// While following by columns that are narrower than the lens has: reads on as far as the lens has come.
    async fn come_near(&mut self) -> Answer {
        let live = match (&self.view, &self.live) {
            (View::Following, Some(live)) if self.column_us < COLUMN_US => Arc::clone(live),
            _ => {
                self.near = None;
                return Ok(());
            }
        };
        let Some(t) = lock(&live.lens).latest() else { return Ok(()) };
        let (near, column_us) = (self.near.take(), self.column_us);
        let moved = tokio::task::spawn_blocking(move || -> crate::Result<Box<Player>> {
            let mut near = match near {
                // Who left off reads anew: from the last keyframe on it is less.
                Some(near) if near.t() + NEAR_US >= t && near.t() <= t => near,
                _ => Box::new(Player::open(Arc::new(live.film.clone()), t, Gaze::plain(column_us))?),
            };
            near.follow(t)?;
            near.lens_mut().rest_as(&lock(&live.lens));
            Ok(near)
        });
        self.near = Some(moved.await.map_err(|_| Refused::from("the view failed within taxel; please report it"))??);
        Ok(())
    }

    /// Works on the view elsewhere: a disk may be slow.
    async fn with_player<T: Send + 'static>(
        &mut self,
        work: impl FnOnce(&mut Player) -> crate::Result<T> + Send + 'static,
    ) -> Answer<T> {
        let View::At(place) = &mut self.view else { return Err("the view follows the newest".into()) };
        let Some(mut player) = place.take() else { return Err("the view is gone: open it again".into()) };
        let moved = tokio::task::spawn_blocking(move || {
            let outcome = work(&mut player);
            (player, outcome)
        });
        match moved.await {
            Ok((player, outcome)) => {
                self.view = View::At(Some(player));
                Ok(outcome?)
            }
            Err(_) => {
                self.view = View::Following;
                Err("the view failed within taxel; please report it".into())
            }
        }
    }

    fn film(&self) -> Answer<Arc<dyn Film>> {
        match (&self.recording, &self.live) {
            (Some((_, film)), _) => Ok(Arc::new(Arc::clone(film))),
            (None, Some(live)) => Ok(Arc::new(live.film.clone())),
            (None, None) => Err("nothing is shown: open a recording first".into()),
        }
    }

    /// Shows another time.
    async fn seek(&mut self, t: i64) -> Answer {
        let film = self.film()?;
        if let Some(encoder) = &self.encoder
            && let Err(error) = encoder.stream(film.array())
        {
            self.encoder = None;
            let _ = self.answers.try_send(json!({ "type": "warning", "text": error.to_string() }));
        }
        let (column_us, watched, encoder) = (self.column_us, self.watched, self.encoder.clone());
        // A live past at wide columns: the lens has kept them.
        let live = self.live.as_ref().filter(|_| self.recording.is_none() && column_us > COLUMN_US);
        let whole = live.map(|live| {
            let mut lens = lock(&live.lens);
            lens.settle();
            Arc::new(lens.strip().clone())
        });
        let gaze = Gaze { column_us, watched, encoder, whole };
        let opened = tokio::task::spawn_blocking(move || Player::open(film, t, gaze)).await;
        let player = opened.map_err(|_| Refused::from("the view failed within taxel; please report it"))??;
        self.view = View::At(Some(Box::new(player)));
        self.look_anew();
        self.spikes = None;
        Ok(())
    }

    /// All that was sent is of no more use.
    fn look_anew(&mut self) {
        (self.restart, self.dirty, self.history, self.near) = (true, true, None, None);
    }

    fn follow(&mut self) {
        (self.view, self.plays, self.recording) = (View::Following, None, None);
        self.look_anew();
        self.listen();
    }

    /// Shows the same time in another way.
    async fn again(&mut self) -> Answer {
        self.look_anew();
        match self.t() {
            Some(t) if matches!(self.view, View::At(_)) => {
                self.seek(t).await?;
                self.plays = self.plays.map(|(speed, _, _)| (speed, Instant::now(), t));
            }
            _ => self.listen(),
        }
        Ok(())
    }

    // ------------------------------------------------------------------------------------------ spikes

    /// While following: the encoder begins here.
    fn listen(&mut self) {
        self.spikes = None;
        let (View::Following, Some(encoder), Some(live)) = (&self.view, &self.encoder, &self.live) else { return };
        let lens = lock(&live.lens);
        let begun = Spikes::new(encoder, live.film.array(), self.column_us, lens.held(), lens.latest());
        let next = live.film.come_to();
        drop(lens);
        match begun {
            Ok(spikes) => self.spikes = Some((spikes, next)),
            Err(error) => {
                self.encoder = None;
                let _ = self.answers.try_send(json!({ "type": "warning", "text": error.to_string() }));
            }
        }
    }

    async fn tell_spikes(&mut self) -> Result<(), End> {
        if self.encoder.is_none() || self.spikes_told.elapsed() < FRAME {
            return Ok(());
        }
        self.spikes_told = Instant::now();
        if let (Some((spikes, next)), Some(live)) = (&mut self.spikes, &self.live) {
            *next = live.film.changes_from(*next, |changes| spikes.take(changes));
            if let Some(t) = lock(&live.lens).latest() {
                spikes.advance(t);
            }
        }
        let spikes = match &mut self.view {
            View::Following => self.spikes.as_mut().map(|(spikes, _)| spikes),
            View::At(player) => player.as_mut().and_then(|player| player.spikes_mut()),
        };
        let Some(spikes) = spikes else { return Ok(()) };
        let (said, failed) = (spikes.tell(), spikes.failed().map(str::to_owned));
        if let Some(text) = failed {
            (self.encoder, self.spikes) = (None, None);
            self.say(&json!({ "type": "warning", "text": text })).await?;
        }
        match said {
            Some(said) => self.say(&said).await,
            None => Ok(()),
        }
    }

    async fn encode(&mut self, asked: &Asked<'_>) -> Answer {
        self.encoder = None;
        if asked.has("encoder") {
            let said = asked.0.get("encoder").map(Value::to_string).unwrap_or_default();
            let refused =
                |error: taxel_core::Error| Refused { reason: error.to_string(), field: Some("encoder".to_owned()) };
            let encoder = Encoder::from_json(&said).map_err(refused)?;
            encoder.stream(self.film()?.array()).map_err(refused)?;
            self.encoder = Some(encoder);
        }
        self.again().await
    }

    async fn zoom(&mut self, asked: &Asked<'_>) -> Answer {
        let (least, most) = COLUMNS_US;
        let column_us = asked.whole("column_us", least, most)?;
        if !is_column(column_us) {
            return Err(Refused::of("column_us", format!("must be {least} times a power of two, up to {most}")));
        }
        self.column_us = column_us;
        self.again().await
    }

    // ------------------------------------------------------------------------------------------ what he asks

    async fn hear(&mut self, text: &str) -> Result<(), End> {
        let message: Option<Map<String, Value>> = serde_json::from_str(text).ok();
        let Some(message) = message else {
            return self.refuse(&Value::Null, "", "no JSON object".into()).await;
        };
        let id = message.get("id").cloned().unwrap_or(Value::Null);
        let named = match &id {
            Value::Null => true,
            Value::Number(number) => number.is_i64() || number.is_u64(),
            Value::String(text) => text.chars().count() <= 64,
            _ => false,
        };
        if !named {
            return self
                .refuse(&Value::Null, "", Refused::of("id", "must be a whole number or a text of 64 characters"))
                .await;
        }
        let Some(what) = message.get("type").and_then(Value::as_str).map(str::to_owned) else {
            return self.refuse(&id, "", Refused::of("type", "is missing")).await;
        };
        match self.own(&what, &Asked(&message)).await {
            Some(Ok(told)) => {
                for said in told {
                    self.say(&said).await?;
                }
                self.done(&id).await
            }
            Some(Err(refused)) => self.refuse(&id, &what, refused).await,
            None => {
                self.ask_others(id, what, message);
                self.flood()
            }
        }
    }

    /// Requests that concern his view alone; `None` for others.
    async fn own(&mut self, what: &str, asked: &Asked<'_>) -> Option<Answer<Vec<Value>>> {
        let quiet = |answer: Answer| answer.map(|()| vec![]);
        Some(match what {
            "credit" => quiet(asked.whole("n", 1, MOST_CREDITS.into()).map(|n| {
                self.credits = (self.credits + u32::try_from(n).unwrap_or(0)).min(MOST_CREDITS);
            })),
            "watch" => quiet(self.watch(asked).await),
            "encode" => quiet(self.encode(asked).await),
            "zoom" => quiet(self.zoom(asked).await),
            "seek" => match asked.time("t_us") {
                Ok(t) => {
                    self.plays = None;
                    self.seek(t).await.map(|()| vec![self.transport()])
                }
                Err(refused) => Err(refused),
            },
            "play" => self.play(asked).await.map(|()| vec![self.transport()]),
            "pause" => self.pause().await.map(|()| vec![self.transport()]),
            "step" => self.step(asked).await.map(|()| vec![self.transport()]),
            "live" => {
                if self.live.is_none() {
                    return Some(Err("this panel shows recordings only: begin it with taxel live --panel".into()));
                }
                self.follow();
                Ok(vec![self.transport()])
            }
            "open" => self.open(asked).await,
            "overview" => self.overview(),
            _ => return None,
        })
    }

    async fn watch(&mut self, asked: &Asked<'_>) -> Answer {
        let film = self.film()?;
        let array = film.array();
        let taxel = if asked.has("taxel") {
            let place = asked.0.get("taxel").and_then(Value::as_array).map(|pair| {
                pair.iter().map(|n| n.as_u64().and_then(|n| u16::try_from(n).ok())).collect::<Option<Vec<u16>>>()
            });
            match place {
                Some(Some(pair)) if pair.len() == 2 && pair[0] < array.columns && pair[1] < array.rows => {
                    u32::try_from(array.index(pair[0], pair[1])).ok()
                }
                _ => {
                    let (rows, columns) = (array.rows, array.columns);
                    return Err(Refused::of(
                        "taxel",
                        format!("must be [x, y] on {rows} rows x {columns} columns, or null"),
                    ));
                }
            }
        } else {
            None
        };
        self.watched = taxel;
        if matches!(self.view, View::Following) {
            (self.history, self.restart, self.dirty) = (None, true, true);
            return Ok(());
        }
        self.again().await
    }

    async fn play(&mut self, asked: &Asked<'_>) -> Answer {
        let speed = if asked.has("speed") { asked.number("speed", 0.001, 100.0)? } else { self.speed };
        let t = self.t().ok_or("nothing is shown yet")?;
        if matches!(self.view, View::Following) {
            // From now on at a fixed delay, which is none yet: following is that.
            return Err("the view follows the newest already; seek first".into());
        }
        let end = self.film()?.range().map_or(t, |(_, last)| last);
        let t = if t >= end && self.recording.is_some() {
            let first = self.film()?.range().map_or(t, |(first, _)| first);
            self.seek(first).await?;
            first
        } else {
            t
        };
        (self.speed, self.plays) = (speed, Some((speed, Instant::now(), t)));
        Ok(())
    }

    async fn pause(&mut self) -> Answer {
        self.plays = None;
        if matches!(self.view, View::Following) {
            let t = self.t().ok_or("nothing came yet")?;
            self.seek(t).await?;
        }
        self.dirty = true;
        Ok(())
    }

    async fn step(&mut self, asked: &Asked<'_>) -> Answer {
        let frames = asked.whole("frames", -1000, 1000)?;
        self.pause().await?;
        for _ in 0..frames.unsigned_abs() {
            let moved = if frames > 0 {
                self.with_player(|player| {
                    let next = player.next_stamp()?;
                    next.map_or(Ok(None), |t| player.advance(t).map(|_| Some(t)))
                })
                .await?
            } else {
                let before = self.with_player(|player| player.last_stamp()).await?;
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

    async fn open(&mut self, asked: &Asked<'_>) -> Answer<Vec<Value>> {
        let name = asked.text("name", 110)?.to_owned();
        let begun = Instant::now();
        let film = self.hub.film(&name).await.map_err(|error| Refused::of("name", error))?;
        let labels = self.hub.read_labels(&name).await;
        let range = film.range();
        let header = film.header();
        let noted = film.remarks.notes.iter().map(|n| json!({ "t_us": n.t_us, "text": n.text }));
        let marked = film.remarks.markers.iter().map(|m| json!({ "t_us": m.t, "start": m.start }));
        let said = film.remarks.detections.iter().take(10_000);
        let said = said.map(|(_, d)| json!({ "label": d.label, "t_us": d.t, "known_us": d.known }));
        let opened = json!({
            "type": "opened",
            "name": name,
            "array": said_of(&header.array),
            "start_us": range.map(|(first, _)| first),
            "stop_us": range.map(|(_, last)| last),
            "events": film.events,
            "bytes": film.bytes,
            "verdict": film.verdict,
            "unfinished": film.unfinished,
            "registers": header.registers,
            "markers": marked.collect::<Vec<_>>(),
            "notes": noted.collect::<Vec<_>>(),
            "zeroed": film.remarks.zeroings.iter().map(|(_, one)| said_of_zeroing(one)).collect::<Vec<_>>(),
            "detections": said.collect::<Vec<_>>(),
            "index_ms": begun.elapsed().as_secs_f64() * 1e3,
        });
        let array = &header.array;
        if self.watched.is_some_and(|taxel| taxel as usize >= array.len()) {
            self.watched = None;
        }
        let first = range.map_or(0, |(first, _)| first);
        (self.recording, self.plays) = (Some((name.clone(), film)), None);
        let mut told = vec![opened];
        match range {
            Some(_) => self.seek(first).await?,
            None => self.view = View::At(None),
        }
        told.push(self.hub.labels(&name));
        told.push(self.transport());
        if let Err(reason) = labels {
            told.push(json!({ "type": "warning", "text": reason }));
        }
        Ok(told)
    }

    fn overview(&self) -> Answer<Vec<Value>> {
        let (source, (start, step, events)) = match (&self.recording, &self.live) {
            (Some((name, film)), _) => (Some(name), film.rate.clone()),
            (None, Some(live)) => (None, live.film.rate()),
            (None, None) => return Err("nothing is shown".into()),
        };
        Ok(vec![json!({ "type": "overview", "source": source, "start_us": start, "step_us": step, "events": events })])
    }

    /// What may take its time goes on beside the pictures.
    fn ask_others(&mut self, id: Value, what: String, message: Map<String, Value>) {
        let Ok(permit) = Arc::clone(&self.at_work).try_acquire_owned() else {
            let busy = refusal(&id, &what, &"too many requests at a time: wait for their answers".into());
            self.refusals.push_back(Instant::now());
            let _ = self.answers.try_send(busy);
            return;
        };
        let (hub, answers) = (Arc::clone(&self.hub), self.answers.clone());
        let shown = self.recording.as_ref().map(|(name, _)| name.clone());
        tokio::spawn(async move {
            let outcome = carry_out(hub, &what, shown.as_deref(), Asked(&message)).await;
            let last = match outcome {
                Ok(told) => {
                    if let Some(told) = told {
                        let _ = answers.send(told).await;
                    }
                    if id.is_null() {
                        return;
                    }
                    json!({ "type": "done", "id": id })
                }
                Err(refused) => refusal(&id, &what, &refused),
            };
            let _ = answers.send(last).await;
            drop(permit);
        });
    }

    async fn done(&mut self, id: &Value) -> Result<(), End> {
        if id.is_null() { Ok(()) } else { self.say(&json!({ "type": "done", "id": id })).await }
    }

    async fn refuse(&mut self, id: &Value, what: &str, refused: Refused) -> Result<(), End> {
        self.refusals.push_back(Instant::now());
        self.say(&refusal(id, what, &refused)).await?;
        self.flood()
    }

    /// Lets go of who is refused over and over.
    fn flood(&mut self) -> Result<(), End> {
        while self.refusals.front().is_some_and(|at| at.elapsed() > REFUSALS_WITHIN) {
            self.refusals.pop_front();
        }
        if self.refusals.len() > MOST_REFUSALS {
            return Err(End::Close(POLICY, "too many refused messages"));
        }
        Ok(())
    }
}

fn refusal(id: &Value, what: &str, refused: &Refused) -> Value {
    json!({ "type": "refused", "id": id, "what": what, "reason": refused.reason, "field": refused.field })
}
