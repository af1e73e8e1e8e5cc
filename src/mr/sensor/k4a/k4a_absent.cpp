#include <utility>

#include "mr/core/assert.h"
#include "mr/sensor/k4a/k4a_source.h"

/// In place of k4a_source.cpp where CMake has not found the SDK.
namespace mr::sensor {
namespace {

Error k4a_not_built() {
  return {Error::Cause::unsupported,
          "source type k4a is not built into this program: install the Azure Kinect Sensor SDK or "
          "Orbbec's K4A wrapper and configure with CMAKE_PREFIX_PATH set to it "
          "(docs/sensors.md); recordings (.mkv) need neither"};
}

/// Says why there are no frames, and ends.
class AbsentK4a final : public FrameSource {
 public:
  explicit AbsentK4a(std::string sensor) : sensor_(std::move(sensor)) {}
  Result<std::optional<Frame>> next() override {
    if (std::exchange(is_told_, true)) return std::optional<Frame>();
    const Error error = k4a_not_built();
    return Error{error.cause, "sensor '" + sensor_ + "': " + error.message};
  }
  void skip(std::uint64_t) override {}
  bool endless() const override { return false; }

 private:
  std::string sensor_;
  bool is_told_ = false;
};

}  // namespace

std::unique_ptr<FrameSource> open_k4a(const SensorConfig& sensor, SensorId, const Timeline&) {
  MR_ASSERT(sensor.source.get_if<K4aSource>() != nullptr);
  return std::make_unique<AbsentK4a>(sensor.id);
}

Result<std::vector<K4aDeviceInfo>> find_k4a_devices() { return k4a_not_built(); }

}  // namespace mr::sensor
