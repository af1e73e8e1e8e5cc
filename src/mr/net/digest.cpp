#include "mr/net/digest.h"

#include <openssl/crypto.h>
#include <openssl/sha.h>

namespace mr::net {

Sha256 sha256(const std::string& text) {
  Sha256 digest{};
  ::SHA256(reinterpret_cast<const unsigned char*>(text.data()), text.size(), digest.data());
  return digest;
}

bool is_equal_in_constant_time(const Sha256& a, const Sha256& b) {
  return ::CRYPTO_memcmp(a.data(), b.data(), a.size()) == 0;
}

}  // namespace mr::net
