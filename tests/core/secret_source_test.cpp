#include "mr/core/secret_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdlib>

#include "core/temp_dir.h"

namespace mr {
namespace {

using testing::HasSubstr;

class Secret : public testing::Test {
 protected:
  ~Secret() override { ::unsetenv("MR_TEST_SECRET"); }

  SecretSource file(const std::string& text, unsigned mode = 0600) {
    const auto path = dir_.write("secret", text);
    EXPECT_EQ(::chmod(path.c_str(), static_cast<::mode_t>(mode)), 0);
    return {{}, path};
  }
  static SecretSource variable(const char* text) {
    ::setenv("MR_TEST_SECRET", text, 1);
    return {"MR_TEST_SECRET", {}};
  }
  /// The error of a source that cannot be read: one line, which does not hold the secret.
  static std::string refusal(const SecretSource& source) {
    const auto secret = read_secret(source);
    if (secret) return "read " + *secret;
    EXPECT_EQ(secret.error().message.find('\n'), std::string::npos);
    EXPECT_EQ(secret.error().message.find("sesame"), std::string::npos);
    return secret.error().message;
  }

  test::TempDir dir_;
};

TEST_F(Secret, IsReadWithoutWhiteSpaceAroundIt) {
  EXPECT_EQ(*read_secret(file(" open sesame\r\n\n")), "open sesame");
  EXPECT_EQ(*read_secret(file("sesame", 0400)), "sesame");
  EXPECT_EQ(*read_secret(variable("\topen sesame ")), "open sesame");
  EXPECT_EQ(read_secret(file(std::string(65536, 'x')))->size(), 65536u);
}

TEST_F(Secret, ARefusalNamesTheSourceAndNeverTheSecret) {
  EXPECT_THAT(refusal({}), HasSubstr("no secret is named"));
  EXPECT_THAT(refusal({"MR_NOT_SET_EITHER", {}}),
              HasSubstr("secret in environment variable MR_NOT_SET_EITHER: is not set"));
  EXPECT_THAT(refusal(variable(" \n")), HasSubstr("MR_TEST_SECRET: is empty"));
  EXPECT_THAT(refusal(variable(("sesame" + std::string(65536, 'x')).c_str())),
              HasSubstr("more than 64 kB"));
  EXPECT_THAT(refusal({{}, dir_ / "nobody"}), HasSubstr("nobody: cannot read: No such file"));
  EXPECT_THAT(refusal({{}, dir_.path()}), HasSubstr("is no file"));
  EXPECT_THAT(refusal(file("\n")), HasSubstr("is empty"));
  EXPECT_THAT(refusal(file("sesame" + std::string(65536, 'x'))), HasSubstr("more than 64 kB"));
  EXPECT_EQ(read_secret({{}, dir_ / "nobody"}).error().cause, Error::Cause::not_found);
  for (const unsigned mode : {0640u, 0604u, 0620u, 0644u, 0601u})
    EXPECT_THAT(refusal(file("sesame", mode)), HasSubstr("chmod 600 " + (dir_ / "secret").string()))
        << mode;
}

}  // namespace
}  // namespace mr
