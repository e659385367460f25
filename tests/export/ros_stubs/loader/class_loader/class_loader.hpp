/* For the tests of holokin where class_loader is not installed: opens a library and asks it for its plugin. */
#pragma once
#include <dlfcn.h>

#include <memory>
#include <stdexcept>
#include <string>

namespace class_loader {
class ClassLoader {
 public:
  template <class T>
  using UniquePtr = std::unique_ptr<T>;
  explicit ClassLoader(const std::string &library) : handle_(dlopen(library.c_str(), RTLD_NOW | RTLD_LOCAL)) {
    if (handle_ == nullptr) throw std::runtime_error(dlerror());
  }
  template <class T>
  UniquePtr<T> createUniqueInstance(const std::string &) {
    return UniquePtr<T>(reinterpret_cast<T *(*)()>(dlsym(handle_, "make_plugin"))());
  }

 private:
  void *handle_; /* never closed: the plugin lives as long */
};
}  // namespace class_loader
