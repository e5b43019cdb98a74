#include "app/cli/tev_client.h"

#include <fmt/format.h>
#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <mutex>
#include <optional>
#include <thread>

#include "octrad/base/error.h"
#include "octrad/base/log.h"
#include "octrad/base/stopwatch.h"

namespace octrad::cli {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr const char* kPort = "14158";
constexpr int kTimeout = 5000;                // milliseconds without an answer or a byte taken
constexpr std::size_t kTilePixels = 1 << 18;  // of one packet: 3 MB
constexpr double kLeast = 0.25, kShare = 0.05;

// A packet: its length in bytes with these four, its type, and what belongs to that; texts end with a zero.
class Packet {
 public:
  enum Type : char { update_image = 6, create_image = 4 };
  explicit Packet(Type type) : bytes_(4, '\0') { add(type); }
  template <typename T>
  void add(T value) {
    const auto* from = reinterpret_cast<const char*>(&value);
    bytes_.insert(bytes_.end(), from, from + sizeof value);
  }
  void text(const std::string& value) { bytes_.append(value.c_str(), std::strlen(value.c_str()) + 1); }
  void numbers(const float* from, std::size_t count) {
    bytes_.append(reinterpret_cast<const char*>(from), count * sizeof(float));
  }
  const std::string& bytes() {
    const auto length = static_cast<std::uint32_t>(bytes_.size());
    std::memcpy(bytes_.data(), &length, sizeof length);
    return bytes_;
  }

 private:
  std::string bytes_;
};

const char* const kChannels[] = {"R", "G", "B"};

std::string create_packet(const std::string& name, int width, int height) {
  Packet p(Packet::create_image);
  p.add<char>(0);  // leaves the viewer's focus where it is
  p.text(name);
  p.add<std::int32_t>(width);
  p.add<std::int32_t>(height);
  p.add<std::int32_t>(3);
  for (const char* channel : kChannels) p.text(channel);
  return p.bytes();
}

// Rows [first, first + rows) of an image of three channels.
std::string update_packet(const std::string& name, const Image& image, int first, int rows) {
  Packet p(Packet::update_image);
  p.add<char>(0);
  p.text(name);
  p.add<std::int32_t>(3);
  for (const char* channel : kChannels) p.text(channel);
  for (const int v : {0, first, image.width, rows}) p.add<std::int32_t>(v);
  for (const int offset : {0, 1, 2}) p.add<std::int64_t>(offset);
  for (int c = 0; c < 3; ++c) p.add<std::int64_t>(3);  // from one pixel to the next
  const std::size_t row = static_cast<std::size_t>(image.width) * 3;
  p.numbers(image.data.data() + static_cast<std::size_t>(first) * row, static_cast<std::size_t>(rows) * row);
  return p.bytes();
}

struct Socket {
  int descriptor = -1;
  ~Socket() {
    if (descriptor >= 0) ::close(descriptor);
  }
};

bool wait_for_room(int descriptor) {
  pollfd p{descriptor, POLLOUT, 0};
  return ::poll(&p, 1, kTimeout) == 1 && (p.revents & (POLLERR | POLLHUP)) == 0;
}

// Empty, or what went wrong.
std::string connect_to(const std::string& host, const std::string& port, Socket& socket) {
  addrinfo hints{}, *found = nullptr;
  hints.ai_socktype = SOCK_STREAM;
  if (const int code = ::getaddrinfo(host.c_str(), port.c_str(), &hints, &found); code != 0) return gai_strerror(code);
  std::string why = "no address";
  for (const addrinfo* a = found; a; a = a->ai_next) {
    Socket attempt;
    attempt.descriptor = ::socket(a->ai_family, a->ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, a->ai_protocol);
    if (attempt.descriptor < 0) continue;
    int code = ::connect(attempt.descriptor, a->ai_addr, a->ai_addrlen) == 0 ? 0 : errno;
    if (code == EINPROGRESS) {
      code = ETIMEDOUT;
      socklen_t size = sizeof code;
      pollfd p{attempt.descriptor, POLLOUT, 0};
      if (::poll(&p, 1, kTimeout) == 1) ::getsockopt(attempt.descriptor, SOL_SOCKET, SO_ERROR, &code, &size);
    }
    if (code == 0) {
      std::swap(socket.descriptor, attempt.descriptor);
      why.clear();
      break;
    }
    why = std::strerror(code);
  }
  ::freeaddrinfo(found);
  return why;
}

std::string send_all(const Socket& socket, const std::string& bytes) {
  for (std::size_t sent = 0; sent < bytes.size();) {
    const ssize_t n = ::send(socket.descriptor, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
    if (n > 0) {
      sent += static_cast<std::size_t>(n);
    } else if (errno == EAGAIN || errno == EWOULDBLOCK) {
      if (!wait_for_room(socket.descriptor)) return "it takes nothing any more";
    } else if (errno != EINTR) {
      return std::strerror(errno);
    }
  }
  return "";
}

}  // namespace

struct TevClient::State {
  std::string host, port;
  std::mutex mutex;
  std::condition_variable changed;
  std::optional<std::pair<std::string, Image>> next;  // name and picture to be sent
  bool sending = false, connected = false, lost = false, ending = false, abandoned = false;
  Stopwatch since;  // the last picture
  double cost = 0.0;
};

TevClient::TevClient(const std::string& address) : state_(std::make_shared<State>()) {
  std::string host = address, port = kPort;
  const std::size_t bracket = address.find(']'), colon = address.find(':', bracket == std::string::npos ? 0 : bracket);
  if (colon != std::string::npos) {
    host = address.substr(0, colon);
    port = address.substr(colon + 1);
  }
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
  int number = 0;
  const auto [end, code] = std::from_chars(port.data(), port.data() + port.size(), number);
  if (host.empty() || code != std::errc() || end != port.data() + port.size() || number < 1 || number > 65535)
    throw UsageError("--tev " + address + ": expected HOST or HOST:PORT, such as localhost or 127.0.0.1:14158");
  state_->host = host;
  state_->port = port;
  std::thread(serve, state_).detach();  // looking up a name may take longer than anybody should wait at the end
}

TevClient::~TevClient() {
  std::unique_lock lock(state_->mutex);
  state_->ending = true;
  state_->changed.notify_all();
  state_->changed.wait_for(lock, std::chrono::seconds(2),
                           [this] { return state_->lost || (!state_->next && !state_->sending); });
  state_->abandoned = true;
}

bool TevClient::due() const {
  const std::lock_guard lock(state_->mutex);
  return state_->connected && !state_->lost && !state_->next && !state_->sending &&
         state_->since.seconds() >= std::max(kLeast, state_->cost / kShare);
}

void TevClient::show(const std::string& name, const Image& image, double cost) {
  Image rgb = extract_rgb(image);
  const std::lock_guard lock(state_->mutex);
  if (state_->lost) return;
  state_->next.emplace(name, std::move(rgb));
  state_->cost = cost;
  state_->since = Stopwatch();
  state_->changed.notify_all();
}

void TevClient::serve(const std::shared_ptr<State>& state) {
  const auto lose = [&](const std::string& why) {
    const std::lock_guard lock(state->mutex);
    state->lost = true;
    state->sending = false;
    state->next.reset();
    if (!state->abandoned)
      log_warning(fmt::format("--tev: {}:{}: {}; nothing is shown there from now on", state->host, state->port, why));
    state->changed.notify_all();
  };
  try {
    if (const std::string why = send_pictures(*state); !why.empty()) lose(why);
  } catch (const std::exception& error) {  // no memory
    lose(error.what());
  }
}

// Until it ends; or what went wrong.
std::string TevClient::send_pictures(State& state) {
  Socket socket;
  if (std::string why = connect_to(state.host, state.port, socket); !why.empty()) return why;
  std::unique_lock lock(state.mutex);
  state.connected = true;
  std::string name;
  int width = 0, height = 0;
  for (;;) {
    state.changed.wait(lock, [&] { return state.next || state.ending; });
    if (!state.next) return "";
    const std::pair<std::string, Image> picture = std::move(*state.next);
    state.next.reset();
    state.sending = true;
    lock.unlock();
    const Image& image = picture.second;
    std::string why;
    if (picture.first != name || image.width != width || image.height != height)
      why = send_all(socket, create_packet(picture.first, image.width, image.height));
    name = picture.first;
    width = image.width;
    height = image.height;
    const int rows = std::max(1, static_cast<int>(kTilePixels / static_cast<std::size_t>(width)));
    for (int y = 0; y < height && why.empty(); y += rows)
      why = send_all(socket, update_packet(name, image, y, std::min(rows, height - y)));
    if (!why.empty()) return why;
    lock.lock();
    state.sending = false;
    state.changed.notify_all();
  }
}

CLI::Option* add_tev_option(CLI::App& verb, std::string& address) {
  return verb
      .add_option("--tev", address, "show the picture while it is made in the viewer tev, at port 14158 or another")
      ->type_name("HOST[:PORT]");
}

std::unique_ptr<TevClient> open_tev(const std::string& address) {
  return address.empty() ? nullptr : std::make_unique<TevClient>(address);
}

}  // namespace octrad::cli
