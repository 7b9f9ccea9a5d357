//! The requests of clients. They are described here alone: `tools/messages.py` makes of them the types of the page.

use serde::Deserialize;
use serde_json::{Map, Value, json};
use serde_path_to_error::Segment;

use super::limited::{BoardTime, Number, OneOrMore, Text, Whole};
use super::limits::MOST_CREDITS;
use super::refusal::{Answer, Refusal};

/// Number of a label.
pub(crate) type Id = Whole<1, { i64::MAX }>;

/// A taxel, column and row.
pub(crate) type Taxel = (u16, u16);

/// A request of a client.
#[derive(Debug, Clone, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema), schemars(tag = "type"))]
pub(crate) enum Request {
    /// Credits for `n` more frames.
    Credit { n: Whole<1, { MOST_CREDITS as i64 }> },
    /// Send this taxel's history; `null` for none.
    Watch { taxel: Option<Taxel> },
    /// The held values are the rest from now on (`now`, "reset intensity"), or find it again (`lowest`): that of the next quiet
    /// half second, tracked from there. The live source changes for all clients.
    Rest { how: RestHow },
    /// The values that these taxels hold now are their rest from now on, for the readout's encoder, the frames of the
    /// recording and this panel; all or none. The recording notes the time and the rests before and after. Refused for a taxel
    /// without events, while a tare is taken, and while a `.lsa` is recorded. Answered at once; `zeroed` follows.
    Zero { taxels: OneOrMore<Taxel> },
    /// Spikes of this encoder (JSON as `Encoder.to_json` writes it) of what this view shows, live or in a recording; `null`
    /// for none. A name without parameters is that of the encoder of the readout that reads what is shown, with its parameters
    /// and its tare, where the readout has one of this name; else the parameters are the defaults.
    Encode { encoder: Option<Map<String, Value>> },
    /// Columns of time of this width, for this view: 125 us times a power of two, up to 131 072 000 (0.16 s to 45 hours in 1250
    /// columns). Counts of several narrow columns add up, to 15 at most. With `end_us`, in a view that does not follow the
    /// newest, the 1250 columns end there, wherever the view's time is, and stay until the next `zoom`; a view that plays beyond
    /// takes them along. Without it they end at the view's time.
    Zoom { column_us: i64, end_us: Option<BoardTime> },
    /// Show this time: of the recording, or while live within the reach; stops playing.
    Seek { t_us: BoardTime },
    /// Play from there at this speed (board time over real time; the last one where left out), from the end of a recording from
    /// its beginning; live: from an earlier time at a fixed delay, refused while following.
    Play { speed: Option<Number<1, 100_000>> },
    /// Pause the view. Acquisition continues.
    Pause {},
    /// Forward or back (negative) by this number of time stamps with events; time without events is skipped. Stops playing.
    Step { frames: Whole<-1000, 1000> },
    /// Follow the live source; leaves a recording.
    Live {},
    /// Show a recording of the folder, at its beginning, paused: any file that `taxel.open` reads; of a file with several trials
    /// the one that `trial` names, or the first.
    Open { name: Text<110>, trial: Option<Text<255>> },
    /// Requests `recordings`.
    Recordings {},
    /// Requests `overview` of what this view shows.
    Overview {},
    /// Write registers, by taxel's names or the manual's, in the registers' own units (as `registers.js` has them); all or none.
    Set {
        #[cfg_attr(
            feature = "development",
            schemars(with = "std::collections::BTreeMap<String, super::limited::RegisterValue>")
        )]
        values: Map<String, Value>,
    },
    /// Read all registers back from the board.
    Read {},
    /// Write every register again ("change (send all again)").
    SendAll {},
    /// Write a preset's registers: a built-in one does not change the version of the wire, one of the user holds every register.
    PresetApply { name: Text<60> },
    /// Save the registers under a new name; a name that exists is refused.
    PresetSave { name: Text<60> },
    /// A preset of the user only.
    PresetDelete { name: Text<60> },
    /// Begin: after the countdown (none where left out) record to `NAME.mcap`, or with an `index` of 1 to `NAME1.mcap`, for
    /// `length_s`, or else until `stop`. With `advance` the index moves on by itself after each recording, and the next countdown
    /// begins until `stop`. `label` is written into the recording as a note without a time: it is about the whole recording,
    /// and is not an event. `format` is `mcap` where left out; `lsa` holds raw bytes and no label.
    Record(RecordRequest),
    /// End the recording, or its countdown; and the advance.
    Stop {},
    /// Write a note into the recording that runs, with the time of now.
    Note { text: Text<200> },
    /// A label at this time of the recording shown. A live view: at this time of the recording that runs. With `source` it is of
    /// this source alone. One of the same name, time, source and trial is not made twice. With `replaces_us` it replaces the
    /// recording's own note of that time (and source), which counts no more. Refused outside the recording: of events more than a
    /// second before the first or after the last one, of frames more than one frame.
    Mark { label: Text<200>, t_us: BoardTime, source: Option<Text<64>>, replaces_us: Option<BoardTime> },
    /// Several labels, all or none: each entry is a label at one time or more, its keys as of `mark`; `replaces_us` has as many
    /// times as `t_us`. At most 5000 labels.
    Marks { labels: OneOrMore<MarkedTimes> },
    /// Another name for a label.
    Rename { label_id: Id, label: Text<200> },
    /// Another time, as for `mark`.
    Move { label_id: Id, t_us: BoardTime },
    /// If the label replaces a note, that note no longer counts either, until a `mark` with the same `replaces_us`.
    Delete { label_id: Id },
    /// Take back the last change of labels that this client made in the recording that it shows or that is recorded, whole or not
    /// at all; refused where there is none, or where another window or program has changed such a label since.
    Undo {},
    /// Requests `health` of what this view shows.
    Health {},
    /// Train a readout on the labels of the recording shown, as `taxel train --labels notes` does; of a file with several trials,
    /// on the trials that have labels. The readout replaces `NAME.readout.json` beside the recording. Answered when the training
    /// has ended; `trained` comes before. One training runs at a time.
    Train {},
    /// Requests `training`: how far the training that runs is.
    Training {},
    /// End the training that runs: it is refused, and writes nothing.
    TrainStop {},
    /// Read what this view shows with a readout or a plain rule of the folder. A recording: answered by `detections`. The board:
    /// from now on, for all clients; the source begins again, as with `delta_intensity`. A readout that needs a tare uses that of
    /// the command, else what the taxels hold now.
    ReadOut { readout: Text<110> },
    /// Write the stretch of the recording shown to a new file of the folder; what `taxel cut` does, so any of its endings.
    Cut { start_us: BoardTime, stop_us: BoardTime, name: Text<100> },
    /// Receive the board's datagrams there instead. Refused while a recording runs.
    Listen { host: Text<255>, port: u16 },
    /// Receive another source instead, as `taxel live --source` names it. Time, values and the past that can be viewed begin
    /// again. Refused while a recording runs.
    ReadSource { source: Text<1024> },
    /// Requests `source_preview`: what arrives from a source of lines, for two seconds at most.
    PreviewSource { source: Text<1024> },
    /// Write a source of lines, with all that its text states, to the new layout file NAME.layout.toml of the folder; `layout_saved`
    /// follows. An existing file is never overwritten.
    SaveLayout { source: Text<1024>, name: Text<90> },
    /// Requests `topics`: those of a ROS bag of the folder.
    Topics { name: Text<110> },
    /// Write what is stated here into the layout file beside a recording of the folder, NAME.layout.toml, as its keys `falls`,
    /// `rate_hz`, `rows` and `columns`, and in `[ros]` `topic` and `field`; what it holds already stays. The next `open` reads the
    /// recording by it. Refused where options of the command say the same, and for a file that no layout file describes.
    Describe(DescribeRequest),
    /// Whether the board sends differences from the value before, not values. Earlier events were decoded with the other
    /// meaning, so the source begins again: time, values, the past that can be viewed, a readout with its tare. Refused while a
    /// recording runs.
    DeltaIntensity { on: bool },
    /// Requests `places`: where a board can be.
    Places {},
    /// The board's serial line: a port of this machine, or host:port; `null` disconnects it.
    Control { place: Option<Text<255>> },
}

/// How a rest is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema), schemars(inline))]
pub(crate) enum RestHow {
    Now,
    Lowest,
}

/// What is to be recorded.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema), schemars(inline))]
pub(crate) struct RecordRequest {
    pub(crate) name: Text<100>,
    pub(crate) index: Option<Whole<0, 999_999>>,
    pub(crate) countdown_s: Option<Number<0, 60_000>>,
    pub(crate) length_s: Option<Number<10, 86_400_000>>,
    pub(crate) advance: Option<bool>,
    pub(crate) label: Option<Text<200>>,
    pub(crate) format: Option<RecordingFormat>,
}

/// What a layout file is to say of a recording.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema), schemars(inline))]
pub(crate) struct DescribeRequest {
    pub(crate) name: Text<110>,
    pub(crate) falls: Option<bool>,
    pub(crate) rate_hz: Option<Number<1, 1_000_000_000>>,
    /// Rows and columns.
    pub(crate) size: Option<(u16, u16)>,
    pub(crate) topic: Option<Text<255>>,
    pub(crate) field: Option<Text<255>>,
}

/// The kind of file that is recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema), schemars(inline))]
pub(crate) enum RecordingFormat {
    #[default]
    Mcap,
    /// Raw bytes alone.
    Lsa,
}

/// A label at one time or more.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema))]
pub(crate) struct MarkedTimes {
    pub(crate) label: Text<200>,
    pub(crate) t_us: OneOrMore<BoardTime>,
    pub(crate) source: Option<Text<64>>,
    pub(crate) replaces_us: Option<OneOrMore<BoardTime>>,
}

impl Request {
    /// Whether it changes labels.
    pub(crate) fn changes_labels(&self) -> bool {
        matches!(
            self,
            Self::Mark { .. }
                | Self::Marks { .. }
                | Self::Rename { .. }
                | Self::Move { .. }
                | Self::Delete { .. }
                | Self::Undo { .. }
        )
    }

    /// A request by its `type` and its other keys, without `type` and `id`.
    ///
    /// # Errors
    ///
    /// The refusal, which names the key at fault.
    pub(crate) fn read(kind: &str, mut keys: Map<String, Value>) -> Answer<Self> {
        keys.remove("type");
        keys.remove("id");
        serde_path_to_error::deserialize(json!({ kind: keys })).map_err(|error| {
            let key = |segment: &Segment| match segment {
                Segment::Map { key } => Some(key.clone()),
                _ => None,
            };
            match error.path().iter().filter_map(key).next_back() {
                Some(key) => Refusal::of_field(&key, error.inner()),
                None => error.inner().to_string().into(),
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(request: Value) -> Answer<Request> {
        let Value::Object(keys) = request else { unreachable!("a request is an object") };
        Request::read(keys["type"].as_str().unwrap_or_default(), keys.clone())
    }

    #[test]
    fn keys_become_values_and_null_is_as_left_out() {
        let label = json!({ "label": "heel", "t_us": [10, 20], "replaces_us": null });
        match read(json!({ "type": "marks", "id": 7, "labels": [label] })) {
            Ok(Request::Marks { labels: OneOrMore(labels) }) => {
                assert_eq!((&*labels[0].label.0, &labels[0].t_us), ("heel", &OneOrMore(vec![Whole(10), Whole(20)])));
                assert_eq!((labels[0].source.is_none(), labels[0].replaces_us.is_none()), (true, true));
            }
            other => panic!("{other:?}"),
        }
        assert!(matches!(read(json!({ "type": "pause", "id": "a" })), Ok(Request::Pause {})));
        assert!(matches!(
            read(json!({ "type": "watch", "taxel": [3, 5] })),
            Ok(Request::Watch { taxel: Some((3, 5)) })
        ));
        assert!(matches!(read(json!({ "type": "watch", "taxel": null })), Ok(Request::Watch { taxel: None })));
        assert!(matches!(read(json!({ "type": "rest", "how": "now" })), Ok(Request::Rest { how: RestHow::Now })));
    }

    #[test]
    fn a_refusal_names_the_innermost_key_and_what_would_be_right() {
        for (request, field, reason) in [
            (json!({ "type": "credit", "n": 9 }), Some("n"), "n: must be a whole number from 1 to 8"),
            (json!({ "type": "credit" }), None, "missing field `n`"),
            (json!({ "type": "credit", "n": 1, "m": 1 }), Some("m"), "m: unknown field `m`, expected `n`"),
            (json!({ "type": "pause", "m": 1 }), Some("m"), "m: unknown field `m`, there are no fields"),
            (json!({ "type": "play", "speed": 0 }), Some("speed"), "speed: must be a number from 0.001 to 100"),
            (json!({ "type": "note", "text": " " }), Some("text"), "text: must be a text of 1 to 200 characters"),
            (json!({ "type": "note", "text": "a\nb" }), Some("text"), "text: must be a text of 1 to 200 characters"),
            (
                json!({ "type": "rest", "how": "soon" }),
                Some("how"),
                "how: unknown variant `soon`, expected `now` or `lowest`",
            ),
            (json!({ "type": "zero", "taxels": [] }), Some("taxels"), "taxels: must contain one or more"),
            (
                json!({ "type": "watch", "taxel": [1, 2, 3] }),
                Some("taxel"),
                "taxel: invalid length 3, expected fewer elements in array",
            ),
            (
                json!({ "type": "marks", "labels": [{ "label": "a", "t_us": [1, "soon"] }] }),
                Some("t_us"),
                "t_us: must be a whole number from -4503599627370496 to 4503599627370496",
            ),
            (
                json!({ "type": "delta_intensity", "on": "yes" }),
                Some("on"),
                "on: invalid type: string \"yes\", expected a boolean",
            ),
        ] {
            let refusal = Refusal { reason: reason.to_owned(), field: field.map(str::to_owned) };
            assert_eq!(read(request.clone()).err(), Some(refusal), "{request}");
        }
        let unknown = read(json!({ "type": "dance" })).expect_err("no request");
        assert!(
            unknown.reason.starts_with("unknown variant `dance`, expected one of `credit`, `watch`, "),
            "{unknown:?}"
        );
    }
}
