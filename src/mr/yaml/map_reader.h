#pragma once

#include <filesystem>
#include <initializer_list>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mr/core/range.h"
#include "mr/core/user_text.h"
#include "mr/yaml/problem.h"
#include "mr/yaml/tree.h"

/// Typed access to the YAML tree that records every problem and continues.
namespace mr::yaml {

/// Collects the problems of one file.
class Report {
 public:
  /// `options`: the values of --set.
  Report(std::filesystem::path file, std::vector<std::string> options)
      : file_(std::move(file)), options_(std::move(options)) {}

  void problem(int line, std::string message);
  void notice(int line, std::string message);
  /// Reports that an environment variable is not set; once per variable.
  void unset_variable(int line, const std::string& name);
  /// Reports `count` missing files with `message`; `first` is one of them, `written` its name in
  /// the scene file. Several reports about one missing folder become one problem about the folder.
  void missing_files(int line, std::string message, const std::filesystem::path& first,
                     std::size_t count, const std::string& written);
  bool full() const;  ///< the limit of listed problems is reached

  /// The pseudo line number of option i; negative.
  int line_of_option(std::size_t i) const {
    return static_cast<int>(i) - static_cast<int>(options_.size());
  }

  /// Resolves a path relative to the file's own folder.
  std::filesystem::path resolve(const std::string& path) const;
  /// Whether `count` more files may be checked: bounds the work that a small scene file can cause.
  bool spend_files(std::size_t count);

  /// Moves out the problems, or notices, sorted by line.
  std::vector<Problem> take_problems();
  std::vector<Problem> take_notices();

 private:
  std::vector<Problem> by_line(std::vector<Problem> list) const;

  /// The files missing in one folder that does not exist.
  struct MissingFolder {
    int line = 0;         ///< of the first file
    std::string message;  ///< of the first file
    std::string remedy;   ///< may be empty
    std::size_t reported = 0, files = 0;
  };

  std::filesystem::path file_;
  std::vector<std::string> options_;
  std::vector<Problem> problems_, notices_;
  std::set<std::string> unset_;
  std::map<std::filesystem::path, MissingFolder> missing_;
  std::size_t files_ = 0;
};

/// " (first in line 7)"; empty: not in the file.
std::string first_in(int line);

/// A scalar with ${NAME} and ${NAME:-default} expanded.
std::optional<std::string> read_text(Report& report, const Node& node, const std::string& name);
std::optional<double> read_number(Report& report, const Node& node, const std::string& name,
                                  Range range);
/// A list of exactly out.size() numbers.
bool read_numbers(Report& report, const Node& node, const std::string& name, Range range,
                  std::span<double> out);
/// Whether an environment variable can have this name.
bool is_variable_name(std::string_view name);
/// A text of the form [A-Za-z0-9_-]{1,64}; a wrong one is reported and still returned.
std::optional<std::string> read_id(Report& report, const Node& node, const std::string& name);

/// Reads one mapping. Duplicate keys are reported at once, unknown keys (never read) in the
/// destructor. The getters return whether the key has a usable value; else the output is not
/// changed.
class MapReader {
 public:
  MapReader(Report& report, const Node& node, std::string name);
  ~MapReader();
  MapReader(const MapReader&) = delete;
  MapReader& operator=(const MapReader&) = delete;

  const Node* find(const std::string& key);
  /// As find, but a missing key is a problem.
  const Node* need(const std::string& key);
  /// Disables the report of unknown keys.
  void accept_all() { accept_all_ = true; }
  bool has(const std::string& key) { return find(key) != nullptr; }
  /// Reports, as a notice, that a key is accepted but has no effect.
  void not_acted_on(const std::string& key, const std::string& what);
  int line() const { return node_.line; }
  int line(const std::string& key) const;  ///< of the key; of the mapping where it is missing

  bool number(const std::string& key, double& out, Range range);
  /// A whole number.
  bool integer(const std::string& key, int& out, Range range);
  bool flag(const std::string& key, bool& out);
  bool text(const std::string& key, std::string& out);
  bool numbers(const std::string& key, Range range, std::span<double> out);
  /// A list of two whole numbers.
  bool size(const std::string& key, Range range, int& first, int& second);
  /// One of the words; sets `out` to the value beside it.
  template <typename T>
  bool choice(const std::string& key, T& out,
              std::initializer_list<std::pair<const char*, T>> choices);

  Report& report;

 private:
  std::optional<std::size_t> index(const std::string& key) const;
  void refuse_choice(const std::string& key, const std::string& value,
                     const std::vector<std::string>& words);

  const Node& node_;
  std::string name_;
  std::vector<std::string> asked_;
  bool accept_all_ = false;
};

template <typename T>
bool MapReader::choice(const std::string& key, T& out,
                       std::initializer_list<std::pair<const char*, T>> choices) {
  std::string value;
  if (!text(key, value)) return false;
  std::vector<std::string> words;
  for (const auto& [word, meaning] : choices) {
    if (value == word) {
      out = meaning;
      return true;
    }
    words.push_back(word);
  }
  refuse_choice(key, value, words);
  return false;
}

}  // namespace mr::yaml
