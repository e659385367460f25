/* For the tests of holokin where GoogleTest is not installed: what the test of an exported package uses of it. */
#pragma once
#include <cmath>
#include <functional>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

namespace testing {
inline int failures = 0;
inline bool stopped = false;

class Test {
 public:
  virtual ~Test() = default;
  virtual void SetUp() {}
  virtual void TestBody() = 0;
};

struct Case {
  std::string name;
  std::function<Test *()> make;
};
inline std::vector<Case> &cases() {
  static std::vector<Case> all;
  return all;
}

/* Says what failed when it ends, with what was written to it. */
struct Check {
  bool good;
  std::string what;
  std::ostringstream said;
  Check(bool ok, std::string words) : good(ok), what(std::move(words)) {}
  Check(const Check &) = delete;
  explicit operator bool() const { return good; }
  template <class T>
  Check &operator<<(const T &word) {
    said << word;
    return *this;
  }
  ~Check() {
    if (!good) failures++, std::cerr << "FAILED " << what << " " << said.str() << "\n";
  }
};
struct Stop {
  void operator=(const Check &) const { stopped = true; }
};
}  // namespace testing

#define CHECK_THAT(what) \
  if (const bool good_ = static_cast<bool>(what); good_) \
    ; \
  else \
    testing::Check(false, #what)
#define MUST_THAT(what) \
  if (const bool good_ = static_cast<bool>(what); good_) \
    ; \
  else \
    return testing::Stop() = testing::Check(false, #what)
#define EXPECT_TRUE(a) CHECK_THAT(a)
#define EXPECT_FALSE(a) CHECK_THAT(!(a))
#define EXPECT_EQ(a, b) CHECK_THAT((a) == (b))
#define EXPECT_LE(a, b) CHECK_THAT((a) <= (b))
#define EXPECT_NEAR(a, b, most) CHECK_THAT(std::abs((a) - (b)) <= (most))
#define ASSERT_TRUE(a) MUST_THAT(a)
#define TEST_F(fixture, name) \
  struct fixture##_##name : fixture { \
    void TestBody() override; \
  }; \
  static const bool listed_##name = (testing::cases().push_back({#name, [] { return new fixture##_##name; }}), true); \
  void fixture##_##name::TestBody()

int main() {
  for (const auto &one : testing::cases()) {
    testing::Test *test = one.make();
    testing::stopped = false;
    test->SetUp();
    if (!testing::stopped) test->TestBody();
    delete test;
  }
  std::cout << testing::cases().size() << " tests, " << testing::failures << " failures\n";
  return testing::failures != 0;
}
