//! A server for one page on this machine: serves the page, and a web socket to it.
//!
//! It listens on the loopback address only. A random token in the address keeps other users and other pages out,
//! `Host` and `Origin` are checked, and no part of a request is used as a path. A client without the token can hold
//! only a few connections for a short time, and the oldest of them are closed first.

mod admission;

use std::io::{self, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use sha1::{Digest, Sha1};
use tempfile::NamedTempFile;
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Message, WebSocket};

use admission::WaitingRoom;
use bodyflight_io::diagnostic::{Problem, Result};

/// Longest message from the page (bytes): twenty minutes of flight.
const LONGEST_MESSAGE: usize = 320 << 20;

/// Messages that may wait for a slow page; later ones are dropped.
const WAITING: usize = 64;

/// Timeouts for a whole answer and for one message to a page, and the time between checks for messages to send.
const ANSWER_TIME: Duration = Duration::from_secs(30);
const PATIENCE: Duration = Duration::from_secs(5);
const TURN: Duration = Duration::from_millis(5);

/// Largest number of pages that may listen at once.
const MOST_PAGES: usize = 16;

/// Pause after the system has refused a connection or a thread, to let it recover.
const BREATH: Duration = Duration::from_millis(50);

/// Headers of every answer: do not cache, do not show in another page, do not guess the type, do not send a referrer.
const HEADERS: &str = "Cache-Control: no-store\r\nContent-Security-Policy: frame-ancestors 'none'\r\n\
    Cross-Origin-Opener-Policy: same-origin\r\nCross-Origin-Resource-Policy: same-origin\r\n\
    Referrer-Policy: no-referrer\r\nX-Content-Type-Options: nosniff\r\nX-Frame-Options: DENY\r\nConnection: close";

/// Answers a binary message of the page with a text.
pub type Answer = dyn Fn(Vec<u8>) -> String + Send + Sync;

/// The server; it runs until the process ends.
pub struct Server {
    address: SocketAddr,
    token: String,
    listeners: Arc<Mutex<Vec<SyncSender<Message>>>>,
}

struct Shared {
    page: String,
    token: String,
    address: SocketAddr,
    answer: Box<Answer>,
    listeners: Arc<Mutex<Vec<SyncSender<Message>>>>,
    waiting_room: WaitingRoom,
}

impl Server {
    /// Starts serving `page` on a free port. `answer` handles the binary messages from the page.
    ///
    /// # Errors
    /// Returns an error if no port is free, or the system provides no random numbers.
    pub fn start(page: String, answer: Box<Answer>) -> Result<Self> {
        let refused = |what: &str| Problem::refused(format!("cannot {what} for the page"));
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))
            .map_err(|error| refused("open a port").caused_by(error))?;
        let address = listener
            .local_addr()
            .map_err(|error| refused("open a port").caused_by(error))?;
        let mut random = [0; 16];
        getrandom::fill(&mut random).map_err(|error| refused("draw a token").caused_by(error))?;
        let token: String = random.iter().map(|byte| format!("{byte:02x}")).collect();
        let listeners = Arc::default();
        let shared = Arc::new(Shared {
            page,
            token: token.clone(),
            address,
            answer,
            listeners: Arc::clone(&listeners),
            waiting_room: WaitingRoom::default(),
        });
        std::thread::Builder::new()
            .spawn(move || accept(&listener, &shared))
            .map_err(|error| refused("start a thread").caused_by(error))?;
        Ok(Self {
            address,
            token,
            listeners,
        })
    }

    /// The page's address.
    pub fn url(&self) -> String {
        format!("http://{}/{}/", self.address, self.token)
    }

    /// A file, readable by this user only, that leads a browser to the page. An address in the browser's arguments
    /// would show the token to everybody on the machine. The file is removed on drop.
    ///
    /// # Errors
    /// Returns an error if the file cannot be created.
    pub fn doorway(&self) -> Result<NamedTempFile> {
        let folder = std::env::temp_dir();
        let refused = |error| Problem::system("create", &folder, error);
        let mut file = tempfile::Builder::new()
            .prefix("bodyflight-")
            .suffix(".html")
            .tempfile()
            .map_err(refused)?;
        let url = self.url();
        writeln!(
            file,
            "<!doctype html><meta http-equiv=\"refresh\" content=\"0; url={url}\"><a href=\"{url}\">bodyflight</a>"
        )
        .and_then(|()| file.flush())
        .map_err(refused)?;
        Ok(file)
    }

    /// Number of connected pages.
    pub fn listening(&self) -> usize {
        self.listeners
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .len()
    }

    /// Sends a message to every connected page; pages that lag behind miss it.
    pub fn send(&self, message: &Message) {
        self.listeners
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .retain(|listener| {
                !matches!(
                    listener.try_send(message.clone()),
                    Err(TrySendError::Disconnected(_))
                )
            });
    }
}

/// Accepts connections until the process ends.
fn accept(listener: &TcpListener, shared: &Arc<Shared>) {
    loop {
        let begun = listener.accept().and_then(|(stream, _)| {
            let shared = Arc::clone(shared);
            // A failed connection does not affect the others.
            std::thread::Builder::new().spawn(move || shared.serve(stream))
        });
        if begun.is_err() {
            std::thread::sleep(BREATH);
        }
    }
}

impl Shared {
    fn serve(&self, mut stream: TcpStream) -> io::Result<()> {
        let head = self.waiting_room.read_head(&mut stream)?;
        match self.judge(&head) {
            Request::Page => answer(
                &mut stream,
                "200 OK",
                "text/html; charset=utf-8",
                &self.page,
            ),
            Request::Socket(_) if self.pages() >= MOST_PAGES => answer(
                &mut stream,
                "503 Service Unavailable",
                "text/plain; charset=utf-8",
                "too many pages are already connected",
            ),
            Request::Socket(key) => {
                let accept = accept_key(&key);
                write!(
                    stream,
                    "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: {accept}\r\n\r\n"
                )?;
                self.talk(stream)
            }
            Request::Refused(status, reason) => {
                answer(&mut stream, status, "text/plain; charset=utf-8", reason)
            }
        }
    }

    fn pages(&self) -> usize {
        let listeners = self.listeners.lock();
        listeners.unwrap_or_else(PoisonError::into_inner).len()
    }

    fn judge(&self, head: &[u8]) -> Request {
        let mut headers = [httparse::EMPTY_HEADER; 64];
        let mut request = httparse::Request::new(&mut headers);
        if !matches!(request.parse(head), Ok(httparse::Status::Complete(_))) {
            return Request::Refused("400 Bad Request", "this is not an HTTP request");
        }
        let path = request.path.unwrap_or_default();
        let method = request.method.unwrap_or_default();
        let header = |name: &str| {
            let mut all = request.headers.iter();
            let found = all.find(|header| header.name.eq_ignore_ascii_case(name));
            found.and_then(|header| std::str::from_utf8(header.value).ok())
        };
        let host = self.address.to_string();
        // Another host name for this address means DNS rebinding.
        if header("host") != Some(&host) {
            return Request::Refused("403 Forbidden", "this page is available at 127.0.0.1 only");
        }
        let origin = header("origin");
        if origin.is_some_and(|origin| origin != format!("http://{host}")) {
            return Request::Refused("403 Forbidden", "another page may not talk to this one");
        }
        if method != "GET" {
            return Request::Refused("405 Method Not Allowed", "GET only");
        }
        let (token, rest) = path
            .strip_prefix('/')
            .unwrap_or(path)
            .split_at_checked(self.token.len())
            .unwrap_or_default();
        if !is_same(token, &self.token) {
            return Request::Refused("404 Not Found", "use the address that the program printed");
        }
        if rest == "/" {
            return Request::Page;
        }
        if rest == "/socket" {
            // Browsers always send the origin of a socket.
            return match (header("sec-websocket-key"), origin) {
                (Some(key), Some(_)) => Request::Socket(key.to_owned()),
                _ => Request::Refused("400 Bad Request", "this address is for the page's socket"),
            };
        }
        Request::Refused("404 Not Found", "use the address that the program printed")
    }

    fn talk(&self, stream: TcpStream) -> io::Result<()> {
        stream.set_read_timeout(Some(TURN))?;
        stream.set_write_timeout(Some(PATIENCE))?;
        let config = WebSocketConfig::default()
            .max_message_size(Some(LONGEST_MESSAGE))
            .max_frame_size(Some(LONGEST_MESSAGE));
        let mut socket = WebSocket::from_raw_socket(stream, Role::Server, Some(config));
        let (sender, waiting) = sync_channel(WAITING);
        self.listeners
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(sender);
        self.exchange(&mut socket, &waiting)
            .map_err(io::Error::other)
    }

    fn exchange(
        &self,
        socket: &mut WebSocket<TcpStream>,
        waiting: &Receiver<Message>,
    ) -> core::result::Result<(), Box<tungstenite::Error>> {
        loop {
            for message in waiting.try_iter() {
                socket.write(message)?;
            }
            socket.flush()?;
            match socket.read() {
                Ok(Message::Binary(bytes)) => {
                    let text = (self.answer)(bytes.into());
                    socket.send(Message::text(text))?;
                }
                Ok(Message::Close(_)) => return Ok(()),
                Ok(_) => {}
                Err(tungstenite::Error::Io(error))
                    if matches!(
                        error.kind(),
                        io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut
                    ) => {}
                Err(error) => return Err(Box::new(error)),
            }
        }
    }
}

enum Request {
    Page,
    Socket(String),
    Refused(&'static str, &'static str),
}

/// The answer to a browser's key (RFC 6455, section 1.3).
fn accept_key(key: &str) -> String {
    let digest = Sha1::new()
        .chain_update(key)
        .chain_update("258EAFA5-E914-47DA-95CA-C5AB0DC85B11")
        .finalize();
    BASE64_STANDARD.encode(digest)
}

/// Compares in constant time.
fn is_same(one: &str, other: &str) -> bool {
    let differences = one.bytes().zip(other.bytes()).map(|(a, b)| a ^ b);
    one.len() == other.len() && differences.fold(0, |all, difference| all | difference) == 0
}

fn answer(stream: &mut TcpStream, status: &str, kind: &str, body: &str) -> io::Result<()> {
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\n{HEADERS}\r\n\r\n",
        body.len()
    );
    let end = Instant::now() + ANSWER_TIME;
    for mut rest in [head.as_bytes(), body.as_bytes()] {
        while !rest.is_empty() {
            stream.set_write_timeout(Some(admission::left_until(end)?))?;
            let written = stream.write(rest)?;
            if written == 0 {
                return Err(io::ErrorKind::WriteZero.into());
            }
            rest = rest.get(written..).unwrap_or_default();
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;

    fn server() -> Server {
        let answer = |bytes: Vec<u8>| format!("{} bytes", bytes.len());
        Server::start("<p>page".to_owned(), Box::new(answer)).unwrap()
    }

    fn asked(server: &Server, head: &str) -> String {
        let mut stream = TcpStream::connect(server.address).unwrap();
        stream
            .write_all(format!("{head}\r\n\r\n").as_bytes())
            .unwrap();
        let mut text = String::new();
        stream.read_to_string(&mut text).unwrap();
        text
    }

    #[test]
    fn the_page_needs_the_token_and_the_right_host_name() {
        let server = server();
        let (host, token) = (server.address, &server.token);
        let page = asked(&server, &format!("GET /{token}/ HTTP/1.1\r\nHost: {host}"));
        assert!(page.starts_with("HTTP/1.1 200") && page.ends_with("<p>page"));
        for (head, status) in [
            (format!("GET / HTTP/1.1\r\nHost: {host}"), 404),
            (format!("GET /{token}/../x HTTP/1.1\r\nHost: {host}"), 404),
            (format!("GET /{token}/ HTTP/1.1\r\nHost: evil.example"), 403),
            (
                format!("GET /{token}/ HTTP/1.1\r\nHost: {host}\r\nOrigin: http://evil.example"),
                403,
            ),
            (format!("POST /{token}/ HTTP/1.1\r\nHost: {host}"), 405),
            (format!("GET /{token}/socket HTTP/1.1\r\nHost: {host}"), 400),
            ("nonsense".to_owned(), 400),
        ] {
            let text = asked(&server, &head);
            assert!(
                text.starts_with(&format!("HTTP/1.1 {status}")),
                "{head}: {text}"
            );
        }
    }

    #[test]
    fn no_other_page_may_embed_the_page() {
        let server = server();
        let head = format!(
            "GET /{}/ HTTP/1.1\r\nHost: {}",
            server.token, server.address
        );
        let text = asked(&server, &head);
        for header in [
            "X-Frame-Options: DENY",
            "frame-ancestors 'none'",
            "X-Content-Type-Options: nosniff",
            "Cross-Origin-Resource-Policy: same-origin",
        ] {
            assert!(text.contains(header), "{header}: {text}");
        }
    }

    #[test]
    fn slow_clients_lock_nobody_out() {
        let server = server();
        let slow: Vec<TcpStream> = (0..400)
            .map(|_| {
                let mut stream = TcpStream::connect(server.address).unwrap();
                let _ = stream.write_all(b"GET / HT");
                stream
            })
            .collect();
        let head = format!(
            "GET /{}/ HTTP/1.1\r\nHost: {}",
            server.token, server.address
        );
        assert!(asked(&server, &head).starts_with("HTTP/1.1 200"));
        drop(slow);
    }

    #[test]
    fn an_occasional_byte_does_not_keep_a_connection_open() {
        let server = server();
        let begin = Instant::now();
        let mut stream = TcpStream::connect(server.address).unwrap();
        stream.set_nodelay(true).unwrap();
        let mut head = b"GET / HTTP/1.1\r\nX: "
            .iter()
            .chain(std::iter::repeat(&b'a'));
        while stream.write_all(&[*head.next().unwrap()]).is_ok() {
            assert!(begin.elapsed() < Duration::from_secs(20), "still open");
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    #[test]
    fn only_this_user_can_read_the_link_for_the_browser() {
        let server = server();
        let door = server.doorway().unwrap();
        let text = std::fs::read_to_string(door.path()).unwrap();
        assert!(text.contains(&server.url()));
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let mode = door.as_file().metadata().unwrap().permissions().mode();
            assert_eq!(mode & 0o077, 0, "{mode:o}");
        }
    }

    #[test]
    fn a_page_receives_and_sends_messages() {
        let server = server();
        let url = server.url().replace("http", "ws") + "socket";
        let mut request = tungstenite::client::IntoClientRequest::into_client_request(url).unwrap();
        let origin = format!("http://{}", server.address);
        request
            .headers_mut()
            .insert("origin", origin.parse().unwrap());
        let (mut socket, _) = tungstenite::connect(request).unwrap();
        while server.listening() == 0 {
            std::thread::sleep(Duration::from_millis(1));
        }
        server.send(&Message::text("hello"));
        assert_eq!(socket.read().unwrap().into_text().unwrap(), "hello");
        socket.send(Message::binary(vec![0; 70_000])).unwrap();
        assert_eq!(socket.read().unwrap().into_text().unwrap(), "70000 bytes");
    }
}
