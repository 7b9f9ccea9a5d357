//! Runs the tests of a file by the portable calls too, and says which calls are used.

use std::process::Command;

const VARIABLE: &str = "TAXEL_CAPTURE";

/// Whether this run is by the portable calls.
pub fn is_portable() -> bool {
    !cfg!(target_os = "linux") || std::env::var_os(VARIABLE).is_some()
}

/// Runs this file's tests in a process of its own by the portable calls.
#[test]
fn every_test_of_this_file_passes_by_the_portable_calls() {
    if is_portable() {
        return;
    }
    let tests = std::env::current_exe().expect("the tests' own file");
    let done = Command::new(tests).env(VARIABLE, "portable").output().expect("it runs");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stdout));
}
