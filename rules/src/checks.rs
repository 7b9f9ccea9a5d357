//! Checks of patterns that all rules make.

use taxel_core::{Result, SpikeKind, SpikeTrains, problem};

/// Refuses graded trains, on behalf of `reader`, which reads no values.
pub(crate) fn check_ungraded(pattern: &SpikeTrains, reader: &str) -> Result<()> {
    if pattern.kind == SpikeKind::Graded {
        return Err(problem!("{reader} takes no graded trains: their spikes have values, which it does not read"));
    }
    Ok(())
}

/// Checks a pattern without targets.
pub(crate) fn check_untargeted(pattern: &SpikeTrains) -> Result<()> {
    pattern.check()?;
    if pattern.kind == SpikeKind::Signed {
        return Err(problem!("pattern: spikes are signed; split them into ON and OFF trains (split_by_sign)"));
    }
    if pattern.is_empty() {
        return Err(problem!("pattern: has no train"));
    }
    Ok(())
}
