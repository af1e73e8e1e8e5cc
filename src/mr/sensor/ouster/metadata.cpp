#include "mr/sensor/ouster/metadata.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "mr/core/file.h"
#include "mr/core/user_text.h"

namespace mr::sensor {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kMetadataBytes = std::size_t{1} << 20;
constexpr int kMostBeams = 512, kMostColumnsPerPacket = 256;
constexpr std::size_t kMostUdpBytes = 65507;

struct OusterMode {
  std::string_view name;
  int width;
  double rate_hz;
  int gen1_shift;  ///< between neighbouring rows of four; 0: gen 1 has no such mode
};
constexpr std::array<OusterMode, 6> kModes{{{"512x10", 512, 10, 3},
                                            {"512x20", 512, 20, 3},
                                            {"1024x10", 1024, 10, 6},
                                            {"1024x20", 1024, 20, 6},
                                            {"2048x10", 2048, 10, 12},
                                            {"4096x5", 4096, 5, 0}}};

/// A value of the JSON and its place in it, for messages.
struct Field {
  const Json* value = nullptr;  ///< null: missing
  std::string name;
};

Error unusable(const std::string& field, const std::string& problem) {
  return {Error::Cause::invalid, "Ouster metadata: " + field + " " + problem};
}
Error unsupported(const std::string& field, const std::string& problem) {
  return {Error::Cause::unsupported, "Ouster metadata: " + field + " " + problem};
}

/// Finds values by the section and key of the newer generation, and flat in the older.
class MetadataFields {
 public:
  explicit MetadataFields(const Json& root)
      : root_(root),
        legacy_(!root.contains("sensor_info") && !root.contains("lidar_data_format") &&
                !root.contains("config_params")) {}

  Field find(const char* section, const char* key) const {
    if (legacy_) {
      if (std::string_view(section) != "lidar_data_format") return in(root_, "", key);
      section = "data_format";
    }
    const auto at = root_.find(section);
    if (at == root_.end() || at->is_null()) return {nullptr, std::string(section) + "." + key};
    return in(*at, std::string(section) + ".", key);
  }

 private:
  static Field in(const Json& object, const std::string& path, const char* key) {
    Field out{nullptr, path + key};
    if (!object.is_object()) return out;
    const auto at = object.find(key);
    if (at != object.end() && !at->is_null()) out.value = &*at;
    return out;
  }

  const Json& root_;
  bool legacy_;
};

Result<std::string> text_of(const Field& field) {
  if (field.value == nullptr) return std::string();
  if (!field.value->is_string()) return unusable(field.name, "must be a text");
  return field.value->get<std::string>();
}

/// An integer in [low, high]; `missing` where the key is.
Result<std::int64_t> integer_of(const Field& field, std::int64_t low, std::int64_t high,
                                std::int64_t missing) {
  if (field.value == nullptr) return missing;
  const bool fits = field.value->is_number_integer() &&
                    !(field.value->is_number_unsigned() &&
                      field.value->get<std::uint64_t>() > static_cast<std::uint64_t>(INT64_MAX));
  const std::int64_t value = fits ? field.value->get<std::int64_t>() : 0;
  if (!fits || value < low || value > high)
    return unusable(field.name, fmt::format("must be an integer from {} to {}", low, high));
  return value;
}

/// `count` finite numbers of at most `most` in magnitude; empty where the key is missing.
Result<std::vector<double>> numbers_of(const Field& field, std::size_t count, double most) {
  std::vector<double> out;
  if (field.value == nullptr) return out;
  if (!field.value->is_array() || field.value->size() != count)
    return unusable(field.name,
                    fmt::format("must be a list of {} numbers, not {}", count,
                                field.value->is_array() ? std::to_string(field.value->size())
                                                        : std::string(field.value->type_name())));
  for (const Json& entry : *field.value) {
    const double value = entry.is_number() ? entry.get<double>() : NAN;
    if (!(std::abs(value) <= most))
      return unusable(field.name, fmt::format("must hold numbers from {} to {}", -most, most));
    out.push_back(value);
  }
  return out;
}

/// Numbers of the sensor in its packets' headers; nothing where the text is not such a number.
std::optional<std::uint64_t> serial_number_of(const std::string& text) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value == 0) return std::nullopt;
  return value;
}

Status read_identity(const MetadataFields& fields, OusterMetadata& out) {
  for (const auto& [key, target] : {std::pair{"prod_line", &out.product},
                                    {"prod_sn", &out.serial},
                                    {"build_rev", &out.firmware}}) {
    auto text = text_of(fields.find("sensor_info", key));
    if (!text) return text.error();
    *target = std::move(*text);
  }
  out.serial_number = serial_number_of(out.serial);
  const Field init = fields.find("sensor_info", "initialization_id");
  const auto init_id = integer_of(init, 0, 0xFFFFFF, 0);
  if (!init_id) return init_id.error();
  if (init.value != nullptr) out.init_id = static_cast<std::uint32_t>(*init_id);
  const auto lidar_port = integer_of(fields.find("config_params", "udp_port_lidar"), 0, 65535, 0);
  if (!lidar_port) return lidar_port.error();
  const auto imu_port = integer_of(fields.find("config_params", "udp_port_imu"), 0, 65535, 0);
  if (!imu_port) return imu_port.error();
  out.udp_port_lidar = static_cast<int>(*lidar_port);
  out.udp_port_imu = static_cast<int>(*imu_port);
  return {};
}

Result<OusterMode> read_mode(const MetadataFields& fields) {
  const Field field = fields.find("config_params", "lidar_mode");
  const auto name = text_of(field);
  if (!name) return name.error();
  std::string known;
  for (const OusterMode& mode : kModes) {
    if (mode.name == *name) return mode;
    known += (known.empty() ? "" : ", ") + std::string(mode.name);
  }
  if (name->empty()) return unusable(field.name, "is missing; it must be one of " + known);
  return unsupported(field.name, in_quotes(*name) + " is not supported; supported are " + known);
}

Result<LidarProfile> read_profile(const MetadataFields& fields) {
  const Field field = fields.find("lidar_data_format", "udp_profile_lidar");
  const auto name = text_of(field);
  if (!name) return name.error();
  if (field.value == nullptr) return LidarProfile::legacy;
  if (const auto profile = profile_named(*name)) return *profile;
  std::string known;
  for (int i = 0; i <= static_cast<int>(LidarProfile::fusa_rng15_rfl8_nir8_dual); ++i)
    known += (i == 0 ? "" : ", ") + std::string(profile_name(static_cast<LidarProfile>(i)));
  return unsupported(field.name, in_quotes(*name) + " is not supported; supported are " + known);
}

Status read_window(const Field& field, OusterMetadata& out) {
  out.window_first = 0;
  out.window_last = out.width - 1;
  if (field.value == nullptr) return {};
  const Json& window = *field.value;
  int ends[2] = {};
  for (std::size_t i = 0; i < 2; ++i) {
    if (!window.is_array() || window.size() != 2)
      return unusable(field.name, "must be two columns [first, last]");
    const auto end = integer_of({&window[i], field.name}, 0, out.width - 1, 0);
    if (!end) return end.error();
    ends[i] = static_cast<int>(*end);
  }
  out.window_first = ends[0];
  out.window_last = ends[1];
  return {};
}

Status read_shifts(const Field& field, const OusterMode& mode, OusterMetadata& out) {
  const auto rows = static_cast<std::size_t>(out.height);
  auto shifts = numbers_of(field, rows, out.width - 1);
  if (!shifts) return shifts.error();
  if (shifts->empty() && mode.gen1_shift == 0)
    return unusable(field.name, "is missing and has no default in mode " + std::string(mode.name));
  for (std::size_t row = 0; row < rows; ++row) {
    const double shift =
        shifts->empty() ? mode.gen1_shift * (3 - static_cast<int>(row % 4)) : (*shifts)[row];
    if (shift != std::floor(shift)) return unusable(field.name, "must hold integers");
    out.pixel_shift_by_row.push_back(static_cast<int>(shift));
  }
  return {};
}

Status read_data_format(const MetadataFields& fields, OusterMetadata& out) {
  const auto mode = read_mode(fields);
  if (!mode) return mode.error();
  out.mode = mode->name;
  out.rate_hz = mode->rate_hz;
  const auto profile = read_profile(fields);
  if (!profile) return profile.error();
  out.profile = *profile;
  const auto in_format = [&](const char* key) { return fields.find("lidar_data_format", key); };
  const auto width = integer_of(in_format("columns_per_frame"), 1, 4096, mode->width);
  if (!width) return width.error();
  if (*width != mode->width)
    return unusable(
        in_format("columns_per_frame").name,
        fmt::format("is {}, but mode {} has {} columns", *width, out.mode, mode->width));
  out.width = mode->width;
  const auto height = integer_of(in_format("pixels_per_column"), 1, kMostBeams, 64);
  if (!height) return height.error();
  out.height = static_cast<int>(*height);
  const auto columns = integer_of(in_format("columns_per_packet"), 1, kMostColumnsPerPacket, 16);
  if (!columns) return columns.error();
  out.columns_per_packet = static_cast<int>(*columns);
  if (out.packet_format().packet_bytes() > kMostUdpBytes)
    return unusable(in_format("columns_per_packet").name,
                    fmt::format("makes packets of {} bytes, more than UDP carries",
                                out.packet_format().packet_bytes()));
  if (Status window = read_window(in_format("column_window"), out); !window) return window;
  return read_shifts(in_format("pixel_shift_by_row"), *mode, out);
}

/// Design values of a first-generation sensor: 64 beams between ±16.611 degrees, four azimuths.
double gen1_altitude_deg(int row) { return 16.611 - 2 * 16.611 / 63 * row; }
double gen1_azimuth_deg(int row) {
  return std::array{3.164, 1.055, -1.055, -3.164}[static_cast<std::size_t>(row % 4)];
}

/// One angle per beam, radians; the first generation's where the key is missing.
Result<std::vector<double>> read_angles(const MetadataFields& fields, const char* key, int rows,
                                        double most_deg, double (*missing)(int)) {
  const Field field = fields.find("beam_intrinsics", key);
  auto angles = numbers_of(field, static_cast<std::size_t>(rows), most_deg);
  if (!angles) return angles.error();
  if (angles->empty() && rows != 64)
    return unusable(field.name, fmt::format("is missing; {} beams have no default", rows));
  for (int row = 0; angles->size() < static_cast<std::size_t>(rows); ++row)
    angles->push_back(missing(row));
  for (double& angle : *angles) angle *= std::numbers::pi / 180;
  return angles;
}

double default_beam_origin_mm(const std::string& product) {
  if (product.starts_with("OS-0-")) return 27.67;
  if (product.starts_with("OS-1-")) return 15.806;
  if (product.starts_with("OS-2-")) return 13.762;
  return 12.163;
}

Status read_beam_to_lidar(const MetadataFields& fields, OusterMetadata& out) {
  constexpr double kMost_mm = 1000;
  const Field matrix = fields.find("beam_intrinsics", "beam_to_lidar_transform");
  const auto given = numbers_of(matrix, 16, kMost_mm);
  if (!given) return given.error();
  if (!given->empty()) {
    std::ranges::copy(*given, out.beam_to_lidar.begin());
    return {};
  }
  out.beam_to_lidar = Pose{}.matrix();
  out.beam_to_lidar[3] = default_beam_origin_mm(out.product);
  const Field origin = fields.find("beam_intrinsics", "lidar_origin_to_beam_origin_mm");
  if (origin.value == nullptr) return {};
  const double mm = origin.value->is_number() ? origin.value->get<double>() : NAN;
  if (!(std::abs(mm) <= kMost_mm))
    return unusable(origin.name, fmt::format("must be a number up to {}", kMost_mm));
  out.beam_to_lidar[3] = mm;
  return {};
}

Status read_lidar_to_sensor(const MetadataFields& fields, OusterMetadata& out) {
  const Field field = fields.find("lidar_intrinsics", "lidar_to_sensor_transform");
  const auto given = numbers_of(field, 16, 1e5);
  if (!given) return given.error();
  std::array<double, 16> matrix{-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 36.18, 0, 0, 0, 1};
  if (!given->empty()) std::ranges::copy(*given, matrix.begin());
  for (const std::size_t translation : {3, 7, 11}) matrix[translation] *= 0.001;
  auto pose = pose_from_matrix(matrix);
  if (!pose) return unusable(field.name, "is not a rigid transform");
  out.T_sensor_lidar = *pose;
  return {};
}

Result<OusterMetadata> read_fields(const Json& root) {
  const MetadataFields fields(root);
  OusterMetadata out;
  if (Status identity = read_identity(fields, out); !identity) return identity.error();
  if (Status format = read_data_format(fields, out); !format) return format.error();
  auto altitude = read_angles(fields, "beam_altitude_angles", out.height, 90, gen1_altitude_deg);
  if (!altitude) return altitude.error();
  out.beam_altitude_rad = std::move(*altitude);
  auto azimuth = read_angles(fields, "beam_azimuth_angles", out.height, 360, gen1_azimuth_deg);
  if (!azimuth) return azimuth.error();
  out.beam_azimuth_rad = std::move(*azimuth);
  if (Status beam = read_beam_to_lidar(fields, out); !beam) return beam.error();
  if (Status lidar = read_lidar_to_sensor(fields, out); !lidar) return lidar.error();
  return out;
}

}  // namespace

Result<OusterMetadata> parse_ouster_metadata(std::string_view json) {
  if (json.size() > kMetadataBytes)
    return Error{Error::Cause::too_large, "Ouster metadata: over 1 MiB"};
  const Json root = Json::parse(json.begin(), json.end(), nullptr, /*allow_exceptions=*/false);
  if (root.is_discarded() || !root.is_object())
    return Error{Error::Cause::corrupt, "Ouster metadata: not a JSON object"};
  return read_fields(root);
}

Result<OusterMetadata> read_ouster_metadata(const std::filesystem::path& file) {
  const auto bytes = read_file(file, kMetadataBytes);
  if (!bytes) return bytes.error();
  auto metadata =
      parse_ouster_metadata({reinterpret_cast<const char*>(bytes->data()), bytes->size()});
  if (!metadata)
    return Error{metadata.error().cause, file.string() + ": " + metadata.error().message};
  return metadata;
}

}  // namespace mr::sensor
