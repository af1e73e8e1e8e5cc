#pragma once

#include <concepts>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "mr/core/timeline.h"

namespace mr {

/// The length of a source.
struct SourceContent {
  std::size_t items = 0;  ///< frames before it ends or starts again; 0: not known
  bool loops = false;     ///< starts again after the last
};

/// The config of one type of source: a plain struct that can be compared with ==.
template <typename T>
concept SourceConfigType = requires(const T& config) {
  { T::kType } -> std::convertible_to<std::string_view>;  // as scene files and reports name it
  { config.content() } -> std::same_as<SourceContent>;
};

/// The config of a sensor's source, of any type, as a value (type erasure). Only the module that
/// implements a type of source, and callers of get_if(), name that type.
class SourceConfig {
 public:
  SourceConfig() = default;  ///< no source
  template <SourceConfigType T>
  SourceConfig(T config) : held_(std::make_unique<Held<T>>(std::move(config))) {}
  SourceConfig(const SourceConfig& other) : held_(other.held_ ? other.held_->clone() : nullptr) {}
  SourceConfig(SourceConfig&&) noexcept = default;
  SourceConfig& operator=(SourceConfig other) noexcept {
    held_ = std::move(other.held_);
    return *this;
  }
  ~SourceConfig() = default;

  /// The config if it is of type T, else null.
  template <SourceConfigType T>
  T* get_if() {
    auto* held = dynamic_cast<Held<T>*>(held_.get());
    return held ? &held->config : nullptr;
  }
  template <SourceConfigType T>
  const T* get_if() const {
    return const_cast<SourceConfig*>(this)->get_if<T>();
  }

  std::string_view type() const { return held_ ? held_->type() : "none"; }
  SourceContent content() const { return held_ ? held_->content() : SourceContent{}; }

  /// The invalid fields, one line each; empty: valid (`problems()` of the config).
  std::vector<std::string> problems() const {
    return held_ ? held_->problems() : std::vector<std::string>{"there is none"};
  }
  /// The files that the frames are read from; empty for types without a list of files (`files()` of
  /// the config).
  std::vector<std::filesystem::path> files() const {
    return held_ ? held_->files() : std::vector<std::filesystem::path>{};
  }
  /// A warning in one line if the median of all measured depths is implausible, with advice (such
  /// as a wrong unit); nothing if it is plausible (`depth_hint()` of the config).
  std::optional<std::string> depth_hint(double median_m) const {
    return held_ ? held_->depth_hint(median_m) : std::nullopt;
  }

  /// The recording's own clock; nothing for sources without one, whose item i is captured at i /
  /// fps
  /// (`clock()` of the config).
  std::optional<SourceClock> clock() const { return held_ ? held_->clock() : std::nullopt; }

  friend bool operator==(const SourceConfig& a, const SourceConfig& b) {
    return a.held_ && b.held_ ? a.held_->equals(*b.held_) : a.held_ == b.held_;
  }

 private:
  struct Holder {
    virtual ~Holder() = default;
    virtual std::unique_ptr<Holder> clone() const = 0;
    virtual bool equals(const Holder& other) const = 0;
    virtual std::string_view type() const = 0;
    virtual SourceContent content() const = 0;
    virtual std::vector<std::string> problems() const = 0;
    virtual std::vector<std::filesystem::path> files() const = 0;
    virtual std::optional<std::string> depth_hint(double median_m) const = 0;
    virtual std::optional<SourceClock> clock() const = 0;
  };

  template <typename T>
  struct Held final : Holder {
    explicit Held(T value) : config(std::move(value)) {}
    std::unique_ptr<Holder> clone() const override { return std::make_unique<Held>(config); }
    bool equals(const Holder& other) const override {
      const auto* same = dynamic_cast<const Held*>(&other);
      return same && config == same->config;
    }
    std::string_view type() const override { return T::kType; }
    SourceContent content() const override { return config.content(); }
    std::vector<std::string> problems() const override {
      if constexpr (requires { config.problems(); })
        return config.problems();
      else
        return {};
    }
    std::vector<std::filesystem::path> files() const override {
      if constexpr (requires { config.files(); })
        return config.files();
      else
        return {};
    }
    std::optional<std::string> depth_hint([[maybe_unused]] double median_m) const override {
      if constexpr (requires { config.depth_hint(median_m); })
        return config.depth_hint(median_m);
      else
        return std::nullopt;
    }
    std::optional<SourceClock> clock() const override {
      if constexpr (requires { config.clock(); })
        return config.clock();
      else
        return std::nullopt;
    }
    T config;
  };

  std::unique_ptr<Holder> held_;
};

}  // namespace mr
