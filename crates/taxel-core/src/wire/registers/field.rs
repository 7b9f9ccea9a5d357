//! What a field of a register is, and the numbers of the array that rules need.

/// Where a field lies, and what it may hold (Table 5.5).
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Field {
    /// taxel's name.
    pub name: &'static str,
    /// The manual's.
    pub manual: &'static str,
    /// "flag" for one that is on or off.
    pub unit: &'static str,
    /// What it is for.
    pub text: &'static str,
    /// Which of the eight.
    pub register: u8,
    /// Its lowest bit.
    pub shift: u32,
    /// Its bits, shifted down.
    pub mask: u32,
    /// What is added to the bits.
    pub offset: u32,
    /// The least value.
    pub least: u32,
    /// The greatest value.
    pub greatest: u32,
}

/// What the rules know of an array on a board.
pub(super) struct Scanned {
    pub(super) steps: u32,
    pub(super) driven_lines: u16,
    pub(super) sense_lines: u16,
}

/// 10 ns units as us, with two places.
pub(super) fn us(units: i64) -> String {
    let sign = if units < 0 { "-" } else { "" };
    format!("{sign}{}.{:02}", units.abs() / 100, units.abs() % 100)
}
