#pragma once

#include <chrono>
#include <functional>
#include <nlohmann/json.hpp>

#include "mr/core/result.h"

/// Work in processes of its own. The program itself starts no thread, so that it can fork at any
/// time: whatever computes, loads a scene or might abort runs in a child.
namespace mr::bench {

/// Messages between processes (as CBOR) and printed results. Large arrays are binary values.
using Message = nlohmann::ordered_json;

/// Handles one request; an exception becomes the error of that request.
using Answerer = std::function<Message(const Message& question)>;

class Child {
 public:
  /// Forks; `make` runs in the child, with a copy of the parent's memory. Its standard
  /// output goes to standard error (`quiet`: both are discarded), and it writes no core dump.
  static Result<Child> start(const std::function<Answerer()>& make, bool quiet = false);
  Child(Child&& other) noexcept;
  Child& operator=(Child&&) = delete;
  ~Child();  ///< kills the process

  /// Sends a request and waits for the answer. Errors: io: the child is dead (the message names the
  /// signal), or was killed because it took longer than `patience`; invalid: it threw an exception.
  Result<Message> ask(const Message& question, std::chrono::seconds patience);

 private:
  Child(int process, int socket) : process_(process), socket_(socket) {}
  Error how_it_ended();

  int process_ = -1, socket_ = -1;
};

/// Runs `work` in a child process and returns its result.
Result<Message> apart(const std::function<Message()>& work,
                      std::chrono::seconds patience = std::chrono::seconds(600));

}  // namespace mr::bench
