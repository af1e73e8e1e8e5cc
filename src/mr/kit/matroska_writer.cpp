#include "mr/kit/matroska_writer.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstring>
#include <string_view>
#include <utility>

namespace mr::kit {
namespace {

using EbmlBytes = std::vector<std::byte>;

/// Element IDs, their length marker included.
namespace matroska_id {
constexpr std::uint32_t kEbml = 0x1A45DFA3, kEbmlVersion = 0x4286, kEbmlReadVersion = 0x42F7,
                        kEbmlMaxIdLength = 0x42F2, kEbmlMaxSizeLength = 0x42F3, kDocType = 0x4282,
                        kDocTypeVersion = 0x4287, kDocTypeReadVersion = 0x4285, kVoid = 0xEC,
                        kCrc32 = 0xBF;
constexpr std::uint32_t kSegment = 0x18538067, kSeekHead = 0x114D9B74, kSeek = 0x4DBB,
                        kSeekId = 0x53AB, kSeekPosition = 0x53AC;
constexpr std::uint32_t kInfo = 0x1549A966, kTimestampScale = 0x2AD7B1, kMuxingApp = 0x4D80,
                        kWritingApp = 0x5741, kDateUtc = 0x4461, kTitle = 0x7BA9,
                        kDuration = 0x4489;
constexpr std::uint32_t kTracks = 0x1654AE6B, kTrackEntry = 0xAE, kTrackNumber = 0xD7,
                        kTrackUid = 0x73C5, kTrackType = 0x83, kCodecId = 0x86, kTrackName = 0x536E,
                        kCodecPrivate = 0x63A2, kDefaultDuration = 0x23E383, kVideo = 0xE0,
                        kPixelWidth = 0xB0, kPixelHeight = 0xBA;
constexpr std::uint32_t kAttachments = 0x1941A469, kAttachedFile = 0x61A7, kFileName = 0x466E,
                        kFileMimeType = 0x4660, kFileData = 0x465C, kFileUid = 0x46AE;
constexpr std::uint32_t kTags = 0x1254C367, kTag = 0x7373, kTargets = 0x63C0, kTargetType = 0x63CA,
                        kTagTrackUid = 0x63C5, kTagAttachmentUid = 0x63C6, kSimpleTag = 0x67C8,
                        kTagName = 0x45A3, kTagString = 0x4487;
constexpr std::uint32_t kCluster = 0x1F43B675, kTimestamp = 0xE7, kSimpleBlock = 0xA3,
                        kBlockGroup = 0xA0, kBlock = 0xA1, kBlockDuration = 0x9B;
constexpr std::uint32_t kCues = 0x1C53BB6B, kCuePoint = 0xBB, kCueTime = 0xB3,
                        kCueTrackPositions = 0xB7, kCueTrack = 0xF7, kCueClusterPosition = 0xF1;
}  // namespace matroska_id
using namespace matroska_id;

// What k4arecord keeps free for the list of positions, for Info, and for later tags; with a
// header of three bytes each.
constexpr std::uint64_t kSeekRoom = 1024, kInfoRoom = 256, kTagRoom = 1024, kVoidHeader = 3;
constexpr std::uint64_t kUnknownSize = 0x01FF'FFFF'FFFF'FFFF;  // in eight bytes
constexpr std::uint8_t kKeyFrame = 0x80;

// --- EBML

void put_big_endian(EbmlBytes& out, std::uint64_t value, int bytes) {
  for (int shift = 8 * (bytes - 1); shift >= 0; shift -= 8)
    out.push_back(static_cast<std::byte>(value >> shift));
}

void put_bytes(EbmlBytes& out, std::span<const std::byte> bytes) {
  out.insert(out.end(), bytes.begin(), bytes.end());
}

int byte_count(std::uint64_t value) {
  return std::max(1, static_cast<int>(std::bit_width(value) + 7) / 8);
}

/// A number with its length marker, in the fewest bytes or in `length`. All ones mean "unknown".
void put_varint(EbmlBytes& out, std::uint64_t value, int length = 0) {
  if (length == 0)
    for (length = 1; value >= (std::uint64_t{1} << 7 * length) - 1;) ++length;
  put_big_endian(out, value | std::uint64_t{1} << 7 * length, length);
}

void put_element(EbmlBytes& out, std::uint32_t id, std::span<const std::byte> content) {
  put_big_endian(out, id, byte_count(id));
  put_varint(out, content.size());
  put_bytes(out, content);
}

void put_number(EbmlBytes& out, std::uint32_t id, std::uint64_t value) {
  EbmlBytes content;
  put_big_endian(content, value, byte_count(value));
  put_element(out, id, content);
}

void put_text(EbmlBytes& out, std::uint32_t id, std::string_view text) {
  put_element(out, id, std::as_bytes(std::span(text)));
}

/// An element without content, `bytes` long with its header of up to nine bytes.
EbmlBytes void_header(std::uint64_t bytes) {
  MR_ASSERT(bytes >= 2);
  EbmlBytes out;
  put_big_endian(out, kVoid, 1);
  put_varint(out, bytes >= 9 ? bytes - 9 : bytes - 2, bytes >= 9 ? 8 : 1);
  return out;
}

EbmlBytes void_element(std::uint64_t bytes) {
  EbmlBytes out = void_header(bytes);
  out.resize(bytes);
  return out;
}

std::uint32_t ebml_crc32(std::span<const std::byte> bytes) {
  static constexpr auto kTable = [] {
    std::array<std::uint32_t, 256> table{};
    for (std::uint32_t i = 0; i < table.size(); ++i) {
      std::uint32_t c = i;
      for (int k = 0; k < 8; ++k) c = (c & 1) != 0 ? 0xEDB88320u ^ c >> 1 : c >> 1;
      table[i] = c;
    }
    return table;
  }();
  std::uint32_t c = 0xFFFFFFFFu;
  for (const std::byte b : bytes)
    c = kTable[(c ^ std::to_integer<std::uint32_t>(b)) & 0xFF] ^ c >> 8;
  return ~c;
}

/// The checksum of what follows it in its parent; little-endian, unlike everything else.
EbmlBytes checksum_of(std::span<const std::byte> content) {
  EbmlBytes out, sum;
  put_big_endian(sum, __builtin_bswap32(ebml_crc32(content)), 4);
  put_element(out, kCrc32, sum);
  return out;
}

// --- Matroska

EbmlBytes ebml_header() {
  EbmlBytes content, out;
  put_number(content, kEbmlVersion, 1);
  put_number(content, kEbmlReadVersion, 1);
  put_number(content, kEbmlMaxIdLength, 4);
  put_number(content, kEbmlMaxSizeLength, 8);
  put_text(content, kDocType, "matroska");
  put_number(content, kDocTypeVersion, 2);
  put_number(content, kDocTypeReadVersion, 2);
  put_element(out, kEbml, content);
  return out;
}

EbmlBytes track_entries(std::span<const MatroskaTrack> tracks) {
  EbmlBytes out;
  for (const MatroskaTrack& track : tracks) {
    EbmlBytes entry, video;
    put_number(entry, kTrackNumber, track.number);
    put_number(entry, kTrackUid, track.uid);
    put_number(entry, kTrackType, static_cast<std::uint64_t>(track.kind));
    put_text(entry, kCodecId, track.codec_id);
    put_text(entry, kTrackName, track.name);
    if (!track.codec_private.empty()) put_element(entry, kCodecPrivate, track.codec_private);
    if (track.default_duration.count() > 0)
      put_number(entry, kDefaultDuration, track.default_duration.count());
    if (track.kind == MatroskaTrack::Kind::video) {
      put_number(video, kPixelWidth, track.width);
      put_number(video, kPixelHeight, track.height);
      put_element(entry, kVideo, video);
    }
    put_element(out, kTrackEntry, entry);
  }
  return out;
}

EbmlBytes attached_files(std::span<const MatroskaAttachment> attachments) {
  EbmlBytes out;
  for (const MatroskaAttachment& attachment : attachments) {
    EbmlBytes file;
    put_text(file, kFileName, attachment.file_name);
    put_text(file, kFileMimeType, attachment.mime_type);
    put_element(file, kFileData, attachment.data);
    put_number(file, kFileUid, attachment.uid);
    put_element(out, kAttachedFile, file);
  }
  return out;
}

EbmlBytes tag_entries(std::span<const MatroskaTag> tags) {
  EbmlBytes out;
  for (const MatroskaTag& tag : tags) {
    EbmlBytes targets, simple, entry;
    if (tag.track_uid != 0 || tag.attachment_uid != 0)
      put_text(targets, kTargetType, tag.track_uid != 0 ? "TRACK" : "ATTACHMENT");
    if (tag.track_uid != 0) put_number(targets, kTagTrackUid, tag.track_uid);
    if (tag.attachment_uid != 0) put_number(targets, kTagAttachmentUid, tag.attachment_uid);
    put_text(simple, kTagName, tag.name);
    put_text(simple, kTagString, tag.value);
    put_element(entry, kTargets, targets);
    put_element(entry, kSimpleTag, simple);
    put_element(out, kTag, entry);
  }
  return out;
}

EbmlBytes info_of(const MatroskaSettings& settings, std::int64_t last_ticks) {
  constexpr std::chrono::sys_days kEpoch{std::chrono::year{2001} / 1 / 1};
  EbmlBytes content, out, date, duration;
  put_number(content, kTimestampScale, settings.tick.count());
  put_text(content, kMuxingApp, "meshreduce");
  put_text(content, kWritingApp, settings.writing_app);
  put_big_endian(date, std::chrono::nanoseconds(settings.date - kEpoch).count(), 8);
  put_element(content, kDateUtc, date);
  put_text(content, kTitle, settings.title);
  put_big_endian(duration, std::bit_cast<std::uint64_t>(static_cast<double>(last_ticks)), 8);
  put_element(content, kDuration, duration);
  put_element(out, kInfo, content);
  return out;
}

/// What stands before the frames of a laced block: their number and the sizes of all but the last.
EbmlBytes lace_head(std::span<const MatroskaWriter::Frame> frames, MatroskaLacing lacing) {
  EbmlBytes out;
  if (lacing == MatroskaLacing::none) return out;
  out.push_back(static_cast<std::byte>(frames.size() - 1));
  if (lacing == MatroskaLacing::fixed) return out;
  for (std::size_t i = 0; i + 1 < frames.size(); ++i) {
    const std::size_t size = frames[i].size();
    if (lacing == MatroskaLacing::xiph) {
      out.insert(out.end(), size / 255, std::byte{255});
      out.push_back(static_cast<std::byte>(size % 255));
    } else if (i == 0) {
      put_varint(out, size);
    } else {  // the difference to the frame before, moved so that it is positive
      constexpr int kLength = 4;
      constexpr std::int64_t kMiddle = (std::int64_t{1} << (7 * kLength - 1)) - 1;
      const auto difference =
          static_cast<std::int64_t>(size) - static_cast<std::int64_t>(frames[i - 1].size());
      put_varint(out, static_cast<std::uint64_t>(kMiddle + difference), kLength);
    }
  }
  return out;
}

Error invalid_call(const std::filesystem::path& file, const std::string& why) {
  return {Error::Cause::invalid, file.string() + ": " + why};
}

}  // namespace

MatroskaWriter::MatroskaWriter(std::filesystem::path file, MatroskaSettings settings,
                               std::vector<MatroskaTrack> tracks,
                               std::vector<MatroskaAttachment> attachments,
                               std::vector<MatroskaTag> tags)
    : file_(std::move(file)),
      settings_(std::move(settings)),
      tracks_(std::move(tracks)),
      attachments_(std::move(attachments)),
      tags_(std::move(tags)),
      stream_(file_, std::ios::binary | std::ios::trunc) {}

Result<MatroskaWriter> MatroskaWriter::create(const std::filesystem::path& file,
                                              MatroskaSettings settings,
                                              std::vector<MatroskaTrack> tracks,
                                              std::vector<MatroskaAttachment> attachments,
                                              std::vector<MatroskaTag> tags) {
  MR_ASSERT(!tracks.empty() && settings.tick.count() > 0);
  MR_ASSERT(settings.title.size() + settings.writing_app.size() < kInfoRoom / 2);
  MatroskaWriter writer(file, std::move(settings), std::move(tracks), std::move(attachments),
                        std::move(tags));
  if (const Status begun = writer.begin(); !begun) return begun.error();
  return writer;
}

Status MatroskaWriter::begin() {
  EbmlBytes head = ebml_header();
  put_big_endian(head, kSegment, 4);
  put_big_endian(head, kUnknownSize, 8);
  segment_at_ = head.size();
  put_bytes(head, void_element(kSeekRoom + kVoidHeader));
  put_bytes(head, void_element(kInfoRoom + kVoidHeader));
  if (const Status ok = put(head); !ok) return ok;
  if (const Status ok = put_top(kTracks, track_entries(tracks_)); !ok) return ok;
  if (settings_.tags_first)
    if (const Status ok = put_attachments_and_tags(); !ok) return ok;
  return put(void_element(kTagRoom + kVoidHeader));
}

Status MatroskaWriter::put(const Bytes& bytes) {
  stream_.write(reinterpret_cast<const char*>(bytes.data()),
                static_cast<std::streamsize>(bytes.size()));
  at_ += bytes.size();
  if (stream_) return {};
  return Error{Error::Cause::io, "cannot write " + file_.string() + ": " + std::strerror(errno)};
}

/// An element of the segment; where it lies is kept for the list of positions.
Status MatroskaWriter::put_top(std::uint32_t id, const Bytes& content) {
  positions_.push_back({id, in_segment()});
  Bytes element;
  put_element(element, id, content);
  return put(element);
}

Status MatroskaWriter::put_attachments_and_tags() {
  if (!attachments_.empty())
    if (const Status ok = put_top(kAttachments, attached_files(attachments_)); !ok) return ok;
  Bytes tags = tag_entries(tags_);
  if (settings_.checksums) {
    Bytes sum = checksum_of(tags);
    tags.insert(tags.begin(), sum.begin(), sum.end());
  }
  return put_top(kTags, tags);
}

Status MatroskaWriter::write_frame(std::uint64_t track, Time at, Frame frame) {
  return add_block(track, at, frame, {}, kKeyFrame, false);
}

Status MatroskaWriter::write_group(std::uint64_t track, Time at, Time duration,
                                   std::span<const Frame> frames, MatroskaLacing lacing) {
  const std::size_t most = lacing == MatroskaLacing::none ? 1 : 256;
  if (frames.empty() || frames.size() > most)
    return invalid_call(file_, "a block holds 1 to " + std::to_string(most) + " frames");
  if (lacing == MatroskaLacing::fixed)
    for (const Frame& frame : frames)
      if (frame.size() != frames[0].size())
        return invalid_call(file_, "fixed lacing wants frames of one size");
  Bytes payload = lace_head(frames, lacing), after;
  for (const Frame& frame : frames) put_bytes(payload, frame);
  put_number(after, kBlockDuration, duration / settings_.tick);
  return add_block(track, at, payload, after, static_cast<std::uint8_t>(lacing) << 1, true);
}

Status MatroskaWriter::add_block(std::uint64_t track, Time at, Frame payload, const Bytes& after,
                                 std::uint8_t flags, bool is_group) {
  const std::int64_t tick = settings_.tick.count(), ticks = (at.count() + tick / 2) / tick;
  if (at.count() < 0) return invalid_call(file_, "times must not be negative");
  const auto fits = [&] {
    const std::int64_t after_start = ticks - cluster_ticks_;
    return after_start >= -32768 && after_start <= 32767 &&
           after_start * settings_.tick < settings_.cluster_span;
  };
  if (cluster_ticks_ >= 0 && !fits())
    if (const Status ok = flush_cluster(); !ok) return ok;
  if (cluster_ticks_ < 0) {
    cluster_ticks_ = ticks;
    put_number(cluster_, kTimestamp, ticks);
  }
  last_ticks_ = std::max(last_ticks_, ticks);
  const bool is_due =
      cues_.empty() || (ticks - cues_.back().ticks) * settings_.tick >= settings_.cue_every;
  if (track == tracks_[0].number && is_due) cues_.push_back({ticks, in_segment()});
  Bytes block, group;
  put_varint(block, track);
  put_big_endian(block, static_cast<std::uint16_t>(ticks - cluster_ticks_), 2);
  block.push_back(std::byte{flags});
  put_bytes(block, payload);
  if (!is_group) {
    put_element(cluster_, kSimpleBlock, block);
    return {};
  }
  put_element(group, kBlock, block);
  put_bytes(group, after);
  put_element(cluster_, kBlockGroup, group);
  return {};
}

Status MatroskaWriter::flush_cluster() {
  if (cluster_ticks_ < 0) return {};
  Bytes head;
  const Bytes sum = settings_.checksums ? checksum_of(cluster_) : Bytes{};
  put_big_endian(head, kCluster, 4);
  put_varint(head, sum.size() + cluster_.size());
  put_bytes(head, sum);
  cluster_ticks_ = -1;
  const Status ok = put(head);
  const Status written = ok ? put(cluster_) : ok;
  cluster_.clear();
  return written;
}

Status MatroskaWriter::skip(std::uint64_t bytes) {
  if (const Status ok = flush_cluster(); !ok) return ok;
  constexpr std::uint64_t kLeast = 16;  // the header, and the byte that makes the hole real
  if (bytes < kLeast) return invalid_call(file_, "skip at least 16 bytes");
  const Bytes head = void_header(bytes);
  if (const Status ok = put(head); !ok) return ok;
  at_ += bytes - head.size() - 1;
  stream_.seekp(static_cast<std::streamoff>(at_));
  return put({std::byte{0}});
}

Status MatroskaWriter::close() {
  if (const Status ok = flush_cluster(); !ok) return ok;
  if (!settings_.tags_first)
    if (const Status ok = put_attachments_and_tags(); !ok) return ok;
  Bytes cues;
  for (const Cue& cue : cues_) {
    Bytes place, point;
    put_number(place, kCueTrack, tracks_[0].number);
    put_number(place, kCueClusterPosition, cue.cluster_at);
    put_number(point, kCueTime, cue.ticks);
    put_element(point, kCueTrackPositions, place);
    put_element(cues, kCuePoint, point);
  }
  if (settings_.cues && !cues_.empty())
    if (const Status ok = put_top(kCues, cues); !ok) return ok;
  if (const Status ok = fill_kept_room(); !ok) return ok;
  stream_.close();
  if (stream_) return {};
  return Error{Error::Cause::io, "cannot write " + file_.string() + ": " + std::strerror(errno)};
}

/// The segment's size, the list of positions and Info, at the front.
Status MatroskaWriter::fill_kept_room() {
  const auto padded = [](Bytes bytes, std::uint64_t room) {
    MR_ASSERT(bytes.size() + 2 <= room);
    const Bytes rest = void_element(room - bytes.size());
    put_bytes(bytes, rest);
    return bytes;
  };
  const Bytes info = padded(info_of(settings_, last_ticks_), kInfoRoom + kVoidHeader);
  positions_.insert(positions_.begin(), {kInfo, kSeekRoom + kVoidHeader});
  Bytes seeks, size, head;
  for (const Position& position : positions_) {
    Bytes seek, id;
    put_big_endian(id, position.id, byte_count(position.id));
    put_element(seek, kSeekId, id);
    put_number(seek, kSeekPosition, position.at);
    put_element(seeks, kSeek, seek);
  }
  put_element(head, kSeekHead, seeks);
  put_varint(size, in_segment(), 8);
  if (settings_.known_size) {
    stream_.seekp(static_cast<std::streamoff>(segment_at_ - 8));
    if (const Status ok = put(size); !ok) return ok;
  }
  stream_.seekp(static_cast<std::streamoff>(segment_at_));
  if (const Status ok = put(padded(head, kSeekRoom + kVoidHeader)); !ok) return ok;
  return put(info);
}

}  // namespace mr::kit
