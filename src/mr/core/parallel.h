#pragma once

#include <cstddef>
#include <functional>
#include <memory>

namespace mr {

/// A TBB task arena: the threads that the app gives to the pipeline. parallel_for inside run() uses
/// them. TBB's global settings are not changed.
class Arena {
 public:
  /// `threads`: 0 = all cores.
  explicit Arena(int threads);
  ~Arena();
  Arena(const Arena&) = delete;
  Arena& operator=(const Arena&) = delete;

  int threads() const;
  void run(const std::function<void()>& work);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Calls body(begin, end) on disjoint pieces that cover [0, count), each at least `grain` long
/// where possible; serial below one grain. Pieces may run at once and in any order, so the body
/// writes to places that only its own indices name: then the result is the same on any number of
/// threads. Exceptions from the body reach the caller.
void parallel_for(std::size_t count, std::size_t grain,
                  const std::function<void(std::size_t begin, std::size_t end)>& body);

/// Runs `work` so that a thread that waits inside it takes up nothing from outside: what is timed
/// in it is its own.
void isolated(const std::function<void()>& work);

}  // namespace mr
