//! What all clients share: the live source, the board's registers, the folder of recordings, labels, and the recorder.

pub(super) mod clients;
pub(super) mod folder;
pub(super) mod indexed;
pub(super) mod labels;
pub(super) mod live_source;
pub(super) mod presets;
pub(super) mod recorder;

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};

use taxel_core::encode;
use taxel_core::wire::Registers;
use taxel_live::Result;
use taxel_live::capture::{FIREWALL, Origin};
use taxel_live::locked::lock;
use taxel_live::pipeline::{Counters, Handle};
use taxel_live::recording::now_ns;
use tokio::sync::{Notify, OwnedMutexGuard};

use super::handler::{Reply, RequestHandlers, UserPresets};
use super::options::PanelOptions;
use super::protocol::limits::{MOST_BYTES, MOST_CREDITS};
use super::protocol::messages::{ArrayInfo, FileInfo, Message};
use super::time_columns::{COLUMN_US, COLUMNS_US, SPAN};
use clients::{Broadcast, Clients};
use folder::{Folder, Listed};
use labels::LabelTables;
use live_source::LiveSource;
use recorder::RecorderControl;

/// How often new events are fetched from the live source.
const RECEIVE_EVERY: Duration = Duration::from_millis(16);

/// How often counters are sent.
const COUNT_EVERY: Duration = Duration::from_millis(250);

/// The board behind the live source, as far as the panel knows it.
#[derive(Debug, Default)]
pub(super) struct KnownBoard {
    /// Its serial line, where one is connected.
    pub(super) control: Option<String>,
    pub(super) registers: Registers,
    /// Whether the registers were read from the board.
    pub(super) known: bool,
}

/// The objects that all clients share.
pub(super) struct Hub {
    options: PanelOptions,
    handlers: Arc<RequestHandlers>,
    live: Mutex<Option<Arc<LiveSource>>>,
    board: Mutex<KnownBoard>,
    presets: Mutex<UserPresets>,
    /// See [`Hub::file_turn`].
    files: Arc<tokio::sync::Mutex<()>>,
    /// Resets that the board has reported on its serial line.
    resets: AtomicU64,
    pub(super) clients: Clients,
    pub(super) folder: Folder,
    pub(super) labels: LabelTables,
    pub(super) recorder: RecorderControl,
    /// Notified when the board was reset: its registers are to be read again.
    pub(super) registers_unknown: Notify,
}

impl Hub {
    pub(super) fn new(options: PanelOptions, live: Option<Handle>, handlers: RequestHandlers) -> Result<Arc<Self>> {
        let board = KnownBoard { control: options.control.clone(), ..KnownBoard::default() };
        let hub = Arc::new(Self {
            folder: Folder::new(options.folder.clone()),
            options,
            handlers: Arc::new(handlers),
            live: Mutex::default(),
            board: Mutex::new(board),
            presets: Mutex::default(),
            files: Arc::default(),
            resets: AtomicU64::new(0),
            clients: Clients::new(),
            labels: LabelTables::default(),
            recorder: RecorderControl::default(),
            registers_unknown: Notify::new(),
        });
        if let Some(live) = live {
            hub.attach(live)?;
        }
        Ok(hub)
    }

    /// Waits until no other request changes presets and writes their file. Requests run at the same time, so without
    /// this a file could end with the older of two changes.
    pub(super) async fn file_turn(&self) -> OwnedMutexGuard<()> {
        Arc::clone(&self.files).lock_owned().await
    }

    pub(super) fn options(&self) -> &PanelOptions {
        &self.options
    }

    /// Notes where the board's serial line is; its registers are to be read.
    pub(super) fn connected(&self, control: Option<String>) {
        {
            let mut board = self.board();
            (board.control, board.known) = (control, false);
        }
        self.clients.send(Broadcast::Hello);
        self.registers_unknown.notify_one();
    }

    /// Whether the board's registers were read or stated.
    pub(super) fn registers_certain(&self) -> bool {
        self.options.registers_stated || self.board().known
    }

    /// Shows another live source from now on.
    pub(super) fn attach(&self, handle: Handle) -> Result<()> {
        let noise_floor = {
            let mut board = self.board();
            if board.known {
                // It is the board whose registers were read: the other source begins with them.
                handle.announce_registers(board.registers);
            } else {
                board.registers = handle.registers();
            }
            board.registers.noise_floor
        };
        *lock(&self.live) = Some(Arc::new(LiveSource::new(handle, noise_floor)?));
        self.clients.send(Broadcast::Hello);
        self.clients.send_message(&self.zeroed_message());
        Ok(())
    }

    pub(super) fn live(&self) -> Option<Arc<LiveSource>> {
        lock(&self.live).clone()
    }

    pub(super) fn board(&self) -> MutexGuard<'_, KnownBoard> {
        lock(&self.board)
    }

    pub(super) fn presets(&self) -> MutexGuard<'_, UserPresets> {
        lock(&self.presets)
    }

    /// Makes a request of the program that started the panel, in a thread where it may block.
    pub(super) async fn ask<T: Send + 'static>(
        &self,
        request: impl FnOnce(&RequestHandlers) -> Reply<T> + Send + 'static,
    ) -> Reply<T> {
        let handlers = Arc::clone(&self.handlers);
        let answer = tokio::task::spawn_blocking(move || request(&handlers)).await;
        answer.unwrap_or_else(|_| Err("failed within taxel; please report it".to_owned()))
    }

    // ------------------------------------------------------------------------------------------ the live source

    /// Fetches new events from the live source and sends news of it to the clients; never returns.
    pub(super) async fn serve_live(self: Arc<Self>) {
        let (mut counted, mut before) = (Instant::now(), None);
        let mut reading_lines = None::<tokio::task::JoinHandle<()>>;
        let mut ticks = tokio::time::interval(RECEIVE_EVERY);
        ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
        loop {
            ticks.tick().await;
            let Some(live) = self.live() else {
                tokio::time::sleep(COUNT_EVERY).await;
                continue;
            };
            let has_clients = self.clients.count() > 0;
            let received = live.receive(has_clients);
            if received.reset {
                self.forget_registers();
            }
            for detection in &received.detections {
                self.clients.send_message(&Message::detection(detection));
            }
            if received.zeroed {
                self.clients.send_message(&self.zeroed_message());
            }
            if received.frame {
                self.clients.new_frame();
            }
            if counted.elapsed() < COUNT_EVERY {
                continue;
            }
            let counters = live.handle.counters();
            if let Some(offset) = counters.board.offset {
                live.follow_clock(offset);
            }
            if live.has_new_steps() {
                self.clients.send(Broadcast::Hello);
            }
            self.send_counters(&live, &counters, before.as_ref(), counted.elapsed().as_secs_f64());
            (counted, before) = (Instant::now(), Some(counters));
            self.clients.new_frame();
            let connected = self.board().control.is_some();
            if has_clients && connected && reading_lines.as_ref().is_none_or(tokio::task::JoinHandle::is_finished) {
                let hub = Arc::clone(&self);
                reading_lines = Some(tokio::spawn(async move { hub.read_board_lines().await }));
            }
        }
    }

    fn send_counters(&self, live: &LiveSource, now: &Counters, before: Option<&Counters>, seconds: f64) {
        let frame_us = self.registers_certain().then(|| self.board().registers.frame_us());
        let message = live.counters(now, before, seconds, frame_us, self.clients.count());
        self.clients.send(Broadcast::Counters(Box::new(message)));
    }

    /// After a reset the board holds other registers than were read.
    fn forget_registers(&self) {
        if std::mem::take(&mut self.board().known) {
            self.clients.send_message(&self.registers_message());
        }
        self.registers_unknown.notify_one();
    }

    /// Sends the new lines of the board's serial line to the clients.
    async fn read_board_lines(&self) {
        if let Ok(new) = self.ask(|handlers| handlers.board.board_lines()).await {
            for line in new.lines {
                self.clients.send_message(&Message::BoardLine { at_ns: now_ns(), text: line });
            }
            // With version 1 of the wire only the serial line reports a reset.
            if self.resets.swap(new.resets, Ordering::Relaxed) != new.resets && new.resets > 0 {
                self.forget_registers();
            }
        }
    }

    // ------------------------------------------------------------------------------------------ messages

    pub(super) fn hello_message(&self) -> Message {
        let live = self.live();
        let live = live.as_ref();
        Message::Hello {
            protocol: 1,
            taxel: env!("CARGO_PKG_VERSION"),
            live: live.is_some(),
            array: live.map(|live| ArrayInfo::from(live.array())),
            options: live.map(|live| Box::new(live.handle.options().clone())),
            udp: live.and_then(|live| match live.handle.origin() {
                Origin::Udp(address) => Some(address.to_string()),
                Origin::Frames(_) => None,
            }),
            firewall: FIREWALL,
            lines: live.and_then(|live| match live.handle.origin() {
                Origin::Frames(place) => Some(place.clone()),
                Origin::Udp(_) => None,
            }),
            source: live.and_then(|live| match live.handle.origin() {
                Origin::Frames(_) => live.handle.options().sources.first().cloned(),
                Origin::Udp(_) => None,
            }),
            sources: live.map(|live| live.handle.source_names()).unwrap_or_default(),
            frames: live.and_then(|live| live.frames()),
            delta_intensity: live.map(|live| live.handle.options().differences),
            control: self.board().control.clone(),
            folder: self.options.folder.display().to_string(),
            open: self.options.open.clone(),
            readout: live.and_then(|live| live.labels.clone()),
            readout_encoders: live.map(|live| live.encoders()).unwrap_or_default(),
            encoders: encode::NAMES,
            column_us: COLUMN_US,
            columns_us: COLUMNS_US,
            time_columns: SPAN,
            most_message_bytes: MOST_BYTES,
            most_credits: MOST_CREDITS,
        }
    }

    /// The taxels of the live source that were zeroed.
    pub(super) fn zeroed_message(&self) -> Message {
        let zeroed = self.live().map(|live| live.handle.latest_zeroings().0).unwrap_or_default();
        Message::zeroed(&zeroed)
    }

    pub(super) fn registers_message(&self) -> Message {
        let live = self.live();
        let (registers, known) = {
            let board = self.board();
            (board.registers, board.known)
        };
        let held = Registers { record: false, ..registers };
        let of_user = || presets::equal_to(&held, &self.presets().presets);
        Message::Registers {
            known,
            stated: self.options.registers_stated,
            values: registers,
            preset: presets::built_in_equal_to(&held, live.as_ref().map(|live| live.array())).or_else(of_user),
            frame_us: registers.frame_us(),
            warnings: registers.warnings(),
        }
    }

    pub(super) fn presets_message(&self) -> Message {
        let live = self.live();
        let held = self.board().registers;
        let built_in = presets::fitting(&held, live.as_ref().map(|live| live.array()));
        let UserPresets { path, presets } = self.presets().clone();
        Message::Presets {
            built_in: built_in.into_iter().map(|preset| preset.name).collect(),
            user: presets,
            path: path.display().to_string(),
        }
    }

    /// The recordings of the folder.
    pub(super) async fn recordings_message(&self) -> Message {
        let folder = self.folder.path().to_owned();
        let names = self.ask(move |handlers| handlers.files.recordings(&folder)).await.unwrap_or_else(|reason| {
            self.clients.send_message(&Message::warning(reason));
            vec![]
        });
        let files = self.folder.list(names).into_iter().map(|Listed { name, bytes, modified_ns }| {
            let labels = self.labels.count(&name);
            FileInfo { name, bytes, modified_ns, labels }
        });
        Message::Recordings {
            folder: self.folder.path().display().to_string(),
            files: files.collect(),
            readouts: self.folder.readouts(),
        }
    }
}
