//! Checks of the arguments of learners.

use crate::neuron::{Neuron, Time, rounding_ms};
use crate::{Result, SpikeKind, SpikeTrains, problem};

/// Checks the arguments of every learner: one list of targets (ms, ascending) per pattern, and the same trains in each
/// pattern.
///
/// # Errors
///
/// `Problem`, naming pattern and target.
pub fn check_examples(neuron: &Neuron, patterns: &[SpikeTrains], targets: &[Vec<f64>]) -> Result<()> {
    if patterns.is_empty() {
        return Err(problem!("patterns"; " is empty: must contain one pattern or more"));
    }
    if patterns.len() != targets.len() {
        return Err(problem!(
            "targets"; ": {} lists for {} patterns; must be one per pattern (an empty list teaches silence)",
            targets.len(),
            patterns.len()
        ));
    }
    for (p, (pattern, targets)) in patterns.iter().zip(targets).enumerate() {
        check_example(neuron, p, pattern, targets)?;
        check_trains(p, pattern, patterns[0].len())?;
    }
    Ok(())
}

/// Checks that some pattern has a target, for learners that learn nothing from silence alone.
///
/// # Errors
///
/// `Problem` where none has one.
pub fn check_some_target(targets: &[Vec<f64>]) -> Result<()> {
    if targets.iter().all(Vec::is_empty) {
        return Err(problem!("targets"; ": no pattern has a target, so there is nothing to learn"));
    }
    Ok(())
}

/// Checks one pattern, number `p`, and its targets.
pub(crate) fn check_example(neuron: &Neuron, p: usize, pattern: &SpikeTrains, targets: &[f64]) -> Result<()> {
    check_pattern(p, pattern)?;
    if pattern.times.is_empty() && !targets.is_empty() {
        return Err(problem!("pattern {p}: has no spike, so weights have no effect at its target"));
    }
    for (k, &t) in targets.iter().enumerate() {
        if !t.is_finite() {
            return Err(problem!("pattern {p}, target {k}: time is {t}; must be finite"));
        }
        if t < pattern.start || t > pattern.stop {
            return Err(problem!(
                "pattern {p}, target {k}: {t} ms is outside the pattern's window {} to {} ms",
                pattern.start,
                pattern.stop
            ));
        }
        if k == 0 {
            continue;
        }
        let since = t - targets[k - 1];
        if since <= 0.0 {
            return Err(problem!(
                "pattern {p}, target {k}: {t} ms comes after {} ms; targets must ascend",
                targets[k - 1]
            ));
        }
        // In continuous time a neuron may fire at the end of its refractory time, on a grid from the next point on.
        let (refused, least) = match neuron.time {
            Time::Continuous => (since < neuron.refractory - rounding_ms(t), "at least"),
            Time::Grid => (since <= neuron.refractory + rounding_ms(t), "more than"),
        };
        if refused {
            return Err(problem!(
                "pattern {p}, target {k} ({t} ms): {since} ms after target {}; must be {least} the refractory time, {} \
                 ms",
                k - 1,
                neuron.refractory
            ));
        }
    }
    Ok(())
}

/// Checks the windows of silence of pattern number `p`.
pub(crate) fn check_silence(p: usize, windows: Option<&[[f64; 2]]>) -> Result<()> {
    let mut before = f64::NEG_INFINITY;
    for (k, &[start, stop]) in windows.unwrap_or_default().iter().enumerate() {
        if !(start.is_finite() && stop.is_finite() && start <= stop) {
            return Err(problem!(
                "pattern {p}, window {k} of silence: {start} to {stop} ms; start must not be after stop, and both \
                 must be finite"
            ));
        }
        if start < before {
            return Err(problem!(
                "pattern {p}, window {k} of silence: begins at {start} ms, but the window before ends at {before} ms; \
                 windows must ascend"
            ));
        }
        before = stop;
    }
    Ok(())
}

/// Checks pattern number `p`.
///
/// # Errors
///
/// `Problem`, naming the pattern.
pub fn check_pattern(p: usize, pattern: &SpikeTrains) -> Result<()> {
    pattern.check().map_err(|e| problem!("pattern {p}: {e}"))?;
    if pattern.is_empty() {
        return Err(problem!("pattern {p}: has no train"));
    }
    if pattern.kind == SpikeKind::Signed {
        return Err(problem!("pattern {p}: spikes are signed; split them into ON and OFF trains (split_by_sign)"));
    }
    Ok(())
}

/// Checks that a pattern has the trains that pattern 0 has.
///
/// # Errors
///
/// `Problem`, naming the pattern.
pub fn check_trains(p: usize, pattern: &SpikeTrains, trains: usize) -> Result<()> {
    if pattern.len() == trains {
        Ok(())
    } else {
        Err(problem!("pattern {p}: {} trains, pattern 0 has {trains}", pattern.len()))
    }
}
