#pragma once

#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <exception>
#include <functional>
#include <string>
#include <thread>
#include <utility>

namespace mr::net {

/// One thread that runs an asio io_context until stop(). Handlers still pending then are
/// destroyed with this object and not called, so it must outlive all sockets.
class IoThread {
 public:
  /// `failed` is called for exceptions that escape a handler; the thread continues.
  explicit IoThread(std::function<void(const std::string&)> failed) : failed_(std::move(failed)) {}
  ~IoThread() { stop(); }
  IoThread(const IoThread&) = delete;
  IoThread& operator=(const IoThread&) = delete;

  boost::asio::io_context& io() { return io_; }
  void start() {
    thread_ = std::thread([this] { run(); });
  }
  void stop() {
    io_.stop();
    if (thread_.joinable()) thread_.join();
  }

 private:
  void run() {
    while (!io_.stopped()) try {
        io_.run();
      } catch (const std::exception& e) {
        if (failed_) failed_(e.what());
      }
  }

  boost::asio::io_context io_{1};
  boost::asio::executor_work_guard<boost::asio::io_context::executor_type> work_{
      io_.get_executor()};
  std::function<void(const std::string&)> failed_;
  std::thread thread_;
};

}  // namespace mr::net
