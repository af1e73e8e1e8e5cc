#include <algorithm>
#include <cmath>
#include <iterator>

#include "dct_contenders.h"
#include "mr/core/parallel.h"
#include "mr/kit/freed_memory.h"
#include "mr/rate/features.h"
#include "report.h"
#include "stage.h"

namespace mr::bench {
namespace {

constexpr double kAgreement = 1e-3;  // of energies, relative

// ------------------------------------------------------------ input

/// Evenly distributed in 0..1; the same in every run.
float noise(int x, int y, int capture) {
  std::uint32_t h = x * 0x9E3779B1u ^ y * 0x85EBCA77u ^ (capture + 1) * 0xC2B2AE3Du;
  h = (h ^ h >> 15) * 0x2C1B3C6Du;
  h = (h ^ h >> 12) * 0x297A2D39u;
  return static_cast<float>(h >> 8) / (1 << 24);
}

/// A capture of 1280x720 and 640x576: waves that drift before a slanted wall with holes, noise.
Frame capture(int index) {
  Frame frame;
  frame.color = ImageRgb(1280, 720);
  for (int y = 0; y < frame.color.height; ++y)
    for (int x = 0; x < frame.color.width; ++x)
      for (int c = 0; c < 3; ++c) {
        const double wave = std::sin(0.05 * (x + 3 * index)) * std::cos(0.031 * y + c);
        frame.color.at(x, y)[c] =
            static_cast<std::uint8_t>(120 + 100 * wave + 10 * noise(x, y, index));
      }
  frame.depth = ImageDepth(640, 576);
  for (int y = 0; y < frame.depth.height; ++y)
    for (int x = 0; x < frame.depth.width; ++x) {
      const bool person = std::hypot(x - 300 - 4 * index, y - 300) < 120;
      const bool hole = x % 160 < 12 + y % 7;
      const float wall_m = 2 + 0.003f * static_cast<float>(x);
      *frame.depth.at(x, y) = hole ? 0 : (person ? 1.5f : wall_m) + 0.01f * noise(x, y, index);
    }
  return frame;
}

/// Luma 0..255 (BT.709). Without our own functions: they may start threads, before the children.
LumaPlane luma_of(const ImageRgb& picture) {
  LumaPlane plane(picture.width, picture.height);
  for (std::size_t i = 0; i < plane.data.size(); ++i) {
    const std::uint8_t* rgb = picture.data.data() + 3 * i;
    plane.data[i] = 0.2126f * rgb[0] + 0.7152f * rgb[1] + 0.0722f * rgb[2];
  }
  return plane;
}

/// Depth in millimetres; holes stay 0.
LumaPlane millimetres(LumaPlane depth) {
  for (float& value : depth.data) value *= 1000;
  return depth;
}

std::vector<CaseInfo> dct_cases() {
  return {{"color", "DCT energy of a luma picture of 1280x720", true, ""},
          {"depth", "DCT energy of a depth picture of 640x576", true, ""},
          {"pair", "all features of a frame of both, from RGB and metres; ours only", true, ""}};
}

// ------------------------------------------------------------ ours

class Energy final : public Work {
 public:
  explicit Energy(const LumaPlane& plane) : plane_(plane), arena_(1) {}
  void clear() override {}
  void run(StageClock&) override {
    arena_.run([&] { energy_ = rate::dct_energy(plane_); });
  }
  Message result() override { return {{"energy", energy_}}; }

 private:
  const LumaPlane& plane_;
  Arena arena_;
  double energy_ = 0;
};

class Features final : public Work {
 public:
  explicit Features(const std::vector<Frame>& frames) : frames_(frames), arena_(1) {
    kit::keep_freed_memory();  // as `meshreduce` does
  }
  void clear() override {}
  void run(StageClock&) override {
    arena_.run([&] { features_ = extractor_.extract(frames_[next_++ % frames_.size()]); });
  }
  Message result() override { return {{"energy", features_.color.spatial}}; }

 private:
  const std::vector<Frame>& frames_;
  Arena arena_;
  rate::FeatureExtractor extractor_;
  std::size_t next_ = 0;
  rate::SceneFeatures features_;
};

// ------------------------------------------------------------ the stage

std::vector<Contender> contenders_of(const std::string& name, const LumaPlane& plane,
                                     const std::vector<Frame>& frames) {
  if (name == "pair") return {features_ours(frames)};
  std::vector<Contender> out{dct_ours(plane)};
  std::ranges::move(dct_fftw(plane), std::back_inserter(out));
  out.push_back(dct_opencv(plane));
  return out;
}

/// An error where a peer's energy is not the first contender's.
Status agree(const std::vector<Message>& rows) {
  for (const Message& row : rows) {
    const Message& first = rows.front();
    if (!row.contains("energy") || !first.contains("energy")) continue;
    const double energy = row["energy"], expected = first["energy"];
    if (!(std::abs(energy - expected) <= kAgreement * expected))
      return Error{Error::Cause::invalid, row["impl"].get<std::string>() + ": energy " +
                                              std::to_string(energy) + ", ours " +
                                              std::to_string(expected)};
  }
  return {};
}

Status measure_dct(const std::string& name, const Request& request, cli::ProgressBar& bar,
                   Report& report) {
  const std::vector<Frame> frames{capture(0), capture(1)};
  const LumaPlane plane = name == "depth" ? millimetres(frames[0].depth) : luma_of(frames[0].color);
  const auto contenders = contenders_of(name, plane, frames);
  const auto outcomes = race(contenders, {.runs = request.runs},
                             [&](std::size_t done, std::size_t of) { bar.show(name, done, of); });
  std::vector<Message> rows;
  for (std::size_t i = 0; i < contenders.size(); ++i) {
    rows.push_back(result_row(contenders[i], name, outcomes[i]));
    if (!outcomes[i].result.is_null()) rows.back().update(outcomes[i].result);
  }
  report.input[name] = {{"width", plane.width}, {"height", plane.height}};
  if (const Status same = agree(rows); !same) return same;
  std::ranges::move(rows, std::back_inserter(report.results));
  return {};
}

Result<Report> run_dct(const Request& request, cli::ProgressBar& bar) {
  if (!request.input.empty())
    return Error{Error::Cause::unsupported, "dct takes no --input: its pictures are fixed"};
  const auto names = wanted_cases(dct_cases(), request, "dct has");
  if (!names) return names.error();
  Report report{.stage = "dct", .columns = {{"energy", "energy", 1}}};
  if (!has_fftw()) report.absent.push_back("fftw");
  for (const std::string& name : *names)
    if (const Status measured = measure_dct(name, request, bar, report); !measured)
      return measured.error();
  return report;
}

}  // namespace

Contender dct_ours(const LumaPlane& plane) {
  return {kOurs, 1, Message::object(), [&plane] { return std::make_unique<Energy>(plane); }};
}

Contender features_ours(const std::vector<Frame>& frames) {
  return {kOurs, 1, Message::object(), [&frames] { return std::make_unique<Features>(frames); }};
}

DctWeights::DctWeights(double first, double other) {
  for (int j = 0; j < kDctBlock; ++j)
    for (int i = 0; i < kDctBlock; ++i) {
      const double part = (i + 1) * (j + 1) / static_cast<double>(kDctBlock * kDctBlock);
      values[j * kDctBlock + i] = static_cast<float>(
          std::exp(part * part - 1) * (i == 0 ? first : other) * (j == 0 ? first : other));
    }
  values[0] = 0;
}

float DctWeights::energy(const float* dct) const {
  std::array<float, 16> sums{};
  for (std::size_t i = 0; i < values.size(); i += sums.size())
    for (std::size_t k = 0; k < sums.size(); ++k) sums[k] += values[i + k] * std::abs(dct[i + k]);
  float sum = 0;
  for (const float one : sums) sum += one;
  return sum;
}

Stage dct_stage() {
  return {"dct", "scene features of colour and depth on one thread; peers: FFTW, OpenCV", dct_cases,
          run_dct};
}

}  // namespace mr::bench
