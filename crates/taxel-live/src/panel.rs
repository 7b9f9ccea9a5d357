//! The live panel: what a browser is shown.

pub mod assets;
