//! Reading and writing the board's registers.

use serde_json::{Map, Value};
use taxel_core::wire::registers::PRESETS;
use taxel_core::wire::{Command, Registers};
use taxel_live::locked::lock;
use tokio::sync::OwnedMutexGuard;

use crate::handler::UserPresets;
use crate::hub::Hub;
use crate::hub::presets;
use crate::protocol::refusal::{Answer, Refusal};

const NOT_CONNECTED: &str = "the board's serial line is not connected: give --control to taxel live, or connect the \
                             line here";

/// The registers in the order in which all of them are written.
const ALL: [u8; 6] = [1, 2, 3, 4, 0, 5];

/// The registers that can be read; REG6 asks for them.
const READABLE: [u8; 7] = [0, 1, 2, 3, 4, 5, 7];

/// Reads all registers from the board.
pub(crate) async fn read(hub: &Hub) -> Answer {
    if hub.board().control.is_none() {
        return Err(NOT_CONNECTED.into());
    }
    let before = hub.board().registers.channels;
    // The number of channels is no register: it is in the board's greeting. A board without one has as many as it had.
    let channels = hub.ask(|handlers| handlers.board.channels()).await.unwrap_or(before);
    let mut words = [0; 8];
    for register in READABLE {
        let command = Command { register: 6, value: register.into() };
        words[usize::from(register)] = hub.ask(move |handlers| handlers.board.command(command)).await?;
    }
    hold(hub, Registers::of_words(&words, channels));
    if channels != before {
        // Other presets fit it.
        hub.clients.send_message(&hub.presets_message());
    }
    Ok(())
}

/// Reads the registers unless they are known.
async fn ensure_known(hub: &Hub) -> Answer {
    let unknown = {
        let board = hub.board();
        board.control.is_some() && !board.known
    };
    if unknown { read(hub).await } else { Ok(()) }
}

/// Notes that the board holds these registers.
fn hold(hub: &Hub, registers: Registers) {
    {
        let mut board = hub.board();
        (board.registers, board.known) = (registers, true);
    }
    if let Some(live) = hub.live() {
        live.handle.announce_registers(registers);
        lock(&live.state).set_noise_floor(registers.noise_floor.into());
    }
    hub.clients.send_message(&hub.registers_message());
}

/// Writes the registers that differ from those that the board holds, or `all` of them.
async fn write(hub: &Hub, target: Registers, all: bool) -> Answer {
    let live = hub.live().ok_or("no board is connected")?;
    if hub.board().control.is_none() {
        return Err(NOT_CONNECTED.into());
    }
    ensure_known(hub).await?;
    let from = hub.board().registers;
    let mut commands = from.commands_to(&target, live.array()).map_err(|error| error.to_string())?;
    if all {
        let written: Vec<u8> = commands.iter().map(|command| command.register).collect();
        let others = ALL.into_iter().filter(|n| !written.contains(n));
        commands.extend(others.map(|register| Command { register, value: target.word(register) }));
    }
    for command in commands {
        if let Err(reason) = hub.ask(move |handlers| handlers.board.command(command)).await {
            // What the board holds now is not certain, so its registers are read; the refusal is that of the write.
            let _ = read(hub).await;
            return Err(reason.into());
        }
    }
    hold(hub, Registers { record: from.record, ..target });
    Ok(())
}

/// `set`: writes single registers.
pub(crate) async fn set(hub: &Hub, values: &Map<String, Value>) -> Answer {
    let names: Vec<String> = values.keys().cloned().collect();
    let mut wanted = vec![];
    for (name, value) in values {
        let number = match value {
            Value::Bool(flag) => Some(u32::from(*flag)),
            value => value.as_u64().and_then(|n| u32::try_from(n).ok()),
        };
        let number = number
            .ok_or_else(|| Refusal::of_field(name, "must be a whole number, 0 or more, in the unit of the register"))?;
        match name.as_str() {
            "record" => return Err(Refusal::of_field(name, "is written when a recording starts or stops")),
            "channels" => return Err(Refusal::of_field(name, "is a property of the board")),
            _ => wanted.push((name.clone(), number)),
        }
    }
    let live = hub.live().ok_or("no board is connected")?;
    ensure_known(hub).await?;
    let mut target = hub.board().registers;
    let refused = |reason: String| Refusal { field: field_of(&reason, &names), reason };
    target.set_all(&wanted, live.array()).map_err(|error| refused(error.to_string()))?;
    write(hub, target, false).await.map_err(|refusal| refused(refusal.reason))
}

/// `send_all`: writes every register again.
pub(crate) async fn send_all(hub: &Hub) -> Answer {
    let target = hub.board().registers;
    write(hub, target, true).await
}

/// The name that comes first in a reason.
fn field_of(reason: &str, names: &[String]) -> Option<String> {
    let start = |name: &String| reason.find(name.as_str()).map(|start| (start, name.clone()));
    names.iter().filter_map(start).min().map(|(_, name)| name)
}

// ---------------------------------------------------------------------------------------------- presets

/// Reads the presets of the user while no other request changes them.
async fn reread_presets(hub: &Hub) -> Answer {
    let _turn = hub.file_turn().await;
    read_presets(hub).await
}

async fn read_presets(hub: &Hub) -> Answer {
    let read = hub.ask(|handlers| handlers.presets.read()).await?;
    *hub.presets() = read;
    Ok(())
}

async fn write_presets(hub: &Hub, turn: OwnedMutexGuard<()>) -> Answer {
    let UserPresets { presets, .. } = hub.presets().clone();
    // The lock is held until the file is written, also if the client disconnects.
    let (written, turn) = hub.ask(move |handlers| Ok((handlers.presets.write(&presets), turn))).await?;
    written?;
    drop(turn);
    hub.clients.send_message(&hub.presets_message());
    hub.clients.send_message(&hub.registers_message());
    Ok(())
}

/// `preset_apply`: writes the registers of a preset.
pub(crate) async fn apply_preset(hub: &Hub, name: &str) -> Answer {
    reread_presets(hub).await?;
    let live = hub.live().ok_or("no board is connected")?;
    let array = live.array();
    ensure_known(hub).await?;
    let of_user = hub.presets().presets.get(name).cloned();
    let target = if PRESETS.iter().any(|preset| preset.name == name) {
        let preset = Registers::preset_on(name, array).map_err(|error| Refusal::of_field("name", error))?;
        hub.board().registers.with_preset(&preset, array)
    } else if let Some(of_user) = of_user {
        // A preset of the user holds every register, also the version of the wire.
        let of_user = presets::to_registers(&of_user)
            .map_err(|error| Refusal::of_field("name", format!("preset {name}: {error}")))?;
        Registers { lines: of_user.lines.min(array.columns), ..of_user }
    } else {
        return Err(Refusal::of_field("name", format!("there is no preset {name}")));
    };
    write(hub, target, false).await
}

/// `preset_save`: saves the registers that the board holds under a new name.
pub(crate) async fn save_preset(hub: &Hub, name: &str) -> Answer {
    let turn = hub.file_turn().await;
    read_presets(hub).await?;
    let exists = PRESETS.iter().any(|preset| preset.name == name) || hub.presets().presets.contains_key(name);
    if exists {
        return Err(Refusal::of_field(
            "name",
            format!("{name}: exists already; delete it first, or choose another name"),
        ));
    }
    let held = Registers { record: false, ..hub.board().registers };
    hub.presets().presets.insert(name.to_owned(), presets::from_registers(&held));
    write_presets(hub, turn).await
}

/// `preset_delete`: deletes a preset of the user.
pub(crate) async fn delete_preset(hub: &Hub, name: &str) -> Answer {
    let turn = hub.file_turn().await;
    read_presets(hub).await?;
    if hub.presets().presets.remove(name).is_none() {
        let built_in = PRESETS.iter().any(|preset| preset.name == name);
        let why = if built_in { "is built in" } else { "is not one of your presets" };
        return Err(Refusal::of_field("name", format!("{name} {why}")));
    }
    write_presets(hub, turn).await
}

/// Reads what only the request handler knows: presets, and registers that are not known.
pub(crate) async fn prepare(hub: &Hub) {
    // Without a file there are no presets of the user; a damaged one is reported where a preset is applied.
    let _ = reread_presets(hub).await;
    // Where the board does not answer now, its registers stay unknown, as the page then shows.
    let _ = ensure_known(hub).await;
}
