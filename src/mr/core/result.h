#pragma once

#include <string>
#include <utility>
#include <variant>

#include "mr/core/assert.h"

namespace mr {

/// A failure caused by bytes, files, devices or peers. Programming errors: MR_ASSERT.
struct Error {
  /// Causes are counted by name; `message` is one line that names what and where.
  enum class Cause { invalid, corrupt, too_large, not_found, io, unsupported, empty, over_budget };

  Cause cause = Cause::invalid;
  std::string message;
  friend bool operator==(const Error&, const Error&) = default;
};

/// "invalid", "corrupt", …: the name under which a cause is counted.
inline const char* cause_name(Error::Cause cause) {
  constexpr const char* kNames[] = {"invalid", "corrupt",     "too_large", "not_found",
                                    "io",      "unsupported", "empty",     "over_budget"};
  return kNames[static_cast<int>(cause)];
}

/// A value or an Error (C++20 has no std::expected). Test it before taking the value.
template <typename T>
class [[nodiscard]] Result {
 public:
  Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}  // implicit by design
  Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}

  explicit operator bool() const { return state_.index() == 0; }
  bool ok() const { return state_.index() == 0; }

  T& operator*() & { return checked(); }
  const T& operator*() const& { return const_cast<Result*>(this)->checked(); }
  T&& operator*() && { return std::move(checked()); }
  T* operator->() { return &checked(); }
  const T* operator->() const { return &const_cast<Result*>(this)->checked(); }

  const Error& error() const {
    MR_ASSERT(!ok());
    return std::get<1>(state_);
  }

 private:
  T& checked() {
    MR_ASSERT(ok());
    return *std::get_if<0>(&state_);
  }

  std::variant<T, Error> state_;
};

/// Success or an Error.
template <>
class [[nodiscard]] Result<void> {
 public:
  Result() = default;
  Result(Error error) : error_(std::move(error)), ok_(false) {}

  explicit operator bool() const { return ok_; }
  bool ok() const { return ok_; }
  const Error& error() const {
    MR_ASSERT(!ok_);
    return error_;
  }

 private:
  Error error_;
  bool ok_ = true;
};

using Status = Result<void>;

}  // namespace mr
