//! What a view shows of a source at a time: the player, the spikes of an encoder, and the frames sent to a client.

pub(super) mod encoded_spikes;
pub(super) mod frame;
pub(super) mod player;
