//! Waits for the time at which a frame is due.

use std::time::{Duration, Instant};

/// Longest busy wait before a frame is due, and the step by which it is adapted.
const MOST_AWAKE: Duration = Duration::from_micros(30);
const STEP: Duration = Duration::from_nanos(100);

/// Waits until frames are due. A sleeping thread wakes some 10 us late, later on an idle core than on a busy one. So the sleep ends
/// earlier by that much, and the rest is a busy wait.
#[derive(Debug, Default)]
pub(super) struct FramePacer {
    sooner: Duration,
}

impl FramePacer {
    /// Waits until `due`, if it is not past; returns the time then.
    pub(super) fn wait_until(&mut self, due: Instant) -> Instant {
        self.wait_by(std::thread::sleep, due)
    }

    fn wait_by(&mut self, sleep_for: impl FnOnce(Duration), due: Instant) -> Instant {
        let mut now = Instant::now();
        let Some(left) = due.checked_duration_since(now) else { return now };
        if let Some(sleep) = left.checked_sub(self.sooner)
            && !sleep.is_zero()
        {
            sleep_for(sleep);
            let woken = Instant::now();
            // Nine in ten wake in time; a later one had a busy core, which a longer busy wait does not help.
            self.sooner = if woken.saturating_duration_since(now + sleep) > self.sooner {
                (self.sooner + 9 * STEP).min(MOST_AWAKE)
            } else {
                self.sooner.saturating_sub(STEP)
            };
            now = woken;
        }
        while now < due {
            std::hint::spin_loop();
            now = Instant::now();
        }
        now
    }
}

/// Asks Linux not to gather this thread's wake-ups: it may let them come 50 us late, a quarter of a frame.
#[cfg(target_os = "linux")]
pub(super) fn wake_sharply() {
    // SAFETY: PR_SET_TIMERSLACK takes one number and touches no memory of ours; where it fails, sleeps are coarser.
    unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1_u64) };
}

/// Elsewhere a sleep is as sharp as the system's timers; in Windows `sleep` uses those of high resolution, where there are any.
#[cfg(not(target_os = "linux"))]
pub(super) fn wake_sharply() {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_never_sent_before_it_is_due_nor_waited_for_awake_for_long() {
        let mut pace = FramePacer::default();
        let mut due = Instant::now();
        for _ in 0..300 {
            due += Duration::from_micros(400);
            assert!(pace.wait_until(due) >= due);
            assert!(pace.sooner <= MOST_AWAKE);
        }
        // A frame that is already due is not waited for.
        let now = pace.wait_until(due);
        assert!(now >= due);
    }

    #[test]
    fn timers_of_15_6_ms_send_frames_late_but_lose_none_of_their_rate() {
        let (mut pace, mut due, mut sleeps) = (FramePacer::default(), Instant::now(), 0);
        for _ in 0..500 {
            due += Duration::from_micros(200);
            let coarse = |sleep: Duration| {
                sleeps += 1;
                std::thread::sleep(sleep.max(Duration::from_micros(15_600)));
            };
            assert!(pace.wait_by(coarse, due) >= due);
            assert!(pace.sooner <= MOST_AWAKE);
        }
        // After a sleep of 15.6 ms some 77 frames are due, which are sent without another.
        assert!((1..=500 / 77 + 1).contains(&sleeps), "{sleeps} sleeps");
    }
}
