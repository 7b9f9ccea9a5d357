//! The live panel: what a browser is shown, and what it asks for (docs/panel-protocol.md).
//!
//! One thread of its own serves all who look. It gets copies ([`crate::pipeline::Outlet`]) and sends pictures against
//! credits, so that nobody who reads slowly, or never, slows anything but himself. What takes long or belongs to another
//! program (the board's serial line, cutting, label files) is done by who started the panel, through [`Office`].

pub mod assets;
mod door;
mod film;
mod guests;
mod hub;
mod lens;
mod limits;
mod options;
mod picture;
mod player;
mod recorder;
mod requests;
mod session;
mod spikes;
mod take;

pub use door::Panel;
pub use hub::Office;
pub use options::PanelOptions;
