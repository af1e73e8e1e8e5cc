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
/// where possible; serial below one grain. Pieces run concurrently and in any order. A body that
/// writes only to elements of its own indices gives the same result on any number of threads.
/// Exceptions from the body reach the caller.
void parallel_for(std::size_t count, std::size_t grain,
                  const std::function<void(std::size_t begin, std::size_t end)>& body);

/// Runs `work` in isolation (TBB's this_task_arena::isolate): a thread that waits inside it does
/// not steal tasks from outside, which would be counted in the time of `work`.
void isolated(const std::function<void()>& work);

}  // namespace mr
