#include "octrad/base/version.h"

namespace octrad {
const char* const kVersion = OCTRAD_VERSION;
}
