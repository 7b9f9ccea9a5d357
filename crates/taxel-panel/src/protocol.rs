//! The messages of the web socket (protocol.md): requests with their limits and refusals, and what the server sends.

pub(super) mod limited;
pub(super) mod limits;
pub(super) mod messages;
pub(super) mod refusal;
pub(super) mod request;
