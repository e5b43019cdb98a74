# src/app/view/page becomes part of the program (app/view/page.h, page_files): sets OCTRAD_PAGE to the source.
set(entries)
foreach(file "index.html:/:text/html" "viewer.css:/viewer.css:text/css" "viewer.js:/viewer.js:text/javascript"
             "tools.js:/tools.js:text/javascript" "training.js:/training.js:text/javascript")
  string(REPLACE ":" ";" parts ${file})
  list(GET parts 0 name)
  list(GET parts 1 path)
  list(GET parts 2 type)
  octrad_literal(text ${PROJECT_SOURCE_DIR}/src/app/view/page/${name})
  string(APPEND entries "    PageFile{\"${path}\", \"${type}; charset=utf-8\", ${text}},\n")
endforeach()
set(OCTRAD_PAGE ${PROJECT_BINARY_DIR}/viewer_page.cc)
file(CONFIGURE OUTPUT ${OCTRAD_PAGE} @ONLY CONTENT [[// Written by cmake/page.cmake.
#include <array>

#include "app/view/page.h"

namespace octrad::viewer {
namespace {
constexpr std::array kFiles = {
@entries@};
}  // namespace
std::span<const PageFile> page_files() { return kFiles; }
}  // namespace octrad::viewer
]])
