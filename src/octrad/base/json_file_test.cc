#include "octrad/base/json_file.h"

#include <gtest/gtest.h>

#include <climits>
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
  const std::string open(200, '['), inside = nested(102, "[", "]");
  EXPECT_EQ(refusal("[\"" + open + "\", \"\\\"" + open + "\"]"), "") << "in texts";
  EXPECT_EQ(refusal("[1, // " + open + "\n2, /* " + open + " */ 3]"), "") << "in comments";
  for (const std::string before : {"// \"\r", "// \"\n", "/* \" */", "/**/", "/**//*x*/", "[\"\\\\\"],"}) {
    const std::string text = before[0] == '[' ? "[" + before + inside + "]" : before + inside;
    EXPECT_EQ(refusal(text), "a.json: lists or objects are nested more than 100 deep") << before;
  }
}

TEST(Json, WholeNumbers) {
  const auto whole = [](const std::string& text, long long low = LLONG_MIN, long long high = LLONG_MAX) {
    return whole_number(parse_json(text, "a.json"), low, high, "a.json: steps");
  };
  const auto refusal_of = [&](const std::string& text, long long low = LLONG_MIN, long long high = LLONG_MAX) {
    try {
      return "accepted: " + std::to_string(whole(text, low, high));
    } catch (const InputError& error) {
      return std::string(error.what());
    }
  };
  EXPECT_EQ(whole("7"), 7);
  EXPECT_EQ(whole("-7"), -7);
  EXPECT_EQ(whole("4.0"), 4);
  EXPECT_EQ(whole("1e6"), 1000000);
  EXPECT_EQ(whole("9223372036854775807"), LLONG_MAX);
  EXPECT_EQ(whole("-9223372036854775808"), LLONG_MIN);
  EXPECT_EQ(whole("0", 0, 0), 0);
  EXPECT_EQ(refusal_of("1.5", 0, 9), "a.json: steps must be a whole number from 0 to 9, not 1.5");
  EXPECT_EQ(refusal_of("-1", 0, 9), "a.json: steps must be a whole number from 0 to 9, not -1");
  EXPECT_EQ(refusal_of("10", 0, 9), "a.json: steps must be a whole number from 0 to 9, not 10");
  EXPECT_EQ(refusal_of("[1]", 0, 9), "a.json: steps must be a whole number from 0 to 9, not array");
  for (const char* text :
       {"1e300", "-1e300", "1e19", "9223372036854775808", "18446744073709551615", "\"3\"", "true", "null", "{}"})
    EXPECT_NE(refusal_of(text).find("must be a whole number"), std::string::npos) << text;
}

TEST(Json, MemoryIsAskedFirst) {
  set_memory_limit(1);
  EXPECT_THROW(parse_json("[1]", "a.json"), MemoryError);
  set_memory_limit(0);
}

}  // namespace
}  // namespace octrad
