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

TEST(Printable, KeepsText) {
  for (const char* text : {"", "a b~", "two\nlines\tand a tab",
                           "Gr\xc3\xbc\xc3\x9f"
                           "e \xe2\x82\xac \xf0\x9f\x98\x80"})
    EXPECT_EQ(printable(text), text);
}

TEST(Printable, EscapesControlCharactersAndWhatIsNoUtf8) {
  EXPECT_EQ(printable("\x1b]0;title\x07\x1b[31m"), "\\x1b]0;title\\x07\\x1b[31m");
  EXPECT_EQ(printable("a\rb\x7f"), "a\\x0db\\x7f");
  EXPECT_EQ(printable(std::string("a\0b", 3)), "a\\x00b");
  EXPECT_EQ(printable("sz\xe4ne"), "sz\\xe4ne") << "Latin-1";
  EXPECT_EQ(printable("\xc2\x9b[31m"), "\\xc2\\x9b[31m") << "the control sequence introducer as U+009B";
  EXPECT_EQ(printable("\xc0\xaf"), "\\xc0\\xaf") << "overlong";
  EXPECT_EQ(printable("\xed\xa0\x80"), "\\xed\\xa0\\x80") << "a surrogate";
  EXPECT_EQ(printable("\xf4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80") << "above U+10FFFF";
  EXPECT_EQ(printable("cut \xe2\x82"), "cut \\xe2\\x82");
}

}  // namespace
}  // namespace octrad
