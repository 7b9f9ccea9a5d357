//! Whether a board keeps pace with its own clock: the drift and the delays that its arrivals show.

use std::collections::VecDeque;

use serde::Serialize;

use super::offset::Offset;
use crate::latency::{Latencies, Quantiles};

/// Board time in us, and arrival minus board time in ns.
pub(super) type ArrivalPoint = (i64, i64);

/// Number of stretches from which the line is fitted: 64 s, within which the rate of a quartz is constant.
pub(super) const STRETCHES: usize = 256;
/// Duration beyond which a slope larger than that of a quartz is accepted, us.
pub(super) const LONG_US: i64 = 10_000_000;

/// Reading: no two clocks differ by more (crystals by 0.01 %, the worst oscillators by 1 %), ppm.
const MOST_DRIFT_PPM: f64 = 10_000.0;
/// Reading: no datagram on a local network is later than this, us.
const MOST_DELAY_US: f64 = 1e6;
/// Reading: a board whose clock takes more than twice the host's time is a simulated one, ppm.
const SIMULATED_PPM: f64 = 1e6;
/// Host's time after which a simulated board is known by its pace, ns.
const KNOWN_NS: i64 = 500_000_000;
/// What waited is read at once: its delays shrink by more than one in so many parts of the time between, and by one of
/// these parts in the stretch in which the last of it is read.
const CATCHING_UP: i64 = 2;
const STILL_CATCHING_UP: i64 = 20;
/// Only by a drift beyond what is fitted does one in two arrive so much sooner than the soonest can, us.
const SOON_US: f64 = 1e5;

/// Why a drift between two clocks, or the delays of datagrams, cannot be; `None` if they can. `delay_us` is that of 99
/// in 100 datagrams at most, `median_us` that of one in two. A simulated board's clock is as slow as its simulation, and
/// all its datagrams seem late: that is no reason for a doubt.
#[must_use]
pub fn doubt(drift_ppm: f64, delay_us: f64, median_us: f64) -> Option<String> {
    if drift_ppm > SIMULATED_PPM {
        return None;
    }
    let mut wrong = vec![];
    if drift_ppm.abs() > MOST_DRIFT_PPM {
        wrong.push(format!("a drift of {drift_ppm:+.0} ppm (clocks differ by less than {MOST_DRIFT_PPM:.0})"));
    }
    if delay_us > MOST_DELAY_US {
        wrong.push(format!("a delay of {:.1} s", delay_us / 1e6));
    }
    if median_us < -SOON_US {
        wrong.push(format!("a median delay of {:.1} s", median_us / 1e6));
    }
    (!wrong.is_empty()).then(|| {
        let how = if drift_ppm < -MOST_DRIFT_PPM {
            "ran faster than its own clock, for example a file that is read at once"
        } else {
            "paused or ran slower than its own clock, for example an emulator on a busy machine"
        };
        format!(
            "{} is impossible for a clock. Either the sender {how}: then its times are right, but they do not match \
             this computer's clock. Or its stamps were damaged",
            wrong.join(" and ")
        )
    })
}

/// The drift and the delays that arrivals show.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Pace {
    /// Drift of the host's clock relative to the board's, parts per million.
    pub drift_ppm: f64,
    /// Delays beyond the shortest, of all datagrams so far.
    pub delay: Quantiles,
    /// Why they cannot be, with the likely cause; `None` if they can.
    pub doubt: Option<String>,
}

/// Delays, and the fastest arrivals of the last 64 s, whichever line was fitted to them.
#[derive(Debug, Clone, Default)]
pub(super) struct ArrivalDelays {
    delays: Latencies,
    fastest: VecDeque<ArrivalPoint>,
    /// The first arrival and the latest: the board's time, us, and the host's, ns.
    ends: Option<[(i64, i64); 2]>,
    /// The board's time of the first stretch, us.
    begun: Option<i64>,
    /// Whether what came before the last stretch had waited.
    catches_up: bool,
}

impl ArrivalDelays {
    /// Notes when a datagram arrived, and how much later than the line.
    pub(super) fn note(&mut self, board_us: i64, arrived_ns: i64, late_ns: i64) {
        let now = (board_us, arrived_ns);
        self.ends = Some([self.ends.map_or(now, |[first, _]| first), now]);
        self.delays.note(late_ns);
    }

    /// The drift of a simulated board, ppm; `None` if it is none.
    #[allow(clippy::cast_precision_loss)]
    fn simulated_ppm(&self) -> Option<f64> {
        let [(first_us, first_ns), (last_us, last_ns)] = self.ends?;
        let (board_ns, host_ns) = ((last_us - first_us) * 1000, last_ns - first_ns);
        let drift = (host_ns as f64 / board_ns.max(1) as f64 - 1.0) * 1e6;
        (host_ns >= KNOWN_NS && drift > SIMULATED_PPM).then_some(drift)
    }

    /// Whether this arrival, in the first seconds, shows that those before had waited until they were read: it comes so much
    /// sooner behind them than the board's clock has it as no drift does.
    pub(super) fn had_waited(&self, (board_us, late_ns): ArrivalPoint) -> bool {
        let (Some(begun), Some(last)) = (self.begun, self.fastest.back()) else { return false };
        let part = if self.catches_up { STILL_CATCHING_UP } else { CATCHING_UP };
        board_us - begun < LONG_US && (last.1 - late_ns) * part > (board_us - last.0) * 1000
    }

    /// Forgets what had waited.
    pub(super) fn caught_up(&self) -> Self {
        Self { begun: self.begun, catches_up: true, ..Self::default() }
    }

    /// Notes the fastest arrival of a stretch.
    pub(super) fn end_stretch(&mut self, fastest: ArrivalPoint) {
        self.catches_up &= self.fastest.is_empty();
        self.begun.get_or_insert(fastest.0);
        if self.fastest.len() == STRETCHES {
            self.fastest.pop_front();
        }
        self.fastest.push_back(fastest);
    }

    /// The drift over all of these arrivals, ppm; `None` within their first seconds. A line follows no drift that
    /// cannot be: it is given up, and another begins.
    #[allow(clippy::cast_precision_loss)]
    fn drift_ppm(&self) -> Option<f64> {
        let (first, last) = self.fastest.front().zip(self.fastest.back())?;
        let passed = last.0 - first.0;
        (passed >= LONG_US).then(|| (last.1 - first.1) as f64 / passed as f64 * 1e3)
    }

    #[cfg(test)]
    pub(super) fn fastest_count(&self) -> usize {
        self.fastest.len()
    }

    /// What they show beside the line.
    pub(super) fn pace(&self, line: Offset) -> Pace {
        let beyond = self.drift_ppm().filter(|drift| drift.abs() > MOST_DRIFT_PPM);
        let drift_ppm = self.simulated_ppm().or(beyond).unwrap_or(line.drift_ppm);
        let delay = self.delays.quantiles();
        let doubt = doubt(drift_ppm, delay.p99_us.unwrap_or(0.0), delay.p50_us.unwrap_or(0.0));
        Pace { drift_ppm, delay, doubt }
    }
}
