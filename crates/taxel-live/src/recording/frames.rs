//! Sources of frames: the whole array at each time, as messages that any viewer of MCAP files shows.
//!
//! A message is a `foxglove.RawImage` in protobuf: `16UC1` where all values are whole and from 0 to 65 535, else `32FC1`,
//! in which NaN is a missing value. Its time stamp is the board's time, exact to the us.

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
    /// Number of messages that are no frame of the source's array.
    pub bad: u64,
}

/// How the values of a frame are encoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameEncoding {
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
            Self::Whole => "16UC1",
            Self::Float => "32FC1",
        }
    }

    fn bytes(self) -> usize {
        match self {
            Self::Whole => 2,
            Self::Float => 4,
        }
    }
}

/// The numbers of the fields of the message (foxglove/RawImage.proto).
mod field {
    pub(super) const TIMESTAMP: u64 = 1;
    pub(super) const WIDTH: u64 = 2;
    pub(super) const HEIGHT: u64 = 3;
    pub(super) const ENCODING: u64 = 4;
    pub(super) const STEP: u64 = 5;
    pub(super) const DATA: u64 = 6;
    pub(super) const FRAME_ID: u64 = 7;
    pub(super) const SECONDS: u64 = 1;
    pub(super) const NANOS: u64 = 2;
}

/// The types of fields in protobuf's encoding.
const VARINT: u64 = 0;
const BITS_64: u64 = 1;
const BYTES: u64 = 2;
const BITS_32: u64 = 5;

fn varint(mut value: u64, out: &mut Vec<u8>) {
    while value >= 0x80 {
        out.push(value.to_le_bytes()[0] | 0x80);
        value >>= 7;
    }
    out.push(value.to_le_bytes()[0]);
}

fn bytes(field: u64, content: &[u8], out: &mut Vec<u8>) {
    varint(field << 3 | BYTES, out);
    varint(content.len() as u64, out);
    out.extend_from_slice(content);
}

fn fixed(field: u64, value: usize, out: &mut Vec<u8>) {
    varint(field << 3 | BITS_32, out);
    out.extend_from_slice(&u32::try_from(value).unwrap_or(u32::MAX).to_le_bytes());
}

/// Writes the message of a frame of `columns` columns into `out`, which is cleared.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
pub(super) fn write_message(
    out: &mut Vec<u8>,
    source: &str,
    t_us: i64,
    columns: usize,
    values: &[f32],
    encoding: FrameEncoding,
) {
    out.clear();
    let (seconds, nanos) = (t_us.div_euclid(1_000_000), t_us.rem_euclid(1_000_000) * 1000);
    let mut stamp = Vec::with_capacity(16);
    for (field, value) in [(field::SECONDS, seconds), (field::NANOS, nanos)] {
        varint(field << 3 | VARINT, &mut stamp);
        varint(value as u64, &mut stamp);
    }
    bytes(field::TIMESTAMP, &stamp, out);
    fixed(field::WIDTH, columns, out);
    fixed(field::HEIGHT, values.len() / columns.max(1), out);
    bytes(field::ENCODING, encoding.name().as_bytes(), out);
    fixed(field::STEP, columns * encoding.bytes(), out);
    varint(field::DATA << 3 | BYTES, out);
    varint((values.len() * encoding.bytes()) as u64, out);
    match encoding {
        FrameEncoding::Whole => values.iter().for_each(|&value| out.extend_from_slice(&(value as u16).to_le_bytes())),
        FrameEncoding::Float => values.iter().for_each(|value| out.extend_from_slice(&value.to_le_bytes())),
    }
    bytes(field::FRAME_ID, source.as_bytes(), out);
}

/// The fields of a message that are used.
#[derive(Default)]
struct RawImage<'a> {
    stamp: &'a [u8],
    width: u64,
    height: u64,
    step: u64,
    encoding: &'a [u8],
    data: &'a [u8],
}

/// A field's value: a number, or bytes.
enum FieldValue<'a> {
    Number(u64),
    Bytes(&'a [u8]),
}

/// Takes the next field off a message; `None` at its end, and where it is no protobuf.
fn next<'a>(message: &mut &'a [u8]) -> Option<(u64, FieldValue<'a>)> {
    fn number(message: &mut &[u8]) -> Option<u64> {
        let mut value = 0;
        for k in 0..10 {
            let (byte, rest) = message.split_first()?;
            *message = rest;
            value |= u64::from(byte & 0x7F) << (7 * k);
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }
    fn take_bytes<'a>(message: &mut &'a [u8], count: u64) -> Option<&'a [u8]> {
        let (taken, rest) = message.split_at_checked(usize::try_from(count).ok()?)?;
        *message = rest;
        Some(taken)
    }
    let key = number(message)?;
    let value = match key & 7 {
        VARINT => FieldValue::Number(number(message)?),
        BITS_64 => FieldValue::Bytes(take_bytes(message, 8)?),
        BYTES => {
            let count = number(message)?;
            FieldValue::Bytes(take_bytes(message, count)?)
        }
        BITS_32 => FieldValue::Number(u32::from_le_bytes(take_bytes(message, 4)?.try_into().ok()?).into()),
        _ => return None,
    };
    Some((key >> 3, value))
}

impl<'a> RawImage<'a> {
    fn read(mut message: &'a [u8]) -> Option<Self> {
        let mut image = Self::default();
        while !message.is_empty() {
            match next(&mut message)? {
                (field::TIMESTAMP, FieldValue::Bytes(stamp)) => image.stamp = stamp,
                (field::WIDTH, FieldValue::Number(width)) => image.width = width,
                (field::HEIGHT, FieldValue::Number(height)) => image.height = height,
                (field::ENCODING, FieldValue::Bytes(encoding)) => image.encoding = encoding,
                (field::STEP, FieldValue::Number(step)) => image.step = step,
                (field::DATA, FieldValue::Bytes(data)) => image.data = data,
                _ => {}
            }
        }
        Some(image)
    }

    #[allow(clippy::cast_possible_wrap)]
    fn t_us(&self) -> Option<i64> {
        let (mut stamp, mut seconds, mut nanos) = (self.stamp, 0_i64, 0_i64);
        while !stamp.is_empty() {
            match next(&mut stamp)? {
                (field::SECONDS, FieldValue::Number(value)) => seconds = value as i64,
                (field::NANOS, FieldValue::Number(value)) => nanos = value as i64,
                _ => {}
            }
        }
        seconds.checked_mul(1_000_000)?.checked_add(nanos.div_euclid(1000))
    }
}

impl Frames {
    /// Adds the frame of a message; one that does not fit an array of `rows` x `columns` is counted.
    pub(super) fn push(&mut self, message: &[u8], rows: u16, columns: u16) {
        if self.read(message, rows, columns).is_none() {
            self.bad += 1;
        }
    }

    fn read(&mut self, message: &[u8], rows: u16, columns: u16) -> Option<()> {
        let image = RawImage::read(message)?;
        let encoding =
            [FrameEncoding::Whole, FrameEncoding::Float].into_iter().find(|e| e.name().as_bytes() == image.encoding)?;
        let row = usize::from(columns) * encoding.bytes();
        let fits = (image.width, image.height, image.step) == (columns.into(), rows.into(), row as u64);
        if !fits || image.data.len() != row * usize::from(rows) {
            return None;
        }
        self.t.push(image.t_us()?);
        match encoding {
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
                let (mut message, mut back) = (vec![], Frames::default());
                write_message(&mut message, "left", t, 2, values, encoding);
                back.push(&message, 2, 2);
                let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
                assert_eq!((back.t, bits(&back.values), back.bad), (vec![t], bits(values), 0));
            }
        }
    }

    #[test]
    fn what_is_no_frame_of_the_array_is_counted() {
        let mut message = vec![];
        write_message(&mut message, "left", 5, 2, &[1.0; 4], FrameEncoding::Whole);
        let mut frames = Frames::default();
        for cut in 0..message.len() {
            // The source's name comes last, and no part of it is needed.
            if !(message.len() - 6..message.len()).contains(&cut) {
                frames.push(&message[..cut], 2, 2);
            }
        }
        frames.push(&message, 4, 1);
        assert_eq!(frames.t.len(), 0);
        assert_eq!(frames.bad as usize, message.len() - 6 + 1);
    }
}
