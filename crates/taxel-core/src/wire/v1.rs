//! The 5-byte word of version 1 (Table 5.4), and events as such words.
//!
//! | byte | 7 | 6 | 5 | 4 | 3 | 2 | 1 | 0 |
//! |---|---|---|---|---|---|---|---|---|
//! | 0 | 1 | Pol | Z2 | Z1 | Z0 | U | T15 | T14 |
//! | 1 | 0 | T13 .. T7 |||||||
//! | 2 | 0 | T6 .. T0 |||||||
//! | 3 | 0 | U | X5 .. X0 ||||||
//! | 4 | 0 | U | Y5 .. Y0 ||||||
//!
//! Reading: byte 0 is sent first; Z1 and U are sent as 0 and ignored; a marker's X and Y likewise; Pol 1 is more
//! pressure, and start.

use crate::{EventsView, Result, problem};

/// Bytes of a word.
pub const WORD_BYTES: usize = 5;

/// Unit of a stamp, us (manual, 3.3.3).
pub const STAMP_US: i64 = 100;

/// Only the first byte of a word has this bit.
pub(crate) const FIRST: u8 = 0x80;
const POL: u8 = 0x40;
const Z2: u8 = 0x20;
const Z0: u8 = 0x08;
const COORDINATE: u8 = 0x3f;

/// A decoded word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Word {
    /// A change of pressure at a taxel.
    Change {
        /// Time in units of [`STAMP_US`], modulo 65 536.
        stamp: u16,
        /// Column.
        x: u8,
        /// Row.
        y: u8,
        /// True if the pressure rose.
        p: bool,
    },
    /// The converter's reading at a taxel.
    Intensity {
        /// Value or difference, depending on the stream, in ticks of 1/300 us.
        ticks: u16,
        /// Column.
        x: u8,
        /// Row.
        y: u8,
        /// Polarity of the change that it belongs to.
        p: bool,
    },
    /// Start or stop of a recording.
    Marker {
        /// Time in units of [`STAMP_US`], modulo 65 536.
        stamp: u16,
        /// Start (true) or stop.
        start: bool,
    },
    /// Marked as intensity and marker at once, which has no meaning.
    Contradictory,
}

impl Word {
    /// Parses five bytes, of which only the first may have its top bit set (the decoder checks this).
    #[must_use]
    pub fn from_bytes(b: [u8; WORD_BYTES]) -> Self {
        let value = u16::from(b[0] & 3) << 14 | u16::from(b[1] & 0x7f) << 7 | u16::from(b[2] & 0x7f);
        let (x, y, p) = (b[3] & COORDINATE, b[4] & COORDINATE, b[0] & POL != 0);
        match (b[0] & Z2 != 0, b[0] & Z0 != 0) {
            (false, false) => Self::Change { stamp: value, x, y, p },
            (true, false) => Self::Intensity { ticks: value, x, y, p },
            (false, true) => Self::Marker { stamp: value, start: p },
            (true, true) => Self::Contradictory,
        }
    }

    /// The word's five bytes, first byte first.
    #[must_use]
    pub fn to_bytes(self) -> [u8; WORD_BYTES] {
        let (kind, value, x, y, p) = match self {
            Self::Change { stamp, x, y, p } => (0, stamp, x, y, p),
            Self::Intensity { ticks, x, y, p } => (Z2, ticks, x, y, p),
            Self::Marker { stamp, start } => (Z0, stamp, 0, 0, start),
            Self::Contradictory => (Z2 | Z0, 0, 0, 0, false),
        };
        let [high, low] = value.to_be_bytes();
        [
            FIRST | if p { POL } else { 0 } | kind | high >> 6,
            (high & 0x3f) << 1 | low >> 7,
            low & 0x7f,
            x & COORDINATE,
            y & COORDINATE,
        ]
    }
}

/// The stamp of a time: whole units of [`STAMP_US`] (rounded down, as the board counts), modulo 65 536.
#[must_use]
pub fn stamp(t_us: i64) -> u16 {
    (t_us.div_euclid(STAMP_US) & 0xffff) as u16
}

/// Encodes events as bytes: each change followed by its intensity, markers before the first event that is not earlier.
///
/// Version 1 holds times in units of 100 us and modulo 6.5536 s: finer times are rounded down, and a reader recovers
/// whole silences of up to 6.45 s.
///
/// # Errors
///
/// `Problem` if columns are unequal, or a taxel's column or row is above 63, the limit of six bits.
pub fn encode(events: EventsView<'_>) -> Result<Vec<u8>> {
    events.check()?;
    let mut bytes = Vec::with_capacity(WORD_BYTES * (2 * events.len() + events.markers.len()));
    let mut markers = events.markers.iter().peekable();
    for k in 0..events.len() {
        let (t, x, y, p) = (events.t[k], events.x[k], events.y[k], events.p[k]);
        if x > u16::from(COORDINATE) || y > u16::from(COORDINATE) {
            return Err(problem!(
                "event {k}: row {y}, column {x}: version 1 of the wire has only rows and columns 0 to 63"
            ));
        }
        while let Some(m) = markers.next_if(|m| m.t <= t) {
            bytes.extend(Word::Marker { stamp: stamp(m.t), start: m.start }.to_bytes());
        }
        let (x, y) = (x as u8, y as u8);
        bytes.extend(Word::Change { stamp: stamp(t), x, y, p }.to_bytes());
        if let Some(i) = events.intensity.as_ref().filter(|i| i.present[k]) {
            bytes.extend(Word::Intensity { ticks: i.ticks[k], x, y, p }.to_bytes());
        }
    }
    for m in markers {
        bytes.extend(Word::Marker { stamp: stamp(m.t), start: m.start }.to_bytes());
    }
    Ok(bytes)
}
