//! The line between two clocks.

use serde::Serialize;

/// The relation of the host's clock to the board's: a line.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Offset {
    /// The board's time of a point on the line, us.
    pub board_us: i64,
    /// The host's time of that point, ns since 1970.
    pub host_ns: i64,
    /// Drift of the host's clock relative to the board's, parts per million.
    pub drift_ppm: f64,
}

impl Offset {
    /// The host's time at a time of the board, ns since 1970.
    #[must_use]
    #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]
    pub fn host_ns(&self, board_us: i64) -> i64 {
        let since = board_us - self.board_us;
        self.host_ns + since * 1000 + (since as f64 * self.drift_ppm * 1e-3) as i64
    }

    /// The board's time at a time of the host, us.
    #[must_use]
    #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]
    pub fn board_us(&self, host_ns: i64) -> i64 {
        let since = (host_ns - self.host_ns) as f64 * 1e-3;
        self.board_us + (since / (1.0 + self.drift_ppm * 1e-6)) as i64
    }
}
