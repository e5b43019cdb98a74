#include "octrad/base/json_file.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "octrad/base/error.h"
#include "octrad/base/memory_limit.h"

namespace octrad {
namespace {

std::string refusal(const std::string& text) {
  try {
    parse_json(text, "a.json");
  } catch (const InputError& error) {
    EXPECT_TRUE(parse_json_or_discard(text).is_discarded());
    return error.what();
  }
  return "";
}

TEST(Json, ReadsWithComments) {
  EXPECT_EQ(parse_json("{\"a\": [1, 2.5e3] // two\n}", "a.json"), (nlohmann::json{{"a", {1, 2.5e3}}}));
  EXPECT_EQ(parse_json_or_discard("[1]"), nlohmann::json::array({1}));
}

TEST(Json, SaysWhereItIsWrong) {
  EXPECT_EQ(refusal("{\n \"a\": }"), "a.json:2:7: not valid JSON");
  EXPECT_NE(refusal(""), "");
  EXPECT_NE(refusal("\"\xff\""), "") << "no UTF-8";
  EXPECT_EQ(refusal("[1e999]"), "a.json: a number is too large for a floating-point number");
  EXPECT_EQ(refusal("[-1e999]"), "a.json: a number is too large for a floating-point number");
}

TEST(Json, DepthIsLimited) {
  const auto nested = [](std::size_t n, const std::string& open, const std::string& close) {
    std::string text;
    for (std::size_t i = 0; i < n; ++i) text += open;
    text += "1";
    for (std::size_t i = 0; i < n; ++i) text += close;
    return text;
  };
  EXPECT_EQ(refusal(nested(100, "[", "]")), "");
  EXPECT_EQ(refusal(nested(102, "[", "]")), "a.json: lists or objects are nested more than 100 deep");
  EXPECT_NE(refusal(nested(1'000'000, "[", "]")), "");
  EXPECT_NE(refusal(nested(200'000, "{\"a\":", "}")), "");
  EXPECT_NE(refusal(std::string(1'000'000, '[')), "");
}

TEST(Json, MemoryIsAskedFirst) {
  set_memory_limit(1);
  EXPECT_THROW(parse_json("[1]", "a.json"), MemoryError);
  set_memory_limit(0);
}

}  // namespace
}  // namespace octrad
