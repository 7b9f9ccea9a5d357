//! Made from registers.toml by tools/registers.py (`make registers`): edit that.

use std::sync::LazyLock;

/// Number of fractional bits of [`POWER_LAW`].
pub const POWER_LAW_FRACTION: u32 = 16;

/// Ticks to the power of 0.7 (5.1), in fixed point: the lookup table of the logic.
pub static POWER_LAW: LazyLock<[u32; 2048]> = LazyLock::new(|| {
    std::array::from_fn(|tick| (libm::pow(tick as f64, 0.7) * f64::from(1 << POWER_LAW_FRACTION)).round() as u32)
});
