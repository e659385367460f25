#include <type_traits>
/* For the tests of holokin where pluginlib is not installed: one plugin a library, made by a function with a known name. */
#pragma once
#define PLUGINLIB_EXPORT_CLASS(type, base) \
  extern "C" base *make_plugin() { return new type; } \
  static_assert(std::is_base_of<base, type>::value, "the plugin is one of the base class");
