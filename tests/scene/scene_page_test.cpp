// docs/scene-file.md against schema/scene.schema.json. MR_WRITE_DOCS=1 writes the tables of the
// page anew.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "mr/core/file.h"
#include "scene/json_schema.h"

namespace mr {
namespace {

using test::is_key;
using test::Json;
using test::JsonSchema;
using test::text_of;

std::string joined(const std::vector<std::string>& list, const char* between) {
  std::string out;
  for (const std::string& text : list) out += (out.empty() ? "" : between) + text;
  return out;
}

std::string bounds_text(const Json& part) {
  const auto text = [&](const char* key) { return part.contains(key) ? part[key].dump() : ""; };
  if (part.contains("exclusiveMinimum"))
    return "> " + text("exclusiveMinimum") + ", ≤ " + text("maximum");
  return text("minimum") + " … " + text("maximum");
}

/// The range of a key in words: its own, else from the keywords.
std::string range_text(const JsonSchema& schema, const Json& key) {
  const auto parts = schema.parts(key);
  for (const Json* part : parts)
    if (part->contains("range")) return (*part)["range"];
  for (const Json* part : parts)
    if (part->contains("title"))
      return "see [" + (*part)["title"].get<std::string>() + "](#" +
             (*part)["title"].get<std::string>() + ")";
  const auto has_type = [](const Json& part, const char* type) {
    const Json& given = part["type"];
    return given == type || (given.is_array() && given[0] == type);
  };
  for (const Json* part : parts) {
    if (part->contains("enum")) {
      std::vector<std::string> words;
      for (const Json& word : (*part)["enum"])
        words.push_back("`" + (word.is_string() ? word.get<std::string>() : word.dump()) + "`");
      return joined(words, ", ");
    }
    if (!part->contains("type")) continue;
    if (has_type(*part, "boolean")) return "`true`, `false`";
    if (has_type(*part, "number")) return bounds_text(*part);
    if (has_type(*part, "integer")) return bounds_text(*part) + ", whole";
    if (has_type(*part, "object")) return "the keys below";
    if (has_type(*part, "array")) {
      const std::string least = (*part)["minItems"].dump(), most = (*part)["maxItems"].dump();
      const std::string count = least == most ? least : least + " … " + most;
      const bool is_numbers = part->at("items").contains("maximum");
      return count + (is_numbers ? " numbers, each " : ", ") + range_text(schema, (*part)["items"]);
    }
  }
  return "";
}

std::string default_text(const Json& key, bool is_required) {
  if (is_required) return "required";
  if (key.contains("left_out")) return key["left_out"];
  if (!key.contains("default")) return "as of its keys";
  const Json& value = key["default"];
  return "`" + (value.is_string() ? value.get<std::string>() : value.dump()) + "`";
}

std::string effect_text(const Json& key) {
  std::string out = key["description"];
  const Json rule = key.value("not_acted_on", Json(false));
  if (rule == Json(false)) return out;
  if (rule.is_string()) return out + " **Not acted on** " + rule.get<std::string>() + ".";
  std::vector<std::string> words;
  if (rule.is_array())
    for (const Json& word : rule) words.push_back("`" + word.get<std::string>() + "`");
  return out + " **Not acted on yet**" + (words.empty() ? "" : ": " + joined(words, ", ")) + ".";
}

/// The rows of a mapping's keys; what has a title has a table of its own.
std::string rows(const JsonSchema& schema, const Json& map, const std::string& before) {
  std::string out;
  for (const Json* part : schema.parts(map)) {
    if (!part->contains("properties")) continue;
    const Json required = part->value("required", Json::array());
    for (const auto& [name, key] : (*part)["properties"].items()) {
      if (!is_key(key)) continue;
      const bool is_required = std::find(required.begin(), required.end(), name) != required.end();
      out += "| `" + before + name + "` | " + key.value("unit", std::string()) + " | " +
             default_text(key, is_required) + " | " + range_text(schema, key) + " | " +
             effect_text(key) + " |\n";
      const auto inner = schema.parts(key);
      const bool has_table = std::any_of(inner.begin(), inner.end(),
                                         [](const Json* p) { return p->contains("title"); });
      if (!has_table) out += rows(schema, key, before + name + ".");
    }
  }
  return out;
}

void tables(const JsonSchema& schema, const Json& at, std::map<std::string, std::string>& out) {
  if (!at.is_structured()) return;
  if (at.is_object() && at.contains("title") && at.contains("properties"))
    out[at["title"]] =
        "| key | unit | default | range | effect |\n|---|---|---|---|---|\n" + rows(schema, at, "");
  for (const auto& [name, inner] : at.items()) tables(schema, inner, out);
}

TEST(ScenePage, HasTheTablesOfTheSchema) {
  const JsonSchema schema = test::scene_schema();
  const std::filesystem::path page = MR_SOURCE_DIR "/docs/scene-file.md";
  const std::string before = text_of(page);
  std::string text = before;
  std::map<std::string, std::string> of_schema;
  tables(schema, schema.root(), of_schema);
  EXPECT_GT(of_schema.size(), 10u);
  for (const auto& [title, table] : of_schema) {
    const std::string open = "<!-- keys of " + title + ", from schema/scene.schema.json -->\n";
    const std::size_t at = text.find(open), end = text.find("<!-- end -->", at);
    if (at == std::string::npos || end == std::string::npos) {
      ADD_FAILURE() << "docs/scene-file.md has no place for the keys of " << title << ":\n" << open;
      continue;
    }
    text.replace(at + open.size(), end - at - open.size(), table);
  }
  if (std::getenv("MR_WRITE_DOCS"))
    ASSERT_TRUE(write_file(page, text));
  else
    EXPECT_EQ(before, text) << "the schema says otherwise: MR_WRITE_DOCS=1 build/dev/bin/"
                               "scene_schema_test writes the tables anew";
}

}  // namespace
}  // namespace mr
