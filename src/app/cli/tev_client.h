// Pictures while they are made, shown in the viewer tev. Its packets: "IPC" in github.com/Tom94/tev, include/tev/Ipc.h.
#pragma once

#include <memory>
#include <string>

#include "app/cli/common.h"
#include "octrad/image/image.h"

namespace octrad::cli {

// A thread of its own connects and sends: nobody waits for the viewer, and of pictures that come faster than they can
// be sent the newest is kept. Where there is no viewer, or the connection is lost, there is one warning, and nothing is
// sent any more.
class TevClient {
 public:
  // `address`: HOST or HOST:PORT; [HOST]:PORT for an address with colons. The viewer's port is 14158. Throws UsageError
  // for anything else. Does not wait for the connection.
  explicit TevClient(const std::string& address);
  // Waits until the last picture is sent, but not more than two seconds.
  ~TevClient();
  TevClient(const TevClient&) = delete;
  TevClient& operator=(const TevClient&) = delete;

  // Whether a picture is wanted: there is a connection, the last one is sent, and making one, which took `cost` seconds
  // the last time, is a few percent of the time since then.
  bool due() const;
  // The colour of `image` (R, G, B), under `name` in the viewer. `cost`: of making it, in seconds.
  void show(const std::string& name, const Image& image, double cost = 0.0);

 private:
  struct State;
  static void serve(const std::shared_ptr<State>& state);
  static std::string send_pictures(State& state);
  std::shared_ptr<State> state_;  // the thread holds it too: it may outlive this
};

// --tev of verbs whose work can be watched; null where it was not given.
CLI::Option* add_tev_option(CLI::App& verb, std::string& address);
std::unique_ptr<TevClient> open_tev(const std::string& address);

}  // namespace octrad::cli
