#include "octrad/model/safetensors.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "octrad/base/atomic_file.h"
#include "octrad/base/error.h"
#include "octrad/base/folder_test_helper.h"
#include "octrad/base/input_file.h"

namespace octrad {
namespace {

class Safetensors : public ::testing::Test {
 protected:
  void put(const std::string& header, const std::string& data, std::int64_t length = -1) const {
    std::ofstream out(file_, std::ios::binary);
    const std::uint64_t n = length == -1 ? header.size() : static_cast<std::uint64_t>(length);
    out.write(reinterpret_cast<const char*>(&n), 8);
    out << header << data;
  }
  // The error that opening gives, "" if none.
  std::string refusal() const {
    try {
      TensorReader reader(file_);
      for (const std::string& name : reader.names()) values<char>(reader, name);  // all that was let through
      return "";
    } catch (const InputError& error) {
      return error.what();
    }
  }

  template <typename T>
  static std::vector<T> values(const TensorReader& reader, const std::string& name) {
    const auto tensor = reader.get(name);
    std::vector<T> out(tensor.bytes / sizeof(T));
    reader.read(tensor, out.data());
    return out;
  }

  TestFolder temporary_;
  const std::filesystem::path& folder_ = temporary_.path();
  const std::string file_ = temporary_.file("m.octrad");
};

TEST_F(Safetensors, RoundTrip) {
  const std::vector<float> a = {1, 2, 3, 4, 5, 6};
  const std::vector<std::uint8_t> odd = {9, 8, 7};
  const std::vector<std::int64_t> wide = {-1, INT64_MAX};
  TensorWriter writer;
  writer.metadata("format", "octrad");
  writer.metadata("config", "{\"a\": \"\\u00e4\"}");
  writer.add("odd", DType::u8, {3}, odd.data());
  writer.add("a", DType::f32, {2, 3}, a.data());
  writer.add("wide", DType::i64, {2}, wide.data());
  writer.add("none", DType::f32, {0, 4}, nullptr);
  const float scalar = 42.0f;
  writer.add("scalar", DType::f32, {}, &scalar);
  writer.write(file_);
  writer.write(file_);  // over an existing file
  EXPECT_FALSE(std::filesystem::exists(file_ + ".tmp"));

  const TensorReader reader(file_);
  EXPECT_EQ(reader.metadata().at("format"), "octrad");
  EXPECT_EQ(reader.metadata().at("config"), "{\"a\": \"\\u00e4\"}");
  EXPECT_EQ(reader.names().size(), 5u);
  const auto t = reader.get("a", DType::f32, {-1, 3});
  EXPECT_TRUE(std::ranges::equal(values<float>(reader, "a"), a));
  EXPECT_EQ(t.count, 6);
  std::vector<float> blocks(6);
  reader.read_blocks(t, 4, [&](const void* block, std::int64_t first, std::int64_t count) {
    EXPECT_TRUE((first == 0 && count == 4) || (first == 4 && count == 2));
    std::copy_n(static_cast<const float*>(block), count, blocks.begin() + first);
  });
  EXPECT_EQ(blocks, a);
  const auto w = reader.get("wide");
  EXPECT_EQ(w.position % 8, 0u);
  EXPECT_TRUE(std::ranges::equal(values<std::int64_t>(reader, "wide"), wide));
  EXPECT_EQ(values<float>(reader, "scalar"), std::vector<float>{42.0f});
  EXPECT_EQ(reader.get("none").bytes, 0u);
  EXPECT_FALSE(reader.has("b"));
  EXPECT_THROW(reader.get("b"), InputError);
  EXPECT_THROW(reader.get("a", DType::f16, {2, 3}), InputError);
  EXPECT_THROW(reader.get("a", DType::f32, {3, 2}), InputError);
  EXPECT_THROW(reader.get("a", DType::f32, {6}), InputError);
}

// A bit of each byte of a small file, but of white space; and of some bytes of a file of several blocks.
TEST_F(Safetensors, DamageIsFound) {
  for (const std::size_t count : {30u, 300'000u}) {
    std::vector<float> numbers(count);
    for (std::size_t i = 0; i < count; ++i) numbers[i] = static_cast<float>(i % 7);
    TensorWriter writer;
    writer.metadata("format", "octrad");
    writer.metadata("scene", "not UTF-8: \xff");
    writer.add("numbers", DType::f32, {3, static_cast<std::int64_t>(count / 3)}, numbers.data());
    writer.add("few", DType::u8, {3}, "abc");
    writer.write(file_);
    ASSERT_EQ(refusal(), "");
    std::ostringstream read;
    read << std::ifstream(file_, std::ios::binary).rdbuf();
    const std::string bytes = read.str();
    const std::size_t data = bytes.size() - count * sizeof(float) - 3;
    const std::size_t list = bytes.find("\"octrad.checksums\""),
                      list_end = list + 18;  // under another name it is no list
    const bool small = count == 30;
    for (std::size_t place = small ? 0 : data; place < bytes.size(); place += small ? 1 : 71'111) {
      if (bytes[place] == ' ' || (place >= list && place < list_end)) continue;
      std::string other = bytes;
      other[place] = static_cast<char>(other[place] ^ (1 << (place * 5 % 8)));
      std::ofstream(file_, std::ios::binary) << other;
      const std::string why = refusal();
      EXPECT_NE(why.find(place < data ? " is not a usable model file" : "is damaged: its checksum differs"),
                std::string::npos)
          << place << ": " << why;
    }
  }
}

// A checksum is the CRC-32 of zlib, so that other programs can make and check them.
TEST_F(Safetensors, ChecksumsAreThoseOfZlib) {
  TensorWriter writer;
  writer.add("digits", DType::u8, {9}, "123456789");
  writer.write(file_);
  const TensorReader reader(file_);
  EXPECT_EQ(reader.get("digits").checksum, 0xcbf43926u);
  EXPECT_EQ(reader.metadata().at("octrad.checksums"), R"({"__metadata__":"00000000","digits":"cbf43926"})");
  const std::string tensor = R"("digits":{"dtype":"U8","shape":[9],"data_offsets":[0,9]})";
  const auto with = [&](const std::string& list) {
    put("{\"__metadata__\":{\"octrad.checksums\":\"" + list + "\"}," + tensor + "}", "123456789");
    return refusal();
  };
  EXPECT_EQ(with(R"({\"__metadata__\":\"00000000\",\"digits\":\"cbf43926\"})"), "");
  for (const char* list :
       {"", "[]", "{}", R"({\"digits\":\"cbf43926\"})", R"({\"__metadata__\":\"00000000\",\"other\":\"cbf43926\"})",
        R"({\"__metadata__\":\"00000001\",\"digits\":\"cbf43926\"})",
        R"({\"__metadata__\":\"00000000\",\"digits\":\"CBF43926\"})",
        R"({\"__metadata__\":\"00000000\",\"digits\":0})"})
    EXPECT_NE(with(list).find("its header is damaged"), std::string::npos) << list;
  EXPECT_NE(with(R"({\"__metadata__\":\"00000000\",\"digits\":\"cbf43927\"})").find("tensor \"digits\" is damaged"),
            std::string::npos);
}

TEST_F(Safetensors, EmptyModelIsAFile) {
  TensorWriter().write(file_);
  EXPECT_TRUE(TensorReader(file_).names().empty());
}

TEST_F(Safetensors, ReadsUnalignedTensorsOfOtherWriters) {
  std::string data = "x";
  const float value = 3.5f;
  data.append(reinterpret_cast<const char*>(&value), 4);
  put(R"({"b":{"dtype":"U8","shape":[1],"data_offsets":[0,1]},"f":{"dtype":"F32","shape":[1],"data_offsets":[1,5]}})",
      data);
  const TensorReader reader(file_);
  EXPECT_EQ(values<float>(reader, "f"), std::vector<float>{3.5f});
}

TEST_F(Safetensors, MissingAndUnreadableFiles) {
  EXPECT_THROW(TensorReader(file_ + "x"), IoError);
  EXPECT_THROW(TensorReader(folder_.string()), IoError);
  EXPECT_THROW(TensorReader("/dev/null"), IoError);
}

TEST_F(Safetensors, RefusesBrokenFiles) {
  const auto tensor = [](const std::string& dtype, const std::string& shape, const std::string& offsets) {
    return R"({"t":{"dtype":)" + dtype + R"(,"shape":)" + shape + R"(,"data_offsets":)" + offsets + "}}";
  };
  const std::string data(16, 'x');
  struct Case {
    const char* why;
    std::string header;
    std::int64_t length;
  };
  put(tensor("\"F32\"", "[2,2]", "[0,16]"), data);
  ASSERT_EQ(refusal(), "") << "the sound file that the others are variants of";
  const Case cases[] = {
      {"claims", tensor("\"F32\"", "[2,2]", "[0,16]"), 1 << 20},
      {"claims", tensor("\"F32\"", "[2,2]", "[0,16]"), INT64_MAX},
      {"claims", tensor("\"F32\"", "[2,2]", "[0,16]"), INT64_MIN + 8},
      {"not a JSON object", "[]", -1},
      {"not a JSON object", "", -1},
      {"not valid JSON", "{\"t\":", -1},
      {"not valid JSON", "{\"t\":1}}", -1},
      {"not valid JSON", "{\"\xff\xfe\":1}", -1},
      {"nested too deeply", "{\"t\":" + std::string(100000, '['), -1},
      {"nested too deeply", R"({"t":{"a":{"a":{"a":{"a":{"a":{}}}}}}})", -1},
      {"lacks", R"({"t":{"dtype":"F32","shape":[4]}})", -1},
      {"lacks", R"({"t":5})", -1},
      {"dtype", tensor("\"F33\"", "[2,2]", "[0,16]"), -1},
      {"dtype", tensor("7", "[2,2]", "[0,16]"), -1},
      {"shape", tensor("\"F32\"", "\"2\"", "[0,16]"), -1},
      {"shape", tensor("\"F32\"", "[2,-2]", "[0,16]"), -1},
      {"shape", tensor("\"F32\"", "[2.0,2]", "[0,16]"), -1},
      {"shape", tensor("\"F32\"", "[18446744073709551615,4]", "[0,16]"), -1},
      {"shape", tensor("\"F32\"", "[1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,4]", "[0,16]"), -1},
      {"overflows", tensor("\"F32\"", "[4294967296,4294967296,4]", "[0,16]"), -1},
      {"overflows", tensor("\"F32\"", "[4611686018427387908]", "[0,16]"), -1},
      {"data_offsets", tensor("\"F32\"", "[2,2]", "[0]"), -1},
      {"data_offsets", tensor("\"F32\"", "[2,2]", "[-16,0]"), -1},
      {"data_offsets", tensor("\"F32\"", "[2,2]", "[0,1e1]"), -1},
      {"wrong order", tensor("\"F32\"", "[2,2]", "[16,0]"), -1},
      {"truncated", tensor("\"F32\"", "[2,4]", "[0,32]"), -1},
      {"truncated", tensor("\"F32\"", "[2,2]", "[18446744073709551600,18446744073709551615]"), -1},
      {"holds 16 bytes", tensor("\"F32\"", "[2,1]", "[0,16]"), -1},
      {"belong to no tensor", tensor("\"F32\"", "[1,2]", "[0,8]"), -1},
      {"belong to no tensor", tensor("\"F32\"", "[1,2]", "[8,16]"), -1},
      {"overlap",
       R"({"a":{"dtype":"F32","shape":[3],"data_offsets":[0,12]},"b":{"dtype":"F32","shape":[2],"data_offsets":[8,16]}})",
       -1},
      {"twice",
       R"({"a":{"dtype":"F32","shape":[4],"data_offsets":[0,16]},"a":{"dtype":"F32","shape":[4],"data_offsets":[0,16]}})",
       -1},
      {"metadata", R"({"__metadata__":{"a":1}})", -1},
      {"metadata", R"({"__metadata__":"a"})", -1},
  };
  for (const Case& c : cases) {
    put(c.header, data, c.length);
    const std::string text = refusal();
    EXPECT_NE(text.find(c.why), std::string::npos) << c.header.substr(0, 120) << "\n  gave: " << text;
    EXPECT_NE(text.find(file_), std::string::npos);
  }
}

TEST_F(Safetensors, RefusesEveryTruncation) {
  const std::vector<float> a(8, 1.0f);
  TensorWriter writer;
  writer.metadata("format", "octrad");
  writer.add("a", DType::f32, {8}, a.data());
  writer.write(file_);
  const std::string whole = read_file(file_);
  for (std::size_t n = 0; n < whole.size(); ++n) {
    std::ofstream(file_, std::ios::binary) << whole.substr(0, n);
    EXPECT_NE(refusal(), "") << n << " of " << whole.size() << " bytes";
  }
  std::ofstream(file_, std::ios::binary) << whole << "x";
  EXPECT_NE(refusal(), "");
  std::ofstream(file_, std::ios::binary) << whole;
  EXPECT_EQ(refusal(), "");
}

TEST_F(Safetensors, AFileThatChangesWhileItIsReadIsAnError) {
  const std::vector<float> a(1000, 1.0f);
  TensorWriter writer;
  writer.add("a", DType::f32, {1000}, a.data());
  writer.write(file_);
  const TensorReader replaced(file_);
  writer.write(file_);  // another file of that name
  EXPECT_EQ(values<float>(replaced, "a"), a);
  EXPECT_NO_THROW(replaced.require_unchanged());
  const TensorReader cut(file_);
  std::filesystem::resize_file(file_, 500);
  EXPECT_THROW(values<float>(cut, "a"), IoError);
  EXPECT_THROW(cut.require_unchanged(), IoError);
}

TEST_F(Safetensors, SurvivesFlippedHeaderBytes) {
  const std::vector<float> a(8, 1.0f);
  TensorWriter writer;
  writer.add("a", DType::f32, {8}, a.data());
  writer.write(file_);
  const std::string whole = read_file(file_);
  int accepted = 0;
  for (std::size_t i = 0; i < whole.size() - 32; ++i) {
    for (const char bits : {'\x01', '\x10', '\x80'}) {
      std::string broken = whole;
      broken[i] = static_cast<char>(broken[i] ^ bits);
      std::ofstream(file_, std::ios::binary) << broken;
      accepted += refusal().empty();  // a changed name or padding is fine; a crash or a read outside is not
    }
  }
  EXPECT_LT(accepted, 60);
}

TEST_F(Safetensors, FailedWritesKeepTheOldFile) {
  const float one = 1.0f, two = 2.0f;
  TensorWriter writer;
  writer.add("a", DType::f32, {1}, &one);
  writer.write(file_);
  writer.add("a", DType::f32, {1}, &two);
  EXPECT_THROW(writer.write(file_), IoError) << "the same name twice";
  EXPECT_EQ(values<float>(TensorReader(file_), "a"), std::vector<float>{1.0f});
  TensorWriter other;
  other.add("a", DType::f32, {1}, &one);
  EXPECT_THROW(other.write((folder_ / "none" / "m").string()), IoError);
  EXPECT_THROW(other.write("/dev/full"), IoError);
}

}  // namespace
}  // namespace octrad
