#include "app/view/web_server.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <boost/asio/bind_executor.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <thread>

#include "app/view/page.h"
#include "octrad/base/error.h"
#include "octrad/base/log.h"
#include "octrad/base/lower_case.h"
#include "octrad/base/random_seed.h"
#include "octrad/base/stopwatch.h"

namespace octrad::viewer {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using boost::system::error_code;
using tcp = asio::ip::tcp;
using std::chrono::duration;
using std::chrono::duration_cast;
using Clock = std::chrono::steady_clock;

constexpr std::uint32_t kLargestHeader = 8192;  // bytes of a request
constexpr int kMostRequests = 200;              // over one connection

// In time that does not depend on where they differ.
bool same_secret(std::string_view a, std::string_view b) {
  unsigned difference = a.size() == b.size() ? 0 : 1;
  for (std::size_t i = 0; i < a.size() && i < b.size(); ++i)
    difference |= static_cast<unsigned char>(a[i]) ^ static_cast<unsigned char>(b[i]);
  return difference == 0;
}

std::string_view view_of(beast::string_view text) { return {text.data(), text.size()}; }

// The value of `key` in the query of a target, as it is: tokens need no escapes.
std::string_view query_value(std::string_view target, std::string_view key) {
  const std::size_t mark = target.find('?');
  std::string_view rest = mark == std::string_view::npos ? std::string_view() : target.substr(mark + 1);
  while (!rest.empty()) {
    const std::string_view part = rest.substr(0, rest.find('&'));
    rest.remove_prefix(std::min(rest.size(), part.size() + 1));
    if (part.size() > key.size() && part.substr(0, key.size()) == key && part[key.size()] == '=')
      return part.substr(key.size() + 1);
  }
  return {};
}

// "[::1]:80" -> "[::1]"
std::string host_name(std::string_view host) {
  const std::size_t bracket = host.rfind(']'), colon = host.rfind(':');
  if (colon != std::string_view::npos && (bracket == std::string_view::npos || colon > bracket))
    host = host.substr(0, colon);
  return lower_case(std::string(host));
}

class Client;
class Connection;

}  // namespace

bool is_own_page(const std::string& address, std::string_view host, std::string_view origin) {
  const std::string name = host_name(host);
  if (!origin.empty() && lower_case(std::string(origin)) != "http://" + lower_case(std::string(host))) return false;
  error_code ignored;
  const asio::ip::address own = asio::ip::make_address(address, ignored);
  if (name == (own.is_v6() ? "[" + own.to_string() + "]" : own.to_string())) return true;
  const bool everywhere = own.is_unspecified();
  if (own.is_loopback() || everywhere) {
    if (name == "localhost" || name == "127.0.0.1" || name == "[::1]") return true;
  }
  if (!everywhere) return false;
  // Any number may be ours; of names, only the machine's. A page of a stranger could have its own name lead here.
  std::string number = name;
  if (number.size() > 2 && number.front() == '[') number = number.substr(1, number.size() - 2);
  asio::ip::make_address(number, ignored);
  if (!ignored) return true;
  char machine[256] = "";
  return gethostname(machine, sizeof(machine) - 1) == 0 && name == lower_case(machine);
}

bool is_loopback(const std::string& address) {
  error_code error;
  const asio::ip::address own = asio::ip::make_address(address, error);
  return !error && own.is_loopback();
}

struct WebServer::Impl : std::enable_shared_from_this<WebServer::Impl> {
  Impl(const ServerOptions& server_options, ServerHandler& server_handler)
      : options(server_options),
        handler(server_handler),
        net(std::make_unique<Net>()) {}

  void listen();
  void accept();
  void open(ClientId id, const std::shared_ptr<Client>& client);
  void close(ClientId id);
  // Runs body(*this) in the server's thread; once that has ended, never.
  template <typename Body>
  void post(Body body) {
    const std::lock_guard lock(net_mutex);
    if (net) asio::post(net->io, [self = shared_from_this(), body = std::move(body)]() mutable { body(*self); });
  }

  // Destroyed at the end, with what still waits in it: connections, which hold this object.
  struct Net {
    asio::io_context io{1};
    tcp::acceptor acceptor{io};
    asio::steady_timer timer{io};
  };
  const ServerOptions options;
  ServerHandler& handler;
  std::mutex net_mutex;
  std::unique_ptr<Net> net;
  std::map<ClientId, std::shared_ptr<Client>> clients;
  std::shared_ptr<const Frame> newest;
  ClientId last_id = 0;
  std::atomic<int> connections{0};
  std::deque<std::weak_ptr<Connection>> accepted;  // oldest first; some may have ended
  int port = 0;
  bool stopping = false;
  std::atomic<double> send_ms{0.0};
  std::thread thread;
};

namespace {

// One that watches or controls.
class Client : public std::enable_shared_from_this<Client> {
 public:
  Client(std::shared_ptr<WebServer::Impl> server, tcp::socket&& socket);
  ~Client();
  void start(const http::request<http::empty_body>& request);
  void send(std::string text);
  void publish(std::shared_ptr<const Frame> frame) {
    frame_ = std::move(frame);
    write();
  }
  void acknowledge(long long number) {
    if (number >= unacknowledged_) unacknowledged_ = 0;
    write();
  }
  void stop();

 private:
  void read();
  void write();
  void end();

  std::shared_ptr<WebServer::Impl> server_;
  websocket::stream<beast::tcp_stream> socket_;
  beast::flat_buffer buffer_;
  asio::steady_timer slow_;
  double allowance_;  // messages that may still be read at once
  Clock::time_point refilled_ = Clock::now();
  std::deque<std::string> texts_;
  std::size_t waiting_bytes_ = 0;  // of texts_
  std::shared_ptr<const Frame> frame_, sending_;
  long long sent_ = 0, unacknowledged_ = 0;  // numbers of frames
  bool writing_ = false, open_ = false, ended_ = false;
  ClientId id_ = 0;
};

// One that asks for files, or is about to become a client.
class Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(std::shared_ptr<WebServer::Impl> server, tcp::socket&& socket)
      : server_(std::move(server)),
        stream_(std::move(socket)),
        buffer_(kLargestHeader + 4096) {
    ++server_->connections;
  }
  ~Connection() { --server_->connections; }
  void start();
  // Closes a connection that has not shown the token; returns whether it did.
  bool close_stranger() {
    if (known_) return false;
    stream_.close();
    return true;
  }

 private:
  void read();
  using Request = http::request<http::empty_body>;
  void handle(const Request& request);
  void answer(const Request& request, Download file);
  void limit_time() {
    stream_.expires_after(duration_cast<Clock::duration>(duration<double>(server_->options.limits.request_seconds)));
  }
  void write();

  std::shared_ptr<WebServer::Impl> server_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_;
  std::optional<http::request_parser<http::empty_body>> parser_;
  std::optional<http::response<http::string_body>> response_;
  std::shared_ptr<void> held_;                                              // Download::held of response_
  std::optional<http::response_serializer<http::string_body>> serializer_;  // of response_
  int requests_ = 0;
  bool known_ = false;  // has shown the token
};

Client::Client(std::shared_ptr<WebServer::Impl> server, tcp::socket&& socket)
    : server_(std::move(server)),
      socket_(std::move(socket)),
      buffer_(server_->options.limits.message + 256),
      slow_(server_->net->io),
      allowance_(server_->options.limits.messages_a_second) {
  ++server_->connections;
}

Client::~Client() { --server_->connections; }

void Client::start(const http::request<http::empty_body>& request) {
  error_code ignored;
  beast::get_lowest_layer(socket_).socket().set_option(tcp::no_delay(true), ignored);
  beast::get_lowest_layer(socket_).expires_never();  // WebSocket has times of its own
  websocket::stream_base::timeout times{};
  times.handshake_timeout = std::chrono::seconds(10);
  times.idle_timeout = std::chrono::seconds(60);
  times.keep_alive_pings = true;
  socket_.set_option(times);
  socket_.read_message_max(server_->options.limits.message);
  socket_.auto_fragment(false);
  socket_.async_accept(request, [self = shared_from_this()](error_code error) {
    if (error) return;
    if (static_cast<int>(self->server_->clients.size()) >= self->server_->options.limits.clients) return self->end();
    self->open_ = true;
    self->id_ = ++self->server_->last_id;
    self->server_->open(self->id_, self);
    self->read();
  });
}

void Client::read() {
  // A client that sends more than it may is read later, and so held up.
  const double rate = server_->options.limits.messages_a_second;
  const Clock::time_point now = Clock::now();
  allowance_ = std::min(rate, allowance_ + rate * duration<double>(now - refilled_).count());
  refilled_ = now;
  if (allowance_ < 1.0) {
    slow_.expires_after(std::chrono::milliseconds(20));
    slow_.async_wait([self = shared_from_this()](error_code) {
      if (!self->ended_) self->read();
    });
    return;
  }
  allowance_ -= 1.0;
  socket_.async_read(buffer_, [self = shared_from_this()](error_code error, std::size_t) {
    if (error) return self->end();
    const std::string text = beast::buffers_to_string(self->buffer_.data());
    self->buffer_.consume(self->buffer_.size());
    if (self->server_->stopping) return self->end();
    self->server_->handler.message(self->id_, self->socket_.got_text() ? text : std::string());
    self->read();
  });
}

void Client::send(std::string text) {
  const ServerLimits& limits = server_->options.limits;
  const bool waits = !texts_.empty();  // one text of any size is sent: a list of very many lights, for example
  if (texts_.size() >= limits.unread || (waits && waiting_bytes_ + text.size() > limits.unread_bytes)) return stop();
  waiting_bytes_ += text.size();
  texts_.push_back(std::move(text));
  write();
}

// Texts go first. A frame goes only when the last one was acknowledged.
void Client::write() {
  if (writing_ || !open_ || ended_) return;
  const Stopwatch watch;
  if (!texts_.empty()) {
    writing_ = true;
    socket_.text(true);
    socket_.async_write(asio::buffer(texts_.front()), [self = shared_from_this()](error_code error, std::size_t) {
      self->writing_ = false;
      self->waiting_bytes_ -= self->texts_.front().size();
      self->texts_.pop_front();
      if (error) return self->end();
      self->write();
    });
  } else if (frame_ && unacknowledged_ == 0 && frame_->number > sent_) {
    writing_ = true;
    sending_ = std::move(frame_);
    sent_ = unacknowledged_ = sending_->number;
    socket_.binary(true);
    socket_.async_write(asio::buffer(sending_->bytes),
                        [self = shared_from_this(), watch](error_code error, std::size_t) {
                          self->writing_ = false;
                          self->sending_.reset();
                          if (error) return self->end();
                          self->server_->send_ms = 1e3 * watch.seconds();
                          self->write();
                        });
  }
}

void Client::stop() {
  if (ended_ || !open_) return;
  open_ = false;
  if (writing_) return end();  // one write at a time: the socket closes without a close frame
  writing_ = true;
  socket_.async_close(websocket::close_code::going_away, [self = shared_from_this()](error_code) { self->end(); });
}

void Client::end() {
  if (std::exchange(ended_, true)) return;
  slow_.cancel();
  error_code ignored;
  beast::get_lowest_layer(socket_).socket().close(ignored);
  if (id_ != 0) server_->close(id_);
}

void Connection::start() {
  std::erase_if(server_->accepted, [](const auto& connection) { return connection.expired(); });
  server_->accepted.push_back(weak_from_this());
  read();
}

void Connection::read() {
  parser_.emplace();
  parser_->header_limit(kLargestHeader);
  parser_->body_limit(0);
  limit_time();
  http::async_read(stream_, buffer_, *parser_, [self = shared_from_this()](error_code error, std::size_t) {
    if (error == http::error::end_of_stream) {
      error_code ignored;
      self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
      return;
    }
    if (error == http::error::header_limit || error == http::error::body_limit) {
      const Request& part = self->parser_->get();
      return self->answer(part, {413, "text/plain; charset=utf-8", "", "the request is too large\n"});
    }
    if (error) {
      if (error.category() == http::make_error_code(http::error::bad_method).category())
        self->answer(self->parser_->get(), {400, "text/plain; charset=utf-8", "", "not a request\n"});
      return;
    }
    self->handle(self->parser_->get());
  });
}

void Connection::handle(const Request& request) {
  const std::string_view target = view_of(request.target());
  const std::string path(target.substr(0, target.find('?')));
  const auto refuse = [&](int status, const std::string& why) {
    answer(request, {status, "text/plain; charset=utf-8", "", why + "\n"});
  };
  if (!is_own_page(server_->options.address, view_of(request[http::field::host]),
                   view_of(request[http::field::origin])))
    return refuse(403, "not from here: the host or the origin of the request is foreign");
  if (request.method() != http::verb::get) return refuse(405, "only GET");
  for (const PageFile& file : page_files()) {
    if (path == file.path) return answer(request, {200, std::string(file.type), "", std::string(file.text)});
  }
  if (!same_secret(query_value(target, "token"), server_->options.token))
    return refuse(403, "the token is missing or wrong: open the address that octrad printed");
  known_ = true;
  if (path == "/check") return answer(request, {204, "text/plain", "", ""});
  if (path == "/stream") {
    if (!websocket::is_upgrade(request)) return refuse(426, "a WebSocket is expected here");
    if (static_cast<int>(server_->clients.size()) >= server_->options.limits.clients)
      return refuse(503, fmt::format("{} are here already", server_->options.limits.clients));
    std::make_shared<Client>(server_, stream_.release_socket())->start(request);
    return;
  }
  const auto kept = std::make_shared<Request>(request);
  server_->handler.download(path, [self = shared_from_this(), kept](Download file) {
    self->server_->post(
        [self, kept, file = std::move(file)](WebServer::Impl&) mutable { self->answer(*kept, std::move(file)); });
  });
}

void Connection::answer(const Request& request, Download file) {
  response_.emplace(static_cast<http::status>(file.status), request.version() == 10 ? 10 : 11);
  response_->set(http::field::content_type, file.type);
  if (!file.name.empty())
    response_->set(http::field::content_disposition, fmt::format("attachment; filename=\"{}\"", file.name));
  response_->set(http::field::cache_control, "no-store");
  response_->set(
      "Content-Security-Policy",
      "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self' "
      "ws://" +
          std::string(view_of(request[http::field::host])) +
          "; base-uri 'none'; form-action 'none'; frame-ancestors 'none'");
  response_->set("X-Content-Type-Options", "nosniff");
  response_->set("Referrer-Policy", "no-referrer");
  response_->set("Cross-Origin-Resource-Policy", "same-origin");
  response_->set("Cross-Origin-Opener-Policy", "same-origin");
  const bool ok = file.status < 300;
  response_->keep_alive(ok && request.keep_alive() && ++requests_ < kMostRequests && !server_->stopping);
  response_->body() = std::move(file.body);
  held_ = std::move(file.held);
  response_->prepare_payload();
  serializer_.emplace(*response_);
  write();
}

// As much of the answer as the line takes, and the rest: a slow line has all the time, one that stands still has not.
void Connection::write() {
  limit_time();
  http::async_write_some(stream_, *serializer_, [self = shared_from_this()](error_code error, std::size_t) {
    if (error) return;
    if (!self->serializer_->is_done()) return self->write();
    self->response_->body() = {};
    self->held_.reset();
    if (self->response_->keep_alive()) return self->read();
    error_code ignored;
    self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
  });
}

}  // namespace

void WebServer::Impl::listen() {
  // Beast would take std::random_device (base/random_seed.h says why not).
  const std::uint64_t numbers[] = {random_seed(), random_seed(), random_seed(), random_seed()};
  std::seed_seq seeds(std::begin(numbers), std::end(numbers));
  beast::websocket::seed_prng(seeds);
  error_code error;
  const asio::ip::address address = asio::ip::make_address(options.address, error);
  if (error)
    throw UsageError(
        fmt::format("--listen {}: expected an address in numbers, such as 127.0.0.1, ::1 or 0.0.0.0", options.address));
  const tcp::endpoint endpoint(address, static_cast<unsigned short>(options.port));
  const auto check = [&](const error_code& failed) {
    if (failed)
      throw IoError(fmt::format("cannot listen at {} port {}: {}", options.address, options.port, failed.message()));
  };
  check(net->acceptor.open(endpoint.protocol(), error));
  check(net->acceptor.set_option(asio::socket_base::reuse_address(true), error));
  check(net->acceptor.bind(endpoint, error));
  check(net->acceptor.listen(16, error));
  port = net->acceptor.local_endpoint().port();
  accept();
}

void WebServer::Impl::accept() {
  net->acceptor.async_accept([self = shared_from_this()](error_code error, tcp::socket socket) {
    if (self->stopping) return;
    if (error) {  // such as too many open files: later
      self->net->timer.expires_after(std::chrono::milliseconds(100));
      self->net->timer.async_wait([self](error_code) {
        if (!self->stopping) self->accept();
      });
      return;
    }
    // Whoever has the token is not locked out by those who have not.
    const bool full = self->connections >= self->options.limits.connections;
    bool closed = false;
    for (auto it = self->accepted.begin(); full && !closed && it != self->accepted.end();) {
      const std::shared_ptr<Connection> connection = it->lock();
      closed = connection && connection->close_stranger();
      it = closed || !connection ? self->accepted.erase(it) : it + 1;
    }
    if (!full || closed) std::make_shared<Connection>(self, std::move(socket))->start();
    self->accept();
  });
}

void WebServer::Impl::open(ClientId id, const std::shared_ptr<Client>& client) {
  clients[id] = client;
  handler.opened(id);
  // After the texts of opened(), which are posted.
  post([client](Impl& impl) {
    if (impl.newest) client->publish(impl.newest);
  });
}

void WebServer::Impl::close(ClientId id) {
  if (clients.erase(id) > 0) handler.closed(id);
}

WebServer::WebServer(const ServerOptions& options, ServerHandler& handler)
    : impl_(std::make_shared<Impl>(options, handler)) {
  impl_->listen();
}

void WebServer::start() {
  impl_->thread = std::thread([impl = impl_] {
    while (true) {
      try {
        impl->net->io.run();
        return;
      } catch (const std::exception& error) {  // of a handler; the connections go on
        log_warning(fmt::format("while serving: {}", error.what()));
      }
    }
  });
}

WebServer::~WebServer() { stop(); }

int WebServer::port() const { return impl_->port; }

std::string WebServer::url() const {
  error_code ignored;
  const asio::ip::address address = asio::ip::make_address(impl_->options.address, ignored);
  std::string host = address.to_string();
  if (address.is_unspecified()) host = address.is_v6() ? "::1" : "127.0.0.1";
  if (address.is_v6()) host = "[" + host + "]";
  return fmt::format("http://{}:{}/#token={}", host, impl_->port, impl_->options.token);
}

double WebServer::last_send_ms() const { return impl_->send_ms; }

void WebServer::send(ClientId client, std::string text) {
  impl_->post([client, text = std::move(text)](Impl& impl) mutable {
    const auto found = impl.clients.find(client);
    if (found != impl.clients.end()) std::shared_ptr<Client>(found->second)->send(std::move(text));
  });
}

void WebServer::broadcast(const std::string& text) {
  impl_->post([text](Impl& impl) {
    const auto all = impl.clients;  // sending may close one
    for (const auto& [id, client] : all) client->send(text);
  });
}

void WebServer::publish(std::shared_ptr<const Frame> frame) {
  impl_->post([frame = std::move(frame)](Impl& impl) {
    impl.newest = frame;
    const auto all = impl.clients;
    for (const auto& [id, client] : all) client->publish(frame);
  });
}

void WebServer::acknowledge(ClientId client, long long frame) {
  impl_->post([client, frame](Impl& impl) {
    const auto found = impl.clients.find(client);
    if (found != impl.clients.end()) std::shared_ptr<Client>(found->second)->acknowledge(frame);
  });
}

void WebServer::stop() {
  if (!impl_->thread.joinable()) return;
  impl_->post([](Impl& impl) {
    impl.stopping = true;
    error_code ignored;
    impl.net->acceptor.close(ignored);
    const auto all = impl.clients;
    for (const auto& [id, client] : all) client->stop();
    impl.net->timer.expires_after(std::chrono::milliseconds(all.empty() ? 1 : 300));
    impl.net->timer.async_wait([&impl](error_code) { impl.net->io.stop(); });
  });
  impl_->thread.join();
  std::unique_ptr<Impl::Net> net;
  {
    const std::lock_guard lock(impl_->net_mutex);
    net = std::move(impl_->net);
  }
  impl_->clients.clear();
}

}  // namespace octrad::viewer
