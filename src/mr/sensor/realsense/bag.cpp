#include "mr/sensor/realsense/bag.h"

#include <lz4frame.h>

#include <algorithm>
#include <fstream>
#include <utility>
#include <vector>

#include "mr/core/user_text.h"
#include "mr/sensor/realsense/ros_bytes.h"

namespace mr::sensor {
namespace {

constexpr std::string_view kBagMagic = "#ROSBAG V2.0\n";
// What recorders write: headers of at most 4 KiB, chunks of about 1 MiB or of one large picture.
constexpr std::uint32_t kMostBagHeaderBytes = 1 << 16, kMostIndexBytes = 1 << 20;
constexpr std::uint32_t kMostChunkBytes = 64 << 20;
constexpr std::size_t kMostConnections = 4096, kMostTopicBytes = 1024, kMostChunks = 1 << 22;

enum BagOp : std::uint8_t {
  kMessageRecord = 2,
  kBagHeaderRecord = 3,
  kChunkRecord = 5,
  kChunkInfoRecord = 6,
  kConnectionRecord = 7
};

/// The fields `name=value` of a record's header.
class BagFields {
 public:
  explicit BagFields(std::span<const std::byte> header) : header_(header) {}

  std::optional<std::span<const std::byte>> find(std::string_view name) const {
    RosBytes left(header_);
    while (!left.rest().empty()) {
      const auto field = left.counted();
      if (!left.good()) break;
      const std::string_view text = RosBytes::text_of(field);
      if (text.size() > name.size() && text.starts_with(name) && text[name.size()] == '=')
        return field.subspan(name.size() + 1);
    }
    return std::nullopt;
  }
  /// Nothing where the field is missing or of another size.
  template <typename T>
  std::optional<T> number(std::string_view name) const {
    const auto value = find(name);
    if (!value || value->size() != sizeof(T)) return std::nullopt;
    return RosBytes(*value).get<T>();
  }
  std::string_view text(std::string_view name) const {
    const auto value = find(name);
    return value ? RosBytes::text_of(*value) : std::string_view();
  }
  std::uint8_t op() const { return number<std::uint8_t>("op").value_or(0); }

 private:
  std::span<const std::byte> header_;
};

/// A ROS time: seconds, then nanoseconds.
Duration bag_time(std::uint64_t time) {
  return std::chrono::seconds(time & 0xffffffff) + Duration(time >> 32);
}

struct FreeLz4 {
  void operator()(LZ4F_dctx* context) const { LZ4F_freeDecompressionContext(context); }
};

/// Decompresses an LZ4 frame into `out`, which grows with what really comes out, up to `size`
/// bytes. False: it is damaged, truncated or of another size; `out` has what came before.
bool decompress_lz4(std::span<const std::byte> from, std::size_t size,
                    std::vector<std::byte>& out) {
  constexpr std::size_t kStep = 1 << 20;
  LZ4F_dctx* made = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&made, LZ4F_VERSION))) return false;
  const std::unique_ptr<LZ4F_dctx, FreeLz4> context(made);
  out.clear();
  while (true) {
    const std::size_t done = out.size();
    out.resize(std::min(size, done + kStep));
    std::size_t written = out.size() - done, taken = from.size();
    const std::size_t left =
        LZ4F_decompress(context.get(), out.data() + done, &written, from.data(), &taken, nullptr);
    out.resize(LZ4F_isError(left) ? done : done + written);
    if (LZ4F_isError(left)) return false;
    if (left == 0) return out.size() == size;
    if (written == 0 && taken == 0) return false;
    from = from.subspan(taken);
  }
}

struct ChunkPlace {
  std::uint64_t at = 0;  ///< byte in the file
  Duration begins{};     ///< when its first message was recorded
};

}  // namespace

struct BagReader::Impl {
  /// A record of the file; its data is still to be read.
  struct Record {
    BagFields fields;
    std::uint32_t data_bytes = 0;
  };

  std::filesystem::path file;
  std::ifstream in;
  std::uint64_t size = 0, at = 0;  ///< bytes of the file; that were read
  std::uint64_t first_record = 0, index = 0;
  bool has_index = false, is_cut_off = false, ended = false;
  std::map<std::uint32_t, std::string> topics;
  std::vector<ChunkPlace> chunks;
  std::map<std::uint32_t, std::uint64_t> last_chunk;  ///< by connection
  std::vector<std::byte> header, chunk, packed;
  std::span<const std::byte> rest;  ///< of the chunk
  std::optional<Error> after;       ///< what is wrong with the file after `rest`

  Error failure(Error::Cause cause, const std::string& what) const {
    return {cause, file.string() + ": " + what};
  }
  Error damaged(const std::string& what) const {
    return failure(Error::Cause::corrupt, "damaged before byte " + std::to_string(at) + " (" +
                                              what + "); what follows is lost");
  }
  /// The end of a file that should go on.
  Error cut_off() {
    is_cut_off = true;
    return failure(Error::Cause::corrupt,
                   "cut off after " + std::to_string(size) + " bytes: its end is missing");
  }

  bool read(std::size_t count, std::vector<std::byte>& out) {
    if (count > size - at) return false;
    out.resize(count);
    if (!in.read(reinterpret_cast<char*>(out.data()), static_cast<std::streamsize>(count)))
      return false;
    at += count;
    return true;
  }

  bool go_to(std::uint64_t place) {
    in.clear();
    at = place, rest = {}, after.reset(), is_cut_off = ended = false;
    return place <= size && in.seekg(static_cast<std::streamoff>(place)).good();
  }
  bool skip(std::uint32_t count) {
    if (count > size - at) return false;
    at += count;
    return in.seekg(static_cast<std::streamoff>(at)).good();
  }

  /// The next record's header. Nothing: the file ends in it. Error: it is none.
  Result<std::optional<Record>> read_record() {
    if (!read(4, header)) return std::optional<Record>();
    const auto count = RosBytes(header).get<std::uint32_t>();
    if (count > kMostBagHeaderBytes) return damaged("no record");
    if (!read(count, header) || !read(4, packed)) return std::optional<Record>();
    return std::optional(Record{BagFields(header), RosBytes(packed).get<std::uint32_t>()});
  }

  void add_connection(const BagFields& fields) {
    const auto number = fields.number<std::uint32_t>("conn");
    const std::string_view topic = fields.text("topic");
    if (number && topic.size() <= kMostTopicBytes && topics.size() < kMostConnections)
      topics.try_emplace(*number, topic);
  }

  Result<std::optional<BagMessage>> next();
  Status read_on(std::optional<BagMessage>& out);
  Status read_chunk(const BagFields& fields, std::uint32_t data_bytes);
  void open_chunk(const std::string& compression, std::uint32_t unpacked_bytes, bool is_whole);
  std::optional<BagMessage> message(const BagFields& fields, std::span<const std::byte> data) const;
  std::optional<BagMessage> take_from_chunk();
  Status open();
  bool read_index();
  bool add_chunk(const BagFields& fields, std::uint32_t data_bytes);
};

std::optional<BagMessage> BagReader::Impl::message(const BagFields& fields,
                                                   std::span<const std::byte> data) const {
  const auto known = topics.find(fields.number<std::uint32_t>("conn").value_or(0xffffffff));
  const auto time = fields.number<std::uint64_t>("time");
  if (known == topics.end() || !time) return std::nullopt;
  return BagMessage{known->second, bag_time(*time), data};
}

/// The next message of the chunk; nothing: there is none, or the chunk is damaged.
std::optional<BagMessage> BagReader::Impl::take_from_chunk() {
  while (!rest.empty()) {
    RosBytes record(rest);
    const BagFields fields(record.counted());
    const auto data = record.counted();
    rest = record.rest();
    if (!record.good()) {
      rest = {};
      if (!after) after = damaged("a chunk");
      return std::nullopt;
    }
    if (fields.op() == kConnectionRecord) add_connection(fields);
    if (fields.op() != kMessageRecord) continue;
    if (auto found = message(fields, data)) return found;
  }
  return std::nullopt;
}

/// Makes the bytes of a chunk, which lie in `packed`, those that are read.
void BagReader::Impl::open_chunk(const std::string& compression, std::uint32_t unpacked_bytes,
                                 bool is_whole) {
  if (!is_whole) after = cut_off();
  if (compression == "none") {
    std::swap(chunk, packed);
  } else if (!decompress_lz4(packed, unpacked_bytes, chunk) && is_whole) {
    after = damaged("an LZ4 chunk");
  }
  rest = chunk;
}

Status BagReader::Impl::read_chunk(const BagFields& fields, std::uint32_t data_bytes) {
  const std::string compression(fields.text("compression"));
  const auto unpacked_bytes = fields.number<std::uint32_t>("size");
  if (compression == "bz2")
    return failure(Error::Cause::unsupported,
                   "its chunks are compressed by bz2, which is not read: write it anew with "
                   "`rosbag decompress`");
  if (compression != "none" && compression != "lz4")
    return failure(Error::Cause::unsupported, "its chunks are compressed by " +
                                                  in_quotes(compression) +
                                                  "; those without compression and LZ4 are read");
  if (!unpacked_bytes) return damaged("a chunk without its size");
  if (std::max(*unpacked_bytes, data_bytes) > kMostChunkBytes)
    return failure(Error::Cause::too_large,
                   "a chunk of more than 64 MiB at byte " + std::to_string(at));
  // A recorder that is killed leaves 0 in place of the size of its last chunk: uncompressed
  // messages follow as records of their own, compressed ones are lost.
  if (index == 0 && data_bytes == 0 && compression != "none") {
    ended = true;
    return {};
  }
  const auto there = static_cast<std::uint32_t>(std::min<std::uint64_t>(data_bytes, size - at));
  if (!read(there, packed)) return failure(Error::Cause::io, "cannot be read");
  open_chunk(compression, *unpacked_bytes, there == data_bytes);
  return {};
}

/// Reads the file's next record: `out` is its message if it is one, a chunk becomes the one that is
/// read. At the end of the file `ended` is set.
Status BagReader::Impl::read_on(std::optional<BagMessage>& out) {
  if (at == size) {
    ended = true;
    return index == 0 || size > index ? Status() : cut_off();
  }
  const auto record = read_record();
  if (!record) return record.error();
  if (!*record) return cut_off();
  const auto& [fields, data_bytes] = **record;
  switch (fields.op()) {
    case kChunkRecord:
      return read_chunk(fields, data_bytes);
    case kMessageRecord:
      if (data_bytes > kMostChunkBytes) return damaged("a message of more than 64 MiB");
      if (!read(data_bytes, packed)) return cut_off();
      out = message(fields, packed);
      return {};
    case kConnectionRecord:
      add_connection(fields);
      break;
    case 0:
      return damaged("a record without its kind");
    default:
      break;
  }
  return skip(data_bytes) ? Status() : cut_off();
}

Result<std::optional<BagMessage>> BagReader::Impl::next() {
  while (true) {
    if (auto out = take_from_chunk()) return out;
    std::optional<BagMessage> out;
    if (!after && !ended)
      if (const Status read = read_on(out); !read) after = read.error();
    if (out) return out;
    if (!rest.empty()) continue;
    if (after) ended = true;
    // What breaks off is the end of a file that was never closed.
    if (after && !(is_cut_off && index == 0)) return *std::exchange(after, std::nullopt);
    if (ended) return std::optional<BagMessage>();
  }
}

/// The index is a hint: where it is damaged the file is read without.
bool BagReader::Impl::read_index() {
  if (index < first_record || index >= size || !go_to(index)) return false;
  while (at < size) {
    const auto record = read_record();
    if (!record || !*record) return false;
    const auto& [fields, data_bytes] = **record;
    if (fields.op() == kConnectionRecord) {
      add_connection(fields);
      if (!skip(data_bytes)) return false;
    } else if (fields.op() != kChunkInfoRecord || !add_chunk(fields, data_bytes)) {
      return false;
    }
  }
  std::ranges::stable_sort(chunks, {}, &ChunkPlace::at);
  return !chunks.empty();
}

bool BagReader::Impl::add_chunk(const BagFields& fields, std::uint32_t data_bytes) {
  const auto place = fields.number<std::uint64_t>("chunk_pos");
  const auto begins = fields.number<std::uint64_t>("start_time");
  if (!place || !begins || *place < first_record || *place >= index) return false;
  const ChunkPlace found{*place, bag_time(*begins)};
  if (data_bytes > kMostIndexBytes || chunks.size() >= kMostChunks || !read(data_bytes, packed))
    return false;
  chunks.push_back(found);
  RosBytes counts(packed);
  while (!counts.rest().empty()) {
    const auto connection = counts.get<std::uint32_t>();
    const auto messages = counts.get<std::uint32_t>();
    if (!counts.good()) return false;
    if (messages > 0 && (topics.contains(connection) || last_chunk.size() < kMostConnections))
      last_chunk[connection] = std::max(last_chunk[connection], found.at);
  }
  return true;
}

Status BagReader::Impl::open() {
  std::error_code failed;
  if (!std::filesystem::exists(file, failed))
    return failure(Error::Cause::not_found, "there is no such file");
  in.open(file, std::ios::binary);
  if (!in || !in.seekg(0, std::ios::end)) return failure(Error::Cause::io, "cannot be read");
  size = static_cast<std::uint64_t>(std::max<std::streamoff>(in.tellg(), 0));
  const auto refuse = [&](const char* what) { return failure(Error::Cause::corrupt, what); };
  if (!go_to(0) || !read(std::min<std::uint64_t>(kBagMagic.size(), size), packed))
    return failure(Error::Cause::io, "cannot be read");
  const std::string_view magic = RosBytes::text_of(packed);
  if (magic != kBagMagic)
    return refuse(magic.starts_with("#ROSBAG") ? "a ROS bag of another version than 2.0"
                                               : "no ROS bag: it does not begin with #ROSBAG");
  const auto record = read_record();
  if (!record) return record.error();
  const auto place = *record ? (*record)->fields.number<std::uint64_t>("index_pos") : std::nullopt;
  if (!place || (*record)->fields.op() != kBagHeaderRecord || !skip((*record)->data_bytes))
    return refuse("a ROS bag whose header is damaged or truncated");
  index = *place, first_record = at;
  has_index = index != 0 && read_index();
  if (!has_index) chunks.clear(), last_chunk.clear(), topics.clear();
  return go_to(first_record) ? Status() : failure(Error::Cause::io, "cannot be read");
}

BagReader::BagReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
BagReader::BagReader(BagReader&&) noexcept = default;
BagReader& BagReader::operator=(BagReader&&) noexcept = default;
BagReader::~BagReader() = default;

Result<BagReader> BagReader::open(const std::filesystem::path& file) {
  auto impl = std::make_unique<Impl>();
  impl->file = file;
  if (const Status opened = impl->open(); !opened) return opened.error();
  return BagReader(std::move(impl));
}

Result<std::optional<BagMessage>> BagReader::next() { return impl_->next(); }
bool BagReader::is_closed() const { return impl_->index != 0; }
bool BagReader::has_index() const { return impl_->has_index; }
const std::map<std::uint32_t, std::string>& BagReader::topics() const { return impl_->topics; }

Status BagReader::rewind() {
  if (impl_->go_to(impl_->first_record)) return {};
  return impl_->failure(Error::Cause::io, "cannot be read");
}

Status BagReader::seek(Duration recorded) {
  std::uint64_t place = impl_->first_record;
  for (const ChunkPlace& chunk : impl_->chunks)
    if (chunk.begins <= recorded) place = chunk.at;
  if (impl_->go_to(place)) return {};
  return rewind();
}

bool BagReader::seek_last(std::string_view topic) {
  for (const auto& [connection, name] : impl_->topics) {
    const auto found = impl_->last_chunk.find(connection);
    if (name == topic && found != impl_->last_chunk.end()) return impl_->go_to(found->second);
  }
  return false;
}

}  // namespace mr::sensor
