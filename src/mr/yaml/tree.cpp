#include "mr/yaml/tree.h"

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/parser.h>

#include <algorithm>
#include <map>
#include <sstream>
#include <utility>

namespace mr::yaml {
namespace {

constexpr std::size_t kMaxDepth = 32;
constexpr std::size_t kMaxNodes = 400'000;
constexpr std::size_t kMaxText = 16 * 1024;            // bytes of one value
constexpr std::size_t kMaxAllText = 64 * 1024 * 1024;  // bytes, aliases included

/// Leaves the parser; never leaves this file.
struct Refused {
  int line;
  std::string message;
};

struct Size {
  std::size_t nodes = 1, text = 0;
};

Size size_of(const Node& node) {
  Size size{1, node.text.size()};
  for (const Key& key : node.keys) size.nodes += 1, size.text += key.name.size();
  for (const Node& item : node.items) {
    const Size inner = size_of(item);
    size.nodes += inner.nodes, size.text += inner.text;
  }
  return size;
}

std::size_t depth_of(const Node& node) {
  std::size_t deepest = 0;
  for (const Node& item : node.items) deepest = std::max(deepest, depth_of(item));
  return deepest + 1;
}

/// Builds the tree from yaml-cpp's events.
class Builder : public YAML::EventHandler {
 public:
  Node root;

  void OnDocumentStart(const YAML::Mark& mark) override {
    if (documents_++ > 0) throw Refused{mark.line + 1, "a scene file holds one YAML document only"};
  }
  void OnDocumentEnd() override {}

  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    if (wants_key()) throw Refused{mark.line + 1, "a key is missing before ':'"};
    Node node;
    // An empty value's mark is where the next token stands.
    node.line = open_.empty() || open_.back().node.kind != Node::Kind::map
                    ? mark.line + 1
                    : open_.back().node.keys.back().line;
    add(std::move(node), anchor);
  }

  void OnAlias(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    if (wants_key()) throw Refused{mark.line + 1, "an alias cannot be a key"};
    const auto known = anchors_.find(anchor);
    if (known == anchors_.end())
      throw Refused{mark.line + 1, "an alias stands inside its own anchor"};
    spend(size_of(known->second), mark.line + 1);
    if (open_.size() + depth_of(known->second) > kMaxDepth) refuse_depth(mark.line + 1);
    add(known->second, 0);
  }

  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                const std::string& value) override {
    refuse_tag(mark, tag);
    if (value.size() > kMaxText) throw Refused{mark.line + 1, "a value is longer than 16 KiB"};
    if (wants_key()) {
      spend({1, value.size()}, mark.line + 1);
      open_.back().node.keys.push_back({value, mark.line + 1});
      return;
    }
    Node node;
    node.kind = Node::Kind::scalar;
    node.line = mark.line + 1;
    node.text = value;
    node.quoted = tag == "!";
    add(std::move(node), anchor);
  }

  void OnSequenceStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value) override {
    open(Node::Kind::list, mark, tag, anchor);
  }
  void OnSequenceEnd() override { close(); }
  void OnMapStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value) override {
    open(Node::Kind::map, mark, tag, anchor);
  }
  void OnMapEnd() override { close(); }

 private:
  struct Open {
    Node node;
    YAML::anchor_t anchor;
  };

  bool wants_key() const {
    if (open_.empty()) return false;
    const Node& node = open_.back().node;
    return node.kind == Node::Kind::map && node.keys.size() == node.items.size();
  }

  static void refuse_depth(int line) {
    throw Refused{line, "nested deeper than " + std::to_string(kMaxDepth) + " levels"};
  }

  static void refuse_tag(const YAML::Mark& mark, const std::string& tag) {
    if (tag.size() > 1) throw Refused{mark.line + 1, "YAML tags (!...) are not supported"};
  }

  void spend(Size size, int line) {
    spent_.nodes += size.nodes, spent_.text += size.text;
    if (spent_.nodes > kMaxNodes)
      throw Refused{line, "more than " + std::to_string(kMaxNodes) + " values, aliases included"};
    if (spent_.text > kMaxAllText)
      throw Refused{line, "more than 64 MiB of text, aliases included"};
  }

  void open(Node::Kind kind, const YAML::Mark& mark, const std::string& tag,
            YAML::anchor_t anchor) {
    refuse_tag(mark, tag);
    if (wants_key()) throw Refused{mark.line + 1, "a key must be a plain word"};
    if (open_.size() + 1 >= kMaxDepth) refuse_depth(mark.line + 1);
    Node node;
    node.kind = kind;
    node.line = mark.line + 1;
    open_.push_back({std::move(node), anchor});
  }

  void close() {
    Open done = std::move(open_.back());
    open_.pop_back();
    add(std::move(done.node), done.anchor);
  }

  void add(Node node, YAML::anchor_t anchor) {
    spend({1, node.text.size()}, node.line);
    if (anchor != 0) {
      spend(size_of(node), node.line);
      anchors_[anchor] = node;
    }
    if (open_.empty())
      root = std::move(node);
    else
      open_.back().node.items.push_back(std::move(node));
  }

  std::vector<Open> open_;
  std::map<YAML::anchor_t, Node> anchors_;
  Size spent_{0, 0};
  int documents_ = 0;
};

}  // namespace

Tree parse_yaml(const std::string& text) {
  Tree tree;
  const auto fail = [&](int line, const std::string& message) {
    tree.line = line;
    tree.problem = message;
  };
  // yaml-cpp holds a whole line of brackets in memory before its first event.
  const auto separators = std::count_if(text.begin(), text.end(),
                                        [](char c) { return c == '[' || c == '{' || c == ','; });
  if (static_cast<std::size_t>(separators) > kMaxNodes) {
    fail(0, "more than " + std::to_string(kMaxNodes) + " values");
    return tree;
  }
  try {
    std::istringstream in(text);
    YAML::Parser parser(in);
    Builder builder;
    if (!parser.HandleNextDocument(builder)) {
      fail(0, "the file holds nothing");
      return tree;
    }
    while (parser.HandleNextDocument(builder)) {
    }
    tree.root = std::move(builder.root);
  } catch (const Refused& e) {
    fail(e.line, e.message);
  } catch (const YAML::Exception& e) {
    fail(e.mark.line + 1, "not valid YAML: " + e.msg);
  } catch (const std::exception& e) {
    fail(0, std::string("cannot be read as YAML: ") + e.what());
  }
  return tree;
}

}  // namespace mr::yaml
