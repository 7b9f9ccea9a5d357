//! Which sources a name of the extension is made of: the file that binds it, and every room that this one leads to.
//!
//! A room is a module at the root of a crate, with the files below it. It leads to the rooms that its paths name
//! (`crate::X`, `taxel_core::X`), seen through what a crate's root re-exports. The digest is one of tokens: comments,
//! documentation, formatting and tests do not count.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use proc_macro2::{Delimiter, TokenStream, TokenTree};

/// The crate whose rooms bind names.
const BINDING: &str = "taxel_python";

/// A room: the crate's name as paths have it, and the module's.
type Room = (String, String);

/// The tokens of all rooms, and what the crates' roots re-export.
pub struct Sources {
    rooms: BTreeMap<Room, Vec<String>>,
    exports: BTreeMap<Room, String>,
}

impl Sources {
    /// Reads the sources of all crates in a folder: those that no path leads to do no harm.
    pub fn read(crates: &Path) -> io::Result<Self> {
        let mut texts = vec![];
        for entry in std::fs::read_dir(crates)? {
            let entry = entry?;
            let root = entry.path().join("src");
            for file in if root.is_dir() { files(&root)? } else { vec![] } {
                let inside = file.strip_prefix(&root).unwrap().to_path_buf();
                let package = entry.file_name().to_str().unwrap().replace('-', "_");
                texts.push((package, inside, std::fs::read_to_string(&file)?));
            }
        }
        Ok(Self::of(texts))
    }

    /// Takes sources: of each file the crate, its path below `src`, its text.
    pub fn of(texts: impl IntoIterator<Item = (String, PathBuf, String)>) -> Self {
        let (mut rooms, mut exports) = (BTreeMap::<Room, Vec<String>>::new(), BTreeMap::new());
        for (package, path, text) in texts {
            let first = path.iter().next().unwrap().to_str().unwrap().trim_end_matches(".rs").to_owned();
            let tokens = tokens(&text).unwrap_or_else(|error| panic!("{package}/src/{}: {error}", path.display()));
            if first == "lib" {
                exports.extend(exported(&tokens).into_iter().map(|(name, room)| ((package.clone(), name), room)));
            } else {
                let room = rooms.entry((package, first)).or_default();
                room.push(path.to_str().unwrap().to_owned());
                room.extend(tokens);
            }
        }
        Self { rooms, exports }
    }

    /// The digest of each name that the binding crate gives to Python.
    pub fn digests(&self) -> BTreeMap<String, u64> {
        let binding = self.rooms.iter().filter(|((package, _), _)| package == BINDING);
        binding
            .flat_map(|(room, tokens)| {
                let digest = self.digest(room);
                bound(tokens).into_iter().map(move |name| (name, digest))
            })
            .collect()
    }

    /// The digest of a room and of all that it leads to.
    fn digest(&self, room: &Room) -> u64 {
        let (mut met, mut open) = (BTreeSet::new(), vec![room.clone()]);
        while let Some(next) = open.pop() {
            if met.insert(next.clone()) {
                open.extend(self.leads_to(&next));
            }
        }
        met.iter().flat_map(|room| &self.rooms[room]).fold(0xcbf2_9ce4_8422_2325, |hash, token| fnv(hash, token))
    }

    fn leads_to(&self, room: &Room) -> BTreeSet<Room> {
        let tokens = &self.rooms[room];
        let mut found = BTreeSet::new();
        for k in 0..tokens.len() {
            let package = if tokens[k] == "crate" { &room.0 } else { &tokens[k] };
            if is(tokens, k + 1, "::") {
                for name in heads(tokens, k + 2) {
                    let inside = self.exports.get(&(package.clone(), name.clone())).unwrap_or(&name).clone();
                    found.insert((package.clone(), inside));
                }
            }
        }
        found.retain(|room| self.rooms.contains_key(room));
        found
    }
}

/// FNV-1a of one more token and its end.
fn fnv(hash: u64, token: &str) -> u64 {
    token.bytes().chain([0]).fold(hash, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3))
}

fn is(tokens: &[String], k: usize, token: &str) -> bool {
    tokens.get(k).is_some_and(|found| found == token)
}

/// The first names of the paths that begin at a token: one, or those of a group in braces.
fn heads(tokens: &[String], k: usize) -> Vec<String> {
    if !is(tokens, k, "{") {
        return tokens.get(k).cloned().into_iter().collect();
    }
    let (mut depth, mut found, mut begins) = (0, vec![], false);
    for token in &tokens[k..] {
        match token.as_str() {
            "{" => (depth, begins) = (depth + 1, depth == 0),
            "}" if depth == 1 => break,
            "}" => depth -= 1,
            "," => begins = depth == 1,
            name if begins => {
                found.push(name.to_owned());
                begins = false;
            }
            _ => {}
        }
    }
    found
}

/// Which module of a crate each name is of that its root re-exports.
fn exported(tokens: &[String]) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    for k in 0..tokens.len() {
        if tokens[k] == "pub" && is(tokens, k + 1, "use") && is(tokens, k + 3, "::") {
            found.extend(heads(tokens, k + 4).into_iter().map(|name| (name, tokens[k + 2].clone())));
        }
    }
    found
}

/// The names that a binding file gives to Python: functions, classes, and what it adds by name.
fn bound(tokens: &[String]) -> Vec<String> {
    let mut found = vec![];
    for k in 0..tokens.len() {
        let rest = &tokens[k..];
        let after = |word: &str| rest.iter().position(|t| t == word).and_then(|n| rest.get(n + 1)).cloned();
        if tokens[k] == "#" && is(tokens, k + 2, "pyfunction") {
            found.extend(after("fn"));
        } else if tokens[k] == "#" && is(tokens, k + 2, "pyclass") {
            let end = rest.iter().position(|t| t == "]").unwrap();
            let named = rest[..end].iter().position(|t| t == "name").and_then(|n| rest.get(n + 2)).map(|t| unquoted(t));
            found.extend(named.or_else(|| after("struct")));
        } else if tokens[k] == "." && is(tokens, k + 1, "add") && rest.get(3).is_some_and(|t| t.starts_with('"')) {
            found.push(unquoted(&rest[3]));
        }
    }
    found
}

fn unquoted(token: &str) -> String {
    token.trim_matches('"').to_owned()
}

fn files(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut found = vec![];
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            found.extend(files(&path)?);
        } else if path.extension().is_some_and(|e| e == "rs") && path.file_stem().is_some_and(|s| s != "tests") {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

/// The tokens of a file, but for documentation, tests, and the commas that a formatter sets before a closing bracket.
pub fn tokens(text: &str) -> Result<Vec<String>, proc_macro2::LexError> {
    let mut found = vec![];
    flatten(TokenStream::from_str(text)?, &mut found);
    Ok(found)
}

fn flatten(stream: TokenStream, found: &mut Vec<String>) {
    let trees: Vec<TokenTree> = stream.into_iter().collect();
    let mut k = 0;
    while k < trees.len() {
        if let Some((attribute, after)) = attribute(&trees, k) {
            if attribute.starts_with("doc") {
                k = after;
                continue;
            }
            if attribute.replace(' ', "") == "cfg(test)" {
                k = end_of_item(&trees, after);
                continue;
            }
        }
        match &trees[k] {
            TokenTree::Group(group) => {
                let (open, close) = match group.delimiter() {
                    Delimiter::Parenthesis => ("(", ")"),
                    Delimiter::Brace => ("{", "}"),
                    Delimiter::Bracket => ("[", "]"),
                    Delimiter::None => ("", ""),
                };
                found.push(open.to_owned());
                flatten(group.stream(), found);
                if found.last().is_some_and(|last| last == ",") {
                    found.pop();
                }
                found.push(close.to_owned());
            }
            TokenTree::Punct(punct) if punct.as_char() == ':' && colon(trees.get(k + 1)) => {
                found.push("::".to_owned());
                k += 1;
            }
            tree => found.push(tree.to_string()),
        }
        k += 1;
    }
}

fn colon(tree: Option<&TokenTree>) -> bool {
    matches!(tree, Some(TokenTree::Punct(punct)) if punct.as_char() == ':')
}

/// The text of an attribute that begins at a tree, and where what follows it begins.
fn attribute(trees: &[TokenTree], k: usize) -> Option<(String, usize)> {
    let punct = |k: usize, c: char| matches!(trees.get(k), Some(TokenTree::Punct(p)) if p.as_char() == c);
    if !punct(k, '#') {
        return None;
    }
    let at = k + 1 + usize::from(punct(k + 1, '!'));
    match trees.get(at) {
        Some(TokenTree::Group(group)) if group.delimiter() == Delimiter::Bracket => {
            Some((group.stream().to_string(), at + 1))
        }
        _ => None,
    }
}

/// Where the item ends that begins at a tree: behind its braces, or its semicolon.
fn end_of_item(trees: &[TokenTree], k: usize) -> usize {
    let ends = |tree: &TokenTree| match tree {
        TokenTree::Group(group) => group.delimiter() == Delimiter::Brace,
        TokenTree::Punct(punct) => punct.as_char() == ';',
        _ => false,
    };
    trees[k..].iter().position(ends).map_or(trees.len(), |n| k + n + 1)
}
