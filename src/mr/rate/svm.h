#pragma once

#include <memory>
#include <vector>

#include "mr/core/result.h"

namespace mr::rate {

/// A support vector machine for classes 0, 1, … (C-SVC of libsvm, radial basis functions). Copies
/// share the trained machine; prediction on any thread.
class Svm {
 public:
  /// What prediction needs, as stored in a model file.
  struct Parts {
    double gamma = 1;
    std::vector<int> labels;                        ///< of the classes
    std::vector<int> counts;                        ///< support vectors of each class
    std::vector<double> rho;                        ///< of each pair of classes
    std::vector<std::vector<double>> coefficients;  ///< [classes - 1][support vectors]
    std::vector<std::vector<double>> vectors;       ///< [support vectors][features]
  };

  Svm() = default;
  /// `samples`: [samples][features], not empty, each of a class. Deterministic.
  static Svm train(const std::vector<std::vector<double>>& samples,
                   const std::vector<int>& classes);
  /// Errors: corrupt: parts that do not fit together, or are not finite.
  static Result<Svm> from(Parts parts);

  int predict(const std::vector<double>& features) const;
  const Parts& parts() const;

 private:
  struct Machine;
  std::shared_ptr<const Machine> machine_;
};

}  // namespace mr::rate
