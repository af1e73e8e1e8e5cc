#include <array>
#include <iterator>

#include "mr/synth/hash.h"
#include "mr/synth/wardrobe.h"

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

void choose_body(Random& random, Look& look) {
  Physique& body = look.physique;
  body.woman = random.index(2) == 0;
  look.stature_m = body.woman ? random.uniform(1.58, 1.74) : random.uniform(1.69, 1.88);
  body.bulk = random.uniform(0.93, 1.12);
  body.belly = random.index(3) == 0 && !body.woman ? random.uniform(0.02, 0.05) : 0;
  body.nose_m = random.uniform(-0.003, 0.006);
  body.jaw = random.uniform(0.94, 1.1);
}

void choose_head(Random& random, Look& look) {
  const std::uint32_t skin = pick(random, kSkins);
  const std::uint32_t hair = pick(random, kHairs);
  look.skin = material(Pattern::plain, skin, 0x9A4A3A, 0.07f);
  look.face = material(Pattern::face, skin, hair, 0.07f);
  look.hairs = material(Pattern::hair, hair, 0xC09A6A, 0.35f);
  constexpr std::array kWomens{Hair::bob, Hair::bun, Hair::tail, Hair::long_hair};
  constexpr std::array kMens{Hair::shorn, Hair::parted};
  look.hair = look.physique.woman ? kWomens[random.index(4)] : kMens[random.index(2)];
  look.beard = !look.physique.woman && random.index(3) == 0;
}

void choose_clothes(Random& random, Look& look) {
  constexpr std::array kWords{"27", "MESH", "ROBOT", "08", "HELLO"};
  constexpr std::array kWeaves{Pattern::bands, Pattern::plaid, Pattern::knit};
  look.top = static_cast<Top>(random.index(static_cast<int>(Top::kinds)));
  look.bottom = static_cast<Bottom>(
      random.index(static_cast<int>(look.physique.woman ? Bottom::kinds : Bottom::skirt)));
  look.long_sleeves = look.top != Top::tee;
  const std::uint32_t color = pick(random, kCloths), accent = pick(random, kCloths);
  const std::uint32_t clear = color == accent || color == 0xE7E3DA ? 0x22262E : 0xEFEBE0;
  Pattern weave = kWeaves[random.index(3)];
  if (look.top == Top::shirt || look.top == Top::coat) weave = Pattern::plaid;
  look.cloth = material(weave, color, clear, 0.10f);
  look.print = look.cloth;
  if (look.top == Top::tee || look.top == Top::hoodie) {
    look.print = look.cloth = material(Pattern::knit, color, clear, 0.10f);
    look.print.pattern = Pattern::print;
    look.print.text = kWords[random.index(5)];
  }
  const bool jeans = look.bottom == Bottom::jeans;
  look.legwear = jeans ? material(Pattern::denim, 0x35507E, 0xA9B6C9, 0.14f)
                       : material(Pattern::knit, pick(random, kDarks), 0x1C1C20, 0.12f);
  look.coat = material(Pattern::knit, pick(random, kDarks), 0x3A3F4A, 0.12f);
  look.shoe = material(Pattern::plain, pick(random, kShoes), 0x101010, 0.15f);
  look.sole = material(Pattern::plain, 0xC9C4B8, 0x101010, 0.15f);
}

}  // namespace

Look look_of(std::uint64_t seed) {
  Random random(seed);
  Look look;
  choose_body(random, look);
  choose_head(random, look);
  choose_clothes(random, look);
  std::uint32_t number = static_cast<std::uint32_t>(seed) * 64;
  for (Material* m : {&look.skin, &look.face, &look.hairs, &look.cloth, &look.print, &look.legwear,
                      &look.shoe, &look.sole, &look.coat})
    m->seed = ++number;
  return look;
}

}  // namespace mr::synth
