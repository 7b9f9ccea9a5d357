//! What a client may ask for: its message, checked, and what is done about it.

use std::sync::Arc;
use std::time::Duration;

use serde_json::{Map, Value, json};
use taxel_core::wire::registers::PRESETS;
use taxel_core::wire::{Command, Registers};

use super::hub::{Hub, Label, said_of};
use super::recorder::Plan;
use super::take;
use crate::locked::lock;
use crate::pipeline::UNKNOWN;

/// Why not, and which register or key is at fault.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Refused {
    pub(super) reason: String,
    pub(super) field: Option<String>,
}

impl Refused {
    pub(super) fn of(field: &str, reason: impl std::fmt::Display) -> Self {
        Self { reason: format!("{field}: {reason}"), field: Some(field.to_owned()) }
    }
}

impl From<String> for Refused {
    fn from(reason: String) -> Self {
        Self { reason, field: None }
    }
}

impl From<&str> for Refused {
    fn from(reason: &str) -> Self {
        reason.to_owned().into()
    }
}

impl From<crate::Error> for Refused {
    fn from(error: crate::Error) -> Self {
        error.to_string().into()
    }
}

pub(super) type Answer<T = ()> = Result<T, Refused>;

/// A message's keys.
pub(super) struct Asked<'a>(pub(super) &'a Map<String, Value>);

impl<'a> Asked<'a> {
    pub(super) fn has(&self, key: &str) -> bool {
        self.0.get(key).is_some_and(|value| !value.is_null())
    }

    pub(super) fn whole(&self, key: &str, least: i64, most: i64) -> Answer<i64> {
        let found = self.0.get(key).and_then(Value::as_i64).filter(|n| (least..=most).contains(n));
        found.ok_or_else(|| Refused::of(key, format!("must be a whole number from {least} to {most}")))
    }

    pub(super) fn number(&self, key: &str, least: f64, most: f64) -> Answer<f64> {
        let found = self.0.get(key).and_then(Value::as_f64).filter(|n| (least..=most).contains(n));
        found.ok_or_else(|| Refused::of(key, format!("must be a number from {least} to {most}")))
    }

    /// A time of a board, us.
    pub(super) fn time(&self, key: &str) -> Answer<i64> {
        self.whole(key, -(1 << 52), 1 << 52)
    }

    /// False where it was left out.
    pub(super) fn flag(&self, key: &str) -> Answer<bool> {
        if self.has(key) { self.switch(key) } else { Ok(false) }
    }

    pub(super) fn switch(&self, key: &str) -> Answer<bool> {
        self.0.get(key).and_then(Value::as_bool).ok_or_else(|| Refused::of(key, "must be true or false"))
    }

    pub(super) fn text(&self, key: &str, most: usize) -> Answer<&'a str> {
        let fits = |text: &&str| {
            let n = text.chars().count();
            !text.trim().is_empty() && n <= most && !text.chars().any(char::is_control)
        };
        let found = self.0.get(key).and_then(Value::as_str).filter(fits);
        found.ok_or_else(|| Refused::of(key, format!("must be a text of 1 to {most} characters")))
    }

    fn object(&self, key: &str) -> Answer<&'a Map<String, Value>> {
        self.0.get(key).and_then(Value::as_object).ok_or_else(|| Refused::of(key, "must be an object"))
    }
}

/// Which of the names a reason begins with, or speaks of.
fn field_of(reason: &str, names: &[String]) -> Option<String> {
    let place = |name: &String| reason.find(name.as_str()).map(|place| (place, name.clone()));
    names.iter().filter_map(place).min().map(|(_, name)| name)
}

// ---------------------------------------------------------------------------------------------- registers

/// Writes what leads from the registers that the board holds to these.
async fn write(hub: &Hub, target: Registers, every: bool) -> Answer {
    let live = hub.live().ok_or("no board is listened to")?;
    if hub.state().control.is_none() {
        return Err("the board's serial line is not connected: give --control, or connect it here".into());
    }
    let array = &live.handle.options().array;
    if !hub.state().known {
        read(hub).await?;
    }
    let from = hub.state().registers;
    let mut commands = from.commands_to(&target, array).map_err(|error| error.to_string())?;
    if every {
        let written: Vec<u8> = commands.iter().map(|command| command.register).collect();
        let others = [1, 2, 3, 4, 0, 5].into_iter().filter(|n| !written.contains(n));
        commands.extend(others.map(|register| Command { register, value: target.word(register) }));
    }
    for command in commands {
        let asked = json!({ "register": command.register, "value": command.value });
        if let Err(reason) = hub.ask("command", asked).await {
            // What the board holds now is not sure: ask it.
            let _ = read(hub).await;
            return Err(reason.into());
        }
    }
    took(hub, Registers { record: from.record, ..target }, true);
    Ok(())
}

/// The board holds these now.
fn took(hub: &Hub, registers: Registers, known: bool) {
    {
        let mut state = hub.state();
        (state.registers, state.known) = (registers, known);
    }
    if let Some(live) = hub.live() {
        live.handle.wrote(registers);
        lock(&live.lens).set_floor(registers.noise_floor.into());
    }
    hub.tell_all(&hub.registers());
}

/// Reads all registers back.
async fn read(hub: &Hub) -> Answer {
    if hub.state().control.is_none() {
        return Err("the board's serial line is not connected: give --control, or connect it here".into());
    }
    // Channels are no register: the board greets with them. One that does not greet has as many as it was said to have.
    let greeting = hub.ask("greeting", json!({})).await.unwrap_or_default();
    let channels = greeting["channels"].as_u64().and_then(|n| u8::try_from(n).ok());
    let channels = channels.unwrap_or(hub.state().registers.channels);
    let mut words = [0; 8];
    for register in [0_u8, 1, 2, 3, 4, 5, 7] {
        let answer = hub.ask("command", json!({ "register": 6, "value": register })).await?;
        let word = answer["value"].as_u64().and_then(|word| u32::try_from(word).ok());
        words[usize::from(register)] = word.ok_or("the board's answer is no register")?;
    }
    let registers = Registers::of_words(&words, channels);
    let other = channels != hub.state().registers.channels;
    took(hub, registers, true);
    if other {
        // Other presets fit it.
        hub.tell_all(&hub.presets());
    }
    Ok(())
}

async fn set(hub: &Hub, asked: Asked<'_>) -> Answer {
    let values = asked.object("values")?;
    let names: Vec<String> = values.keys().cloned().collect();
    let mut wanted = vec![];
    for (name, value) in values {
        let number = match value {
            Value::Bool(flag) => Some(u32::from(*flag)),
            value => value.as_u64().and_then(|n| u32::try_from(n).ok()),
        };
        let number = number
            .ok_or_else(|| Refused::of(name, "must be a whole number of 0 or more, in the register's own unit"))?;
        if name == "record" || name == "channels" {
            return Err(Refused::of(
                name,
                if name == "record" { "is written by record and stop" } else { "is the board's build" },
            ));
        }
        wanted.push((name.clone(), number));
    }
    let live = hub.live().ok_or("no board is listened to")?;
    if hub.state().control.is_some() && !hub.state().known {
        read(hub).await?;
    }
    let mut target = hub.state().registers;
    let refused = |reason: String| Refused { field: field_of(&reason, &names), reason };
    target.set_all(&wanted, &live.handle.options().array).map_err(|error| refused(error.to_string()))?;
    write(hub, target, false).await.map_err(|refusal| refused(refusal.reason))
}

async fn read_presets(hub: &Hub) -> Answer {
    let said = hub.ask("presets_read", json!({})).await?;
    let mut state = hub.state();
    state.presets_path = said["path"].as_str().unwrap_or_default().to_owned();
    let own = said["own"].as_object().cloned().unwrap_or_default();
    state.presets = own.into_iter().filter_map(|(name, held)| Some((name, held.as_object()?.clone()))).collect();
    Ok(())
}

async fn write_presets(hub: &Hub) -> Answer {
    let own = json!(hub.state().presets);
    hub.ask("presets_write", json!({ "own": own })).await?;
    hub.tell_all(&hub.presets());
    hub.tell_all(&hub.registers());
    Ok(())
}

async fn preset(hub: &Hub, what: &str, name: &str) -> Answer {
    read_presets(hub).await?;
    let built_in = PRESETS.iter().find(|preset| preset.name == name);
    let own = hub.state().presets.get(name).cloned();
    match what {
        "preset_apply" => {
            let live = hub.live().ok_or("no board is listened to")?;
            let array = &live.handle.options().array;
            if hub.state().control.is_some() && !hub.state().known {
                read(hub).await?;
            }
            let target = match (built_in, own) {
                (Some(_), _) => {
                    let preset =
                        Registers::preset_on(name, array).map_err(|error| Refused::of("name", error.to_string()))?;
                    hub.state().registers.with_preset(&preset, array)
                }
                // One's own says every register, the version of the wire too.
                (None, Some(own)) => {
                    let own: Registers = serde_json::from_value(Value::Object(own))
                        .map_err(|error| Refused::of("name", format!("preset {name}: {error}")))?;
                    Registers { lines: own.lines.min(array.columns), ..own }
                }
                (None, None) => return Err(Refused::of("name", format!("there is no preset {name}"))),
            };
            write(hub, target, false).await
        }
        "preset_save" => {
            if built_in.is_some() || own.is_some() {
                return Err(Refused::of("name", format!("{name} is taken: delete it first, or name another")));
            }
            let Value::Object(held) = json!(Registers { record: false, ..hub.state().registers }) else {
                return Err("registers are no object".into());
            };
            hub.state().presets.insert(name.to_owned(), held);
            write_presets(hub).await
        }
        _ => {
            if own.is_none() {
                let why = if built_in.is_some() { "is built in" } else { "is no preset of yours" };
                return Err(Refused::of("name", format!("{name} {why}")));
            }
            hub.state().presets.remove(name);
            write_presets(hub).await
        }
    }
}

// ---------------------------------------------------------------------------------------------- recording and labels

fn record(hub: &Arc<Hub>, asked: &Asked<'_>) -> Answer {
    let name = asked.text("name", 100)?;
    let index = if asked.has("index") { Some(asked.whole("index", 0, 999_999)?) } else { None };
    let length = if asked.has("length_s") { Some(asked.number("length_s", 0.01, 86_400.0)?) } else { None };
    let countdown = if asked.has("countdown_s") { asked.number("countdown_s", 0.0, 60.0)? } else { 0.0 };
    let ending = match asked.0.get("format").and_then(Value::as_str) {
        None | Some("mcap") => "mcap",
        Some("lsa") => "lsa",
        Some(_) => return Err(Refused::of("format", "must be mcap or lsa")),
    };
    let advance = asked.flag("advance")?;
    if advance && (index.is_none() || length.is_none()) {
        return Err(Refused::of("advance", "needs an index and a length"));
    }
    if hub.live().is_none() {
        return Err("no board is listened to: nothing to record".into());
    }
    let plan = Plan {
        name: name.to_owned(),
        index: index.and_then(|index| u32::try_from(index).ok()),
        ending,
        countdown: Duration::from_secs_f64(countdown),
        length: length.map(Duration::from_secs_f64),
        advance,
        label: if asked.has("label") { Some(asked.text("label", 200)?.to_owned()) } else { None },
    };
    take::start(hub, plan).map_err(|reason| Refused { reason, field: Some("name".to_owned()) })
}

/// Which recording a label is of.
async fn label(hub: &Hub, what: &str, name: &str, asked: Asked<'_>) -> Answer {
    let id = if what == "mark" { 0 } else { asked.whole("label_id", 1, i64::MAX)?.unsigned_abs() };
    let text = if matches!(what, "mark" | "rename") { asked.text("label", 200)?.to_owned() } else { String::new() };
    let t_us = if matches!(what, "mark" | "move") { asked.time("t_us")? } else { 0 };
    let changed = hub.change_labels(name, |labels, ids| {
        if what == "mark" {
            *ids += 1;
            labels.push(Label { id: *ids, label: text, t_us });
            return Ok(());
        }
        let place = labels.iter().position(|label| label.id == id);
        let place = place
            .ok_or_else(|| format!("label_id: there is no label {id}; it was deleted, perhaps by somebody else"))?;
        match what {
            "rename" => labels[place].label = text,
            "move" => labels[place].t_us = t_us,
            _ => drop(labels.remove(place)),
        }
        Ok(())
    });
    changed.await.map_err(Refused::from)
}

// ---------------------------------------------------------------------------------------------- the rest

async fn health(hub: &Hub, name: Option<&str>) -> Answer<Value> {
    let (array, activity) = match name {
        Some(name) => {
            let film = hub.film(name).await?;
            (film.header().array.clone(), film.activity.clone())
        }
        None => {
            let live = hub.live().ok_or("nothing is shown")?;
            let activity = lock(&live.activity).clone();
            (live.handle.options().array.clone(), activity)
        }
    };
    let values = activity.range.iter().any(|&(least, _)| least != UNKNOWN).then_some(&activity.values);
    let known = |(least, greatest)| if least == UNKNOWN { (-1, -1) } else { (i32::from(least), i32::from(greatest)) };
    let (least, greatest): (Vec<_>, Vec<_>) = activity.range.iter().map(|&range| known(range)).unzip();
    let with = json!({
        "array": said_of(&array),
        "activity": activity.events,
        "moved": activity.moved,
        "values": values,
        "least": least,
        "greatest": greatest,
    });
    let mut said = hub.ask("health", with).await?;
    let heard = activity.events.iter().filter(|&&n| n > 0).count();
    if let Some(said) = said.as_object_mut() {
        said.insert("type".to_owned(), json!("health"));
        said.insert("source".to_owned(), json!(name));
        said.insert(
            "taxels".to_owned(),
            json!(array.exists.as_ref().map_or(array.len(), |e| e.iter().filter(|&&t| t).count())),
        );
        said.insert("heard".to_owned(), json!(heard));
    }
    Ok(said)
}

async fn cut(hub: &Hub, name: &str, asked: Asked<'_>) -> Answer<Value> {
    let (start, stop) = (asked.time("start_us")?, asked.time("stop_us")?);
    if start >= stop {
        return Err(Refused::of("stop_us", "must lie after start_us"));
    }
    let to = asked.text("name", 100)?;
    let (from, out) = (hub.place(name)?, hub.place(to).map_err(|error| Refused::of("name", error))?);
    if out.exists() {
        return Err(Refused::of("name", format!("{to} exists already; name another")));
    }
    let with = json!({ "path": from, "out": out, "start_us": start, "stop_us": stop });
    let said = hub.ask("cut", with).await?;
    hub.tell_all(&hub.recordings());
    Ok(json!({ "type": "cut", "name": to, "lost": said["lost"] }))
}

/// What does not need the client's own view; `shown` is the recording that it looks at. Gives what only the client is told.
pub(super) async fn carry_out(
    hub: Arc<Hub>,
    what: &str,
    shown: Option<&str>,
    asked: Asked<'_>,
) -> Answer<Option<Value>> {
    match what {
        "set" => set(&hub, asked).await?,
        "read" => read(&hub).await?,
        "send_all" => {
            let target = hub.state().registers;
            write(&hub, target, true).await?;
        }
        "preset_apply" | "preset_save" | "preset_delete" => preset(&hub, what, asked.text("name", 60)?).await?,
        "record" => record(&hub, &asked)?,
        "stop" => hub.recorder.end()?,
        "note" => {
            let live = hub.live().ok_or("no board is listened to")?;
            live.handle.note(asked.text("text", 200)?)?;
        }
        "mark" | "rename" | "move" | "delete" => {
            let recorded = hub.recorder.file();
            let name = shown.or(recorded.as_deref());
            let name = name.ok_or("a label belongs to a recording: open one, or record")?;
            label(&hub, what, name, asked).await?;
        }
        "health" => return health(&hub, shown).await.map(Some),
        "cut" => {
            let name = shown.ok_or("cut: open a recording first")?;
            return cut(&hub, name, asked).await.map(Some);
        }
        "recordings" => return Ok(Some(hub.recordings())),
        "rest" => {
            let live = hub.live().ok_or("no board is listened to")?;
            let mut lens = lock(&live.lens);
            match asked.0.get("how").and_then(Value::as_str) {
                Some("now") if lens.held().iter().all(|&held| held == UNKNOWN) => return Err("nothing came yet".into()),
                Some("now") => lens.rest_now(),
                Some("lowest") => lens.rest_lowest(),
                _ => return Err(Refused::of("how", "must be now or lowest")),
            }
        }
        "zero" => {
            let live = hub.live().ok_or("no board is listened to")?;
            let taxels = taxels(&asked)?;
            // A disk may hold the answer up.
            let zeroed = tokio::task::spawn_blocking(move || live.handle.zero(&taxels)).await;
            zeroed.map_err(|_| Refused::from("zero: failed within taxel; please report it"))??;
        }
        "places" => {
            let mut said = hub.ask("places", json!({})).await?;
            if let Some(said) = said.as_object_mut() {
                said.insert("type".to_owned(), json!("places"));
            }
            return Ok(Some(said));
        }
        "delta_intensity" => {
            may_begin_anew(&hub)?;
            let on = asked.switch("on")?;
            hub.ask("differences", json!({ "on": on })).await?;
        }
        "listen" => {
            may_begin_anew(&hub)?;
            let (host, port) = (asked.text("host", 255)?, asked.whole("port", 0, 65_535)?);
            hub.ask("listen", json!({ "host": host, "port": port })).await?;
        }
        "control" => {
            let place = if asked.has("place") { Some(asked.text("place", 255)?) } else { None };
            let connected = hub.ask("control", json!({ "place": place })).await;
            {
                let mut state = hub.state();
                state.control = place.filter(|_| connected.is_ok()).map(str::to_owned);
                state.known = false;
            }
            hub.tell(super::hub::Told::Hello);
            connected?;
            if place.is_some() {
                read(&hub).await?;
            }
        }
        _ => return Err(format!("type {what:?} is none of the protocol's").into()),
    }
    Ok(None)
}

/// Which taxels a request names.
fn taxels(asked: &Asked<'_>) -> Answer<Vec<(u16, u16)>> {
    let one = |taxel: &Value| {
        let two = taxel.as_array().filter(|two| two.len() == 2)?;
        let number = |k: usize| two[k].as_u64().and_then(|n| u16::try_from(n).ok());
        number(0).zip(number(1))
    };
    let all = asked.0.get("taxels").and_then(Value::as_array).filter(|all| !all.is_empty());
    let taxels = all.and_then(|all| all.iter().map(one).collect());
    taxels.ok_or_else(|| Refused::of("taxels", "must be one taxel or more, each [column, row]"))
}

/// Whether the source may begin anew: on another address, or read in another way.
fn may_begin_anew(hub: &Hub) -> Answer {
    if hub.recorder.is_busy() {
        return Err("a recording runs: stop it first".into());
    }
    if hub.live().is_none() {
        return Err("this panel shows recordings only: begin it with taxel live --panel".into());
    }
    Ok(())
}

/// What a client needs to know that only the office knows.
pub(super) async fn prepare(hub: &Hub) {
    // Without a file of presets there are none of one's own.
    let _ = read_presets(hub).await;
    let (listens, known) = {
        let state = hub.state();
        (state.control.is_some(), state.known)
    };
    if listens && !known {
        // Where the board does not answer now, its registers stay unknown, as the page then says.
        let _ = read(hub).await;
    }
}
