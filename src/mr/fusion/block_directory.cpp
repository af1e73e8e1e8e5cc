#include "mr/fusion/block_directory.h"

#include <algorithm>

namespace mr::fusion {
namespace {

constexpr std::size_t kLeastTable = 1024;

}  // namespace

void BlockDirectory::clear() {
  count_ = last_ = 0;
  table_.assign(std::max(kLeastTable, table_.size()), kNone);
}

const BlockDirectory::Region* BlockDirectory::find_region(Vec3i region) const {
  const std::size_t mask = table_.size() - 1;
  for (std::size_t i = hash_cell(region) & mask; table_[i] != kNone; i = (i + 1) & mask)
    if (regions_[table_[i]].coordinate == region) return &regions_[table_[i]];
  return nullptr;
}

BlockDirectory::Region& BlockDirectory::need_region(Vec3i region) {
  if (last_ < count_ && regions_[last_].coordinate == region) return regions_[last_];
  const std::size_t mask = table_.size() - 1;
  std::size_t i = hash_cell(region) & mask;
  for (; table_[i] != kNone; i = (i + 1) & mask)
    if (regions_[table_[i]].coordinate == region) return regions_[last_ = table_[i]];
  table_[i] = static_cast<std::uint32_t>(count_);
  if (count_ == regions_.size()) regions_.emplace_back();
  last_ = count_++;
  regions_[last_].coordinate = region;
  regions_[last_].slots.fill(kNone);
  if (2 * count_ > table_.size()) rehash(2 * table_.size());
  return regions_[last_];
}

void BlockDirectory::rehash(std::size_t size) {
  table_.assign(size, kNone);
  for (std::uint32_t r = 0; r < count_; ++r) {
    std::size_t i = hash_cell(regions_[r].coordinate) & (size - 1);
    while (table_[i] != kNone) i = (i + 1) & (size - 1);
    table_[i] = r;
  }
}

}  // namespace mr::fusion
