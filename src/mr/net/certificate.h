#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "mr/core/result.h"

namespace mr::net {

/// A TLS server's identity as PEM texts: its chain of certificates, its own first, and the private
/// key of that one.
struct Certificate {
  std::string chain_pem, key_pem;
};

/// A new self-signed certificate (EC P-256) whose subject alternative names are `names`: DNS names
/// and IP addresses. Valid for `days` (397: the most that browsers accept). io: OpenSSL failed.
Result<Certificate> make_certificate(const std::vector<std::string>& names, int days = 397);

/// The self-signed certificate stored in `folder`. Made and stored there when there is none, when
/// it expires within a month, or when it lacks one of the names `needed`. So a browser in which a
/// person accepted it accepts it after a restart too, even when the machine's addresses among
/// `names` have changed. An empty `folder`, or one that cannot be written: the certificate lasts
/// for this run. io: it could not be made.
Result<Certificate> load_or_make_certificate(const std::filesystem::path& folder,
                                             const std::vector<std::string>& names,
                                             const std::vector<std::string>& needed = {});

/// Reads a certificate chain and its private key from two PEM files. io: a file cannot be read;
/// invalid: it is no PEM, or the key is not that of the first certificate.
Result<Certificate> load_certificate(const std::filesystem::path& chain,
                                     const std::filesystem::path& key);

/// SHA-256 fingerprint of the first certificate in the form browsers show: "AB:CD:…". invalid: the
/// chain is empty.
Result<std::string> fingerprint(const Certificate& certificate);

/// A warning if the certificate has expired or will within a week; else empty.
std::string expiry_warning(const Certificate& certificate);

}  // namespace mr::net
