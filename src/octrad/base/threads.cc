#include "octrad/base/threads.h"

#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <memory>

namespace octrad {
namespace {
std::unique_ptr<tbb::global_control> g_limit;  // TBB's own limit is process-wide too
int g_threads = 0;
}  // namespace

void set_thread_count(int threads) {
  g_threads = threads > 0 ? threads : 0;
  g_limit.reset();
  if (g_threads > 0) {
    g_limit = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism,
                                                    static_cast<std::size_t>(g_threads));
  }
}

int thread_count() { return g_threads > 0 ? g_threads : tbb::info::default_concurrency(); }

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

void parallel_blocks(std::size_t n, std::size_t block, const std::function<void(std::size_t, std::size_t)>& body) {
  const std::size_t blocks = (n + block - 1) / block;
  parallel_for(blocks, [&](std::size_t b) { body(b * block, std::min(n, (b + 1) * block)); });
}

}  // namespace octrad
