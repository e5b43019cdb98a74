#include "octrad/base/memory_limit.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <mutex>

#include "octrad/base/bytes.h"
#include "octrad/base/error.h"

namespace octrad {
namespace {

std::atomic<std::uint64_t> g_limit{0};
// What open scopes were promised, and what was there before it.
std::mutex g_mutex;
std::uint64_t g_promised = 0, g_before = 0;
thread_local MemoryScope* g_scope = nullptr;

}  // namespace

void set_memory_limit(std::uint64_t bytes) { g_limit = bytes; }
std::uint64_t memory_limit() { return g_limit; }

void ask_memory(std::uint64_t bytes, std::string_view what) {
  const std::uint64_t limit = g_limit;
  if (limit == 0) return;
  const std::lock_guard lock(g_mutex);
  const std::uint64_t resident = resident_bytes();
  if (g_promised == 0) g_before = resident;
  const std::uint64_t used = std::max(resident, g_before + g_promised);
  if (bytes > limit || used > limit - bytes) {
    throw MemoryError(fmt::format("{} needs {} beside {} that are in use, and the budget is {} (--max-memory)", what,
                                  format_bytes(static_cast<double>(bytes)), format_bytes(static_cast<double>(used)),
                                  format_bytes(static_cast<double>(limit))));
  }
  if (g_scope == nullptr) return;
  g_scope->promised_ += bytes;
  g_promised += bytes;
}

MemoryScope::MemoryScope() : outer_(g_scope) { g_scope = this; }

MemoryScope::~MemoryScope() {
  g_scope = outer_;
  if (promised_ == 0) return;
  const std::lock_guard lock(g_mutex);
  g_promised -= promised_;
  g_before = std::min(g_before + promised_, resident_bytes());  // part of it is still there, most likely
}

}  // namespace octrad
