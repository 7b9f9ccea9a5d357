//! The web socket of a client: bounded waiting, pings, and how it is closed.

use std::time::{Duration, Instant};

use axum::extract::ws::{CloseFrame, Message, Utf8Bytes, WebSocket};

use crate::protocol::messages::Message as Sent;

/// A client that does not read a message within this time is disconnected.
const SEND_WITHIN: Duration = Duration::from_secs(5);

const PING_EVERY: Duration = Duration::from_secs(10);

/// A client that sends nothing for this time, not even answers to pings, is disconnected.
const ALIVE_WITHIN: Duration = Duration::from_secs(30);

/// Close codes of the protocol.
pub(super) const GOING_AWAY: u16 = 1001;
pub(super) const UNSUPPORTED: u16 = 1003;
pub(super) const POLICY: u16 = 1008;
pub(super) const TOO_BIG: u16 = 1009;

/// How a session ends.
#[derive(Debug)]
pub(super) enum Closing {
    /// The client has left or does not read: without a close frame.
    Silently,
    /// With a close code and its reason.
    With(u16, &'static str),
}

/// A message from the client.
pub(super) enum Incoming {
    Text(Utf8Bytes),
    /// A ping or the answer to one.
    SignOfLife,
}

/// A client's web socket.
pub(super) struct Connection {
    socket: WebSocket,
    received: Instant,
    pinged: Instant,
}

impl Connection {
    pub(super) fn new(socket: WebSocket) -> Self {
        let now = Instant::now();
        Self { socket, received: now, pinged: now }
    }

    /// Waits for the next message.
    pub(super) async fn receive(&mut self) -> Result<Incoming, Closing> {
        let message = self.socket.recv().await;
        self.received = Instant::now();
        match message {
            Some(Ok(Message::Text(text))) => Ok(Incoming::Text(text)),
            Some(Ok(Message::Ping(_) | Message::Pong(_))) => Ok(Incoming::SignOfLife),
            Some(Ok(Message::Binary(_))) => Err(Closing::With(UNSUPPORTED, "text only")),
            Some(Ok(Message::Close(_)) | Err(_)) | None => Err(Closing::Silently),
        }
    }

    async fn send(&mut self, message: Message) -> Result<(), Closing> {
        match tokio::time::timeout(SEND_WITHIN, self.socket.send(message)).await {
            Ok(Ok(())) => Ok(()),
            Ok(Err(_)) | Err(_) => Err(Closing::Silently),
        }
    }

    pub(super) async fn send_text(&mut self, text: &str) -> Result<(), Closing> {
        self.send(Message::text(text)).await
    }

    pub(super) async fn send_message(&mut self, message: &Sent) -> Result<(), Closing> {
        self.send_text(&message.text()).await
    }

    pub(super) async fn send_bytes(&mut self, bytes: Vec<u8>) -> Result<(), Closing> {
        self.send(Message::binary(bytes)).await
    }

    /// Pings the client when it is time, and disconnects one that shows no sign of life.
    pub(super) async fn keep_alive(&mut self) -> Result<(), Closing> {
        if self.received.elapsed() > ALIVE_WITHIN {
            return Err(Closing::With(POLICY, "the client does not answer"));
        }
        if self.pinged.elapsed() > PING_EVERY {
            self.pinged = Instant::now();
            self.send(Message::Ping(Vec::new().into())).await?;
        }
        Ok(())
    }

    pub(super) async fn close(&mut self, closing: Closing) {
        if let Closing::With(code, reason) = closing {
            // The client may have left in the meantime.
            let _ = self.send(Message::Close(Some(CloseFrame { code, reason: reason.into() }))).await;
        }
    }
}
