#include "mr/rate/models.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>

#include "mr/core/assert.h"
#include "mr/core/file.h"
#include "mr/rate/grid.h"
#include "mr/rate/shipped_models.h"
#include "mr/rate/stored_numbers.h"

namespace mr::rate {
namespace {

using Json = nlohmann::ordered_json;
using Numbers = std::vector<double>;

constexpr std::size_t kMostBytes = 16 << 20, kMostRows = 10'000;
constexpr int kMostWhole = 1'000'000;

/// What is predicted from a file is predicted from its own numbers.
double seven_digits(double v) { return rounded_to(v, 7); }
Json to_json(const Numbers& values) {
  Json out = Json::array();
  for (const double v : values) out.push_back(seven_digits(v));
  return out;
}
Json to_json(const std::vector<Numbers>& rows) {
  Json out = Json::array();
  for (const Numbers& row : rows) out.push_back(to_json(row));
  return out;
}

[[noreturn]] void refuse(const std::string& what) { throw std::runtime_error(what); }

Numbers numbers(const Json& in) {
  if (!in.is_array() || in.size() > kMostRows) refuse("no list of numbers");
  Numbers out;
  for (const Json& v : in) out.push_back(v.get<double>());
  for (const double v : out)
    if (!std::isfinite(v)) refuse("an impossible number");
  return out;
}
Numbers numbers(const Json& in, std::size_t count) {
  Numbers out = numbers(in);
  if (out.size() != count) refuse("a list of another length");
  return out;
}
const Json& rows(const Json& in) {
  if (!in.is_array() || in.size() > kMostRows) refuse("no list");
  return in;
}

Json to_json(const Setting& s) { return {s.error_voxels, s.bits, s.scale, s.qp}; }
Setting setting(const Json& in) {
  const Numbers v = numbers(in, 4);
  const Setting out{v[0], whole_number(v[1], -kMostWhole, kMostWhole), v[2],
                    whole_number(v[3], -kMostWhole, kMostWhole)};
  const bool has_scale = std::ranges::any_of(
      kTextureNodes, [&](const TextureNode& node) { return node.scale == out.scale; });
  const bool good = out.error_voxels >= 0.1 && out.error_voxels <= 100 && has_scale &&
                    std::ranges::find(kLattices, out.bits) != std::end(kLattices) && out.qp >= 0 &&
                    out.qp <= 51;
  if (!good) refuse("an impossible setting");
  return out;
}

Json to_json(const FeatureSpace& space) {
  return {{"mean", to_json(space.mean())}, {"deviation", to_json(space.deviation())}};
}
FeatureSpace feature_space(const Json& in) {
  Numbers deviation = numbers(in.at("deviation"), FeatureSpace::size());
  for (const double v : deviation)
    if (!(v > 0)) refuse("an impossible deviation");
  return {numbers(in.at("mean"), FeatureSpace::size()), std::move(deviation)};
}

// -------------------------------------------------- classifier

Json to_json(const Svm& svm) {
  const Svm::Parts& p = svm.parts();
  return {{"gamma", seven_digits(p.gamma)},
          {"labels", p.labels},
          {"counts", p.counts},
          {"rho", to_json(p.rho)},
          {"coefficients", to_json(p.coefficients)},
          {"vectors", to_json(p.vectors)}};
}
Svm svm(const Json& in, std::size_t features) {
  Svm::Parts p;
  p.gamma = in.at("gamma").get<double>();
  for (const double v : numbers(in.at("labels")))
    p.labels.push_back(whole_number(v, -kMostWhole, kMostWhole));
  for (const double v : numbers(in.at("counts")))
    p.counts.push_back(whole_number(v, -kMostWhole, kMostWhole));
  p.rho = numbers(in.at("rho"));
  for (const Json& row : rows(in.at("coefficients"))) p.coefficients.push_back(numbers(row));
  for (const Json& row : rows(in.at("vectors"))) p.vectors.push_back(numbers(row, features));
  auto out = Svm::from(std::move(p));
  if (!out) refuse(out.error().message);
  return *std::move(out);
}

Json to_json(const std::vector<Classifier::Machines>& kind) {
  Json out = Json::array();
  for (const Classifier::Machines& m : kind) {
    Json hull = Json::array();
    for (const Setting& s : m.hull) hull.push_back(to_json(s));
    out.push_back({{"nominal", to_json(m.nominal.log_mbps())},
                   {"hull", std::move(hull)},
                   {"error", to_json(m.error)},
                   {"bits", to_json(m.bits)},
                   {"scale", to_json(m.scale)},
                   {"qp", to_json(m.qp)}});
  }
  return out;
}
std::vector<Classifier::Machines> machines(const Json& in) {
  std::vector<Classifier::Machines> out;
  const std::size_t features = FeatureSpace::size() + 3;  // with what was produced, and the target
  const std::size_t on_lattice = features + 1;
  for (const Json& m : rows(in)) {
    Classifier::Machines one{NominalRates(numbers(m.at("nominal"), NominalRates::size())),
                             svm(m.at("error"), on_lattice),
                             svm(m.at("bits"), features),
                             svm(m.at("scale"), on_lattice),
                             svm(m.at("qp"), on_lattice),
                             {}};
    for (const Json& s : rows(m.at("hull"))) one.hull.push_back(setting(s));
    if (one.hull.empty()) refuse("a classifier without settings");
    out.push_back(std::move(one));
  }
  return out;
}

Json to_json(const Classifier& c) {
  return {{"features", to_json(c.space())},
          {"layers", to_json(c.kinds().layers)},
          {"without_layers", to_json(c.kinds().without_layers)}};
}
Classifier classifier(const Json& in) {
  Classifier::Kinds kinds{machines(in.at("layers")), machines(in.at("without_layers"))};
  if (kinds.layers.empty() && kinds.without_layers.empty()) refuse("a classifier without machines");
  return {feature_space(in.at("features")), std::move(kinds)};
}

// -------------------------------------------------- lookup table

Json to_json(const LookupTable& table) {
  Json out{{"features", to_json(table.space())}, {"rows", Json::array()}};
  for (const LookupTable::Row& row : table.rows()) {
    Json entries = Json::array();
    for (const auto& [mbps, setting] : row.entries)
      entries.push_back({seven_digits(mbps), to_json(setting)});
    out["rows"].push_back({{"layers", row.layers},
                           {"bits", row.bits ? Json(*row.bits) : Json(nullptr)},
                           {"at", to_json(row.features)},
                           {"entries", std::move(entries)}});
  }
  return out;
}
LookupTable lookup_table(const Json& in) {
  std::vector<LookupTable::Row> out;
  for (const Json& r : rows(in.at("rows"))) {
    LookupTable::Row& row = out.emplace_back();
    row.layers = r.at("layers").get<bool>();
    if (const Json& bits = r.at("bits"); !bits.is_null())
      row.bits = whole_number(bits.get<double>(), 0, kMostWhole);
    row.features = numbers(r.at("at"), FeatureSpace::size());
    for (const Json& entry : rows(r.at("entries")))
      row.entries.push_back({entry.at(0).get<double>(), setting(entry.at(1))});
    if (row.entries.empty()) refuse("a row without entries");
  }
  if (out.empty()) refuse("a lookup table without rows");
  return {feature_space(in.at("features")), std::move(out)};
}

// -------------------------------------------------- ours

Json to_json(const std::vector<CurvePredictor::Member>& members) {
  Json out = Json::array();
  for (const auto& [features, values] : members)
    out.push_back({to_json(features), to_json(values)});
  return out;
}
std::vector<CurvePredictor::Member> members(const Json& in) {
  std::vector<CurvePredictor::Member> out;
  for (const Json& row : rows(in))
    out.push_back({numbers(row.at(0), FeatureSpace::size()),
                   numbers(row.at(1), CurvePredictor::value_count())});
  return out;
}

Json to_json(const CurvePredictor& p) {
  return {{"features", to_json(p.space())},
          {"layers", to_json(p.members().layers)},
          {"without_layers", to_json(p.members().without_layers)}};
}
CurvePredictor curve_predictor(const Json& in) {
  CurvePredictor::Members all{members(in.at("layers")), members(in.at("without_layers"))};
  if (all.layers.empty() && all.without_layers.empty()) refuse("a predictor without members");
  return {feature_space(in.at("features")), std::move(all)};
}

}  // namespace

Models Models::train(std::span<const Sweep> sweeps) {
  return {Classifier::train(sweeps), LookupTable::train(sweeps), CurvePredictor::train(sweeps)};
}

std::shared_ptr<const Model> Models::get(RateConfig::Model which) const {
  switch (which) {
    case RateConfig::Model::classifier:
      return std::make_shared<Classifier>(classifier);
    case RateConfig::Model::lookup:
      return std::make_shared<LookupTable>(lookup);
    case RateConfig::Model::ours:
      return std::make_shared<CurvePredictor>(ours);
    case RateConfig::Model::fixed:
      break;
  }
  MR_ASSERT(false);
  return nullptr;
}

std::string to_json(const Models& models) {
  return "{\"version\": " + std::to_string(Models::kVersion) +
         ",\n\"classifier\": " + to_json(models.classifier).dump() +
         ",\n\"lookup\": " + to_json(models.lookup).dump() +
         ",\n\"ours\": " + to_json(models.ours).dump() + "}\n";
}

Result<Models> models_from_json(std::string_view text) {
  if (text.size() > kMostBytes)
    return Error{Error::Cause::too_large, "a model file of over 16 MiB"};
  try {
    const Json in = Json::parse(text);
    if (const int version = whole_number(in.at("version").get<double>(), -kMostWhole, kMostWhole);
        version != Models::kVersion)
      return Error{Error::Cause::unsupported, "a model file of version " + std::to_string(version) +
                                                  "; this program reads version " +
                                                  std::to_string(Models::kVersion) +
                                                  ": make it again with 'meshreduce train'"};
    return Models{classifier(in.at("classifier")), lookup_table(in.at("lookup")),
                  curve_predictor(in.at("ours"))};
  } catch (const std::exception& wrong) {
    return Error{Error::Cause::corrupt, std::string("no model file: ") + wrong.what()};
  }
}

const Result<Models>& shipped_models() {
  static const Result<Models> models = models_from_json(kShippedModels);
  return models;
}

Result<std::shared_ptr<const Model>> open_model(
    const RateConfig& config, const std::function<void(const std::string&)>& notice) {
  if (config.model == RateConfig::Model::fixed) return std::shared_ptr<const Model>();
  if (!config.model_file.empty()) {
    const auto bytes = read_file(config.model_file, kMostBytes);
    const auto models =
        bytes ? models_from_json({reinterpret_cast<const char*>(bytes->data()), bytes->size()})
              : Result<Models>(bytes.error());
    if (models) return models->get(config.model);
    notice("rate.model_file '" + config.model_file.string() + "': " + models.error().message +
           "; the program's own model takes its place");
  }
  const Result<Models>& own = shipped_models();
  if (!own) return own.error();
  return own->get(config.model);
}

int lattice_of_epoch(const RateConfig& config, bool layers, double voxel_m) {
  const auto model = open_model(config, [](const std::string&) {});  // told where it is used
  if (!model || !*model) return kBits;
  Observation observed;
  observed.layers = layers, observed.moving_weight = config.moving_weight;
  observed.coarsest_error_voxels = coarsest_error_voxels(voxel_m);
  return (*model)->choose(observed, config.target_mbps).bits;
}

}  // namespace mr::rate
