//! Frames on their way from stage to stage.

use taxel_core::{Array, FramesView};

/// Frames in order of time.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct FrameBlock {
    /// Time of each frame, us.
    pub(super) t: Vec<i64>,
    /// The values of all frames, each row by row.
    pub(super) values: Vec<f32>,
}

impl FrameBlock {
    pub(super) fn is_empty(&self) -> bool {
        self.t.is_empty()
    }

    pub(super) fn clear(&mut self) {
        self.t.clear();
        self.values.clear();
    }

    /// Appends frames and clears them there.
    pub(super) fn append(&mut self, later: &mut Self) {
        self.t.append(&mut later.t);
        self.values.append(&mut later.values);
    }

    pub(super) fn view<'a>(&'a self, array: &'a Array) -> FramesView<'a> {
        FramesView { array, t: &self.t, values: &self.values }
    }
}

/// A frame as a message: its time, us, and its values.
pub(super) fn write_message(t: i64, values: &[f32], out: &mut Vec<u8>) {
    out.clear();
    out.extend_from_slice(&t.to_le_bytes());
    values.iter().for_each(|value| out.extend_from_slice(&value.to_le_bytes()));
}

/// The time of a frame's message, us, and its values.
///
/// # Panics
///
/// If the message was not made by [`write_message`].
pub(super) fn read_message(message: &[u8]) -> (i64, impl Iterator<Item = f32> + '_) {
    let (t, values) = message.split_first_chunk().expect("a message begins with its time");
    let value = |four: &[u8]| f32::from_le_bytes([four[0], four[1], four[2], four[3]]);
    (i64::from_le_bytes(*t), values.chunks_exact(4).map(value))
}
