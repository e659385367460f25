/* For the tests of holokin: finds a plugin by the index of ament, with pluginlib, as those do that load such plugins.
   HEADER has the class BASE, which is of the package OF. */
#include <iostream>

#include HEADER
#include <pluginlib/class_loader.hpp>

#define TEXT_OF(word) #word
#define TEXT(word) TEXT_OF(word)

int main(int, char **argv) {
  pluginlib::ClassLoader<BASE> loader(TEXT(OF), TEXT(BASE));
  const auto plugin = loader.createUniqueInstance(argv[1]);
  for (const auto &name : loader.getDeclaredClasses()) std::cout << name << "\n";
  return plugin ? 0 : 1;
}
