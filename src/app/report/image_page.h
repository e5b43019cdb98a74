// Pictures in a web page: flip between them, zoom and pan them together, change the exposure, see errors and values.
// Pages need no network and no other file; the pixels are in them as half floats.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "octrad/image/image.h"

namespace octrad::report {

struct PageImage {
  std::string name;     // as the page shows it
  Image image;          // its colour is shown: linear radiance, or display-referred (PNG)
  std::string caption;  // below the picture, may be empty
};

// What all viewers of a page share: <style> and <script>, once in its <head>.
std::string viewer_head();

// One viewer, a <figure>: the first picture is the reference when `has_reference`, and the others have error maps then.
// `id`: unique in the page, letters and digits. `largest_side`: pictures with a longer side are made smaller by whole
// factors (means of blocks); 0: never. 8 bytes a pixel and picture. Throws InputError when there are no pictures, or
// sizes differ.
std::string viewer_html(const std::string& id, const std::vector<PageImage>& images, bool has_reference,
                        int largest_side = 0);

// A whole page: title, `body` as it is (HTML), with viewer_head().
std::string page_html(const std::string& title, const std::string& body);

// Bytes as base64 (RFC 4648), for data: addresses.
std::string base64(const std::vector<std::uint8_t>& bytes);

}  // namespace octrad::report
