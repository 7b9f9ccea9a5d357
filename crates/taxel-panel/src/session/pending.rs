//! Requests of a client that take long: they are carried out beside the frames, a bounded number at a time.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use serde_json::Value;
use tokio::sync::{Semaphore, mpsc};

use crate::hub::Hub;
use crate::hub::indexed::OpenRecording;
use crate::hub::labels::LabelHistory;
use crate::protocol::limits::MOST_BYTES;
use crate::protocol::messages::Message;
use crate::protocol::refusal::Refusal;
use crate::protocol::request::Request;
use crate::requests::carry_out;

/// Maximum number of pending requests, but for those that change labels: a person's work is not refused.
const MOST_PENDING: usize = 8;

/// Maximum number of pending requests that change labels; a long one counts for each [`PART`] of it. A client with so many is not
/// read until half of them are answered: those that are read together are written together.
const MOST_LABEL_REQUESTS: usize = 1000;

/// See [`MOST_LABEL_REQUESTS`], bytes.
const PART: usize = 1 << 16;

/// Answers that may wait to be sent.
const MOST_ANSWERS: usize = 64;

/// A client's long requests that are carried out now.
pub(super) struct PendingRequests {
    answers: mpsc::Sender<Message>,
    permits: Arc<Semaphore>,
    label_permits: Arc<Semaphore>,
    history: Arc<LabelHistory>,
    /// Whether there were too many requests that change labels, and more than half of them still wait.
    is_full: AtomicBool,
}

impl PendingRequests {
    /// Also returns where the answers arrive.
    pub(super) fn new() -> (Self, mpsc::Receiver<Message>) {
        let (answers, receiver) = mpsc::channel(MOST_ANSWERS);
        let permits = |most| Arc::new(Semaphore::new(most));
        let (permits, label_permits) = (permits(MOST_PENDING), permits(MOST_LABEL_REQUESTS));
        let history = Arc::default();
        (Self { answers, permits, label_permits, history, is_full: AtomicBool::new(false) }, receiver)
    }

    /// Whether the client's next message may be read.
    pub(super) fn has_room(&self) -> bool {
        let enough = if self.is_full.load(Relaxed) { MOST_LABEL_REQUESTS / 2 } else { MOST_BYTES / PART };
        let is_full = self.label_permits.available_permits() < enough;
        self.is_full.store(is_full, Relaxed);
        !is_full
    }

    /// Begins to carry out a request of `bytes`; `shown` is the recording that the client shows. Where too many are pending it is refused, with
    /// the message that is returned.
    pub(super) fn begin(
        &self,
        hub: &Arc<Hub>,
        id: Value,
        kind: String,
        request: Request,
        bytes: usize,
        shown: Option<OpenRecording>,
    ) -> Option<Message> {
        let (permits, count) = match request.changes_labels() {
            true => (&self.label_permits, bytes.div_ceil(PART).clamp(1, MOST_BYTES / PART)),
            false => (&self.permits, 1),
        };
        let Ok(permit) = Arc::clone(permits).try_acquire_many_owned(count as u32) else {
            let refusal = Refusal::from("too many requests at a time: wait for their answers");
            return Some(Message::refused(id, kind, refusal));
        };
        let (hub, history, answers) = (Arc::clone(hub), Arc::clone(&self.history), self.answers.clone());
        tokio::spawn(async move {
            let last = match carry_out(hub, &history, shown.as_ref(), request).await {
                Ok(answer) => {
                    if let Some(answer) = answer {
                        // The client may have left in the meantime, here and below.
                        let _ = answers.send(answer).await;
                    }
                    if id.is_null() {
                        return;
                    }
                    Message::Done { id }
                }
                Err(refusal) => Message::refused(id, kind, refusal),
            };
            let _ = answers.send(last).await;
            drop(permit);
        });
        None
    }
}
