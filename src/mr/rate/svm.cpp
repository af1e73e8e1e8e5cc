#include "mr/rate/svm.h"

#include <libsvm/svm.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "mr/core/assert.h"

namespace mr::rate {
namespace {

constexpr double kCost = 8;  // of a sample on the wrong side

/// libsvm's list of (index, value), ended by index -1.
std::vector<svm_node> nodes_of(const std::vector<double>& features) {
  std::vector<svm_node> out;
  for (std::size_t i = 0; i < features.size(); ++i)
    out.push_back({static_cast<int>(i) + 1, features[i]});
  out.push_back({-1, 0});
  return out;
}

std::vector<double> features_of(const svm_node* node, std::size_t size) {
  std::vector<double> out(size, 0);
  for (; node->index != -1; ++node) out[static_cast<std::size_t>(node->index) - 1] = node->value;
  return out;
}

}  // namespace

/// The parts, and libsvm's view of them.
struct Svm::Machine {
  explicit Machine(Parts of) : parts(std::move(of)) {
    for (const auto& vector : parts.vectors) nodes.push_back(nodes_of(vector));
    for (auto& row : nodes) rows.push_back(row.data());
    for (auto& row : parts.coefficients) coefficients.push_back(row.data());
    model.param.svm_type = C_SVC, model.param.kernel_type = RBF;
    model.param.gamma = parts.gamma;
    model.nr_class = static_cast<int>(parts.labels.size());
    model.l = static_cast<int>(rows.size());
    model.SV = rows.data(), model.sv_coef = coefficients.data(), model.rho = parts.rho.data();
    model.label = parts.labels.data(), model.nSV = parts.counts.data();
  }
  Machine(const Machine&) = delete;
  Machine& operator=(const Machine&) = delete;

  Parts parts;
  std::vector<std::vector<svm_node>> nodes;
  std::vector<svm_node*> rows;
  std::vector<double*> coefficients;
  svm_model model{};
};

Svm Svm::train(const std::vector<std::vector<double>>& samples, const std::vector<int>& classes) {
  MR_ASSERT(!samples.empty() && samples.size() == classes.size());
  svm_set_print_string_function([](const char*) {});
  std::vector<std::vector<svm_node>> nodes;
  for (const auto& sample : samples) nodes.push_back(nodes_of(sample));
  std::vector<svm_node*> rows;
  for (auto& row : nodes) rows.push_back(row.data());
  std::vector<double> labels(classes.begin(), classes.end());
  const svm_problem problem{static_cast<int>(rows.size()), labels.data(), rows.data()};
  svm_parameter parameter{};
  parameter.svm_type = C_SVC, parameter.kernel_type = RBF;
  parameter.gamma = 1.0 / static_cast<double>(samples.front().size());
  parameter.cache_size = 16, parameter.eps = 1e-3, parameter.C = kCost, parameter.shrinking = 1;
  svm_model* trained = svm_train(&problem, &parameter);
  Parts parts;
  parts.gamma = parameter.gamma;
  const auto count = static_cast<std::size_t>(trained->nr_class);
  parts.labels.assign(trained->label, trained->label + count);
  parts.counts.assign(trained->nSV, trained->nSV + count);
  parts.rho.assign(trained->rho, trained->rho + count * (count - 1) / 2);
  const auto vectors = static_cast<std::size_t>(trained->l);
  for (std::size_t c = 0; c + 1 < count; ++c)
    parts.coefficients.emplace_back(trained->sv_coef[c], trained->sv_coef[c] + vectors);
  for (std::size_t v = 0; v < vectors; ++v)
    parts.vectors.push_back(features_of(trained->SV[v], samples.front().size()));
  svm_free_and_destroy_model(&trained);
  Svm out;
  out.machine_ = std::make_shared<const Machine>(std::move(parts));
  return out;
}

Result<Svm> Svm::from(Parts parts) {
  constexpr std::size_t kMostClasses = 256, kMostVectors = 100'000;
  const std::size_t classes = parts.labels.size(), vectors = parts.vectors.size();
  const auto are_finite = [](const std::vector<double>& values) {
    return std::ranges::all_of(values, [](double v) { return std::isfinite(v); });
  };
  std::size_t counted = 0;
  bool good = classes > 0 && classes <= kMostClasses && vectors <= kMostVectors &&
              parts.counts.size() == classes && parts.rho.size() == classes * (classes - 1) / 2 &&
              parts.coefficients.size() == classes - 1 && are_finite(parts.rho) &&
              std::isfinite(parts.gamma) && parts.gamma > 0;
  for (const int n : parts.counts)
    good = good && n >= 0, counted += static_cast<std::size_t>(std::max(n, 0));
  good = good && counted == vectors;
  for (const auto& row : parts.coefficients)
    good = good && row.size() == vectors && are_finite(row);
  for (const auto& vector : parts.vectors)
    good = good && vector.size() == parts.vectors.front().size() && are_finite(vector);
  if (!good) return Error{Error::Cause::corrupt, "an impossible support vector machine"};
  Svm out;
  out.machine_ = std::make_shared<const Machine>(std::move(parts));
  return out;
}

int Svm::predict(const std::vector<double>& features) const {
  MR_ASSERT(machine_);
  if (machine_->parts.labels.size() == 1) return machine_->parts.labels.front();
  const std::vector<svm_node> nodes = nodes_of(features);
  return static_cast<int>(std::lround(svm_predict(&machine_->model, nodes.data())));
}

const Svm::Parts& Svm::parts() const { return machine_->parts; }

}  // namespace mr::rate
