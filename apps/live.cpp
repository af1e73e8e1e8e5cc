#include "live.h"

#include <fmt/format.h>
#include <signal.h>
#include <spdlog/logger.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <mutex>

#include "mr/cli/command_line.h"
#include "mr/core/file.h"
#include "mr/runtime/live_scene.h"
#include "mr/synth/room.h"
#include "output.h"

namespace mr::apps {
namespace {

/// Log lines with time, level and node, and on a terminal one status line below them, which is
/// overwritten. Lines that differ only in numbers are printed once in ten seconds.
class Console {
 public:
  Console() : sink_(std::make_shared<spdlog::sinks::stderr_color_sink_mt>()) {
    sink_->set_pattern("%Y-%m-%d %H:%M:%S.%e %^%l%$ [%n] %v");
  }
  void print(const LogLine& line) {
    const std::lock_guard lock(mutex_);
    const auto now = std::chrono::steady_clock::now();
    if (printed_.size() > 1000) printed_.clear();
    std::string kind = line.node + ": " + line.text;
    std::erase_if(kind, [](char c) { return c >= '0' && c <= '9'; });
    auto& printed = printed_[kind];
    if (printed.count++ > 0 && now - printed.at < std::chrono::seconds(10)) return;
    printed = {now, 1};
    clear();
    const std::string& name = line.node.empty() ? kProgram : line.node;
    spdlog::logger(name, sink_).log(level_of(line.level), line.text);
  }
  void status(const std::string& line) {
    if (!isatty(STDERR_FILENO)) return;
    const std::lock_guard lock(mutex_);
    clear();
    fmt::print(stderr, "{}", line);
    std::fflush(stderr);
    shown_ = !line.empty();
  }

 private:
  struct Printed {
    std::chrono::steady_clock::time_point at;
    int count = 0;
  };
  static spdlog::level::level_enum level_of(LogLevel level) {
    constexpr spdlog::level::level_enum kLevels[] = {spdlog::level::info, spdlog::level::warn,
                                                     spdlog::level::err};
    return kLevels[static_cast<int>(level)];
  }
  void clear() {
    if (std::exchange(shown_, false)) std::fputs("\r\x1b[K", stderr);
  }
  inline static const std::string kProgram = "meshreduce";
  std::shared_ptr<spdlog::sinks::sink> sink_;
  std::mutex mutex_;
  bool shown_ = false;
  std::map<std::string, Printed> printed_;  // by the line's place
};

/// SIGINT and SIGTERM are waited for instead of ending the process. Set before any thread starts.
class Interrupt {
 public:
  Interrupt() {
    sigemptyset(&signals_);
    sigaddset(&signals_, SIGINT);
    sigaddset(&signals_, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
  }
  /// Whether one came within the time.
  bool within(std::chrono::milliseconds time) const {
    const timespec wait{time.count() / 1000, time.count() % 1000 * 1'000'000};
    return sigtimedwait(&signals_, nullptr, &wait) > 0;
  }

 private:
  sigset_t signals_;
};

/// The viewer is built into share/ beside bin/.
std::filesystem::path default_page() {
  std::error_code failed;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", failed);
  return program.parent_path().parent_path() / "share" / "meshreduce" / "web";
}

/// Where programs keep what is theirs between runs.
std::filesystem::path state_folder() {
  if (const char* state = std::getenv("XDG_STATE_HOME"); state != nullptr && *state == '/')
    return std::filesystem::path(state) / "meshreduce";
  if (const char* home = std::getenv("HOME"); home != nullptr && *home == '/')
    return std::filesystem::path(home) / ".local" / "state" / "meshreduce";
  return {};
}

void open_in_browser(const std::string& url) {
  if (!std::getenv("DISPLAY") && !std::getenv("WAYLAND_DISPLAY")) return;
  const std::string command =
      "command -v xdg-open >/dev/null && xdg-open " + url + " >/dev/null 2>&1 &";
  [[maybe_unused]] const int ignored = std::system(command.c_str());  // the address was printed
}

/// "root 6.1 fps, cam-0 6.1 fps, …": frames since the last look.
class FrameRates {
 public:
  std::string line(const runtime::LiveScene& live) {
    const double seconds = live.seconds();
    std::string out = "  ";
    for (const node::NodeStats& node : live.stats()) {
      auto& last = last_[node.id];
      out +=
          fmt::format(" {} {:.1f}", node.id,
                      static_cast<double>(node.frames - last) / std::max(0.1, seconds - seconds_));
      last = node.frames;
    }
    seconds_ = seconds;
    return out + " frames/s";
  }

 private:
  double seconds_ = 0;
  std::map<std::string, std::uint64_t> last_;
};

void show_rendering(Console& console, int done, int of) {
  constexpr int kWidth = 30;
  const int filled = of > 0 ? kWidth * done / of : 0;
  console.status(done >= of ? ""
                            : fmt::format("rendering the rig, once [{:=<{}}>{: <{}}] {}/{}", "",
                                          filled, "", kWidth - filled, done, of));
}

}  // namespace

int run_live(Scene scene, const LiveRun& run) {
  if (scene.pipeline != "meshreduce")
    return misuse(fmt::format("pipeline {} runs in lockstep only: add --frames N", scene.pipeline));
  const Interrupt interrupt;
  if (!scene.gateway) scene.gateway.emplace();
  if (!run.listen.empty()) scene.gateway->listen = run.listen;
  Console console;
  runtime::LiveOptions options;
  options.nodes = run.nodes;
  options.page = run.page.empty() ? default_page() : run.page;
  options.cache_folder = synth::default_rig_cache();
  options.threads = run.threads;
  options.state_folder = state_folder();
  options.metrics = run.metrics;
  options.log = [&](const LogLine& line) { console.print(line); };
  options.rendering = [&](int done, int of) {
    show_rendering(console, done, of);
    if (interrupt.within(std::chrono::milliseconds(0)))
      std::_Exit(cli::kInterrupted);  // the cache keeps what is whole
  };
  auto live = runtime::LiveScene::start(std::move(scene), options);
  if (!live) return fail(live.error().message);

  if (const std::vector<std::string>& urls = (*live)->urls(); !urls.empty()) {
    fmt::print("Open {} in a browser. Ctrl-C ends it.\n", urls.front());
    for (std::size_t i = 1; i < urls.size(); ++i) fmt::print("Or {}\n", urls[i]);
    if (!std::filesystem::is_regular_file(options.page / "index.html"))
      console.print({LogLevel::warning, "gateway",
                     "no page in " + options.page.string() +
                         "; build it with scripts/build, or name it with --page"});
    if (run.open_browser) open_in_browser(urls.front());
  } else {
    fmt::print("Running {}. Ctrl-C ends it.\n", fmt::join(run.nodes, ", "));
  }
  std::fflush(stdout);

  FrameRates rates;
  while (!interrupt.within(std::chrono::seconds(1)) &&
         (run.seconds <= 0 || (*live)->seconds() < run.seconds))
    console.status(rates.line(**live));
  console.status("");
  if (run.report.empty()) return 0;
  const Status written = write_file(run.report, to_json(**live));
  return written ? 0 : fail(written.error().message);
}

}  // namespace mr::apps
