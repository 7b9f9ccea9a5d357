//! The host's clock, ns since 1970: as the computer's clock was when receiving began, and from then on by a clock that
//! nobody sets and that goes on while the computer sleeps. A computer's clock that is set tears no recording apart.

use std::sync::LazyLock;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::{SystemTime, UNIX_EPOCH};

/// Smallest step of the computer's clock that is noticed, ns; below it are the times that reading two clocks takes.
#[cfg(target_os = "linux")]
const STEP_NS: i64 = 1_000_000;

/// How far the computer's clock was ahead of the steady one, ns.
static AHEAD: LazyLock<AtomicI64> = LazyLock::new(|| AtomicI64::new(system_ns() - steady_ns()));

/// Takes over the time of the computer's clock, where receiving begins.
pub(crate) fn set() {
    AHEAD.store(system_ns() - steady_ns(), Ordering::Relaxed);
}

/// The current time of the host's clock, ns since 1970.
#[must_use]
pub fn now_ns() -> i64 {
    AHEAD.load(Ordering::Relaxed) + steady_ns()
}

/// How far the host's clock is ahead of the computer's, ns: the kernel stamps arrivals by that.
#[cfg(target_os = "linux")]
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Ahead(pub(crate) i64);

#[cfg(target_os = "linux")]
impl Ahead {
    /// Looks whether the computer's clock was set.
    pub(crate) fn look(&mut self) {
        let (before, system, after) = (now_ns(), system_ns(), now_ns());
        let ahead = before - system;
        // A thread that was stopped in between sees a step that was none.
        if after - before < STEP_NS && (ahead - self.0).abs() >= STEP_NS {
            self.0 = ahead;
        }
    }
}

fn system_ns() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}

#[cfg(target_os = "linux")]
fn steady_ns() -> i64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `time` lives through the call, which every kernel since 2.6.39 answers.
    unsafe { libc::clock_gettime(libc::CLOCK_BOOTTIME, &raw mut time) };
    time.tv_sec * 1_000_000_000 + time.tv_nsec
}

#[cfg(not(target_os = "linux"))]
fn steady_ns() -> i64 {
    static BEGAN: LazyLock<std::time::Instant> = LazyLock::new(std::time::Instant::now);
    i64::try_from(BEGAN.elapsed().as_nanos()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    #[cfg(target_os = "linux")]
    #[test]
    fn a_step_of_the_computers_clock_is_taken_over_and_no_smaller_difference() {
        let is_as_it_was = |ahead_ns| {
            let mut ahead = super::Ahead(ahead_ns);
            ahead.look();
            ahead.0 == ahead_ns
        };
        assert!(is_as_it_was(0) && is_as_it_was(20_000));
        assert!(!is_as_it_was(10_000_000_000) && !is_as_it_was(-10_000_000_000));
    }
}
