// Runs a test body once for every instruction set that this machine and this build have. Not part of the library.
#pragma once

#include <gtest/gtest.h>
#include <hwy/highway.h>

namespace octrad::testing {

template <typename Body>
void for_each_simd_target(Body&& body) {
  const std::int64_t present = hwy::SupportedTargets() & HWY_TARGETS;
  ASSERT_NE(present, 0);
  for (std::int64_t rest = present; rest != 0; rest &= rest - 1) {
    const std::int64_t target = rest & -rest;
    SCOPED_TRACE(hwy::TargetName(target));
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(target);
    body();
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().DeInit();
  }
}

}  // namespace octrad::testing
