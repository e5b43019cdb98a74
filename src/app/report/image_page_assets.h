// The style sheet and the script of image_page.h.
#pragma once

namespace octrad::report {

extern const char* const kViewerStyle;
extern const char* const kViewerScript;

}  // namespace octrad::report
