#include "scene/json_schema.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <regex>
#include <stdexcept>

#include "mr/core/file.h"

namespace mr::test {
namespace {

bool is_of_type(const std::string& type, const Json& value) {
  if (type == "object") return value.is_object();
  if (type == "array") return value.is_array();
  if (type == "string") return value.is_string();
  if (type == "boolean") return value.is_boolean();
  if (type == "number") return value.is_number();
  if (type == "integer")
    return value.is_number() && value.get<double>() == std::floor(value.get<double>());
  throw std::runtime_error("type " + type + " is not known here");
}

const std::regex& compiled(const std::string& pattern) {
  static std::map<std::string, std::regex> all;
  const auto known = all.find(pattern);
  return known != all.end() ? known->second : all.emplace(pattern, pattern).first->second;
}

/// "#/definitions/id"
const Json& definition(const Json& root, const std::string& ref) {
  return root.at(Json::json_pointer(ref.substr(1)));
}

}  // namespace

bool JsonSchema::fits(const Json& schema, const Json& value) const {
  if (schema.is_boolean()) return schema.get<bool>();
  for (const auto& [keyword, rule] : schema.items())
    if (!fits_keyword(keyword, schema, value)) return false;
  return true;
}

bool JsonSchema::fits_keyword(const std::string& keyword, const Json& schema,
                              const Json& value) const {
  const Json& rule = schema.at(keyword);
  const auto number = [&] { return value.get<double>(); };
  const auto fits_value = [&](const Json& other) { return fits(other, value); };
  if (keyword == "$ref") return fits(definition(root_, rule), value);
  if (keyword == "allOf") return std::all_of(rule.begin(), rule.end(), fits_value);
  if (keyword == "anyOf") return std::any_of(rule.begin(), rule.end(), fits_value);
  if (keyword == "oneOf") return std::count_if(rule.begin(), rule.end(), fits_value) == 1;
  if (keyword == "not") return !fits(rule, value);
  if (keyword == "if") return !fits(rule, value) || fits(schema.at("then"), value);
  if (keyword == "const") return value == rule;
  if (keyword == "enum") return std::find(rule.begin(), rule.end(), value) != rule.end();
  if (keyword == "type") {
    if (rule.is_string()) return is_of_type(rule, value);
    return std::any_of(rule.begin(), rule.end(),
                       [&](const Json& type) { return is_of_type(type, value); });
  }
  if (keyword == "minimum") return !value.is_number() || number() >= rule.get<double>();
  if (keyword == "exclusiveMinimum") return !value.is_number() || number() > rule.get<double>();
  if (keyword == "maximum") return !value.is_number() || number() <= rule.get<double>();
  if (keyword == "pattern")
    return !value.is_string() ||
           std::regex_search(value.get<std::string>(), compiled(rule.get<std::string>()));
  if (keyword == "minItems") return !value.is_array() || value.size() >= rule.get<std::size_t>();
  if (keyword == "maxItems") return !value.is_array() || value.size() <= rule.get<std::size_t>();
  if (keyword == "items")
    return !value.is_array() || std::all_of(value.begin(), value.end(),
                                            [&](const Json& item) { return fits(rule, item); });
  if (keyword == "required")
    return !value.is_object() || std::all_of(rule.begin(), rule.end(), [&](const Json& key) {
      return value.contains(key.get<std::string>());
    });
  if (keyword == "properties") {
    for (const auto& [key, inner] : rule.items())
      if (value.is_object() && value.contains(key) && !fits(inner, value[key])) return false;
    return true;
  }
  if (keyword == "additionalProperties") {
    if (!value.is_object()) return true;
    const Json known = schema.value("properties", Json::object());
    for (const auto& [key, inner] : value.items())
      if (!known.contains(key) && !fits(rule, inner)) return false;
    return true;
  }
  for (const char* told : {"$schema", "$id", "title", "description", "default", "definitions",
                           "then", "unit", "range", "left_out", "not_acted_on"})
    if (keyword == told) return true;
  throw std::runtime_error("keyword " + keyword + " is not known here");
}

std::vector<const Json*> JsonSchema::parts(const Json& schema) const {
  std::vector<const Json*> out{&schema};
  const auto add = [&](const Json& inner) {
    for (const Json* part : parts(inner)) out.push_back(part);
  };
  if (schema.contains("$ref")) add(definition(root_, schema["$ref"]));
  for (const char* key : {"allOf", "anyOf"})
    if (schema.contains(key))
      for (const Json& inner : schema[key]) add(inner);
  return out;
}

std::string text_of(const std::filesystem::path& file) {
  const auto bytes = read_file(file, 1 << 24);
  EXPECT_TRUE(bytes) << file;
  return bytes ? std::string(reinterpret_cast<const char*>(bytes->data()), bytes->size()) : "";
}

JsonSchema scene_schema() {
  return JsonSchema(Json::parse(text_of(MR_SOURCE_DIR "/schema/scene.schema.json")));
}

}  // namespace mr::test
