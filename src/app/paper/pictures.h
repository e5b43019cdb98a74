// Pictures of the report: shown, cut out, and as error maps, embedded into the page.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "app/paper/store.h"

namespace octrad::paper {

// What is compared in one view: the reference first.
struct ViewPicture {
  std::string title, caption, anchor;  // name, figures below it, place of its commands
  std::string file;                    // EXR in the store
};

// One figure: every picture with its cut-out and error map. Files are kept in the folder pictures/ too. Pictures that
// cannot be read are left out.
std::string view_figure(const Store& store, const std::string& name, const std::vector<ViewPicture>& pictures);

// A row of colours in [0, 1], such as features.
std::string color_figure(const Store& store, const std::string& name, const std::vector<ViewPicture>& pictures);

// A row of quantities in false colours, black 0, white the 98th percentile of the first picture.
std::string quantity_figure(const Store& store, const std::string& name, const std::vector<ViewPicture>& pictures);

}  // namespace octrad::paper
