//! Who may come in: the page's files for everybody on this machine, the socket for who has the token.

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

use super::assets::ASSETS;
use super::guests::Guests;
use super::hub::{Hub, Office};
use super::limits::MOST_BYTES;
use super::options::PanelOptions;
use super::requests::prepare;
use super::session;
use crate::pipeline::Handle;
use crate::{Error, Result};

/// The subprotocol, and how the one begins that brings the token.
const PROTOCOL: &str = "taxel.panel.1";
const TOKEN: &str = "token.";

/// Who may look at a time.
const MOST_VIEWERS: usize = 128;

/// Scripts and styles from here, nothing from elsewhere; pictures may be made in the page (PNG).
const POLICY: &str = "default-src 'self'; img-src 'self' blob: data:; object-src 'none'; base-uri 'none'; \
                      form-action 'none'; frame-ancestors 'none'";

/// The server, from [`Panel::start`] until it is dropped.
pub struct Panel {
    hub: Arc<Hub>,
    address: SocketAddr,
    token: String,
    end: watch::Sender<bool>,
    thread: Option<JoinHandle<()>>,
}

struct Door {
    hub: Arc<Hub>,
    token: String,
    hosts: Vec<String>,
    end: watch::Receiver<bool>,
}

impl Panel {
    /// Opens the port and begins to serve: a live source, where there is one, and the folder's recordings.
    ///
    /// # Errors
    ///
    /// `Socket` where the port is taken, `File` where the folder is not there, or the system gives no random numbers.
    pub fn start(options: PanelOptions, live: Option<Handle>, office: Box<dyn Office>) -> Result<Self> {
        let folder = options.folder.canonicalize().map_err(Error::file(&options.folder))?;
        let place = format!("panel {}", options.address);
        let listener = std::net::TcpListener::bind(options.address).map_err(Error::socket(&place))?;
        listener.set_nonblocking(true).map_err(Error::socket(&place))?;
        let address = listener.local_addr().map_err(Error::socket(&place))?;
        let token = token()?;
        let hub = Hub::new(PanelOptions { folder, address, ..options }, live, office)?;
        let (end, ended) = watch::channel(false);
        let door = Arc::new(Door { hub: Arc::clone(&hub), token: token.clone(), hosts: hosts(address), end: ended });
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .max_blocking_threads(8)
            .build()
            .map_err(Error::socket(&place))?;
        let thread = std::thread::Builder::new()
            .name("taxel-panel".to_owned())
            .spawn(move || {
                runtime.block_on(serve(listener, door));
                runtime.shutdown_timeout(Duration::from_secs(2));
            })
            .map_err(Error::socket(&place))?;
        Ok(Self { hub, address, token, end, thread: Some(thread) })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// What opens the socket.
    #[must_use]
    pub fn token(&self) -> &str {
        &self.token
    }

    /// What a person opens: the token stands where no log sees it.
    #[must_use]
    pub fn url(&self) -> String {
        let open = self.hub.options().open.as_ref();
        let open = open.map_or_else(String::new, |name| format!("&open={}", escaped(name)));
        format!("http://{}/#token={}{open}", shown(self.address), self.token)
    }

    /// Shows another live source from here on.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where it has ended.
    pub fn attach(&self, live: Handle) -> Result<()> {
        self.hub.attach(live)
    }

    /// How many look.
    #[must_use]
    pub fn viewers(&self) -> usize {
        self.hub.viewers()
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

/// 256 random bits of the system, in hexadecimal digits.
fn token() -> Result<String> {
    let mut bytes = [0; 32];
    let path = std::path::Path::new("/dev/urandom");
    let mut file = std::fs::File::open(path).map_err(Error::file(path))?;
    std::io::Read::read_exact(&mut file, &mut bytes).map_err(Error::file(path))?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// The address as a browser writes it; every address of this machine is said as the one that always is.
fn shown(address: SocketAddr) -> SocketAddr {
    match address.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => (std::net::Ipv4Addr::LOCALHOST, address.port()).into(),
        IpAddr::V6(ip) if ip.is_unspecified() => (std::net::Ipv6Addr::LOCALHOST, address.port()).into(),
        _ => address,
    }
}

/// What `Host` may say; on every address whatever is an address (a name could be another site's, pointed here).
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

async fn serve(listener: std::net::TcpListener, door: Arc<Door>) {
    let Ok(listener) = tokio::net::TcpListener::from_std(listener) else { return };
    let pump = tokio::spawn(Arc::clone(&door.hub).pump());
    let hub = Arc::clone(&door.hub);
    let reads = tokio::spawn(async move {
        loop {
            hub.unknown.notified().await;
            prepare(&hub).await;
        }
    });
    let mut end = door.end.clone();
    let app = Router::new().fallback(enter).with_state(door);
    let ended = async move {
        let _ = end.wait_for(|ended| *ended).await;
        // Whoever still looks hears that it is over; nobody is waited for long.
        tokio::time::sleep(Duration::from_millis(200)).await;
    };
    tokio::select! {
        _ = std::future::IntoFuture::into_future(axum::serve(Guests::new(listener), app)) => {}
        () = ended => {}
    }
    pump.abort();
    reads.abort();
}

async fn enter(State(door): State<Arc<Door>>, request: Request) -> Response {
    let mut response = answer(&door, request).await;
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

fn said<'a>(headers: &'a HeaderMap, name: &header::HeaderName) -> Option<&'a str> {
    let mut all = headers.get_all(name).iter();
    let one = all.next()?.to_str().ok()?;
    all.next().is_none().then_some(one)
}

impl Door {
    fn knows(&self, host: &str) -> bool {
        let anywhere = self.hub.options().address.ip().is_unspecified();
        self.hosts.iter().any(|known| known == host)
            || anywhere
                && host.parse::<SocketAddr>().is_ok_and(|address| address.port() == self.hub.options().address.port())
    }
}

async fn answer(door: &Arc<Door>, request: Request) -> Response {
    let headers = request.headers();
    let Some(host) = said(headers, &header::HOST).filter(|host| door.knows(host)).map(str::to_owned) else {
        return StatusCode::MISDIRECTED_REQUEST.into_response();
    };
    if !matches!(*request.method(), Method::GET | Method::HEAD) {
        return StatusCode::METHOD_NOT_ALLOWED.into_response();
    }
    let path = request.uri().path().to_owned();
    if path == "/socket" {
        return socket(door, &host, request).await;
    }
    let name = if path == "/" { "index.html" } else { path.strip_prefix('/').unwrap_or_default() };
    match ASSETS.iter().find(|asset| asset.name == name) {
        Some(asset) => ([(header::CONTENT_TYPE, asset.media)], asset.bytes).into_response(),
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

async fn socket(door: &Arc<Door>, host: &str, request: Request) -> Response {
    let headers = request.headers();
    if said(headers, &header::ORIGIN).is_none_or(|origin| origin != format!("http://{host}")) {
        return StatusCode::FORBIDDEN.into_response();
    }
    let offered = said(headers, &header::SEC_WEBSOCKET_PROTOCOL).unwrap_or_default();
    let offered: Vec<&str> = offered.split(',').map(str::trim).collect();
    let right = |text: &&str| text.strip_prefix(TOKEN).is_some_and(|token| same(token, &door.token));
    if !offered.contains(&PROTOCOL) || !offered.iter().any(right) {
        return StatusCode::UNAUTHORIZED.into_response();
    }
    let Some(seat) = door.hub.sit(MOST_VIEWERS) else {
        return StatusCode::SERVICE_UNAVAILABLE.into_response();
    };
    let (mut parts, _) = request.into_parts();
    match WebSocketUpgrade::from_request_parts(&mut parts, &()).await {
        Ok(upgrade) => {
            let (hub, end) = (Arc::clone(&door.hub), door.end.clone());
            upgrade
                .protocols([PROTOCOL])
                // What is a little too long is answered; of what is far too long not even the beginning is kept.
                .max_message_size(4 * MOST_BYTES)
                .max_frame_size(4 * MOST_BYTES)
                .write_buffer_size(0)
                .on_upgrade(move |socket| session::run(socket, hub, end, seat))
        }
        Err(refused) => refused.into_response(),
    }
}

/// Compares in a time that does not tell where they differ.
fn same(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).fold(0, |differ, (a, b)| differ | (a ^ b)) == 0
}
