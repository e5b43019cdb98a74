// Where the elements and files of a scene come from: includes, aliases and folders.
#include "octrad/scene/description.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "octrad/base/folder_test_helper.h"
#include "octrad/base/join.h"
#include "octrad/scene/load.h"
#include "octrad/scene/texture.h"

namespace octrad {
namespace {

TEST(Description, IncludesAliasesAndPaths) {
  const TestFolder folder;
  const auto load = [&](const std::string& body) {
    return load_scene(
        folder.write("s.xml", "<scene version=\"3.0.0\"><sensor type=\"perspective\"/>" + body + "</scene>"));
  };
  std::filesystem::create_directories(folder.file("sub"));
  folder.write(
      "part.xml",
      R"(<scene version="3.0.0"><default name="r" value="0.1"/><bsdf type="diffuse" id="inner"><float name="reflectance" value="$r"/></bsdf></scene>)");
  folder.write("one.xml", R"(<bsdf type="conductor" id="single"/>)");
  folder.write("sub/q.obj", "v 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n");
  const Scene scene = load(
      R"(<default name="r" value="0.3"/><include filename="part.xml"/><include filename="one.xml"/><alias id="inner" as="outer"/><path value="sub"/>
    <shape type="sphere"><ref id="outer"/></shape><shape type="sphere"><ref id="single"/></shape><shape type="obj"><string name="filename" value="q.obj"/></shape>)");
  EXPECT_EQ(scene.materials[static_cast<std::size_t>(scene.shapes[0].material)].id, "inner");
  EXPECT_EQ(evaluate_texture(texture_view(scene.textures[static_cast<std::size_t>(
                                 scene.materials[static_cast<std::size_t>(scene.shapes[0].material)].reflectance)]),
                             {0, 0}),
            Vec3f(0.3f));
  EXPECT_EQ(scene.materials[static_cast<std::size_t>(scene.shapes[1].material)].type, BsdfType::conductor);
  // The folder of a <path> comes before that of the scene, and a later <path> before an earlier one.
  std::filesystem::create_directories(folder.file("late"));
  for (const auto& [name, x] : {std::pair{"q.obj", "7"}, {"late/q.obj", "9"}})
    folder.write(name, std::string("v ") + x + " 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n");
  const std::string named = R"(<shape type="obj"><string name="filename" value="q.obj"/></shape>)";
  for (const auto& [paths, x] :
       {std::pair{R"(<path value="sub"/>)", 1.0f}, {R"(<path value="sub"/><path value="late"/>)", 9.0f}, {"", 7.0f}})
    EXPECT_EQ(load(paths + named).meshes[0].positions[0].x, x) << paths;
}

TEST(Description, FilesAndFoldersBesideIncludedFiles) {
  const TestFolder folder;
  for (const char* name : {"sub/deep", "deep"}) std::filesystem::create_directories(folder.file(name));
  const auto mesh = [](const char* x) { return "v " + std::string(x) + " 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n"; };
  const auto shape = [](const std::string& file) {
    return R"(<shape type="obj"><string name="filename" value=")" + file + R"("/></shape>)";
  };
  folder.write("sub/a.xml", R"(<scene version="3.0.0"><path value="deep"/><include filename="b.xml"/></scene>)");
  folder.write("sub/b.xml",
               R"(<scene version="3.0.0">)" + shape("m.obj") + shape("n.obj") + shape("o.obj") + "</scene>");
  folder.write("sub/deep/m.obj", mesh("2"));  // the folder beside a.xml, not that beside the scene
  folder.write("deep/m.obj", mesh("3"));
  folder.write("n.obj", mesh("4"));  // the scene's folder comes first
  folder.write("sub/n.obj", mesh("5"));
  folder.write("sub/o.obj", mesh("6"));
  const Scene scene = load_scene(folder.write(
      "s.xml", R"(<scene version="3.0.0"><sensor type="perspective"/><include filename="sub/a.xml"/></scene>)"));
  ASSERT_EQ(scene.meshes.size(), 3u);
  for (const auto& [i, x] : {std::pair{0, 2.0f}, {1, 4.0f}, {2, 6.0f}})
    EXPECT_EQ(scene.meshes[static_cast<std::size_t>(i)].positions[0].x, x) << i;
  // A <path> inside of another.
  folder.write("sub/deep/p.obj", mesh("7"));
  const std::string sensor = R"(<scene version="3.0.0"><sensor type="perspective"/>)";
  EXPECT_EQ(load_scene(folder.write("t.xml", sensor + R"(<path value="sub"/><path value="./deep/../../sub/deep"/>)" +
                                                 shape("p.obj") + "</scene>"))
                .meshes[0]
                .positions[0]
                .x,
            7.0f);
  // The working directory comes last.
  std::filesystem::create_directories(folder.file("work"));
  folder.write("work/q.obj", mesh("8"));
  folder.write("work/n.obj", mesh("9"));
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(folder.file("work"));
  const Scene there = load_scene(folder.write("w.xml", sensor + shape("q.obj") + shape("n.obj") + "</scene>"));
  std::filesystem::current_path(before);
  EXPECT_EQ(there.meshes.at(0).positions[0].x, 8.0f);
  EXPECT_EQ(there.meshes.at(1).positions[0].x, 4.0f);
}

TEST(Description, WhatHasNoEffectIsNoMistake) {
  const TestFolder folder;
  const Scene scene = load_scene(folder.write("s.xml", R"(<scene version="3.0.0"><sensor type="perspective"/>
    <sampler type="independent"/><film type="hdrfilm"/><texture type="checkerboard"/>
    <shape type="sphere"><transform name="to_world"><translate/><scale/></transform></shape></scene>)"));
  EXPECT_EQ(scene.assumed.size(), 3u);
  EXPECT_NE(join(scene.assumed).find("a <sampler> at the top level without an id is not used"), std::string::npos)
      << join(scene.assumed);
  EXPECT_EQ(scene.spheres.at(0).center, Vec3f(0.0f));
}

TEST(Description, AnIncludedObjectHasTheNameOfItsInclude) {
  const TestFolder folder;
  folder.write("color.xml", R"(<rgb value="0.1 0.2 0.3"/>)");
  const Scene scene = load_scene(folder.write("s.xml", R"(<scene version="3.0.0"><sensor type="perspective"/>
    <shape type="sphere"><bsdf type="diffuse"><include filename="color.xml" name="reflectance"/></bsdf></shape></scene>)"));
  const Material& m = scene.materials[static_cast<std::size_t>(scene.shapes[0].material)];
  EXPECT_EQ(evaluate_texture(texture_view(scene.textures[static_cast<std::size_t>(m.reflectance)]), {0, 0}),
            Vec3f(0.1f, 0.2f, 0.3f));
}

}  // namespace
}  // namespace octrad
