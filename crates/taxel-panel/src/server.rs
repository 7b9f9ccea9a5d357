//! The HTTP server: the page's files for every program on this machine, the web socket for those that have the token.

mod connections;

use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use axum::Router;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{FromRequestParts, Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use tokio::sync::watch;

use super::assets::asset;
use super::handler::RequestHandlers;
use super::hub::Hub;
use super::options::PanelOptions;
use super::protocol::limits::MOST_BYTES;
use super::requests::registers::prepare;
use super::requests::{labels, opening};
use super::session;
use connections::LimitedListener;
use taxel_live::pipeline::Handle;
use taxel_live::{Error, Result};

/// The subprotocol, and the prefix of the one that carries the token.
const PROTOCOL: &str = "taxel.panel.1";
const TOKEN: &str = "token.";

/// Maximum number of clients.
const MOST_CLIENTS: usize = 128;

/// Content security policy: scripts and styles from this server only; the page may make pictures (PNG) itself.
const POLICY: &str = "default-src 'self'; img-src 'self' blob: data:; object-src 'none'; base-uri 'none'; \
                      form-action 'none'; frame-ancestors 'none'";

/// The panel's server, from [`Panel::start`] until it is dropped.
pub struct Panel {
    hub: Arc<Hub>,
    address: SocketAddr,
    token: String,
    end: watch::Sender<bool>,
    thread: Option<JoinHandle<()>>,
}

/// What the handlers of HTTP requests need.
struct Gate {
    hub: Arc<Hub>,
    token: String,
    /// Accepted values of the header `Host`.
    hosts: Vec<String>,
    end: watch::Receiver<bool>,
}

impl Panel {
    /// Opens the port and serves a live source, where there is one, and the recordings of the folder.
    ///
    /// # Errors
    ///
    /// `Socket` where the port is taken, `File` where the folder does not exist, or the system gives no random numbers.
    pub fn start(options: PanelOptions, live: Option<Handle>, handlers: RequestHandlers) -> Result<Self> {
        let folder = options.folder.canonicalize().map_err(Error::file(&options.folder))?;
        let name = format!("panel {}", options.address);
        let listener = std::net::TcpListener::bind(options.address).map_err(Error::socket(&name))?;
        listener.set_nonblocking(true).map_err(Error::socket(&name))?;
        let address = listener.local_addr().map_err(Error::socket(&name))?;
        let token = token()?;
        let hub = Hub::new(PanelOptions { folder, address, ..options }, live, handlers)?;
        let (end, ended) = watch::channel(false);
        let gate = Arc::new(Gate { hub: Arc::clone(&hub), token: token.clone(), hosts: hosts(address), end: ended });
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .max_blocking_threads(8)
            .build()
            .map_err(Error::socket(&name))?;
        let thread = std::thread::Builder::new()
            .name("taxel-panel".to_owned())
            .spawn(move || {
                runtime.block_on(serve(listener, gate));
                runtime.shutdown_timeout(Duration::from_secs(2));
            })
            .map_err(Error::socket(&name))?;
        Ok(Self { hub, address, token, end, thread: Some(thread) })
    }

    /// The address on which it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The token with which a client opens the web socket.
    #[must_use]
    pub fn token(&self) -> &str {
        &self.token
    }

    /// The address for a browser. The token is in the fragment, which browsers do not send, so that it is in no log.
    #[must_use]
    pub fn url(&self) -> String {
        let open = self.hub.options().open.as_ref();
        let open = open.map_or_else(String::new, |name| format!("&open={}", escaped(name)));
        format!("http://{}/#token={}{open}", shown(self.address), self.token)
    }

    /// Shows another live source from now on.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where it has ended.
    pub fn attach(&self, live: Handle) -> Result<()> {
        self.hub.attach(live)
    }

    /// Notes that the request handler has connected the board's serial line, or disconnected it.
    pub fn connected(&self, control: Option<String>) {
        self.hub.connected(control);
    }

    /// Number of connected clients.
    #[must_use]
    pub fn viewers(&self) -> usize {
        self.hub.clients.count()
    }
}

impl Drop for Panel {
    fn drop(&mut self) {
        self.end.send_replace(true);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// 256 random bits from the system, as hexadecimal digits.
fn token() -> Result<String> {
    let mut bytes = [0; 32];
    let path = std::path::Path::new("/dev/urandom");
    let mut file = std::fs::File::open(path).map_err(Error::file(path))?;
    std::io::Read::read_exact(&mut file, &mut bytes).map_err(Error::file(path))?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// The address for a browser: loopback, where the server listens on every address of this machine.
fn shown(address: SocketAddr) -> SocketAddr {
    match address.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => (std::net::Ipv4Addr::LOCALHOST, address.port()).into(),
        IpAddr::V6(ip) if ip.is_unspecified() => (std::net::Ipv6Addr::LOCALHOST, address.port()).into(),
        _ => address,
    }
}

/// Accepted values of the header `Host`. Where the server listens on every address, [`Gate::accepts`] also accepts any IP
/// address; names are refused, because another site's name may resolve to this machine.
fn hosts(address: SocketAddr) -> Vec<String> {
    let mut hosts = vec![shown(address).to_string()];
    if shown(address).ip().is_loopback() {
        hosts.push(format!("localhost:{}", address.port()));
    }
    hosts
}

fn escaped(name: &str) -> String {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"._-".contains(&byte);
    name.bytes().map(|byte| if plain(byte) { char::from(byte).to_string() } else { format!("%{byte:02X}") }).collect()
}

async fn serve(listener: std::net::TcpListener, gate: Arc<Gate>) {
    let Ok(listener) = tokio::net::TcpListener::from_std(listener) else { return };
    let live = tokio::spawn(Arc::clone(&gate.hub).serve_live());
    let hub = Arc::clone(&gate.hub);
    let reads = tokio::spawn(async move {
        loop {
            hub.registers_unknown.notified().await;
            prepare(&hub).await;
        }
    });
    let followed = tokio::spawn(labels::follow(Arc::clone(&gate.hub)));
    // The recording to show first is read while the browser starts; the client that opens it gets the error, if any.
    let hub = Arc::clone(&gate.hub);
    let first = tokio::spawn(async move {
        if let Some(name) = &hub.options().open {
            let _ = opening::index(&hub, name, None).await;
        }
    });
    let mut end = gate.end.clone();
    let app = Router::new().fallback(respond).with_state(gate);
    let ended = async move {
        let _ = end.wait_for(|ended| *ended).await;
        // Time for the sessions to send their close frames.
        tokio::time::sleep(Duration::from_millis(200)).await;
    };
    tokio::select! {
        _ = std::future::IntoFuture::into_future(axum::serve(LimitedListener::new(listener), app)) => {}
        () = ended => {}
    }
    live.abort();
    reads.abort();
    followed.abort();
    first.abort();
}

async fn respond(State(gate): State<Arc<Gate>>, request: Request) -> Response {
    let mut response = answer(&gate, request).await;
    let headers = response.headers_mut();
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

/// The value of a header that occurs exactly once.
fn header_value<'a>(headers: &'a HeaderMap, name: &header::HeaderName) -> Option<&'a str> {
    let mut values = headers.get_all(name).iter();
    let value = values.next()?.to_str().ok()?;
    values.next().is_none().then_some(value)
}

impl Gate {
    fn accepts(&self, host: &str) -> bool {
        let anywhere = self.hub.options().address.ip().is_unspecified();
        self.hosts.iter().any(|known| known == host)
            || anywhere
                && host.parse::<SocketAddr>().is_ok_and(|address| address.port() == self.hub.options().address.port())
    }
}

async fn answer(gate: &Arc<Gate>, request: Request) -> Response {
    let headers = request.headers();
    let Some(host) = header_value(headers, &header::HOST).filter(|host| gate.accepts(host)).map(str::to_owned) else {
        return StatusCode::MISDIRECTED_REQUEST.into_response();
    };
    if !matches!(*request.method(), Method::GET | Method::HEAD) {
        return StatusCode::METHOD_NOT_ALLOWED.into_response();
    }
    let path = request.uri().path().to_owned();
    if path == "/socket" {
        return socket(gate, &host, request).await;
    }
    let name = if path == "/" { "index.html" } else { path.strip_prefix('/').unwrap_or_default() };
    match asset(name) {
        Some(asset) => match asset.read() {
            Ok(bytes) => ([(header::CONTENT_TYPE, asset.media)], bytes).into_response(),
            Err(error) => (StatusCode::INTERNAL_SERVER_ERROR, format!("{name}: {error}")).into_response(),
        },
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

async fn socket(gate: &Arc<Gate>, host: &str, request: Request) -> Response {
    let headers = request.headers();
    if header_value(headers, &header::ORIGIN).is_none_or(|origin| origin != format!("http://{host}")) {
        return StatusCode::FORBIDDEN.into_response();
    }
    let offered = header_value(headers, &header::SEC_WEBSOCKET_PROTOCOL).unwrap_or_default();
    let offered: Vec<&str> = offered.split(',').map(str::trim).collect();
    let right = |text: &&str| text.strip_prefix(TOKEN).is_some_and(|token| same(token, &gate.token));
    if !offered.contains(&PROTOCOL) || !offered.iter().any(right) {
        return StatusCode::UNAUTHORIZED.into_response();
    }
    let Some(slot) = gate.hub.clients.admit(MOST_CLIENTS) else {
        return StatusCode::SERVICE_UNAVAILABLE.into_response();
    };
    let (mut parts, _) = request.into_parts();
    match WebSocketUpgrade::from_request_parts(&mut parts, &()).await {
        Ok(upgrade) => {
            let (hub, end) = (Arc::clone(&gate.hub), gate.end.clone());
            upgrade
                .protocols([PROTOCOL])
                // A message that is a little too long gets a close frame; a far longer one is not even read to its end.
                .max_message_size(2 * MOST_BYTES)
                .max_frame_size(2 * MOST_BYTES)
                .write_buffer_size(0)
                .on_upgrade(move |socket| session::run(socket, hub, end, slot))
        }
        Err(refused) => refused.into_response(),
    }
}

/// Compares in a time that does not depend on where the texts differ.
fn same(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).fold(0, |differ, (a, b)| differ | (a ^ b)) == 0
}
