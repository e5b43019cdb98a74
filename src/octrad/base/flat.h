// Inner loops of the CPU as one function each.
#pragma once

namespace octrad {

#if defined(__x86_64__)
#define OCTRAD_AVX512 [[gnu::target("avx2,bmi,bmi2,lzcnt,popcnt,avx512f,avx512bw,avx512cd,avx512dq,avx512vl")]]
inline bool has_avx512() {
  static const bool has = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                          __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") &&
                          __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("bmi2");
  return has;
}
#else
#define OCTRAD_AVX512
constexpr bool has_avx512() { return false; }
#endif

namespace flat_detail {

template <typename Function>
[[gnu::flatten]] void run_baseline(const Function& f) {
  f();
}

template <typename Function>
[[gnu::flatten]] OCTRAD_AVX512 void run_avx512(const Function& f) {
  f();
}

}  // namespace flat_detail

// Calls f(), in a function of which all that f calls and whose body is known becomes part, compiled for AVX-512 too. By
// themselves compilers leave small functions of the definitions apart, and the linker may then take a copy that another
// part of the program compiled with less effort. Both have the same bits: no instruction rounds otherwise, as products
// and sums are never fused. It multiplies what the compiler writes: for loops over many rays only.
template <typename Function>
void run_flat(const Function& f) {
  if (has_avx512()) flat_detail::run_avx512(f);
  else flat_detail::run_baseline(f);
}

}  // namespace octrad
