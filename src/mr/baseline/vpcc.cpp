#include "mr/baseline/vpcc.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <thread>

#include "mr/baseline/ply_points.h"
#include "mr/core/file.h"

namespace mr::baseline {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kMaxFile = std::uintmax_t{1} << 30;
constexpr int kMostBits = 16;

/// A folder of our own that goes away with everything in it.
class TempFolder {
 public:
  TempFolder() {
    std::error_code failed;
    std::string pattern = (fs::temp_directory_path(failed) / "meshreduce-vpcc-XXXXXX").string();
    if (!failed && mkdtemp(pattern.data()) != nullptr) path_ = pattern;
  }
  ~TempFolder() {
    std::error_code ignored;
    if (!path_.empty()) fs::remove_all(path_, ignored);
  }
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;

  bool ok() const { return !path_.empty(); }
  fs::path file(const char* name) const { return path_ / name; }

 private:
  fs::path path_;
};

Error no_folder() { return {Error::Cause::io, "baseline: no temporary folder for V-PCC"}; }

fs::path on_path(const std::string& program) {
  const char* const all = std::getenv("PATH");
  const std::string path = all == nullptr ? "" : all;
  for (std::size_t at = 0; at < path.size();) {
    const std::size_t end = std::min(path.find(':', at), path.size());
    const fs::path file = fs::path(path.substr(at, end - at)) / program;
    std::error_code failed;
    if (end > at && fs::is_regular_file(file, failed) && ::access(file.c_str(), X_OK) == 0)
      return file;
    at = end + 1;
  }
  return {};
}

/// Starts a program without a shell, in a process group of its own and without its output.
std::optional<pid_t> start(const fs::path& program, const std::vector<std::string>& arguments) {
  std::vector<std::string> words{program.string()};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t files;
  posix_spawnattr_t attributes;
  posix_spawn_file_actions_init(&files);
  posix_spawnattr_init(&attributes);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(&files, STDOUT_FILENO, STDERR_FILENO);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  pid_t child = 0;
  const int rc = posix_spawn(&child, program.c_str(), &files, &attributes, argv.data(), environ);
  posix_spawn_file_actions_destroy(&files);
  posix_spawnattr_destroy(&attributes);
  return rc == 0 ? std::optional(child) : std::nullopt;
}

/// Runs a program to its end, or kills it, with all that it started, after `limit`.
Status run(const fs::path& program, const std::vector<std::string>& arguments,
           std::chrono::seconds limit) {
  const std::string name = "baseline: " + program.filename().string();
  const auto child = start(program, arguments);
  if (!child) return Error{Error::Cause::io, name + " cannot be started"};
  const auto deadline = std::chrono::steady_clock::now() + limit;
  int status = 0;
  while (waitpid(*child, &status, WNOHANG) == 0) {
    if (std::chrono::steady_clock::now() > deadline) {
      kill(-*child, SIGKILL);
      waitpid(*child, &status, 0);
      return Error{Error::Cause::io, name + " takes too long"};
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0)
    return Error{Error::Cause::corrupt, name + " fails"};
  return {};
}

struct Grid {
  Vec3d low;
  double step_m = 0;
  int bits = 0;
};

Result<Grid> grid_of(const PointSet& points, double voxel_m) {
  Box3f box;
  for (const Vec3f& p : points.positions) box.add(p);
  const Vec3d size = vec_cast<double>(box.high - box.low);
  const double cells = std::max({size.x, size.y, size.z}) / voxel_m + 2;
  Grid grid{vec_cast<double>(box.low), voxel_m, 10};
  while (grid.bits <= kMostBits && std::ldexp(1.0, grid.bits) < cells) ++grid.bits;
  if (grid.bits > kMostBits || !is_finite(size))
    return Error{Error::Cause::too_large, "baseline: too many voxels for V-PCC"};
  return grid;
}

PointSet on_grid(PointSet points, const Grid& grid) {
  for (Vec3f& p : points.positions) {
    const Vec3d q = (vec_cast<double>(p) - grid.low) / grid.step_m;
    p = {static_cast<float>(std::round(q.x)), static_cast<float>(std::round(q.y)),
         static_cast<float>(std::round(q.z))};
  }
  return points;
}

std::vector<std::string> encoder_arguments(const VpccPrograms& programs, const Grid& grid,
                                           const fs::path& from, const fs::path& to) {
  std::vector<std::string> out;
  if (!programs.config.empty()) {
    const std::string folder = programs.config.string() + "/";
    out = {"--configurationFolder=" + folder, "--config=" + folder + "common/ctc-common.cfg",
           "--config=" + folder + "condition/ctc-all-intra.cfg",
           "--config=" + folder + "rate/ctc-r3.cfg"};
  }
  const std::vector<std::string> own = {
      "--uncompressedDataPath=" + from.string(),
      "--compressedStreamPath=" + to.string(),
      "--startFrameNumber=0",
      "--frameCount=1",
      "--groupOfFramesSize=1",
      "--resolution=" + std::to_string((1 << grid.bits) - 1),
      "--geometry3dCoordinatesBitdepth=" + std::to_string(grid.bits),
      "--computeMetrics=0",
      "--computeChecksum=0"};
  out.insert(out.end(), own.begin(), own.end());
  return out;
}

}  // namespace

std::optional<VpccPrograms> find_vpcc() {
  VpccPrograms out{on_path("PccAppEncoder"), on_path("PccAppDecoder"), {}, {}};
  out.limit = VpccPrograms{}.limit;
  if (out.encoder.empty() || out.decoder.empty()) return std::nullopt;
  std::error_code failed;
  const fs::path config = fs::canonical(out.encoder, failed).parent_path().parent_path() / "cfg";
  if (!failed && fs::is_directory(config, failed)) out.config = config;
  return out;
}

Result<Bytes> encode_vpcc_points(const VpccPrograms& programs, const PointSet& points,
                                 double voxel_m) {
  const auto grid = grid_of(points, voxel_m);
  if (!grid) return grid.error();
  const TempFolder folder;
  if (!folder.ok()) return no_folder();
  const fs::path ply = folder.file("points.ply"), bin = folder.file("points.bin");
  if (const Status written = write_file(ply, to_ply(on_grid(points, *grid))); !written)
    return written.error();
  if (const Status ran =
          run(programs.encoder, encoder_arguments(programs, *grid, ply, bin), programs.limit);
      !ran)
    return ran.error();
  const auto stream = read_file(bin, kMaxFile);
  if (!stream) return stream.error();
  ByteWriter out;
  for (int axis = 0; axis < 3; ++axis) out.f64(grid->low[axis]);
  out.f64(grid->step_m);
  out.block(*stream);
  return out.take();
}

Result<PointSet> decode_vpcc_points(const VpccPrograms& programs, std::span<const std::byte> bytes,
                                    std::uint32_t most) {
  ByteReader in(bytes);
  Vec3d low;
  for (int axis = 0; axis < 3; ++axis) low[axis] = in.f64();
  const double step_m = in.f64();
  const auto stream = in.block();
  if (!in.at_end() || !is_finite(low) || !(step_m > 0 && step_m < 1))
    return corrupt("no V-PCC stream with its grid");
  const TempFolder folder;
  if (!folder.ok()) return no_folder();
  const fs::path ply = folder.file("points.ply"), bin = folder.file("points.bin");
  if (const Status written = write_file(bin, stream); !written) return written.error();
  std::vector<std::string> arguments = {
      "--compressedStreamPath=" + bin.string(), "--reconstructedDataPath=" + ply.string(),
      "--startFrameNumber=0", "--computeMetrics=0", "--computeChecksum=0"};
  if (const Status ran = run(programs.decoder, arguments, programs.limit); !ran) return ran.error();
  const auto file = read_file(ply, kMaxFile);
  if (!file) return file.error();
  auto points = from_ply(*file, most);
  if (!points) return points;
  for (Vec3f& p : points->positions) p = vec_cast<float>(low + vec_cast<double>(p) * step_m);
  return points;
}

}  // namespace mr::baseline
