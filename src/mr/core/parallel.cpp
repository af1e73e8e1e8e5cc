#include "mr/core/parallel.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>

#if defined(__SANITIZE_THREAD__)
#include <sanitizer/tsan_interface.h>
#endif

namespace mr {
namespace {

/// Tells the thread sanitizer about the happens-before order that TBB's tasks establish: the libtbb
/// of distributions is built without the sanitizer's instrumentation.
class Order {
 public:
#if defined(__SANITIZE_THREAD__)
  void before() { __tsan_release(&tag_); }
  void after() { __tsan_acquire(&tag_); }

 private:
  char tag_ = 0;
#else
  void before() {}
  void after() {}
#endif
};

}  // namespace

struct Arena::Impl {
  explicit Impl(int threads) : arena(threads > 0 ? threads : tbb::task_arena::automatic) {}
  tbb::task_arena arena;
};

Arena::Arena(int threads) : impl_(std::make_unique<Impl>(threads)) {}
Arena::~Arena() = default;

int Arena::threads() const { return impl_->arena.max_concurrency(); }

void Arena::run(const std::function<void()>& work) {
  Order begun, done;
  begun.before();
  impl_->arena.execute([&] {
    begun.after();
    work();
    done.before();
  });
  done.after();
}

void parallel_for(std::size_t count, std::size_t grain,
                  const std::function<void(std::size_t, std::size_t)>& body) {
  grain = std::max<std::size_t>(grain, 1);
  if (count <= grain) {
    if (count > 0) body(0, count);
    return;
  }
  Order begun, done;
  begun.before();
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, grain),
                    [&](const tbb::blocked_range<std::size_t>& r) {
                      begun.after();
                      body(r.begin(), r.end());
                      done.before();
                    });
  done.after();
}

void isolated(const std::function<void()>& work) { tbb::this_task_arena::isolate(work); }

}  // namespace mr
