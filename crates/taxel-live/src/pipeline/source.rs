//! The sources of a pipeline, as Python states them: boards, and frames of numbers.

use serde::Deserialize;
use taxel_core::wire::Registers;
use taxel_core::{Array, problem};

use crate::recording::{FrameProperties, Header, now_ns};

/// A source with its name.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct NamedSource {
    /// Name of the source.
    pub name: String,
    /// Where it is, in words.
    pub place: String,
    /// Kind of the source.
    pub kind: SourceKind,
}

/// The kind of a source.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SourceKind {
    /// A board.
    Board(Box<BoardSource>),
    /// Frames of numbers; those of one row may be quantities, as of an IMU.
    Frames(Box<FrameLayout>),
}

/// Frames of numbers that are received instead of a board.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct FrameSource {
    /// The source as it was stated.
    pub text: String,
    /// Where it is, in words.
    pub place: String,
    /// What a frame is.
    pub layout: FrameLayout,
}

/// A board that sends to a local address.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct BoardSource {
    /// The address.
    pub address: String,
    /// The sensor.
    pub array: Array,
    /// The board's registers.
    pub registers: Registers,
}

/// Frames of the whole array that a reader of lines, or a program, passes.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct FrameLayout {
    /// The sensor.
    pub array: Array,
    /// Unit of the values.
    pub unit: String,
    /// Whether the source states it.
    pub unit_is_stated: bool,
    /// The names of the columns, if each is a quantity of its own.
    pub names: Vec<String>,
    /// The number from which each reading was subtracted, if readings fall with pressure.
    pub turned: Option<f64>,
    /// Time from one frame to the next, us; unknown of frames that are only recorded.
    pub frame_us: Option<f64>,
    /// Unit of the stamps of frames, us; frames without stamps have their times of arrival.
    pub stamp_us: f64,
    /// Whether the lines waited in a file until they were read, so that their arrival is no clock to compare with.
    pub waited: bool,
}

impl FrameLayout {
    /// The properties that a recording states.
    #[must_use]
    pub fn properties(&self) -> FrameProperties {
        FrameProperties {
            unit: self.unit.clone(),
            clock: true,
            columns: self.names.clone(),
            turned: self.turned,
            frame_us: self.frame_us,
            arrivals: !(self.names.is_empty() || self.waited),
        }
    }

    /// Checks the sensor and the length of a frame.
    ///
    /// # Errors
    ///
    /// `Problem`, with the number.
    pub fn check(&self) -> taxel_core::Result<()> {
        self.array.check()?;
        if let Some(frame_us) = self.frame_us.filter(|frame_us| !(1.0..=3.6e9).contains(frame_us)) {
            return Err(problem!("a frame lasts {frame_us} us: must be from 1 us to an hour"));
        }
        Ok(())
    }
}

impl NamedSource {
    /// The source's header in the recording.
    pub(super) fn header(&self) -> taxel_core::Result<Header> {
        let place = self.place.clone();
        match &self.kind {
            SourceKind::Board(board) => {
                let header = Header::of_board(board.array.clone(), Some(board.registers), place, now_ns());
                Ok(Header { name: self.name.clone(), ..header })
            }
            SourceKind::Frames(layout) => {
                Header::of_frames(&self.name, layout.array.clone(), layout.properties(), place, now_ns())
            }
        }
    }
}
