#include "mr/codec/stream_receiver.h"

#include <utility>

#include "mr/codec/packet_codec.h"

namespace mr::codec {

Result<Packet> StreamReceiver::read(std::span<const std::byte> bytes, TimePoint now) {
  auto packet = heads_.read(bytes, now);
  if (packet && heads_.began_afresh()) {
    receiver_ = Receiver(lattice_);
    pacing_.begin_afresh();
  }
  return packet;
}

Result<std::vector<EncodedChunk>> read_answer(std::span<const std::byte> answer) {
  if (const auto refusal = decode_refusal(answer))
    return *refusal ? Error{Error::Cause::unsupported, "it refused: " + **refusal}
                    : refusal->error();
  return decode_chunks(answer);
}

std::vector<Error> StreamReceiver::take_answer(std::span<const std::byte> answer) {
  const auto chunks = read_answer(answer);
  if (!chunks) return {chunks.error()};
  std::vector<Error> wrong;
  for (const EncodedChunk& chunk : *chunks)
    if (const Status taken = receiver_.provide(chunk); !taken) wrong.push_back(taken.error());
  return wrong;
}

Control StreamReceiver::wanted(TimePoint now) {
  std::set<StreamId> streams = key_frames_wanted_;
  for (const StreamId stream : receiver_.streams_waiting()) streams.insert(stream);
  Control request = pacing_.due({.key_frames = {streams.begin(), streams.end()},
                                 .chunks = receiver_.missing(),
                                 .taken = {},
                                 .whole_head = heads_.lacks_base()},
                                now);
  for (const StreamId stream : request.key_frames) key_frames_wanted_.erase(stream);
  return request;
}

}  // namespace mr::codec
