#include "mr/net/certificate.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/sha.h>
#include <openssl/x509v3.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <utility>

#include "mr/core/file.h"

namespace mr::net {
namespace {

template <auto free_it>
struct OpensslDeleter {
  template <typename T>
  void operator()(T* thing) const {
    free_it(thing);
  }
};
using Bio = std::unique_ptr<BIO, OpensslDeleter<BIO_free>>;
using Key = std::unique_ptr<EVP_PKEY, OpensslDeleter<EVP_PKEY_free>>;
using X = std::unique_ptr<X509, OpensslDeleter<X509_free>>;

constexpr long kDaySeconds = 24 * 3600;
constexpr int kRenewDays = 30, kWarnDays = 7;
constexpr std::size_t kMostPem = 1u << 20;

Error failed(const std::string& what) {
  std::array<char, 256> text{};
  ERR_error_string_n(ERR_get_error(), text.data(), text.size());
  return {Error::Cause::io, what + ": " + text.data()};
}

std::string text_of(BIO* bio) {
  char* data = nullptr;
  const long size = BIO_get_mem_data(bio, &data);
  return {data, static_cast<std::size_t>(std::max(size, 0L))};
}

X first_of(const std::string& chain_pem) {
  const Bio bio(BIO_new_mem_buf(chain_pem.data(), static_cast<int>(chain_pem.size())));
  return X(PEM_read_bio_X509(bio.get(), nullptr, nullptr, nullptr));
}

Key key_of(const std::string& pem) {
  const Bio bio(BIO_new_mem_buf(pem.data(), static_cast<int>(pem.size())));
  return Key(PEM_read_bio_PrivateKey(bio.get(), nullptr, nullptr, nullptr));
}

bool is_number(const std::string& name) {
  std::array<unsigned char, 16> bytes{};
  return ::inet_pton(AF_INET, name.c_str(), bytes.data()) == 1 ||
         ::inet_pton(AF_INET6, name.c_str(), bytes.data()) == 1;
}

bool add_extension(X509* certificate, int kind, const std::string& value) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  X509V3_set_ctx(&context, certificate, certificate, nullptr, nullptr, 0);
  X509_EXTENSION* extension = X509V3_EXT_conf_nid(nullptr, &context, kind, value.c_str());
  const bool added = extension != nullptr && X509_add_ext(certificate, extension, -1) == 1;
  X509_EXTENSION_free(extension);
  return added;
}

bool fill(X509* certificate, EVP_PKEY* key, const std::vector<std::string>& names, int days) {
  std::uint64_t serial = 0;
  RAND_bytes(reinterpret_cast<unsigned char*>(&serial), sizeof serial);
  std::string alternatives;
  for (const std::string& name : names)
    alternatives +=
        (alternatives.empty() ? "" : ",") + std::string(is_number(name) ? "IP:" : "DNS:") + name;
  X509_NAME* subject = X509_get_subject_name(certificate);
  const auto* common = reinterpret_cast<const unsigned char*>("MeshReduce gateway");
  return X509_set_version(certificate, X509_VERSION_3) == 1 &&
         ASN1_INTEGER_set_uint64(X509_get_serialNumber(certificate), serial >> 1) == 1 &&
         X509_gmtime_adj(X509_getm_notBefore(certificate), -2 * kDaySeconds) != nullptr &&
         X509_gmtime_adj(X509_getm_notAfter(certificate), days * kDaySeconds) != nullptr &&
         X509_NAME_add_entry_by_txt(subject, "CN", MBSTRING_ASC, common, -1, -1, 0) == 1 &&
         X509_set_issuer_name(certificate, subject) == 1 &&
         X509_set_pubkey(certificate, key) == 1 &&
         add_extension(certificate, NID_basic_constraints, "critical,CA:FALSE") &&
         add_extension(certificate, NID_key_usage, "critical,digitalSignature") &&
         add_extension(certificate, NID_ext_key_usage, "serverAuth") &&
         add_extension(certificate, NID_subject_alt_name, alternatives) &&
         X509_sign(certificate, key, EVP_sha256()) > 0;
}

bool speaks_for(X509* certificate, const std::string& name) {
  return is_number(name) ? X509_check_ip_asc(certificate, name.c_str(), 0) == 1
                         : X509_check_host(certificate, name.c_str(), name.size(), 0, nullptr) == 1;
}

/// Days until the certificate expires; negative: it has expired.
int days_left(const X509* certificate) {
  int days = 0, seconds = 0;
  if (ASN1_TIME_diff(&days, &seconds, nullptr, X509_get0_notAfter(certificate)) != 1) return -1;
  return seconds < 0 ? days - 1 : days;
}

Result<std::string> read_pem(const std::filesystem::path& file) {
  const auto bytes = read_file(file, kMostPem);
  if (!bytes) return bytes.error();
  return std::string(reinterpret_cast<const char*>(bytes->data()), bytes->size());
}

/// Writes a file that only its owner can ever read, atomically.
bool write_private(const std::filesystem::path& file, const std::string& text) {
  const std::string draft = file.string() + ".new";
  ::unlink(draft.c_str());
  const int handle = ::open(draft.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (handle < 0) return false;
  const bool is_written =
      ::write(handle, text.data(), text.size()) == static_cast<::ssize_t>(text.size());
  ::close(handle);
  return is_written && ::rename(draft.c_str(), file.c_str()) == 0;
}

}  // namespace

Result<Certificate> make_certificate(const std::vector<std::string>& names, int days) {
  const Key key(EVP_PKEY_Q_keygen(nullptr, nullptr, "EC", "P-256"));
  const X certificate(X509_new());
  if (!key || !certificate || !fill(certificate.get(), key.get(), names, days))
    return failed("a certificate cannot be made");
  const Bio chain(BIO_new(BIO_s_mem())), secret(BIO_new(BIO_s_mem()));
  if (PEM_write_bio_X509(chain.get(), certificate.get()) != 1 ||
      PEM_write_bio_PrivateKey(secret.get(), key.get(), nullptr, nullptr, 0, nullptr, nullptr) != 1)
    return failed("a certificate cannot be written");
  return Certificate{text_of(chain.get()), text_of(secret.get())};
}

Result<Certificate> load_or_make_certificate(const std::filesystem::path& folder,
                                             const std::vector<std::string>& names,
                                             const std::vector<std::string>& needed) {
  if (folder.empty()) return make_certificate(names);
  const auto chain = folder / "gateway.crt", key = folder / "gateway.key";
  if (auto kept = load_certificate(chain, key)) {
    const X first = first_of(kept->chain_pem);
    const bool fits = std::all_of(needed.begin(), needed.end(),
                                  [&](const auto& name) { return speaks_for(first.get(), name); });
    if (fits && days_left(first.get()) >= kRenewDays) return kept;
  }
  auto made = make_certificate(names);
  if (!made) return made;
  std::error_code ignored;
  std::filesystem::create_directories(folder, ignored);
  // If it cannot be stored, the next run makes another one.
  if (write_private(key, made->key_pem)) write_private(chain, made->chain_pem);
  return made;
}

Result<Certificate> load_certificate(const std::filesystem::path& chain,
                                     const std::filesystem::path& key) {
  auto chain_pem = read_pem(chain);
  if (!chain_pem) return chain_pem.error();
  auto key_pem = read_pem(key);
  if (!key_pem) return key_pem.error();
  const X first = first_of(*chain_pem);
  if (!first)
    return Error{Error::Cause::invalid, chain.string() + " holds no certificate in PEM form"};
  const Key secret = key_of(*key_pem);
  if (!secret)
    return Error{Error::Cause::invalid,
                 key.string() + " holds no private key in PEM form, or one with a password"};
  if (X509_check_private_key(first.get(), secret.get()) != 1)
    return Error{Error::Cause::invalid,
                 "the key " + key.string() + " is not that of the certificate " + chain.string()};
  return Certificate{*std::move(chain_pem), *std::move(key_pem)};
}

Result<std::string> fingerprint(const Certificate& certificate) {
  const X first = first_of(certificate.chain_pem);
  std::array<unsigned char, SHA256_DIGEST_LENGTH> digest{};
  if (!first || X509_digest(first.get(), EVP_sha256(), digest.data(), nullptr) != 1)
    return Error{Error::Cause::invalid, "no certificate"};
  constexpr char kHex[] = "0123456789ABCDEF";
  std::string out;
  for (const unsigned char byte : digest) {
    if (!out.empty()) out += ':';
    out += {kHex[byte >> 4], kHex[byte & 15]};
  }
  return out;
}

std::string expiry_warning(const Certificate& certificate) {
  const X first = first_of(certificate.chain_pem);
  if (!first) return {};
  const int days = days_left(first.get());
  if (days < 0) return "the certificate has expired: browsers will refuse it";
  if (days < kWarnDays) return "the certificate expires in " + std::to_string(days) + " days";
  return {};
}

}  // namespace mr::net
