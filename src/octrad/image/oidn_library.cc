#include "octrad/image/oidn_library.h"

#include <dlfcn.h>

#include <cstdlib>
#include <filesystem>

#include "octrad/base/error.h"
#include "octrad/base/log.h"

namespace octrad {
namespace {

namespace fs = std::filesystem;

constexpr const char* kName = "libOpenImageDenoise.so.2";
constexpr const char* kHowToGet =
    "scripts/install_oidn.sh (or \"pip install pyoidn\") gets it, --oidn-library FILE names one that is elsewhere";

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

// PREFIX/lib/python3*/{site,dist}-packages/pyoidn/oidn/lib
void add_python_packages(std::vector<std::string>& places, const fs::path& prefix) {
  std::error_code failed;
  for (const fs::directory_entry& entry : fs::directory_iterator(prefix / "lib", failed)) {
    if (entry.path().filename().string().rfind("python3", 0) != 0) continue;
    for (const char* packages : {"site-packages", "dist-packages"}) {
      const fs::path library = entry.path() / packages / "pyoidn/oidn/lib" / kName;
      if (fs::exists(library, failed)) places.push_back(library.string());
    }
  }
}

// Since version 2.5 the library needs another one, which it looks for in a folder `lib` beside its own. Once that is
// loaded from its own folder, it is not looked for.
void load_core_beside(const fs::path& library) {
  std::error_code failed;
  for (const fs::directory_entry& entry : fs::directory_iterator(library.parent_path(), failed)) {
    if (entry.path().filename().string().starts_with("libOpenImageDenoise_core.so.2"))
      dlopen(entry.path().c_str(), RTLD_NOW | RTLD_LOCAL);
  }
}

}  // namespace

std::vector<std::string> OidnLibrary::search_places() {
  std::vector<std::string> places;
  std::error_code failed;
  const auto add = [&](const fs::path& library) {
    if (fs::exists(library, failed)) places.push_back(library.string());
  };
  const fs::path program = fs::read_symlink("/proc/self/exe", failed).parent_path();
  const std::string home = environment("HOME");
  if (!program.empty()) {
    add(program / kName);
    add(program.parent_path() / "lib/octrad" / kName);
  }
  if (!home.empty()) add(fs::path(home) / ".local/lib/octrad" / kName);
  places.emplace_back(kName);  // the dynamic linker looks for a name without a folder
  for (const std::string& prefix :
       {environment("VIRTUAL_ENV"), environment("CONDA_PREFIX"), home.empty() ? "" : home + "/.local",
        std::string("/usr/local"), std::string("/usr")})
    if (!prefix.empty()) add_python_packages(places, prefix);
  return places;
}

OidnLibrary::OidnLibrary(const std::string& given) {
  const std::string named = given.empty() ? environment(oidn::kLibraryVariable) : given;
  if (!named.empty()) {
    std::error_code failed;
    const std::string file = fs::is_directory(named, failed) ? (fs::path(named) / kName).string() : named;
    const std::string from = given.empty() ? std::string(oidn::kLibraryVariable) + ": " : "";
    if (!fs::exists(file, failed)) throw IoError(from + file + ": no such file; " + kHowToGet);
    load(file);
    return;
  }
  for (const std::string& place : search_places()) {
    try {
      load(place);
      return;
    } catch (const Error& error) {
      log_verbose("{}", error.what());
    }
  }
  throw IoError(std::string("Intel Open Image Denoise 2 is needed to denoise and was not found: ") + kHowToGet);
}

void OidnLibrary::load(const std::string& file) {
  load_core_beside(file);
  // Never unloaded: its threads may outlive what they were started for.
  void* library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) {
    const char* reason = dlerror();
    throw InputError(file + ": cannot be loaded as a library: " + (reason == nullptr ? "unknown reason" : reason));
  }
  const auto find = [&](auto& function, const char* name) {
    function = reinterpret_cast<std::remove_reference_t<decltype(function)>>(dlsym(library, name));
    if (function == nullptr) {
      dlclose(library);
      throw InputError(file + ": not Open Image Denoise 2: it has no " + name);
    }
  };
#define OCTRAD_FIND(name) find(functions_.name, #name)
  OCTRAD_FIND(oidnNewDevice);
  OCTRAD_FIND(oidnSetDeviceInt);
  OCTRAD_FIND(oidnSetDeviceBool);
  OCTRAD_FIND(oidnGetDeviceInt);
  OCTRAD_FIND(oidnCommitDevice);
  OCTRAD_FIND(oidnGetDeviceError);
  OCTRAD_FIND(oidnReleaseDevice);
  OCTRAD_FIND(oidnNewBuffer);
  OCTRAD_FIND(oidnReadBuffer);
  OCTRAD_FIND(oidnWriteBuffer);
  OCTRAD_FIND(oidnReleaseBuffer);
  OCTRAD_FIND(oidnNewFilter);
  OCTRAD_FIND(oidnSetFilterImage);
  OCTRAD_FIND(oidnSetFilterBool);
  OCTRAD_FIND(oidnSetFilterInt);
  OCTRAD_FIND(oidnCommitFilter);
  OCTRAD_FIND(oidnExecuteFilter);
  OCTRAD_FIND(oidnReleaseFilter);
#undef OCTRAD_FIND
  Dl_info where{};
  const bool known = dladdr(reinterpret_cast<const void*>(functions_.oidnNewDevice), &where) != 0;
  file_ = known && where.dli_fname != nullptr ? where.dli_fname : file;
}

}  // namespace octrad
