#include "octrad/base/escape.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <random>

#include "octrad/base/json_file.h"

namespace octrad {
namespace {

TEST(Escape, BytesThatAreNoUtf8) {
  EXPECT_EQ(escape_bytes("sz\xe4ne.xml"), "sz\\xe4ne.xml");
  EXPECT_EQ(escape_bytes("Zimmer-gr\xc3\xb6\xc3\x9f"
                         "e \xe2\x82\xac \xf0\x9f\x8e\xa8"),
            "Zimmer-gr\xc3\xb6\xc3\x9f"
            "e \xe2\x82\xac \xf0\x9f\x8e\xa8");
  EXPECT_EQ(escape_bytes("\xc0\xaf\xed\xa0\x80\xf4\x90\x80\x80\xc3"),
            "\\xc0\\xaf\\xed\\xa0\\x80\\xf4\\x90\\x80\\x80\\xc3");
  EXPECT_EQ(escape_bytes("C:\\xe4\\x41\\x5c"), "C:\\x5cxe4\\x41\\x5cx5c");
}

TEST(Escape, UnescapeGivesTheSameBytes) {
  std::mt19937 random(1);
  for (int round = 0; round < 2000; ++round) {
    std::string text;
    for (int n = 0; n < 12; ++n) text += "\\x5cE4\xe4\xc3\xa4\x80"[random() % 10];
    const std::string escaped = escape_bytes(text);
    ASSERT_NO_THROW(nlohmann::json(escaped).dump()) << escaped;  // it is UTF-8
    ASSERT_EQ(unescape_bytes(escaped), text);
  }
}

TEST(Escape, JsonTextTakesAnyBytes) {
  EXPECT_EQ(json_text({{"a", "\xc3\xa4"}}), "{\"a\":\"\xc3\xa4\"}");
  EXPECT_EQ(json_text({{"a\xe4", {"\xe4", 1}}}), "{\"a\\\\xe4\":[\"\\\\xe4\",1]}");
}

}  // namespace
}  // namespace octrad
