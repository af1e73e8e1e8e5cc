#include <array>
#include <iterator>

#include "mr/synth/appearance.h"
#include "mr/synth/hash.h"

namespace mr::synth {
namespace {

template <std::size_t N>
std::uint32_t pick(Random& random, const std::array<std::uint32_t, N>& colors) {
  return colors[random.index(static_cast<int>(N))];
}

constexpr std::array<std::uint32_t, 5> kSkins{0xE8B896, 0xD9A07A, 0xC08560, 0x8A5638, 0x613A26};
constexpr std::array<std::uint32_t, 5> kHairs{0x2A1B12, 0x151112, 0x5E3A1E, 0xA87C42, 0x77716B};
constexpr std::array<std::uint32_t, 7> kCloths{0xB5322E, 0x2B5C9E, 0x2F7D4F, 0xD9A52B,
                                               0xE7E3DA, 0x5B3A78, 0x1F7F8C};
constexpr std::array<std::uint32_t, 4> kDarks{0x23304A, 0x2D2A2B, 0x4A4238, 0x6B6F76};
constexpr std::array<std::uint32_t, 4> kShoes{0x2A1A12, 0x17171A, 0xD8D6D2, 0x7A4A28};

Material material(Pattern pattern, std::uint32_t color, std::uint32_t accent, float grain) {
  Material m;
  m.pattern = pattern;
  m.color = linear_color(color), m.accent = linear_color(accent);
  m.grain = grain;
  return m;
}

void choose_body(Random& random, Appearance& appearance) {
  Physique& body = appearance.physique;
  body.woman = random.index(2) == 0;
  appearance.stature_m = body.woman ? random.uniform(1.58, 1.74) : random.uniform(1.69, 1.88);
  body.bulk = random.uniform(0.93, 1.12);
  body.belly = random.index(3) == 0 && !body.woman ? random.uniform(0.02, 0.05) : 0;
  body.nose_m = random.uniform(-0.003, 0.006);
  body.jaw = random.uniform(0.94, 1.1);
}

void choose_head(Random& random, Appearance& appearance) {
  const std::uint32_t skin = pick(random, kSkins);
  const std::uint32_t hair = pick(random, kHairs);
  appearance.skin = material(Pattern::plain, skin, 0x9A4A3A, 0.07f);
  appearance.face = material(Pattern::face, skin, hair, 0.07f);
  appearance.hairs = material(Pattern::hair, hair, 0xC09A6A, 0.35f);
  constexpr std::array kWomens{Hair::bob, Hair::bun, Hair::tail, Hair::long_hair};
  constexpr std::array kMens{Hair::shorn, Hair::parted};
  appearance.hair = appearance.physique.woman ? kWomens[random.index(4)] : kMens[random.index(2)];
  appearance.beard = !appearance.physique.woman && random.index(3) == 0;
}

void choose_clothes(Random& random, Appearance& appearance) {
  constexpr std::array kWords{"27", "MESH", "ROBOT", "08", "HELLO"};
  constexpr std::array kWeaves{Pattern::bands, Pattern::plaid, Pattern::knit};
  appearance.top = static_cast<Top>(random.index(static_cast<int>(Top::kinds)));
  appearance.bottom = static_cast<Bottom>(
      random.index(static_cast<int>(appearance.physique.woman ? Bottom::kinds : Bottom::skirt)));
  appearance.long_sleeves = appearance.top != Top::tee;
  const std::uint32_t color = pick(random, kCloths), accent = pick(random, kCloths);
  const std::uint32_t clear = color == accent || color == 0xE7E3DA ? 0x22262E : 0xEFEBE0;
  Pattern weave = kWeaves[random.index(3)];
  if (appearance.top == Top::shirt || appearance.top == Top::coat) weave = Pattern::plaid;
  appearance.cloth = material(weave, color, clear, 0.10f);
  appearance.print = appearance.cloth;
  if (appearance.top == Top::tee || appearance.top == Top::hoodie) {
    appearance.print = appearance.cloth = material(Pattern::knit, color, clear, 0.10f);
    appearance.print.pattern = Pattern::print;
    appearance.print.text = kWords[random.index(5)];
  }
  const bool jeans = appearance.bottom == Bottom::jeans;
  appearance.legwear = jeans ? material(Pattern::denim, 0x35507E, 0xA9B6C9, 0.14f)
                             : material(Pattern::knit, pick(random, kDarks), 0x1C1C20, 0.12f);
  appearance.coat = material(Pattern::knit, pick(random, kDarks), 0x3A3F4A, 0.12f);
  appearance.shoe = material(Pattern::plain, pick(random, kShoes), 0x101010, 0.15f);
  appearance.sole = material(Pattern::plain, 0xC9C4B8, 0x101010, 0.15f);
}

}  // namespace

Appearance make_appearance(std::uint64_t seed) {
  Random random(seed);
  Appearance appearance;
  choose_body(random, appearance);
  choose_head(random, appearance);
  choose_clothes(random, appearance);
  std::uint32_t number = static_cast<std::uint32_t>(seed) * 64;
  for (Material* m :
       {&appearance.skin, &appearance.face, &appearance.hairs, &appearance.cloth, &appearance.print,
        &appearance.legwear, &appearance.shoe, &appearance.sole, &appearance.coat})
    m->seed = ++number;
  return appearance;
}

}  // namespace mr::synth
