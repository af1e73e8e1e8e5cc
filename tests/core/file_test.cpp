#include "mr/core/file.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>

#include <iterator>

#include "core/temp_dir.h"

namespace mr {
namespace {

std::size_t entries(const std::filesystem::path& folder) {
  return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(folder), {}));
}

std::string text_of(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

TEST(File, ComesBackAsWritten) {
  const test::TempDir dir;
  const std::string text("a\0b\n\xff", 5);
  ASSERT_TRUE(write_file(dir / "x.bin", text));
  const auto bytes = read_file(dir / "x.bin");
  ASSERT_TRUE(bytes);
  EXPECT_EQ(text_of(*bytes), text);
  EXPECT_EQ(entries(dir.path()), 1u);

  ASSERT_TRUE(write_file(dir / "x.bin", std::string("new")));
  EXPECT_EQ(text_of(*read_file(dir / "x.bin")), "new");
}

TEST(File, AnEmptyFileIsEmptyBytes) {
  const test::TempDir dir;
  ASSERT_TRUE(write_file(dir / "empty", std::string()));
  const auto bytes = read_file(dir / "empty");
  ASSERT_TRUE(bytes);
  EXPECT_TRUE(bytes->empty());
}

TEST(File, TooLargeIsRefusedAtTheLimit) {
  const test::TempDir dir;
  dir.write("ten", "0123456789");
  EXPECT_TRUE(read_file(dir / "ten", 10));
  const auto refused = read_file(dir / "ten", 9);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().cause, Error::Cause::too_large);
  EXPECT_NE(refused.error().message.find("ten"), std::string::npos);
}

TEST(File, MissingAndFolderAreNamed) {
  const test::TempDir dir;
  const auto missing = read_file(dir / "nobody");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().cause, Error::Cause::not_found);
  EXPECT_NE(missing.error().message.find("nobody"), std::string::npos);

  const auto folder = read_file(dir.path());
  ASSERT_FALSE(folder);
  EXPECT_EQ(folder.error().cause, Error::Cause::io);
}

TEST(File, WritingIntoAMissingFolderFailsAndLeavesNothing) {
  const test::TempDir dir;
  const Status status = write_file(dir / "no/such/x", std::string("text"));
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().cause, Error::Cause::not_found);
  EXPECT_EQ(entries(dir.path()), 0u);
}

TEST(File, AFailedRenameLeavesNoPartialFile) {
  const test::TempDir dir;
  std::filesystem::create_directories(dir / "target/full");
  EXPECT_FALSE(write_file(dir / "target", std::string("text")));
  EXPECT_EQ(entries(dir.path()), 1u) << "only the folder that stood there";
}

/// A limit on the size of files fails a write like a full disk does.
TEST(File, AWriteCutShortKeepsTheOldFile) {
  const test::TempDir dir;
  ASSERT_TRUE(write_file(dir / "x", std::string("old")));
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto old_handler = ::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{4096, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
  const Status status = write_file(dir / "x", std::string(1 << 20, 'n'));
  ::setrlimit(RLIMIT_FSIZE, &before);
  ::signal(SIGXFSZ, old_handler);

  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().cause, Error::Cause::io);
  EXPECT_EQ(text_of(*read_file(dir / "x")), "old");
  EXPECT_EQ(entries(dir.path()), 1u);
}

}  // namespace
}  // namespace mr
