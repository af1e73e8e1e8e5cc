#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "mr/core/result.h"

namespace mr::net {

/// What a TLS server shows and proves: a chain of certificates, its own first, and its private key,
/// as PEM texts.
struct Certificate {
  std::string chain_pem, key_pem;
};

/// A new certificate that speaks for these names and addresses, signed by itself (EC P-256), for so
/// many days (397: the most that browsers take). io: the library failed.
Result<Certificate> make_certificate(const std::vector<std::string>& names, int days = 397);

/// The one in the folder, made there where there is none, or where it expires within a month or
/// does not speak for all that is `needed`. Browsers that were told to trust it know it again after
/// a restart, also where the machine's addresses among `names` are others then. io: it could not be
/// made; where it only cannot be kept, or the folder is empty, it is good for this run.
Result<Certificate> load_or_make_certificate(const std::filesystem::path& folder,
                                             const std::vector<std::string>& names,
                                             const std::vector<std::string>& needed = {});

/// From two PEM files. io, invalid: they cannot be read, or do not fit each other.
Result<Certificate> load_certificate(const std::filesystem::path& chain,
                                     const std::filesystem::path& key);

/// SHA-256 of the first certificate, as browsers show it: "AB:CD:…". invalid: there is none.
Result<std::string> fingerprint(const Certificate& certificate);

/// What a person should know of it: that it has expired, or does within a week; else empty.
std::string expiry_warning(const Certificate& certificate);

}  // namespace mr::net
