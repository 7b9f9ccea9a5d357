//! Tests the layers of the crate: a module imports only from layers below its own, and there are no circular imports.
//!
//! A module is a file. It depends on the modules that its `use` declarations and paths name, resolved through
//! re-exports. A re-export alone is not a dependency: only the names that a parent itself uses count. A registry's
//! macro depends on the files that it lists. Tests do not count.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Layers from the lowest upwards; modules in one layer must not depend on each other.
const FLOORS: [(&str, &[&[&str]]); 6] = [
    (
        "taxel-core",
        &[
            &["error"],
            &["reading"],
            &["allowed", "vectors"],
            &["parameters", "array"],
            &["events", "frames", "spikes"],
            &["held"],
            &["rest"],
            &["circuit", "health"],
            &["wire", "contact", "neuron"],
            &["board"],
            &["encode"],
            &["metrics"],
            &["learn"],
            &["detect"],
        ],
    ),
    (
        "taxel-live",
        &[
            &["error", "host_clock", "kernel_drops", "latency", "locked", "read_at", "system_error"],
            &["clock", "named_pipe"],
            &["address", "ports"],
            &["serial_line"],
            &["line_place", "recording"],
            &["capture"],
            &["emulate", "pipeline"],
        ],
    ),
    (
        "taxel-panel",
        &[
            &["activity", "block", "change_file", "columns", "frame_values"],
            &["event_rate", "history", "load"],
            &["state"],
            &["index"],
            &["events", "frames", "shown", "spikes"],
            &["live_source", "player"],
            &["view"],
        ],
    ),
    ("taxel-border", &[&["errors"], &["enter", "instructions"], &["convert", "parameters"]]),
    ("../rules", &[&["checks"], &["rules"], &["bindings"]]),
    (
        "taxel-python",
        &[
            &["thread_state", "threaded"],
            &["cone_x"],
            &[
                "calibration",
                "circuit",
                "detect",
                "device",
                "encode",
                "held",
                "learn",
                "live",
                "metrics",
                "neuron",
                "nouns",
                "recording",
                "simulate",
                "test_hooks",
                "wire",
                "wire_v2",
            ],
            &["panel"],
            &["described"],
        ],
    ),
];

type Name = Vec<String>;

/// The declarations of a file: the origin of names that it re-exports, and what it uses.
#[derive(Default)]
struct Module {
    exports: BTreeMap<String, Name>,
    uses: Vec<Name>,
}

/// A crate's modules by name; the root's name is empty.
struct House(BTreeMap<Name, Module>);

impl House {
    fn read(package: &str) -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().join(package).join("src");
        let mut texts = BTreeMap::new();
        for file in files(&root) {
            let inside = file.strip_prefix(&root).unwrap().with_extension("");
            let name: Name = inside.iter().map(|part| part.to_str().unwrap().to_owned()).collect();
            let name = if name == ["lib"] { vec![] } else { name };
            if name.last().is_none_or(|last| last != "tests") {
                texts.insert(name, code(&fs::read_to_string(&file).unwrap()));
            }
        }
        let names: BTreeSet<Name> = texts.keys().cloned().collect();
        Self(texts.iter().map(|(name, text)| (name.clone(), read(name, text, &names))).collect())
    }

    /// The module to which a path resolves.
    fn home(&self, path: &[String], depth: usize) -> Name {
        let inside = (0..=path.len()).rev().find(|&k| self.0.contains_key(&path[..k])).unwrap_or(0);
        let (module, rest) = path.split_at(inside);
        match rest.first().and_then(|name| self.0[module].exports.get(name)) {
            Some(from) if depth < 8 => self.home(&[from, &rest[1..]].concat(), depth + 1),
            _ => module.to_vec(),
        }
    }

    /// The modules on which each module depends.
    fn edges(&self) -> BTreeMap<Name, BTreeSet<Name>> {
        let mut edges = BTreeMap::new();
        for (name, module) in &self.0 {
            let homes = module.uses.iter().map(|path| self.home(path, 0));
            edges.insert(name.clone(), homes.filter(|home| home != name && !home.is_empty()).collect());
        }
        edges
    }
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = vec![];
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path));
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
    found
}

/// A file's text without comments and tests.
fn code(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

fn read(name: &Name, text: &str, names: &BTreeSet<Name>) -> Module {
    let (mut module, mut rest, mut outside) = (Module::default(), text, String::new());
    while let Some(at) = next_use(rest) {
        let (before, after) = rest.split_at(at);
        outside.push_str(before);
        let (declared, left) = after.split_once(';').unwrap_or((after, ""));
        rest = left;
        let public = before.trim_end().ends_with("pub")
            || before.trim_end().ends_with(')') && {
                before.rfind('\n').is_none_or(|line| before[line..].trim_start().starts_with("pub("))
            };
        for path in spread(declared.trim_start_matches("use").trim()) {
            let Some(path) = absolute(name, &path, names) else { continue };
            let is_own = path.len() > name.len() && path.starts_with(name);
            match path.last() {
                Some(last) if public && is_own => drop(module.exports.insert(last.clone(), path.clone())),
                _ => module.uses.push(path),
            }
        }
    }
    outside.push_str(rest);
    let path_like = |c: char| c.is_alphanumeric() || c == '_' || c == ':' || c == '$';
    for word in outside.split(|c| !path_like(c)).filter(|word| word.contains("::")) {
        module.uses.extend(absolute(name, word.trim_matches(':'), names));
    }
    module.uses.extend(named(&outside).filter_map(|word| module.exports.get(word).cloned()));
    if outside.contains("mod $") {
        let child = |word: &str| [name.as_slice(), &[word.to_owned()]].concat();
        module.uses.extend(listed(&outside).map(child).filter(|child| names.contains(child)));
    }
    module
}

/// Each word of a text, with the text before and after it.
fn words(text: &str) -> impl Iterator<Item = (&str, &str, &str)> {
    let part = |c: char| c.is_alphanumeric() || c == '_';
    let starts = text.char_indices().filter(move |&(at, c)| part(c) && !text[..at].ends_with(part));
    starts.map(move |(at, _)| {
        let end = text[at..].find(|c| !part(c)).map_or(text.len(), |length| at + length);
        (&text[..at], &text[at..end], &text[end..])
    })
}

/// The types and called functions in a text: a parent that names one of its re-exports uses it. The variants of an
/// `enum`, one per line, do not count.
fn named(text: &str) -> impl Iterator<Item = &str> {
    let used = |&(before, word, behind): &(&str, &str, &str)| match word.chars().next() {
        Some(first) if first.is_uppercase() => {
            let listed = before.trim_end_matches(' ').ends_with('\n') && behind.starts_with(",\n");
            !listed && !before.ends_with("::")
        }
        _ => behind.starts_with('(') && !before.ends_with('.'),
    };
    words(text).filter(used).map(|(_, word, _)| word)
}

/// The files of a registry, `name: Kind`, which its macro declares.
fn listed(text: &str) -> impl Iterator<Item = &str> {
    words(text).filter(|(_, _, behind)| behind.starts_with(": ")).map(|(_, word, _)| word)
}

/// The position of the next `use` declaration.
fn next_use(text: &str) -> Option<usize> {
    text.match_indices("use ").map(|(at, _)| at).find(|&at| {
        let line = text[..at].rfind('\n').map_or(0, |line| line + 1);
        let before = text[line..at].trim();
        before.is_empty() || before == "pub" || before.starts_with("pub(") && before.ends_with(')')
    })
}

/// Expands a declaration with braces into single paths.
fn spread(tree: &str) -> Vec<String> {
    let Some((before, inside)) = tree.split_once('{') else {
        return vec![tree.split(" as ").next().unwrap_or_default().trim().to_owned()];
    };
    let inside = inside.trim_end().strip_suffix('}').unwrap_or(inside);
    let (mut depth, mut parts, mut part) = (0, vec![], String::new());
    for c in inside.chars() {
        depth += i32::from(c == '{') - i32::from(c == '}');
        if c == ',' && depth == 0 {
            parts.push(std::mem::take(&mut part));
        } else {
            part.push(c);
        }
    }
    parts.push(part);
    let parts = parts.iter().filter(|part| !part.trim().is_empty());
    parts.flat_map(|part| spread(part.trim())).map(|part| format!("{}{part}", before.trim())).collect()
}

/// The path from the crate's root, if it is in this crate.
fn absolute(name: &Name, path: &str, names: &BTreeSet<Name>) -> Option<Name> {
    let mut steps: Vec<String> = path.split("::").map(str::to_owned).collect();
    match steps[0].as_str() {
        "crate" | "$crate" => Some(steps.split_off(1)),
        "self" => Some([name.clone(), steps.split_off(1)].concat()),
        "super" => {
            let up = steps.iter().take_while(|step| *step == "super").count();
            Some([&name[..name.len().saturating_sub(up)], &steps[up..]].concat())
        }
        _ => {
            let child = [name.as_slice(), &steps[..1]].concat();
            names.contains(&child).then(|| [name.clone(), steps].concat())
        }
    }
}

/// Groups of modules that depend on each other in a circle, ordered by name.
fn circles(edges: &BTreeMap<Name, BTreeSet<Name>>) -> BTreeSet<Vec<String>> {
    let reach = |from: &Name| {
        let (mut reached, mut next) = (BTreeSet::new(), vec![from.clone()]);
        while let Some(module) = next.pop() {
            for to in edges.get(&module).into_iter().flatten() {
                if reached.insert(to.clone()) {
                    next.push(to.clone());
                }
            }
        }
        reached
    };
    let reached: BTreeMap<&Name, BTreeSet<Name>> = edges.keys().map(|name| (name, reach(name))).collect();
    let ring = |name: &Name| {
        let others = reached[name].iter().filter(|other| reached.get(other).is_some_and(|r| r.contains(name)));
        others.map(|other| other.join("::")).collect::<Vec<_>>()
    };
    edges.keys().map(ring).filter(|ring| !ring.is_empty()).collect()
}

#[test]
fn a_module_imports_only_from_floors_below() {
    for (package, floors) in FLOORS {
        let floor = |name: &str| floors.iter().position(|floor| floor.contains(&name));
        for (module, used) in House::read(package).edges() {
            let Some(from) = module.first() else { continue };
            let floor_from = floor(from).unwrap_or_else(|| panic!("{package}: {from} stands on no floor of FLOORS"));
            for to in used.iter().filter(|to| to[0] != *from) {
                let below = floor(&to[0]).is_some_and(|other| other < floor_from);
                assert!(below, "{package}: {} imports {}, which is not below it", module.join("::"), to.join("::"));
            }
        }
    }
}

#[test]
fn no_modules_import_in_a_circle() {
    let found: BTreeSet<Vec<String>> =
        FLOORS.iter().flat_map(|(package, _)| circles(&House::read(package).edges())).collect();
    assert!(found.is_empty(), "modules import each other in a circle: {found:?}");
}

#[test]
fn a_circle_and_a_wrong_floor_are_seen() {
    let names: BTreeSet<Name> = [vec![], vec!["a".into()], vec!["a".into(), "b".into()]].into();
    let module = read(&vec!["a".into(), "b".into()], "use super::{Thing, self as a};\nfn f() { super::g() }", &names);
    assert!(
        module.uses.contains(&vec!["a".into(), "Thing".into()]) && module.uses.contains(&vec!["a".into(), "g".into()])
    );
    let parent = read(&vec!["a".into()], "mod b;\npub use b::Made;\nfn f() { b::made() }", &names);
    assert_eq!(parent.exports["Made"], ["a", "b", "Made"]);
    assert!(parent.uses.contains(&vec!["a".into(), "b".into(), "made".into()]));
    let parent = read(&vec!["a".into()], "mod b;\npub use b::Made;\nenum E {\n    Made,\n}", &names);
    assert!(parent.uses.is_empty(), "{:?}", parent.uses);
    let parent = read(&vec!["a".into()], "mod b;\npub use b::Made;\nfn f() -> Made { x }", &names);
    assert_eq!(parent.uses, [["a", "b", "Made"]]);
    let registry = read(&vec!["a".into()], "macro_rules! r { () => { mod $name; } }\nr! {\n    b: B,\n}", &names);
    assert_eq!(registry.uses, [["a", "b"]]);
    let house =
        House([(vec![], Module::default()), (vec!["a".into()], parent), (vec!["a".into(), "b".into()], module)].into());
    assert_eq!(circles(&house.edges()), [vec!["a".to_owned(), "a::b".to_owned()]].into());
}

/// The standard library's functions differ between systems in the last place; those of `libm` do not.
#[test]
fn encoders_compute_the_same_bits_on_every_system() {
    let names = ["exp", "exp_m1", "exp2", "ln", "ln_1p", "log", "log2", "log10", "powf", "sin", "cos", "tan", "tanh"];
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/encode");
    let found: Vec<String> = files(&root)
        .into_iter()
        .flat_map(|file| {
            let text = code(&fs::read_to_string(&file).unwrap());
            let called = |name: &&&str| text.contains(&format!(".{name}(")) || text.contains(&format!("f64::{name}"));
            names.iter().filter(called).map(|name| format!("{}: {name}", file.display())).collect::<Vec<_>>()
        })
        .collect();
    assert!(found.is_empty(), "functions of libm instead: {found:#?}");
}
