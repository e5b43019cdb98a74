// The folder of a run: every command that ran, with what it printed, so that nothing is done twice.
#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

namespace octrad::paper {

// A command that did not work: how it ended, and why in a sentence.
struct CommandFailed {
  int exit_code = 0;
  std::string message, command;
};
struct Interrupted {};  // this process was asked to end

class Store {
 public:
  explicit Store(std::string folder);
  // Makes the folder where it is missing. Throws IoError where nothing can be written there.
  void open();

  const std::string& folder() const { return folder_; }
  std::string path(const std::string& name) const { return folder_ + "/" + name; }
  bool has(const std::string& name) const;
  void make_folder(const std::string& name) const;
  // `name` becomes a link to `target`. Throws InputError when it is one to something else.
  void link(const std::string& name, const std::string& target) const;
  // JSON files, whole or not at all. read() gives null where there is none or it is broken.
  nlohmann::json read(const std::string& name) const;
  std::string read_text(const std::string& name) const;  // throws IoError
  void write(const std::string& name, const nlohmann::json& value) const;
  void write_text(const std::string& name, const std::string& text) const;
  void remove(const std::string& name) const;  // a file, or a folder with what is in it

  // Words that every command gets, such as --threads, and what is called while one runs.
  std::vector<std::string> common;
  std::function<void()> waiting = [] {};

  // `octrad WORDS...`, whose record {command, seconds, peak_bytes, output} is kept in `record`; one that is there
  // already is taken from there. Messages go to log.txt beside it. Throws CommandFailed, Interrupted, or IoError when
  // files cannot be written.
  nlohmann::json command(const std::string& record, const std::vector<std::string>& words) const;
  // The same, without keeping a record.
  nlohmann::json ask(const std::vector<std::string>& words, const std::string& log) const;

 private:
  // Throws IoError where the folder was removed, or is another one now: nothing is made again in its place.
  void require_there() const;

  std::string folder_;
  std::pair<std::uint64_t, std::uint64_t> identity_{};  // device and inode
};

}  // namespace octrad::paper
