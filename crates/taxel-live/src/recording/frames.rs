//! Sources of frames: the whole array at each time, as messages that any viewer of MCAP files shows.
//!
//! A message is a `foxglove.RawImage` in protobuf: `16UC1` where all values are whole and from 0 to 65 535, else `32FC1`,
//! in which NaN is a missing value; a preview without a value above 255 is `mono8`. Its time stamp is the board's time, exact
//! to the us.

use prost::Message;
use serde::{Deserialize, Serialize};
use taxel_core::problem;

/// Properties of a source of frames, beside its array.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameProperties {
    /// Unit of the values.
    pub unit: String,
    /// Whether the frames have times; else they are numbered, one a us.
    #[serde(default = "true_by_default", skip_serializing_if = "Clone::clone")]
    pub clock: bool,
    /// The names of the columns, if each is a quantity of its own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub columns: Vec<String>,
    /// The number that each reading was subtracted from, as readings fall with pressure; none if they were not turned.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turned: Option<f64>,
    /// Time from one frame to the next, us, by which a readout knew live when a frame was over; none where the times of
    /// the frames show it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame_us: Option<f64>,
    /// Whether the file has the time at which each frame arrived, of numbers with a clock of their own.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub arrivals: bool,
}

fn true_by_default() -> bool {
    true
}

impl FrameProperties {
    pub(super) fn check(&self, name: &str, columns: u16) -> taxel_core::Result<()> {
        if self.unit.is_empty() {
            return Err(problem!("source {name}: the unit of its frames is empty"));
        }
        if !self.columns.is_empty() && self.columns.len() != usize::from(columns) {
            let n = self.columns.len();
            return Err(problem!("source {name}: {n} names for {columns} columns; must be one per column"));
        }
        if let Some(frame_us) = self.frame_us.filter(|frame_us| !(1.0..=3.6e9).contains(frame_us)) {
            return Err(problem!("source {name}: frame_us"; " is {frame_us}: must be from 1 to 3600000000 us"));
        }
        Ok(())
    }
}

/// The frames of a source, one after the other.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Frames {
    /// Time of each frame, us.
    pub t: Vec<i64>,
    /// The values of all frames, each row by row.
    pub values: Vec<f32>,
    /// Time in the file of each frame, ns: that of arrival, if the properties say so.
    pub at_ns: Vec<i64>,
    /// Number of messages that are no frame of the source's array.
    pub bad: u64,
}

/// How the values of a frame are encoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameEncoding {
    /// `mono8`: whole numbers from 0 to 255.
    Byte,
    /// `16UC1`: whole numbers from 0 to 65 535.
    Whole,
    /// `32FC1`: any number, and NaN.
    Float,
}

impl FrameEncoding {
    /// The encoding that holds these values to the last bit.
    #[must_use]
    pub fn choose(values: &[f32]) -> Self {
        // -0.0 is no whole number of this encoding, which has no sign.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let is_integer = values.iter().all(|&value| f32::from(value as u16).to_bits() == value.to_bits());
        if is_integer { Self::Whole } else { Self::Float }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Byte => "mono8",
            Self::Whole => "16UC1",
            Self::Float => "32FC1",
        }
    }

    fn bytes(self) -> usize {
        match self {
            Self::Byte => 1,
            Self::Whole => 2,
            Self::Float => 4,
        }
    }
}

/// `foxglove/RawImage.proto`.
#[derive(prost::Message)]
struct RawImage {
    #[prost(message, optional, tag = "1")]
    timestamp: Option<Timestamp>,
    #[prost(fixed32, tag = "2")]
    width: u32,
    #[prost(fixed32, tag = "3")]
    height: u32,
    #[prost(string, tag = "4")]
    encoding: String,
    #[prost(fixed32, tag = "5")]
    step: u32,
    #[prost(bytes = "vec", tag = "6")]
    data: Vec<u8>,
    #[prost(string, tag = "7")]
    frame_id: String,
}

/// `google/protobuf/timestamp.proto`.
#[derive(prost::Message)]
struct Timestamp {
    #[prost(int64, tag = "1")]
    seconds: i64,
    #[prost(int32, tag = "2")]
    nanos: i32,
}

/// The message of a frame of `columns` columns.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
pub(super) fn message(source: &str, t_us: i64, columns: u16, values: &[f32], encoding: FrameEncoding) -> Vec<u8> {
    let data = match encoding {
        FrameEncoding::Byte => values.iter().map(|&value| value as u8).collect(),
        FrameEncoding::Whole => values.iter().flat_map(|&value| (value as u16).to_le_bytes()).collect(),
        FrameEncoding::Float => values.iter().flat_map(|value| value.to_le_bytes()).collect(),
    };
    let width = u32::from(columns);
    let image = RawImage {
        timestamp: Some(Timestamp {
            seconds: t_us.div_euclid(1_000_000),
            nanos: t_us.rem_euclid(1_000_000) as i32 * 1000,
        }),
        width,
        height: values.len() as u32 / width.max(1),
        encoding: encoding.name().to_owned(),
        step: width * encoding.bytes() as u32,
        data,
        frame_id: source.to_owned(),
    };
    image.encode_to_vec()
}

impl Frames {
    /// Adds the frame of a message; one that does not fit an array of `rows` x `columns` is counted.
    pub(super) fn push(&mut self, at_ns: i64, message: &[u8], rows: u16, columns: u16) {
        match self.read(message, rows, columns) {
            Some(()) => self.at_ns.push(at_ns),
            None => self.bad += 1,
        }
    }

    fn read(&mut self, message: &[u8], rows: u16, columns: u16) -> Option<()> {
        let image = RawImage::decode(message).ok()?;
        let all = [FrameEncoding::Byte, FrameEncoding::Whole, FrameEncoding::Float];
        let encoding = all.into_iter().find(|encoding| encoding.name() == image.encoding)?;
        let row = usize::from(columns) * encoding.bytes();
        let fits = (image.width, image.height, image.step as usize) == (columns.into(), rows.into(), row);
        if !fits || image.data.len() != row * usize::from(rows) {
            return None;
        }
        let Timestamp { seconds, nanos } = image.timestamp.unwrap_or_default();
        self.t.push(seconds.checked_mul(1_000_000)?.checked_add(i64::from(nanos).div_euclid(1000))?);
        match encoding {
            FrameEncoding::Byte => self.values.extend(image.data.iter().copied().map(f32::from)),
            FrameEncoding::Whole => {
                let words = image.data.chunks_exact(2).map(|two| u16::from_le_bytes([two[0], two[1]]));
                self.values.extend(words.map(f32::from));
            }
            FrameEncoding::Float => {
                let words =
                    image.data.chunks_exact(4).map(|four| f32::from_le_bytes([four[0], four[1], four[2], four[3]]));
                self.values.extend(words);
            }
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_reads_back_to_the_last_bit() {
        let nan = f32::from_bits(0x7FC0_1234);
        let cases: [(&[f32], FrameEncoding); 5] = [
            (&[0.0, 1.0, 65_535.0, 7.0], FrameEncoding::Whole),
            (&[0.0, 1.5, 2.0, 3.0], FrameEncoding::Float),
            (&[-0.0, 1.0, 2.0, 3.0], FrameEncoding::Float),
            (&[65_536.0, f32::INFINITY, -1.0, 0.0], FrameEncoding::Float),
            (&[nan, 1.0, 2.0, 3.0], FrameEncoding::Float),
        ];
        for (values, encoding) in cases {
            assert_eq!(FrameEncoding::choose(values), encoding, "{values:?}");
            for t in [0, 1, -1, 1_234_567, -4_503_599_627_370_496, 4_503_599_627_370_496] {
                let mut back = Frames::default();
                back.push(0, &message("left", t, 2, values, encoding), 2, 2);
                let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
                assert_eq!((back.t, bits(&back.values), back.bad), (vec![t], bits(values), 0));
            }
        }
    }

    #[test]
    fn what_is_no_frame_of_the_array_is_counted() {
        let message = message("left", 5, 2, &[1.0; 4], FrameEncoding::Whole);
        let mut frames = Frames::default();
        // The source's name comes last, and is not needed.
        let named = message.len() - 6;
        (0..message.len()).filter(|&cut| cut != named).for_each(|cut| frames.push(0, &message[..cut], 2, 2));
        frames.push(0, &message, 4, 1);
        assert_eq!(frames.t.len(), 0);
        assert_eq!(frames.bad as usize, message.len());
    }
}
