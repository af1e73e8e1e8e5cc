#pragma once

#include <optional>
#include <span>
#include <vector>

#include "mr/rate/feature_space.h"
#include "mr/rate/model.h"

namespace mr::rate {

/// The paper's alternative (6.4): settings profiled for scenes of different DCT energy and stored
/// by features and rate. Looks up the scene whose features are the nearest, and there the greatest
/// rate within the target.
class LookupTable final : public Model {
 public:
  struct Entry {
    double mbps = 0;
    Setting setting;
  };
  struct Row {
    bool layers = true;
    std::vector<double> features;  ///< [FeatureSpace::size()]
    std::vector<Entry> entries;    ///< by rising rate; not empty
    std::optional<int> bits = {};  ///< the lattice of all entries; nothing: each its own
  };

  LookupTable() = default;
  LookupTable(FeatureSpace space, std::vector<Row> rows)
      : space_(std::move(space)), rows_(std::move(rows)) {}
  static LookupTable train(std::span<const Sweep> training);

  Setting choose(const Observation& observed, double target_mbps) const override;

  const FeatureSpace& space() const { return space_; }
  const std::vector<Row>& rows() const { return rows_; }

 private:
  FeatureSpace space_;
  std::vector<Row> rows_;
};

}  // namespace mr::rate
