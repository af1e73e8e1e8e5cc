#pragma once

#include <filesystem>
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

/// The text of a file; empty, and the test fails, where it cannot be read.
std::string text_of(const std::filesystem::path& file);
/// schema/scene.schema.json.
JsonSchema scene_schema();
/// A key of the schema: an entry of `properties` with a description. (Others only narrow one.)
inline bool is_key(const Json& schema) {
  return schema.is_object() && schema.contains("description");
}

}  // namespace mr::test
