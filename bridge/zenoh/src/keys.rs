//! The keys of a board's publications and queryables, below `taxel/NAME`.

/// Prefix of all keys.
const ROOT: &str = "taxel";

/// Parcels for recorders, which need all of them: the publisher waits for a slow subscriber.
pub(crate) const BLOCK: &str = "wire/block";
/// The same parcels for viewers: a slow subscriber loses some.
pub(crate) const DROP: &str = "wire/drop";
/// Low-rate frames.
pub(crate) const FRAME: &str = "frame";
/// Detections, one at a time.
pub(crate) const DETECTION: &str = "detection";
/// Description of the sensor (queryable).
pub(crate) const ABOUT: &str = "about";
/// Clock of the computer (queryable).
pub(crate) const CLOCK: &str = "clock";

/// A key of one board.
pub(crate) fn key(name: &str, what: &str) -> String {
    format!("{ROOT}/{name}/{what}")
}

/// The key expression for all boards.
pub(crate) fn of_all(what: &str) -> String {
    key("*", what)
}

/// The name of the board of a key.
pub(crate) fn name_of(key: &str) -> Option<&str> {
    key.strip_prefix(ROOT)?.strip_prefix('/')?.split('/').next()
}

/// Whether a name is valid in a key.
pub(crate) fn is_name(name: &str) -> bool {
    !name.is_empty() && name.len() <= 64 && name.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c))
}
