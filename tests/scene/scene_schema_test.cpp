// schema/scene.schema.json against the reader of scene files.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <charconv>
#include <functional>
#include <map>
#include <set>
#include <sstream>

#include "core/temp_dir.h"
#include "mr/core/file.h"
#include "mr/kit/image_io.h"
#include "mr/scene/scene.h"
#include "mr/yaml/tree.h"
#include "scene/json_schema.h"
#include "scene/scene_schema_cases.h"
#include "support/recordings.h"
#include "support/video_files.h"

namespace mr {
namespace {

using test::BeyondSchema;
using test::is_key;
using test::Json;
using test::JsonSchema;
using test::kBeyondSchema;
using test::text_of;
using testing::IsEmpty;

/// Converts YAML to JSON: unquoted numbers, true and false get their types; all else is text.
Json as_json(const yaml::Node& node) {
  using Kind = yaml::Node::Kind;
  Json out;
  if (node.kind == Kind::list) {
    out = Json::array();
    for (const auto& item : node.items) out.push_back(as_json(item));
  } else if (node.kind == Kind::map) {
    out = Json::object();
    for (std::size_t i = 0; i < node.keys.size(); ++i)
      out[node.keys[i].name] = as_json(node.items[i]);
  } else if (node.kind == Kind::scalar) {
    const char* const end = node.text.data() + node.text.size();
    const auto is_all = [&](auto& number) {
      const auto [stop, failed] = std::from_chars(node.text.data(), end, number);
      return failed == std::errc() && stop == end;
    };
    std::int64_t whole = 0;
    double number = 0;
    if (node.quoted) return node.text;
    if (node.text == "true" || node.text == "false") return node.text == "true";
    if (is_all(whole)) return whole;
    if (is_all(number)) return number;
    return node.text;
  }
  return out;
}

Json json_of(const std::string& yaml) {
  const yaml::Tree tree = yaml::parse_yaml(yaml);
  EXPECT_EQ(tree.problem, "");
  return as_json(tree.root);
}

/// A location in a scene, and the schema that applies there.
struct Place {
  Json::json_pointer at;
  std::string key;  ///< the last part of its path; of an item, its list's
  const Json* schema;
  bool is_required = false;
};

class SceneSchema : public testing::Test {
 protected:
  SceneSchema() {
    for (const char* file : {"c.png", "d.png", "d0.png", "d1.png", "m.glb"}) dir_.write(file, "x");
    for (const char* file : {"pose-0.txt", "pose-1.txt"})
      dir_.write(file, "1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 1");
    write_recordings();
    for (const char* yaml :
         {test::kImages, test::kRig, test::kLidar, test::kRecordings, test::kDevices})
      bases_.push_back(json_of(yaml));
  }

  /// What kRecordings names.
  void write_recordings() {
    test::write_kinect_recording(dir_ / "kinect.mkv", dir_ / "calibration.json");
    test::write_ouster_recording(dir_ / "turns.pcap", dir_ / "turns.json");
    test::write_realsense_recording(dir_ / "realsense.bag");
    ASSERT_TRUE(kit::write_png(dir_ / "sphere.png", ImageRgb(64, 32)).ok());
    test::write_video(dir_ / "film.mp4", std::vector<ImageRgb>(3, ImageRgb(64, 32)), {});
    dir_.write("times.txt", "0.0\n0.1\n");
    dir_.write("desk/rgb.txt", "10.00 rgb/0.png\n");
    dir_.write("desk/depth.txt", "10.01 depth/0.png\n");
    dir_.write("desk/groundtruth.txt", "9.9 0 0 0 0 0 0 1\n10.1 0 0 0 0 0 0 1\n");
    for (const char* picture : {"desk/rgb/0.png", "desk/depth/0.png"}) dir_.write(picture, "x");
  }

  /// Whether a part of a schema is that of a source of another type than the value's.
  static bool is_of_other_type(const Json& part, const Json& value) {
    const Json::json_pointer type("/properties/type/anyOf/0/const");
    if (!value.is_object() || !part.is_object() || !part.contains(type)) return false;
    return value.value("type", Json()) != part.at(type);
  }

  /// What the reader accepts, the configs' own problems() must accept, too.
  SceneResult read(const Json& scene) {
    SceneResult result = parse_scene(scene.dump(), dir_ / "scene.yaml");
    if (result.problems.empty()) {
      EXPECT_THAT(result.scene.problems(), testing::IsEmpty()) << scene.dump();
    }
    return result;
  }

  static bool is_beyond_schema(const SceneProblem& problem) {
    return std::any_of(std::begin(kBeyondSchema), std::end(kBeyondSchema),
                       [&](const BeyondSchema& rule) {
                         return problem.message.find(rule.message) != std::string::npos &&
                                problem.message.ends_with(rule.end);
                       });
  }

  /// Every place of a scene that the schema knows of; all of an object list's items, of others one.
  std::vector<Place> places(const Json& scene) const {
    std::vector<Place> out;
    visit(scene, Json::json_pointer(), "", schema_.root(), out);
    return out;
  }

  void visit(const Json& scene, const Json::json_pointer& at, const std::string& key,
             const Json& schema, std::vector<Place>& out) const {
    const Json& value = scene.at(at);
    for (const Json* part : schema_.parts(schema)) {
      if (is_of_other_type(*part, value)) continue;
      if (value.is_object() && part->contains("properties"))
        for (const auto& [name, inner] : (*part)["properties"].items()) {
          if (!is_key(inner) || !value.contains(name)) continue;
          const Json required = part->value("required", Json::array());
          out.push_back({at / name, name, &inner,
                         std::find(required.begin(), required.end(), name) != required.end()});
          visit(scene, at / name, name, inner, out);
        }
      if (value.is_array() && part->contains("items"))
        for (std::size_t i = 0; i < (value.empty()          ? 0
                                     : value[0].is_object() ? value.size()
                                                            : 1);
             ++i) {
          out.push_back({at / i, key, &(*part)["items"]});
          visit(scene, at / i, key, (*part)["items"], out);
        }
    }
  }

  /// All keys of the schema, however deep.
  static void all_keys(const Json& schema, std::set<const Json*>& out) {
    if (!schema.is_structured()) return;
    if (schema.is_object() && schema.contains("properties"))
      for (const auto& [name, inner] : schema["properties"].items())
        if (is_key(inner)) out.insert(&inner);
    for (const auto& [name, inner] : schema.items()) all_keys(inner, out);
  }

  /// Empty: schema and reader agree on a scene; else the verdict of each.
  std::string disagreement(const Json& scene, const std::string& what) {
    const bool by_schema = schema_.accepts(scene);
    std::string refused;
    for (const SceneProblem& problem : read(scene).problems)
      if (!is_beyond_schema(problem)) refused = problem.message;
    if (by_schema == refused.empty()) return "";
    return what + ": the schema " + (by_schema ? "accepts" : "refuses") + ", the reader " +
           (refused.empty() ? "accepts" : "refuses: " + refused);
  }

  /// Values for a place that lie on both sides of what is allowed.
  std::vector<Json> values_to_try(const Place& place, const Json& now) const {
    constexpr std::int64_t kLarge = 1'000'000'000'000;
    std::vector<Json> out{
        nullptr, true,          "word",           "7",           0, 1, -1, 0.5, kLarge,
        -kLarge, Json::array(), Json::array({0}), Json::object()};
    if (!now.is_structured() && !now.is_boolean())
      out.push_back("${MR_NOT_SET:-" + (now.is_string() ? now.get<std::string>() : now.dump()) +
                    "}");
    if (now.is_boolean()) out.push_back(now.get<bool>() ? "${MR_NOT_SET:-true}" : "true");
    for (const Json* part : schema_.parts(*place.schema)) {
      for (const char* bound : {"minimum", "exclusiveMinimum", "maximum"})
        if (part->contains(bound)) {
          const double edge = part->at(bound), step = std::max(std::abs(edge), 1e-3) * 1e-6;
          for (const double v : {edge, edge - step, edge + step, edge - 1, edge + 1})
            out.push_back(v);
        }
      for (const Json& word : part->value("enum", Json::array())) {
        out.push_back(word);
        if (word.is_string()) out.push_back(word.get<std::string>() + "x");
        if (word.is_number())
          out.push_back(word.get<int>() - 1), out.push_back(word.get<int>() + 1);
      }
      if (now.is_array() && !now.empty())
        for (const char* bound : {"minItems", "maxItems"})
          for (const int more : {-1, 0, 1}) {
            if (!part->contains(bound) || part->at(bound).get<int>() + more < 0) continue;
            Json list = now;
            const std::size_t size = part->at(bound).get<int>() + more;
            while (list.size() > size) list.erase(list.size() - 1);
            while (list.size() < size) list.push_back(now[0]);
            out.push_back(std::move(list));
          }
    }
    return out;
  }

  test::TempDir dir_;
  JsonSchema schema_ = test::scene_schema();
  std::vector<Json> bases_;
};

TEST_F(SceneSchema, TheScenesOfThisTestAreValidAndHoldEveryKey) {
  std::set<const Json*> missing;
  all_keys(schema_.root(), missing);
  EXPECT_GT(missing.size(), 100u);
  for (const Json& base : bases_) {
    EXPECT_TRUE(schema_.accepts(base)) << base;
    for (const SceneProblem& problem : read(base).problems) ADD_FAILURE() << to_string(problem);
    for (const Place& place : places(base)) missing.erase(place.schema);
  }
  for (const Json* key : missing) ADD_FAILURE() << "in no scene of this test: " << key->dump(2);
}

TEST_F(SceneSchema, SchemaAndReaderAgreeOnEveryValue) {
  std::vector<std::string> found;
  std::size_t tried = 0;
  for (const Json& base : bases_)
    for (const Place& place : places(base))
      for (const Json& value : values_to_try(place, base.at(place.at))) {
        Json scene = base;
        scene[place.at] = value;
        ++tried;
        if (auto wrong =
                disagreement(scene, place.at.to_string() + " " + value.dump().substr(0, 60));
            !wrong.empty())
          found.push_back(std::move(wrong));
      }
  EXPECT_THAT(found, IsEmpty());
  EXPECT_GT(tried, 3000u);
}

TEST_F(SceneSchema, SchemaAndReaderAgreeOnMissingKeys) {
  std::vector<std::string> found;
  for (const Json& base : bases_)
    for (const Place& place : places(base)) {
      Json scene = base;
      Json& parent = scene[place.at.parent_pointer()];
      if (!parent.is_object()) continue;
      parent.erase(place.at.back());
      if (auto wrong = disagreement(scene, "without " + place.at.to_string()); !wrong.empty())
        found.push_back(std::move(wrong));
    }
  EXPECT_THAT(found, IsEmpty());
}

/// The words of a list that a message holds behind `lead` and before `end`: "a, b".
std::set<std::string> words_of(const std::vector<SceneProblem>& problems, const std::string& lead,
                               char end = '\0') {
  std::set<std::string> out;
  for (const SceneProblem& problem : problems) {
    const std::size_t at = problem.message.find(lead);
    if (at == std::string::npos) continue;
    const std::string tail = problem.message.substr(at + lead.size());
    std::istringstream list(tail.substr(0, tail.find(end)));
    for (std::string word; std::getline(list >> std::ws, word, ',');) out.insert(word);
  }
  return out;
}

// A key that the reader asks for and the schema lacks, or the other way round.
TEST_F(SceneSchema, TheReaderAsksForTheKeysOfTheSchema) {
  const std::string unknown(33, '?');  // too long to resemble another key
  std::map<const Json*, std::pair<std::set<std::string>, std::set<std::string>>> sets;
  for (const Json& base : bases_) {
    std::vector<Place> all = places(base);
    all.push_back({Json::json_pointer(), "", &schema_.root()});
    for (const Place& place : all) {
      if (!base.at(place.at).is_object() || place.key == "tcp") continue;  // names of nodes
      auto parts = schema_.parts(*place.schema);
      std::erase_if(parts,
                    [&](const Json* part) { return is_of_other_type(*part, base.at(place.at)); });
      const auto titled = std::find_if(parts.begin(), parts.end(),
                                       [](const Json* part) { return part->contains("title"); });
      auto& [by_reader, by_schema] = sets[titled == parts.end() ? place.schema : *titled];
      Json scene = base;
      scene[place.at][unknown] = 1;
      EXPECT_FALSE(schema_.accepts(scene)) << place.at;
      by_reader.merge(words_of(read(scene).problems, "known here: "));
      for (const Json* part : parts)
        if (part->contains("properties"))
          for (const auto& [name, inner] : (*part)["properties"].items())
            if (is_key(inner)) by_schema.insert(name);
    }
  }
  EXPECT_GT(sets.size(), 20u);
  for (const auto& [schema, keys] : sets)
    EXPECT_EQ(keys.first, keys.second) << "of the reader; of the schema: " << schema->dump(2);
}

// Every enumerated value is accepted by both the reader and the schema, or by neither.
TEST_F(SceneSchema, TheReaderTakesTheWordsOfTheSchema) {
  std::size_t compared = 0;
  for (const Json& base : bases_)
    for (const Place& place : places(base))
      for (const Json* part : schema_.parts(*place.schema)) {
        const Json words = part->value("enum", Json::array());
        if (words.empty() || !words[0].is_string()) continue;
        Json scene = base;
        scene[place.at] = "no such word";
        const auto problems = read(scene).problems;
        auto by_reader = words_of(problems, place.key + " must be one of ", ';');
        by_reader.merge(words_of(problems, "supported: "));  // the types of sources
        EXPECT_EQ(by_reader, (std::set<std::string>(words.begin(), words.end()))) << place.at;
        ++compared;
      }
  EXPECT_GT(compared, 10u);
}

TEST_F(SceneSchema, DefaultsAreWhatHoldsWithoutTheKey) {
  for (const Json& base : bases_)
    for (const Place& place : places(base)) {
      const Json& schema = *place.schema;
      Json without = base, with = base;
      if (!without[place.at.parent_pointer()].is_object()) continue;
      without[place.at.parent_pointer()].erase(place.at.back());
      with[place.at] = schema.value("default", Json::object());
      const bool is_plain_map = with[place.at].is_object() && base.at(place.at).is_object();
      if (!schema.contains("default") && (!is_plain_map || schema.contains("left_out"))) {
        EXPECT_TRUE(place.is_required || schema.contains("left_out"))
            << place.at << " has no default, is not required, and left_out says nothing";
        continue;
      }
      if (!schema_.accepts(without)) continue;  // required, or another key asks for it
      const SceneResult left_out = read(without), given = read(with);
      for (const auto* result : {&left_out, &given})
        for (const SceneProblem& problem : result->problems)
          ADD_FAILURE() << place.at << ": " << to_string(problem);
      EXPECT_EQ(left_out.scene, given.scene) << place.at << " " << with[place.at];
    }
}

/// How many notices name a key; none where the scene is refused.
std::optional<int> notices_of(const SceneResult& result, const std::string& key) {
  if (!result.problems.empty()) return std::nullopt;
  return static_cast<int>(
      std::count_if(result.notices.begin(), result.notices.end(), [&](const SceneProblem& notice) {
        return notice.message.starts_with(key + " ") || notice.message.starts_with(key + ":");
      }));
}

// Where not_acted_on is a sentence, scene_test.cpp has the cases.
TEST_F(SceneSchema, KeysThatAreNotActedOnAreNoticed) {
  int noticed = 0;
  for (const Place& place : places(bases_[0])) {
    const Json rule = place.schema->value("not_acted_on", Json(false));
    if (rule.is_string()) continue;
    std::string key = place.at.to_string().substr(1);
    std::replace(key.begin(), key.end(), '/', '.');
    for (const Json& value : values_to_try(place, bases_[0].at(place.at))) {
      Json scene = bases_[0];
      scene[place.at] = value;
      const auto notices = notices_of(read(scene), key);
      if (!notices || value.is_object()) continue;  // its notices are those of its keys
      const bool is_told = rule.is_array()
                               ? std::find(rule.begin(), rule.end(), value) != rule.end()
                               : rule == Json(true);
      EXPECT_EQ(*notices, is_told) << key << " " << value;
      noticed += is_told;
    }
  }
  EXPECT_GT(noticed, 2);
}

TEST_F(SceneSchema, AWrongTypeOfAnOptionIsOneProblem) {
  for (const Json& base : bases_)
    for (const Place& place : places(base)) {
      std::string option = place.at.to_string().substr(1);
      std::replace(option.begin(), option.end(), '/', '.');
      const bool is_list = base.at(place.at.parent_pointer()).is_array();
      if (is_list && !base.at(place.at).is_object()) continue;  // coordinates have no names
      option += base.at(place.at).is_structured() ? "=true" : "=[[]]";
      const auto problems = parse_scene(base.dump(), dir_ / "scene.yaml", {option}).problems;
      EXPECT_EQ(problems.size(), 1u) << option;
      for (const SceneProblem& problem : problems)
        EXPECT_TRUE(problems.size() == 1 && (problem.option || is_beyond_schema(problem)))
            << to_string(problem);
    }
}

TEST_F(SceneSchema, ExamplesAreValid) {
  std::size_t count = 0;
  for (const char* folder : {"/examples", "/examples/eval", "/bench/scenes"})
    for (const auto& entry :
         std::filesystem::directory_iterator(std::string(MR_SOURCE_DIR) + folder)) {
      if (entry.path().extension() != ".yaml") continue;
      ++count;
      const std::string text = text_of(entry.path());
      EXPECT_TRUE(schema_.accepts(json_of(text))) << entry.path();
      for (const SceneProblem& problem : load_scene(entry.path()).problems)
        EXPECT_TRUE(is_beyond_schema(problem)) << to_string(problem);
      const std::string to_schema =
          std::string(folder) == "/examples" ? "../schema" : "../../schema";
      EXPECT_TRUE(
          text.starts_with("# yaml-language-server: $schema=" + to_schema + "/scene.schema.json\n"))
          << entry.path() << " does not name the schema to editors";
    }
  EXPECT_GT(count, 15u);
}

}  // namespace
}  // namespace mr
