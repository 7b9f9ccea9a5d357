//! Replays a recording: its events with their values, or its frames by the board's rules.

use taxel_core::{Array, EventsView, Stop, problem};

use super::Touch;
use crate::Result;

/// The content that is replayed.
#[derive(Debug)]
enum ReplayedContent {
    /// Taxel and value of each event.
    Events(Vec<(u32, u16)>),
    /// Ticks, frame after frame.
    Frames(Vec<u16>),
}

/// Replays a recording to a board: each frame of the board contains what had arrived by its start, by the recording's clock times a
/// speed.
#[derive(Debug)]
pub struct Replay {
    /// Times, us from the first, ascending.
    times: Vec<i64>,
    content: ReplayedContent,
    held: Vec<u16>,
    next: usize,
    frame: u64,
    frame_us: f64,
    speed: f64,
}

impl Replay {
    /// Replays events. An event without a value changes its taxel by `step` ticks, up or down, starting from half of
    /// `ramp`.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` if the speed is not above 0 or the events are not valid.
    pub fn events(events: EventsView<'_>, (frame_us, speed): (f64, f64), step: u16, ramp: u16) -> Result<Self> {
        events.check()?;
        let valued = |k: usize| events.intensity.and_then(|i| i.present[k].then_some(i.ticks[k]));
        let rest = if events.intensity.is_some() { 0 } else { ramp / 2 };
        let mut held = vec![rest; events.array.len()];
        let mut order: Vec<usize> = (0..events.len()).collect();
        order.sort_by_key(|&k| events.t[k]);
        let mut played = Vec::with_capacity(order.len());
        for &k in &order {
            let taxel = events.array.index(events.x[k], events.y[k]);
            held[taxel] = valued(k).unwrap_or_else(|| match events.p[k] {
                true => held[taxel].saturating_add(step).min(ramp),
                false => held[taxel].saturating_sub(step),
            });
            played.push((taxel as u32, held[taxel]));
        }
        held.fill(rest);
        let times = order.iter().map(|&k| events.t[k]).collect();
        Self::new(times, ReplayedContent::Events(played), held, frame_us, speed)
    }

    /// Replays frames of ticks, one after the other in `values`, at `times` us; each holds until the next.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` if there is not one time per frame, in order, or the speed is not above 0.
    pub fn frames(array: &Array, times: Vec<i64>, values: Vec<u16>, frame_us: f64, speed: f64) -> Result<Self> {
        if values.len() != times.len() * array.len() || !times.is_sorted() {
            let (n, taxels) = (times.len(), array.len());
            return Err(problem!("{} values for {n} frames of {taxels} taxels, in order of time", values.len()).into());
        }
        let held = values.get(..array.len()).map_or_else(|| vec![0; array.len()], <[u16]>::to_vec);
        Self::new(times, ReplayedContent::Frames(values), held, frame_us, speed)
    }

    fn new(mut times: Vec<i64>, content: ReplayedContent, held: Vec<u16>, frame_us: f64, speed: f64) -> Result<Self> {
        if !(speed > 0.0 && speed.is_finite()) {
            return Err(problem!("speed"; " is {speed}: must be above 0").into());
        }
        if let Some(&first) = times.first() {
            times.iter_mut().for_each(|t| *t -= first);
        }
        // The first frame arms the board; the recording begins with the second.
        Ok(Self { times, content, held, next: 0, frame: 0, frame_us, speed })
    }
}

impl Touch for Replay {
    fn frame(&mut self, ticks: &mut [u16], _stop: Stop<'_>) -> Result<bool> {
        if self.frame > 0 {
            if self.next == self.times.len() {
                return Ok(false);
            }
            let now = (self.frame - 1) as f64 * self.frame_us * self.speed;
            while let Some(_due) = self.times.get(self.next).filter(|&&t| t as f64 <= now) {
                match &self.content {
                    ReplayedContent::Events(events) => {
                        let (taxel, value) = events[self.next];
                        self.held[taxel as usize] = value;
                    }
                    ReplayedContent::Frames(values) => {
                        let taxels = self.held.len();
                        self.held.copy_from_slice(&values[self.next * taxels..(self.next + 1) * taxels]);
                    }
                }
                self.next += 1;
            }
        }
        self.frame += 1;
        ticks.copy_from_slice(&self.held);
        Ok(true)
    }

    fn is_last(&mut self, _stop: Stop<'_>) -> Result<bool> {
        Ok(self.next == self.times.len())
    }
}
