#include "app/cli/info_plugins.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>

#include "octrad/base/error.h"
#include "octrad/base/join.h"
#include "octrad/scene/plugin_help.h"
#include "octrad/scene/plugins.h"

namespace octrad::cli {
namespace {

constexpr std::size_t kLongestLine = 100, kShortestLine = 40, kIndent = 19;

// Columns of a line: those of the terminal, and no more than are easy to read.
std::size_t line_columns() {
  winsize size{};
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return kLongestLine;
  return std::clamp<std::size_t>(size.ws_col, kShortestLine, kLongestLine);
}

// Characters of UTF-8, each a column wide.
std::size_t columns_of(const std::string& text) {
  return static_cast<std::size_t>(
      std::ranges::count_if(text, [](char c) { return (static_cast<unsigned char>(c) & 0xC0) != 0x80; }));
}

// Markdown for a terminal: back-quotes and the addresses of links are left out.
std::string without_marks(std::string text) {
  for (std::size_t at = text.find("]("); at != std::string::npos; at = text.find("](", at)) {
    text.erase(at, text.find(')', at) + 1 - at);
    if (const std::size_t open = text.rfind('[', at); open != std::string::npos) text.erase(open, 1);
  }
  std::erase(text, '`');
  return text;
}

// Names in a first column, the text beside them, or below where the names are too long.
std::string help_entry(const std::string& names, const std::string& markdown, std::size_t columns) {
  const std::string margin = "\n" + std::string(kIndent, ' ');
  std::string out = fmt::format("  {:<{}}", names, kIndent - 2);
  if (names.size() + 3 > kIndent) out = "  " + names + margin;
  std::size_t column = kIndent;
  const std::string text = without_marks(markdown);
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find(' ', at), text.size());
    const std::string word = text.substr(at, end - at);
    at = end + 1;
    const std::size_t size = columns_of(word);
    if (column > kIndent && column + 1 + size > columns) {
      out += margin;
      column = kIndent;
    } else if (column > kIndent) {
      out += ' ';
      ++column;
    }
    out += word;
    column += size;
  }
  return out + "\n";
}

// An entry's text with that of the type whose parameters it has, too.
std::string whole_text(const PluginKindHelp& kind, const PluginHelp& entry) {
  for (const PluginHelp& other : kind.entries) {
    if (std::ranges::find(other.types, entry.as) != other.types.end())
      return whole_text(kind, other) + ", " + entry.text;
  }
  return entry.text;
}

// Those of `types` that `name` chooses: a kind of objects, one type, or all.
std::vector<std::string> chosen_types(std::vector<std::string> types, const std::string& tag, const std::string& name) {
  if (name != kAllPlugins && name != tag) std::erase_if(types, [&](const std::string& type) { return type != name; });
  return types;
}

std::string plugins_text(const std::string& name) {
  const std::size_t columns = line_columns();
  std::string out;
  for (const PluginKindHelp& kind : plugin_help()) {
    std::string entries;
    for (const PluginHelp& entry : kind.entries) {
      const std::vector<std::string> types = chosen_types(entry.types, kind.tag, name);
      if (!types.empty()) entries += help_entry(join(types), whole_text(kind, entry), columns);
    }
    if (entries.empty()) continue;
    out += (out.empty() ? "" : "\n") + kind.tag + "\n";
    if (!kind.all.empty()) out += help_entry("all", kind.all, columns);
    out += entries;
  }
  return out;
}

// {tag: [types], ..., "help": {tag: {"all", "entries": [{"types", "as", "text"}]}, ...}}, texts in Markdown.
nlohmann::json plugins_json(const std::string& name) {
  const auto text_or_null = [](const std::string& text) {
    return text.empty() ? nlohmann::json(nullptr) : nlohmann::json(text);
  };
  nlohmann::json out = nlohmann::json::object(), help = nlohmann::json::object();
  for (const auto& [tag, all_types] : plugin_types()) {
    if (const std::vector<std::string> types = chosen_types(all_types, tag, name); !types.empty()) out[tag] = types;
  }
  for (const PluginKindHelp& kind : plugin_help()) {
    nlohmann::json entries = nlohmann::json::array();
    for (const PluginHelp& entry : kind.entries) {
      const std::vector<std::string> types = chosen_types(entry.types, kind.tag, name);
      if (!types.empty()) entries.push_back({{"types", types}, {"as", text_or_null(entry.as)}, {"text", entry.text}});
    }
    if (!entries.empty()) help[kind.tag] = {{"all", text_or_null(kind.all)}, {"entries", entries}};
  }
  out["help"] = help;
  return out;
}

}  // namespace

void info_plugins(const CommonOptions& common, const std::string& name) {
  std::vector<std::string> tags, names = {kAllPlugins};
  for (const auto& [tag, types] : plugin_types()) {
    tags.push_back(tag);
    names.push_back(tag);
    names.insert(names.end(), types.begin(), types.end());
  }
  if (std::ranges::find(names, name) == names.end()) {
    throw UsageError(fmt::format("--plugins: no kind or type of objects is called \"{}\"{}; kinds: {}", name,
                                 did_you_mean(name, names), join(tags)));
  }
  if (common.json) print_json(plugins_json(name));
  else print_text(plugins_text(name));
}

}  // namespace octrad::cli
