// Parallel loops. Work is cut into blocks whose size does not depend on the number of threads, so that results that
// are combined block by block are the same at any thread count.
#pragma once

#include <cstddef>
#include <functional>

namespace octrad {

// Upper limit of threads used from now on; 0: all. Call once, from main.
void set_thread_count(int threads);
int thread_count();
// How many of `wanted` threads the system lets this process have, the calling one included; tries it.
int startable_threads(int wanted);

// Calls body(i) for i in [0, n), in any order, from several threads. Exceptions propagate.
void parallel_for(std::size_t n, const std::function<void(std::size_t)>& body);

// Calls body(begin, end) for consecutive blocks of `block` items covering [0, n).
void parallel_blocks(std::size_t n, std::size_t block, const std::function<void(std::size_t, std::size_t)>& body);

}  // namespace octrad
