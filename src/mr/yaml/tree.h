#pragma once

#include <string>
#include <vector>

/// YAML as a plain value: what the scene reader needs and yaml-cpp's own nodes do not give, namely
/// the line of every key, doubled keys kept, and aliases that cannot grow without bound.
namespace mr::yaml {

struct Key {
  std::string name;
  int line = 0;
};

struct Node {
  enum class Kind { null, scalar, list, map };

  Kind kind = Kind::null;
  int line = 0;             ///< 1-based
  std::string text;         ///< of a scalar
  bool quoted = false;      ///< a scalar in quotes, or a block scalar: always a string
  std::vector<Node> items;  ///< of a list; of a map: its values
  std::vector<Key> keys;    ///< of a map: keys[i] names items[i]; doubled keys stay
};

struct Tree {
  Node root;  ///< usable only when `problem` is empty
  std::string problem;
  int line = 0;  ///< of the problem, 1-based
};

/// Reads one document. Refused, with the line: what is not YAML, a second document, nesting deeper
/// than 32, more than 400,000 nodes or 64 MiB of text after aliases are copied, a value over 16
/// KiB, an alias inside its own anchor, tags, and keys that are not plain words. Does not throw.
Tree parse_yaml(const std::string& text);

}  // namespace mr::yaml
