//! The panel's view of a recording or a live source: what a page shows of it at a time, as binary frames and as JSON.
//!
//! It works on copies of the events ([`taxel_live::pipeline::ViewerEvents`]), in a thread of its own. The server of the page is
//! Python's.

mod array_state;
mod keyframe_index;
mod live_source;
mod load;
mod readout_encoders;
mod shown;
mod taxel_history;
mod time_columns;
mod view;

pub use array_state::RestSource;
pub use keyframe_index::Activity;
pub use keyframe_index::events::{EventIndex, Kept};
pub use keyframe_index::frames::{FrameArea, FrameIndex, FrameRest, FrameSource};
pub use live_source::{LiveSource, News, limits};
pub use readout_encoders::encoder_names;
pub use shown::Shown;
pub use view::View;
