# configs/paper/*.json become part of the program (app/paper/matrix.h, builtin_matrices): sets OCTRAD_MATRICES to the source.
file(GLOB matrices CONFIGURE_DEPENDS configs/paper/*.json)
set(main ${PROJECT_SOURCE_DIR}/configs/paper/main.json)  # first: what runs when none is named
list(REMOVE_ITEM matrices ${main})
set(entries)
foreach(matrix ${main} ${matrices})
  get_filename_component(name ${matrix} NAME_WE)
  octrad_literal(text ${matrix})
  string(APPEND entries "    std::pair{\"${name}\", ${text}},\n")
endforeach()
set(OCTRAD_MATRICES ${PROJECT_BINARY_DIR}/builtin_matrices.cc)
file(CONFIGURE OUTPUT ${OCTRAD_MATRICES} @ONLY CONTENT [[// Written by cmake/matrices.cmake.
#include <array>

#include "app/paper/matrix.h"

namespace octrad::paper {
namespace {
constexpr std::array kMatrices = {
@entries@};
}  // namespace
std::span<const std::pair<const char*, const char*>> builtin_matrices() { return kMatrices; }
}  // namespace octrad::paper
]])
