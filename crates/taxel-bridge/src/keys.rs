//! Where what is found, below `taxel/NAME`.

/// What all keys begin with.
const ROOT: &str = "taxel";

/// Parcels, for those who must have all of them: whoever is slow is waited for.
pub(crate) const BLOCK: &str = "wire/block";
/// The same parcels, for those who look on: whoever is slow misses some.
pub(crate) const DROP: &str = "wire/drop";
/// Low-rate pictures.
pub(crate) const PICTURE: &str = "picture";
/// Detections, one at a time.
pub(crate) const DETECTION: &str = "detection";
/// What the sensor is; answers questions.
pub(crate) const ABOUT: &str = "about";
/// What time it is; answers questions.
pub(crate) const CLOCK: &str = "clock";

/// The key of something of a board.
pub(crate) fn key(name: &str, what: &str) -> String {
    format!("{ROOT}/{name}/{what}")
}

/// The key of something of every board.
pub(crate) fn of_all(what: &str) -> String {
    key("*", what)
}

/// The board that a key is of.
pub(crate) fn name_of(key: &str) -> Option<&str> {
    key.strip_prefix(ROOT)?.strip_prefix('/')?.split('/').next()
}

/// Whether a name can stand in a key.
pub(crate) fn is_name(name: &str) -> bool {
    !name.is_empty() && name.len() <= 64 && name.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c))
}
