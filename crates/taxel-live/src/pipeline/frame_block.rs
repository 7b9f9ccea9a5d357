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
