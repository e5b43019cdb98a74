#include "octrad/shading/compact_texture.h"

#include <gtest/gtest.h>

#include "octrad/base/rng.h"

namespace octrad {
namespace {

Texture random_bitmap(int width, int height, int levels) {
  Texture t;
  t.kind = Texture::Kind::bitmap;
  t.width = width;
  t.height = height;
  Rng rng(1, RngPurpose::test, 0);
  for (int i = 0; i < width * height; ++i) {
    Vec3f v;
    for (int c = 0; c < 3; ++c) v[c] = static_cast<float>(rng.below(static_cast<std::uint32_t>(levels))) / 255.0f;
    t.pixels.push_back(v);
  }
  return t;
}

TEST(CompactTexture, SameBitsAsTheTexture) {
  for (const auto filter : {Texture::Filter::bilinear, Texture::Filter::nearest}) {
    for (const auto wrap : {Texture::Wrap::repeat, Texture::Wrap::clamp}) {
      Texture t = random_bitmap(71, 67, 256);
      t.filter = filter;
      t.wrap = wrap;
      const float to_uv[6] = {2.0f, 0.3f, 0.1f, -0.2f, 1.5f, -0.4f};
      std::copy(to_uv, to_uv + 6, t.to_uv);
      const auto compact = CompactTexture::make(t);
      ASSERT_TRUE(compact);
      Rng rng(2, RngPurpose::test, 0);
      for (int i = 0; i < 5000; ++i) {
        const Vec2f uv = rng.uniform2() * 6.0f - Vec2f{3.0f, 3.0f};
        ASSERT_EQ(evaluate_texture(compact->view(), uv), evaluate_texture(texture_view(t), uv)) << uv.x << " " << uv.y;
        CompactTexture::prefetch(compact->view(), uv);
      }
      for (const Vec2f uv :
           {Vec2f{0, 0}, Vec2f{1, 1}, Vec2f{-1, 2}, Vec2f{1e20f, 0.5f}, Vec2f{NAN, 0.5f}, Vec2f{INFINITY, -INFINITY}}) {
        const Vec3f a = evaluate_texture(compact->view(), uv), b = evaluate_texture(texture_view(t), uv);
        for (int c = 0; c < 3; ++c) EXPECT_TRUE(a[c] == b[c] || (std::isnan(a[c]) && std::isnan(b[c]))) << uv.x;
      }
    }
  }
}

TEST(CompactTexture, RefusesWhatItCannotHold) {
  EXPECT_TRUE(CompactTexture::make(random_bitmap(128, 128, 256)));
  EXPECT_FALSE(CompactTexture::make(random_bitmap(128, 128, 400))) << "more numbers than a byte tells apart";
  EXPECT_FALSE(CompactTexture::make(random_bitmap(8, 8, 16))) << "small";
  EXPECT_FALSE(CompactTexture::make(Texture{}));
}

}  // namespace
}  // namespace octrad
