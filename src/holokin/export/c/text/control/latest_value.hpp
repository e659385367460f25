/* $title. Written by holokin $version. */
#pragma once

#include <array>
#include <atomic>
#include <cstddef>

namespace $package {

/* The latest value that one thread wrote, for one thread that reads. Neither waits, locks or allocates: one slot is the
   writer's, one the reader's, and the third one lies between them. */
template <class T>
class LatestValue {
 public:
  void write(const T &value) {
    slots_[back_] = value;
    back_ = between_.exchange(back_ | FRESH, std::memory_order_acq_rel) & ~FRESH;
  }

  /* False where nothing was written since the last call; `value` is then as it was. */
  bool read(T &value) {
    if ((between_.load(std::memory_order_acquire) & FRESH) == 0) return false;
    front_ = between_.exchange(front_, std::memory_order_acq_rel) & ~FRESH;
    value = slots_[front_];
    return true;
  }

 private:
  static constexpr std::size_t FRESH = 4;

  std::array<T, 3> slots_{};
  std::size_t back_ = 0, front_ = 1;
  std::atomic<std::size_t> between_{2};
  static_assert(std::atomic<std::size_t>::is_always_lock_free, "the two threads do not wait");
};

}  // namespace $package
