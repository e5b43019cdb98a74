// Tables of a measured material, as one array with the places in it. Plain data, for host and device.
//
// Dupuy and Jakob 2018, "An Adaptive Parameterization for Efficient Material Acquisition and Rendering". Directions to
// the viewer are at the nodes phi x theta; for each there are grids over the unit square. Places on a grid are
// interpolated bilinearly, and so are the nodes.
#pragma once

#include <cstdint>

namespace octrad {

// Values of a grid, [nodes][height][width] or, where they are the same for all, [height][width]: from data[values] on.
struct MeasuredGrid {
  std::uint32_t values = 0;
  int width = 0, height = 0;
};

// A grid of densities, in units of cells: in each node the means of all cells add up to 1. With integrals of the cells
// before each point: over the rows before, and over the points before in the same row.
struct MeasuredDensity : MeasuredGrid {
  std::uint32_t rows = 0;     // [nodes][height]
  std::uint32_t columns = 0;  // [nodes][height][width]
};

struct MeasuredLayout {
  std::uint32_t phi = 0, theta = 0;  // of the nodes, ascending, in radians
  int phi_count = 0, theta_count = 0;
  bool isotropic = true;    // phi of half vectors is relative to that of the viewer
  int symmetry = 1;         // of phi, the nodes cover a part: 1: all, 2: y < 0, 4: x < 0 and y < 0
  bool is_density = false;  // `rgb` is to be multiplied by what the microfacets give
  // Tables by direction, theta along x and phi along y: how common normals are, and what area microfacets show.
  MeasuredGrid normals, area;
  MeasuredDensity visible_normals;  // by half vector
  MeasuredDensity luminance;        // by place in the distribution of visible normals
  std::uint32_t rgb = 0;            // reflectance times cosine there, [nodes][3][luminance.height][luminance.width]
};

}  // namespace octrad
