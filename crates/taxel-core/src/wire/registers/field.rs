//! The type of a register's field, and the numbers of the array that the rules need.

/// Position of a field in its register, and the values that it can have (Table 5.5).
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Field {
    /// Name in taxel.
    pub name: &'static str,
    /// Name in the manual.
    pub manual: &'static str,
    /// Unit; "flag" for a field that is on or off.
    pub unit: &'static str,
    /// Description.
    pub text: &'static str,
    /// Number of the register, 0 to 7.
    pub register: u8,
    /// Lowest bit.
    pub shift: u32,
    /// Mask of its bits, after shifting down.
    pub mask: u32,
    /// Added to the bits.
    pub offset: u32,
    /// Smallest valid value.
    pub least: u32,
    /// Largest valid value.
    pub greatest: u32,
}

/// The numbers of an array on a board that the rules need.
pub(super) struct Scanned {
    pub(super) steps: u32,
    pub(super) driven_lines: u16,
    pub(super) sense_lines: u16,
}

/// Formats a time in units of 10 ns as us, with two decimals.
pub(super) fn us(units: i64) -> String {
    let sign = if units < 0 { "-" } else { "" };
    format!("{sign}{}.{:02}", units.abs() / 100, units.abs() % 100)
}
