#include "mr/yaml/edit.h"

#include <algorithm>
#include <charconv>

#include "mr/yaml/map_reader.h"

namespace mr::yaml {
namespace {

constexpr std::size_t kMaxParts = 32;

/// "a.b.c" as its parts; none where one of them is empty.
std::vector<std::string> parts_of(const std::string& path) {
  std::vector<std::string> parts;
  for (std::size_t at = 0; at <= path.size();) {
    const std::size_t dot = std::min(path.find('.', at), path.size());
    if (dot == at) return {};
    parts.push_back(path.substr(at, dot - at));
    at = dot + 1;
  }
  return parts;
}

void move_to_line(Node& node, int line) {
  node.line = line;
  for (Key& key : node.keys) key.line = line;
  for (Node& item : node.items) move_to_line(item, line);
}

bool has_id(const Node& item, const std::string& id) {
  for (std::size_t i = 0; i < item.keys.size(); ++i)
    if (item.keys[i].name == "id" && item.items[i].text == id) return true;
  return false;
}

/// The item of a list that has this id, or this number; null where there is none.
Node* item_of(Node& list, const std::string& part) {
  const auto named = std::find_if(list.items.begin(), list.items.end(),
                                  [&](const Node& item) { return has_id(item, part); });
  if (named != list.items.end()) return &*named;
  std::size_t number = 0;
  const char* const end = part.data() + part.size();
  const auto [stop, failed] = std::from_chars(part.data(), end, number);
  const bool good = failed == std::errc() && stop == end && number < list.items.size();
  return good ? &list.items[number] : nullptr;
}

/// The value of a key, which is added where it is missing.
Node& value_of(Node& map, const std::string& part, int line) {
  for (std::size_t i = 0; i < map.keys.size(); ++i)
    if (map.keys[i].name == part) return map.items[i];
  map.keys.push_back({part, line});
  map.items.emplace_back().line = line;
  return map.items.back();
}

}  // namespace

std::string set_value(Node& root, const std::string& option, int line) {
  const std::size_t equals = option.find('=');
  const auto parts = parts_of(option.substr(0, equals));
  if (equals == std::string::npos || parts.empty())
    return "write key=value, as in --set voxel_m=0.02 or --set merge.simplify.ratio=0.5";
  if (parts.size() > kMaxParts) return "its key has more than 32 parts";
  Node value;
  const std::string text = option.substr(equals + 1);
  if (text.find_first_not_of(' ') != std::string::npos) {
    Tree tree = parse_yaml(text);
    if (!tree.problem.empty()) return "its value is not usable: " + tree.problem;
    value = std::move(tree.root);
  }
  move_to_line(value, line);

  Node* node = &root;
  std::string path;
  for (const std::string& part : parts) {
    if (node->kind == Node::Kind::null) node->kind = Node::Kind::map, node->line = line;
    if (node->kind == Node::Kind::scalar)
      return in_quotes(path) + " is a single value and has no key " + in_quotes(part);
    Node* next =
        node->kind == Node::Kind::list ? item_of(*node, part) : &value_of(*node, part, line);
    if (!next)
      return in_quotes(path) + " has no item " + in_quotes(part) + "; it has " +
             std::to_string(node->items.size()) + ", named by id or by number from 0";
    if (&part == &parts.back())
      for (Key& key : node->keys)
        if (key.name == part) key.line = line;
    path += (path.empty() ? "" : ".") + part;
    node = next;
  }
  *node = std::move(value);
  return "";
}

}  // namespace mr::yaml
