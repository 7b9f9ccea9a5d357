//! The session of a connected client: what it asks, what it is sent, and when it is disconnected.

mod connection;
mod delivered;
mod flow;
mod following;
mod pending;
mod playback;
mod viewport;

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::extract::ws::WebSocket;
use serde_json::{Map, Value};
use tokio::sync::{broadcast, mpsc, watch};

use super::hub::Hub;
use super::hub::clients::{Broadcast, ClientSlot};
use super::protocol::limits::MOST_BYTES;
use super::protocol::messages::Message;
use super::protocol::refusal::{Answer, Refusal};
use super::protocol::request::Request;
use super::requests::registers::prepare;
use super::view::frame::RECORDS;
use connection::{Closing, Connection, GOING_AWAY, Incoming, POLICY, TOO_BIG};
use flow::{FRAME_TIME, FlowControl};
use pending::PendingRequests;
use viewport::Viewport;

/// A client with more refused requests than this within [`REFUSALS_WITHIN`] is disconnected.
const MOST_REFUSALS: usize = 100;
const REFUSALS_WITHIN: Duration = Duration::from_secs(10);

/// How often a session without other work checks whether its client is alive.
const IDLE: Duration = Duration::from_secs(1);

/// What a client sent before it left is read until nothing arrives for this time, and at most for that one.
const ARRIVED_WITHIN: Duration = Duration::from_millis(100);
const MOST_ARRIVING: Duration = Duration::from_secs(5);

struct ClientSession {
    hub: Arc<Hub>,
    connection: Connection,
    flow: FlowControl,
    viewport: Viewport,
    pending: PendingRequests,
    /// Times of the last refusals.
    refusals: VecDeque<Instant>,
    spikes_sent: Instant,
}

/// Serves a client until it leaves or is disconnected.
pub(super) async fn run(socket: WebSocket, hub: Arc<Hub>, end: watch::Receiver<bool>, slot: ClientSlot) {
    let (pending, answers) = PendingRequests::new();
    let session = ClientSession {
        viewport: Viewport::new(hub.live()),
        hub,
        connection: Connection::new(socket),
        flow: FlowControl::new(),
        pending,
        refusals: VecDeque::new(),
        spikes_sent: Instant::now(),
    };
    session.serve(end, answers).await;
    drop(slot);
}

impl ClientSession {
    async fn serve(mut self, end: watch::Receiver<bool>, answers: mpsc::Receiver<Message>) {
        if let Err(closing) = self.run(end, answers).await {
            if matches!(closing, Closing::Silently) {
                self.begin_arrived().await;
            }
            self.connection.close(closing).await;
        }
    }

    /// Begins the changes of labels that arrived before the client left.
    async fn begin_arrived(&mut self) {
        let begun = Instant::now();
        while begun.elapsed() < MOST_ARRIVING
            && let Ok(Ok(incoming)) = tokio::time::timeout(ARRIVED_WITHIN, self.connection.receive()).await
        {
            let Incoming::Text(text) = incoming else { continue };
            let keys: Map<String, Value> = serde_json::from_str(&text).unwrap_or_default();
            let kind = keys.get("type").and_then(Value::as_str).unwrap_or_default().to_owned();
            let Ok(request) = Request::read(&kind, keys) else { continue };
            while !self.pending.has_room() {
                tokio::time::sleep(FRAME_TIME).await;
            }
            if request.changes_labels() {
                self.pending.begin(&self.hub, Value::Null, kind, request, text.len(), self.viewport.open_recording());
            } else if matches!(request, Request::Open { .. } | Request::Live {}) {
                // The labels after it are of what it shows.
                let _ = self.handle_view_request(request).await;
            }
        }
    }

    async fn run(
        &mut self,
        mut end: watch::Receiver<bool>,
        mut answers: mpsc::Receiver<Message>,
    ) -> Result<(), Closing> {
        let (mut messages, mut frames) = self.hub.clients.subscribe();
        let hub = Arc::clone(&self.hub);
        prepare(&hub).await;
        for message in [
            hub.hello_message(),
            hub.registers_message(),
            hub.presets_message(),
            hub.recorder.message(),
            hub.recordings_message().await,
            hub.zeroed_message(),
        ] {
            self.connection.send_message(&message).await?;
        }
        for detection in hub.live().map(|live| live.latest_detections()).unwrap_or_default() {
            self.connection.send_message(&Message::detection(&detection)).await?;
        }
        loop {
            // A frame that became due less than `FRAME_TIME` after the last one is sent when that time has passed.
            let due = self.viewport.is_playing() || self.viewport.is_dirty() && self.flow.has_credit();
            let tick = tokio::time::sleep(if due { FRAME_TIME } else { IDLE });
            tokio::select! {
                biased;
                () = async { drop(end.wait_for(|ended| *ended).await) } => {
                    return Err(Closing::With(GOING_AWAY, "the server ends"));
                }
                incoming = self.connection.receive(), if self.pending.has_room() => match incoming? {
                    Incoming::Text(text) if text.len() > MOST_BYTES => {
                        return Err(Closing::With(TOO_BIG, "a message has more than 4 MiB"));
                    }
                    Incoming::Text(text) => self.handle(&text).await?,
                    Incoming::SignOfLife => {}
                },
                message = messages.recv() => match message {
                    Ok(message) => self.forward(message).await?,
                    // The client does not read its messages.
                    Err(broadcast::error::RecvError::Lagged(_)) => return Err(Closing::Silently),
                    Err(broadcast::error::RecvError::Closed) => {
                        return Err(Closing::With(GOING_AWAY, "the server ends"));
                    }
                },
                Some(answer) = answers.recv() => {
                    if let Message::Detections { source, encoders, .. } = &answer {
                        self.viewport.set_readout(source, encoders).await;
                    }
                    self.connection.send_message(&answer).await?;
                }
                _ = frames.changed() => self.viewport.mark_dirty(),
                () = tick => {}
            }
            self.connection.keep_alive().await?;
            self.send_frame().await?;
            self.send_spikes().await?;
            for text in self.viewport.take_warnings() {
                self.connection.send_message(&Message::warning(text)).await?;
            }
        }
    }

    /// Sends a message that is meant for all clients.
    async fn forward(&mut self, message: Broadcast) -> Result<(), Closing> {
        match message {
            Broadcast::Text(text) => self.connection.send_text(&text).await,
            Broadcast::Counters(mut counters) => {
                if let Message::Counters { sent_frames_per_s, .. } = &mut *counters {
                    *sent_frames_per_s = self.flow.frames_per_s();
                }
                self.connection.send_message(&counters).await
            }
            Broadcast::Labels(name) => {
                let shows = match self.viewport.recording_name() {
                    Some(shown) => *shown == *name,
                    None => self.hub.recorder.file().as_ref() == Some(&name),
                };
                if shows { self.connection.send_message(&self.hub.labels.message(&name)).await } else { Ok(()) }
            }
            Broadcast::Whole(name) => {
                let hub = Arc::clone(&self.hub);
                if let Some(messages) = self.viewport.reopen_whole(&hub, &name).await {
                    for message in messages {
                        self.connection.send_message(&message).await?;
                    }
                }
                Ok(())
            }
            Broadcast::Hello => {
                self.viewport.set_live(self.hub.live());
                self.connection.send_message(&self.hub.hello_message()).await?;
                self.connection.send_message(&self.hub.registers_message()).await
            }
        }
    }

    /// Sends a frame where there is a credit, something new, and [`FRAME_TIME`] has passed since the last one.
    async fn send_frame(&mut self) -> Result<(), Closing> {
        if !self.flow.is_due() {
            return Ok(());
        }
        if self.viewport.play_on().await {
            self.connection.send_message(&self.viewport.transport_message()).await?;
        }
        if !self.viewport.take_dirty() {
            return Ok(());
        }
        self.viewport.update_narrow().await;
        let records = self.hub.recorder.file().is_some() || self.hub.board().registers.record;
        let flags = if records { RECORDS } else { 0 };
        let Some(frame) = self.viewport.frame(flags, self.flow.number()) else { return Ok(()) };
        self.flow.count_frame();
        self.connection.send_bytes(frame).await
    }

    async fn send_spikes(&mut self) -> Result<(), Closing> {
        if self.spikes_sent.elapsed() < FRAME_TIME {
            return Ok(());
        }
        self.spikes_sent = Instant::now();
        match self.viewport.spikes_message() {
            Some(message) => self.connection.send_message(&message).await,
            None => Ok(()),
        }
    }

    // ------------------------------------------------------------------------------------------ requests

    async fn handle(&mut self, text: &str) -> Result<(), Closing> {
        let Ok(keys) = serde_json::from_str::<Map<String, Value>>(text) else {
            return self.refuse(Value::Null, String::new(), "not a JSON object".into()).await;
        };
        let id = keys.get("id").cloned().unwrap_or(Value::Null);
        let is_id = match &id {
            Value::Null => true,
            Value::Number(number) => number.is_i64() || number.is_u64(),
            Value::String(text) => text.chars().count() <= 64,
            _ => false,
        };
        if !is_id {
            let refusal = Refusal::of_field("id", "must be a whole number or a text of at most 64 characters");
            return self.refuse(Value::Null, String::new(), refusal).await;
        }
        let Some(kind) = keys.get("type").and_then(Value::as_str).map(str::to_owned) else {
            return self.refuse(id, String::new(), Refusal::of_field("type", "is missing")).await;
        };
        let request = match Request::read(&kind, keys) {
            Ok(request) => request,
            Err(refusal) => return self.refuse(id, kind, refusal).await,
        };
        match self.handle_view_request(request).await {
            Ok(Ok(messages)) => {
                for message in messages {
                    self.connection.send_message(&message).await?;
                }
                if id.is_null() {
                    return Ok(());
                }
                self.connection.send_message(&Message::Done { id }).await
            }
            Ok(Err(refusal)) => self.refuse(id, kind, refusal).await,
            Err(request) => {
                let shown = self.viewport.open_recording();
                if let Some(busy) = self.pending.begin(&self.hub, id, kind, request, text.len(), shown) {
                    self.count_refusal();
                    self.connection.send_message(&busy).await?;
                }
                self.check_refusals()
            }
        }
    }

    /// Carries out a request that concerns this client's flow or view alone, and returns the messages before `done`; another
    /// request is returned.
    async fn handle_view_request(&mut self, request: Request) -> Result<Answer<Vec<Message>>, Request> {
        let view = &mut self.viewport;
        let done = match request {
            Request::Credit { n } => {
                self.flow.grant(u32::try_from(n.0).unwrap_or(0));
                Ok(())
            }
            Request::Watch { taxel } => view.watch(taxel).await,
            Request::Encode { encoder } => view.encode(encoder).await,
            Request::Zoom { column_us, end_us } => view.zoom(column_us, end_us.map(|end| end.0)).await,
            Request::Open { name, trial } => {
                return Ok(view.open(&self.hub, name.0, trial.map(|trial| trial.0)).await);
            }
            Request::Overview {} => return Ok(view.overview_message().map(|message| vec![message])),
            Request::Seek { .. }
            | Request::Play { .. }
            | Request::Pause {}
            | Request::Step { .. }
            | Request::Live {} => {
                let moved = match request {
                    Request::Seek { t_us } => view.seek_request(t_us.0).await,
                    Request::Play { speed } => view.play(speed.map(|speed| speed.0)).await,
                    Request::Step { frames } => view.step(frames.0).await,
                    Request::Live {} => view.follow_request(),
                    _ => view.pause().await,
                };
                return Ok(moved.map(|()| vec![view.transport_message()]));
            }
            request => return Err(request),
        };
        Ok(done.map(|()| vec![]))
    }

    async fn refuse(&mut self, id: Value, kind: String, refusal: Refusal) -> Result<(), Closing> {
        self.count_refusal();
        self.connection.send_message(&Message::refused(id, kind, refusal)).await?;
        self.check_refusals()
    }

    fn count_refusal(&mut self) {
        self.refusals.push_back(Instant::now());
    }

    /// Disconnects a client whose requests are refused over and over.
    fn check_refusals(&mut self) -> Result<(), Closing> {
        while self.refusals.front().is_some_and(|at| at.elapsed() > REFUSALS_WITHIN) {
            self.refusals.pop_front();
        }
        if self.refusals.len() > MOST_REFUSALS {
            return Err(Closing::With(POLICY, "too many refused messages"));
        }
        Ok(())
    }
}
