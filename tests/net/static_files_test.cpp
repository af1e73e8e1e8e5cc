#include "mr/net/static_files.h"

#include <gtest/gtest.h>

#include "core/temp_dir.h"

namespace mr::net {
namespace {

class StaticFiles : public testing::Test {
 protected:
  StaticFiles() {
    dir_.write("root/index.html", "<html>");
    dir_.write("root/assets/app-1a2b.js", "js");
    dir_.write("root/assets/draco.wasm", "wasm");
    dir_.write("root/a b.txt", "space");
    dir_.write("root/..hidden", "dots");
    dir_.write("root2/secret", "secret");
    dir_.write("secret", "secret");
    std::filesystem::create_symlink(dir_ / "secret", dir_ / "root/link");
    std::filesystem::create_directory_symlink(dir_ / "root2", dir_ / "root/folder");
  }

  Result<StaticFile> find(const std::string& target) const {
    return find_static_file(dir_ / "root", target);
  }

  test::TempDir dir_;
};

TEST_F(StaticFiles, FindsFilesAndTheirTypes) {
  EXPECT_EQ(find("/")->mime, "text/html; charset=utf-8");
  EXPECT_EQ(find("/index.html?x=/../../secret")->path.filename(), "index.html");
  EXPECT_FALSE(find("/")->immutable);
  EXPECT_EQ(find("/assets/app-1a2b.js")->mime, "text/javascript; charset=utf-8");
  EXPECT_TRUE(find("/assets/app-1a2b.js")->immutable);
  EXPECT_EQ(find("/assets/draco.wasm")->mime, "application/wasm");
  EXPECT_TRUE(find("/a%20b.txt"));
  EXPECT_TRUE(find("/..hidden"));
}

TEST_F(StaticFiles, NothingOutsideOfTheRoot) {
  for (const char* target :
       {"/../secret", "/assets/../../secret", "/%2e%2e/secret", "/..%2fsecret", "/%2E%2E%2Fsecret",
        "/../root2/secret", "//../secret", "/link", "/folder/secret", "/assets/..", "/assets",
        "/nowhere", "/assets/", "//etc/passwd", "/index.html/"})
    EXPECT_FALSE(find(target)) << target;
  EXPECT_FALSE(find_static_file(dir_ / "no such root", "/"));
}

TEST_F(StaticFiles, RefusesBrokenTargets) {
  for (const std::string target : {"", "index.html", "http://x/", "/%", "/%4", "/%zz", "/%00",
                                   "/a%0ab", "/..\\secret", "/%5c", "*"}) {
    const auto file = find(target);
    ASSERT_FALSE(file) << target;
    EXPECT_EQ(file.error().cause, Error::Cause::invalid) << target;
  }
}

}  // namespace
}  // namespace mr::net
