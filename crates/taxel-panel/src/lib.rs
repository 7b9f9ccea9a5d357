//! The panel's view of a recording or a live source: what a page shows of it at a time, as binary frames and as JSON.
//!
//! It works on copies of the events ([`taxel_live::pipeline::ViewerEvents`]), in a thread of its own. The server of the page is
//! Python's.

mod activity;
mod block;
mod change_file;
mod columns;
mod event_rate;
mod events;
mod frame_values;
mod frames;
mod history;
mod index;
mod live_source;
mod load;
mod player;
mod shown;
mod state;
mod view;

pub use activity::Activity;
pub use frame_values::{FrameRest, FramesOfSource, RestSource};
pub use frames::FrameSource;
pub use index::{Index, Kept};
pub use live_source::{LiveSource, News, limits};
pub use view::View;
