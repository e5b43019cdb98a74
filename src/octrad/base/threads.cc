#include "octrad/base/threads.h"

#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

namespace octrad {
namespace {
tbb::global_control* g_tbb_limit = nullptr;  // TBB's own limit is process-wide too
int g_threads = 0;
}  // namespace

void set_thread_count(int threads) {
  g_threads = threads > 0 ? threads : 0;
  // The new limit before the old one goes, and none goes at the end of the program: where threads cannot be started,
  // TBB must not try in between.
  tbb::global_control* limit = g_threads == 0 ? nullptr
                                              : new tbb::global_control(tbb::global_control::max_allowed_parallelism,
                                                                        static_cast<std::size_t>(g_threads));
  delete std::exchange(g_tbb_limit, limit);
}

int thread_count() { return g_threads > 0 ? g_threads : tbb::info::default_concurrency(); }

int startable_threads(int wanted) {
  std::vector<std::jthread> threads;
  std::atomic<bool> done = false;
  try {
    while (static_cast<int>(threads.size()) + 1 < wanted) threads.emplace_back([&] { done.wait(false); });
  } catch (const std::system_error&) {  // a limit of the user or of the container
  }
  done = true;
  done.notify_all();
  return static_cast<int>(threads.size()) + 1;
}

#ifdef OCTRAD_PLAIN_THREADS

// For ThreadSanitizer, which does not see the synchronisation inside TBB's library: threads of their own for each loop.
// More than one even on one processor, so that there is something to see. A loop inside a loop runs where it is called.
void parallel_for(std::size_t n, const std::function<void(std::size_t)>& body) {
  static thread_local bool inside = false;
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::exception_ptr error;
  const auto work = [&] {
    const bool outer = std::exchange(inside, true);
    try {
      for (std::size_t i; (i = next.fetch_add(1, std::memory_order_relaxed)) < n;) body(i);
    } catch (...) {
      const std::lock_guard lock(mutex);
      error = std::current_exception();
      next = n;
    }
    inside = outer;
  };
  const std::size_t helpers = inside || n < 2 || g_threads == 1 ? 0 : std::min<std::size_t>(n, 4) - 1;
  {
    std::vector<std::jthread> threads;
    for (std::size_t t = 0; t < helpers; ++t) threads.emplace_back(work);
    work();
  }
  if (error) std::rethrow_exception(error);
}

#else

void parallel_for(std::size_t n, const std::function<void(std::size_t)>& body) {
  // TBB's threads keep the floating-point mode in which they were first asked to work, and Embree flushes subnormal
  // numbers while it builds: the caller's mode holds instead.
  using Context = tbb::task_group_context;
  Context context(Context::bound, Context::default_traits | Context::fp_settings);
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, n, 1),
      [&](const auto& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) body(i);
      },
      tbb::simple_partitioner(), context);
}

#endif

void parallel_blocks(std::size_t n, std::size_t block, const std::function<void(std::size_t, std::size_t)>& body) {
  const std::size_t blocks = (n + block - 1) / block;
  parallel_for(blocks, [&](std::size_t b) { body(b * block, std::min(n, (b + 1) * block)); });
}

}  // namespace octrad
