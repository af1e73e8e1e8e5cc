#pragma once

#include <cstddef>
#include <cstdint>

/// Identifiers as distinct types, so that the compiler tells them apart. A sensor measures
/// triangles, a view textures them, a texture stream carries the pictures of one or more views.
namespace mr {

enum class SensorId : std::uint32_t {};  ///< index of the sensor in the scene file
enum class ViewId : std::uint32_t {};    ///< unique in a scene; a live view and its plate share one
enum class StreamId : std::uint32_t {};  ///< unique within a node's packets

inline constexpr SensorId kNoSensor{
    0xFFFFFFFFu};  ///< the sensor that measured a triangle is not known
/// Label of a triangle that no view textures; it is drawn in a neutral colour.
inline constexpr ViewId kNoView{0xFFFFFFFFu};

/// The number of an identifier, as on the wire and in messages.
constexpr std::uint32_t number_of(SensorId id) { return static_cast<std::uint32_t>(id); }
constexpr std::uint32_t number_of(ViewId id) { return static_cast<std::uint32_t>(id); }
constexpr std::uint32_t number_of(StreamId id) { return static_cast<std::uint32_t>(id); }

/// Index of a sensor in Scene::sensors.
constexpr std::size_t index_of(SensorId id) { return number_of(id); }
constexpr SensorId sensor_at(std::size_t index) {
  return SensorId{static_cast<std::uint32_t>(index)};
}

/// The view of a sensor's own colour picture.
constexpr ViewId view_of(SensorId id) { return ViewId{number_of(id)}; }
/// The sensor whose colour picture a view shows.
constexpr SensorId sensor_of(ViewId id) { return SensorId{number_of(id)}; }
/// The texture stream in which a sensor sends its colour picture.
constexpr StreamId stream_of(SensorId id) { return StreamId{number_of(id)}; }

}  // namespace mr
