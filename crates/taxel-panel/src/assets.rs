//! The panel's files, inside the program: a table of exact names, so that no request can leave it.

use std::borrow::Cow;
use std::io;

/// A file of the page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Asset {
    /// Its name below `web/`, as the page asks for it.
    pub name: &'static str,
    /// Its media type.
    pub media: &'static str,
    /// What it held when the program was built.
    pub bytes: &'static [u8],
}

impl Asset {
    /// What it holds. A build for development reads the folder, so that a change of the page needs no other build.
    ///
    /// # Errors
    ///
    /// Those of reading, in a build for development.
    pub fn read(&self) -> io::Result<Cow<'static, [u8]>> {
        #[cfg(feature = "development")]
        return std::fs::read(format!("{}/web/{}", env!("CARGO_MANIFEST_DIR"), self.name)).map(Cow::Owned);
        #[cfg(not(feature = "development"))]
        Ok(Cow::Borrowed(self.bytes))
    }
}

/// A row of the table: name and media type once, the bytes from the folder.
macro_rules! assets {
    ($($media:literal: $($name:literal)+;)+) => {
        &[$($(Asset { name: $name, media: $media, bytes: include_bytes!(concat!("../web/", $name)) },)+)+]
    };
}

/// All of them.
pub const ASSETS: &[Asset] = assets! {
    "text/html; charset=utf-8": "index.html";
    "text/javascript; charset=utf-8":
        "actions.js" "board.js" "channels.js" "clusters.js" "colours.js" "connection.js" "counters.js" "cursor.js" "description.js" "detections.js" "dom.js" "geometry.js" "image.js" "keys.js" "labels.js" "lanes.js" "layout.js" "main.js" "maps.js" "mistakes.js" "notes.js" "notice.js" "player.js"
        "protocol.js" "raster.js" "recorder.js" "registers.js" "server.js" "settings.js" "state.js" "strip.js" "tabs.js" "timeline.js"
        "tones.js" "training.js" "view.js" "vendor/uPlot.js" "window.js" "words.js";
    "text/css; charset=utf-8": "style.css" "vendor/uPlot.css";
    "image/svg+xml": "icon.svg";
    "text/plain; charset=utf-8": "vendor/colour-maps.LICENSE" "vendor/uPlot.LICENSE";
};

/// Gives the file of exactly this name.
pub fn asset(name: &str) -> Option<&'static Asset> {
    ASSETS.iter().find(|asset| asset.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::{Path, PathBuf};

    /// Everything in the folder but what only the linter and readers of the source want.
    fn files(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path()) {
            if entry.is_dir() {
                files(&entry, found);
            } else if !entry.to_string_lossy().ends_with(".d.ts") && !entry.ends_with("README.md") {
                found.push(entry);
            }
        }
    }

    #[test]
    fn the_table_holds_what_the_folder_holds() {
        let web = Path::new(env!("CARGO_MANIFEST_DIR")).join("web");
        let mut found = Vec::new();
        files(&web, &mut found);
        let mut found: Vec<_> =
            found.iter().map(|f| f.strip_prefix(&web).expect("below").display().to_string()).collect();
        let mut known: Vec<_> = ASSETS.iter().map(|asset| asset.name.to_owned()).collect();
        found.sort();
        known.sort();
        assert_eq!(known, found);
    }

    #[test]
    fn only_exact_names_are_known() {
        for name in ["", "/", "vendor", "vendor/../registers.js", "REGISTERS.JS", "../Cargo.toml", "registers.js\0"] {
            assert!(asset(name).is_none(), "{name:?}");
        }
        assert!(asset("registers.js").is_some_and(|asset| asset.media.starts_with("text/javascript")));
    }
}
