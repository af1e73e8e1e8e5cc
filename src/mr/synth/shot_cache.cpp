#include "mr/synth/shot_cache.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <string>

#include "mr/core/file.h"
#include "mr/synth/hash.h"

namespace mr::synth {
namespace {

constexpr std::uint64_t kMagic = 0x3130474952524DULL;  // "MRRIG01"
constexpr std::uint32_t kShotMagic = 0x544F4853;       // "SHOT"
constexpr std::uint32_t kMostFrames = 1'000'000;

struct FileHead {
  std::uint64_t magic = kMagic, key = 0;
  std::int32_t depth_width = 0, depth_height = 0, color_width = 0, color_height = 0;
  std::uint64_t color_sum = 0;
};

struct ShotHead {
  std::uint32_t magic = kShotMagic, frame = 0, spans = 0, rgb_bytes = 0;
  std::uint64_t payload_sum = 0, head_sum = 0;
};

std::size_t padded(std::size_t bytes) { return (bytes + 7) & ~std::size_t{7}; }

/// Of whole 8-byte words and a rest.
std::uint64_t checksum(const void* data, std::size_t bytes) {
  const auto* at = static_cast<const unsigned char*>(data);
  std::uint64_t sum = 0x243F6A8885A308D3ull + bytes;
  const auto add = [&](std::uint64_t word) {
    sum = (sum ^ word) * 0x9FB21C651E98DF25ull;
    sum ^= sum >> 32;
  };
  for (; bytes >= 8; bytes -= 8, at += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, at, 8);
    add(word);
  }
  std::uint64_t rest = 0;
  std::memcpy(&rest, at, bytes);
  add(rest);
  return sum;
}

std::uint64_t head_sum(ShotHead head) {
  head.head_sum = 0;
  return checksum(&head, sizeof head);
}

std::size_t payload_bytes(const ShotHead& head, const ShotLayout& layout) {
  return padded(layout.depth_pixels() * 2) + head.spans * sizeof(Shot::Span) +
         padded(head.rgb_bytes);
}

template <typename T>
T read_at(const std::byte* data) {
  T value;
  std::memcpy(&value, data, sizeof value);
  return value;
}

void append(std::vector<std::byte>& out, const void* data, std::size_t bytes) {
  const auto* first = static_cast<const std::byte*>(data);
  out.insert(out.end(), first, first + bytes);
  out.resize(padded(out.size()));
}

std::vector<std::byte> encode(std::uint32_t frame, const Shot& shot) {
  ShotHead head;
  head.frame = frame;
  head.spans = static_cast<std::uint32_t>(shot.spans.size());
  head.rgb_bytes = static_cast<std::uint32_t>(shot.rgb.size());
  std::vector<std::byte> out(sizeof head);
  append(out, shot.depth_mm.data(), shot.depth_mm.size() * 2);
  append(out, shot.spans.data(), shot.spans.size() * sizeof(Shot::Span));
  append(out, shot.rgb.data(), shot.rgb.size());
  head.payload_sum = checksum(out.data() + sizeof head, out.size() - sizeof head);
  head.head_sum = head_sum(head);
  std::memcpy(out.data(), &head, sizeof head);
  return out;
}

bool write_at(int descriptor, std::size_t offset, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::pwrite(descriptor, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (n <= 0) return false;
    offset += static_cast<std::size_t>(n);
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
  return true;
}

/// Whether spans lie in the picture and count as many pixels as there are colours.
bool spans_fit(std::span<const Shot::Span> spans, std::size_t rgb_bytes, const ShotLayout& layout) {
  const std::uint64_t pixels = layout.color_bytes() / 3;
  std::uint64_t sum = 0;
  for (const Shot::Span& span : spans) {
    if (std::uint64_t{span.first} + span.count > pixels) return false;
    sum += span.count;
  }
  return sum * 3 == rgb_bytes;
}

}  // namespace

ShotCache::ShotCache(std::filesystem::path file, const ShotLayout& layout,
                     std::atomic<std::int64_t>& budget)
    : file_(std::move(file)), layout_(layout), budget_(budget) {
  open();
}

ShotCache::~ShotCache() { close(); }

bool ShotCache::open() {
  close();
  descriptor_ = ::open(file_.c_str(), O_RDWR | O_CLOEXEC);
  if (descriptor_ < 0) return false;
  map_all();
  if (!header_is_good()) {
    close();
    return false;
  }
  end_ = sizeof(FileHead) + padded(layout_.color_bytes());
  scan();
  return true;
}

void ShotCache::close() {
  if (data_ != nullptr) ::munmap(const_cast<std::byte*>(data_), mapped_);
  if (descriptor_ >= 0) ::close(descriptor_);
  data_ = nullptr, descriptor_ = -1, mapped_ = end_ = 0, locked_ = false;
  records_.clear();
}

bool ShotCache::header_is_good() const {
  if (data_ == nullptr || mapped_ < sizeof(FileHead) + padded(layout_.color_bytes())) return false;
  const auto head = read_at<FileHead>(data_);
  return head.magic == kMagic && head.key == layout_.key &&
         head.depth_width == layout_.depth_width && head.depth_height == layout_.depth_height &&
         head.color_width == layout_.color_width && head.color_height == layout_.color_height &&
         head.color_sum == checksum(data_ + sizeof head, layout_.color_bytes());
}

void ShotCache::map_all() {
  struct stat status {};
  if (::fstat(descriptor_, &status) != 0) return;
  const auto size = static_cast<std::size_t>(status.st_size);
  if (size == mapped_) return;
  if (data_ != nullptr) ::munmap(const_cast<std::byte*>(data_), mapped_);
  void* data = size > 0 ? ::mmap(nullptr, size, PROT_READ, MAP_SHARED, descriptor_, 0) : MAP_FAILED;
  data_ = data == MAP_FAILED ? nullptr : static_cast<const std::byte*>(data);
  mapped_ = data_ != nullptr ? size : 0;
}

/// Notes the records behind those known already.
void ShotCache::scan() {
  while (end_ + sizeof(ShotHead) <= mapped_) {
    const auto head = read_at<ShotHead>(data_ + end_);
    if (head.magic != kShotMagic || head.head_sum != head_sum(head) || head.frame >= kMostFrames)
      return;
    const std::size_t next = end_ + sizeof head + payload_bytes(head, layout_);
    if (next > mapped_) return;
    if (head.frame >= records_.size()) records_.resize(head.frame + 1);
    records_[head.frame] = Record{end_, false};
    end_ = next;
  }
}

std::optional<ImageRgb> ShotCache::empty_room() const {
  if (descriptor_ < 0) return std::nullopt;
  ImageRgb image(layout_.color_width, layout_.color_height);
  std::memcpy(image.data.data(), data_ + sizeof(FileHead), image.data.size());
  return image;
}

std::optional<ShotRef> ShotCache::find(std::uint32_t frame) {
  if (descriptor_ < 0) return std::nullopt;
  map_all();  // it may have grown
  scan();
  if (frame >= records_.size() || !records_[frame]) return std::nullopt;
  Record& record = *records_[frame];
  if (record.offset + sizeof(ShotHead) > mapped_) return std::nullopt;
  const std::byte* at = data_ + record.offset;
  const auto head = read_at<ShotHead>(at);
  at += sizeof head;
  const std::size_t bytes = payload_bytes(head, layout_);
  if (record.offset + sizeof head + bytes > mapped_) return std::nullopt;
  const std::byte* spans = at + padded(layout_.depth_pixels() * 2);
  const ShotRef shot{
      {reinterpret_cast<const std::uint16_t*>(at), layout_.depth_pixels()},
      {reinterpret_cast<const Shot::Span*>(spans), head.spans},
      {reinterpret_cast<const std::uint8_t*>(spans + head.spans * sizeof(Shot::Span)),
       head.rgb_bytes}};
  if (!record.checked && (head.payload_sum != checksum(at, bytes) ||
                          !spans_fit(shot.spans, shot.rgb.size(), layout_))) {
    records_[frame].reset();
    return std::nullopt;
  }
  record.checked = true;
  return shot;
}

int ShotCache::count(int begin, int end) const {
  int known = 0;
  for (int i = begin; i < std::min(end, static_cast<int>(records_.size())); ++i)
    known += records_[i].has_value();
  return known;
}

void ShotCache::begin(const ImageRgb& empty_room) {
  if (descriptor_ >= 0 || open()) return;
  FileHead head;
  head.key = layout_.key;
  head.depth_width = layout_.depth_width, head.depth_height = layout_.depth_height;
  head.color_width = layout_.color_width, head.color_height = layout_.color_height;
  head.color_sum = checksum(empty_room.data.data(), empty_room.data.size());
  std::vector<std::byte> bytes(sizeof head);
  std::memcpy(bytes.data(), &head, sizeof head);
  append(bytes, empty_room.data.data(), empty_room.data.size());
  if (budget_.fetch_sub(static_cast<std::int64_t>(bytes.size())) <
      static_cast<std::int64_t>(bytes.size()))
    return;
  if (write_file(file_, bytes)) open();
}

/// Becomes the one who appends; cuts off what a crash left half written.
bool ShotCache::lock() {
  if (locked_) return true;
  if (descriptor_ < 0 || ::flock(descriptor_, LOCK_EX | LOCK_NB) != 0) return false;
  map_all();
  scan();
  if (mapped_ > end_ && ::ftruncate(descriptor_, static_cast<off_t>(end_)) != 0) return false;
  map_all();
  return locked_ = true;
}

void ShotCache::add(std::uint32_t frame, const Shot& shot) {
  if (!lock()) return;
  const std::vector<std::byte> bytes = encode(frame, shot);
  if (budget_.fetch_sub(static_cast<std::int64_t>(bytes.size())) <
      static_cast<std::int64_t>(bytes.size()))
    return;
  if (!write_at(descriptor_, end_, bytes)) {
    budget_ = 0;  // the disk is full: no more of this
    // On failure the next process that locks the file truncates it.
    [[maybe_unused]] const int cut = ::ftruncate(descriptor_, static_cast<off_t>(end_));
    return;
  }
  if (frame >= records_.size()) records_.resize(frame + 1);
  records_[frame] = Record{end_, true};
  end_ += bytes.size();
}

std::uintmax_t folder_bytes(const std::filesystem::path& folder) {
  std::uintmax_t sum = 0;
  std::error_code failed;
  for (const auto& entry : std::filesystem::directory_iterator(folder, failed)) {
    const std::uintmax_t bytes = entry.file_size(failed);
    if (!failed) sum += bytes;
  }
  return sum;
}

void trim_caches(const std::filesystem::path& folder, const std::filesystem::path& keep,
                 std::uintmax_t bytes) {
  struct Rig {
    std::filesystem::file_time_type used;
    std::filesystem::path folder;
    std::uintmax_t bytes;
  };
  std::vector<Rig> rigs;
  std::error_code failed;
  std::filesystem::last_write_time(keep, std::filesystem::file_time_type::clock::now(), failed);
  for (const auto& entry : std::filesystem::directory_iterator(folder, failed))
    if (entry.is_directory(failed) && entry.path() != keep)
      rigs.push_back({entry.last_write_time(failed), entry.path(), folder_bytes(entry.path())});
  std::sort(rigs.begin(), rigs.end(), [](const Rig& a, const Rig& b) { return a.used > b.used; });
  std::uintmax_t sum = 0;
  for (const Rig& rig : rigs) {
    sum += rig.bytes;
    if (sum > bytes) std::filesystem::remove_all(rig.folder, failed);
  }
}

}  // namespace mr::synth
