#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace mr::test {

using Json = nlohmann::ordered_json;

/// The part of JSON Schema (draft 7) that scene.schema.json uses; another keyword throws.
class JsonSchema {
 public:
  explicit JsonSchema(Json root) : root_(std::move(root)) {}

  const Json& root() const { return root_; }
  bool accepts(const Json& value) const { return fits(root_, value); }
  bool fits(const Json& schema, const Json& value) const;
  /// A schema with all that it takes in by $ref, allOf and anyOf, itself first.
  std::vector<const Json*> parts(const Json& schema) const;

 private:
  bool fits_keyword(const std::string& keyword, const Json& schema, const Json& value) const;

  Json root_;
};

}  // namespace mr::test
