/* For the tests of holokin with ros2_control's own base class: stands in for the header of this name. */
#pragma once
#include <cxxabi.h>

#include <memory>
#include <type_traits>
namespace rcpputils {
template <class T>
struct is_pointer : std::is_pointer<T> {};
template <class T>
struct is_pointer<std::shared_ptr<T>> : std::true_type {};
}  // namespace rcpputils
