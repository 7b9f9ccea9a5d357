//! A digest moves with a token of a room, or of one below it, and with nothing else.

use std::path::{Path, PathBuf};

#[path = "../build/sources.rs"]
mod sources;

use sources::{Sources, tokens};

const CORE: &str = "pub mod error; pub mod learn; pub mod neuron; pub use neuron::{Kernel, Neuron};";
const NEURON: &str = "use crate::error::Error; pub struct Neuron; pub fn run(t: f64) -> f64 { t * 2.0 }";
const LEARN: &str = "use crate::{Neuron, error}; pub fn fit(n: &Neuron) {}";
const METRICS: &str = "pub fn distance() {}";
const BOUND: &str = r#"
    #[pyfunction]
    fn fit() { taxel_core::learn::fit(&n) }
    #[pyclass(module = "taxel._core", name = "Fitted", frozen)]
    struct Inner;
    #[pyclass]
    struct Plain;
"#;
const MEASURED: &str = "#[pyfunction] fn distance() { taxel_core::metrics::distance() }";

fn texts() -> Vec<(String, PathBuf, String)> {
    [
        ("taxel_core", "lib.rs", CORE),
        ("taxel_core", "error.rs", "pub struct Error;"),
        ("taxel_core", "neuron.rs", NEURON),
        ("taxel_core", "learn/mod.rs", LEARN),
        ("taxel_core", "metrics.rs", METRICS),
        ("taxel_python", "learn.rs", BOUND),
        ("taxel_python", "metrics.rs", MEASURED),
    ]
    .map(|(package, path, text)| (package.to_owned(), path.into(), text.to_owned()))
    .to_vec()
}

/// The names whose digest moves when a piece of a file is another one.
fn moved(file: &str, old: &str, new: &str) -> Vec<String> {
    let before = Sources::of(texts()).digests();
    let changed = texts().into_iter().map(|(package, path, text)| {
        let other = if path == Path::new(file) && package == "taxel_core" { text.replace(old, new) } else { text };
        (package, path, other)
    });
    let after = Sources::of(changed).digests();
    assert_eq!(before.keys().collect::<Vec<_>>(), after.keys().collect::<Vec<_>>());
    before.into_iter().filter(|(name, digest)| after[name] != *digest).map(|(name, _)| name).collect()
}

#[test]
fn a_token_of_a_room_below_moves_what_is_bound_above_it_and_nothing_else() {
    assert_eq!(moved("neuron.rs", "2.0", "3.0"), ["Fitted", "Plain", "fit"]);
    assert_eq!(moved("error.rs", "struct Error", "enum Error"), ["Fitted", "Plain", "fit"]);
    assert_eq!(moved("metrics.rs", "fn distance()", "fn distance(_: u8)"), ["distance"]);
}

#[test]
fn comments_documentation_formatting_and_tests_move_nothing() {
    for (old, new) in [
        ("pub fn run", "// as before\n/* a /* nested */ one */ pub fn run"),
        ("pub fn run", "/// Runs.\n#[doc = \"as before\"] pub fn run"),
        ("run(t: f64) -> f64 { t * 2.0 }", "run(\n    t: f64,\n) -> f64 {\n    t * 2.0\n}"),
        ("pub fn run", "#[cfg(test)]\nmod tests { fn one() {} }\npub fn run"),
    ] {
        assert_eq!(moved("neuron.rs", old, new), Vec::<String>::new(), "{new}");
    }
}

#[test]
fn text_that_looks_like_a_comment_counts() {
    assert_ne!(tokens("\"// a\"").unwrap(), tokens("\"// b\"").unwrap());
    assert_eq!(tokens("r#\"/* a */\"#").unwrap().len(), 1);
}

#[test]
fn every_room_of_the_checkout_is_read() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let digests = Sources::read(crates).unwrap().digests();
    assert!(digests.len() > 50, "{}", digests.len());
    assert_ne!(digests["neuron_run"], digests["distance"]);
}
