//! Compiles into the extension which sources each of its names is made of, as digests (see `build/sources.rs`).

use std::fmt::Write as _;
use std::path::Path;
use std::{env, fs};

#[path = "build/sources.rs"]
mod sources;

fn main() {
    let crates = Path::new(&env::var("CARGO_MANIFEST_DIR").unwrap()).parent().unwrap().to_path_buf();
    println!("cargo::rerun-if-changed={}", crates.display());
    let mut text = String::from("/// The digest of what each name of the extension is made of.\n");
    text += "const DIGESTS: &[(&str, &str)] = &[\n";
    for (name, digest) in sources::Sources::read(&crates).unwrap().digests() {
        writeln!(text, "    ({name:?}, \"{digest:016x}\"),").unwrap();
    }
    text += "];\n";
    fs::write(Path::new(&env::var("OUT_DIR").unwrap()).join("digests.rs"), text).unwrap();
}
