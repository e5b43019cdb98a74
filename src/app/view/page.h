// The page of `octrad view`: its files of src/app/view/page, which are part of the program (cmake/page.cmake).
#pragma once

#include <span>
#include <string_view>

namespace octrad::viewer {

struct PageFile {
  std::string_view path, type, text;
};
std::span<const PageFile> page_files();

}  // namespace octrad::viewer
