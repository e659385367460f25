/* For the tests of holokin: one thread writes, another one reads, as fast as they can. */
#include <cstdio>
#include <thread>

#include "latest_value.hpp"

struct Pair {
  std::array<long, 20> numbers{};
};

int main() {
  constexpr long COUNT = 300000;
  four_controller::LatestValue<Pair> latest;
  std::thread writer([&latest]() {
    for (long k = 1; k <= COUNT; k++) {
      Pair pair;
      pair.numbers.fill(k);
      latest.write(pair);
    }
  });
  Pair seen;
  long last = 0;
  while (last < COUNT) {
    if (!latest.read(seen)) continue;
    for (const long number : seen.numbers)
      if (number != seen.numbers[0]) return std::puts("torn"), 1;
    if (seen.numbers[0] <= last) return std::puts("older than the one before"), 1;
    last = seen.numbers[0];
  }
  writer.join();
  std::puts("whole and in order");
  return 0;
}
