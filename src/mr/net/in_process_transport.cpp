#include <utility>

#include "mr/net/registry.h"
#include "mr/net/transport.h"

namespace mr::net {
namespace {

class InProcessTransport final : public Transport {
 public:
  void publish(const std::string& node, Message packet) override {
    if (!packet) return;
    for (const auto& callback : packets_.of(node)) (*callback)(packet);
  }

  std::unique_ptr<Subscription> subscribe(const std::string& node,
                                          std::function<void(Message)> on_packet) override {
    return packets_.add(node, std::move(on_packet));
  }

  void request(const std::string& node, Message message,
               std::function<void(Message)> on_answer) override {
    if (!message) return;
    Message answer = answer_from(answers_, node, *message);
    if (answer && on_answer) on_answer(std::move(answer));
  }

  std::unique_ptr<Subscription> serve(
      const std::string& node, std::function<Message(std::span<const std::byte>)> answer) override {
    return answers_.add(node, std::move(answer));
  }

  std::map<std::string, std::uint64_t> drops() const override { return {}; }

 private:
  PacketRegistry packets_;
  AnswerRegistry answers_;
};

}  // namespace

std::unique_ptr<Transport> make_in_process_transport() {
  return std::make_unique<InProcessTransport>();
}

}  // namespace mr::net
