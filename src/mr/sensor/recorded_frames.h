#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "mr/core/frame_source.h"
#include "mr/core/sensor_config.h"
#include "mr/core/timeline.h"

namespace mr::sensor {

/// Reads the captures of one recording in order. Times are those of the recording's own clock.
class RecordingReader {
 public:
  /// A capture that is not decoded yet.
  struct Capture {
    TimePoint at{};        ///< Frame::captured_at()
    std::size_t item = 0;  ///< its number in the recording, from 0
  };
  virtual ~RecordingReader() = default;

  /// The next capture; nothing at the end. Error: what is left of the recording cannot be read; it
  /// is not called again before a seek().
  virtual Result<std::optional<Capture>> peek() = 0;
  /// Decodes the capture that peek() told and goes on to the next. The frame has the recording's
  /// own times; sensor, index and pose are left. Error: this capture is lost.
  virtual Result<Frame> take() = 0;
  /// Goes on to the next capture; cheap.
  virtual void drop() = 0;
  /// Goes to a capture at `time` or earlier, such as the last one before it; later ones follow.
  virtual Status seek(TimePoint time) = 0;
};

/// Puts a recording's colour into a frame. Damaged colour costs itself alone: the surface goes on,
/// and the frame says what is wrong with it, with the file and the sensor.
void add_recorded_color(Result<ImageRgb> color, const std::filesystem::path& file,
                        const std::string& sensor, Frame& frame);

/// The number of a capture in a recording by its time; 0 also where the beginning is not known.
std::size_t item_at(TimePoint at, std::optional<TimePoint> first, Duration period);

/// How many captures a recording holds by its times. 0: not known, or more than can be believed.
std::size_t captures_of(std::optional<TimePoint> first, std::optional<TimePoint> last,
                        Duration period);

/// Plays a recording on the scene's clock: frame i is the first capture within half a period of
/// i / fps, if there is one, with the time at which it was really captured (plus the sensor's clock
/// offset and drift). Where there is none the frame is a gap (is_gap). A capture belongs to one
/// frame at most. Poses are those of the sensor at the capture's own time; captures without one are
/// lost.
class RecordedFrames final : public FrameSource {
 public:
  RecordedFrames(std::unique_ptr<RecordingReader> reader, const SensorConfig& sensor, SensorId id,
                 const Timeline& timeline);

  Result<std::optional<Frame>> next() override;
  void skip(std::uint64_t frames) override { index_ += frames; }
  bool endless() const override { return loops_; }

 private:
  Duration scene_time(TimePoint own) const;  ///< within a round, with offset and drift
  TimePoint own_time(Duration scene_time) const;
  Status go_to_round(Duration tick);
  Result<std::optional<RecordingReader::Capture>> peek();
  bool is_astray(TimePoint at);
  Result<std::optional<RecordingReader::Capture>> first_from(TimePoint own);
  Result<std::optional<RecordingReader::Capture>> ended(Duration tick);
  Result<std::optional<Frame>> take(const RecordingReader::Capture& capture, std::uint64_t index);

  const std::unique_ptr<RecordingReader> reader_;
  const SensorConfig sensor_;
  const SensorId id_;
  const Timeline timeline_;
  const bool loops_;
  Duration length_;                  ///< of a round; 0: not known yet
  Duration round_{};                 ///< scene time at which this round began
  std::uint64_t index_ = 0;          ///< of the next frame
  std::optional<TimePoint> last_;    ///< the newest capture seen in this round
  bool failed_ = false;              ///< what is left of this round cannot be read
  std::optional<TimePoint> astray_;  ///< a time stamp that was not believed
};

}  // namespace mr::sensor
