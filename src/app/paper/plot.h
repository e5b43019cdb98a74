// Plots with logarithmic axes as SVG.
#pragma once

#include <string>
#include <vector>

namespace octrad::paper {

struct Series {
  std::string name;
  std::vector<std::pair<double, double>> points;  // both above 0; others are left out
  bool line = true;                               // joined; false: single points with the name beside them
};

// Colours, dashes and marks tell series apart, on paper too; series of one name look alike in all plots of a page when
// `names` lists them in one order. Empty when nothing can be drawn.
std::string log_log_plot(const std::vector<Series>& series, const std::vector<std::string>& names,
                         const std::string& x_title, const std::string& y_title);

}  // namespace octrad::paper
