#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "mr/core/frame.h"
#include "mr/core/result.h"

/// Text files of data sets: words apart by white space or commas, lines that begin with # are
/// comments.
namespace mr::sensor {

/// Goes through the lines that hold something. Line ends may be \n or \r\n.
class TextLines {
 public:
  explicit TextLines(std::string_view text) : rest_(text) {}

  /// Goes to the next line; false at the end.
  bool next();
  int number() const { return number_; }                                 ///< of the line, from 1
  const std::vector<std::string_view>& words() const { return words_; }  ///< at least one

 private:
  std::string_view rest_;
  int number_ = 0;
  std::vector<std::string_view> words_;
};

/// A number, also "inf", "nan" and "-1.#IND"; nothing for other text.
std::optional<double> number_of(std::string_view word);

/// A time in seconds as a decimal number, such as 1305031102.175304 or 1.3050e+09, exact to the
/// nanosecond. Nothing for other text and beyond ± 9e9 s.
std::optional<TimePoint> time_of_seconds(std::string_view word);

/// A whole text file. Errors name it; too_large beyond `max_bytes`.
Result<std::string> read_text_file(const std::filesystem::path& file,
                                   std::size_t max_bytes = std::size_t{64} << 20);

/// Whether a .json file of up to 1 MiB has a key of this name, somewhere: enough to tell whose it
/// is.
bool is_json_with_key(const std::filesystem::path& file, std::string_view key);

}  // namespace mr::sensor
