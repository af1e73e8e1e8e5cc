#pragma once

#include <chrono>
#include <functional>
#include <nlohmann/json.hpp>

#include "mr/core/result.h"

/// Work in processes of its own. The program itself starts no thread, so that it can fork at any
/// time: whatever computes, loads a scene or might abort runs in a child.
namespace mr::bench {

/// What processes tell each other (as CBOR), and what is printed. Large arrays are binary values.
using Message = nlohmann::ordered_json;

/// Answers one question; an exception becomes the error of that question.
using Answerer = std::function<Message(const Message& question)>;

class Child {
 public:
  /// Forks; `make` runs in the child, which sees everything that is in memory now. Its standard
  /// output goes to standard error (`quiet`: both go nowhere), and it leaves no core dump.
  static Result<Child> start(const std::function<Answerer()>& make, bool quiet = false);
  Child(Child&& other) noexcept;
  Child& operator=(Child&&) = delete;
  ~Child();  ///< kills it

  /// io: the child is dead (the message names the signal), or was killed because it took longer
  /// than `patience`; invalid: what it threw.
  Result<Message> ask(const Message& question, std::chrono::seconds patience);

 private:
  Child(int process, int socket) : process_(process), socket_(socket) {}
  Error how_it_ended();

  int process_ = -1, socket_ = -1;
};

/// Runs `work` in a child and hands back what it returns.
Result<Message> apart(const std::function<Message()>& work,
                      std::chrono::seconds patience = std::chrono::seconds(600));

}  // namespace mr::bench
