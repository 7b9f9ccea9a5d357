//! Names of a recording's metadata records, shared by the writer and the reader.

use std::collections::BTreeMap;

/// Name of the metadata record at the beginning of a recording.
pub(super) const BEGIN: &str = "taxel";
/// Name of the metadata record at its end.
pub(super) const END: &str = "taxel.end";
/// Key of the checksum of its counts.
pub(super) const CHECK: &str = "check";

/// The checksum of the final counts in a metadata record, which has no checksum of its own.
pub(super) fn check(record: &BTreeMap<String, String>) -> String {
    let counts = record.iter().filter(|(key, _)| key.starts_with("counts"));
    let of_all = counts
        .fold(0, |sum, (key, text)| crc32c::crc32c_append(crc32c::crc32c_append(sum, key.as_bytes()), text.as_bytes()));
    format!("{of_all:08x}")
}
