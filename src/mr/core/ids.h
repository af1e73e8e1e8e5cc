#pragma once

#include <cstddef>
#include <cstdint>

/// Numbers that must not be taken for each other. A sensor measures triangles, a view textures
/// them, a texture stream carries the pictures of one or more views.
namespace mr {

enum class SensorId : std::uint32_t {};  ///< index of the sensor in the scene file
enum class ViewId : std::uint32_t {};    ///< of a scene; a live view and its plate share one
enum class StreamId : std::uint32_t {};  ///< of a node's packets

inline constexpr SensorId kNoSensor{0xFFFFFFFFu};  ///< nobody says who measured a triangle
/// A triangle that no view textures; drawn in a neutral colour.
inline constexpr ViewId kNoView{0xFFFFFFFFu};

/// The number on the wire and in messages.
constexpr std::uint32_t number_of(SensorId id) { return static_cast<std::uint32_t>(id); }
constexpr std::uint32_t number_of(ViewId id) { return static_cast<std::uint32_t>(id); }
constexpr std::uint32_t number_of(StreamId id) { return static_cast<std::uint32_t>(id); }

/// Place of a sensor in Scene::sensors.
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
