//! Names of a recording's metadata records, shared by the writer and the reader.

/// Name of the metadata record at the beginning of a recording.
pub(super) const BEGIN: &str = "taxel";
/// Name of the metadata record at its end.
pub(super) const END: &str = "taxel.end";
