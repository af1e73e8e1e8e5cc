#include "mr/baseline/draco_points.h"

#include <draco/compression/expert_encode.h>
#include <draco/compression/point_cloud/point_cloud_kd_tree_decoder.h>

#include <cstring>
#include <exception>

namespace mr::baseline {
namespace {

using Cell = std::array<std::uint32_t, 3>;
using Color = std::array<std::uint8_t, 3>;
constexpr int kSpeed = 5;

draco::PointAttribute* add_attribute(draco::PointCloud& cloud, draco::GeometryAttribute::Type type,
                                     draco::DataType data, std::size_t bytes) {
  draco::GeometryAttribute attribute;
  attribute.Init(type, nullptr, 3, data, false, static_cast<std::int64_t>(bytes), 0);
  return cloud.attribute(cloud.AddAttribute(attribute, true, cloud.num_points()));
}

Status fill(const PointSet& points, const Lattice& lattice, draco::PointCloud& cloud) {
  const auto count = static_cast<std::uint32_t>(points.positions.size());
  cloud.set_num_points(count);
  auto* positions =
      add_attribute(cloud, draco::GeometryAttribute::POSITION, draco::DT_UINT32, sizeof(Cell));
  auto* colors =
      add_attribute(cloud, draco::GeometryAttribute::COLOR, draco::DT_UINT8, sizeof(Color));
  for (std::uint32_t i = 0; i < count; ++i) {
    const Vec3i q = lattice.quantize(points.positions[i]);
    if (!is_finite(points.positions[i]) || !Lattice::contains(q))
      return Error{Error::Cause::invalid, "baseline: a point is outside the lattice"};
    const Cell cell{static_cast<std::uint32_t>(q.x), static_cast<std::uint32_t>(q.y),
                    static_cast<std::uint32_t>(q.z)};
    positions->SetAttributeValue(draco::AttributeValueIndex(i), cell.data());
    colors->SetAttributeValue(draco::AttributeValueIndex(i), points.colors[i].data());
  }
  return {};
}

bool is(const draco::PointAttribute& a, draco::GeometryAttribute::Type type, draco::DataType data) {
  return a.attribute_type() == type && a.num_components() == 3 && a.data_type() == data;
}

/// Looks at what a stream declares before Draco makes room for it.
class GuardedDecoder final : public draco::PointCloudKdTreeDecoder {
 public:
  explicit GuardedDecoder(std::uint32_t count) : count_(count) {}

 protected:
  bool DecodeGeometryData() override {
    return PointCloudKdTreeDecoder::DecodeGeometryData() && point_cloud()->num_points() == count_;
  }
  bool DecodeAllAttributes() override {
    const draco::PointCloud& cloud = *point_cloud();
    return cloud.num_attributes() == 2 &&
           is(*cloud.attribute(0), draco::GeometryAttribute::POSITION, draco::DT_UINT32) &&
           is(*cloud.attribute(1), draco::GeometryAttribute::COLOR, draco::DT_UINT8) &&
           PointCloudKdTreeDecoder::DecodeAllAttributes();
  }

 private:
  std::uint32_t count_;
};

/// Draco's bitstream 2.3, point cloud, kd-tree, no metadata: all that our encoder writes.
bool has_our_header(std::span<const std::byte> bytes) {
  constexpr unsigned char kStart[] = {'D', 'R', 'A', 'C', 'O', 2, 3, 0, 1, 0, 0};
  return bytes.size() > sizeof kStart && std::memcmp(bytes.data(), kStart, sizeof kStart) == 0;
}

Result<PointSet> points_of(const draco::PointCloud& cloud, const Lattice& lattice) {
  const draco::PointAttribute &positions = *cloud.attribute(0), &colors = *cloud.attribute(1);
  if (!positions.is_mapping_identity() || !colors.is_mapping_identity() ||
      positions.size() < cloud.num_points() || colors.size() < cloud.num_points())
    return corrupt("points without place or colour");
  PointSet out;
  for (std::uint32_t i = 0; i < cloud.num_points(); ++i) {
    Cell cell;
    positions.GetValue(draco::AttributeValueIndex(i), cell.data());
    colors.GetValue(draco::AttributeValueIndex(i), out.colors.emplace_back().data());
    for (const std::uint32_t v : cell)
      if (v >= Lattice::kCells) return corrupt("a point is outside the lattice");
    out.positions.push_back(
        lattice.position({static_cast<std::int32_t>(cell[0]), static_cast<std::int32_t>(cell[1]),
                          static_cast<std::int32_t>(cell[2])}));
  }
  return out;
}

}  // namespace

Result<Bytes> encode_draco_points(const PointSet& points, const Lattice& lattice) {
  try {
    draco::PointCloud cloud;
    if (const Status filled = fill(points, lattice, cloud); !filled) return filled.error();
    draco::ExpertEncoder encoder(cloud);
    encoder.SetSpeedOptions(kSpeed, kSpeed);
    encoder.SetEncodingMethod(draco::POINT_CLOUD_KD_TREE_ENCODING);
    draco::EncoderBuffer buffer;
    if (const draco::Status status = encoder.EncodeToBuffer(&buffer); !status.ok())
      return corrupt("Draco refuses to encode: " + status.error_msg_string());
    const auto* bytes = reinterpret_cast<const std::byte*>(buffer.data());
    return Bytes(bytes, bytes + buffer.size());
  } catch (const std::exception& e) {
    return corrupt(std::string("Draco gave up: ") + e.what());
  }
}

Result<PointSet> decode_draco_points(std::span<const std::byte> bytes, std::uint32_t count,
                                     const Lattice& lattice) {
  if (!has_our_header(bytes)) return corrupt("not a kd-tree stream of version 2.3");
  try {
    draco::DecoderBuffer buffer;
    buffer.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    GuardedDecoder decoder(count);
    draco::PointCloud cloud;
    const draco::Status status = decoder.Decode(draco::DecoderOptions(), &buffer, &cloud);
    if (!status.ok()) return corrupt("Draco refuses to decode: " + status.error_msg_string());
    return points_of(cloud, lattice);
  } catch (const std::exception& e) {
    return corrupt(std::string("Draco gave up: ") + e.what());
  }
}

}  // namespace mr::baseline
