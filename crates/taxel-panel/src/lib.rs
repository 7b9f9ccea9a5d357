//! The live panel: a server for the page that shows a board or recordings (protocol.md).
//!
//! One thread serves all clients. It works on copies of the events ([`taxel_live::pipeline::ViewerEvents`]) and sends a frame
//! only when a client has asked for one, so that a client that reads slowly, or never, delays nothing but its own
//! frames. What takes long or belongs to other parts of the program (the board's serial line, cutting, label tables) is
//! left to the program that started the panel, through [`RequestHandlers`].

mod array_state;
pub mod assets;
mod handler;
mod hub;
mod keyframe_index;
mod load;
mod options;
mod protocol;
mod readout_encoders;
mod requests;
mod server;
mod session;
mod taxel_history;
mod time_columns;
mod view;

/// The JSON schemas of the requests (`requests`), of the messages that are text (`messages`) and of the options of a live source
/// (`options`), for `tools/messages.py`.
#[cfg(feature = "development")]
#[must_use]
pub fn message_schemas() -> String {
    let settings = schemars::generate::SchemaSettings::draft2020_12;
    let requests = settings().into_generator().into_root_schema_for::<protocol::request::Request>();
    let messages = settings().for_serialize().into_generator().into_root_schema_for::<protocol::messages::Message>();
    let options = settings().into_generator().into_root_schema_for::<taxel_live::pipeline::LiveOptions>();
    serde_json::json!({ "requests": requests, "messages": messages, "options": options }).to_string()
}

pub use array_state::RestSource;
pub use handler::{
    BagTopic, BoardLines, BoardRequests, Cut, Description, Detected, EditOutcome, FileRequests, FramesRead, LabelEdit,
    LabelRequests, LabelRow, LabelScore, LabelTable, LabelTimes, Mistake, Opening, PresetRequests, PresetValue,
    ReadFile, Reply, RequestHandlers, TrainingRequests, TrainingResult, UnhealthyTaxels, UserPreset, UserPresets,
};
pub use keyframe_index::Activity;
pub use keyframe_index::frames::{FrameArea, FrameFile, FrameIndex, FrameRest, FrameSource};
pub use options::PanelOptions;
pub use server::Panel;
