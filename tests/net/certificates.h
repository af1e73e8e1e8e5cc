#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "core/temp_dir.h"

namespace mr::test {

/// Certificates as docs/security.md makes them, with the openssl command: "NAME.pem", "NAME.key".
class Certificates {
 public:
  Certificates() {
    run("req -x509 " + new_key("ca") + " -out ca.pem -days 30 -subj /CN=ca");
    run("req -x509 " + new_key("other") + " -out other.pem -days 30 -subj /CN=other");
  }
  /// One signed by `ca` for these names: "DNS:localhost,IP:127.0.0.1".
  void sign(const std::string& name, const std::string& names, int days = 30) {
    run("req " + new_key(name) + " -out " + name + ".csr -subj /CN=" + name +
        " -addext subjectAltName=" + names);
    run("x509 -req -in " + name + ".csr -CA ca.pem -CAkey ca.key -CAcreateserial -out " + name +
        ".pem -copy_extensions copy -days " + std::to_string(days));
  }
  std::filesystem::path operator/(const std::string& name) const { return dir_ / name; }
  const TempDir& folder() const { return dir_; }

 private:
  static std::string new_key(const std::string& name) {
    return "-newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -keyout " + name + ".key";
  }
  void run(const std::string& words) const {
    const std::string line =
        "cd " + dir_.path().string() + " && openssl " + words + " >openssl.log 2>&1";
    EXPECT_EQ(std::system(line.c_str()), 0) << line;
  }

  TempDir dir_;
};

}  // namespace mr::test
