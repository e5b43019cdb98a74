// HTTP and WebSocket for `octrad view`: who may connect, what is sent when, and what is bounded. What is said is in
// protocol.h. By Boost.Beast; docs/viewer.md has the rules.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace octrad::viewer {

using ClientId = std::uint32_t;  // 1, 2, ... as they come; 0: none

// A message with a picture, for all clients alike.
struct Frame {
  long long number = 0;  // rising
  std::string bytes;
};

struct ServerLimits {
  int clients = 8;                      // that watch or control
  int connections = 64;                 // of any kind
  std::size_t message = 65536;          // bytes that a client may send at once
  double messages_a_second = 500.0;     // of a client, on average; it is read more slowly above
  std::size_t unread = 256;             // texts that wait for a client before it is dropped
  std::size_t unread_bytes = 16 << 20;  // and their bytes
  double request_seconds = 15.0;        // for a request to arrive, the next part of an answer to be taken
};

struct ServerOptions {
  std::string address = "127.0.0.1";
  int port = 0;       // 0: a free one
  std::string token;  // that everything but the page needs
  ServerLimits limits = {};
};

// A file that is sent once.
struct Download {
  int status = 200;
  std::string type = "text/plain; charset=utf-8", name = {}, body;
  std::shared_ptr<void> held = {};  // released when it is sent, or its client is gone
};

// What a server asks. All functions are called by the server's thread, one at a time, and must not take long.
class ServerHandler {
 public:
  virtual ~ServerHandler() = default;
  virtual void opened(ClientId client) = 0;
  virtual void closed(ClientId client) = 0;
  virtual void message(ClientId client, const std::string& text) = 0;
  // The file at `path` ("/picture-a.png"), of a request with the token. Calls `answer`, now or later, in any thread;
  // `answer` must be gone before the server is.
  virtual void download(const std::string& path, std::function<void(Download)> answer) = 0;
};

// Serves from start() to stop() or destruction, in a thread of its own.
class WebServer {
 public:
  // Throws UsageError for what is no numeric address, IoError where it cannot be listened to.
  WebServer(const ServerOptions& options, ServerHandler& handler);
  ~WebServer();
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;

  void start();

  int port() const;
  // Address of the page with the token, which stays in the browser: it stands behind a #.
  std::string url() const;
  // Milliseconds that the last frame took from being handed to a socket until the system had all of it.
  double last_send_ms() const;

  // All of these may be called from any thread.
  void send(ClientId client, std::string text);
  void broadcast(const std::string& text);
  // Each client gets the newest frame once it has acknowledged its last one; those between are dropped for it.
  void publish(std::shared_ptr<const Frame> frame);
  void acknowledge(ClientId client, long long frame);
  // Closes the connections of the clients and ends; the destructor does it too.
  void stop();

  struct Impl;

 private:
  std::shared_ptr<Impl> impl_;
};

// Whether a browser that sends these headers shows our own page: `host` names this machine as it is listened to
// (`address`, or by a loopback name where that is reached), and `origin` (empty: no browser) is http:// with that host.
// A port may differ from ours: that of a tunnel (ssh -L).
bool is_own_page(const std::string& address, std::string_view host, std::string_view origin);

// Whether only this machine reaches an address.
bool is_loopback(const std::string& address);

}  // namespace octrad::viewer
