// Pictures of the report: shown, cut out, and as error maps, embedded into the page.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "app/paper/store.h"

namespace octrad::paper {

// What is compared in one view: the reference first.
struct ViewPicture {
  std::string title, caption, anchor;  // name, figures below it, place of its commands
  std::string file;                    // EXR in the store
};

// A viewer that flips between the pictures (report::viewer_html), and for paper every picture with its cut-out and
// error map, whose files are kept in the folder pictures/ too. Pictures that cannot be read are left out. `name`:
// unique in the page; `viewer_side`: as report::viewer_html takes it; none: no viewer.
std::string view_figure(const Store& store, const std::string& name, const std::vector<ViewPicture>& pictures,
                        std::optional<int> viewer_side);

// A row of colours in [0, 1], such as features.
std::string color_figure(const Store& store, const std::string& name, const std::vector<ViewPicture>& pictures);

// A row of quantities in false colours, black 0, white the 90th percentile of the first picture.
std::string quantity_figure(const Store& store, const std::string& name, const std::vector<ViewPicture>& pictures);

}  // namespace octrad::paper
