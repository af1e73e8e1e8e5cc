#include "mr/sensor/source_registry.h"

#include <gtest/gtest.h>

#include <optional>
#include <set>
#include <string>

#include "mr/sensor/rgbd_images.h"
#include "mr/yaml/tree.h"

namespace mr::sensor {
namespace {

TEST(SourceRegistry, EveryTypeHasAName) {
  std::set<std::string_view> names;
  for (const SourceType& type : source_types()) {
    EXPECT_FALSE(type.name.empty());
    EXPECT_TRUE(names.insert(type.name).second) << type.name << " is there twice";
    EXPECT_EQ(find_source_type(type.name), &type);
  }
  EXPECT_EQ(find_source_type("no-such-type"), nullptr);
  EXPECT_EQ(find_source_type(""), nullptr);
}

// The keys that messages report as missing are those that the reader requires.
TEST(SourceRegistry, EveryTypeReportsWhatItsKeysLack) {
  for (const SourceType& type : source_types()) {
    const yaml::Tree tree = yaml::parse_yaml("{}");
    yaml::Report report("scene.yaml", {});
    {
      yaml::MapReader map(report, tree.root, "source");
      EXPECT_EQ(type.read(map, "sensors.a.source").config.type(), type.name);
    }
    EXPECT_FALSE(report.take_problems().empty()) << type.name;
  }
}

/// A second type, as little as one needs.
struct Bag {
  static constexpr std::string_view kType = "bag";
  std::string file;
  SourceContent content() const { return {.items = 7, .loops = true}; }
  friend bool operator==(const Bag&, const Bag&) = default;
};

TEST(SourceConfig, IsAValueOfAnyType) {
  const SourceConfig none;
  EXPECT_EQ(none, SourceConfig());
  EXPECT_EQ(none.type(), "none");
  EXPECT_EQ(none.content().items, 0u);

  const SourceConfig bag = Bag{"a.bag"};
  EXPECT_NE(bag, none);
  EXPECT_EQ(bag, SourceConfig(Bag{"a.bag"}));
  EXPECT_NE(bag, SourceConfig(Bag{"b.bag"}));
  EXPECT_NE(bag, SourceConfig(RgbdImagesSource{}));
  EXPECT_EQ(bag.type(), "bag");
  EXPECT_EQ(bag.content().items, 7u);
  EXPECT_TRUE(bag.files().empty());
  EXPECT_EQ(bag.depth_hint(1000), std::nullopt);
  EXPECT_EQ(bag.get_if<RgbdImagesSource>(), nullptr);

  SourceConfig copy = bag;
  EXPECT_EQ(copy, bag);
  copy.get_if<Bag>()->file = "c.bag";
  EXPECT_NE(copy, bag) << "a copy is its own";
  EXPECT_EQ(bag.get_if<Bag>()->file, "a.bag");
}

TEST(SourceConfig, TellsTheFilesOfPictures) {
  const SourceConfig images = RgbdImagesSource{.color = {"c.png"}, .depth = {"d.png"}};
  EXPECT_EQ(images.files().size(), 2u);
  EXPECT_EQ(images.content().items, 1u);
  EXPECT_FALSE(images.content().loops);
  EXPECT_EQ(images.depth_hint(2), std::nullopt);
  EXPECT_NE(images.depth_hint(2000).value_or("").find("depth_unit_m"), std::string::npos);
}

}  // namespace
}  // namespace mr::sensor
